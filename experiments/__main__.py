"""The command `torchvsa`, as a module: `python -m experiments corral`."""

from experiments.main import main

main()
