"""When the next episode of a vector environment begins: Gymnasium's autoreset modes."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import sim

LIMIT = 230  # some of the teacher's episodes end at the lamp, others run out of time
ROBOTS = 3


def made(mode: str, **options: Any) -> gymnasium.vector.VectorEnv[Any, Any, Any]:
    return gymnasium.make_vec(
        "CorralEscape-v0", num_envs=ROBOTS, max_episode_steps=LIMIT, autoreset_mode=mode, **options
    )


def episodes_of(mode: str, steps: int, **options: Any) -> dict[int, list[tuple[Any, ...]]]:
    """All episodes that were played to their end, driven by the teacher: observation, reward, ends, pose per step."""
    env, teacher = made(mode, **options), sim.Teacher()
    seen, info = env.reset(seed=5)
    found: dict[int, list[tuple[Any, ...]]] = {
        k: [(tuple(seen[k]), 0.0, False, False, tuple(info["pose"][k]))] for k in range(ROBOTS)
    }
    finished = set()
    for _ in range(steps):
        seen, rewards, terminated, truncated, info = env.step(teacher(seen))
        last, about = info.get("final_obs", [None] * ROBOTS), info.get("final_info", {})
        for row in range(ROBOTS):
            episode = int(info["episode"][row])
            ends = float(rewards[row]), bool(terminated[row]), bool(truncated[row])
            if last[row] is not None:
                ended = int(about["episode"][row])
                assert episode == ended + ROBOTS
                found[ended].append((tuple(last[row]), *ends, tuple(about["pose"][row])))
                finished.add(ended)
                ends = 0.0, False, False
            elif ends[1] or ends[2]:
                finished.add(episode)
            found.setdefault(episode, []).append((tuple(seen[row]), *ends, tuple(info["pose"][row])))
    env.close()
    return {episode: found[episode] for episode in finished}


@pytest.mark.parametrize("options", [{}, {"engine": "bullet"}], ids=["vector", "bullet"])
def test_both_modes_play_the_same_episodes_with_the_same_bits(options: dict[str, str]) -> None:
    found = {mode: episodes_of(mode, 500, **options) for mode in ("next_step", "same_step")}
    shared = set(found["next_step"]) & set(found["same_step"])
    assert len(shared) >= 2 * ROBOTS
    assert all(found["next_step"][episode] == found["same_step"][episode] for episode in shared)
    ends = {found["same_step"][episode][-1][1:4] for episode in shared}
    assert ends == {(1.0, True, False), (0.0, False, True)}


def test_the_last_observation_is_told_as_gymnasium_does() -> None:
    """The same format as that of Gymnasium's own vector environment around single ones."""

    def single() -> gymnasium.Env[Any, Any]:
        return gymnasium.make("CorralEscape-v0", max_episode_steps=LIMIT)

    ours, theirs = made("same_step"), SyncVectorEnv([single] * ROBOTS, autoreset_mode=AutoresetMode.SAME_STEP)
    teacher = sim.Teacher()
    seen, _ = ours.reset(seed=5)
    for row, env in enumerate(theirs.envs):
        env.reset(seed=5, options={"episode": row})
    ended = 0
    for _ in range(LIMIT):  # up to the first end; a single environment goes on with another episode
        actions = teacher(seen)
        seen, rewards, terminated, truncated, info = ours.step(actions)
        _, *others, other = theirs.step(actions)
        assert [rewards.tolist(), terminated.tolist(), truncated.tolist()] == [part.tolist() for part in others]
        assert ("final_obs" in info) == ("final_obs" in other)
        if "final_obs" not in info:
            continue
        ended += 1
        for key in ("_final_obs", "_final_info"):
            assert info[key].tolist() == other[key].tolist()
        assert info["final_obs"].dtype == other["final_obs"].dtype
        for row in range(ROBOTS):
            assert np.array_equal(info["final_obs"][row], other["final_obs"][row])
            if info["_final_info"][row]:
                for key, column in info["final_info"].items():
                    assert np.array_equal(column[row], other["final_info"][key][row])
        break
    assert ended == 1
    ours.close()
    theirs.close()


@pytest.mark.parametrize("mode", ["next_step", "same_step"])
def test_the_episodes_are_those_that_gymnasium_counts(mode: str) -> None:
    env = RecordEpisodeStatistics(made(mode), stats_key="counted")
    teacher = sim.Teacher()
    seen, _ = env.reset(seed=5)
    lengths = []
    for _ in range(500):
        seen, _, _, _, info = env.step(teacher(np.asarray(seen)))
        if "counted" in info:
            lengths += info["counted"]["l"][info["_counted"]].tolist()
    env.close()
    assert len(lengths) >= 2 * ROBOTS
    expected = {len(steps) - 1 for steps in episodes_of(mode, 500).values()}
    assert set(lengths) == expected


def test_the_mode_is_stated_and_others_are_refused() -> None:
    for name, mode in (("next_step", AutoresetMode.NEXT_STEP), ("same_step", AutoresetMode.SAME_STEP)):
        assert sim.CorralEscapeVectorEnv(2, autoreset_mode=name).metadata["autoreset_mode"] is mode  # pyright: ignore[reportArgumentType]
        assert sim.CorralEscapeVectorEnv(2, autoreset_mode=mode).metadata["autoreset_mode"] is mode
    with pytest.raises(ValueError, match=r"autoreset_mode .*; expected one of 'next_step', 'same_step'"):
        sim.CorralEscapeVectorEnv(2, autoreset_mode=AutoresetMode.DISABLED)
