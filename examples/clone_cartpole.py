"""From a Gymnasium environment to one hypervector: watch an expert for five episodes, then drive.

    python examples/clone_cartpole.py

`BehaviourClassifier` learns which action the expert took; its program is 4,000 numbers. The whole takes 10 s on one
thread and 510 MB, most of it PyTorch and scikit-learn.
"""

import gymnasium
import numpy as np

from behaviours import BehaviourClassifier


def expert(seen: np.ndarray) -> int:
    """Push toward the side to which the pole will fall, and the cart back to the middle."""
    place, speed, angle, turn = seen
    return int(angle + 0.25 * turn + 0.02 * place + 0.06 * speed > 0)


def episode(env: gymnasium.Env, act, seed: int) -> tuple[list, list, float]:
    """The observations, actions and return of one episode."""
    (seen, _), rows, actions, total, over = env.reset(seed=seed), [], [], 0.0, False
    while not over:
        action = act(seen)
        rows.append(seen)
        actions.append(action)
        seen, reward, ended, cut, _ = env.step(action)
        total, over = total + reward, ended or cut
    return rows, actions, total


env = gymnasium.make("CartPole-v1")
shown = [episode(env, expert, seed) for seed in range(100, 105)]
rows, actions = (np.concatenate([one[part] for one in shown]) for part in (0, 1))
model = BehaviourClassifier(random_state=0).fit(rows, actions)
returns = [episode(env, lambda seen: int(model.predict(seen[None])[0]), seed)[2] for seed in range(3)]
print(f"{len(rows)} steps shown; program of {model.behaviour_.program.numel():,} numbers; returns {returns} of 500")
