"""Damaged and forged files are refused with a word about the file, or keep every promise.

`make fuzz` tries 200,000 of them.
"""

import pytest
from file_damage import DAMAGES
from mutants import verdicts

BLOCK = 500


@pytest.mark.parametrize("start", range(0, 1000, BLOCK))
def test_mutants_are_refused_or_sound(start: int) -> None:
    counts = verdicts(range(start, start + BLOCK))
    assert counts.total() == BLOCK
    assert {damage for damage, _ in counts} == set(DAMAGES)
    assert {what for _, what in counts} == {"refused", "loaded"}, counts
