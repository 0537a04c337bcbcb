"""`torchvsa show FILE`: what is in a bank or a demonstration file."""

from collections.abc import Iterator
from pathlib import Path

from behaviours.bank import BehaviourBank
from behaviours.demonstrations import Demonstrations
from behaviours.parts import span


def show(path: str | Path) -> str:
    """A description in lines of text. Raises `ValueError` for a file that is neither."""
    try:
        return "\n".join(_bank(BehaviourBank.load(path)))
    except ValueError as problem:
        try:
            return "\n".join(_demonstrations(Demonstrations.load(path)))
        except ValueError:
            raise problem from None


def _bank(bank: BehaviourBank) -> Iterator[str]:
    schema, parts = bank.space.schema, bank.space
    yield f"bank of {len(bank)} behaviour{'' if len(bank) == 1 else 's'} over {parts.vsa}"
    yield f"encoder     {parts.encoder.config()['name']}, protection {parts.protect.config()['name']}"
    for sensor in schema.sensors:
        unit = f" {sensor.unit}" if sensor.unit else ""
        what = f"one of {', '.join(map(str, sensor.values))}{unit}" if sensor.values else span(sensor)
        yield f"sensor      {sensor.name}: {what}, {sensor.kind}"
    for actuator in schema.actuators:
        yield f"actuator    {actuator.name}: {span(actuator)}, {actuator.levels} levels"
    for name in bank:
        behaviour, report = bank[name], bank[name].report
        used = (
            ""
            if len(behaviour.space.sensors) == len(schema.sensors)
            else f", uses {', '.join(behaviour.space.sensors)}"
        )
        missed = "off by more than half a level" if behaviour.smooth else "not recalled"
        wrong = f", {report.wrong} {missed}" if report.wrong else ""
        made = f"sum of {', '.join(report.terms)}" if report.terms else f"{report.pairs} pairs by {report.rule}{wrong}"
        gives = "smooth commands" if behaviour.smooth else f"{len(behaviour.results)} results"
        yield f"behaviour   {name}: {made}, {gives}{used}"


def _demonstrations(shown: Demonstrations) -> Iterator[str]:
    yield f"demonstrations of {len(shown)} rows in {len(shown.episodes.unique())} episodes"
    for kind, values, names in (
        ("sensor", shown.sensors, shown.sensor_names),
        ("command", shown.commands, shown.actuator_names),
    ):
        for place, column in enumerate(values.T):
            seen = column[~column.isnan()]
            name = names[place] if names else f"number {place}"
            reach = f"{seen.min().item():g} to {seen.max().item():g}" if len(seen) else "never observed"
            gaps = len(column) - len(seen)
            yield f"{kind:11} {name}: {reach}{f', {gaps} not observed' if gaps else ''}"
