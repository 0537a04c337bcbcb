"""CSV and Parquet files, written by pandas and pyarrow, are read with names, units and missing values."""

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet

from behaviours.data import read, read_csv, read_parquet

FRAME = pd.DataFrame(
    {
        "run": [0, 0, 1],
        "front [m]": [0.5, np.nan, 2.0],
        "bumper": [True, False, True],
        "mode": ["follow", None, "turn, left"],
        "v": [-0.25, 1e-3, 0.5],
    }
)


def test_what_pandas_writes_is_read(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("comma.csv", "tab.tsv", "semicolon.csv", "log.parquet")]
    for path, separator in zip(paths, (",", "\t", ";"), strict=False):
        FRAME.to_csv(path, sep=separator, index=False)
    FRAME.to_parquet(paths[-1])
    for path in paths:
        log = read(path)
        assert log.columns == ["run", "front", "bumper", "mode", "v"]
        assert log.units == {"front": "m"}
        for name in ("run", "front", "bumper", "v"):
            title = "front [m]" if name == "front" else name
            assert np.array_equal(log[name].astype(float), FRAME[title].to_numpy(float), equal_nan=True)
        assert log["mode"].tolist() == ["follow", None, "turn, left"]


def test_units_of_parquet_fields(tmp_path: Path) -> None:
    schema = pa.schema([pa.field("front", pa.float32(), metadata={"unit": "m"}), pa.field("image", pa.binary())])
    parquet.write_table(pa.table({"front": [0.5, None], "image": [b"1", b"2"]}, schema), tmp_path / "log.parquet")
    log = read_parquet(tmp_path / "log.parquet")
    assert log.units == {"front": "m"}
    assert np.array_equal(log["front"], [0.5, np.nan], equal_nan=True)
    assert "binary" in log.left_out["image"]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "is empty"),
        ("\n1,2\n", "the first line names no columns"),
        ("front,v\n", "has no rows below its first line, front, v"),
        ("front,front\n1,2\n", "each column needs a name of its own"),
        ("front,\n1,2\n", "each column needs a name of its own"),
        ("front,v\n1,2\n1,2,3\n", "Expected 2 columns, got 3"),
        ("front,v\n" + "1,2\n" * 20 + "abc,2\n", "column 'front' holds numbers, but 'abc' in line 22"),
    ],
)
def test_mistakes_in_a_csv_file_take_one_line(text: str, why: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=why) as caught:
        read_csv(path)
    assert "\n" not in str(caught.value)
    assert "log.csv" in str(caught.value)


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="there is no file"):
        read(tmp_path / "log.csv")
    (tmp_path / "log.xyz").write_text("1")
    with pytest.raises(ValueError, match=r"cannot tell its format; a log is one of \.csv"):
        read(tmp_path / "log.xyz")
    (tmp_path / "log.parquet").write_text("no Parquet")
    with pytest.raises(ValueError, match="is no readable Parquet file"):
        read(tmp_path / "log.parquet")
