"""`handfast hold`: one preload under which all loads are resisted; of one grasp, or of each of many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.console import Console
from rich.text import Text
from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.console import print_table
from handfast.cli.load_options import Disturbances
from handfast.cli.options import LoadingOrder, QueryOptions, Saved, WorkOptions, check_folder, check_writable
from handfast.cli.tables import VERDICT_STYLES
from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.core.parallel import default_jobs, workers_of
from handfast.datasets.dataset_rows import DatasetRow, FaultyRow, GraspChanges, grasp_of_text
from handfast.datasets.open_dataset import open_dataset
from handfast.model.grasp import Grasp
from handfast.pictures import Entry, words
from handfast.pictures.sentences import command_text, hold_sentence
from handfast.pictures.words import num
from handfast.proofs.holds import grown
from handfast.stability.answers import MaxAnswer
from handfast.stability.answers.load_path import LoadPath
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.hold import HoldAnswer
from handfast.stability.studies.questions import hold

PRELOAD_MARGIN = 1.01  # margin: no more than the smallest preload leaves
BATCH_ENDINGS = (".jsonl", ".ndjson")  # files of many grasps


@dataclass(kw_only=True)
class Hold(Disturbances, QueryOptions, LoadingOrder, Saved, WorkOptions):
    """Is there one preload under which every load is resisted, each on its own, and how small can it be?

    GRASP may be a folder of grasp files, such as `import` writes, or JSON lines: a line each is said of its grasps.
    Sought are the commands of the actuators that the grasp preloads, or of all if it preloads none. The margin of a
    load is the largest factor by which it can be multiplied and is still resisted under that preload, by a witness and
    a certificate; factors between 1 and it are mostly resisted, not always. The smallest preload leaves the load that
    needs most a margin of about 1: --safety asks for more. With --loading preload-first each load grows on a path after
    the squeeze, the margin is where the path ends, and no preload is said to be the smallest."""

    grasp: Annotated[Positional[str], arg(metavar="GRASP|FOLDER")]
    """a handfast/grasp/1 file, the name of a bundled grasp, or a folder or .jsonl of grasp files"""
    save: Annotated[Path | None, arg(metavar="FILE.json|FOLDER")] = None
    """write answer, witnesses and certificates, for handfast verify; of a folder, K.hold.json for each grasp"""
    safety: Annotated[float, arg(metavar="FACTOR")] = 1.0
    """multiply every load"""
    command_limit: Annotated[float | None, arg(metavar="V")] = None
    """largest command of any actuator [N m or N]; by default any"""
    least: bool = True
    """be content with the first preload that holds, not the smallest that is found"""
    margin: bool = True
    """do not ask how much more of each load is resisted"""
    timeout: Annotated[float, arg(metavar="S")] = float("inf")
    """seconds for everything that is asked about a grasp; by default any"""
    question_timeout: Annotated[float, arg(metavar="S")] = float("inf")
    """seconds for a single query"""

    def settings(self) -> Settings:
        return replace(super().settings(), timeout=self.question_timeout)

    def run(self) -> int:
        if not self.timeout > 0:
            raise InputError(f"is {self.timeout:g} s; a positive number is needed", field="--timeout")
        if self.command_limit is not None and not self.command_limit >= 0:
            raise InputError(f"is {self.command_limit:g}; 0 or more is needed", field="--command-limit")
        self.workers()
        where = Path(self.grasp)
        return self._all(where) if where.is_dir() or where.suffix.lower() in BATCH_ENDINGS else self._one()

    def _one(self) -> int:
        if self.scheduler:
            raise InputError("is for a folder of grasps; one is asked about", field="--scheduler")
        check_writable(self.save, self.force, (".json",))
        grasp, options = self.load(), self.options()
        with console.watch("hold") as watch:
            answer = self._asked(grasp, self.grasp, options | {"on_progress": watch.say})
        held = grasp if answer.preload is None else grasp.with_commands(answer.preload)
        said = said_of(answer)
        self.finish(held, answer, self._entries(answer), lambda out: self._show(out, grasp, answer), said=said)
        return status(answer)

    def _show(self, out: Console, grasp: Grasp, answer: HoldAnswer) -> None:
        show_hold(out, grasp, answer, self.eta, self._why(answer))
        if answer.margin is not None and answer.margin < PRELOAD_MARGIN and self.safety == 1 and answer.upper > 0:
            which = "The smallest preload" if answer.loading == "together" else "This preload"
            out.print(f"{which} leaves its hardest load no more; --safety 1.5 asks for 1.5.")
        if answer.margins and self.safety != 1:
            out.print(f"Margins are of the loads above, which are {self.safety:g} times what was given.")
        if self.gravity:
            out.print(self.weight_text(grasp), style="dim")
        console.say_written(out, self.save, self.report)

    def _asked(self, grasp: Grasp, source: str, options: dict[str, Any]) -> HoldAnswer:
        loads = self.disturbances(grasp, source).scaled(self.safety)
        asked: dict[str, Any] = {"least": self.least, "margins": self.margin, "command_limit": self.command_limit}
        asked |= {"loading": self.loading}
        return hold(grasp, loads, timeout=self.timeout, **asked, **options)

    def _entries(self, answer: HoldAnswer) -> list[Entry]:
        if not self.report:
            return []
        if answer.preload is None:
            raise InputError("shows loads under a preload, and none was found", field="--report")
        named = zip(answer.loads.names, answer.checks, strict=True)
        return [Entry(f"Does it hold “{name}”?", a, self.limits.eta) for name, a in named]

    def _why(self, answer: HoldAnswer) -> str:
        """Why an answer is not complete, and what helps; '' if it is."""
        stops = {answer.stop, *(a.stop for a in answer.margins.values())}
        if Stop.INTERRUPTED in stops:
            return "It was interrupted; this is what was found so far."
        if Stop.TIME in stops:
            option = "--question-timeout" if self.timeout == float("inf") else "--timeout"
            found = answer.verdict is not Verdict.UNDECIDED
            what = "find a smaller preload, or say more of the margins" if found else "decide it"
            return f"The time ran out; a larger {option} may {what}."
        if Stop.NODES in stops:
            return f"The node limit of {self.nodes:g} was hit; a larger --nodes may say more."
        if answer.verdict is Verdict.UNDECIDED:
            return f"None of the preloads that were tried holds all loads; the last that failed was {answer.hardest}."
        return ""

    # --- of several grasps

    def _all(self, where: Path) -> int:
        if self.report:
            raise InputError("is a page about one grasp; several are asked about", field="--report")
        self.check_given()
        check_folder(self.save)
        if self.save and self.save.exists() and any(self.save.iterdir()) and not self.force:
            raise InputError("is not empty; give --force to write over files in it", source=str(self.save))
        dataset, rows = open_dataset(where), list[HeldGrasp]()
        items = (dataset.row(k, item) for k, item in enumerate(dataset.items()))
        jobs = min(self.jobs or default_jobs(), dataset.count)
        with console.watch("hold") as watch, workers_of(self, jobs, self.scheduler) as pool:
            try:
                for row in pool.map(Hold.held, items):
                    rows.append(row)
                    watch.item(len(rows), dataset.count)
                    if row.answer and self.save:
                        row.answer.save(self.save / f"{len(rows) - 1:03}.hold.json", force=self.force)
            except KeyboardInterrupt:
                console.complain(f"interrupted after {len(rows)} of {dataset.count}")
        if self.json:
            console.print_json({"schema": "handfast/answers/1", "query": "hold", "rows": [r.to_json() for r in rows]})
        else:
            show_holds(console.out(), rows)
            console.say_written(console.out(), self.save)
        if rows and not any(row.answer for row in rows):
            return console.BAD_INPUT
        whole = console.ANSWERED if len(rows) == dataset.count else console.UNDECIDED
        return max([whole, *(status(row.answer) for row in rows if row.answer)])

    def held(self, row: DatasetRow) -> HeldGrasp:
        """What is known of a row; a fault in it is its reason."""
        options = self.options()
        try:
            if isinstance(row.content, FaultyRow):
                return HeldGrasp(row.name, None, row.content.reason)
            if not isinstance(row.content, str):
                return HeldGrasp(row.name, None, "is a posture; a grasp file is needed")
            grasp = self.changed(grasp_of_text(row.content, row.name, GraspChanges()), row.name)
            options |= {"settings": replace(options["settings"], jobs=1)}
            return HeldGrasp(row.name, self._asked(grasp, row.name, options))
        except InputError as fault:
            return HeldGrasp(row.name, None, str(fault).removeprefix(f"{row.name}: "))


def status(answer: HoldAnswer) -> int:
    """Exit status of an answer; margins that a limit left open count."""
    open_ = [console.status(answer.verdict, a.stop) for a in answer.margins.values()]
    return max(console.status(answer.verdict, answer.stop), *open_, 0)


CUT = Stop.TIME, Stop.NODES, Stop.INTERRUPTED  # limits that ended a search


@dataclass(frozen=True, eq=False)
class HeldGrasp:
    """What is known of one grasp of several: an answer, or why there is none."""

    name: str
    answer: HoldAnswer | None
    reason: str = ""

    def to_json(self) -> dict[str, Any]:
        said = None if self.answer is None else self.answer.to_json()
        return {"name": self.name, "answer": said, "reason": self.reason or None}


def show_hold(out: Console, grasp: Grasp, answer: HoldAnswer, eta: float, why: str) -> None:
    """Verdict, preload, loads.

    Args:
        eta: how far normals may be off [degrees].
        why: the answer is not complete; '' if it is.
    """
    out.print(Text.assemble((answer.verdict.upper(), VERDICT_STYLES[answer.verdict]), "  ", hold_sentence(answer)))
    off = f"; normals off by up to {num(eta)}°" if eta else ""
    out.print(f"{grasp.name}: {words.grasp_text(grasp)}{off}", style="dim")
    if why:
        out.print(why, style="yellow")
    out.print(f"{words.count(answer.nodes, 'node')}, {num(answer.seconds, 2)} s", style="dim")
    if answer.preload:
        commands = answer.preload.items()
        rows = [(n, f"{num(v)} {words.actuator_unit(grasp, n)}" if v else "locked") for n, v in commands]
        print_table(out, ["actuator", "command"], rows)
    if answer.checks:
        lines = []
        for name, wrench, a in zip(answer.loads.names, answer.loads.wrenches, answer.checks, strict=True):
            shown = "an exact state" if a.exact else "a state to 1e-9"
            shown += " of each step" if isinstance(a.path, LoadPath) else ""
            more = [margin_text(answer.margins.get(name))] if answer.margins else []
            lines.append((name, words.load_text(wrench), shown, *more))
        print_table(out, ["load", "", "shown by", *(["margin"] if answer.margins else [])], lines)
    if answer.margin is not None:
        out.print(conclusion(answer))


def said_of(answer: HoldAnswer) -> list[str]:
    """What the page says first: the verdict, and how many times each load is resisted."""
    said = [f"{answer.verdict.upper()}: {hold_sentence(answer)}"]
    if answer.margins:
        each = [f"{name} {margin_text(found)}" for name, found in answer.margins.items()]
        said.append(f"{conclusion(answer)} Of each: {', '.join(each)}.")
    return said


def show_holds(out: Console, rows: Sequence[HeldGrasp]) -> None:
    """A line for each grasp; below it, why some have no answer."""
    answers = [row.answer for row in rows if row.answer]
    counts = [(v, sum(a.verdict is v for a in answers)) for v in Verdict]
    said = ", ".join(f"{n} {v}" for v, n in counts if n) or "none asked"
    broken = len(rows) - len(answers)
    out.print(f"{words.count(len(rows), 'grasp')}: {said}{f', {broken} broken' if broken else ''}", style="bold")
    heads = "#", "grasp", "", "largest command", "hardest load", "margin", "exact", "seconds"
    lines: list[tuple[str | Text, ...]] = []
    for k, row in enumerate(rows):
        a = row.answer
        if a is None:
            lines.append((str(k), row.name, Text("BROKEN", style="bold red"), *["–"] * 5))
            continue
        exact = "–" if a.exact is None else "yes" if a.exact else "to 1e-9"
        cut = f", {a.stop}" if a.stop in CUT else ""
        verdict = Text(a.verdict.upper() + cut, style=VERDICT_STYLES[a.verdict])
        hardest = a.refuted[0] if a.refuted else a.hardest or "–"
        margin = "–" if a.margin is None else "any size" if np.isinf(a.margin) else num(a.margin)
        margin += " or more" * any(m.stop in CUT for m in a.margins.values())
        lines.append((str(k), row.name, verdict, command_text(a), hardest, margin, exact, num(a.seconds, 2)))
    print_table(out, heads, lines)
    for k, row in enumerate(rows):
        if row.reason:
            out.print(f"{k}: {row.reason}", style="yellow", soft_wrap=True)


def margin_text(a: MaxAnswer | None) -> str:
    """'1.25', with the bound above it where they are apart."""
    if a is None or np.isinf(shown := grown(a.lower, a.unbounded)):
        return "any size"
    lower = num(shown)
    if not np.isfinite(a.upper):
        return f"{lower} or more"
    upper = num(max(a.upper, 1.0))
    return lower if lower == upper else f"{lower} to {upper}"


def conclusion(answer: HoldAnswer) -> str:
    """The least margin in words."""
    if answer.margin is None or np.isinf(answer.margin):
        return "Each load is resisted at any size under this preload, as far as was looked: 1000 times at least."
    return f"Margin {num(answer.margin)}: each load alone is resisted so many times; {answer.weakest} has the least."
