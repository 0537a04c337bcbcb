"""Export behaviours to ONNX, for robots without Python.

This module needs the packages of the extra `onnx`, and is not imported by `behaviours`.
"""

import json
import logging
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from behaviours.behaviour import Behaviour
from behaviours.composition.base import Policy
from behaviours.schema import Schema
from behaviours.storage import write_atomically

OUTPUTS = ("commands", "similarity", "margin", "familiarity", "speaker")
"""The outputs of a file: those of `Recall`, `speaker` for policies only."""


def to_onnx(
    behaviour: Behaviour | Policy | Any,
    path: str | Path,
    *,
    dtype: torch.dtype = torch.float64,
    labels: Mapping[str, Sequence[Any]] | None = None,
) -> Path:
    """Write a behaviour, a policy, or a fitted `BehaviourClassifier` to one ONNX file, completely or not at all.

    | | name | type and shape |
    |---|---|---|
    | input | `readings` | float64 or float32 `[batch, n]`; NaN means not observed; values out of range are clipped |
    | outputs | `commands` | float64 or float32 `[batch, m]`, as the input; NaN where no sensor was observed |
    | | `similarity`, `margin`, `familiarity` | float32 `[batch]`, see `Recall` |
    | | `speaker` | int64 `[batch]`, for a policy only |

    The file contains the current codebooks, program and clean-up memory. Its metadata are JSON: `sensors` and
    `actuators` list names, `schema` has ranges, units and kinds (see `Schema.to_dict`), and `labels` what the commands
    0, 1, ... of an actuator stand for; a classifier brings its classes. Integer codes
    give the same bits as the module. (`torch.onnx.export(behaviour, (readings,), dynamo=True, dynamic_shapes=({0:
    "batch"},))` writes the same graph.)

    Args:
        behaviour: What answers.
        path: The file.
        dtype: Of readings and commands; thresholds are compared in float64 in any case.
        labels: What the commands 0, 1, ... of an actuator stand for, by its name.

    Raises `ImportError` without the packages, `OSError` if the file cannot be written, and `ValueError` for complex
    codes (FHRR), which ONNX lacks, another `dtype`, and labels of an unknown actuator or not one for each level.

        to_onnx(bank["seek_light"], "seek_light.onnx")
        session = onnxruntime.InferenceSession("seek_light.onnx")
        commands, similarity, *_ = session.run(None, {"readings": readings.numpy()})
    """
    labels = dict(labels or {})
    fitted: Any = behaviour
    if hasattr(fitted, "behaviour_"):  # a classifier, whose module needs scikit-learn
        classes, behaviour = fitted.classes_.tolist(), fitted.behaviour_
        labels = {behaviour.space.schema.actuators[0].name: classes} | labels
    space = behaviour.space
    if dtype not in (torch.float64, torch.float32):
        raise ValueError(f"dtype is torch.float64 or torch.float32; got {dtype}")
    written = _labels(labels, space.schema)
    if space.vsa.dtype.is_complex:
        raise ValueError(
            f"ONNX has no complex numbers, so that {space.vsa} cannot be exported; use a real architecture"
        )
    if not Path(path).absolute().parent.is_dir():  # told before seconds of work
        raise FileNotFoundError(f"cannot write {path}: there is no such folder")
    answer = _Answer(behaviour, dtype)
    names = list(OUTPUTS if isinstance(behaviour, Policy) else OUTPUTS[:-1])
    # Two rows: a batch size of 1 would be taken as constant.
    rows = torch.zeros(2, len(space.schema.sensors), dtype=dtype)
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
    about = {key: [part.name for part in getattr(space.schema, key)] for key in ("sensors", "actuators")}
    about |= {"schema": space.schema.to_dict(), **({"labels": written} if written else {})}
    for key, value in about.items():
        model.metadata_props.add(key=key, value=json.dumps(value))
    return write_atomically(path, model.SerializeToString())


def _labels(given: Mapping[str, Sequence[Any]], schema: Schema) -> dict[str, list[Any]]:
    """The labels by actuator, as JSON can hold them. Raises `ValueError` for wrong ones."""
    actuators = {actuator.name: actuator for actuator in schema.actuators}
    for name, labels in given.items():
        if name not in actuators:
            raise ValueError(f"labels has {name!r}, but the actuators are {', '.join(actuators)}")
        if isinstance(labels, str) or len(labels) != actuators[name].levels:
            raise ValueError(f"actuator {name!r} has {actuators[name].levels} levels; got the labels {labels!r:.80}")
    return {name: [str(one) if not isinstance(one, int | float) else one for one in given[name]] for name in given}


class _Answer(nn.Module):
    """A behaviour that returns a plain tuple, with commands of the type of the readings."""

    def __init__(self, behaviour: Behaviour | Policy, dtype: torch.dtype) -> None:
        super().__init__()
        self.behaviour, self.dtype = behaviour, dtype

    def forward(self, readings: Tensor) -> tuple[Any, ...]:
        commands, *others = self.behaviour(readings.to(torch.float64))
        return (commands.to(self.dtype), *(part for part in others if part is not None))


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
