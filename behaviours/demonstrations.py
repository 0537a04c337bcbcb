"""Demonstrations: what was sensed and what was done about it."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Bool, Float64, Int64
from torch import Tensor

from behaviours.schema import Schema
from behaviours.storage import load_tensors, save_tensors
from torchvsa import ShapeError


class Demonstrations:
    """Pairs of sensor readings `[N, n]` and motor commands `[N, m]`, in the order in which they were shown.

    `episodes` `[N]` says which run each row comes from (all from run 0, if left out). NaN readings were not
    observed. Raises an error for no rows, unequal numbers of rows, and infinite or NaN commands.
    """

    def __init__(self, sensors: Any, commands: Any, episodes: Any = None) -> None:
        self.sensors: Float64[Tensor, "N n"] = torch.as_tensor(sensors, dtype=torch.float64)
        self.commands: Float64[Tensor, "N m"] = torch.as_tensor(commands, dtype=torch.float64)
        for name, rows in (("sensors", self.sensors), ("commands", self.commands)):
            if rows.dim() != 2 or rows.shape[1] == 0:
                raise ShapeError(f"{name} must be rows of values, [N, columns]; got shape {tuple(rows.shape)}")
        count = len(self.sensors)
        if count == 0:
            raise ValueError("a demonstration needs at least one row; this one is empty")
        if episodes is None:
            episodes = torch.zeros(count)
        self.episodes: Int64[Tensor, "N"] = torch.as_tensor(episodes).to(torch.int64)
        if self.episodes.dim() != 1:
            raise ShapeError(f"episodes must be one number per row, [N]; got shape {tuple(self.episodes.shape)}")
        for name, rows in (("commands", self.commands), ("episodes", self.episodes)):
            if len(rows) != count:
                raise ShapeError(f"{name} has {len(rows)} rows, but sensors has {count}; each row is one moment")
        if self.sensors.isinf().any():
            row, column = self.sensors.isinf().nonzero()[0].tolist()
            raise ValueError(f"sensors has an infinite value in row {row}, column {column}; use NaN for 'not observed'")
        if not self.commands.isfinite().all():
            row, column = (~self.commands.isfinite()).nonzero()[0].tolist()
            raise ValueError(f"commands has {self.commands[row, column].item()} in row {row}, column {column}")

    def __len__(self) -> int:
        return len(self.sensors)

    def __repr__(self) -> str:
        return (
            f"Demonstrations({len(self)} rows, {self.sensors.shape[1]} sensors, {self.commands.shape[1]} actuators, "
            f"{len(self.episodes.unique())} episodes)"
        )

    def check(self, schema: Schema) -> None:
        """Raise unless the columns are those of `schema` and every value is in range."""
        schema.check_readings(self.sensors)
        schema.command_levels(self.commands)

    def where(self, keep: Bool[Tensor, "N"] | Sequence[bool]) -> "Demonstrations":
        """The rows for which `keep` is true."""
        mask = torch.as_tensor(keep, dtype=torch.bool)
        return Demonstrations(self.sensors[mask], self.commands[mask], self.episodes[mask])

    @staticmethod
    def join(parts: Iterable["Demonstrations"]) -> "Demonstrations":
        """Several demonstrations one after the other, with their episode numbers as they are."""
        parts = list(parts)
        return Demonstrations(*(torch.cat([getattr(p, f) for p in parts]) for f in ("sensors", "commands", "episodes")))

    def save(self, path: str | Path) -> Path:
        """Write to one safetensors file, whole or not at all."""
        tensors = {"sensors": self.sensors, "commands": self.commands, "episodes": self.episodes}
        return save_tensors(path, "demonstrations", tensors, {"rows": len(self)})

    @classmethod
    def load(cls, path: str | Path) -> "Demonstrations":
        """Read what `save` wrote."""
        tensors, _ = load_tensors(path, "demonstrations")
        try:
            return cls(tensors["sensors"], tensors["commands"], tensors["episodes"])
        except (KeyError, ValueError) as error:
            raise ValueError(f"{path} does not hold demonstrations of this version: {error}") from error
