"""`handfast grasp`: from regions to a certified, collision-free, passively stable grasp with its torques."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from rich.console import Console
from rich.text import Text
from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.console import print_table
from handfast.cli.load_options import JointLawOptions, ObjectOptions, SearchFlags
from handfast.cli.options import Command, load_solvable
from handfast.cli.synthesize import REACH_STYLES, STOP_REASONS
from handfast.core.answer import Reach
from handfast.core.errors import InputError
from handfast.core.limited import within
from handfast.pictures import words
from handfast.pictures.words import num
from handfast.planning.question import Allowed, Requirements, TaskGraspOptions, compared
from handfast.planning.results.search_file import COUNTED_REASONS
from handfast.planning.search import Journal, Pair, Rejected, RejectionReason, Tally
from handfast.proofs.replay import down, up

if TYPE_CHECKING:
    from handfast.planning.joined_search import JoinedSearched
    from handfast.planning.missing import Missing
    from handfast.planning.no_balance import BalanceSearched
    from handfast.planning.results.grasps import Grasps
    from handfast.synthesis.task import Task


@dataclass(kw_only=True)
class FindGrasps(SearchFlags, JointLawOptions, ObjectOptions, Command):
    """Find grasps for a task: the hand reaches them, nothing collides, they hold, and with these torques.

    Every configuration comes with a proof that it exists, every load with an exact equilibrium under the
    preload. What else was tried is counted by the reason why it was dropped.
    """

    task: Annotated[Positional[str], arg(metavar="TASK")]
    """a handfast/task/1 file or the name of a bundled task"""
    count: Annotated[int, arg(metavar="N", aliases=["-n"])] = 3
    """grasps that differ from each other"""
    object: Annotated[str | None, arg(metavar="OBJECT")] = None
    """a mesh or handfast/body/1 file or the name of a bundled object, instead of the task's"""
    depth: Annotated[float, arg(metavar="M")] = 1e-3
    """how deep solids may be in each other, links beyond what they are at rest: shapes are approximations [m]"""
    best: Literal["margin"] | None = None
    """margin: go on until the time is over, for grasps that hold the largest multiple of the loads under one preload,
    and for a proved bound on it; --force-limit makes it finite"""
    timeout: Annotated[float, arg(metavar="S")] = 60.0
    """seconds for the search after start-up; inf: until there are N"""
    output: Annotated[Path | None, arg(metavar="FOLDER", aliases=["-o"])] = None
    """write grasps as they are found: grasps.json for handfast verify, grasp-K.json and configuration-K.json of each"""

    def run(self) -> int:
        from handfast.planning.grasp_for import grasp_for
        from handfast.planning.results.folder import GraspFolder

        allowed = Allowed(self.depth, self.depth, self.depth)
        task = load_solvable(self.task)
        options: TaskGraspOptions = self.options(TaskGraspOptions, lambda: task.hand, allowed=allowed)
        task = replace(task, hand=self.lawful(task.hand))
        name = self.object or task.object
        if name is None:
            raise InputError("names no object; give --object, its shape is needed", source=self.task)
        workers = self.workers()
        GraspFolder.refuse(self.output, resume=self.resume, force=self.force)
        with within(self.timeout):
            body = self.load_object(name)
        console.warn(compared(task.hand, body))
        with console.watch("grasp") as watch:

            def note(so_far: Grasps) -> None:
                watch.say(progress_text(so_far))

            folder = GraspFolder(self.output, resume=self.resume, on_progress=note) if self.output else None
            journal = folder or Journal(note)
            answer = grasp_for(task, body, self.asked(body), options=options, journal=journal, **workers)
        written = folder.written if folder else []
        if self.report and answer.grasps:
            from handfast.pictures.found_page import report_grasp

            report_grasp(self.report, answer, force=self.force)
            written = [*written, self.report]
        if self.json:
            console.print_json(answer.to_json())
        else:
            show_grasps(console.out(), answer, written, self.safety)
        enough = len(answer.grasps) >= self.count
        return console.status(answer.verdict, answer.stop) if enough or not answer.grasps else console.UNDECIDED


