"""Errors of this package."""


class ShapeError(ValueError):
    """A tensor's shape does not fit; the message names the argument, its shape, and the expected one."""
