"""Programs that recall which behaviour to ask, and the random hypervectors that name behaviours."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from jaxtyping import Shaped
from torch import Tensor

from behaviours.bank import BehaviourBank
from behaviours.behaviour import Behaviour
from behaviours.demonstrations import Demonstrations
from behaviours.learning import ErrorDriven, Rule, require_rule
from behaviours.options import as_int
from behaviours.schema import Actuator, Schema
from behaviours.space import Space
from torchvsa._numerics import as_bipolar, is_integer, norms
from torchvsa.encoders import Lookup


def choosing(
    bank: BehaviourBank, shown: Mapping[str, Demonstrations], rule: Rule | None = None, seed: int = 0
) -> Behaviour:
    """Learn which behaviour of a bank to ask, from demonstrations by the name of the behaviour that they show.

    The result is a behaviour with one actuator, `"behaviour"`, whose commands are indices into `bank.names`; see
    `Hierarchy`. Its conditions are those of the bank, its results random hypervectors, one for each name.

    Args:
        bank: The behaviours to choose from.
        shown: Demonstrations by name; their commands are not used.
        rule: The learning rule; by default `ErrorDriven(margin=5)`.
        seed: Seed of the hypervectors that name behaviours.

    Raises:
        ValueError: For no demonstrations, for names that the bank does not have, and for behaviours that use different
            sensors.
    """
    rule = ErrorDriven(margin=5) if rule is None else rule
    require_rule(rule)
    if unknown := [name for name in shown if name not in bank]:
        raise ValueError(f"there is no behaviour {unknown[0]!r} to choose; the bank holds {', '.join(bank) or 'none'}")
    if not shown:
        raise ValueError("there are no demonstrations to learn from; give some for each behaviour, by name")
    space = common_space([bank[name] for name in bank])
    named = [(shown[name], number) for number, name in enumerate(bank) if name in shown]
    return rule.fit(naming_space(space, len(bank), seed), numbered(named))


def numbered(parts: Sequence[tuple[Demonstrations, int]]) -> Demonstrations:
    """The readings of all parts, each with a number as its command. Runs of different parts stay apart."""
    renamed, runs = [], 0
    for shown, number in parts:
        episodes = shown.episodes.unique(return_inverse=True)[1] + runs
        runs = int(episodes.max()) + 1
        renamed.append(Demonstrations(shown.sensors, torch.full((len(shown), 1), float(number)), episodes))
    return Demonstrations.join(renamed)


def common_space(behaviours: list[Behaviour]) -> Space:
    """The space of all behaviours. Raises `ValueError` if they use different sensors."""
    used = {behaviour.space.sensors: behaviour for behaviour in behaviours}
    if len(used) > 1:
        first, second = list(used.values())[:2]
        raise ValueError(
            "one program chooses between behaviours that use the same sensors, as it is asked with one condition; "
            f"{first.name!r} uses {', '.join(first.space.sensors)}, and {second.name!r} "
            f"{', '.join(second.space.sensors)}"
        )
    return behaviours[0].space


def same_conditions(a: Space, b: Space) -> bool:
    """Whether two spaces encode readings alike: sensors, encoder and protection are equal."""
    pairs = ((a.encoder, b.encoder), (a.protect, b.protect))
    return a.sensors == b.sensors and all(
        first.config() == second.config()
        and first.state_dict().keys() == second.state_dict().keys()
        and all(torch.equal(t.cpu(), second.state_dict()[name].cpu()) for name, t in first.state_dict().items())
        for first, second in pairs
    )


def naming_space(space: Space, count: int, seed: int) -> Space:
    """The same conditions, with the numbers 0 to `count - 1` as results: random hypervectors drawn from `seed`."""
    levels = max(count, 2)
    schema = Schema(space.schema.sensors, [Actuator("behaviour", 0, levels - 1, levels=levels)])
    codes = Lookup(space.vsa, levels)
    made = Space(schema, space.encoder, protection=space.protect, seed=seed_of(seed, 2), command_codes=codes)
    return made.to(space.device).using(space.sensors)


def seed_of(seed: int, purpose: int) -> int:
    """A seed for one purpose (0 contexts, 1 tags, 2 names), whose draws are unrelated to those of `seed` itself.

    The codebooks of a space are drawn from its seed; a context that is drawn from the same one would be a code.
    """
    state = np.random.SeedSequence([as_int("seed", seed, 0), purpose]).generate_state(1, np.uint64)
    return int(state[0] >> np.uint64(1))


def with_length(program: Shaped[Tensor, "d"], length: Tensor, exact: bool) -> Shaped[Tensor, "d"]:
    """A program scaled to a length; rounded to integers if `exact`, so that sums with integer programs are exact."""
    program = as_bipolar(program)
    scaled = program.to(torch.float64 if is_integer(program) else program.dtype)
    scaled = scaled * (length / norms(program).clamp(min=torch.finfo(torch.float32).tiny)).to(scaled.real.dtype)
    return scaled.round().to(torch.int32) if exact else scaled
