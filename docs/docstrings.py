"""Docstrings in Markdown, as reStructuredText: tables, and indented blocks of code or formulas."""

import re


def converted(lines: list[str]) -> list[str]:
    """The lines of a docstring, after its sections were converted by napoleon."""
    made: list[str] = []
    place = 0
    while place < len(lines):
        line = lines[place]
        if _row(line) and place + 1 < len(lines) and re.fullmatch(r"\s*\|[\s:|-]+\|\s*", lines[place + 1]):
            end = place
            while end < len(lines) and _row(lines[end]):
                end += 1
            made += ["", *_table(lines[place:end]), ""]
            place = end
        elif _begins_block(lines, place):
            indent = _indent(line)
            made += [" " * (indent - 4) + "::", ""]
            while place < len(lines) and (not lines[place].strip() or _indent(lines[place]) >= indent):
                made.append(lines[place])
                place += 1
            made.append("")
        else:
            made.append(_escaped(line))
            place += 1
    return made


def _escaped(line: str) -> str:
    """The line without bars that would begin a substitution, as in |x - y|; code between backticks stays as it is."""
    parts = line.split("`")
    return "`".join(part if place % 2 else part.replace("|", "\\|") for place, part in enumerate(parts))


def _row(line: str) -> bool:
    return line.strip().startswith("|") and line.strip().endswith("|") and len(line.strip()) > 1


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def _table(rows: list[str]) -> list[str]:
    margin = " " * _indent(rows[0])
    cells = [re.split(r"(?<!\\)\|", row.strip()[1:-1]) for row in (rows[0], *rows[2:])]
    made = [f"{margin}.. list-table::", f"{margin}   :header-rows: 1", ""]
    for row in cells:
        for place, cell in enumerate(row):
            made.append(f"{margin}   {'* -' if place == 0 else '  -'} {cell.strip()}")
    return made


def _begins_block(lines: list[str], place: int) -> bool:
    """Whether an indented block begins here that no directive, list or field explains."""
    line = lines[place]
    if (
        place == 0
        or not line.strip()
        or lines[place - 1].strip()
        or line.lstrip().startswith(("* -", "- ", ">>>", ".."))
    ):
        return False
    before = next((one for one in reversed(lines[:place]) if one.strip()), "")
    explained = before.lstrip().startswith((":", "..", "- ", "* ")) or before.rstrip().endswith("::")
    return not explained and _indent(line) >= _indent(before) + 4
