"""The laws of controllers: behaviours, and policies that combine them."""

import copy
import pickle
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64
from torch import Tensor
from torch.testing import assert_close

from behaviours.controller import Controller
from behaviours.recall import Recall
from behaviours.testing._material import bits, first_step, no_global_random_numbers, readings, tensors, unchanged, walk
from behaviours.testing._states import check_rows, copied, form, join, rows_of, same_state
from torchvsa._numerics import is_integer
from torchvsa.testing._laws import refuses, require, same, seeded

_STEPS, _ROBOTS = 8, 6
_CLEAR_MARGIN = 1e-3
"""With a larger margin, rounding of floats cannot change the recalled result."""


def same_answer(a: Recall, b: Recall) -> None:
    """Raise `AssertionError` unless both answers have the same bits."""
    for first, second in zip(a, b, strict=True):
        require((first is None) == (second is None), "one of the answers has no speaker")
        if first is not None and second is not None:
            same(bits(first), bits(second))


def _alike(controller: Controller, a: Recall, b: Recall) -> None:
    """Raise unless the answers are equal; for float programs, up to rounding, since sums may be in another order."""
    programs = [tensor for name, tensor in controller.state_dict().items() if name.split(".")[-1] == "program"]
    if controller.space.vsa.integer and all(map(is_integer, programs)):
        same_answer(a, b)
        return
    for first, second in zip(a[1:4], b[1:4], strict=True):
        assert_close(first, second, rtol=1e-4, atol=1e-5)
    clear = (a.margin > _CLEAR_MARGIN) & (b.margin > _CLEAR_MARGIN)
    assert_close(a.commands[clear], b.commands[clear], rtol=1e-4, atol=1e-5)


def _joined(recalls: Sequence[Recall]) -> Recall:
    fields: Any = zip(*recalls, strict=True)
    columns: Any = (None if parts[0] is None else torch.cat(parts) for parts in fields)
    return Recall(*columns)


def _drive(controller: Controller, sequence: Float64[Tensor, "steps robots n"]) -> tuple[list[Recall], Any]:
    """The answers of all steps, starting with new episodes, and the final state."""
    state, recalls = controller.start(range(sequence.shape[1])), []
    for rows in sequence:
        recall, state = controller.step(rows, state)
        recalls.append(recall)
    return recalls, state


def _answers_have_one_row_per_robot_within_range(controller: Controller) -> None:
    space, sequence = controller.space, walk(controller.space, _STEPS, _ROBOTS)
    low = torch.tensor([float(actuator.low) for actuator in space.schema.actuators])
    high = torch.tensor([float(actuator.high) for actuator in space.schema.actuators])
    for recall in _drive(controller, sequence)[0]:
        shape = (_ROBOTS, len(space.schema.actuators))
        require(recall.commands.shape == shape, f"commands have the shape {tuple(recall.commands.shape)}")
        require(recall.commands.dtype == torch.float64, f"commands are {recall.commands.dtype}")
        for name in ("similarity", "margin", "familiarity"):
            part = getattr(recall, name)
            require(part.shape == (_ROBOTS,), f"{name} has the shape {tuple(part.shape)}")
            require(not part.isnan().any(), f"{name} is NaN")
        require(recall.similarity.abs().max() <= 1 + 1e-5, "a similarity is outside of [-1, 1]")
        require(recall.familiarity.abs().max() <= 1 + 1e-5, "a familiarity is outside of [-1, 1]")
        given = recall.commands.cpu()[~recall.commands.cpu().isnan().any(1)]
        require(((given >= low) & (given <= high)).all(), "commands are out of range")


def _an_empty_batch_gives_an_empty_answer(controller: Controller) -> None:
    empty = torch.empty(0, len(controller.space.schema.sensors), dtype=torch.float64)
    recall = first_step(controller, empty)
    require(recall.commands.shape == (0, len(controller.space.schema.actuators)))
    require(all(part is None or part.shape == (0,) for part in recall[1:]), "an answer is not empty")


