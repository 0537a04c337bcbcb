"""Laws that every learning rule and every policy keeps, to run on those of your own.

>>> from behaviours import OneShot, Priority
>>> from behaviours.testing import check_policy, check_rule
>>> check_rule(OneShot(novelty="similarity"))
>>> check_policy(Priority)

Each raises `AssertionError` that names the first law that is broken. They run over a space of their own, or over the
one that is given, with which architecture and encoder are chosen; take at least 1,000 dimensions. For architectures
and encoders themselves see `torchvsa.testing`.
"""

from behaviours.testing.policies import check_policy
from behaviours.testing.rules import check_rule

__all__ = ["check_policy", "check_rule"]
