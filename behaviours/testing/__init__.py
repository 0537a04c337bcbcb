"""Check that a learning rule or a policy obeys the laws of its interface.

>>> from behaviours import OneShot, Priority
>>> from behaviours.testing import check_policy, check_rule
>>> check_rule(OneShot(novelty="similarity"))
>>> check_policy(Priority)

Each raises `AssertionError` that names the first broken law. The checks use a default space, or a given one, which
chooses architecture and encoder and needs at least 1,000 dimensions. To check architectures and encoders, see
`torchvsa.testing`.
"""

from behaviours.testing.policies import check_policy
from behaviours.testing.rules import check_rule

__all__ = ["check_policy", "check_rule"]
