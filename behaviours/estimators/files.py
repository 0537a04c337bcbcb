"""Files of fitted estimators: parameters, codebooks and tensors in one safetensors file."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from torch import Tensor

from behaviours.estimators.base import QuantileEncoding
from behaviours.estimators.shares import share_of
from behaviours.space import Space
from behaviours.storage import check_layout, error_context, load_tensors, save_tensors

Model = TypeVar("Model", bound=QuantileEncoding)


def save_fitted(
    path: str | Path, model: QuantileEncoding, space: Space, tensors: Mapping[str, Tensor], about: Mapping[str, Any]
) -> Path:
    """Write a fitted estimator with its space, its tensors and what else `load_fitted` is to restore.

    Raises `ValueError` if `random_state` is a generator.
    """
    parameters = {
        name: value.item() if isinstance(value, np.generic) else value for name, value in model.get_params().items()
    }
    if not isinstance(parameters["random_state"], int | None):
        raise ValueError(
            "random_state is a generator, which a file does not hold; set_params(random_state=None) before save"
        )
    names = getattr(model, "feature_names_in_", None)
    config = space.config()
    codebooks = {f"space.{name}": tensor for name, tensor in space.state_dict().items()}
    check_layout(codebooks, {f"space.{name}": spec for name, spec in Space.layout(config).items()})
    head = {"parameters": parameters, "features": names if names is None else list(names), "space": config}
    return save_tensors(path, type(model).__name__, codebooks | dict(tensors), {**head, **about})


def load_fitted(
    path: str | Path,
    kind: type[Model],
    names: Sequence[str],
    restore: Callable[[Model, Space, dict[str, Tensor], dict[str, Any]], None],
) -> Model:
    """Read a file of `save_fitted`; `restore` gets the new estimator, its space, the tensors `names` and the rest.

    All tensors are compared with the description before any object is created. Raises `ValueError` that names the file
    and what in it is wrong.
    """
    tensors, about = load_tensors(path, kind.__name__)
    with error_context(f"{path} does not describe a {kind.__name__} of this version"):
        with error_context("space"):
            layout = {f"space.{name}": spec for name, spec in Space.layout(about["space"]).items()}
            check_layout({name: tensor for name, tensor in tensors.items() if name not in names}, layout)
            space = Space.from_config(about["space"], {name.removeprefix("space."): tensors[name] for name in layout})
        with error_context("parameters"):
            model = kind(**about["parameters"])
            model.check_parameters()
        sensors, features = len(space.schema.sensors), about["features"]
        if features is not None:
            if len(features) != sensors or not all(isinstance(name, str) for name in features):
                raise ValueError(f"features must be {sensors} names, or null; got {features!r:.200}")
            model.feature_names_in_ = np.array(features, dtype=object)
        model.n_features_in_, model.oblique_ = sensors, share_of(space)
        restore(model, space, {name: tensors[name] for name in names}, about)
    return model
