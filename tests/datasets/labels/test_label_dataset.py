"""Whole datasets: broken rows are recorded, nothing is lost or done twice, and the table is always the same."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest

from handfast.core import parallel
from handfast.core.errors import InputError
from handfast.datasets.dataset_rows import GraspChanges
from handfast.datasets.labels import label_dataset as run_module
from handfast.datasets.labels.label_columns import LABEL_COLUMNS
from handfast.datasets.labels.label_dataset import LabelProgress, label_dataset
from handfast.datasets.labels.label_files import PartFolder, folder_of, load_labels
from handfast.datasets.labels.labeller import Labelling
from tests.support.labelled import broken_rows, fixture, heavy, write_lines

LITTLE = Labelling(directions=1, gravity=((0, 0, -1.0),), nodes=300)
COURSE = {c.name for c in LABEL_COLUMNS if c.course}


@pytest.fixture
def lines(tmp_path: Path) -> Path:
    """Nine grasps that differ in their friction."""
    return write_lines(tmp_path / "grasps.jsonl", *(fixture(0.1 * k) for k in range(1, 10)))


def rows(path: Path) -> list[dict[str, Any]]:
    return [{k: v for k, v in row.items() if k not in COURSE} for row in load_labels(path)]


class Stopped(Exception):
    """In the place of whatever ends a run."""


def stop_after(parts: int) -> Any:
    seen: list[LabelProgress] = []

    def progress(p: LabelProgress) -> None:
        seen.append(p)
        if len(seen) == parts:
            raise Stopped

    return progress


def test_broken_rows_are_recorded_with_their_reasons_and_the_others_labelled(tmp_path: Path) -> None:
    kinds = broken_rows()
    texts = [line for broken, _ in kinds.values() for line in (broken, json.dumps(fixture()))]
    summary = label_dataset(write_lines(tmp_path / "a.jsonl", *texts), tmp_path / "b.jsonl", labelling=LITTLE, part=3)
    found = rows(tmp_path / "b.jsonl")
    assert [r["row"] for r in found] == list(range(2 * len(kinds)))
    for row, (kind, (_, reason)) in zip(found[::2], kinds.items(), strict=True):
        assert row["status"] == "broken", kind
        assert reason in row["reason"], kind
        assert row["name"] == f"line {row['row'] + 1}"
    assert {r["status"] for r in found[1::2]} == {"labelled"}
    assert (summary.rows, summary.labelled, summary.broken) == (20, 10, 10)
    assert [b["row"] for b in summary.broken_rows] == list(range(0, 20, 2))


def test_the_table_does_not_depend_on_workers_or_parts(lines: Path, tmp_path: Path) -> None:
    one, two = tmp_path / "one.jsonl", tmp_path / "two.jsonl"
    label_dataset(lines, one, labelling=LITTLE, jobs=1, part=9)
    label_dataset(lines, two, labelling=LITTLE, jobs=2, part=2)
    assert rows(one) == rows(two)
    assert not folder_of(one).exists()


@pytest.mark.slow
def test_a_run_that_was_ended_goes_on_with_what_is_missing(lines: Path, tmp_path: Path) -> None:
    whole, torn = tmp_path / "whole.jsonl", tmp_path / "torn.jsonl"
    label_dataset(lines, whole, labelling=LITTLE)
    for parts in (2, 3):  # told at the beginning, too
        with pytest.raises(Stopped):
            label_dataset(lines, torn, labelling=LITTLE, part=2, resume=True, on_progress=stop_after(parts))
    assert not torn.exists()
    kept = {f: f.stat().st_mtime_ns for f in folder_of(torn).glob("*/*.jsonl")}
    assert len(kept) == 3
    assert not list(folder_of(torn).rglob("*.part"))
    told: list[LabelProgress] = []
    summary = label_dataset(
        lines, torn, labelling=LITTLE, part=2, resume=True, keep_parts=True, on_progress=told.append
    )
    assert kept.items() <= {f: f.stat().st_mtime_ns for f in folder_of(torn).glob("*/*.jsonl")}.items()
    assert (summary.rows, summary.fresh) == (9, 3)
    assert (told[-1].done, told[-1].total, told[-1].fresh, told[-1].left) == (9, 9, 3, 0)
    assert rows(torn) == rows(whole)


def test_parts_of_another_size_are_gone_on_with(lines: Path, tmp_path: Path) -> None:
    whole, torn = tmp_path / "whole.jsonl", tmp_path / "torn.jsonl"
    label_dataset(lines, whole, labelling=LITTLE)
    for part in (4, 2, None):
        with pytest.raises(Stopped):
            label_dataset(lines, torn, labelling=LITTLE, jobs=1, part=part, resume=True, on_progress=stop_after(2))
        if part == 4:
            (first,) = folder_of(torn).glob("*/*.jsonl")  # rows 0 to 3
            first.write_bytes(first.read_bytes()[:-1])  # damaged: made again, in other parts
    assert label_dataset(lines, torn, labelling=LITTLE, part=5, resume=True).rows == 9
    assert rows(torn) == rows(whole)


def test_a_task_ends_when_its_time_is_over_and_keeps_what_it_has(
    lines: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With no time at all every row is a part of its own."""
    monkeypatch.setattr(run_module, "KEPT_EVERY", 0.0)
    whole, slow = tmp_path / "whole.jsonl", tmp_path / "slow.jsonl"
    label_dataset(lines, whole, labelling=LITTLE, part=9)
    told: list[LabelProgress] = []
    label_dataset(lines, slow, labelling=LITTLE, jobs=2, keep_parts=True, on_progress=told.append)
    assert [p.done for p in told] == list(range(10))
    assert len(list(folder_of(slow).glob("*/*.jsonl"))) == 9
    assert rows(slow) == rows(whole)