SHOWN_REASONS = 3
SHORT_REASONS = {  # reasons in a few words, for a line of progress
    RejectionReason.PAST: "past the object",
    RejectionReason.INSIDE: "in the object",
    RejectionReason.FOLDED: "hand in itself",
    RejectionReason.MISSES: "would miss",
    RejectionReason.FEW: "too few fingers",
    RejectionReason.PENETRATES: "penetrate",
    RejectionReason.UNBALANCED: "unbalanced",
    RejectionReason.SLIPS: "slip",
    RejectionReason.UNDECIDED: "undecided",
    RejectionReason.STRONG: "need too much",
}


def progress_text(so_far: Grasps) -> str:
    """Where the search is, and as long as nothing is found how far the proofs are that there is nothing."""
    said = f"{len(so_far.grasps)} of {so_far.count} found, {words.count(so_far.tally.total, 'start')} judged"
    if (forces := so_far.balance) is not None and forces.boxes and forces.balanced is None:
        said += f"; no forces at {100 * forces.discarded:.3g} % of the placements"
    if (joined := so_far.joined) is not None:
        links = ", ".join(so_far.task.contact_pairs[k].link for k in joined.contacts)
        said += f"; {100 * joined.discarded:.3g} % of the configurations of {links} discarded"
    return said


def tally_rows(tally: Tally, passed: str, reasons: Sequence[RejectionReason]) -> Iterator[tuple[str, str]]:
    """What became of candidates, in words, and how many; without what none did."""
    for what, number in [(passed, tally.passed), *((str(reason), tally[reason]) for reason in reasons)]:
        if number:
            yield what, str(number)


def starts_text(tally: Tally) -> str:
    """How many starts there were, and what became of most of them: for a line that is written over and over."""
    worst = sorted(tally.rejected.items(), key=lambda item: -item[1].count)[:SHOWN_REASONS]
    parts = [f"{tally.passed} held"] if tally.passed else []
    for reason, some in worst:
        pair = _often(some)
        parts.append(f"{some.count} {SHORT_REASONS.get(reason, str(reason))}{f' ({pair})' if pair else ''}")
    return f"{words.count(tally.total, 'start')}: {', '.join(parts)}"


def overlaps_text(tally: Tally) -> dict[str, str]:
    """For each reason that has overlaps: which were seen most often, and the deepest."""
    out = {}
    for reason, some in tally.rejected.items():
        if some.overlaps:
            deepest = max(some.overlaps, key=lambda pair: some.overlaps[pair][1])
            text = _often(some, often=True)
            worst = f"; deepest {_pair(deepest, some)}" if not text.startswith(_names(deepest)) else ""
            out[str(reason)] = text + worst
    return out


def _often(some: Rejected, often: bool = False) -> str:
    """The overlap that was seen most often, with its depth and, if asked for, how often; '' if there is none."""
    if not some.overlaps:
        return ""
    pair = max(some.overlaps, key=lambda p: some.overlaps[p][0])
    return _pair(pair, some) + (f", {some.overlaps[pair][0]} times" if often else "")


def _pair(pair: Pair, some: Rejected) -> str:
    return f"{_names(pair)} {1e3 * some.overlaps[pair][1]:.3g} mm"


def _names(pair: Pair) -> str:
    return f"{pair[0]} in {pair[1]}"


def show_grasps(out: Console, answer: Grasps, written: Sequence[Path] = (), times: float = 1.0) -> None:
    """times: what the loads were multiplied by."""
    best = f" {best_text(answer, times)}" if answer.grasps and answer.grasps[0].strength else ""
    out.print(Text.assemble((answer.verdict.upper(), REACH_STYLES[answer.verdict]), "  ", sentence(answer) + best))
    task, body = answer.task, answer.body
    links = ", ".join(t.link for t in task.contact_pairs)
    about = f"{task.hand.name} on {body.name}, {words.count(len(task.contact_pairs), 'contact')}: {links}"
    out.print(f"{task.name}: {about}" if task.name else about, style="dim")
    safety = "" if times == 1 else f", {times:g} times what is to be held"
    out.print(loads_text(answer) + safety, style="dim")
    if answer.grasps:
        _show_found(out, answer, times)
    _show_tally(out, answer)
    console.say_written(out, *written)


