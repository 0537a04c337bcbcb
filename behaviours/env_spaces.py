"""Gymnasium's spaces as named columns of numbers, and as sensors and actuators."""

import importlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float64

from behaviours.columns import require
from behaviours.parts import Actuator, Sensor, span
from behaviours.proposal import Proposal, propose
from behaviours.tables import checked_names, columns_of

_UNBOUNDED = 1e30
"""Some environments write the largest float32 where there is no bound."""
_MOST_LEVELS = 64
"""Fewer whole numbers than this are each a level of an actuator."""
_MOST_CHOICES = 1000
"""More values than this are read as a number: a code for each costs memory."""


@dataclass(frozen=True)
class Element:
    """A number of an observation or action.

    Attributes:
        name: Its name, such as `observation.arm[2]`.
        path: The keys of `Dict` and the places of `Tuple` that lead to its array.
        place: Its place in that array, flattened.
        low: The smallest value; -inf without a bound.
        high: The largest value; inf without a bound.
        choices: Whether its values are unordered: those of `Discrete`, `MultiDiscrete` and `MultiBinary`.
        dtype: The type of its array.
    """

    name: str
    path: tuple[Any, ...]
    place: int
    low: float
    high: float
    choices: bool
    dtype: np.dtype[Any]

    @property
    def whole(self) -> bool:
        """Whether its values are whole numbers."""
        return self.dtype.kind in "biu"

    @property
    def bounded(self) -> bool:
        """Whether both bounds are finite."""
        return bool(np.isfinite(self.high - self.low))


def elements_of(space: Any, name: str, names: Sequence[str] | None = None) -> tuple[list[Element], dict[str, str]]:
    """The elements of a space in order, and what is left out of it, with the reason.

    `Dict` adds `.key` to the name, `Tuple` and arrays of several elements `[place]`; `names` replaces all of them.
    Raises `ValueError` if nothing is left, and for another number of names.
    """
    left_out: dict[str, str] = {}
    found = list(_walk(space, name, (), left_out))
    if not found:
        why = "; ".join(f"{part}: {reason}" for part, reason in left_out.items()) or "it has no elements"
        raise ValueError(f"the {name} space {space!s:.80} has no numbers to read ({why})")
    if names is not None:
        names = checked_names(names, f"names of the {name}")
        if len(names) != len(found):
            given = ", ".join(element.name for element in found)
            raise ValueError(f"the {name} has {len(found)} elements ({given:.200}); got {len(names)} names")
        found = [replace(element, name=new) for element, new in zip(found, names, strict=True)]
    return found, left_out


def actions_of(space: Any, names: Sequence[str] | None = None) -> list[Element]:
    """The elements of an action space. Raises `ValueError` if there are parts that cannot be commanded by numbers."""
    found, left_out = elements_of(space, "action", names)
    if left_out:
        part, why = next(iter(left_out.items()))
        raise ValueError(f"{part} of the environment cannot be an actuator: {why}")
    return found


def rows_of(elements: Sequence[Element], values: Any, rows: int) -> Float64[np.ndarray, "rows n"]:
    """The elements of `rows` observations or actions, whose arrays have them along their first axis.

    Raises `ValueError` that names the part whose values have another size.
    """
    sizes = Counter(element.path for element in elements)
    arrays: dict[tuple[Any, ...], np.ndarray[Any, Any]] = {}
    for element in elements:
        if element.path in arrays:
            continue
        part = values
        for key in element.path:
            part = part[key]
        array, expected = np.asarray(part, dtype=np.float64), (rows, sizes[element.path])
        if array.size != rows * expected[1]:
            raise ValueError(f"{element.name} needs values of shape {expected}, [rows, numbers]; got {array.shape}")
        if not element.whole:
            # As the environment takes it: in float32, a command at a bound does not exceed it.
            array = array.astype(element.dtype)
        arrays[element.path] = array.reshape(expected)
    return np.stack([arrays[element.path][:, element.place] for element in elements], 1).astype(np.float64)


def action_of(space: Any, commands: Any) -> Any:
    """The action of a row of commands `[m]`, of the type that `env.step` takes.

    Raises `ValueError` for another number of commands, and for commands that are not finite.
    """
    elements = actions_of(space)
    row = np.asarray(commands, dtype=np.float64).ravel()
    if row.shape != (len(elements),) or not np.isfinite(row).all():
        raise ValueError(f"an action has {len(elements)} finite commands; got {row.tolist()!r:.200}")
    parts: dict[tuple[Any, ...], list[float]] = {}
    for element, value in zip(elements, row.tolist(), strict=True):
        parts.setdefault(element.path, []).append(value)
    return _action(space, (), parts)


def propose_for(env: Any, data: Any = None) -> Proposal:
    """The sensors and actuators of an environment, see `Schema.from_env`."""
    if not (hasattr(env, "observation_space") and hasattr(env, "action_space")):
        raise ValueError(f"expected an environment of Gymnasium; got {type(env).__name__}")
    columns = None if data is None else columns_of(data)
    names = [getattr(data, which, None) for which in ("sensors", "actuators")]
    # A data frame may have a column with such a name.
    sensors, actuators = (given if isinstance(given, list | tuple) else None for given in names)
    observed, left_out = elements_of(env.observation_space, "observation", sensors)
    commanded = actions_of(env.action_space, actuators)
    found = Proposal(left_out=left_out)
    for element in observed:
        sensor = _sensor(element, columns)
        found.sensors.append(sensor)
        found.notes[element.name] = f"sensor, {sensor.kind}; {sensor.describe()}"
    for element in commanded:
        actuator = _actuator(element, columns)
        found.actuators.append(actuator)
        found.notes[element.name] = f"actuator; {span(actuator)} in {actuator.levels} levels"
    return found


