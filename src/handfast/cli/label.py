"""`handfast label`: what every grasp of a dataset holds, as one table."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, UseAppendAction, arg

from handfast.cli import console
from handfast.cli.console import table
from handfast.cli.load_options import JointLawOptions
from handfast.cli.options import (
    ALL_OPTIONS,
    Assignments,
    Command,
    Gravity,
    LoadingOrder,
    Reported,
    Triple,
    WorkOptions,
    assigned,
)
from handfast.core.errors import InputError
from handfast.core.files import write_bytes, write_text
from handfast.datasets.dataset_rows import GraspChanges
from handfast.datasets.labels.label_columns import LabelSummary
from handfast.datasets.labels.label_dataset import LabelProgress, label_dataset
from handfast.datasets.labels.label_files import load_labels
from handfast.datasets.labels.labeller import LABEL_DIRECTIONS, Labelling
from handfast.datasets.scene_source import SceneSource
from handfast.model.hand.joint_law import laws_named
from handfast.pictures.label_page import held_rows, report_labels
from handfast.pictures.words import count

SUMMARY_ENDING, SUMMARY_PICTURE = ".summary.json", ".summary.png"
SHOWN_REASONS = 8  # reasons that are shown
LOG = 60.0  # [s] between lines of progress at most, where there is no terminal


@dataclass(kw_only=True)
class Label(JointLawOptions, WorkOptions, LoadingOrder, Reported, Command):
    """Labels for every grasp of a dataset: what it holds, by how much, with which commands.

    DATASET is a folder or JSON lines of grasp files, or a table (.npz, .parquet) of joint values and object poses of a
    --hand and an --object, such as `import` writes. Parts are kept as they are done: whatever ends a run, --resume goes
    on. A row that is broken is recorded with its reason while the rest goes on. Beside the table there are a summary
    and its picture."""

    dataset: Annotated[Positional[Path], arg(metavar="DATASET")]
    """a folder, .jsonl, .npz or .parquet"""
    output: Annotated[Path | None, arg(metavar="LABELS", aliases=["-o"])] = None
    """the table: .parquet, or .jsonl, which needs no further package"""
    hand: Annotated[str, arg(metavar="HAND")] = ""
    """of a table of postures: a URDF, MJCF or GraspIt! file, a bundled name, menagerie:... or ..._description"""
    root: Annotated[str | None, arg(metavar="LINK")] = None
    """read only what hangs on this link of the robot"""
    object: Annotated[str, arg(metavar="OBJECT")] = ""
    """of a table of postures: a mesh, URDF, SDF or handfast/body/1 file, or a bundled object"""
    scale: Annotated[float, arg(metavar="M")] = 1.0
    """metres per unit of the object's mesh"""
    threshold: Annotated[float, arg(metavar="M")] = 5e-4
    """surfaces nearer than this touch [m]"""
    mass: Annotated[float | None, arg(metavar="KG")] = None
    """mass of the object [kg], in place of what the rows say; without any, nothing is said of its weight"""
    center_of_mass: Annotated[Triple, arg(aliases=["--com"])] = ()
    """centre of mass in the object's frame [m], in place of what the rows say; --com for short"""
    friction: Annotated[float | None, arg(metavar="MU")] = None
    """friction coefficient at every contact, in place of what the rows say"""
    preload: Assignments = ()
    """actuator commands [N m, or N if prismatic or tendon] in place of those of the rows; others are locked"""
    gravity: UseAppendAction[tuple[Gravity, ...]] = ()
    """a direction in which gravity pulls, object axes; repeatable; by default the axes both ways"""
    directions: Annotated[int, arg(metavar="N")] = 32
    """directions of forces among which the worst is sought"""
    gap: Annotated[float, arg(metavar="G")] = 1e-3
    """relative distance of the two bounds at which a number is exact enough"""
    nodes: Annotated[float | None, arg(metavar="N")] = None
    """nodes of the search for each question; by default 320000 over the square of the number of contacts"""
    timeout: Annotated[float, arg(metavar="S")] = 600.0
    """seconds for all questions about a grasp: a fuse; nodes decide where a question stays open"""
    replay: bool = False
    """replay every proof with the independent checker, too: more than ten times as long"""
    part: Annotated[int | None, arg(metavar="ROWS")] = None
    """rows that a worker labels in one go, and that are then kept; by default what takes 5 s, and 64 at most"""
    resume: bool = False
    """go on with what an earlier run has left; begin if there is nothing"""
    keep_parts: bool = False
    """leave the folder of parts beside the table"""

    def run(self) -> int:
        try:
            return self._run()
        except KeyboardInterrupt:
            console.complain("interrupted; the parts that are done are kept: --resume goes on")
            return console.UNDECIDED

    def _run(self) -> int:
        from handfast.pictures.drawing import picture
        from handfast.pictures.label_picture import draw_labels

        if self.output is None:
            raise InputError("missing: -o LABELS.parquet, or a table that ends in .jsonl", source="label")
        workers = self.workers()
        beside = [self.output.with_suffix(ending) for ending in (SUMMARY_ENDING, SUMMARY_PICTURE)]
        if not (self.force or self.resume):
            for file in beside:
                if file.exists() and not self.output.exists():
                    raise InputError("exists already; give --force to write over it", source=str(file))
        due = 0.0  # [s] when the next line is printed
        with console.watch("label") as watch:

            def shown(p: LabelProgress) -> None:
                nonlocal due
                text = progress_text(p)
                watch.item(p.done, p.total, text)
                if not sys.stderr.isatty() and p.seconds >= due:  # a job's log: at once, soon, then every minute
                    due = min(2 * p.seconds + 1, p.seconds + LOG)
                    print(f"label: {p.done} of {p.total}{text}", file=sys.stderr, flush=True)

            summary = label_dataset(
                self.dataset,
                self.output,
                labelling=self._labelling(),
                changes=self._changes(),
                scene=self._scene(),
                part=self.part,
                resume=self.resume,
                force=self.force,
                keep_parts=self.keep_parts,
                on_progress=shown,
                **workers,
            )

        of_paths = {"loading": self.loading} if self.loading != "together" else {}
        said = {"schema": "handfast/label-summary/1", "table": self.output.name} | of_paths | summary.to_json()
        write_text(beside[0], json.dumps(said, indent=1, allow_nan=False) + "\n", force=True)
        write_bytes(beside[1], picture(draw_labels(summary, self.output.name)), force=True)
        if self.report:
            report_labels(self.report, self.output.name, summary, load_labels(self.output), force=self.force)
        if self.json:
            console.print_json(said)
        else:
            self._show(summary, [self.output, *beside, *([self.report] if self.report else [])])
        return console.ANSWERED if summary.labelled else console.BAD_INPUT

    def _labelling(self) -> Labelling:
        pulls: list[Any] = []
        for g in self.gravity:
            pulls += LABEL_DIRECTIONS if g == ALL_OPTIONS else [tuple(g)]
        return self.made(Labelling, gravity=tuple(pulls) or LABEL_DIRECTIONS)

    def _changes(self) -> GraspChanges:
        preload = assigned(self.preload, "--preload") if self.preload else None
        return self.made(GraspChanges, center_of_mass=self.center_of_mass or None, preload=preload)

    def _scene(self) -> SceneSource | None:
        laws_named(self.joint_laws, "--joint-laws")
        if bool(self.hand) != bool(self.object):
            raise InputError("is missing; a table of postures needs both", field="--object" if self.hand else "--hand")
        if not self.hand:
            if self.joint_laws != "all" or self.backdrivable:
                given = "--backdrivable" if self.backdrivable else "--joint-laws"
                raise InputError("is of the --hand of a table of postures; grasp files say it themselves", field=given)
            return None
        laws: dict[str, Any] = {"joint_laws": self.joint_laws, "backdrivable": self.backdrivable}
        how: dict[str, Any] = {"root": self.root, "scale": self.scale, "threshold": self.threshold}
        return SceneSource.of(self.hand, self.object, **how, **laws)

    def _show(self, summary: LabelSummary, files: list[Path]) -> None:
        out = console.out()
        out.print(
            f"{summary.labelled} of {count(summary.rows, 'grasp')} labelled, {summary.broken} broken", style="bold"
        )
        if self.loading != "together":
            out.print("First the squeeze, then the load: weights are held on their paths, maxima are where paths end.")
        if rows := held_rows(summary):
            out.print(table(["weight from every direction", "grasps"], rows))
        if summary.broken:
            most = summary.reasons.most_common(SHOWN_REASONS)
            reasons = [(str(number), str(summary.first[reason]), reason) for reason, number in most]
            if len(summary.reasons) > SHOWN_REASONS:
                reasons.append(
                    ("", "", f"and other reasons: {len(summary.reasons) - SHOWN_REASONS}; the table has all")
                )
            out.print(table(["rows", "first", "broken because"], reasons))
        if summary.open:
            out.print(f"{count(summary.open, 'question')} stayed open; the rows say what was shown.")
        if summary.fresh:
            out.print(f"{summary.fresh} rows in {summary.wall:.1f} s, {summary.rate:.3g} a second.")
        console.say_written(out, *files)


def progress_text(p: LabelProgress) -> str:
    """What is said beside how many are done: rate, what is left, what is broken."""
    text = f" · {p.rate:.3g} a second" if p.fresh else ""
    if p.left < float("inf"):
        hours, rest = divmod(round(p.left), 3600)
        minutes, seconds = divmod(rest, 60)
        text += f" · {hours}:{minutes:02}:{seconds:02} left"
    return text + (f" · {p.broken} broken" if p.broken else "")
