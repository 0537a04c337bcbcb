"""Operators of our own: each does what a line or two of PyTorch say, faster.

They run outside of graphs, gradients and `vmap`, so that they may write in place and call what has no rules for those.
Where a gradient is wanted, in exported graphs and mostly on a GPU, PyTorch's own lines stand instead.
"""

from torchvsa.operators.look_up import entries, looked_up
from torchvsa.operators.matrix import integer_product
from torchvsa.operators.rotation import rotated

__all__ = ["entries", "integer_product", "looked_up", "rotated"]
