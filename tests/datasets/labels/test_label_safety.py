"""What happens to a dataset, its parts and its table from outside is noticed, and costs nobody a file or a run."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.datasets.dataset_rows import GraspChanges
from handfast.datasets.labels import label_dataset as run_module
from handfast.datasets.labels.label_dataset import LabelProgress, label_dataset
from handfast.datasets.labels.label_files import folder_of, load_labels
from handfast.datasets.labels.labeller import Labelling
from handfast.datasets.open_dataset import open_dataset
from tests.support.labelled import fixture, heavy, write_lines

LITTLE = Labelling(directions=1, gravity=((0, 0, -1.0),), nodes=300)


@pytest.fixture
def lines(tmp_path: Path) -> Path:
    return write_lines(tmp_path / "data.jsonl", *(fixture(0.1 * k) for k in range(1, 4)))


@pytest.fixture
def grasps(tmp_path: Path) -> Path:
    folder = tmp_path / "grasps"
    folder.mkdir()
    for name in "ab":
        (folder / f"{name}.json").write_text(json.dumps(fixture()))
    return folder


def rows(path: Path) -> list[dict[str, Any]]:
    return [row | {"seconds": 0} for row in load_labels(path)]


def test_a_folder_whose_grasps_have_changed_is_another_dataset(grasps: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.jsonl"
    label_dataset(grasps, out, labelling=LITTLE)
    file = grasps / "b.json"
    file.write_text(file.read_text().replace("0.5", "0.9"))  # of the same size
    with pytest.raises(InputError, match="is of another dataset"):
        label_dataset(grasps, out, labelling=LITTLE, resume=True)


def test_a_change_in_the_middle_of_a_large_file_is_seen(tmp_path: Path) -> None:
    data = write_lines(tmp_path / "data.jsonl", " " * (3 << 20), fixture(0.5), " " * (3 << 20))
    before = open_dataset(data).identity()
    data.write_text(data.read_text().replace("0.5", "0.9"))
    assert open_dataset(data).identity() != before


def test_a_table_can_be_in_the_folder_that_it_is_about(grasps: Path) -> None:
    out = grasps / "out.jsonl"
    label_dataset(grasps, out, labelling=LITTLE, keep_parts=True)
    (grasps / "out.summary.json").write_text("{}")
    out.unlink()
    assert label_dataset(grasps, out, labelling=LITTLE, resume=True).fresh == 0
    assert label_dataset(grasps, out, labelling=LITTLE, resume=True).rows == 2


def test_a_dataset_that_grows_meanwhile_makes_no_table(lines: Path, tmp_path: Path) -> None:
    def grow(progress: LabelProgress) -> None:
        if progress.fresh == 1:
            lines.write_text(lines.read_text() + json.dumps(heavy()) + "\n")

    out = tmp_path / "out.jsonl"
    with pytest.raises(InputError, match=r"data.jsonl: changed while it was labelled; give --force"):
        label_dataset(lines, out, labelling=LITTLE, part=1, jobs=1, on_progress=grow)
    assert not out.exists()


def test_one_changed_digit_in_a_part_is_noticed(lines: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.jsonl"
    label_dataset(lines, out, labelling=LITTLE, part=1, keep_parts=True)
    before = rows(out)
    part = sorted(folder_of(out).glob("*/*.jsonl"))[1]
    part.write_text(part.read_text().replace("0.2", "0.3"))
    assert label_dataset(lines, out, labelling=LITTLE, part=1, resume=True).fresh == 1
    assert rows(out) == before


@pytest.mark.parametrize("keep", [300, -300, "line"])
def test_a_finished_table_that_was_damaged_is_not_taken_for_whole(lines: Path, tmp_path: Path, keep: Any) -> None:
    out = tmp_path / "out.jsonl"
    label_dataset(lines, out, labelling=LITTLE)
    data = out.read_bytes()
    out.write_bytes(data[: data.index(b"\n") + 1] if keep == "line" else data[:keep])
    with pytest.raises(InputError, match=r"out.jsonl: was damaged since it was written; give --force"):
        label_dataset(lines, out, labelling=LITTLE, resume=True)


@pytest.mark.parametrize("asked", [{}, {"resume": True}, {"force": True}])
def test_files_that_are_no_parts_are_left_alone(lines: Path, tmp_path: Path, asked: dict[str, bool]) -> None:
    out = tmp_path / "out.jsonl"
    mine = folder_of(out) / "mine" / "notes.txt"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    with pytest.raises(InputError, match=r"out.jsonl.parts: has files that are no parts of labels; move it away"):
        label_dataset(lines, out, labelling=LITTLE, **asked)
    assert mine.read_text() == "mine"


def test_a_run_that_waited_for_another_does_not_write_over_its_table(
    lines: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the first look and the lock of this run another one begins and ends."""
    out, enter = tmp_path / "out.jsonl", run_module.PartFolder.__enter__

    def late(folder: Any) -> Any:
        monkeypatch.setattr(run_module.PartFolder, "__enter__", enter)
        label_dataset(lines, out, labelling=LITTLE)
        return enter(folder)

    monkeypatch.setattr(run_module.PartFolder, "__enter__", late)
    with pytest.raises(InputError, match="exists already; give --force"):
        label_dataset(lines, out, labelling=Labelling(directions=2))
    assert not folder_of(out).exists()


