"""How large a disturbance along a direction is resisted? Stability paper, section VII-B, (23)-(25)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from handfast.core.answer import SearchLimits, Stop, Verdict
from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.proofs.answers import UPPER_BOUND_FACTOR
from handfast.proofs.certificate import proof_to_dict
from handfast.proofs.constants import END_TOLERANCE
from handfast.proofs.existence import MODE_TRIES, Proved, exactly, nearby, polished
from handfast.proofs.states import State
from handfast.proofs.tolerance import farthest
from handfast.stability.answers.answer import Answer, finite, state_json
from handfast.stability.answers.load_path import LoadPath, StepAnswer, comes_after, path_end
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.bound_problem import BoundProblem
from handfast.stability.problem.equivalent_grasp import runs_away
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.model import scaled
from handfast.stability.problem.objective import ANY_STATE, INF, LARGEST_MAGNITUDE, SMALLEST_PRELOAD, Objective
from handfast.stability.problem.scaled_problem import ScaledProblem
from handfast.stability.problem.settings import Loading, OnStep, Settings
from handfast.stability.problem.witness import Witness
from handfast.stability.search.solve import clock_of, solve, time_left, without_end

if TYPE_CHECKING:
    from handfast.stability.search.interval_search import ResistedInterval
    from handfast.stability.search.proof import Outcome
    from handfast.stability.search.supremum import Supremum
BEYOND_BOUND = 1.01 * UPPER_BOUND_FACTOR  # times a bound: as far as it is looked for where the usual end is nearer
MAGNITUDE_TOLERANCE = 1e-9  # relative: the exact state of a largest magnitude is so near the one that was found
Near = tuple[State, float]  # of a question that is nearly the same: a state, and the magnitude that it resists


@dataclass(frozen=True, eq=False)
class MaxAnswer(Answer):
    """How large a disturbance is resisted?

    Attributes:
        lower: the largest magnitude that was witnessed, 0 if none.
        upper: no larger magnitude is possible; inf if that could not be shown.
        unbounded: resisted as far as the search goes, ten thousand times the preload (or the base load,
            or the limits); `lower` is that magnitude and its witness, `upper` is inf.
        interval: which magnitudes below are resisted too, if that was asked.
    """

    query = "max"

    lower: float
    upper: float
    unbounded: bool
    interval: ResistedInterval | None = field(default=None, kw_only=True)

    @cached_property
    def limit(self) -> Supremum | None:
        """What the magnitudes tend to as the virtual motion grows without end, where no state attains the largest.

        None where nothing shows that.
        """
        if not (self.lower > 0 and np.isfinite(self.upper)) or self.posed is None or self.witness is None:
            return None
        if self.path is not None:
            return None
        from handfast.stability.search.supremum import limit_from

        return limit_from(self.posed.problem, self.posed.goal, self.witness.state, self.lower, self.upper)

    @property
    def attained(self) -> bool:
        """False if the largest magnitude is shown to be approached only, by states that move ever farther."""
        return self.limit is None

    @property
    def gap(self) -> float:
        """(upper - lower) / lower; 0 if unbounded or both are 0, inf if one bound is missing."""
        if self.unbounded or self.upper == 0:
            return 0.0
        return (self.upper - self.lower) / self.lower if self.lower > 0 else INF

    def _judged(self, until: float) -> MaxAnswer:
        """With a lower bound that is proved to be reached; UNDECIDED where none is."""
        out, known = self, self._of_found
        if known is not None and known.magnitude is not None and known.magnitude[0] < out.lower:
            out = replace(out, lower=max(known.magnitude[0], 0.0))
        settled = Answer._judged(out, until)
        if settled.verdict is out.verdict:
            return settled
        upper = settled.upper if settled.proof else INF
        return replace(settled, lower=0.0, upper=upper, unbounded=False)

    @property
    def caps_each_time(self) -> bool:
        """Is `motion_cap` that of each time of the direction, as nothing of it is resisted?"""
        q = self.question
        in_proportion = q is not None and (q.homogeneous or not q.has_scalar)
        return in_proportion and self.upper == 0 and (self.path is None or bool(self._slips_at))

    @property
    def motion_cap(self) -> float | None:
        cap, at = super().motion_cap, self._slips_at
        return cap / at if cap is not None and at and self.caps_each_time else cap

    @property
    def _slips_at(self) -> float | None:
        """The magnitude at which its path ends; None without one."""
        return getattr(self.path, "slips_at", None)

    @property
    def _bound(self) -> float:
        return self.upper if np.isfinite(self.upper) else 0.0

    def _exactly(self, until: float) -> MaxAnswer:
        """With a state that exists exactly, where one is near: at most a tenth of the gap lower."""
        known, w = self._of_found, self.found
        if known is None or w is None or known.exact or self.posed is None or self._along is None:
            return self
        room = self.upper - self.lower if np.isfinite(self.upper) else 0.0
        lower = known if known.reason else self._proved(w, -INF)  # without one, a smaller one exists exactly
        if lower.exact and lower.magnitude is not None and lower.magnitude[0] >= max(self.lower - room / 10, 0.0):
            return replace(self, lower=lower.magnitude[0])
        smaller = partial(nearby, gap=room, until=until, thorough=not known.tolerant)
        before, asked = w.state, self._problem(w)
        for other in (exactly, smaller):
            p, x = other(asked, before)
            if x is before or p.magnitude < asked.magnitude - room / 10:
                continue
            at = Witness(w.grasp, p.load, x, w.eta, w.mdp)
            shown = self._proved(at, -INF)
            if shown.exact and shown.modes and not at.valid:  # what is proved moves otherwise
                y = polished(replace(p, wrench=p.load, along=None), x, shown.modes)[1]
                at = replace(at, state=y)
                shown = self._proved(at, -INF)
            if shown.exact:
                less = p.magnitude * (1 - MAGNITUDE_TOLERANCE)
                return replace(self, found=at, lower=min(self.lower, less))
        return self

    def _proved(self, w: Witness, least: float | None = None, tries: int = MODE_TRIES) -> Proved:
        return super()._proved(w, self.lower if least is None else least, tries)

    def _reaches(self, proved: Proved) -> bool:
        return proved.reaches(self.lower)

    @property
    def _along(self) -> Array | None:
        if self.posed is None or self.path is not None or not self.lower > 0:
            return None
        return self.posed.problem.along

    def said(self) -> dict[str, Any]:
        return {
            "lower": self.lower,
            "upper": finite(self.upper),
            "gap": finite(self.gap),
            "unbounded": self.unbounded,
            "attained": self.attained,
            "limit": self.limit.to_json() if self.limit else None,
            "holds_from_zero_to": self.interval.holds_from_zero_to if self.interval else None,
        } | (self.interval.to_json() if self.interval else {})

    def to_file(self) -> dict[str, Any]:
        """With the states and certificates of smaller magnitudes."""
        out, shown = super().to_file(), self.interval
        if shown is None:
            return out
        arcs = [{"first": a.first, "last": a.last, "controls": [state_json(x) for x in a.controls]} for a in shown.arcs]
        return out | {"arcs": arcs, "slips": [proof_to_dict(c) for c in shown.slips]}


def ask(
    grasp: Grasp,
    direction: Sequence[float] | Array,
    *,
    base: Sequence[float] | Array | None = None,
    limits: GraspLimits = NO_LIMITS,
    mdp: bool = True,
    interval: bool = False,
    loading: Loading = "together",
    settings: Settings | None = None,
) -> MaxAnswer:
    """What `handfast.maximum` answers, whose arguments and errors these are."""
    settings = settings or Settings()
    if comes_after(loading, mdp, base=base, interval=interval):
        p = scaled_problem.build(grasp, scaled_problem.as_direction(direction), limits=limits)
        return largest_along(p, settings)
    p = scaled_problem.build(grasp, np.zeros(6) if base is None else base, direction, limits=limits, mdp=mdp)
    return largest(p, settings, interval=interval)


def largest_along(
    p: ScaledProblem, settings: Settings, on_progress: OnStep | None = None, rest: StepAnswer | None = None
) -> MaxAnswer:
    """The answer at the end of the path of a built problem, whose load is the direction; rest: as of `path_end`."""
    clock = clock_of(settings)
    return _of_path(path_end(p, settings, on_progress, rest), clock)


def _of_path(path: LoadPath, clock: SearchLimits) -> MaxAnswer:
    """The answer at the end of a path."""
    lower, upper = path.reached or 0.0, INF if path.upper is None else path.upper
    backing = path.backing(clock.seconds)
    verdict = Verdict.HOLDS if lower > 0 else Verdict.SLIPS if upper == 0 else Verdict.UNDECIDED
    unbounded = upper == INF and backing["verdict"] is Verdict.HOLDS and lower > 0
    if not lower > 0:
        backing["found"] = None
    return MaxAnswer(**backing | {"verdict": verdict}, lower=lower, upper=upper, unbounded=unbounded)


def with_interval(answer: MaxAnswer, settings: Settings) -> MaxAnswer:
    """A maximum with which smaller magnitudes are resisted; as it is if none is, or after Ctrl-C."""
    if answer.posed is None or answer.found is None or not answer.lower > 0 or answer.stop is Stop.INTERRUPTED:
        return answer
    from handfast.stability.search.interval_search import resisted
    from handfast.stability.search.least_motion import least_motion

    assert answer.witness is not None
    p, goal = answer.posed

    def least(found: Witness) -> State:
        return least_motion(found, p.limits).state

    shown = resisted(p, goal, answer.lower, answer.upper, least(answer.witness), settings, least)
    return replace(answer, interval=shown, stop=Stop.INTERRUPTED if shown.interrupted else answer.stop)


def max_goal(p: ScaledProblem) -> Objective:
    """How a maximum is posed: limits and a base load break homogeneity; without commands, or anything that is given to
    joints, there is only yes or no."""
    if p.limits.limits_forces or p.w0.any():  # limits also of backdrivable motors, which have no row
        return LARGEST_MAGNITUDE
    return SMALLEST_PRELOAD if p.f_c.any() or p.is_given else ANY_STATE


def largest(
    p: ScaledProblem,
    settings: Settings,
    on_progress: OnStep | None = None,
    *,
    interval: bool = False,
    near: Sequence[Near] = (),
) -> MaxAnswer:
    """The answer of `maximum` to a built problem.

    near: states and their magnitudes of questions that are nearly the same: Newton's method starts from them, too.
    """
    limits = clock_of(settings)
    answer = shown_maximum(*_search(p, settings, on_progress, near))
    answer = answer.settled(limits.end) if settings.verify else answer
    return with_interval(answer, time_left(settings, limits)) if interval else answer


def shown_maximum(posed: BoundProblem, found: Outcome) -> MaxAnswer:
    """What a search has shown of a maximum, its witness at the largest magnitude; not settled yet."""
    p, goal = posed
    w = found.witness
    lower, upper, unbounded = 0.0, INF, False
    if found.bound == INF:
        verdict, w, upper = Verdict.SLIPS, None, 0.0
    elif w is None:
        verdict = Verdict.UNDECIDED
        upper = goal.bounds(p, INF, found.bound)[1] if goal.has_scalar else INF
    else:
        verdict, end = Verdict.HOLDS, p.last_magnitude
        if goal.has_scalar:
            lower, upper = goal.bounds(p, found.value, found.bound)
            least = farthest(posed.question) if lower >= end * (1 - END_TOLERANCE) else INF
            unbounded = bool(lower >= least * (1 - END_TOLERANCE))
            w = _scaled(w, lower / p.direction_scale, p.grasp) if goal.homogeneous else w
        else:
            lower, unbounded, w = end, True, _scaled(w, end, p.grasp)
        upper = INF if unbounded else upper
        if lower == 0 and not p.w0.any():  # rest without a load says nothing of any magnitude
            verdict, w = Verdict.UNDECIDED, None
    backing: dict[str, Any] = {"posed": posed, "verified": found.backed}
    backing |= {"lower": lower * (1 - MAGNITUDE_TOLERANCE), "upper": upper, "unbounded": unbounded}
    return MaxAnswer(verdict, found.stop, *found.cost, w, found.proof, **backing)


def _search(
    p: ScaledProblem, settings: Settings, on_progress: OnStep | None, near: Sequence[Near]
) -> tuple[BoundProblem, Outcome]:
    """What was asked in the end, and what was found."""
    goal, limits = max_goal(p), clock_of(settings)
    if not goal.has_scalar:  # nothing but the disturbance: resisted at every magnitude or at none
        p = replace(p, w0=p.direction, wrench=p.along)
    if goal.maximised and p.is_given and not p.w0.any():  # what slips without limits slips with them
        free = scaled_problem.build(p.grasp, p.wrench, p.along, limits=GraspLimits(p.limits.eta), mdp=p.mdp)
        posed, alone = _search(free, settings, on_progress, ())
        if alone.bound == INF:
            return posed, alone
        settings = time_left(settings, limits)
    elif goal.maximised and not (p.w0.any() or p.f_c.any()):  # beside limits there is the load alone
        # no search tells small magnitudes from 0, which every limit allows; what slips without limits slips with them
        free = scaled_problem.build(p.grasp, p.along, limits=GraspLimits(p.limits.eta), mdp=p.mdp)
        alone = solve(free, ANY_STATE, settings, on_progress)
        if alone.bound == INF:
            return BoundProblem(free, ANY_STATE), alone
        settings = time_left(settings, limits)
    hints = {"near": near} if near and goal.has_scalar else {}
    found = solve(p, goal, settings, on_progress, **hints)
    if found.bound == INF and goal.has_scalar and runs_away(p.grasp):
        if goal.homogeneous:  # by the same rows with any preload
            left = time_left(settings, limits)
            found = solve(p, goal, left, on_progress, within=(goal.search_range(p)[0], INF)).after(found)
    elif found.bound == INF and goal.has_scalar:
        found = without_end(p, goal, settings, on_progress, found, limits)
    interrupted = found.stop is Stop.INTERRUPTED
    upper = goal.bounds(p, found.value, found.bound)[1] if goal.has_scalar and found.witness is not None else INF
    if p.last_magnitude < UPPER_BOUND_FACTOR * upper < INF and not interrupted:  # a bound is shown to twice as far
        lo, hi = goal.search_range(p)
        last = goal.objective(goal.at_magnitude(p, BEYOND_BOUND * upper))
        found = solve(p, goal, time_left(settings, limits), on_progress, within=(min(lo, last), hi)).after(found)
    if found.witness is None and found.bound < INF and goal.maximised and not interrupted:
        alone = solve(p, ANY_STATE, time_left(settings, limits), None)  # is the base load resisted, at least?
        found = found.after(alone)
        if alone.witness is not None:
            found = replace(found, witness=alone.witness, value=0.0, point=None)
    return BoundProblem(p, goal), found


def _scaled(w: Witness, s: float, grasp: Grasp) -> Witness:
    """A homogeneous witness (w = d, commands lambda f_c) scaled so that the commands are the grasp's own."""
    return Witness(grasp.with_preload(s * w.grasp.command), s * w.wrench, scaled(w.state, s), w.eta, w.mdp)
