"""What the command `torchvsa` does with files: `ask` and `show`."""
