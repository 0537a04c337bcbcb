"""What is left of a behaviour when a growing share of what it is made of is damaged?

Hypervectors are said to be robust to noise, and the paper claims that behaviours made of them stay so. Elements are
drawn at random and have their sign flipped, are set to zero, or get Gaussian noise. What is damaged is the program,
the codebooks, or the query; beside them stand an MLP and a decision tree with the same share of their parameters
damaged. Learning is over by then: nothing is trained on damaged parts.

    python -m experiments.robustness
    python -m experiments.robustness --multirun vsa.dim=500,1000,4000
    python -m experiments.robustness learners=[default,mlp] damages=[flip] draws=2 drive_shares=[0]
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hydra
import numpy as np
import torch
from numpy.typing import NDArray
from omegaconf import DictConfig
from rich.console import Console
from rich.progress import Progress

import sim
import torchvsa
from behaviours import Demonstrations
from experiments import presets
from experiments.choices import check_chosen
from experiments.command_line import errors_in_one_line, job
from experiments.damage import DAMAGES, PARAMETERS, PARTS, Damage, Damaged, Floats, Learner
from experiments.damaged_programs import Programmed
from experiments.damaged_rivals import Network, Tree
from experiments.driving import Driver, progress_bars, workers
from experiments.lessons import FIRST_DEMONSTRATION, shown_in
from experiments.models import hand_written
from experiments.results import Results, Row


class Shared:
    """Damaged copies of one learner that share the starts: episode e is driven by copy e mod their number."""

    def __init__(self, copies: Sequence[Damaged]) -> None:
        self.copies = copies

    def start(self, episodes: NDArray[np.int64]) -> NDArray[np.int64]:
        """The state is the index of each robot's copy, `[B]`."""
        return episodes % len(self.copies)

    def step(self, readings: Floats, state: NDArray[np.int64]) -> tuple[Floats, NDArray[np.int64]]:
        """Commands `[B, 2]` for readings `[B, 3]`."""
        commands = np.empty((len(readings), len(sim.ACTUATORS)))
        for index in np.unique(state).tolist():
            commands[state == index] = self.copies[index](readings[state == index])
        return commands, state


@dataclass(frozen=True)
class Case:
    """What one row of the table is about."""

    learner: str
    part: str
    damage: str
    share: float


@dataclass
class Outcome:
    """What was left: for each draw of the damage, agreement and (where the robot drove) its episodes."""

    agreements: list[float]
    rollout: sim.Rollout | None = None


def study(config: dict[str, Any], folder: Path, console: Console) -> Results:
    """Run the whole comparison and write it to `folder`."""
    began = time.perf_counter()
    check(config)
    results = Results("robustness", config, config["seed"])
    # Settings that cannot be built are found before anything is driven.
    for parts in (config, config["one_shot"]):
        presets.rule(parts["rule"])
        presets.space(config["vsa"], parts, config["seed"])
    if "hand_written" in config["learners"]:
        hand_written.behaviour(torchvsa.architecture(**config["vsa"]), config["seed"])
    with workers(config["workers"]) as executor, progress_bars(console) as progress:
        driver = Driver(config, executor, progress)
        numbers = range(FIRST_DEMONSTRATION, FIRST_DEMONSTRATION + config["demonstrations"])
        train, _ = shown_in(driver.drive("teacher demonstrates", sim.Teacher(), numbers, record=True))
        examined = driver.drive("teacher, held out", sim.Teacher(), range(config["starts"]), record=True)
        heldout, moves = shown_in(examined)
        heldout = heldout.where(moves.tolist())
        steps = progress.track(config["learners"], description="learning")
        learners = {name: LEARNERS[name](config, train) for name in steps}
        outcomes = _examine(config, learners, heldout, progress)
        # One bar for all drives: those of single drives would fill the screen.
        quiet = Driver(config, executor, Progress(disable=True))
        _drive(config, learners, outcomes, quiet, progress)
    results.table = [_row(case, outcome) for case, outcome in outcomes.items()]
    results.records = [row for case, outcome in outcomes.items() for row in _records(config, learners, case, outcome)]
    results.metrics = _metrics(results.table, learners, examined)

    from experiments.robustness_report import write_report  # matplotlib is slow to load, and only needed here

    write_report(folder, results)
    results.wall_time_s = time.perf_counter() - began
    results.write(folder)
    return results


def check(config: Mapping[str, Any]) -> None:
    """Raise, naming the setting, for names that do not exist and shares that make no sense."""
    for setting, choices in (("learners", LEARNERS), ("parts", PARTS), ("damages", DAMAGES)):
        check_chosen(setting, config[setting], choices)
    shares = list(config["shares"])
    if not shares or shares != sorted(set(shares)) or shares[0] != 0 or shares[-1] > 1:
        raise ValueError(f"shares must begin with 0 and rise to at most 1; got {shares}")
    if strangers := [share for share in config["drive_shares"] if share not in shares]:
        raise ValueError(f"drive_shares must be among the shares {shares}; got {strangers}")
    if config["draws"] < 1 or config["noise"] < 0 or not 0 < config["kept"] <= 1:
        raise ValueError(
            f"draws is at least 1, noise at least 0, kept in (0, 1]; "
            f"got {config['draws']}, {config['noise']} and {config['kept']}"
        )


def damage_of(config: Mapping[str, Any], case: Case, draw: int) -> Damage:
    """The damage of one row of the table, in one of its draws."""
    return Damage(case.damage, case.share, config["noise"], (config["seed"], draw))


def _cases(config: Mapping[str, Any], learners: Mapping[str, Learner]) -> list[Case]:
    return [
        Case(name, part, damage, share)
        for name, learner in learners.items()
        for part in learner.parts
        if part in config["parts"] or part == PARAMETERS
        for damage in config["damages"]
        for share in config["shares"]
    ]


