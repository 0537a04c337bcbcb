"""What Hydra reads; a package, so that an installed wheel carries it."""
