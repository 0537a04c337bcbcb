"""Export behaviours to ONNX, for robots without Python.

This module needs the packages of the extra `onnx`, and is not imported by `behaviours`.
"""

import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from behaviours.behaviour import Behaviour
from behaviours.composition.base import Policy
from behaviours.storage import write_atomically

OUTPUTS = ("commands", "similarity", "margin", "familiarity", "speaker")
"""The outputs of a file: those of `Recall`, `speaker` for policies only."""


def to_onnx(behaviour: Behaviour | Policy, path: str | Path) -> Path:
    """Write a behaviour or policy to one ONNX file, completely or not at all.

    | | name | type and shape |
    |---|---|---|
    | input | `readings` | float64 `[batch, n]`; NaN means not observed; values out of range are clipped |
    | outputs | `commands` | float64 `[batch, m]`; NaN where no sensor was observed |
    | | `similarity`, `margin`, `familiarity` | float32 `[batch]`, see `Recall` |
    | | `speaker` | int64 `[batch]`, for a policy only |

    The file contains the current codebooks, program and clean-up memory, and in its metadata the names of sensors and
    actuators as JSON. Integer codes give the same bits as the module. (`torch.onnx.export(behaviour, (readings,),
    dynamo=True, dynamic_shapes=({0: "batch"},))` writes the same graph.)

    Raises `ImportError` without the packages, `OSError` if the file cannot be written, and `ValueError` for complex
    codes (FHRR), which ONNX lacks.

        >>> to_onnx(bank["seek_light"], "seek_light.onnx")                                  # doctest: +SKIP
        >>> session = onnxruntime.InferenceSession("seek_light.onnx")                       # doctest: +SKIP
        >>> commands, similarity, *_ = session.run(None, {"readings": readings.numpy()})    # doctest: +SKIP
    """
    space = behaviour.space
    if space.vsa.dtype.is_complex:
        raise ValueError(
            f"ONNX has no complex numbers, so that {space.vsa} cannot be exported; use a real architecture"
        )
    if not Path(path).absolute().parent.is_dir():  # told before seconds of work
        raise FileNotFoundError(f"cannot write {path}: there is no such folder")
    answer = _Answer(behaviour)
    names = list(OUTPUTS if isinstance(behaviour, Policy) else OUTPUTS[:-1])
    # Two rows: a batch size of 1 would be taken as constant.
    rows = torch.zeros(2, len(space.schema.sensors), dtype=torch.float64)
    try:
        with _quiet(), _eval_mode(answer):
            # Exported explicitly, since the converter would fall back to a fixed batch size without an error.
            graph = torch.export.export(answer, (rows,), dynamic_shapes=({0: torch.export.Dim("batch")},))
            exported = torch.onnx.export(
                graph,
                dynamo=True,
                input_names=["readings"],
                output_names=names,
                verbose=False,
            )
    except (ModuleNotFoundError, torch.onnx.OnnxExporterError) as error:
        missing = error if isinstance(error, ModuleNotFoundError) else error.__cause__
        if isinstance(missing, ModuleNotFoundError):
            raise ImportError(f"ONNX files need more packages: pip install 'torchvsa[onnx]' ({missing})") from error
        raise
    assert exported is not None
    model = exported.model_proto
    for key, parts in (("sensors", space.schema.sensors), ("actuators", space.schema.actuators)):
        model.metadata_props.add(key=key, value=json.dumps([part.name for part in parts]))
    return write_atomically(path, model.SerializeToString())


class _Answer(nn.Module):
    """A behaviour that returns a plain tuple."""

    def __init__(self, behaviour: Behaviour | Policy) -> None:
        super().__init__()
        self.behaviour = behaviour

    def forward(self, readings: Tensor) -> tuple[Any, ...]:
        return tuple(part for part in self.behaviour(readings) if part is not None)


@contextmanager
def _eval_mode(module: nn.Module) -> Iterator[None]:
    """Switch to evaluation mode, and restore the mode of each module on exit."""
    before = [(part, part.training) for part in module.modules()]
    module.eval()
    try:
        yield
    finally:
        for part, training in before:
            part.training = training


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence the log and the deprecation warnings of the exporter."""
    log = logging.getLogger("torch.onnx")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)
            warnings.simplefilter("ignore", DeprecationWarning)
            yield
    finally:
        log.setLevel(level)
