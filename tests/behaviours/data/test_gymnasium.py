"""Episodes of Gymnasium's environments become logs, and their spaces schemas."""

import math
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces

from behaviours import Actuator, BehaviourBank, Demonstrations, Schema, Sensor, Space
from behaviours.data import Log, action_of, collect, readings_of, schema_from_env

SEEN = spaces.Dict(
    {
        "arm": spaces.Tuple((spaces.Box(-1, 1, (2,)), spaces.Discrete(3, start=-1))),
        "camera": spaces.Box(0, 255, (8, 8, 3), np.uint8),
        "count": spaces.Box(0, math.inf, (1,), np.float64),
        "grid": spaces.Box(-2, 2, (2, 2)),
        "lamps": spaces.MultiBinary(2),
        "note": spaces.Text(5),
        "one": spaces.Discrete(1),
    }
)
DONE = spaces.Dict(
    {
        "gear": spaces.Discrete(4),
        "grip": spaces.MultiBinary(1),
        "place": spaces.MultiDiscrete([3, 5], start=[-1, 10]),
        "speed": spaces.Box(np.float32(-0.7), np.float32(0.7), (1,)),
        "step": spaces.Box(0, 7, (1,), np.int16),
    }
)
NAMES = [
    "observation.arm[0][0]", "observation.arm[0][1]", "observation.arm[1]", "observation.count",
    "observation.grid[0][0]", "observation.grid[0][1]", "observation.grid[1][0]", "observation.grid[1][1]",
    "observation.lamps[0]", "observation.lamps[1]", "observation.one",
]  # fmt: skip
ACTIONS = ["action.gear", "action.grip", "action.place[0]", "action.place[1]", "action.speed", "action.step"]


