"""Settings of studies on the kit, as their commands compose them."""

from typing import Any

from hydra import compose, initialize_config_module

from experiments.kit import Study
from experiments.kit.command import register
from experiments.kit.run import settings_of


def composed(study: Study, *overrides: str) -> Any:
    """The settings of a study with Hydra's overrides."""
    register(study)
    with initialize_config_module("experiments.kit.conf", version_base="1.3"):
        return settings_of(study, compose(study.name, list(overrides)))
