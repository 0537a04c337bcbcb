"""What the main job can be told, and what is refused before anything is driven."""

from dataclasses import dataclass
from importlib.util import find_spec

from experiments.corral.controllers import CONTROLLERS, DEFAULT_ROWS, driving, original, printed_space
from experiments.kit import Part, part, parts, setting, settings
from experiments.models import hand_written
from experiments.tasks import corral


@dataclass
class Corral(corral.InOneArena):
    """The settings of this study."""

    composition: Part = part("composition", "bundle", "how the row bundled combines its three behaviours")
    paper: corral.Paper = settings(
        corral.Paper, "the rows paper and paper_best_bins: the printed algorithms, read literally"
    )
    controllers: list[str] = setting(
        DEFAULT_ROWS, "the rows of the table, in this order", choices=lambda: CONTROLLERS, distinct=True
    )
    demonstrations: int = corral.episodes(60, "episodes of the teacher to learn from")
    demonstrations_file: str | None = setting(
        None, "or a file of your own to learn from, as written by behaviours.Demonstrations.save"
    )
    starts: int = corral.episodes(1000, "held-out starts for teacher, default and bundled")
    wheeled_starts: int = corral.episodes(200, "held-out starts for the rows on the wheeled body")
    other_starts: int = corral.episodes(200, "held-out starts for every other controller")
    paper_bins: list[int] = setting(
        [2, 3, 4, 6, 8, 12, 16], "tried for paper_best_bins, and the bins of paper", low=1, distinct=True, empty=True
    )
    validation_starts: int = corral.episodes(40, "starts to choose among them, not among the held-out ones")
    ppo_steps: int = setting(1_000_000, "control steps of all robots together for which ppo is trained", low=1)
    animate: bool = setting(True, "draw one episode of teacher and learned robot side by side, as an animation")


def check(settings: Corral) -> None:
    """Raise for settings with which something could not be built, learned or combined."""
    space = corral.space(settings)
    corral.arena(settings.arena)
    if {"default", "bundled"} & set(map(original, settings.controllers)):
        corral.check_learning(settings)
    if "bundled" in settings.controllers:
        corral.check_policy(space, settings.composition)
    if {"paper", "paper_best_bins"} & set(settings.controllers):
        parts.refuse_unsupported(parts.rule(settings.paper.rule, "paper.rule"), printed_space(settings))
    if "hand_written" in settings.controllers:
        hand_written.behaviour(space.vsa, settings.seed)
    refused: dict[str, list[str]] = {}
    for name in settings.controllers:
        try:
            corral.check_driving(driving(settings, name))
        except ValueError as error:
            refused.setdefault(str(error), []).append(name)
    for reason, names in refused.items():
        raise ValueError(f"controllers: {', '.join(names)} cannot drive: {reason}")
    if "ppo" in settings.controllers and find_spec("stable_baselines3") is None:
        raise ValueError("controllers: ppo needs stable-baselines3: pip install 'torchvsa[rl]'")
    if settings.demonstrations_file is not None:
        corral.from_file(settings.demonstrations_file)


PAPER = {"encoder": "lookup", "record": "sum", "protection": "self_shift", "rule": "literal"}
PRESETS = {
    "quick": {
        "demonstrations": 20,
        "starts": 40,
        "wheeled_starts": 20,
        "other_starts": 20,
        "paper_bins": [2, 4],
        "validation_starts": 10,
        "ppo_steps": 50_000,
    },
    "paper": {"defaults": [{f"override /{group}": option} for group, option in PAPER.items()]},
}
"""A look at the whole job within a minute; and the printed algorithms for all learned rows."""
