"""Errors that tell a person what was given, what was expected, and what to do."""


class ShapeError(ValueError):
    """A tensor's shape does not fit; the message names the argument, its shape, and the expected one."""
