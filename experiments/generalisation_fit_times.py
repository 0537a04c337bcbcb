"""How long learning takes: one hypervector beside torch-hd's AdaptHD, fold by fold in turns, in one process."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from typing import Any

import torch
from rich.progress import Progress

from experiments.generalisation_wall_following import FOLDS, fit_and_ask
from experiments.models import torchhd as torchhd_classifiers
from experiments.results import Row

MODELS = ("one_hypervector", "torchhd_adapthd")


def check(config: Mapping[str, Any]) -> None:
    """Raise, naming the setting, for what cannot be run."""
    if not torchhd_classifiers.installed():
        raise ValueError("parts: fit_times compares with torch-hd, which is not installed; pip install torch-hd")
    for setting in ("threads", "folds"):
        if config[setting] < 1:
            raise ValueError(f"fit_times.{setting}={config[setting]}: expected 1 or more")
    if config["folds"] > FOLDS:
        raise ValueError(f"fit_times.folds={config['folds']}: there are {FOLDS}")
    if config["sensors"] not in (24, 4, 2):
        raise ValueError(f"fit_times.sensors={config['sensors']}: choose from 24, 4, 2")


def run(config: Mapping[str, Any], executor: Executor, progress: Progress) -> list[Row]:
    """One record for each model and stratified fold. Nothing else runs meanwhile, and all threads are theirs."""
    own = config["fit_times"]
    task = progress.add_task("fit times: folds", total=own["folds"] * len(MODELS))
    records = []
    before = torch.get_num_threads()
    torch.set_num_threads(own["threads"])
    try:
        for fold in range(own["folds"]):
            for model in MODELS:
                settings = {"dim": own["dim"], "torchhd_epochs": own["adapthd_epochs"]}
                records.append(fit_and_ask(settings, model, own["sensors"], "stratified", fold, config["seed"]))
                progress.advance(task)
    finally:
        torch.set_num_threads(before)
    return records
