"""The command `python -m benchmarks`."""

import argparse
import json
import platform
from pathlib import Path
from typing import Any

import torch

from behaviours.storage import write_atomically
from benchmarks.isolated import isolated
from benchmarks.report import WIDTH, draw, fill, print_rows
from benchmarks.works import FIT_TIMES, GROWTH, KEPT, ON_THE_CPU, WORKS, measure
from experiments.kit.console import wide_console

FOLDER = Path(__file__).parent


def main() -> None:
    """Measure and print the table; a whole run writes `results.json` and draws it into `docs/` too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Speed beside peers.")
    parser.add_argument("--only", nargs="+", choices=[*WORKS, GROWTH, FIT_TIMES], help="print these works alone")
    parser.add_argument("--threads", nargs="+", type=int, help="1 and 2 by default; on a GPU, which has its own, 1")
    parser.add_argument("--repeats", type=int, default=7, help="timed runs of each call, after one to warm up")
    parser.add_argument("--device", choices=["cpu", "cuda"], default="cpu")
    parser.add_argument("--small", action="store_true", help="print tiny sizes, to see that all works")
    parser.add_argument("--out", type=Path, help="write the rows here; a whole run does, into results.json")
    parser.add_argument("--docs", type=Path, help="fill benchmarks.md here, and draw; a whole run does, in docs/")
    options = parser.parse_args()
    on_cpu = options.device == "cpu"
    options.threads = options.threads or ([1, 2] if on_cpu else [1])
    if not (on_cpu or torch.cuda.is_available()):
        parser.error("PyTorch finds no CUDA device here; leave out --device cuda")
    suffix, whole = "" if on_cpu else f"_{options.device}", not (options.only or options.small)
    out = options.out or (FOLDER / f"results{suffix}.json" if whole else None)
    docs = options.docs or (FOLDER.parent / "docs" if whole else None)
    if docs and not (docs / "benchmarks.md").is_file():
        parser.error(f"{docs} has no benchmarks.md, whose tables could be filled")
    chosen = options.only or [name for name in (*WORKS, GROWTH) if on_cpu or name not in ON_THE_CPU]
    runs = [(name, "returned") for name in chosen]
    if on_cpu:
        runs += [(name, "kept") for name in chosen if name in KEPT]
    machine = f"{_processor() if on_cpu else torch.cuda.get_device_name()}, torch {torch.__version__}"
    rows: list[dict[str, Any]] = []
    for name, memory in runs:
        measured = isolated(measure, name, options, memory=memory)
        rows += [{**row, "machine": machine, "memory": memory} for row in measured]
    console = wide_console(WIDTH)
    print_rows(rows, console)
    if out:
        write_atomically(out, (json.dumps(rows, indent=1) + "\n").encode())
        console.print(f"{out} holds the rows")
    if docs:
        write_atomically(docs / f"benchmarks{suffix}.png", draw(rows))
        fill(docs / "benchmarks.md", rows)
        console.print(f"{docs / 'benchmarks.md'} holds the tables and the figure")


def _processor() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


if __name__ == "__main__":
    main()
