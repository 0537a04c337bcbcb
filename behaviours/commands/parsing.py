"""Arguments of a command whose mistakes become one line."""

import argparse
from typing import NoReturn


class OneLineParser(argparse.ArgumentParser):
    """An argument parser that raises `ValueError` for a mistake, instead of printing the usage and leaving."""

    def error(self, message: str) -> NoReturn:
        """Raise `ValueError` with the mistake, and where to look."""
        raise ValueError(f"{message}; see {self.prog} --help")
