"""Tiny settings of the generalisation study, and workers that run in this process."""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any, cast

from hydra import compose, initialize_config_module
from omegaconf import OmegaConf
from rich.progress import Progress

SMALL = (
    "vsa.dim=300",
    "corral.demonstrations=[1,2]",
    "corral.draws=[2,1]",
    "corral.encoder=[level]",
    "corral.protection=[none,self_shift]",
    "corral.record=[bind]",
    "corral.rule=[error_driven,one_shot]",
    "corral.arenas=[default,narrow]",
    "corral.rivals=[decision_tree]",
    "corral.starts=4",
    "corral.variant_starts=2",
    "wall_following.dim=200",
    "wall_following.sensors=[2]",
    "wall_following.splits=[blocks]",
    "wall_following.models=[decision_tree,torchhd_vanilla]",
    "smooth.tasks=[corral]",
    "smooth.models=[one_hypervector,ridge]",
    "smooth.dims=[50,200]",
    "smooth.demonstrations=2",
    "smooth.starts=2",
    "seconds=8",
    "workers=1",
)


class Inline(Executor):
    """Runs what it is given at once, in this process."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@contextmanager
def inline_workers(count: int) -> Iterator[Executor]:
    assert count > 0
    yield Inline()


def settings(*overrides: str) -> dict[str, Any]:
    with initialize_config_module("experiments.conf", version_base="1.3"):
        config = compose("generalisation", [*SMALL, *overrides])
    return cast(dict[str, Any], OmegaConf.to_container(config, resolve=True))


def default_settings() -> dict[str, Any]:
    with initialize_config_module("experiments.conf", version_base="1.3"):
        return cast(dict[str, Any], OmegaConf.to_container(compose("generalisation"), resolve=True))


def quiet() -> Progress:
    return Progress(disable=True)