def sentence(answer: Grasps) -> str:
    """The answer in one sentence."""
    n, seconds = len(answer.grasps), f"in {num(answer.seconds, 3)} s"
    if answer.balance and answer.balance.shown:
        why = no_balance_text(answer.balance, answer.requirements)
        return f"{why}, wherever in their regions the contacts are. Proved {seconds}."
    if answer.joined and answer.joined.shown:
        return f"No configuration is a grasp: {answer.joined.words}. Proved {seconds}."
    if answer.verdict is Reach.NONE:
        return f"The hand cannot bring the regions together: every part of the space was discarded {seconds}."
    if not n:
        why = STOP_REASONS.get(answer.stop, "the search came to its end")
        nothing = "no certified configuration holds" if answer.tally.total else "no configuration was found"
        line = " Two point contacts hold no torque about the line between them, hence hardly any weight."
        points = len(answer.task.contact_pairs) == 2 and not answer.requirements.torsion
        pinch = line if points and answer.tally[RejectionReason.UNBALANCED] else ""
        return f"{nothing[0].upper()}{nothing[1:]} so far, {seconds}; {why}.{pinch}"
    s, loads = "s" if n == 1 else "", words.count(len(answer.loads), "load")
    which = f"{words.count(n, 'grasp')} that exist{s}, collide{s} with nothing and hold{s} {loads}"
    short = (
        f" Requirements for {answer.count}: {STOP_REASONS[answer.stop]}."
        if n < answer.count and answer.stop in STOP_REASONS
        else ""
    )
    return f"{which}, {seconds}.{short}"


def best_text(answer: Grasps, times: float) -> str:
    """How many times the loads the best grasp holds, and the bound; times: what the loads were multiplied by."""
    strength = answer.grasps[0].strength
    assert strength is not None
    held = f"The best holds {down(times * strength.factor, 3)} times what is to be held under one preload"
    if answer.bound is None:
        return f"{held}; no bound is known, as nothing limits the contact forces: --force-limit does."
    if not np.isfinite(answer.bound.factor):
        return f"{held}; no bound was shown."
    gap = f"{100 * (answer.bound.factor / strength.factor - 1):.3g} % more"
    return f"{held}, and no placement of the contacts reaches {up(times * answer.bound.factor, 3)} times ({gap})."


def no_balance_text(searched: BalanceSearched, asked: Requirements) -> str:
    """Why no contact forces balance the loads."""
    distance, soft = searched.line_distance, ""
    if asked.torsion:
        soft = f", a torsion of {num(1e3 * asked.torsion)} mm"
    if not distance or (soft and asked.force_limit is None):
        limit = "" if asked.force_limit is None else f", normal forces up to {num(asked.force_limit)} N"
        limit += ", torques within their limits" if asked.torque_limits else ""
        if few := (searched.proof or {}).get("fewest_contacts"):
            return f"It takes {few} contacts or more to balance the loads with a friction of {num(asked.friction)}"
        return f"No contact forces balance the loads with a friction of {num(asked.friction)}{soft}{limit}"
    near = f"the centre of mass never comes nearer to that line than {down(1e3 * distance, 3)} mm"
    if soft:
        most = f"normal forces up to {num(asked.force_limit or 0.0)} N{soft}"
        return f"Two soft fingertips with {most} have too little moment about the line between them, and {near}"
    return f"Two fingertips have no moment about the line between them, and {near}"


def balance_text(searched: BalanceSearched) -> str:
    """How far the proof has come that no contact forces balance the loads, and what stands in its way."""
    if searched.balanced is not None:
        return (
            "contact forces could balance every load, by statics alone: hand, collisions or friction stand in the way"
        )
    share = f"no forces balance the loads at {100 * searched.discarded:.3g} % of the placements of the contacts"
    if searched.open is None:
        return share
    ends = [f"{low:.3g} to {high:.3g}" for low, high in searched.open.tolist()]
    where = ", ".join(
        f"contact {k} at s {s}, t {t}" for k, (s, t) in enumerate(zip(ends[::2], ends[1::2], strict=True))
    )
    left = f"{searched.pending} boxes, of which the largest is {where}{missing_text(searched.missing)}"
    return f"{share}; neither that nor a placement where they do was shown in {left}"


