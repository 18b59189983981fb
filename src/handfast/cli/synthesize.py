"""`handfast synthesize`: configurations that bring regions of the hand onto regions of the object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.console import Console
from rich.text import Text
from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.console import print_table, table
from handfast.cli.options import Command, EndsIn, Reported, check_writable, load_solvable
from handfast.core.answer import Reach, Stop
from handfast.core.errors import InputError
from handfast.core.files import write_bytes
from handfast.pictures.words import count as counted
from handfast.pictures.words import num, vector
from handfast.readers.configuration_file import save_configuration
from handfast.synthesis.query import SynthesisProgress, synthesize
from handfast.synthesis.solution import Solution
from handfast.synthesis.synthesis_answer import Searched, Synthesis
from handfast.synthesis.task import Task


@dataclass(kw_only=True)
class Synthesize(Reported, Command):
    """Can the hand take that hold? Configurations in which every hand region touches its object region.

    Each one comes with a proof that an exact configuration exists. If there is none, that is shown too,
    where the limits allow. Ctrl-C ends the search; --save keeps where it stands, --resume goes on.
    """

    task: Annotated[Positional[str], arg(metavar="TASK")]
    """a handfast/task/1 file or the name of a bundled task"""
    count: Annotated[int, arg(metavar="N")] = 1
    """configurations that differ as much as possible"""
    seed: Annotated[int, arg(metavar="S")] = 0
    """of the random starts: the same seed gives the same configurations"""
    timeout: Annotated[float, arg(metavar="S")] = 60.0
    """seconds after start-up; inf: until it is answered"""
    nodes: Annotated[int | None, arg(metavar="N")] = None
    """boxes of the search for a contradiction"""
    resume: Annotated[Path | None, arg(metavar="FILE.json")] = None
    """go on from an undecided answer that --save wrote"""
    save: Annotated[Path | None, arg(metavar="FILE.json"), EndsIn((".json",))] = None
    """write task, answer and proofs, for handfast verify and --resume"""
    configuration: Annotated[Path | None, arg(metavar="FILE.json")] = None
    """write the configuration, for handfast contacts; several as FILE-1.json, FILE-2.json, ..."""
    output: Annotated[Path | None, arg(metavar="FILE.png", aliases=["-o"]), EndsIn((".png", ".svg"))] = None
    """picture of the first configuration (.png, .svg)"""

    def run(self) -> int:
        task = load_solvable(self.task)
        if self.count < 1:
            raise InputError(f"is {self.count}; at least 1 is needed", field="--count")
        for path in self._configurations(self.count):
            check_writable(path, self.force, (".json",))
        with console.watch("synthesize") as watch:
            answer = synthesize(
                task,
                count=self.count,
                seed=self.seed,
                timeout=None if self.timeout == float("inf") else self.timeout,
                nodes=self.nodes,
                resume=self.resume,
                on_progress=lambda progress: watch.say(progress_text(progress)),
            )
        written = []
        if self.save:
            answer.save(self.save, force=self.force)
            written.append(self.save)
        for path, solution in zip(self._configurations(len(answer.solutions)), answer.solutions, strict=False):
            save_configuration(solution.configuration, path, force=self.force)
            written.append(path)
        if self.output and answer.solutions:
            from handfast.pictures.drawing import picture
            from handfast.pictures.task_picture import draw_task

            drawn = picture(draw_task(task, answer.solutions[0]), self.output.suffix.lower().removeprefix("."))
            write_bytes(self.output, drawn, force=self.force)
            written.append(self.output)
        if self.report and answer.solutions:
            from handfast.pictures.found_page import report_synthesis

            report_synthesis(self.report, answer, force=self.force)
            written.append(self.report)
        if self.json:
            console.print_json(answer.to_json())
        else:
            show_synthesis(console.out(), answer, self.count, written)
        enough = len(answer.solutions) == self.count
        return console.status(answer.verdict, answer.stop) if enough or not answer.solutions else console.UNDECIDED

    def _configurations(self, count: int) -> list[Path]:
        """Where `count` configurations are written, if they are."""
        if self.configuration is None or count == 0:
            return []
        if self.count == 1:
            return [self.configuration]
        stem, ending = self.configuration.stem, self.configuration.suffix
        return [self.configuration.with_name(f"{stem}-{k}{ending}") for k in range(1, count + 1)]


REACH_STYLES = {Reach.FOUND: "bold green", Reach.NONE: "bold red", Reach.UNDECIDED: "bold yellow"}
SHOWN = 3  # configurations in full; of the others a line each
STOP_REASONS = {
    Stop.TIME: "the time limit was hit; give more with --timeout",
    Stop.NODES: "the node limit was hit",
    Stop.INTERRUPTED: "interrupted",
    Stop.RESOLUTION: "the search came to its resolution: a configuration may exist on a limit only",
}


def show_synthesis(out: Console, answer: Synthesis, wanted: int, written: Sequence[Path] = ()) -> None:
    out.print(Text.assemble((answer.verdict.upper(), REACH_STYLES[answer.verdict]), "  ", _sentence(answer, wanted)))
    task = answer.task
    links = ", ".join(t.link for t in task.contact_pairs)
    about = f"{counted(len(task.contact_pairs), 'contact')} of {task.hand.name}: {links}"
    out.print(f"{task.name}: {about}" if task.name else about, style="dim")
    if answer.searched:
        out.print(_searched_text(answer.searched, answer.verdict), style="dim")
    for k, solution in enumerate(answer.solutions[:SHOWN], start=1):
        if len(answer.solutions) > 1:
            out.print(f"\nConfiguration {k}", style="bold")
        show_solution(out, solution)
    rest = answer.solutions[SHOWN:]
    if rest:
        rows = []
        for k, solution in enumerate(rest, start=SHOWN + 1):
            label, slack = min(solution.slacks.items(), key=lambda item: item[1], default=("", np.inf))
            off = slack_text(task, label, slack) if label else "–"
            rows.append((str(k), vector(1e3 * solution.pose[:3, 3], 4), label or "none", off))
        print_table(out, ["", "object at [mm]", "tightest bound", "is off by"], rows)
    if answer.spread is not None:
        text = f"\nAny two of them are at least {num(answer.spread, 3)} apart (1: a radian, or 0.1 m)."
        out.print(text)
    console.say_written(out, *written)


def show_solution(out: Console, solution: Solution) -> None:
    """Joints, pose, contacts and how far the bounds are."""
    task, hand = solution.task, solution.task.hand
    rows, styles = [], []
    moving = set(task.involved.tolist())
    for j, (joint, value) in enumerate(zip(hand.joints, solution.q, strict=True)):
        factor = 1e3 if joint.type == "prismatic" else 180 / np.pi
        limits = f"{num(factor * joint.lower, 3)} to {num(factor * joint.upper, 3)}"
        rows.append((joint.name, num(factor * value), limits))
        styles.append("" if j in moving else "dim")
    grid = table(["joint", "value [°, mm]", "limits [°, mm]"], rows)
    for row, style in zip(grid.rows, styles, strict=True):
        row.style = style
    out.print()
    out.print(grid)
    place = solution.configuration.object_pose
    at, turn = vector(1e3 * np.array(place.position), 5), vector(place.quaternion, 4)
    out.print(f"Object at {at} mm in the palm frame, turned by the quaternion {turn} (w, x, y, z).")
    places = zip(task.contact_pairs, solution.points, solution.normals, strict=True)
    lines = [(str(k), pair.link, vector(1e3 * p, 4), vector(n)) for k, (pair, p, n) in enumerate(places)]
    print_table(out, ["#", "link", "point [mm]", "normal into the object"], lines)
    tight = sorted(solution.slacks.items(), key=lambda item: item[1])[:3]
    if tight:
        nearest = (f"{label}, {slack_text(task, label, x)} away" for label, x in tight)
        out.print(f"Nearest bounds: {'; '.join(nearest)}.")
    proof = solution.existence
    widest = float(proof.radii.max())
    out.print(
        f"Proved: an exact configuration is within {num(widest, 2)} of it in each of "
        f"{counted(len(proof.dependent), 'coordinate')}, the others as they are.",
        style="dim",
    )


def progress_text(progress: SynthesisProgress) -> str:
    """One line while it runs."""
    text = f"{counted(progress.starts, 'start')}"
    if progress.wanted > 1 or progress.found:
        text += f" · {progress.found} of {progress.wanted} found"
    if progress.nodes:
        text += f" · {_boxes(progress.nodes)}, {progress.pending} left, depth {progress.depth}"
        text += f", {100 * progress.discarded:.4g} % discarded"
    return text


def slack_text(task: Task, label: str, slack: float) -> str:
    """How far a bound is off, in a unit that fits it."""
    kind, _, name = label.partition(":")
    straight = kind == "joint" and task.hand.joints[task.hand.joint(name)].type == "prismatic"
    if kind == "position" or straight:
        return f"{num(1e3 * slack, 3)} mm"
    on_cap = name.endswith(":s") and task.contact_pairs[int(name.split(":")[0])].object.ball
    if kind == "joint" or name.endswith(":cone") or on_cap:
        return f"{num(np.degrees(slack), 3)}°"
    return num(slack, 3)


def _sentence(answer: Synthesis, wanted: int) -> str:
    took = f"{num(answer.seconds, 2)} s, {counted(answer.starts, 'start')}"
    match answer.verdict:
        case Reach.FOUND:
            n = len(answer.solutions)
            text = f"{counted(n, 'configuration')}" + (f" of {wanted}" if n < wanted else "")
            short = "" if n == wanted else f"; {_short(answer.stop)}"
            return f"{text}, proved to exist ({took}){short}."
        case Reach.NONE:
            by = answer.searched.by if answer.searched else "the contacts"
            claim = "cannot go together" if " and " in by else "cannot be made"
            return f"No configuration exists: {by} {claim} ({took})."
        case _:
            further = ", or --save and --resume" if answer.stop is Stop.TIME else ""
            why = f"{STOP_REASONS.get(answer.stop, answer.stop)}{further}"
            return f"Neither a configuration nor a contradiction was found: {why} ({took})."


def _short(stop: Stop) -> str:
    return "no others were met that differ" if stop is Stop.RESOLUTION else STOP_REASONS.get(stop, str(stop))


def _searched_text(s: Searched, verdict: Reach) -> str:
    text = f"{_boxes(s.nodes)} examined, depth {s.depth}"
    if verdict is Reach.NONE:
        return f"{text}, all discarded"
    nearest = f"nearest to a contradiction: {s.by}"
    sizes = f"{s.pending} left, their widest side {num(s.smallest, 2)} to {num(s.largest, 2)}"
    return f"{text}; {nearest}, {100 * s.discarded:.4g} % of the space discarded, {sizes}"


def _boxes(n: int) -> str:
    return "1 box" if n == 1 else f"{n} boxes"