@pytest.mark.parametrize("ending", ["jsonl", "parquet"])
def test_a_folder_that_is_a_file_is_one_line(lines: Path, tmp_path: Path, ending: str) -> None:
    if ending == "parquet":
        pytest.importorskip("pyarrow", reason="the extra label")
    with pytest.raises(InputError, match=r"data.jsonl/out.\w+.parts: cannot be written: Not a directory"):
        label_dataset(lines, lines / f"out.{ending}", labelling=LITTLE)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_factor_beyond_all_numbers_is_left_out(lines: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.jsonl"
    assert label_dataset(lines, out, labelling=LITTLE, changes=GraspChanges(mass=1e-310)).labelled == 3
    assert [row["weight_factor"] for row in rows(out)] == [None] * 3


def test_a_value_that_no_table_can_hold_breaks_its_row(
    lines: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest = run_module.label

    def odd(grasp: Any, labelling: Labelling) -> dict[str, Any]:
        return honest(grasp, labelling) | ({"q1": np.nan} if grasp.mu[0] == 0.2 else {})

    monkeypatch.setattr(run_module, "label", odd)
    out = tmp_path / "out.jsonl"
    assert label_dataset(lines, out, labelling=LITTLE, jobs=1).broken == 1
    assert [r["status"] for r in rows(out)] == ["labelled", "broken", "labelled"]


# --- tables of postures -----------------------------------------------------------------------------


def postures(count: int) -> dict[str, Any]:
    rng = np.random.default_rng(0)
    return {n: rng.random((count, k)) for n, k in (("joints", 8), ("object_position", 3), ("object_quaternion", 4))}


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_an_archive_that_was_damaged_is_one_line(tmp_path: Path, save: Any) -> None:
    file = tmp_path / "t.npz"
    save(file, **postures(5000))
    data = bytearray(file.read_bytes())
    at = data.index(b"joints.npy") + 100_000
    data[at : at + 50] = bytes(50)
    file.write_bytes(data)
    dataset = open_dataset(file)
    with pytest.raises(InputError, match=r"t.npz: joints: is damaged \("):
        list(dataset.items())


def test_arrays_in_a_folder_of_an_archive_are_not_found(tmp_path: Path) -> None:
    file, array = tmp_path / "t.npz", tmp_path / "a.npy"
    np.save(array, np.zeros((2, 8)))
    with zipfile.ZipFile(file, "w") as archive:
        archive.write(array, "sub/joints.npy")
    with pytest.raises(InputError, match=r"t.npz: joints: is missing; it holds sub/joints"):
        open_dataset(file)


def test_a_parquet_table_that_was_damaged_is_one_line(tmp_path: Path) -> None:
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    file = tmp_path / "t.parquet"
    parquet.write_table(arrow.table({k: v.tolist() for k, v in postures(50).items()}), file)
    data = bytearray(file.read_bytes())
    data[4:200] = bytes(196)
    file.write_bytes(data)
    dataset = open_dataset(file)
    with pytest.raises(InputError, match=r"t.parquet: is damaged \("):
        list(dataset.items())