def joined_text(searched: JoinedSearched, task: Task) -> str:
    """How far the proof has come that every configuration is discarded, and what stands in its way."""
    links = ", ".join(task.contact_pairs[k].link for k in searched.contacts)
    done = f"{100 * searched.discarded:.3g} % of the configurations of {links} are discarded: {searched.words}"
    if searched.open is None:
        return done
    where = ", ".join(f"{name} {low:.3g} to {high:.3g}" for name, (low, high) in searched.open.items())
    where += missing_text(*searched.missing)
    if searched.stuck:
        return f"{done}; no reason discards one of those that are left: {where}"
    return f"{done}; {searched.pending} boxes are left, of which the largest is {where}"


def missing_text(*missing: Missing | None) -> str:
    """What would have discarded a box, the nearest first; empty if nothing is known."""
    known = [m.words for m in missing if m is not None]
    return f". What is missing to discard that: {', or '.join(known)}" if known else ""


def loads_text(answer: Grasps) -> str:
    """What is held."""
    names = answer.loads.names
    some = ", ".join(names) if len(names) <= 7 else f"{', '.join(names[:5])}, ... {names[-1]}"
    force = np.linalg.norm(answer.loads.wrenches[:, :3], axis=1)
    low, high = num(float(force.min())), num(float(force.max()))
    return f"loads: {some} ({low if low == high else f'{low} to {high}'} N)"


def _show_found(out: Console, answer: Grasps, times: float) -> None:
    unit = words.actuator_unit(answer.grasps[0].grasp, answer.grasps[0].grasp.mechanism.actuators[0])
    heads = (f"command [{unit}]", "at least", "friction margin [%]", "clear [mm]", "from limits [%]", "dexterity [-]")
    rows = []
    for k, g in enumerate(answer.grasps, start=1):
        commands, away = (num(g.command, 3), num(g.answer.lower, 3)), f"{1e3 * g.terms['clearance']:.2f}"
        shares = f"{100 * g.friction_margin:.0f}", away, f"{100 * g.terms['from_limits']:.1f}"
        last = num(g.dexterity.typical, 3), "repaired" if g.repaired else ""
        holds = (down(times * g.strength.factor, 3),) if g.strength else ()
        rows.append((str(k), f"{g.score:.2f}", *holds, *commands, *shares, *last))
    first = ["#", "score", *(["holds [times]"] if answer.grasps[0].strength else [])]
    print_table(out, [*first, *heads, ""], rows)
    best = answer.grasps[0]
    used = {n: v for n, v in best.grasp.preload.items() if v}
    squeezed = ", ".join(f"{n} {num(v)}" for n, v in used.items()) or "nothing commanded, the gearing holds"
    out.print(f"\nCommands of the best [{unit}]: {squeezed}; every other actuator is locked.", soft_wrap=True)
    if any(g.fragile for g in answer.grasps):
        line = "two point contacts have no moment about the line between them, and the load has none only exactly there"
        out.print(f"Fragile: {line}.", soft_wrap=True)
    worst = max(a.witness.residuals.worst for g in answer.grasps for a in g.answer.checks if a.witness)
    out.print(
        f"Existence proved by the Krawczyk test, every load by an equilibrium of equations (1) to (8), residual "
        f"{worst:.1e} at most. Clearances are measured on convex pieces.",
        style="dim",
    )


def _show_tally(out: Console, answer: Grasps) -> None:
    if answer.unproved or answer.tally.total:
        rows = [*tally_rows(answer.tally, "holds", COUNTED_REASONS)]
        rows += [("could not be certified", str(answer.unproved))] if answer.unproved else []
        print_table(out, ["what became of the starts", ""], rows)
        looked = f"{answer.evaluated} certified configurations judged, steps included"
        out.print(f"{looked}; {answer.starts} random starts of the local search", style="dim")
    if answer.balance and answer.verdict is Reach.UNDECIDED:
        out.print(balance_text(answer.balance), style="dim")
    if answer.joined and answer.verdict is Reach.UNDECIDED:
        out.print(joined_text(answer.joined, answer.task), style="dim")