def test_progress_counts_the_broken_rows_so_far(tmp_path: Path) -> None:
    good = json.dumps(fixture())
    lines = write_lines(tmp_path / "a.jsonl", good, "{", "{", good, good, good)
    told: list[LabelProgress] = []
    out = tmp_path / "b.jsonl"
    label_dataset(lines, out, labelling=LITTLE, part=2, jobs=1, keep_parts=True, on_progress=told.append)
    assert [(p.done, p.total, p.fresh, p.broken) for p in told] == [
        (0, 6, 0, 0),
        (2, 6, 2, 1),
        (4, 6, 4, 2),
        (6, 6, 6, 2),
    ]


def test_a_part_that_was_damaged_is_made_again(lines: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.jsonl"
    label_dataset(lines, out, labelling=LITTLE, part=3, keep_parts=True)
    before = rows(out)
    parts = sorted(folder_of(out).glob("*/*.jsonl"))
    parts[0].write_bytes(parts[0].read_bytes()[:-20])
    parts[2].write_bytes(parts[1].read_bytes())
    assert label_dataset(lines, out, labelling=LITTLE, part=3, resume=True).fresh == 6
    assert rows(out) == before


def test_a_finished_table_is_left_alone(lines: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.jsonl"
    label_dataset(lines, out, labelling=LITTLE)
    written = out.stat().st_mtime_ns
    again = label_dataset(lines, out, labelling=LITTLE, resume=True)
    assert (again.rows, again.fresh) == (9, 0)
    assert out.stat().st_mtime_ns == written
    assert not folder_of(out).exists()
    with pytest.raises(InputError, match="is of another dataset or of other questions; give --force"):
        label_dataset(lines, out, labelling=Labelling(directions=2), resume=True)
    with pytest.raises(InputError, match="exists already; give --force"):
        label_dataset(lines, out, labelling=LITTLE)


@pytest.mark.parametrize(
    ("changed", "field"),
    [
        ({"labelling": Labelling(directions=2)}, "questions"),
        ({"changes": GraspChanges(friction=0.3)}, "changes"),
        ({"dataset": True}, "dataset"),
    ],
)
def test_parts_of_another_run_are_not_mixed_in(
    lines: Path, tmp_path: Path, changed: dict[str, Any], field: str
) -> None:
    out, asked = tmp_path / "out.jsonl", {"labelling": LITTLE, "part": 2}
    with pytest.raises(Stopped):
        label_dataset(lines, out, **asked, on_progress=stop_after(2))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="holds parts of labels already; give --resume"):
        label_dataset(lines, out, **asked)  # type: ignore[arg-type]
    if changed.pop("dataset", False):
        lines.write_text(lines.read_text().replace("0.1", "0.2", 1))
    with pytest.raises(InputError, match=f"manifest.json: {field}: is another than the parts were made with"):
        label_dataset(lines, out, **(asked | changed), resume=True)  # type: ignore[arg-type]


def test_two_runs_do_not_fill_one_folder(lines: Path, tmp_path: Path) -> None:
    from handfast.datasets.labels.label_files import LinesFormat

    pytest.importorskip("fcntl")
    out = tmp_path / "out.jsonl"
    with PartFolder(out, LinesFormat(), {}, 9), pytest.raises(InputError, match="is being filled by another run"):
        label_dataset(lines, out, labelling=LITTLE)


@pytest.mark.skipif(parallel.START != "fork", reason="processes cannot be forked here")
def test_a_row_that_ends_its_process_is_found(lines: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    honest = run_module.label

    def deadly(grasp: Any, labelling: Labelling) -> dict[str, Any]:
        if abs(grasp.mu[0] - 0.5) < 1e-9:
            os.kill(os.getpid(), signal.SIGKILL)
        return honest(grasp, labelling)

    monkeypatch.setattr(run_module, "label", deadly)
    label_dataset(lines, tmp_path / "out.jsonl", labelling=LITTLE, part=4, jobs=2)
    found = rows(tmp_path / "out.jsonl")
    assert [r["row"] for r in found if r["status"] == "broken"] == [4]
    assert found[4]["reason"] == "its process was ended by SIGKILL"
    assert [r["contact_frictions"][0] for r in found if r["row"] != 4] == pytest.approx(
        [0.1, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8, 0.9]
    )


def test_what_nobody_thought_of_breaks_a_row_only(lines: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def odd(grasp: Any, labelling: Labelling) -> dict[str, Any]:
        raise ZeroDivisionError("by\nzero")

    monkeypatch.setattr(run_module, "label", odd)
    assert label_dataset(lines, tmp_path / "out.jsonl", labelling=LITTLE).broken == 9
    assert rows(tmp_path / "out.jsonl")[0]["reason"] == "ZeroDivisionError: by zero"


def test_changes_take_the_place_of_what_rows_say(tmp_path: Path) -> None:
    data = write_lines(tmp_path / "a.jsonl", heavy())
    changes = GraspChanges(1.5, (0, 0, 0.01), 0.4, {"left": 0.3})
    label_dataset(data, tmp_path / "b.jsonl", labelling=LITTLE, changes=changes)
    row = rows(tmp_path / "b.jsonl")[0]
    assert row["name"] == "two fingers"
    assert (row["mass"], row["center"], row["contact_frictions"]) == (1.5, [0, 0, 0.01], [0.4] * 4)
    assert dict(zip(row["motors"], row["preload"], strict=True)) == {"right": 0, "left": 0.3}


def test_a_folder_is_read_in_the_order_of_names(tmp_path: Path) -> None:
    folder = tmp_path / "grasps"
    (folder / "sub").mkdir(parents=True)
    for name in ("b.grasp.json", "a.grasp.json", "sub/c.grasp.json"):
        (folder / name).write_text(json.dumps(fixture()))
    (folder / "b.json").write_text("{}")  # something else that stands beside grasps
    (folder / "sub" / "d.grasp.json").write_bytes(b"\xff")
    label_dataset(folder, tmp_path / "b.jsonl", labelling=LITTLE)
    found = rows(tmp_path / "b.jsonl")
    assert [r["name"] for r in found] == ["a.grasp.json", "b.grasp.json", "sub/c.grasp.json", "sub/d.grasp.json"]
    assert [r["reason"] for r in found] == [None, None, None, "is no text in UTF-8"]


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("nothing.jsonl", "no such file; a folder, .jsonl, .parquet or .npz"),
        ("grasps.txt", "is of no kind that is known"),
        ("empty.jsonl", "is empty; a grasp file in each line"),
        ("folder", "has no grasp files"),
        ("broken.npz", r"is no .npz archive"),
    ],
)
def test_odd_datasets_are_one_line(tmp_path: Path, name: str, fault: str) -> None:
    (tmp_path / "folder").mkdir()
    for file in ("grasps.txt", "empty.jsonl", "broken.npz"):
        (tmp_path / file).write_text("")
    with pytest.raises(InputError, match=fault):
        label_dataset(tmp_path / name, tmp_path / "out.jsonl")
    assert not list(tmp_path.glob("out*"))


def test_odd_outputs_are_one_line(lines: Path, tmp_path: Path) -> None:
    for output, fault in ((tmp_path / "a.txt", "ends in .parquet or .jsonl"), (tmp_path, "ends in .parquet")):
        with pytest.raises(InputError, match=fault):
            label_dataset(lines, output)
    with pytest.raises(InputError, match="part: is 0"):
        label_dataset(lines, tmp_path / "a.jsonl", part=0)
    with pytest.raises(InputError, match="either --resume or --force"):
        label_dataset(lines, tmp_path / "a.jsonl", resume=True, force=True)
    with pytest.raises(InputError, match="no such file; a table of labels"):
        list(load_labels(tmp_path / "a.jsonl"))
