"""Claims of answers that keep no proofs, asked again: what is found has a witness or a certificate, which is replayed.

A claim is one number or one verdict of a file. A lower bound is proved if that much is shown to be resisted, but for
the gap with which the file was made; an upper bound if no more is; a verdict if it is the one that is proved again.
Where loads come after the commands, the path is followed again, and its end may differ by as much as two paths may
that are said to agree (`load_path.AGREE`).
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.parallel import WorkerPool, default_jobs
from handfast.model.grasp import Grasp
from handfast.proofs import checker
from handfast.proofs.certificate import Certificate
from handfast.proofs.question import CHECK, Question, Range
from handfast.proofs.ranges import width_at
from handfast.proofs.replay import Figure, Replay
from handfast.proofs.tolerance import no_magnitude
from handfast.stability.answers import MaxAnswer
from handfast.stability.answers.answer import Answer
from handfast.stability.answers.check_query import ask as check
from handfast.stability.answers.load_path import AGREE
from handfast.stability.answers.max_query import ask as maximum
from handfast.stability.problem.grasp_data import grasp_data
from handfast.stability.problem.grasp_limits import AskedWith
from handfast.stability.problem.scaled_problem import unbalanced
from handfast.stability.problem.settings import INF, Settings
from handfast.stability.studies.batch import OnItem

A = TypeVar("A", bound=Answer)
LARGEST_GAP = 1e-2  # that a file may give its lower bounds
FINEST_GAP = 1e-6  # with which an upper bound is asked: what is not proved then is refused
UPPER_BOUND_ROUNDING = 1e-9  # relative: an upper bound is proved to that
CONTRADICTION_GAP = 1e-6  # relative: two bounds that contradict each other
FEW_CLAIMS = 3  # claims for which no process is made
QUESTION_TIME_LIMIT = 60.0  # [s] for each question
NO_TIME = "no time was left to ask again"
UNBALANCED = "no forces at the contacts balance it"


@dataclass(frozen=True)
class Asking:
    """How claims are asked again.

    Attributes:
        question_timeout: [s] for each question. timeout: [s] for all of them.
        jobs: cores to use; by default all.
        on_progress: called with (done, total).
    """

    question_timeout: float = QUESTION_TIME_LIMIT
    timeout: float = INF
    jobs: int | None = None
    on_progress: OnItem | None = None

    def __post_init__(self) -> None:
        Settings(timeout=self.question_timeout)
        if not self.timeout > 0:
            raise InputError(f"is {self.timeout:g} s; a number above 0 is needed", field="timeout")


@dataclass(frozen=True)
class Clock:
    """What is left of it: question_timeout [s] for a question, until: on the monotonic clock, jobs: of it."""

    question_timeout: float
    until: float
    jobs: int

    @property
    def left(self) -> float:
        """[s] for the next question; not above 0 if there is no time."""
        return min(self.question_timeout, self.until - time.monotonic())

    def settings(self, gap: float) -> Settings:
        """Of the next question."""
        return Settings(gap=gap, timeout=max(self.left, 1e-3), jobs=self.jobs)


@dataclass(frozen=True, eq=False)
class Claim(ABC):
    """Something that a file says of one load.

    Attributes:
        place: where it stands in the file.
        grasp: with the preload in force.
        load: (6,) [N, N m] the disturbance, or the direction of one.
        terms: limits, law and gap as asked.
    """

    place: str
    grasp: Grasp
    load: Array
    terms: AskedWith

    @abstractmethod
    def ask(self, clock: Clock) -> tuple[Replay, ...]:
        """What becomes of it, or of each of the numbers that it is made of."""

    @property
    def gap(self) -> float:
        """Relative, of lower bounds."""
        return AGREE if self.terms.along_paths else min(self.terms.gap, LARGEST_GAP)

    def apart(self, rounding: float) -> float:
        """Relative, by how much numbers that are asked again differ more than by a rounding."""
        return AGREE if self.terms.along_paths else rounding

    def settled_by(self, query: Callable[..., A], load: Array, clock: Clock, **more: Any) -> tuple[A, Replay]:
        """The answer of a query to a load, with its replay."""
        gap = more.pop("gap", self.gap)
        asked: dict[str, Any] = {"limits": self.terms.limits, "mdp": self.terms.mdp, "loading": self.terms.loading}
        asked |= {"settings": clock.settings(gap)}
        answer = query(self.grasp, load, **asked, **more)
        return answer, answer.verify()

    def no_forces(self) -> Replay:
        """The equations (1) contradict themselves: proved without any search."""
        o, none = self.terms, np.zeros(6)
        g, torques, force = grasp_data(self.grasp), o.limits.torque_limits, o.limits.largest_normal_force
        question = Question(g, CHECK, False, self.load, none, o.limits.eta, o.mdp, torques, force, ())
        done = checker.verify(Certificate.of_root(question, None))
        return Replay(self.place, UNBALANCED, done.reason, {"leaves": done.leaves, "motion_cap": done.cap})


@dataclass(frozen=True, eq=False)
class VerdictClaim(Claim):
    """Is the load resisted? said: "holds" or "slips"."""

    said: str

    def ask(self, clock: Clock) -> tuple[Replay, ...]:
        claim = f"the load is {'resisted' if self.said == Verdict.HOLDS else 'not resisted'}"
        if unbalanced(self.grasp, self.load):
            done, found = self.no_forces(), str(Verdict.SLIPS)
        else:
            answer, done = self.settled_by(check, self.load, clock)
            found = str(answer.verdict)
            if answer.verdict is Verdict.UNDECIDED:
                return (Replay(self.place, claim, undecided=f"asked again, it is open ({answer.stop})"),)
        if not done.ok:
            return (Replay(self.place, claim, undecided=f"asked again, its proof is refused: {done.reason}"),)
        fault = f"is '{self.said}'; asked again, it {found}, which is proved" if found != self.said else ""
        return (Replay(self.place, claim, fault, figures_of(done)),)


@dataclass(frozen=True, eq=False)
class BoundsClaim(Claim):
    """How much of the load is resisted? At least `lower`, nothing above `upper`; as multiples of it.

    Attributes:
        lower: 0 claims nothing. upper: inf claims nothing. unbounded: as far as a search goes.
        upper_place: where `upper` stands.
    """

    lower: float
    upper: float
    unbounded: bool = False
    upper_place: str = ""

    def ask(self, clock: Clock) -> tuple[Replay, ...]:
        both = {"lower": self._told("lower"), "upper": self._told("upper")}
        told = {name: claim for name, claim in both.items() if claim is not None}
        if not told:
            return ()
        if unbalanced(self.grasp, self.load):
            return self._of_none(told)
        along = self.terms.along_paths  # which is followed as it was, and by no other way
        if "upper" not in told and not self.unbounded and not along:
            shown = self._held(told["lower"], clock)
            if shown is not None:
                return (shown,)
        left, gap, done = dict(told), self.terms.gap if along else self.gap, dict[str, Replay]()
        while left and clock.left > 0:
            answer, proof = self.settled_by(maximum, self.load, clock, gap=gap)
            for name, claim in left.items():
                done[name] = self._judged(name, claim, answer, proof)
            left = {name: claim for name, claim in left.items() if done[name].open}
            if along or answer.stop in ("time", "nodes", "interrupted") or gap <= FINEST_GAP:
                break
            gap = max(gap / 10, FINEST_GAP)
        if "lower" in left and "upper" in told and not self.unbounded and not along:
            done["lower"] = self._held(told["lower"], clock) or done.get("lower", told["lower"])
        return tuple(done.get(name, replace(claim, undecided=NO_TIME)) for name, claim in told.items())

    def _told(self, which: str) -> Replay | None:
        """The claim in words; None if nothing is claimed."""
        along = self.terms.along_paths
        if which == "lower":
            if self.unbounded:
                return Replay(self.place, "the load is resisted however large it is")
            what = "the load is reached on its path" if along else "the load is resisted"
            return Replay(self.place, f"{self.lower:.6g} times {what}, or more") if self.lower > 0 else None
        if not self.upper < INF:
            return None
        claim = "no load along it is resisted"
        if self.upper > 0:
            more = "the path of the load ends below" if along else "nothing is resisted above"
            claim = f"{more} {self.upper:.6g} times it"
        return Replay(self.upper_place, claim)

    def _of_none(self, told: dict[str, Replay]) -> tuple[Replay, ...]:
        shown = self.no_forces()
        out = []
        for name, claim in told.items():
            fault = shown.reason if name == "upper" else f"{self._said}; asked again, {UNBALANCED}"
            out.append(replace(claim, refused=fault, figures=shown.figures))
        return tuple(out)

    @property
    def _said(self) -> str:
        return f"is {self.lower:.9g}{', unbounded' if self.unbounded else ''}"

    def _held(self, claim: Replay, clock: Clock) -> Replay | None:
        """The lower bound, by a witness of exactly this much; None if there is none."""
        if clock.left <= 0:
            return None
        answer, proof = self.settled_by(check, self.lower * self.load, clock)
        held = answer.verdict is Verdict.HOLDS and proof.ok
        return replace(claim, figures=figures_of(proof)) if held else None

    def _judged(self, name: str, claim: Replay, answer: MaxAnswer, proof: Replay) -> Replay:
        found = replace(claim, figures=figures_of(proof))
        if not proof.ok:
            return replace(found, undecided=f"asked again, its proof is refused: {proof.reason}")
        if answer.stop is not Stop.COMPLETE and found.figures["motion_cap"] is not None:
            answer = replace(answer, upper=INF)  # of motions that may be too small to count
        if name == "lower":
            return self._judged_lower(found, answer)
        if answer.upper <= self.upper * (1 + self.apart(UPPER_BOUND_ROUNDING)):
            return found
        if answer.lower > self.upper * (1 + self.apart(CONTRADICTION_GAP)):
            more = f"is {self.upper:.9g}; asked again, {answer.lower:.9g} is resisted, which is proved"
            return replace(found, refused=more)
        if not np.isfinite(answer.upper) or answer.gap > 2 * FINEST_GAP:
            return replace(found, undecided=_open(answer))
        least = f"is {self.upper:.9g}; asked again, the bound that can be proved is {answer.upper:.9g}"
        return replace(found, refused=least)

    def _judged_lower(self, found: Replay, answer: MaxAnswer) -> Replay:
        if self.unbounded and answer.unbounded:
            far = answer.lower >= self.lower * (1 - self.gap)
            return found if far else replace(found, refused=f"{self._said}; a search goes up to {answer.lower:.9g}")
        if np.isfinite(answer.upper) and (
            self.unbounded or self.lower > answer.upper * (1 + self.apart(CONTRADICTION_GAP))
        ):
            nothing = f"nothing above {answer.upper:.9g}" if answer.upper > 0 else "nothing"
            return replace(found, refused=f"{self._said}; asked again, {nothing} is resisted, which is proved")
        if not self.unbounded and answer.lower >= self.lower * (1 - self.gap):
            return found
        return replace(found, undecided=_open(answer))


@dataclass(frozen=True, eq=False)
class IntervalClaim(Claim):
    """Which magnitudes below the largest are resisted: all up to `to`, none in holes, all that is not unproved."""

    to: float
    holes: tuple[Range, ...]
    unproved: tuple[Range, ...]

    def ask(self, clock: Clock) -> tuple[Replay, ...]:
        answer, proof = self.settled_by(maximum, self.load, clock, interval=True)
        shown = answer.interval
        claim = f"everything up to {self.to:.6g} times the load is resisted"
        if self.holes:
            claim += f", nothing at {', '.join(f'{a:.6g} to {b:.6g}' for a, b in self.holes)}"
        told = Replay(self.place, claim, figures=figures_of(proof))
        if not proof.ok:
            return (replace(told, refused=f"asked again, its proof is refused: {proof.reason}"),)
        if shown is None:
            return (replace(told, undecided=_open(answer)),)
        if self.to > answer.upper * (1 + CONTRADICTION_GAP):
            text = f"is {self.to:.9g}; asked again, nothing above {answer.upper:.9g} is resisted, which is proved"
            return (replace(told, refused=text),)
        unit = min(no_magnitude(answer.question), answer.lower) if answer.question is not None else answer.lower

        def slack(magnitude: float) -> float:
            return width_at(magnitude, shown.resolution, unit)

        def is_in(a: float, b: float, ranges: Iterable[Range]) -> bool:
            return any(first <= a + slack(a) and last >= b - slack(b) for first, last in ranges)

        within = max(self.gap * self.to, slack(self.to))
        for a, b in shown.holes:
            if a < self.to - within and b > 0:
                text = f"is {self.to:.9g}; asked again, nothing at {a:.9g} to {b:.9g} is resisted, which is proved"
                return (replace(told, refused=text),)
        if shown.holds_from_zero_to < self.to - within:
            text = f"asked again, everything up to {shown.holds_from_zero_to:.9g} is proved to be resisted"
            return (replace(told, undecided=text),)
        for a, b in self.holes:
            if not is_in(a, b, shown.holes):
                text = f"has a hole at {a:.9g} to {b:.9g}; asked again, none is proved there"
                return (replace(told, refused=text),)
        for a, b in shown.holes:
            if b - a > slack(a) + slack(b) and not is_in(a, b, [*self.holes, *self.unproved]):
                text = f"has no hole at {a:.9g} to {b:.9g}; asked again, nothing there is resisted, which is proved"
                return (replace(told, refused=text),)
        for a, b in shown.unproved:
            if not is_in(a, b, self.unproved):
                text = f"asked again, of {a:.9g} to {b:.9g} nothing is shown, which is not among what is unproved"
                return (replace(told, undecided=text),)
        return (told,)


def _open(answer: MaxAnswer) -> str:
    upper = f"and nothing above {answer.upper:.9g}" if np.isfinite(answer.upper) else "and no bound above"
    return f"asked again, it is open ({answer.stop}): proved is {answer.lower:.9g} {upper}"


def figures_of(done: Replay) -> dict[str, Figure]:
    """Of a replay with its parts: `leaves`, cases that were refuted; the least `motion_cap` [N], None for none;
    `tolerant`: is some state proved to 1e-9 of load and commands only?"""
    return _added([done.figures, *map(figures_of, done.parts)], exact=done.figures.get("exact"))


def _added(every: Sequence[Mapping[str, Figure]], exact: Figure = None) -> dict[str, Figure]:
    caps = [float(cap) for f in every if (cap := f.get("motion_cap")) is not None]
    leaves = sum(int(f.get("leaves") or 0) for f in every)
    tolerant = exact is False or any(bool(f.get("tolerant")) for f in every)
    return {"leaves": leaves, "motion_cap": min(caps, default=None), "tolerant": tolerant}


def asked(claims: Sequence[Claim], how: Asking) -> list[tuple[Replay, ...]]:
    """What becomes of each claim, in order. Those that no time was left for are undecided."""
    jobs = 1 if len(claims) <= FEW_CLAIMS else min(how.jobs or default_jobs(), len(claims))
    until = time.monotonic() + how.timeout
    out: list[tuple[Replay, ...]] = []
    with WorkerPool(Clock(how.question_timeout, until, 1 if jobs > 1 else 0), jobs) as pool:
        for told in pool.map(_ask, claims, until=until):
            out.append(told)
            if how.on_progress:
                how.on_progress(len(out), len(claims))
    return out + [(Replay(claim.place, undecided=NO_TIME),) for claim in claims[len(out) :]]


def _ask(clock: Clock, claim: Claim) -> tuple[Replay, ...]:
    return claim.ask(clock)


def together(name: str, what: str, told: Sequence[Replay]) -> Replay:
    """Claims as one: how many, and each that is not proved, those that no time was left for as one; what: they are."""
    late = [part for part in told if part.undecided == NO_TIME]
    left = [part for part in told if not part.ok and part.undecided != NO_TIME]
    done = len(told) - len(left) - len(late)
    figures = _added([part.figures for part in told if part.ok])
    beside = ", some states to 1e-9 of load and commands" if figures["tolerant"] else ""
    if figures["motion_cap"] is not None:
        beside += f", some up to virtual motions of {figures['motion_cap']:.6g} N"
    if done == len(told):
        return Replay(name, f"{what}: {_claims(done)}{beside}" if told else "", figures=figures)
    parts = [Replay("others", f"{what}: {done} of {_claims(len(told))}{beside}", figures=figures)] if done else []
    parts += left
    parts += [Replay("not asked", f"{what}: {len(late)} of {_claims(len(told))}", undecided=NO_TIME)] if late else []
    return Replay(name, parts=tuple(parts))


def _claims(n: int) -> str:
    return "1 claim" if n == 1 else f"{n} claims"
