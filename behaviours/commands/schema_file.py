"""A schema as a YAML file that is read and corrected by hand."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from behaviours.data.log import needed
from behaviours.schema import Schema
from behaviours.storage import error_context, write_atomically


def write_schema(path: str | Path, schema: Schema, by: str | None = None, notes: Sequence[str] = ()) -> Path:
    """Write a schema, the column that names the runs, and lines of comment; whole or not at all. Needs PyYAML."""
    yaml: Any = needed("yaml", "a schema file", "pyyaml")
    parts = schema.to_dict()
    for sensor in parts["sensors"]:
        if "values" in sensor:
            # Both define the range.
            sensor["values"] = list(sensor["values"])
            del sensor["low"], sensor["high"]
        if sensor.get("kind") == "binary":
            del sensor["low"], sensor["high"]
    kept = {key: [{k: v for k, v in part.items() if v not in ("", "error")} for part in parts[key]] for key in parts}
    text = "".join(f"# {' '.join(note.split())}\n" for note in notes)
    text += yaml.safe_dump(({} if by is None else {"by": by}) | kept, sort_keys=False, allow_unicode=True)
    return write_atomically(path, text.encode())


def read_schema(path: str | Path) -> tuple[Schema, str | None]:
    """The schema in a file, and the column that names the runs. Raises `ValueError` that names the file."""
    yaml: Any = needed("yaml", "a schema file", "pyyaml")
    try:
        data = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is no readable YAML: {' '.join(str(error).split())}") from None
    with error_context(str(path)):
        if not isinstance(data, dict) or not {"sensors", "actuators"} <= set(data) <= {"sensors", "actuators", "by"}:
            raise ValueError("expected the entries sensors, actuators and, if there are several runs, by")
        by = data.get("by")
        if not isinstance(by, str | None):
            raise ValueError(f"by is the name of a column; got {by!r:.80}")
        return Schema.from_dict(data), by
