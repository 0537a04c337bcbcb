"""`python -m experiments.corral` is `torchvsa corral`."""

from experiments.main import corral

corral()
