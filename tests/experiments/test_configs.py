"""Every config composes, and every preset can be built."""

from importlib import import_module
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

import sim
from behaviours import Demonstrations
from experiments import presets
from experiments.choices import check_chosen
from experiments.controllers import CONTROLLERS

CONF = Path(next(iter(import_module("experiments.conf").__path__)))
OPTIONS = sorted(
    f"{path.parent.relative_to(CONF)}={path.stem}" for path in CONF.rglob("*/*.yaml") if path.parent != CONF
)


def settings(*overrides: str) -> dict[str, Any]:
    with initialize_config_module("experiments.conf", version_base="1.3"):
        return cast(dict[str, Any], OmegaConf.to_container(compose("corral", list(overrides)), resolve=True))


def test_there_are_options_for_every_group() -> None:
    groups = {option.split("=")[0] for option in OPTIONS}
    assert groups == {
        "vsa", "encoder", "record", "protection", "rule", "composition", "arena", "body", "experiment",
    }  # fmt: skip


@pytest.mark.parametrize("option", OPTIONS)
def test_every_option_composes_and_builds(option: str) -> None:
    # A small dimension: what is tested is that the parts fit together.
    config = settings(option, "vsa.dim=256")
    space = presets.space(config["vsa"], config, seed=0)
    presets.space(config["vsa"], config["paper"], seed=0)
    rng = np.random.default_rng(0)
    readings = rng.uniform(0, 1, (12, 3))
    shown = Demonstrations(readings, sim.Teacher()(readings))
    behaviour = presets.rule(config["rule"]).fit(space, shown)
    assert behaviour.space.encoder.bins == 32
    assert behaviour(readings).commands.isfinite().all()
    assert presets.arena(config["arena"]) == sim.ARENAS[config["arena"]["preset"]]
    assert config["body"]["name"] in sim.BODIES
    check_chosen("controllers", config["controllers"], CONTROLLERS)


def test_the_default_table_has_the_promised_rows() -> None:
    assert settings()["controllers"] == list(CONTROLLERS)


def test_the_paper_preset_is_literal() -> None:
    config = settings("experiment=paper")
    literal = {"novelty": "similarity", "sigmas": 4.0, "threshold": None, "clip_each_step": True, "name": "one_shot"}
    literal["contradictions"] = "first"
    assert config["rule"] == config["paper"]["rule"] == literal
    assert config["protection"] == {"name": "self_shift", "width": "mean"}
    assert (config["encoder"]["values"], config["record"]["combine"]) == ("lookup", "bundle")


def test_the_default_has_enough_bins_and_none_of_its_edges_is_a_threshold_of_the_teacher() -> None:
    bins = settings()["encoder"]["bins"]
    assert bins >= 16
    distance = sim.SENSORS[2]
    low, high = distance.low, distance.high
    edges = low + (high - low) * np.arange(1, bins) / bins
    # At least a tenth of a bin away.
    assert np.abs(edges - sim.Teacher().obstacle_below).min() > 0.1 * (high - low) / bins


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["nobody"], "controllers: there is no 'nobody'; choose from"),
        (["random", "random"], "controllers names 'random' 2 times"),
        ([], "controllers is empty"),
    ],
)
def test_wrong_rows_are_named(names: list[str], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_chosen("controllers", names, CONTROLLERS)