def _examine(
    config: Mapping[str, Any], learners: Mapping[str, Learner], heldout: Demonstrations, progress: Progress
) -> dict[Case, Outcome]:
    """Agreement with the teacher on held-out samples."""
    schema = presets.schema()
    right, sensors = schema.command_levels(heldout.commands), heldout.sensors.numpy()
    outcomes: dict[Case, Outcome] = {}
    undamaged: dict[str, float] = {}
    for case in progress.track(_cases(config, learners), description="damage and ask"):
        # Nothing is drawn where nothing is damaged.
        draws = range(config["draws"] if case.share else 1)
        if not case.share and case.learner in undamaged:
            outcomes[case] = Outcome([undamaged[case.learner]])
            continue
        learner, agreements = learners[case.learner], []
        for draw in draws:
            commands = learner.commands(case.part, damage_of(config, case, draw), sensors)
            agreed = (schema.command_levels(commands) == right).all(-1)
            agreements.append(float(agreed.double().mean()))
        outcomes[case] = Outcome(agreements)
        if not case.share:
            undamaged[case.learner] = agreements[0]
    return outcomes


def _drive(
    config: Mapping[str, Any],
    learners: Mapping[str, Learner],
    outcomes: Mapping[Case, Outcome],
    driver: Driver,
    progress: Progress,
) -> None:
    """Closed loop: the draws of one damage share the starts."""
    driven = [case for case in outcomes if case.share in config["drive_shares"]]
    undamaged: dict[str, sim.Rollout] = {}
    for case in progress.track(driven, description="damage and drive"):
        if not case.share and case.learner in undamaged:
            outcomes[case].rollout = undamaged[case.learner]
            continue
        draws = range(len(outcomes[case].agreements))
        copies = [learners[case.learner].damaged(case.part, damage_of(config, case, draw)) for draw in draws]
        rollout = driver.drive(str(case), Shared(copies), range(config["starts"]))
        outcomes[case].rollout = rollout
        if not case.share:
            undamaged[case.learner] = rollout


def _row(case: Case, outcome: Outcome) -> Row:
    summary = None if outcome.rollout is None else outcome.rollout.summary()
    return {
        "learner": case.learner,
        "part": case.part,
        "damage": case.damage,
        "share": case.share,
        "agreement": float(np.mean(outcome.agreements)),
        "agreement_min": min(outcome.agreements),
        "agreement_max": max(outcome.agreements),
        "success_rate": None if summary is None else summary.success_rate,
        "success_low": None if summary is None else summary.success_low,
        "success_high": None if summary is None else summary.success_high,
        "episodes": None if summary is None else summary.episodes,
    }


def _records(config: Mapping[str, Any], learners: Mapping[str, Learner], case: Case, outcome: Outcome) -> list[Row]:
    """One row for each draw."""
    size = learners[case.learner].elements(case.part)
    rows = []
    for draw, agreement in enumerate(outcome.agreements):
        own = None
        if outcome.rollout is not None:
            own = outcome.rollout.success[outcome.rollout.episode % len(outcome.agreements) == draw]
        rows.append(
            {
                **vars(case),
                "draw": draw,
                "elements": size,
                "damaged": damage_of(config, case, draw).count(size),
                "agreement": agreement,
                "episodes": None if own is None else len(own),
                "successes": None if own is None else int(own.sum()),
            }
        )
    return rows


def _metrics(table: list[Row], learners: Mapping[str, Learner], teacher: sim.Rollout) -> dict[str, float | None]:
    metrics: dict[str, float | None] = {"teacher.success_rate": float(teacher.success.mean())}
    for row in table:
        name = f"{row['learner']}.{row['part']}.{row['damage']}.{row['share']:g}"
        metrics |= {f"{name}.{column}": row[column] for column in ("agreement", "agreement_min", "success_rate")}
        elements = learners[row["learner"]].elements(row["part"])
        metrics[f"{row['learner']}.{row['part']}.elements"] = float(elements)
    return metrics


def _default(config: Mapping[str, Any], train: Demonstrations) -> Learner:
    space = presets.space(config["vsa"], config, config["seed"])
    return Programmed(presets.rule(config["rule"]).fit(space, train))


def _one_shot(config: Mapping[str, Any], train: Demonstrations) -> Learner:
    space = presets.space(config["vsa"], config["one_shot"], config["seed"])
    return Programmed(presets.rule(config["one_shot"]["rule"]).fit(space, train))


def _hand_written(config: Mapping[str, Any], train: Demonstrations) -> Learner:
    return Programmed(hand_written.behaviour(torchvsa.architecture(**config["vsa"]), config["seed"]))


def _mlp(config: Mapping[str, Any], train: Demonstrations) -> Learner:
    return Network(train, config["seed"], config["hidden"], config["mlp_epochs"])


def _decision_tree(config: Mapping[str, Any], train: Demonstrations) -> Learner:
    return Tree(train, config["seed"])


LEARNERS = {
    "default": _default,
    "one_shot": _one_shot,
    "hand_written": _hand_written,
    "mlp": _mlp,
    "decision_tree": _decision_tree,
}


@hydra.main(version_base="1.3", config_path="pkg://experiments.conf", config_name="robustness")
def run(cfg: DictConfig) -> None:
    """One job."""
    from experiments.robustness_report import print_table

    torch.set_num_threads(1)  # the workers need the other core
    job(cfg, "robustness", study, print_table)


def main() -> None:
    """The command `python -m experiments.robustness`."""
    with errors_in_one_line("robustness"):
        run()


if __name__ == "__main__":
    main()
