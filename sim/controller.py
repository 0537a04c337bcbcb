"""What drives robots: controllers, whose memory is an explicit state, and plain functions from readings to commands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from sim.state import check_alike, check_rows, is_empty, join, rows_of


@runtime_checkable
class Controller(Protocol):
    """Drives a batch of robots, like an RNN cell: `step` takes a state and returns the next one.

    Everything that a controller remembers about an episode is in the state; the instance itself does not change.
    The state is a NumPy array or a tensor with one row per robot, a tuple, list or dictionary of those, or None for
    no memory; its structure, types and shapes stay the same. Rows are independent robots: those of finished episodes
    are dropped, new ones are added, and their order may change between two steps. With several workers the controller
    must be picklable.

        class Accelerating:
            def start(self, episodes):
                return np.zeros(len(episodes))

            def step(self, readings, speed):
                speed = np.minimum(speed + 0.05, 1.0)
                return np.stack([speed, speed], axis=-1), speed

        sim.rollout(Accelerating())
    """

    def start(self, episodes: NDArray[np.int64], /) -> Any:
        """The state `[B, ...]` at the beginning of these episodes `[B]`.

        Random numbers should be drawn from a seed and the number of the episode: then they are the same in any batch.
        """
        ...

    def step(self, readings: NDArray[np.float64], state: Any, /) -> tuple[Any, Any]:
        """The answer to readings `[B, n]`, and the next state.

        The answer is an array or a tensor of commands `[B, m]`, or an object that has them as `.commands`.
        """
        ...


ControllerLike = Controller | Callable[[Any], Any]
"""What can drive: a controller; or, without memory, a function or `nn.Module` from readings `[B, n]` to an answer."""


class _Stateless:
    """A function of the readings as a controller."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.function = function

    def start(self, episodes: NDArray[np.int64]) -> None:
        """No state."""

    def step(self, readings: NDArray[np.float64], state: None) -> tuple[Any, None]:
        """The function's answer."""
        return self.function(readings), state


def as_controller(policy: ControllerLike) -> Controller:
    """`policy` itself if it is a controller, else the function as one without state.

    Raises `TypeError` for what is neither.
    """
    if isinstance(policy, Controller) and not isinstance(policy, type):
        return policy
    if not callable(policy) or isinstance(policy, type):
        raise TypeError(
            f"{policy!r} cannot drive; expected a controller, with `start(episodes)` and `step(readings, state)`, or a "
            "function from readings to commands"
        )
    return _Stateless(policy)


def begin(controller: Controller, episodes: NDArray[np.int64]) -> Any:
    """`controller.start(episodes)`. Raises `ValueError`, naming an episode, unless it has one row per episode."""
    state = controller.start(episodes.copy())
    _checked(f"episode {episodes[0]}, start", check_rows, state, len(episodes))
    return state


def append(controller: Controller, state: Any, episodes: NDArray[np.int64]) -> Any:
    """`state` with more robots at its end, which begin `episodes`."""
    more = begin(controller, episodes)
    _checked(f"episode {episodes[0]}, start", check_alike, more, state)
    return join(state, more)


def advance(controller: Controller, readings: NDArray[np.float64], state: Any, where: str) -> tuple[Any, Any]:
    """The commands, as something that NumPy can read but unchecked, and the next state; `where` begins errors.

    Raises `ValueError` if the next state is not built like `state`, `TypeError` if `step` does not return a pair.
    """
    # The controller gets a copy: what it does to its readings must not change the record.
    pair = controller.step(readings.copy(), state)
    if not isinstance(pair, tuple) or len(pair) != 2:
        raise TypeError(f"{where}: `step` returned {type(pair).__name__}; expected the pair (answer, state)")
    answer, after = pair
    if after is not state:
        _checked(where, check_rows, after, len(readings))
        _checked(where, check_alike, after, state)
    return _plain(answer), after


def replay(policy: ControllerLike, readings: NDArray[np.float64], episodes: NDArray[np.int64]) -> NDArray[Any]:
    """What a policy answers to recorded readings `[N, n]`, `[N, ...]`, as if it had been there from the start.

    `episodes` `[N]` says which episode each row is of; the rows of an episode are its steps from 0 on, in this order.
    What has no state is asked about all rows at once.
    """
    controller = as_controller(policy)
    order = np.argsort(episodes, kind="stable")
    numbers, first, lengths = np.unique(episodes[order], return_index=True, return_counts=True)
    # The longest episodes first, so that those that still run are always the first rows.
    longest = np.argsort(-lengths, kind="stable")
    numbers, first, lengths = numbers[longest], first[longest], lengths[longest]
    state, going = begin(controller, numbers), len(numbers)
    if is_empty(state):
        state = begin(controller, episodes)
        return np.asarray(advance(controller, readings, state, f"episode {episodes[0]}, step 0")[0])
    places, answers = [], []
    for step in range(int(lengths[0])):
        left = int(np.count_nonzero(lengths > step))
        if left < going:
            state, going = rows_of(state, slice(left)), left
        places.append(order[first[:going] + step])
        answer, state = advance(controller, readings[places[-1]], state, f"episode {numbers[0]}, step {step}")
        answers.append(np.asarray(answer))
    result = np.concatenate(answers)
    result[np.concatenate(places)] = result.copy()
    return result


def _plain(answer: Any) -> Any:
    """The commands of an answer, as what NumPy can read."""
    commands = getattr(answer, "commands", answer)
    return commands.detach().cpu() if hasattr(commands, "detach") else commands


def _checked(where: str, check: Callable[..., None], *given: Any) -> None:
    try:
        check(*given)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error
