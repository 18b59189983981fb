"""`handfast plan`: grasps of a hand on an object that hold their loads."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from tyro.conf import Positional, UseAppendAction, arg

from handfast.cli import console
from handfast.cli.console import table
from handfast.cli.grasp import overlaps_text, starts_text, tally_rows
from handfast.cli.load_options import SceneOptions, SearchFlags, axis_vector
from handfast.cli.options import Assignments, Command, LoadingOrder, Triple, closing_senses
from handfast.core.answer import Reach, Stop
from handfast.core.errors import InputError
from handfast.core.limited import within
from handfast.model.body import Body
from handfast.pictures import words
from handfast.planning.candidates.palm_poses import Sampling
from handfast.planning.evaluation.attempt import ATTEMPT_REASONS
from handfast.planning.evaluation.preload_search import MIN_PRELOAD_TIME
from handfast.planning.evaluation.quality import largest_command
from handfast.planning.filters.surroundings import WAY_LENGTH, Surroundings
from handfast.planning.plan_grasps import plan
from handfast.planning.question import PlanOptions, compared, compared_size
from handfast.planning.results.plan import Plan
from handfast.planning.search import Journal
from handfast.readers.load_body import load_body, seen_mesh
from handfast.readers.load_hand import load_hand
from handfast.readers.registry import MESHES, ending
from handfast.stability.problem.loads import Loads


@dataclass(kw_only=True)
class PlanGrasps(SearchFlags, SceneOptions, LoadingOrder, Command):
    """Look for grasps that hold an object, and differ from each other.

    Starts the hand at random before the object's surface, closes it, and keeps what holds every load under one
    preload. By default the loads are the object's weight with gravity along its axes, both ways. The same seed
    gives the same grasps.
    """

    others: Annotated[Positional[tuple[str, ...]], arg(metavar="[OBJECT ...]")] = ()
    """more objects, one after the other; files of each go to a folder of its name below FOLDER"""
    count: Annotated[int, arg(metavar="N", aliases=["-n"])] = 20
    """grasps to look for"""
    timeout: Annotated[float, arg(metavar="S")] = 300.0
    """seconds after which what was found is returned, of each object; taking a mesh apart counts"""
    attempts: Annotated[int, arg(metavar="N")] = 100_000
    """largest number of starts"""
    contacts: Annotated[int | None, arg(metavar="N")] = None
    """grasps of at most N contacts"""
    pool: Annotated[int | None, arg(metavar="N")] = None
    """gather so many grasps, then keep those that differ most"""
    approach: Triple = ()
    """direction in which the palm approaches, in the hand's base frame; guessed"""
    closing: Assignments = ()
    """sense in which a joint closes: JOINT=1, JOINT=-1, or JOINT=0 to sample it as a spread"""
    support: Literal["plane"] | None = None
    """the object stands on a plane, below its lowest point along --up, or z; hand and ways keep clear of it"""
    obstacle: UseAppendAction[tuple[str, ...]] = ()
    """a mesh or handfast/body/1 file in the object's frame that nothing may touch; repeatable"""
    travel: Annotated[float | None, arg(metavar="M")] = None
    """length of a straight approach and of a retreat that collide with nothing [m]; 0.1 with a support or obstacles"""
    simulate: bool = False
    """keep what the dynamics engine holds too: hand and object themselves, each load without the factor of safety"""
    give_up: Annotated[int, arg(metavar="N")] = 1000
    """end after so many starts of which none came through the filters, with what is the matter"""
    output: Annotated[Path | None, arg(metavar="FOLDER", aliases=["-o"])] = None
    """write a configuration and a grasp file for each grasp as it is found, and plan.json"""

    def run(self) -> int:
        from handfast.planning.results.folder import PlanFolder

        names = [self.object, *self.others]
        twice = next((n for k, n in enumerate(names) if _name(n) in map(_name, names[:k])), None)
        if twice:
            raise InputError(f"'{twice}' is given twice", field="OBJECT")
        options: PlanOptions = self.options(
            PlanOptions,
            lambda: load_hand(self.hand, root=self.root, srdf=self.srdf),
            sampling=Sampling(approach=self.approach or None),
            surroundings=self._surroundings(),
        )
        self.workers()  # refused before the work
        asked = [self._for(name) for name in names] if self.others else [self]
        for one in asked:
            PlanFolder.refuse(one.output, resume=self.resume, force=self.force)
        rows: list[tuple[str, dict[str, Any] | None, str]] = []
        worst = console.ANSWERED  # what is wrong with one of several objects comes before what is open of another
        for one in asked:
            try:
                status, said = one.plan(options)
                rows.append((one.object, said, ""))
            except InputError as fault:
                if not self.others:
                    raise
                status = console.complain(str(fault))
                rows.append((one.object, None, str(fault)))
            worst = status if worst == console.ANSWERED or status == console.BAD_INPUT else worst
            if rows[-1][1] and rows[-1][1]["stop"] == Stop.INTERRUPTED:
                break
        if self.json and self.others:
            told = [{"name": name, "answer": said, "reason": reason or None} for name, said, reason in rows]
            console.print_json({"schema": "handfast/answers/1", "query": "plan", "rows": told})
        elif self.json:
            console.print_json(rows[0][1] or {})
        return worst

    def _for(self, name: str) -> PlanGrasps:
        """The same question about one of several objects; its files are named after it."""
        of = _name(name)
        folder = self.output / of if self.output else None
        page = self.report.with_name(f"{self.report.stem}-{of}{self.report.suffix}") if self.report else None
        return replace(self, object=name, others=(), output=folder, report=page)

    def plan(self, options: PlanOptions) -> tuple[int, dict[str, Any]]:
        """The exit status, and what is said of one object."""
        from handfast.planning.results.folder import PlanFolder

        begin = time.monotonic()
        if ending(Path(self.object)) in MESHES:
            self._refuse_weightless(self.mass)  # before it is taken apart
        with within(self.timeout):
            hand = self.load_own_hand()
            facts, meshes = seen_mesh(Path(self.object), self.scale)
            if facts:
                compared_size(hand, max(facts["size"]), Path(self.object).stem, self.scale)
            body = self.load_object(self.object, self.scale, meshes)
        options = replace(options, timeout=max(self.timeout - (time.monotonic() - begin), MIN_PRELOAD_TIME))
        senses = closing_senses(self.closing)
        hand = hand.with_closing(senses)
        loads = self._loads(body)
        console.warn(compared(hand, body))
        with console.watch("plan") as progress:

            def note(so_far: Plan) -> None:
                done = sum(g.robust for g in so_far.found)
                others = f" robust, {len(so_far.found) - done} fragile"
                progress.item(done, max(self.count, self.pool or 0), f"{others} · {starts_text(so_far.tally)}")

            names = _from_anywhere(self.hand), _from_anywhere(self.object)
            laws: dict[str, Any] = {"joint_laws": self.joint_laws, "backdrivable": self.backdrivable}
            how: dict[str, Any] = laws | {"resume": self.resume, "on_progress": note}
            folder = PlanFolder(self.output, *names, senses, **how) if self.output else None
            journal = folder or Journal(note)
            planned = plan(hand, body, loads=loads, options=options, journal=journal, **self.workers())
        if self.report and planned.grasps:
            from handfast.pictures.found_page import report_plan

            report_plan(self.report, planned, force=self.force)
        if not self.json:
            self._show(planned)
        return console.status(planned.verdict, planned.stop), folder.answer if folder else planned.to_json()

    def _surroundings(self) -> Surroundings | None:
        """What the object stands on and what is around it; None if nothing was said of that."""
        if not (self.support or self.obstacle or self.travel is not None):
            return None
        way = np.array(axis_vector(self.up or "z"))
        with within(self.timeout):
            solids = [piece for file in self.obstacle for piece in load_body(file).pieces]
        travel = WAY_LENGTH if self.travel is None else self.travel
        return Surroundings(way if self.support else None, solids, travel)

    def _loads(self, body: Body) -> Loads:
        self._refuse_weightless(body.mass)
        return self.asked(body)

    def _refuse_weightless(self, mass: float | None) -> None:
        if mass is None and (self.up or self.tilt or not (self.wrench or self.loads)):
            raise InputError("is unknown; give --mass KG", source=self.object, field="mass")

    def _show(self, planned: Plan) -> None:
        out = console.out()
        if planned.verdict is Reach.NONE:
            out.print(f"NONE  Of {planned.body.name}, {planned.fewest_contacts}. Proved in {planned.seconds:.1f} s.")
            out.print(f"Asked to hold: {words.times_text(self.safety)}{', '.join(planned.loads.names)}", soft_wrap=True)
            console.say_written(out, self.output)
            return
        found = f"{planned.body.name}: {words.count(len(planned.grasps), 'grasp')}"
        first = "" if planned.first is None else f", the first after {planned.first:.1f} s"
        asked = "" if planned.stop == "complete" else f" of {planned.count} asked for (stopped: {planned.stop})"
        out.print(f"{found}{asked}, {planned.tried} starts, {planned.seconds:.1f} s{first}", style="bold")
        what = "Each holds, under its preload" if planned.grasps else "Asked to hold, under one preload"
        out.print(f"{what}: {words.times_text(self.safety)}{', '.join(planned.loads.names)}")
        if planned.grasps:
            heads = "grasp", "start", "contacts", "margin", "", "largest command", "clearance [mm]", "links"
            rows = []
            for g in planned.grasps:
                q, most = g.quality, largest_command(g.grasp)
                unit = words.actuator_unit(g.grasp, most["actuator"]) if most["actuator"] else ""
                measured = ["not asked", "", ""]
                if q:
                    sure = "fragile" if q.fragile else "robust"
                    measured = [words.margin_figure(q.margin), sure, words.num(1e3 * q.clearance, 3)]
                command = f"{words.num(abs(most['value']), 3)} {unit}" if unit else "locked"
                links = ", ".join(sorted({str(c.link) for c in g.grasp.contacts}))
                numbers = str(planned.number(g)), str(g.index), str(g.grasp.m)
                rows.append((*numbers, *measured[:2], command, measured[2], links))
            out.print(table(heads, rows))
            out.print(f"Margin: {words.MARGIN_TEXT}. Best first: {words.BEST_FIRST}.", style="dim", soft_wrap=True)
            if fragile := sum(g.quality is not None and g.quality.fragile for g in planned.grasps):
                some = f"{fragile} of {len(planned.grasps)} are fragile"
                out.print(f"{some}: no more robust ones were found in {planned.tried} starts.", style="yellow")
            if planned.others and self.output:
                out.print(f"Left out: {words.count(len(planned.others), 'grasp')} more, 'others' in plan.json.")
            if left := sum(g.quality is None for g in planned.grasps):
                why = "it was interrupted" if planned.stop is Stop.INTERRUPTED else "the time ran out"
                again = "; --resume with more --timeout asks" if self.output else ""
                out.print(f"Not asked of {words.count(left, 'grasp')} before {why}{again}.", style="yellow")
            for g in planned.grasps:
                beyond = words.beyond_text(planned.hand, g.grasp.preload)
                out.print(f"Preload of {planned.number(g)}: {words.preload_text(g.grasp)}{beyond}", soft_wrap=True)
        worst = overlaps_text(planned.tally)
        became = [(*row, worst.get(row[0], "")) for row in tally_rows(planned.tally, "kept", ATTEMPT_REASONS)]
        columns = 3 if worst else 2
        about = "what became of the starts", "", "overlapped most often"
        out.print(table(about[:columns], [row[:columns] for row in became]))
        if planned.fewest_contacts:
            out.print(f"Shown: of {planned.body.name}, {planned.fewest_contacts}.", soft_wrap=True)
        for sentence in planned.diagnosis:
            out.print(sentence, soft_wrap=True)
        console.say_written(out, self.output, self.report if planned.grasps else None)
        if self.report and not planned.grasps:
            out.print(f"Not written: {self.report}; there is nothing to show", soft_wrap=True)


def _name(object_: str) -> str:
    """What folders and pages of an object are called."""
    return Path(object_).name.partition(".")[0]


def _from_anywhere(name: str) -> str:
    """A path that is right wherever the files are read from; a bundled name as it is."""
    return str(Path(name).resolve()) if os.path.isfile(name) else name
