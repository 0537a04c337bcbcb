"""A device that there is not: its tensors say that they lie on it, and are computed with on the CPU.

What would fail on a GPU fails here too: mixing tensors of two devices, or handing one to NumPy. PyTorch learns of the
device when this is imported, for good, so that it belongs in a process of its own: see `devices`.
"""

from collections.abc import Callable
from copy import deepcopy
from typing import Any, cast

import torch
from torch import Tensor, nn
from torch._library.custom_ops import OPDEFS
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils.backend_registration import _setup_privateuseone_for_python_backend

NAME = "pretended"
TOLERANCE, TRAINED = 1e-5, 1e-5
"""How far floats may be from those of the CPU, which computes them; and those of a program that was trained."""
aten = torch.ops.aten

_setup_privateuseone_for_python_backend(NAME)


class Elsewhere(Tensor):
    """A tensor on the device, around the one on the CPU that stands for it."""

    content: Tensor

    @staticmethod
    def __new__(cls, inner: Tensor) -> "Elsewhere":
        layout = {"strides": inner.stride(), "storage_offset": inner.storage_offset(), "dtype": inner.dtype}
        with torch.inference_mode(False):  # else views of tensors from outside that mode could not be made in it
            return Tensor._make_wrapper_subclass(cls, inner.shape, device=torch.device(NAME, 0), **layout)

    def __init__(self, inner: Tensor) -> None:
        self.content = inner

    @classmethod
    def __torch_dispatch__(cls, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return _run(func, args, kwargs or {})

    def numpy(self, *_: Any, **__: Any) -> Any:
        raise TypeError("a tensor elsewhere has no NumPy array; copy it to the CPU first")

    def tolist(self) -> Any:
        waited.append("tolist")
        return self.content.tolist()

    __array__ = numpy


class Pretended(TorchDispatchMode):
    """While it is on, tensors can be made on the device and moved to it."""

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return _run(func, args, kwargs or {})


def on() -> Pretended:
    """What makes the device be there."""
    return Pretended()


_VIEWS: dict[Any, Any] = {aten._conj.default: aten.conj_physical.default, aten._neg_view.default: aten.neg.default}
"""Views that the CPU sees through and a device made in Python does not, and what takes their place."""
waited: list[str] = []
"""Operations that had to wait until values on the device were known, in order."""
_INDEXING = {aten.index.Tensor, aten.index_put.default, aten.index_put_.default}
_WAITS = {
    aten._local_scalar_dense.default, aten.equal.default, aten.nonzero.default, aten.masked_select.default,
    aten._unique2.default, aten.unique_dim.default,
}  # fmt: skip


def _run(func: Any, args: Any, kwargs: dict[str, Any]) -> Any:
    if func.namespace == "torchvsa":
        # Our operators are made of PyTorch's, which run where their tensors are.
        with Pretended():
            return cast(Any, OPDEFS[func._schema.name])._init_fn(*args, **kwargs)
    if func in _INDEXING and isinstance(args[0], Elsewhere):
        # An index from the CPU is welcome on a GPU.
        args = (args[0], [None if index is None else index.to(NAME) for index in args[1]], *args[2:])
    tensors: list[Tensor] = []
    _changed((args, kwargs), lambda x: tensors.append(x) or x)
    there = [x for x in tensors if isinstance(x, Elsewhere)]
    moves = func in (aten._to_copy.default, aten.copy_.default)
    if there and not moves and any(x.dim() > 0 and not isinstance(x, Elsewhere) for x in tensors):
        raise RuntimeError(f"{func} got tensors on the CPU and on another device")
    answers_there = isinstance(args[0], Elsewhere) if func is aten.copy_.default else bool(there)
    if kwargs.get("device") is not None:
        answers_there = torch.device(kwargs["device"]).type == NAME
        kwargs = {**kwargs, "device": "cpu"}
    masked = func in _INDEXING and any(x.dtype == torch.bool for x in there[1:])
    if there and (func in _WAITS or masked or (moves and not answers_there)):
        waited.append(str(func))
    args, kwargs = _changed((args, kwargs), lambda x: x.content if isinstance(x, Elsewhere) else x)
    answer = _VIEWS.get(func, func)(*args, **kwargs)
    if not answers_there:
        return answer
    known = {id(x.content): x for x in there}  # what was changed in place is the same tensor again
    return _changed(answer, lambda t: known[id(t)] if id(t) in known else Elsewhere(t))


def _changed(tree: Any, change: Callable[[Tensor], Tensor]) -> Any:
    """The same tree of tuples, lists and dicts with other tensors; PyTorch's own walk takes most of a test's time."""
    if isinstance(tree, Tensor):
        return change(tree)
    if isinstance(tree, (tuple, list)):
        return type(tree)([_changed(part, change) for part in tree])
    if isinstance(tree, dict):
        return {key: _changed(part, change) for key, part in tree.items()}
    return tree


_library = torch.library.Library("aten", "IMPL")


def _empty_strided(size: Any, stride: Any, dtype: Any = None, **_: Any) -> Tensor:
    return Elsewhere(torch.empty_strided(size, stride, dtype=dtype))


def _copy_from(source: Tensor, target: Tensor, non_blocking: bool = False) -> Tensor:
    if not isinstance(source, Elsewhere):
        waited.append("copying numbers")
    here = [x.content if isinstance(x, Elsewhere) else x for x in (target, source)]
    here[0].copy_(here[1])
    return target


# What PyTorch asks of a device behind the back of a mode: moving an index, or a list of numbers.
_library.impl("empty_strided", _empty_strided, "PrivateUse1")
_library.impl("_copy_from", _copy_from, "PrivateUse1")


def moved(x: Tensor | nn.Module) -> Any:
    """A copy of a tensor or a module on the device."""
    return deepcopy(x).to(NAME)


def brought_back(x: Any) -> Any:
    """The tensors of an answer, on the CPU; raises if one of them is there already."""
    if isinstance(x, tuple):
        return tuple(brought_back(part) for part in x if part is not None)
    if not isinstance(x, Elsewhere):
        raise AssertionError("an answer came back on the CPU")
    return x.content