def _without_observations_there_is_no_answer(controller: Controller) -> None:
    sequence = walk(controller.space, _STEPS, _ROBOTS)
    for recall in _drive(controller, sequence)[0][: _STEPS // 2]:
        require(recall.commands[-1].isnan().all(), "commands where nothing was observed")
        require(all(part[-1] == 0 for part in recall[1:4]), "a similarity other than 0 where nothing was observed")
        require(recall.speaker is None or recall.speaker[-1] == -1, "there is a speaker where nothing was observed")
    commands = first_step(controller, readings(controller.space, 3)).commands
    require(commands.isfinite().all(), "no commands although all sensors were observed")


def _invalid_readings_raise_value_error(controller: Controller) -> None:
    sensors, good = controller.space.schema.sensors, readings(controller.space, 2)
    state = controller.start(range(2))
    for wrong in (good[:, :-1], torch.cat([good, good], 1), good[None]):
        refuses(ValueError, lambda wrong=wrong: controller.step(wrong, state))
    for column, sensor in enumerate(sensors):
        if sensor.out_of_range == "error":
            outside = good.clone()
            outside[1, column] = 2 * sensor.high - sensor.low
            refuses(ValueError, lambda wrong=outside: controller.step(wrong, state))


def _the_state_has_one_row_per_robot_and_keeps_its_form(controller: Controller) -> None:
    state = controller.start(range(_ROBOTS))
    same_state(state, controller.start(np.arange(_ROBOTS)))
    check_rows(state, _ROBOTS)
    before = form(state)
    for rows in walk(controller.space, _STEPS, _ROBOTS):
        _, state = controller.step(rows, state)
        check_rows(state, _ROBOTS)
        require(form(state) == before, f"the state has the form {form(state)}, and had {before} before")


def _a_step_changes_neither_readings_nor_state(controller: Controller) -> None:
    held = tensors(controller)
    state = controller.start(range(_ROBOTS))
    for rows in walk(controller.space, _STEPS, _ROBOTS):
        given, before = rows.clone(), copied(state)
        _, after = controller.step(given, state)
        same(given, rows)
        same_state(state, before)
        state = after
    unchanged(controller, held, "the controller")


def _the_same_state_gives_the_same_answer(controller: Controller) -> None:
    sequence = walk(controller.space, _STEPS, _ROBOTS)
    state, recorded = controller.start(range(_ROBOTS)), []
    with no_global_random_numbers(1):
        for rows in sequence:
            before = copied(state)
            recall, state = controller.step(rows, state)
            recorded.append((rows, before, recall, copied(state)))
    # Again later, in another order, after other readings.
    _drive(controller, readings(controller.space, 9).view(3, 3, -1))
    with no_global_random_numbers(2):
        for rows, before, recall, after in reversed(recorded):
            again, next_state = controller.step(rows, before)
            same_answer(again, recall)
            same_state(next_state, after)


def _robots_do_not_influence_each_other(controller: Controller) -> None:
    sequence = walk(controller.space, _STEPS, _ROBOTS)
    together, end = _drive(controller, sequence)
    for robots in ([0], [_ROBOTS - 1], [2, 4], list(range(_ROBOTS))[::-1]):
        apart, state = _drive(controller, sequence[:, robots])
        for recall, batch in zip(apart, together, strict=True):
            _alike(controller, recall, batch.rows(torch.tensor(robots, device=batch.commands.device)))
        require(form(state) == form(end))


def _robots_may_leave_join_and_change_places(controller: Controller) -> None:
    sequence = walk(controller.space, _STEPS, _ROBOTS)
    together, _ = _drive(controller, sequence)
    half = _STEPS // 2
    robots, late = [3, 0, 1], [5, 2]
    state = controller.start(range(_ROBOTS))
    for rows in sequence[:half]:
        _, state = controller.step(rows, state)
    state = join(rows_of(state, robots), controller.start(range(len(late))))
    for step in range(half):
        rows = torch.cat([sequence[half + step, robots], sequence[step, late]])
        recall, state = controller.step(rows, state)
        indices = [torch.tensor(part, device=recall.commands.device) for part in (robots, late)]
        expected = _joined([together[half + step].rows(indices[0]), together[step].rows(indices[1])])
        _alike(controller, recall, expected)
        check_rows(state, len(robots) + len(late))


def _equal_rows_of_a_large_batch_are_answered_alike(controller: Controller) -> None:
    rows = walk(controller.space, _STEPS, 4).flatten(0, 1)
    index = torch.randint(len(rows), (200,), generator=seeded(0))
    alone = first_step(controller, rows)
    _alike(controller, first_step(controller, rows[index]), alone.rows(index.to(alone.commands.device)))


def _a_call_answers_as_a_first_step(controller: Controller) -> None:
    rows = walk(controller.space, _STEPS, 3).flatten(0, 1)
    try:
        called = controller(rows)
    except ValueError:
        return  # controllers of past readings cannot be called
    _alike(controller, called, first_step(controller, rows))


def _whether_gradients_are_on_does_not_matter(controller: Controller) -> None:
    sequence = walk(controller.space, 3, _ROBOTS)
    recalls, _ = _drive(controller, sequence)
    for mode in (torch.no_grad, torch.inference_mode, torch.enable_grad):
        with mode():
            for recall, expected in zip(_drive(controller, sequence)[0], recalls, strict=True):
                same_answer(recall, expected)


def _copies_answer_alike(controller: Controller) -> None:
    sequence = walk(controller.space, _STEPS, _ROBOTS)
    recalls, _ = _drive(controller, sequence)
    for twin in (copy.deepcopy(controller), pickle.loads(pickle.dumps(controller))):
        for recall, expected in zip(_drive(twin, sequence)[0], recalls, strict=True):
            same_answer(recall, expected)
    # A copy continues from a state of the original.
    state = controller.start(range(_ROBOTS))
    for rows, expected in zip(sequence, recalls, strict=True):
        recall, state = copy.deepcopy(controller).step(rows, state)
        same_answer(recall, expected)


CONTROLLER_LAWS: tuple[Callable[[Controller], None], ...] = (
    _answers_have_one_row_per_robot_within_range,
    _an_empty_batch_gives_an_empty_answer,
    _without_observations_there_is_no_answer,
    _invalid_readings_raise_value_error,
    _the_state_has_one_row_per_robot_and_keeps_its_form,
    _a_step_changes_neither_readings_nor_state,
    _the_same_state_gives_the_same_answer,
    _robots_do_not_influence_each_other,
    _robots_may_leave_join_and_change_places,
    _equal_rows_of_a_large_batch_are_answered_alike,
    _a_call_answers_as_a_first_step,
    _whether_gradients_are_on_does_not_matter,
    _copies_answer_alike,
)
