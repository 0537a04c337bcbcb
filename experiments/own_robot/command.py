"""The command `torchvsa learn`."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

from behaviours.commands.learn import learn, options_of, proposed
from behaviours.progress import Progress, in_steps
from experiments.kit.console import wide_console
from experiments.own_robot.tables import score_table


def learn_log(arguments: Sequence[str]) -> int:
    """Learn a log as the arguments of the command line say, and print how well; or only propose its schema."""
    options = options_of(arguments)
    if options.propose is not None:
        print(f"{proposed(options)} says what each column is; correct it, and learn with --schema {options.propose}")
        return 0
    learned = learn(options, shown_progress)
    score_table(learned).print(wide_console())
    written = str(options.output)
    if options.page is not None:
        from experiments.own_robot.page import write_page  # which imports what draws

        written += f" and {write_page(learned, options.page)}"
    print(f"{written} written; answer rows with: torchvsa ask {options.output}")
    return 0


def shown_progress(what: str) -> Progress:
    """Progress of a part of the work on stderr: one line on a terminal, otherwise a line for each tenth."""
    began, terminal = time.monotonic(), sys.stderr.isatty()

    def tell(fraction: float) -> None:
        line = f"{what}: {fraction:4.0%}, {time.monotonic() - began:.0f} s"
        print(f"\r{line}" if terminal else line, end="\n" if not terminal or fraction >= 1 else "", file=sys.stderr)
        sys.stderr.flush()

    show = in_steps(tell, 100 if terminal else 10)
    show(0.0)
    return show
