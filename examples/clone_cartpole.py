"""From a Gymnasium environment to one hypervector: watch an expert for five episodes, then drive.

    python examples/clone_cartpole.py

`BehaviourClassifier` learns which action the expert took; its program is 4,000 numbers. The whole takes 10 s on one
thread and 510 MB, most of it PyTorch and scikit-learn.
"""

import gymnasium
import numpy as np

from behaviours import BehaviourClassifier
from behaviours.data import collect


def expert(seen: np.ndarray) -> int:
    """Push toward the side to which the pole will fall, and the cart back to the middle."""
    place, speed, angle, turn = seen
    return int(angle + 0.25 * turn + 0.02 * place + 0.06 * speed > 0)


env = gymnasium.make("CartPole-v1")
shown = collect(env, expert, episodes=5, seed=100)
rows = np.stack([shown[name] for name in shown.sensors], 1)
model = BehaviourClassifier(random_state=0).fit(rows, shown[shown.actuators[0]].astype(int))
# Each step is rewarded with 1.
returns = [len(collect(env, lambda seen: int(model.predict(seen[None])[0]), 1, seed)) for seed in range(3)]
print(f"{len(rows)} steps shown; program of {model.behaviour_.program.numel():,} numbers; returns {returns} of 500")
