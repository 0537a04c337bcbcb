from dataclasses import dataclass


@dataclass
class Range:
    range: float = 0.0
