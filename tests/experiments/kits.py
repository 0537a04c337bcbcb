"""Settings of studies on the kit, as their commands compose them."""

import copy
from typing import Any

from hydra import compose, initialize_config_module

from experiments.kit import Study
from experiments.kit.command import register
from experiments.kit.run import settings_of

_found: dict[tuple[str, ...], Any] = {}


def composed(study: Study, *overrides: str) -> Any:
    """The settings of a study with Hydra's overrides; the same ones are composed once, since Hydra is slow."""
    key = (study.name, *overrides)
    if key not in _found:
        register(study)
        with initialize_config_module("experiments.kit.conf", version_base="1.3"):
            _found[key] = settings_of(study, compose(study.name, list(overrides)))
    return copy.deepcopy(_found[key])
