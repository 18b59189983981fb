"""The table as others read it: types, units, and the same rows in each format."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from handfast.datasets.labels.label_columns import (
    COLUMN_NAMES,
    LABEL_COLUMNS,
    SCHEMA,
    SUMMARY_COLUMNS,
    LabelSummary,
    broken,
    complete,
    edges,
)
from handfast.datasets.labels.label_dataset import label_dataset
from handfast.datasets.labels.label_files import BrokenFile, LinesFormat, load_labels
from handfast.datasets.labels.labeller import Labelling
from tests.support.labelled import fixture, heavy, write_lines

LITTLE = Labelling(directions=1, gravity=((0, 0, -1.0),), nodes=300)


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The same labels as Parquet and as JSON lines: two grasps, and a broken row."""
    pytest.importorskip("pyarrow", reason="the extra label")
    folder = tmp_path_factory.mktemp("tables")
    data = write_lines(folder / "data.jsonl", fixture(), heavy(), "{")
    for name in ("a.parquet", "a.jsonl"):
        label_dataset(data, folder / name, labelling=LITTLE, part=2)
    return folder / "a.parquet", folder / "a.jsonl"


def same(a: list[dict[str, Any]], b: list[dict[str, Any]]) -> bool:
    return [r | {"seconds": 0} for r in a] == [r | {"seconds": 0} for r in b]


def test_both_formats_have_the_same_rows(tables: tuple[Path, Path]) -> None:
    packed, plain = (list(load_labels(path)) for path in tables)
    assert same(packed, plain)
    assert [r["status"] for r in packed] == ["labelled", "labelled", "broken"]


def test_the_metadata_say_units_and_what_was_asked(tables: tuple[Path, Path]) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    schema = parquet.read_schema(tables[0])
    about = json.loads(schema.metadata[b"handfast"])
    assert about["schema"] == SCHEMA
    assert about["questions"]["gravity"] == [[0, 0, -1]]
    assert [c["name"] for c in about["columns"]] == list(COLUMN_NAMES) == schema.names
    beside = json.loads(tables[1].with_name("a.jsonl.about.json").read_text())
    assert beside == about
    for column in LABEL_COLUMNS:
        assert schema.field(column.name).metadata == {b"unit": column.unit.encode(), b"about": column.about.encode()}


def test_pandas_reads_it(tables: tuple[Path, Path]) -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.read_parquet(tables[0])
    assert frame["verdict"][0] == "holds"
    assert frame["max_plus_fy"][1] == pytest.approx(2.222, abs=5e-3)
    assert len(frame["contact_positions"][0]) == 4
    assert frame["mass"].isna().tolist() == [False, False, True]


def test_polars_reads_it(tables: tuple[Path, Path]) -> None:
    polars = pytest.importorskip("polars")
    frame = polars.read_parquet(tables[0])
    assert frame["contacts"].to_list() == [4, 4, None]
    assert frame["contact_normals"].dtype == polars.List(polars.List(polars.Float64))


def test_datasets_reads_it(tables: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    datasets = pytest.importorskip("datasets")
    datasets.disable_progress_bars()
    loaded = datasets.Dataset.from_parquet(str(tables[0]), cache_dir=str(tmp_path))
    assert loaded[0]["verdicts"] == ["holds"]
    assert loaded.features["contact_frictions"].feature.dtype == "float64"


def test_lines_that_are_no_labels_are_broken(tmp_path: Path) -> None:
    write_lines(tmp_path / "a.jsonl", {"row": 1})
    with pytest.raises(BrokenFile, match="name"):
        list(LinesFormat().read(tmp_path / "a.jsonl"))


def test_a_summary_counts() -> None:
    row: dict[str, Any] = {"row": 0, "name": "a", "status": "labelled", "contacts": 3, "open": 1, "stop": "nodes"}
    row |= {"nodes": 5, "seconds": 0.5, "verdict": "holds", "weight_factor": 1e9, "worst_force": 0.0}
    summary = LabelSummary()
    summary.take([complete(row), complete(row | {"verdict": None}), broken(2, "c", "odd"), broken(3, "d", "odd")])
    said = summary.to_json()
    assert (said["rows"], said["labelled"], said["broken"]) == (4, 2, 2)
    assert said["reasons"] == [{"reason": "odd", "rows": 2, "first": 2}]
    assert said["verdicts"] == {"holds": 1, "no weight": 1}
    assert (said["open"], said["nodes"], said["seconds"]) == (2, 10, 1.0)
    assert summary.spread["weight_factor"]["holds"][-1] == 1  # beyond the last edge
    assert summary.spread["worst_force"]["holds"][0] == 1
    assert summary.spread["largest_command"] == {}
    assert set(SUMMARY_COLUMNS) <= set(COLUMN_NAMES)
    assert edges("worst_force")[0] == pytest.approx(1e-3)
