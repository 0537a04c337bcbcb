"""What can drive robots: controllers with an explicit state, and plain functions from readings to commands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from sim.state import check_alike, check_rows, is_empty, join, rows_of


@runtime_checkable
class Controller(Protocol):
    """Drives a batch of robots. Works like an RNN cell: `step` takes a state and returns the next one.

    All memory of an episode is in the state; the instance itself does not change. The state is a NumPy array or a
    tensor with one row per robot, a tuple, list or dictionary of those, or None for no memory. Its structure, types and
    shapes stay the same. Each row is one robot, independent of the others: between two steps, rows of finished episodes
    are dropped, rows of new ones are added, and the order may change. With several workers the controller must be
    picklable.

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

        Seed random numbers with the number of the episode; then they are the same in any batch.
        """
        ...

    def step(self, readings: NDArray[np.float64], state: Any, /) -> tuple[Any, Any]:
        """The answer to readings `[B, n]`, and the next state.

        The answer is an array or a tensor of commands `[B, m]`, or an object whose attribute `commands` is one.
        """
        ...


ControllerLike = Controller | Callable[[Any], Any]
"""A controller; or, without memory, a function or `nn.Module` from readings `[B, n]` to an answer."""


class _Stateless:
    """A controller without state that calls a function of the readings."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.function = function

    def start(self, episodes: NDArray[np.int64]) -> None:
        """No state."""

    def step(self, readings: NDArray[np.float64], state: None) -> tuple[Any, None]:
        """The function's answer."""
        return self.function(readings), state


def as_controller(policy: ControllerLike) -> Controller:
    """Return a controller as it is, and wrap a function in a controller without state.

    Raises `TypeError` for anything else.
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
    """Call `controller.start(episodes)`. Raises `ValueError` unless the state has one row per episode."""
    state = controller.start(episodes.copy())
    _checked(f"episode {episodes[0]}, start", check_rows, state, len(episodes))
    return state


def append(controller: Controller, state: Any, episodes: NDArray[np.int64]) -> Any:
    """Append the states of robots that begin `episodes`."""
    more = begin(controller, episodes)
    _checked(f"episode {episodes[0]}, start", check_alike, more, state)
    return join(state, more)


def advance(controller: Controller, readings: NDArray[np.float64], state: Any, where: str) -> tuple[Any, Any]:
    """Call `controller.step` and return the commands, unchecked but readable by NumPy, and the next state.

    Error messages begin with `where`. Raises `ValueError` if the structure of the state changes, and `TypeError` if
    `step` does not return a pair.
    """
    # A controller that writes into its readings must not change the record.
    pair = controller.step(readings.copy(), state)
    if not isinstance(pair, tuple) or len(pair) != 2:
        raise TypeError(f"{where}: `step` returned {type(pair).__name__}; expected the pair (answer, state)")
    answer, following = pair
    if following is not state:
        _checked(where, check_rows, following, len(readings))
        _checked(where, check_alike, following, state)
    return _plain(answer), following


def replay(policy: ControllerLike, readings: NDArray[np.float64], episodes: NDArray[np.int64]) -> NDArray[Any]:
    """The answers `[N, ...]` of a controller that is fed recorded readings from the start of each episode.

    A controller without state gets all rows at once.

    Args:
        policy: A controller or a function.
        readings: `[N, n]`.
        episodes: `[N]`, the episode of each row. The rows of an episode are its steps, in order, from step 0 on.
    """
    controller = as_controller(policy)
    order = np.argsort(episodes, kind="stable")
    numbers, first, lengths = np.unique(episodes[order], return_index=True, return_counts=True)
    # The longest episodes first, so that the running ones are always the first rows.
    longest = np.argsort(-lengths, kind="stable")
    numbers, first, lengths = numbers[longest], first[longest], lengths[longest]
    state, robots = begin(controller, numbers), len(numbers)
    if is_empty(state):
        state = begin(controller, episodes)
        return np.asarray(advance(controller, readings, state, f"episode {episodes[0]}, step 0")[0])
    rows, answers = [], []
    for step in range(int(lengths[0])):
        running = int(np.count_nonzero(lengths > step))
        if running < robots:
            state, robots = rows_of(state, slice(running)), running
        rows.append(order[first[:running] + step])
        answer, state = advance(controller, readings[rows[-1]], state, f"episode {numbers[0]}, step {step}")
        answers.append(np.asarray(answer))
    result = np.concatenate(answers)
    result[np.concatenate(rows)] = result.copy()
    return result


def _plain(answer: Any) -> Any:
    """The commands of an answer, in a form that NumPy can read."""
    commands = getattr(answer, "commands", answer)
    return commands.detach().cpu() if hasattr(commands, "detach") else commands


def _checked(where: str, check: Callable[..., None], *arguments: Any) -> None:
    try:
        check(*arguments)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error
