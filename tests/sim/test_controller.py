"""The laws of controllers: an explicit state with one row per robot, which never depends on the other robots."""

import pickle
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import policies
import pytest
import torch
from numpy.typing import NDArray

import sim

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Memory(NamedTuple):
    """A state with named parts."""

    episode: Any
    step: Any


BUILDS: dict[str, Callable[[Integers, Integers], Any]] = {
    "arrays": lambda episode, step: (episode, step),
    "tensors": lambda episode, step: [torch.from_numpy(episode), torch.from_numpy(step)],
    "dictionary": lambda episode, step: {"mixed": {"a": torch.from_numpy(episode), "b": step}, "none": None, "no": ()},
    "named": Memory,
}
PARTS: dict[str, Callable[[Any], tuple[Any, Any]]] = {
    "arrays": lambda state: state,
    "tensors": lambda state: (state[0].numpy(), state[1].numpy()),
    "dictionary": lambda state: (state["mixed"]["a"].numpy(), state["mixed"]["b"]),
    "named": lambda state: (state.episode, state.step),
}


class Echo:
    """Commands that tell the episode and the step of each robot, from a state built in one way or another."""

    def __init__(self, build: str) -> None:
        self.build = build

    def start(self, episodes: Integers) -> Any:
        """Step 0."""
        return BUILDS[self.build](episodes, np.zeros_like(episodes))

    def step(self, readings: Floats, state: Any) -> tuple[Floats, Any]:
        """Episode and step, small enough to be driven, and one step more."""
        episode, step = PARTS[self.build](state)
        return np.stack([episode / 1000, step / 1000], axis=-1), BUILDS[self.build](episode, step + 1)


class Wandering:
    """Turns by its last commands and readings: what one robot remembers would soon be seen in another's path."""

    def start(self, episodes: Integers) -> torch.Tensor:
        """The first commands, by episode."""
        return torch.stack([torch.from_numpy(episodes) % 3 - 1.0, torch.ones(len(episodes))], dim=-1).double()

    def step(self, readings: Floats, state: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """A leaky sum of what was read."""
        state = 0.9 * state + 0.1 * torch.from_numpy(readings[:, 1:] - readings[:, :1])
        return state, state


def paths(run: sim.Rollout) -> dict[int, tuple[bytes, ...]]:
    """What each episode saw and commanded, and how it moved."""
    steps = {episode: run.slice(episode) for episode in run.episode.tolist()}
    return {episode: (s.sensors.tobytes(), s.commands.tobytes(), s.x.tobytes()) for episode, s in steps.items()}


def controllers() -> list[Any]:
    return [*map(Echo, BUILDS), Wandering(), policies.random, sim.Teacher()]


def seconds(policy: sim.ControllerLike) -> float:
    """The teacher's episodes end at different steps, so that slots are refilled while others go on."""
    return 9.0 if isinstance(policy, sim.Teacher) else 3.0


@pytest.mark.parametrize("policy", controllers(), ids=lambda one: getattr(one, "build", type(one).__name__))
def test_a_batch_is_stacked_singles_in_any_order(policy: sim.ControllerLike) -> None:
    run: dict[str, Any] = {"seed": 4, "seconds": seconds(policy), "dwell": 0.5}
    before = pickle.dumps(policy)
    alone = sim.rollout(policy, episodes=range(7), robots=1, **run)
    for robots in (3, 64):
        assert paths(sim.rollout(policy, episodes=range(7), robots=robots, **run)) == paths(alone)
    assert paths(sim.rollout(policy, episodes=[5, 0, 6, 2, 4, 1, 3], robots=3, **run)) == paths(alone)
    # Whatever was remembered was in the state.
    assert pickle.dumps(policy) == before


class Finding:
    """Drives as the teacher does, and keeps a log of the states that it is given."""

    def __init__(self) -> None:
        self.log: list[Integers] = []
        self.started: list[list[int]] = []

    def start(self, episodes: Integers) -> Integers:
        """Episode and step."""
        self.started.append(episodes.tolist())
        return np.stack([episodes, np.zeros_like(episodes)], axis=-1)

    def step(self, readings: Floats, state: Integers) -> tuple[Floats, Integers]:
        """The teacher's commands."""
        self.log.append(state)
        return sim.Teacher()(readings), state + policies.ONE_STEP


def test_rows_stay_with_their_robots_and_refilled_slots_start_anew() -> None:
    finding = Finding()
    run = sim.rollout(finding, episodes=range(10, 22), seed=4, robots=4, dwell=0.5)
    assert len(np.unique(run.steps)) > 6
    assert sorted(episode for group in finding.started for episode in group) == list(range(10, 22))
    assert len(finding.started) > 4
    for episode, steps in zip(run.episode.tolist(), run.steps.tolist(), strict=True):
        seen = [state[state[:, 0] == episode, 1].tolist() for state in finding.log]
        assert [step for tick in seen for step in tick] == list(range(steps))


@pytest.mark.parametrize("build", BUILDS)
def test_each_command_comes_from_the_state_of_its_own_robot(build: str) -> None:
    run = sim.rollout(Echo(build), episodes=range(3, 9), robots=4, seconds=1.0)
    np.testing.assert_array_equal(run.trajectory.commands[:, 0], run.step_episode / 1000)
    np.testing.assert_array_equal(run.trajectory.commands[:, 1], run.trajectory.step / 1000)


class Answering(policies.Counting):
    """Answers and states that are wrong from step 3 on."""

    def __init__(self, answer: Callable[[Integers], Any], after: Callable[[Integers], Any] | None = None) -> None:
        self.answer, self.after = answer, after or (lambda state: state)

    def step(self, readings: Floats, state: Integers) -> tuple[Any, Any]:
        """Straight ahead for three steps."""
        if state[0, 1] < 3:
            return np.ones((len(state), 2)), state + policies.ONE_STEP
        return self.answer(state), self.after(state)


def ones(state: Integers) -> Floats:
    return np.ones((len(state), 2))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (Answering(lambda state: ones(state)[1:]), r"commands have shape \(2, 2\); expected \(3, 2\)"),
        (Answering(lambda state: ones(state) * np.nan), "the policy commanded"),
        (Answering(lambda state: "left"), "commands are of type"),
        (Answering(ones, lambda state: state[1:]), r"shape \(2, 2\); expected one row per robot, 3 in all"),
        (Answering(ones, lambda state: None), "its structure, types and shapes must not change"),
        (Answering(ones, lambda state: (state,)), "its structure, types and shapes must not change"),
        (Answering(ones, lambda state: state * 1.0), "float64.*earlier it held.*int64"),
        (Answering(ones, lambda state: torch.from_numpy(state)), "its structure, types and shapes must not change"),
        (Answering(ones, lambda state: "state"), "the state holds 'state'; expected arrays or tensors"),
    ],
)
def test_wrong_answers_and_states_name_episode_and_step(wrong: sim.ControllerLike, words: str) -> None:
    with pytest.raises(ValueError, match=f"episode 4, step 3: .*{words}"):
        sim.rollout(wrong, episodes=[4, 5, 6])


