"""How a study behaves as a command."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, cast

from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console

from experiments.results import Results, finished

TRACEBACK_WANTED = os.environ.get("HYDRA_FULL_ERROR") == "1"
"""Whether the user asked Hydra for whole tracebacks, read before this module sets the same variable."""


@contextmanager
def errors_in_one_line(name: str) -> Iterator[None]:
    """What the user can mend is told in one line on stderr, with exit status 1.

    With HYDRA_FULL_ERROR=1 in the environment the whole traceback is shown instead.
    """
    os.environ["HYDRA_FULL_ERROR"] = "1"  # makes Hydra raise, instead of printing a report of several lines itself
    try:
        yield
    except (HydraException, OmegaConfBaseException, ValueError, TypeError, OSError) as error:
        if TRACEBACK_WANTED:
            raise
        print(f"{name}: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(1)


def job(
    cfg: DictConfig,
    name: str,
    study: Callable[[dict[str, Any], Path, Console], Results],
    print_table: Callable[[Results, Console], None],
) -> None:
    """Run one job of a study in its run directory, unless the results of these settings lie there already.

    `study` writes its results and its `report.html` to the folder that it is given; `print_table` shows them on the
    terminal. `name` is the command's, for errors.
    """
    console = Console()
    if not console.is_terminal:
        console.width = 150  # a file has no width of its own; the tables need this much
    config = cast(dict[str, Any], OmegaConf.to_container(cfg, resolve=True))
    folder = Path(HydraConfig.get().runtime.output_dir)
    if finished(folder, config):
        console.print(f"{folder} holds the results of these settings already; nothing to do")
        return
    # A sweep goes on after a job that failed, and Hydra then says which one it was.
    with errors_in_one_line(name) if HydraConfig.get().mode == RunMode.RUN else nullcontext():
        results = study(config, folder, console)
    print_table(results, console)
    console.print(f"{folder / 'report.html'} shows it; results.json and records.parquet lie beside it", soft_wrap=True)