def _walk(space: Any, name: str, path: tuple[Any, ...], left_out: dict[str, str]) -> Iterator[Element]:
    spaces: Any = importlib.import_module("gymnasium").spaces
    if isinstance(space, spaces.Dict):
        for key, part in space.spaces.items():
            yield from _walk(part, f"{name}.{key}", (*path, key), left_out)
    elif isinstance(space, spaces.Tuple):
        for place, part in enumerate(space.spaces):
            yield from _walk(part, f"{name}[{place}]", (*path, place), left_out)
    elif isinstance(space, spaces.Box) and len(space.shape) > 2:
        left_out[name] = f"it is an image or a block of {' x '.join(map(str, space.shape))}"
    elif isinstance(space, spaces.Box | spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary):
        lows, highs = _bounds(space, spaces)
        choices, dtype = not isinstance(space, spaces.Box), np.dtype(space.dtype)
        for place, at in enumerate(np.ndindex(lows.shape)):
            # The only element of an array has the name of the array.
            own = name if lows.size == 1 else name + "".join(f"[{index}]" for index in at)
            yield Element(own, path, place, float(lows[at]), float(highs[at]), choices, dtype)
    else:
        left_out[name] = f"it is of the space {type(space).__name__}, not of numbers"


def _bounds(space: Any, spaces: Any) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """The smallest and the largest value of each element."""
    if isinstance(space, spaces.Box):
        lows, highs = space.low.astype(np.float64), space.high.astype(np.float64)
        return np.where(lows < -_UNBOUNDED, -np.inf, lows), np.where(highs > _UNBOUNDED, np.inf, highs)
    if isinstance(space, spaces.MultiBinary):
        return np.zeros(space.shape), np.ones(space.shape)
    counts = np.asarray(space.n if isinstance(space, spaces.Discrete) else space.nvec, dtype=np.float64)
    return np.asarray(space.start) + np.zeros_like(counts), space.start + counts - 1


def _action(space: Any, path: tuple[Any, ...], parts: dict[tuple[Any, ...], list[float]]) -> Any:
    spaces: Any = importlib.import_module("gymnasium").spaces
    if isinstance(space, spaces.Dict):
        return {key: _action(part, (*path, key), parts) for key, part in space.spaces.items()}
    if isinstance(space, spaces.Tuple):
        return tuple(_action(part, (*path, place), parts) for place, part in enumerate(space.spaces))
    values = np.reshape(parts[path], space.shape)
    if np.dtype(space.dtype).kind in "biu":
        values = np.rint(values)
    values = np.asarray(values, dtype=space.dtype)
    return values[()] if isinstance(space, spaces.Discrete) else values


def _sensor(element: Element, columns: dict[str, np.ndarray[Any, Any]] | None) -> Sensor:
    if element.choices and 1 <= element.high - element.low < _MOST_CHOICES:
        if (element.low, element.high) == (0, 1):
            return Sensor(element.name, kind="binary")
        return Sensor(element.name, kind="categorical", values=range(int(element.low), int(element.high) + 1))
    low, high = _range(element, columns)
    return Sensor(element.name, low, high, out_of_range="clip")


def _actuator(element: Element, columns: dict[str, np.ndarray[Any, Any]] | None) -> Actuator:
    if element.low == element.high:
        raise ValueError(f"{element.name} is always {element.low:g}, so that there is nothing to learn")
    low, high = _range(element, columns)
    if element.whole and (element.choices or high - low < _MOST_LEVELS):
        return Actuator(element.name, low, high, levels=int(high - low) + 1)
    return Actuator(element.name, low, high)


def _range(element: Element, columns: dict[str, np.ndarray[Any, Any]] | None) -> tuple[float, float]:
    """The bounds of an element; those that it lacks are learned from the data."""
    low, high = element.low, element.high
    if not element.bounded:
        if columns is None:
            raise ValueError(
                f"{element.name} has no finite bounds in the environment: give data to learn its range from, such as "
                "behaviours.data.collect(env, controller, episodes=5)"
            )
        require(element.name, list(columns))
        learned = _learned_range(element.name, columns[element.name])
        low, high = (low if np.isfinite(low) else learned[0]), (high if np.isfinite(high) else learned[1])
    return (low, high) if low < high else (low - 1, low + 1)


def _learned_range(name: str, column: np.ndarray[Any, Any]) -> tuple[float, float]:
    """The range that `Schema.from_data` takes for a real sensor with this column."""
    if (column == column[0]).all():
        return float(column[0]), float(column[0])
    command = f"command for {name}"
    found = propose({name: column, command: np.arange(len(column))}, [name], [command])
    return found.sensors[0].low, found.sensors[0].high
