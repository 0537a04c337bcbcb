"""Every option of the main job composes and can be built, and its presets are what their names say."""

from typing import cast

import numpy as np
import pytest
from kits import composed

import sim
from behaviours import BehaviourBank, Demonstrations
from experiments.corral import study
from experiments.corral.command_map import ambiguous_share, command_maps
from experiments.corral.controllers import CONTROLLERS, bins_of, printed_space
from experiments.corral.forgetting import learners
from experiments.corral.settings import PAPER, Corral
from experiments.kit import parts
from experiments.kit.options import options
from experiments.kit.run import check_all
from experiments.tasks import corral

GROUPS = ("vsa", "encoder", "record", "protection", "rule", "composition", "arena")
CONTINUOUS = ("encoder=fractional_power", "record=random_fourier", "record=oblique_features")


def settings(*overrides: str) -> Corral:
    return cast(Corral, composed(study, *overrides))


@pytest.mark.parametrize("option", [f"{group}={option}" for group in GROUPS for option in options(group)])
def test_every_option_composes_and_builds(option: str) -> None:
    # A small dimension and few epochs: what is tested is that the parts fit together.
    needed = [{"encoder=fractional_power": "vsa=fhrr"}.get(option, "seed=0")]
    needed += ["rule.epochs=2"] if option in ("rule=error_driven", "rule=gradient") else []
    config = settings(option, "vsa.dim=256", "controllers=[default,bundled,paper]", *needed)
    check_all(study, config)
    rng = np.random.default_rng(0)
    readings = rng.uniform(0, 1, (12, 3))
    shown = Demonstrations(readings, sim.Teacher()(readings))
    bank = BehaviourBank(corral.space(config))
    bank.learn("default", shown, parts.rule(config.rule))
    policy = parts.policy(bank, config.composition)
    assert policy(readings).commands.isfinite().all()
    assert bins_of(printed_space(config)) == 32
    assert set(learners(config, 4)) == {"as printed", "clipped", "raw, mean width", "raw, sum width", "default"}
    assert ambiguous_share(policy, shown, shown) in (None, 0.0)
    bins = bins_of(policy.space)
    assert bins == (None if option in CONTINUOUS else 32)
    if bins is not None:
        assert len(command_maps(policy, bins, shown)) == 4 * 32**2
    if option.startswith("arena="):
        assert corral.arena(config.arena) == sim.find_arena(option.removeprefix("arena="))


def test_the_default_table_has_the_promised_rows() -> None:
    assert settings().controllers == [name for name in CONTROLLERS if name not in ("ppo", "default_wheeled")]


def test_the_paper_preset_is_literal() -> None:
    config = settings("experiment=paper")
    literal = {"novelty": "similarity", "sigmas": 4.0, "threshold": None, "clip_each_step": True, "name": "one_shot"}
    literal["contradictions"] = "first"
    assert config.rule == config.paper.rule == literal
    assert config.protection == config.paper.protection == {"name": "self_shift", "width": "mean"}
    assert (config.encoder["name"], config.record["name"]) == (PAPER["encoder"], PAPER["record"]) == ("lookup", "sum")


def test_the_default_has_enough_bins_and_none_of_its_edges_is_a_threshold_of_the_teacher() -> None:
    bins = settings().encoder["bins"]
    assert bins >= 16
    distance = sim.SENSORS[2]
    low, high = distance.low, distance.high
    edges = low + (high - low) * np.arange(1, bins) / bins
    # At least a tenth of a bin away.
    assert np.abs(edges - sim.Teacher().obstacle_below).min() > 0.1 * (high - low) / bins