def test_a_step_without_a_state_is_named() -> None:
    class Forgetful(policies.Counting):
        def step(self, readings: Floats, state: Integers) -> Any:
            return ones(state)

    with pytest.raises(TypeError, match=r"episode 4, step 0: `step` returned ndarray; expected the pair"):
        sim.rollout(Forgetful(), episodes=[4, 5])


@pytest.mark.parametrize("start", [lambda e: np.zeros(len(e) + 1), lambda e: np.float64(0), lambda e: [list(e)]])
def test_wrong_first_states_name_an_episode(start: Callable[[Integers], Any]) -> None:
    class Starting(policies.Counting):
        def start(self, episodes: Integers) -> Any:
            return start(episodes)

    with pytest.raises(ValueError, match=r"episode 4, start: the state holds"):
        sim.rollout(Starting(), episodes=[4, 5])


def test_a_later_start_must_be_like_the_first() -> None:
    class Growing(policies.Counting):
        def start(self, episodes: Integers) -> Integers:
            return np.zeros((len(episodes), 2 + (episodes[0] > 4)), np.int64)

        def step(self, readings: Floats, state: Integers) -> tuple[Floats, Integers]:
            return ones(state), state

    with pytest.raises(ValueError, match=r"episode 5, start: the state holds .*\(3,\).*earlier it held .*\(2,\)"):
        sim.rollout(Growing(), episodes=[4, 5], robots=1, seconds=0.1)


class Answer(NamedTuple):
    """What a behaviour answers."""

    commands: Any


def test_functions_and_modules_of_the_readings_drive() -> None:
    run: dict[str, Any] = {"episodes": range(3), "seconds": 1.0}
    layer = torch.nn.Linear(3, 2, dtype=torch.float64)

    class Module(torch.nn.Module):
        def __init__(self, wrap: bool) -> None:
            super().__init__()
            self.layer, self.wrap = layer, wrap

        def forward(self, readings: Any) -> Any:
            commands = self.layer(torch.as_tensor(readings))
            return Answer(commands) if self.wrap else commands

    with torch.no_grad():
        expected = paths(sim.rollout(lambda readings: layer(torch.from_numpy(readings)).numpy(), **run))
    assert paths(sim.rollout(Module(wrap=True), **run)) == expected
    assert paths(sim.rollout(Module(wrap=False), **run)) == expected
    assert paths(sim.rollout(lambda readings: Answer(sim.Teacher()(readings)), **run)) == paths(
        sim.rollout(sim.Teacher(), **run)
    )


@pytest.mark.parametrize("policy", [None, 3, sim.Teacher, policies.Random])
def test_what_cannot_drive_is_named(policy: Any) -> None:
    with pytest.raises(TypeError, match="cannot drive; expected a controller"):
        sim.rollout(policy, episodes=[0])


@pytest.mark.parametrize("policy", controllers(), ids=lambda one: getattr(one, "build", type(one).__name__))
def test_a_replay_gives_the_commands_of_the_rollout(policy: sim.ControllerLike) -> None:
    run = sim.rollout(policy, episodes=[3, 1, 8, 2], seed=4, seconds=seconds(policy), dwell=0.5)
    path, episodes = run.trajectory, run.step_episode
    np.testing.assert_array_equal(sim.replay(policy, path.sensors, episodes), path.commands)
    # The rows of different episodes may stand in any order.
    order = np.argsort(path.step, kind="stable")
    np.testing.assert_array_equal(sim.replay(policy, path.sensors[order], episodes[order]), path.commands[order])


@pytest.mark.parametrize("empty", [lambda size: None, lambda size: {"past": [torch.empty(size, 0, 3)]}])
def test_a_replay_asks_a_controller_without_memory_once(empty: Callable[[int], Any]) -> None:
    asked: list[int] = []

    class Now:
        def start(self, episodes: Integers) -> Any:
            return empty(len(episodes))

        def step(self, readings: Floats, state: Any) -> tuple[Floats, Any]:
            asked.append(len(readings))
            return sim.Teacher()(readings), state

    run = sim.rollout(Now(), episodes=range(3), seconds=1.0, robots=2)
    asked.clear()
    commands = sim.replay(Now(), run.trajectory.sensors, run.step_episode)
    np.testing.assert_array_equal(commands, run.trajectory.commands)
    assert asked == [60]
