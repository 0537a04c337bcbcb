"""`python -m experiments.corral` is `torchvsa corral`."""

from experiments.corral.study import study
from experiments.kit.command import run_study

run_study(study)
