"""Labels for every grasp of a dataset: made in parts by workers, kept as they come, put together in the end."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from handfast.core.errors import InputError
from handfast.core.files import refuse_existing, same_json
from handfast.core.parallel import Died, Workers, workers_of
from handfast.core.schema import written
from handfast.datasets.dataset_rows import DatasetRow, FaultyRow, GraspChanges, LabelPart, PosedRow, grasp_of_text
from handfast.datasets.labels.label_columns import SCHEMA, SUMMARY_COLUMNS, LabelSummary, broken, complete, described
from handfast.datasets.labels.label_files import BrokenFile, LabelFormat, PartFolder, folder_of, format_named, format_of
from handfast.datasets.labels.labeller import Labelling, label
from handfast.datasets.open_dataset import open_dataset
from handfast.datasets.scene_source import SceneSource, same_scene
from handfast.model.grasp import Grasp

PART = 64  # rows of a task at most, and
KEPT_EVERY = 5.0  # [s] of a task: what a run that is killed has to do again, for each worker, with the row in hand
FIRST_TASK_TIME = 0.5  # [s] of the first tasks, so that the rate is known at once
MAX_REASON_LENGTH = 300  # characters of a reason


@dataclass(frozen=True)
class LabelRecipe:
    """All that a worker is told beside the rows.

    Attributes:
        labelling: what is asked. changes: to the grasps. scene: hand and object of postures.
        ending: of the files in which parts are packed.
    """

    labelling: Labelling
    changes: GraspChanges
    scene: SceneSource | None = None
    ending: str = ".jsonl"

    def to_json(self, folder: Path) -> dict[str, Any]:
        """As a file in a folder has it."""
        scene = self.scene and self.scene.relative_to(folder)
        told: dict[str, Any] = written({"questions": self.labelling.questions, "changes": self.changes, "scene": scene})
        return told


@dataclass(frozen=True)
class PackedLabels:
    """The labels of the first rows of a part as a file has them: packed by the worker, which spares the run that work.

    Attributes:
        data: of the file. rows: how many. broken: of these.
    """

    data: bytes
    rows: int
    broken: int


@dataclass(frozen=True)
class LabelProgress:
    """How far a run has come: rows that are there, all rows, those that this run did, [s] since it began."""

    done: int
    total: int
    fresh: int
    seconds: float
    broken: int

    @property
    def rate(self) -> float:
        """Rows a second."""
        return self.fresh / self.seconds if self.seconds > 0 else 0.0

    @property
    def left(self) -> float:
        """[s] that the rest will take at this rate; inf before the first."""
        return (self.total - self.done) / self.rate if self.rate > 0 else float("inf")


OnProgress = Callable[[LabelProgress], None]


@dataclass(frozen=True, kw_only=True)
class LabelRun:
    """How a dataset is labelled, which changes nothing in the table.

    Attributes:
        jobs: processes; by default one a core.
        scheduler: address of a Dask scheduler, whose workers take the place of processes here.
        part: rows that are labelled in one task, and written at once; by default as many as take `KEPT_EVERY` seconds,
            and `PART` at most.
        resume: go on from the parts that are there; begins if there are none.
        force: write over what is there.
        keep_parts: leave the folder of parts.
    """

    jobs: int | None = None
    scheduler: str | None = None
    part: int | None = None
    resume: bool = False
    force: bool = False
    keep_parts: bool = False

    def __post_init__(self) -> None:
        if self.part is not None and self.part < 1:
            raise InputError(f"is {self.part}; at least 1 row is needed", field="part")
        if self.resume and self.force:
            raise InputError("give either --resume or --force")


def label_dataset(
    dataset: str | Path,
    output: str | Path,
    *,
    labelling: Labelling | None = None,
    changes: GraspChanges | None = None,
    scene: SceneSource | None = None,
    on_progress: OnProgress | None = None,
    **options: Any,
) -> LabelSummary:
    """Label every grasp of a dataset, in a table with the columns of `handfast.datasets.labels.label_columns`.

    While it goes on, finished parts are in a folder beside the table; what ends the run, kill -9 too, loses the last
    seconds of each worker and no more, and `resume` goes on. The table does not depend on the number of workers, on the
    order in which they end or on interruptions, but for the columns `seconds` and `stop`, and for rows whose time ran
    out.

    Args:
        dataset: a folder or JSON lines of grasp files, or a table (.npz, .parquet) of postures, which needs a scene.
        output: .parquet, which needs pyarrow, or .jsonl.
        labelling: what is asked of each grasp.
        changes: mass, centre of mass, friction, preload in place of what the rows say.
        on_progress: called at the beginning and after each part.
        options: of `LabelRun`, by name: `label_dataset("grasps", "labels.parquet", jobs=4, resume=True)`.

    Raises:
        InputError: a dataset that cannot be read, an output that exists or is of another kind, parts of another run,
            a scene that is missing, workers that are gone. One line. What is wrong with single rows is said in theirs.
    """
    begin, target, how = time.monotonic(), Path(output), LabelRun(**options)
    format = format_of(target)
    recipe = LabelRecipe(labelling or Labelling(), changes or GraspChanges(), scene, format.ending)
    rows = open_dataset(dataset)
    if rows.posed and scene is None:
        raise InputError("is a table of postures; give the hand and the object", source=str(dataset))
    if not rows.posed and scene is not None:
        raise InputError("has grasps with their contacts; a hand and an object are for tables", source=str(dataset))
    about = {"schema": SCHEMA, "columns": described(), "dataset": rows.identity()} | recipe.to_json(target.parent)
    folder = PartFolder(target, format, {k: v for k, v in about.items() if k != "schema"}, rows.count)
    _refuse(target, folder, how)
    summary = LabelSummary()
    if how.resume and target.exists() and not folder.begun:  # the last run came to its end
        if not same_run(format.about(target), about):
            raise InputError("is of another dataset or of other questions; give --force", source=str(target))
        _count(summary, format, target, rows.count)
        return summary
    with folder:
        _refuse(target, folder, how)  # another run may have ended since
        bad = fresh = 0
        with workers_of(recipe, how.jobs, how.scheduler) as workers:
            have = folder.open(resume=how.resume)
            done = sum(map(len, have))

            def tell() -> None:
                if on_progress:
                    on_progress(LabelProgress(done + fresh, rows.count, fresh, time.monotonic() - begin, bad))

            tell()
            for first, labels in _labelled(workers, rows.parts(how.part or PART, have), timed=how.part is None):
                folder.write(range(first, first + labels.rows), labels.data)
                fresh, bad = fresh + labels.rows, bad + labels.broken
                tell()
        if open_dataset(dataset).identity() != about["dataset"]:
            raise InputError("changed while it was labelled; give --force to begin anew", source=str(dataset))
        format.write(target, folder.files(), about)
        _count(summary, format, target, rows.count)
        if not how.keep_parts:
            folder.remove()
    summary.fresh, summary.wall = fresh, time.monotonic() - begin
    return summary


def same_run(known: Any, about: Mapping[str, Any]) -> bool:
    """Do the metadata of a table say the same dataset, columns and questions?"""
    if not isinstance(known, dict) or known.keys() != about.keys():
        return False
    return all(same_scene(known[k], v) if k == "scene" else same_json(known[k], v) for k, v in about.items())


def _refuse(target: Path, folder: PartFolder, how: LabelRun) -> None:
    """`InputError` before any work for what would be written over."""
    if target.is_dir():
        raise InputError("is a folder; a file is needed", source=str(target))
    if folder.foreign:
        raise InputError("has files that are no parts of labels; move it away", source=str(folder_of(target)))
    if how.resume or how.force:
        return
    refuse_existing(target, force=False)
    if folder.begun:
        problem = "holds parts of labels already; give --resume to go on, or --force to begin anew"
        raise InputError(problem, source=str(folder_of(target)))


def _count(summary: LabelSummary, format: LabelFormat, target: Path, rows: int) -> None:
    """Take all rows of a table into the summary; `InputError` if it has others than it was written with."""
    try:
        summary.take(row for block in format.read(target, SUMMARY_COLUMNS) for row in block)
        whole = summary.rows == rows
    except BrokenFile:
        whole = False
    if not whole:
        raise InputError("was damaged since it was written; give --force to begin anew", source=str(target))


def _labelled(
    workers: Workers[LabelRecipe], parts: Iterator[LabelPart], *, timed: bool
) -> Iterator[tuple[int, PackedLabels]]:
    """First row and labels of parts, as they are done.

    The rows for which a task had no time become another part. A part whose process died is done again row by row, to
    find the row.
    """
    begin = time.monotonic()
    left, suspects = deque[LabelPart](), list[LabelPart]()

    def feed() -> Iterator[LabelPart]:
        for part in parts:
            yield from unfinished()
            yield limited(part)
        yield from unfinished()

    def unfinished() -> Iterator[LabelPart]:
        while left:
            yield limited(left.popleft())

    def limited(part: LabelPart) -> LabelPart:
        seconds = min(KEPT_EVERY, max(FIRST_TASK_TIME, time.monotonic() - begin))
        return replace(part, seconds=seconds) if timed else part

    while True:
        for part, labels in workers.run(packed_labels, feed()):
            if isinstance(labels, Died):
                suspects.append(part)
                continue
            rest = part.rows[labels.rows :]
            if rest:
                left.append(LabelPart(rest))
            yield part.first, labels
        if not left:
            break
    alone = (LabelPart((row,)) for part in suspects for row in part.rows)
    for part, labels in workers.run(packed_labels, alone):
        if isinstance(labels, Died):
            labels = _packed(workers.shared, [broken(part.first, part.rows[0].name, labels.reason)])
        yield part.first, labels


def packed_labels(recipe: LabelRecipe, part: LabelPart) -> PackedLabels:
    """The labels of the first rows of a part, as many as its time allows, in a worker.

    A scene that cannot be had ends the run; the fault of a row is its own.
    """
    if recipe.scene:
        recipe.scene.scene()
    begin, rows = time.monotonic(), list[dict[str, Any]]()
    for row in part.rows:
        rows.append(_label_of(recipe, row))
        if time.monotonic() - begin > part.seconds:
            break
    return _packed(recipe, rows)


def _packed(recipe: LabelRecipe, rows: list[dict[str, Any]]) -> PackedLabels:
    bad = sum(row["status"] == "broken" for row in rows)
    return PackedLabels(format_named(recipe.ending).packed(rows), len(rows), bad)


def _label_of(recipe: LabelRecipe, row: DatasetRow) -> dict[str, Any]:
    if isinstance(row.content, FaultyRow):
        return broken(row.number, row.name, row.content.reason)
    try:
        grasp, about = grasp_of_row(row, recipe.changes, recipe.scene)
        found = complete(about | label(grasp, recipe.labelling))
        json.dumps(found, allow_nan=False)  # what no table can hold is this row's fault alone
        return found
    except InputError as fault:
        reason = str(fault)
    except Exception as fault:  # a row may be odd in ways that nobody thought of: that is no reason to lose the others
        reason = f"{type(fault).__name__}: {' '.join(str(fault).split())}"
    return broken(row.number, row.name, reason[:MAX_REASON_LENGTH])


def grasp_of_row(row: DatasetRow, changes: GraspChanges, scene: SceneSource | None) -> tuple[Grasp, dict[str, Any]]:
    """The grasp that a row is labelled as, and the columns that say which row it is; raises `InputError`."""
    about: dict[str, Any] = {"row": row.number, "name": row.name, "source": row.source or None}
    match row.content:
        case FaultyRow(reason):
            raise InputError(reason)
        case str(text):
            grasp = grasp_of_text(text, row.name, changes)
            made = grasp.provenance and grasp.provenance.object
            about["object"] = Path(made.path).stem if made else None
            about["grasp"] = None if grasp.name == row.name else grasp.name
            if row.unnamed:
                about["name"] = grasp.name
            return grasp, about
        case PosedRow() as posed:
            assert scene
            grasp = scene.grasp(posed, row.name, changes)
            return grasp, about | {"object": Path(scene.object).stem} | _posture(scene, posed)


def _posture(scene: SceneSource, row: PosedRow) -> dict[str, Any]:
    """The columns that say where hand and object are."""
    q = scene.joints_of(row)
    place = {"object_position": row.position, "object_quaternion": row.quaternion}
    return {"joints": q.tolist()} | {name: [float(x) for x in values] for name, values in place.items()}