class Rig(gymnasium.Env[Any, Any]):
    """Shows random observations for three steps, and takes only valid actions."""

    def __init__(self, seen: spaces.Space[Any] = SEEN, done: spaces.Space[Any] = DONE) -> None:
        self.observation_space, self.action_space = seen, done
        self.shown: list[Any] = []

    def _look(self) -> Any:
        self.shown.append(self.observation_space.sample())
        return self.shown[-1]

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        self.observation_space.seed(seed)
        self.action_space.seed(seed)
        self.steps = 0
        return self._look(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        assert self.action_space.contains(action)
        self.steps += 1
        return self._look(), 0.0, False, self.steps == 3, {}


def recorded(episodes: int = 2, seed: int = 0, **options: Any) -> tuple[Log, Rig, list[Any]]:
    env, actions = Rig(), []

    def act(_: Any) -> Any:
        actions.append(env.action_space.sample())
        return actions[-1]

    return collect(env, act, episodes, seed, **options), env, actions


def test_every_space_is_flattened_with_names() -> None:
    fractions: list[float] = []
    log, env, actions = recorded(progress=fractions.append)
    assert log.columns == [*NAMES, *ACTIONS]
    assert (log.sensors, log.actuators) == (NAMES, ACTIONS)
    assert set(log.left_out) == {"observation.camera", "observation.note"}
    assert fractions == [0.5, 1]
    assert log.episodes is not None
    assert log.episodes.tolist() == [0, 0, 0, 1, 1, 1]
    answered = [seen for place, seen in enumerate(env.shown) if place % 4 != 3]  # all but the last of each episode
    assert np.array_equal(log["observation.arm[0][1]"], [seen["arm"][0][1] for seen in answered])
    assert np.array_equal(log["observation.arm[1]"], [seen["arm"][1] for seen in answered])
    assert np.array_equal(log["observation.grid[1][0]"], [seen["grid"][1, 0] for seen in answered])
    assert np.array_equal(log["observation.lamps[1]"], [seen["lamps"][1] for seen in answered])
    assert np.array_equal(log["action.place[1]"], [action["place"][1] for action in actions])
    assert np.array_equal(log["action.speed"], [action["speed"][0] for action in actions])
    assert log.ranges["action.step"] == (0, 7)
    assert "observation.count" not in log.ranges


def test_an_episode_has_its_own_seed() -> None:
    both, alone = recorded()[0], recorded(1, seed=1)[0]
    for name in both.columns:
        assert np.array_equal(both[name][3:], alone[name])


def test_a_schema_has_the_kinds_and_bounds_of_the_spaces() -> None:
    log, env, _ = recorded()
    counts = log["observation.count"]
    schema, lines = schema_from_env(env, log), []
    assert Schema.from_env(env, log, show=lines.append) == schema
    arm, lamp = [Sensor(name, -1, 1, out_of_range="clip") for name in NAMES[:2]], NAMES[8:10]
    assert schema.sensors == (
        *arm,
        Sensor(NAMES[2], kind="categorical", values=(-1, 0, 1)),
        Sensor(NAMES[3], 0, counts.max(), out_of_range="clip"),
        *(Sensor(name, -2, 2, out_of_range="clip") for name in NAMES[4:8]),
        *(Sensor(name, kind="binary") for name in lamp),
        Sensor(NAMES[10], -1, 1, out_of_range="clip"),
    )
    speed = float(np.float32(0.7))
    assert schema.actuators == (
        Actuator(ACTIONS[0], 0, 3, levels=4),
        Actuator(ACTIONS[1], 0, 1, levels=2),
        Actuator(ACTIONS[2], -1, 1, levels=3),
        Actuator(ACTIONS[3], 10, 14, levels=5),
        Actuator(ACTIONS[4], -speed, speed),
        Actuator(ACTIONS[5], 0, 7, levels=8),
    )
    told = dict(line.split(": ", 1) for line in lines)
    assert "8 x 8 x 3" in told["observation.camera"]
    assert "Text" in told["observation.note"]
    shown = Demonstrations.from_data(log, schema)
    assert np.array_equal(shown.sensors[:, 3].numpy(), counts)


def test_readings_and_commands_are_those_of_the_environment() -> None:
    log, env, actions = recorded()
    assert readings_of(env, env.shown[0]).tolist() == [log[name][0] for name in NAMES]
    for row, action in enumerate(actions):
        given = action_of(env, torch.tensor([log[name][row] for name in ACTIONS]))
        assert env.action_space.contains(given)
        assert all(np.array_equal(given[key], action[key]) for key in action)
    assert action_of(Rig(done=spaces.Tuple((spaces.Discrete(3, start=5), spaces.Box(0, 9)))), [6.0, 2.5]) == (6, [2.5])
    with pytest.raises(ValueError, match="an action has 6 finite commands; got"):
        action_of(env, [math.nan] * 6)


def test_infinite_bounds_are_learned_or_refused() -> None:
    env = gymnasium.make("CartPole-v1")
    names = ["place", "speed", "angle", "turn"]
    log = collect(env, lambda seen: int(seen[2] + seen[3] > 0), 2, most_steps=30, sensors=names, actuators=["push"])
    assert len(log) == 60
    schema = Schema.from_env(env, log)
    assert [sensor.name for sensor in schema.sensors] == names
    assert (schema.sensors[0].low, schema.sensors[0].high) == pytest.approx((-4.8, 4.8))
    assert (schema.sensors[1].low, schema.sensors[1].high) == (log["speed"].min(), log["speed"].max())
    assert schema.actuators == (Actuator("push", 0, 1, levels=2),)
    with pytest.raises(ValueError, match=r"observation\[1\] has no finite bounds in the environment: give data"):
        Schema.from_env(env)
    with pytest.raises(ValueError, match="there is no column 'observation"):
        Schema.from_env(env, {"speed": [1.0]})
    env = Rig(done=spaces.Box(-math.inf, 3, (1,)))
    assert Schema.from_env(env, {"action": [-2.0, 5.0], "observation.count": [1.0, 1.0]}).actuators[0].low == -2


def test_from_an_expert_to_a_program_that_drives() -> None:
    env = gymnasium.make("CartPole-v1", max_episode_steps=100)
    log = collect(env, lambda seen: int(seen[2] + 0.25 * seen[3] + 0.02 * seen[0] + 0.06 * seen[1] > 0), 3, seed=5)
    schema = Schema.from_env(env, log)
    bank = BehaviourBank(Space(schema))
    bank.learn("balance", Demonstrations.from_data(log, schema))
    tick = bank["balance"].freeze()

    def clone(seen: Any) -> Any:
        return action_of(env, tick(readings_of(env, seen)[None]).commands[0])

    def constant(_: Any) -> int:
        return 1

    assert len(collect(env, clone, 2, seed=100)) > 120 > 40 > len(collect(env, constant, 2, seed=100))


@pytest.mark.parametrize(
    ("env", "options", "why"),
    [
        (Rig(), {"episodes": 0}, "episodes is a whole number of at least 1"),
        (Rig(), {"sensors": ["a"]}, r"the observation has 11 elements .*; got 1 names"),
        (Rig(done=spaces.Text(3)), {}, "the action space Text.* has no numbers to read .*Text"),
        (Rig(done=spaces.Tuple((spaces.Text(3), spaces.Discrete(2)))), {}, r"action\[0\] .* cannot be an actuator"),
        (Rig(seen=SEEN["camera"]), {}, "has no numbers to read .*8 x 8 x 3"),
        (Rig(done=spaces.Box(0, 1, (2,))), {}, r"action\[0\] needs values of shape \(1, 2\)"),
        (gymnasium.make_vec("CartPole-v1", 2, vectorization_mode="sync"), {}, "a single environment"),
    ],
)
def test_mistakes_take_one_line(env: Any, options: dict[str, Any], why: str) -> None:
    with pytest.raises(ValueError, match=why) as caught:
        collect(env, lambda seen: 0, options.pop("episodes", 1), **options)
    assert "\n" not in str(caught.value)


def test_what_is_no_environment_or_cannot_be_commanded_is_refused() -> None:
    with pytest.raises(ValueError, match="expected an environment of Gymnasium; got str"):
        Schema.from_env("CartPole-v1")
    with pytest.raises(ValueError, match="action is always 0"):
        Schema.from_env(Rig(seen=spaces.Box(0, 1), done=spaces.Discrete(1)))
