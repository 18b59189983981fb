"""How large a disturbance along a direction is resisted? Stability paper, section VII-B, (23)-(25)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.files import SAME
from handfast.model.grasp import Grasp
from handfast.stability import scaled_problem
from handfast.stability.answers import Answer, finite
from handfast.stability.certify import arc, checker
from handfast.stability.certify.certificate_file import question_to_dict
from handfast.stability.certify.ranges import Known, known
from handfast.stability.goal import ANY_STATE, INF, LARGEST, NEAR_END, SMALLEST_PRELOAD, Goal
from handfast.stability.idle_joints import runs_away
from handfast.stability.json_match import is_number
from handfast.stability.posed import Posed
from handfast.stability.query import (
    CertificateClaim,
    ClaimRefused,
    Query,
    ResultAnswerEntry,
    SavedAnswer,
    WitnessClaim,
)
from handfast.stability.resisted_interval import ResistedInterval
from handfast.stability.scaled_problem import ScaledProblem
from handfast.stability.settings import OnStep, Settings
from handfast.stability.solve import solve, time_left, without_end
from handfast.stability.verification import FIRST_SHARE, IntervalCheck
from handfast.stability.witness import VALID, Witness

if TYPE_CHECKING:
    from handfast.stability.limit import Supremum
    from handfast.stability.search.outcome import Outcome

LIMIT, TURNED = 1e-5, 1e-3  # relative, of a limit that is followed again; of its motion
OF_INTERVAL = ("holds_from_zero_upper", "holes", "unproved", "resolution")  # keys beside `holds_from_zero_to`


class MaxEntry(ResultAnswerEntry):
    query: Literal["max"]
    lower: float
    upper: float | None
    gap: float | None
    unbounded: bool
    holds_from_zero_to: float | None = None
    holds_from_zero_upper: float | None = None
    holes: list[tuple[float, float]] = Field(default_factory=list)
    unproved: list[tuple[float, float]] = Field(default_factory=list)
    resolution: Annotated[float, Field(ge=0)] | None = None


Saved = SavedAnswer[MaxEntry]


class MaxQuery(Query[MaxEntry]):
    name = "max"
    entry = MaxEntry

    def witness_claim(self, saved: Saved, witness: Witness) -> WitnessClaim:
        (base, direction), lower = _load(saved), saved.answer.lower
        words = f"{lower:.6g} times the direction is resisted"
        return WitnessClaim(words, base + lower * direction, saved.question.grasp.command)

    def certificate_claim(self, saved: Saved) -> CertificateClaim | None:
        """No magnitude from the upper bound to the end of the search."""
        q, answer, end = saved.question, saved.answer, _end(saved)
        _check_bounds(saved, end)
        if answer.unbounded or answer.upper is None:
            return None
        if answer.lower > answer.upper:
            raise ClaimRefused(f"its lower bound {answer.lower:.9g} is above its upper bound {answer.upper:.9g}")
        slips = answer.verdict is Verdict.SLIPS
        what = "nothing" if slips else f"nothing above {answer.upper:.6g} times the direction"
        to = f", up to {end:.6g} times it" if q.goal.has_scalar else ""
        claim = f"{what} is resisted{to}"
        if not q.goal.has_scalar:  # homogeneous: what slips at one magnitude slips at all
            if not slips:
                raise ClaimRefused("has an upper bound where magnitudes make no difference")
            return CertificateClaim(claim, (0.0, 0.0))
        if q.goal.homogeneous:  # its scalar is 1 / s
            return CertificateClaim(claim, ((1 + NEAR_END) / end, 1.0 / answer.upper if answer.upper > 0 else INF))
        return CertificateClaim(claim, (answer.upper, end * (1 - NEAR_END)))

    def interval(self, saved: Saved) -> IntervalCheck | None:
        answer = saved.answer
        if answer.holds_from_zero_to is None:
            super().interval(saved)
            if answer.holes or answer.unproved or answer.holds_from_zero_upper:
                raise ClaimRefused("has holes, but does not say up to where everything is resisted")
            return None
        if saved.first:
            raise ClaimRefused("what version 1 says of smaller magnitudes rests on samples; ask again")
        holes = ", ".join(f"{a:.6g} to {b:.6g}" for a, b in answer.holes)
        claim = f"everything up to {answer.holds_from_zero_to:.6g} times the direction is resisted"
        claim += f", nothing at {holes}" if holes else ""
        residual = max((arc.residual_bound(saved.question, a) for a in saved.arcs), default=0.0)
        off = f"states between two magnitudes are off by {residual:.1e}, above {VALID:g}"
        reason = ("" if residual <= VALID else off) or _slips_fault(saved) or _ranges_fault(saved)
        return IntervalCheck(claim, len(saved.arcs), residual, len(saved.slips), reason)

    def shown(self, saved: Saved) -> dict[str, Any]:
        """The bounds are those that witness and certificate were held against."""
        answer = saved.answer
        gap = 0.0 if answer.unbounded or answer.upper == 0 else None
        if gap is None and answer.upper is not None and answer.lower > 0:
            gap = (answer.upper - answer.lower) / answer.lower
        out: dict[str, Any] = {"lower": answer.lower, "upper": answer.upper, "gap": gap, "unbounded": answer.unbounded}
        out["holds_from_zero_to"] = answer.holds_from_zero_to  # held against states and certificates
        if answer.holds_from_zero_to is not None:
            out |= {name: answer.model_dump(mode="json")[name] for name in OF_INTERVAL}
        return out if saved.first else out | _shown_limit(saved)


def _load(saved: Saved) -> tuple[Array, Array]:
    """(6,) each: the disturbance is the first plus s times the second; `ClaimRefused` if it is that of no maximum."""
    q = saved.question
    if q.direction is not None:
        return q.wrench, q.direction
    beside = q.grasp.command.any() or q.equivalent.is_given or q.torque_limits or q.force_limit is not None
    if q.goal != ANY_STATE or beside:
        raise ClaimRefused(f"is of a maximum, its question of '{q.goal.word}'")
    return np.zeros(6), q.wrench


def _end(saved: Saved) -> float:
    """The magnitude at which the search for a maximum ends."""
    q, (_, direction) = saved.question, _load(saved)
    p = Posed.of(q).problem if q.direction is not None else scaled_problem.build(q.grasp, np.zeros(6), direction)
    return p.last_magnitude


def _check_bounds(saved: Saved, end: float) -> None:
    """`ClaimRefused` if verdict and bounds contradict each other."""
    q, answer = saved.question, saved.answer
    slips, holds = answer.verdict is Verdict.SLIPS, answer.verdict is Verdict.HOLDS
    if not answer.lower >= 0:
        raise ClaimRefused(f"a largest magnitude of {answer.lower:.6g}")
    if holds and not answer.unbounded and answer.lower == 0 and not (q.direction is not None and q.wrench.any()):
        raise ClaimRefused("HOLDS without a magnitude that is resisted")
    if not holds and answer.lower != 0:
        raise ClaimRefused(f"{answer.verdict.upper()} with a magnitude that is resisted")
    if slips and answer.upper != 0:
        raise ClaimRefused("SLIPS with bounds above 0")
    if answer.unbounded:
        if answer.upper is not None or not holds:
            raise ClaimRefused("unbounded, with a bound")
        least = end / FIRST_SHARE if saved.first else end * (1 - 2 * NEAR_END)
        if not answer.lower >= least:
            raise ClaimRefused(f"unbounded, but shown up to {answer.lower:.6g} only; a search goes to {least:.6g}")


def _slips_fault(saved: Saved) -> str:
    """What is wrong with the certificates of smaller magnitudes; '' if nothing."""
    for c in saved.slips:
        if question_to_dict(c.question) != question_to_dict(saved.question):
            return "a certificate answers another question"
        if c.capped:
            return "a certificate has caps on motions"
        found = checker.verify(c)
        if not found.ok:
            return f"{c.claim}: {found.reason}"
        if found.cap is not None:
            return f"{c.claim}: proved up to virtual motions of {found.cap:.6g} N only"
    return ""


def _ranges_fault(saved: Saved) -> str:
    """What is wrong with what is said of smaller magnitudes, if all its states and certificates are right."""
    q, answer = saved.question, saved.answer
    upper = INF if answer.upper is None else answer.upper
    if not q.goal.has_scalar:  # magnitudes make no difference
        if saved.slips:
            return "it has certificates where magnitudes make no difference"
        shown = Known(answer.lower, upper, (), ())
    elif answer.resolution is None:
        return "it states no resolution"
    else:
        good, bad = [(a.first, a.last) for a in saved.arcs], [c.magnitudes for c in saved.slips]
        unit = Posed.of(q).problem.unit_magnitude
        try:
            shown = known(good, bad, answer.lower, upper, answer.resolution, unit)
        except ValueError as fault:
            return str(fault)
    said = Known(
        answer.holds_from_zero_to or 0.0,
        INF if answer.holds_from_zero_upper is None else answer.holds_from_zero_upper,
        tuple(answer.holes),
        tuple(answer.unproved),
    )
    return "" if said == shown else f"it says {said}; what is shown is {shown}"


def _shown_limit(saved: Saved) -> dict[str, Any]:
    """The limit, followed again from the witness if one is said; that there is none claims nothing."""
    said, w, answer = saved.said.get("limit"), saved.witness, saved.answer
    if said is None:
        return {"limit": None, "attained": True}
    if w is None or answer.upper is None or answer.unbounded:
        raise ClaimRefused("limit is none of a largest magnitude")
    from handfast.stability.limit import limit_from  # linear algebra alone: nothing is searched

    found = limit_from(*Posed.of(saved.question), w.state, answer.lower, answer.upper)
    if found is None:
        raise ClaimRefused("no limit is found from its witness")
    value = said.get("value") if isinstance(said, dict) else None
    if not isinstance(value, float) or not answer.lower <= value <= answer.upper * (1 + SAME):
        raise ClaimRefused("its limit lies outside of its bounds")
    if abs(value - found.value) > LIMIT * abs(found.value):
        raise ClaimRefused(f"its limit is {value:.9g}; from its witness it is {found.value:.9g}")
    motion = said.get("object_motion")
    near = isinstance(motion, list) and len(motion) == 6 and all(map(is_number, motion))
    if not near or np.abs(np.array(motion) - found.motion).max() > TURNED:
        raise ClaimRefused("object_motion of its limit is not where its witness leads")
    return {"limit": found.to_json() | {"value": value, "object_motion": motion}, "attained": False}


@dataclass(frozen=True, eq=False)
class MaxAnswer(Answer):
    """How large a disturbance is resisted?

    Attributes:
        lower: the largest magnitude that was witnessed, 0 if none.
        upper: no larger magnitude is possible; inf if that could not be shown.
        unbounded: resisted as far as the search goes, ten thousand times the preload (or the base load,
            or the limits); `lower` is that magnitude and its witness, `upper` is inf.
        interval: which magnitudes below are resisted too, if that was asked.
        point: (n,) the witness in the engine's unknowns.
    """

    query = MaxQuery()

    lower: float
    upper: float
    unbounded: bool
    interval: ResistedInterval | None = field(default=None, kw_only=True)
    point: Array | None = field(default=None, kw_only=True, repr=False)

    @cached_property
    def limit(self) -> Supremum | None:
        """What the magnitudes tend to as the virtual motion grows without end, where no state attains the largest.

        None where nothing shows that.
        """
        if not (self.lower > 0 and np.isfinite(self.upper)) or self.posed is None or self.witness is None:
            return None
        from handfast.stability.limit import limit_from

        return limit_from(*self.posed, self.witness.state, self.lower, self.upper)

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

    def saved(self) -> SavedAnswer[Any]:
        """With the states and certificates of smaller magnitudes."""
        saved, shown = super().saved(), self.interval
        return replace(saved, arcs=shown.arcs, slips=shown.slips) if shown else saved


def maximum(
    grasp: Grasp,
    direction: Sequence[float] | Array,
    *,
    base: Sequence[float] | Array | None = None,
    eta: float = 0.0,
    mdp: bool = True,
    torque_limits: Mapping[str, float] | None = None,
    force_limit: float | None = None,
    interval: bool = False,
    settings: Settings | None = None,
    on_step: OnStep | None = None,
) -> MaxAnswer:
    """The largest s such that the disturbance base + s direction is resisted: section VII-B, (23)-(25).

    The resisted magnitudes need not be an interval: a smaller one may slip.

    Args:
        direction: (6,) force [N] and torque [N m]; s multiplies it as given, normalise it yourself. Three numbers
            are a force at the object's origin.
        base: (6,) a constant load such as gravity, or (3,) a force.
        interval: show which smaller magnitudes are resisted, too, see `search/interval_search`.

    The other arguments and errors are those of `check`.
    """
    settings = settings or Settings()
    w0 = np.zeros(6) if base is None else base
    limits: dict[str, Any] = {"torque_limits": torque_limits, "force_limit": force_limit}
    answer = largest(scaled_problem.build(grasp, w0, direction, eta=eta, mdp=mdp, **limits), settings, on_step)
    return with_interval(answer, settings) if interval else answer


def with_interval(answer: MaxAnswer, settings: Settings) -> MaxAnswer:
    """A maximum with which smaller magnitudes are resisted; as it is if none is, or after Ctrl-C."""
    if answer.posed is None or answer.found is None or not answer.lower > 0 or answer.stop is Stop.INTERRUPTED:
        return answer
    from handfast.stability.search.interval_search import resisted

    shown = resisted(*answer.posed, answer.lower, answer.upper, answer.found.state, settings)
    return replace(answer, interval=shown, stop=Stop.INTERRUPTED if shown.interrupted else answer.stop)


def max_goal(p: ScaledProblem) -> Goal:
    """How a maximum is posed: limits and a base load break homogeneity; without commands, or anything that is given to
    joints, there is only yes or no."""
    if p.torque_limits or np.isfinite(p.cn_max) or p.w0.any():  # limits also of backdrivable motors, which have no row
        return LARGEST
    return SMALLEST_PRELOAD if p.f_c.any() or p.is_given else ANY_STATE


def largest(p: ScaledProblem, settings: Settings, on_step: OnStep | None = None, **hints: Any) -> MaxAnswer:
    """The answer to a built problem; hints: to the engine's `search`, what a neighbour left."""
    end = p.last_magnitude
    posed, found = _search(p, settings, on_step, hints)
    p, goal = posed
    w = found.witness
    lower, upper, unbounded = 0.0, INF, False
    if found.bound == INF:
        verdict, w, upper = Verdict.SLIPS, None, 0.0
    elif w is None:
        verdict = Verdict.UNDECIDED
        upper = goal.bounds(p, INF, found.bound)[1] if goal.has_scalar else INF
    else:
        verdict = Verdict.HOLDS
        if goal.has_scalar:
            lower, upper = goal.bounds(p, found.value, found.bound)
            unbounded = bool(lower >= end * (1 - NEAR_END))
            if goal.homogeneous and p.is_given:  # of the state itself, whose preload is the grasp's to the last digits
                lower = min(p.direction_scale / _preload_share(w, p.grasp), upper)
            w = _scaled(w, lower / p.direction_scale, p.grasp) if goal.homogeneous else w
        else:
            lower, unbounded, w = end, True, _scaled(w, end, p.grasp)
        upper = INF if unbounded else upper
        if lower == 0 and not p.w0.any():  # rest without a load says nothing of any magnitude
            verdict, w = Verdict.UNDECIDED, None
    backing: dict[str, Any] = {"posed": posed, "verified": found.backed}
    point = found.point if verdict is Verdict.HOLDS else None
    bounds = lower, upper, unbounded
    return MaxAnswer(verdict, found.stop, *found.cost, w, found.proof, *bounds, point=point, **backing)


def _search(
    p: ScaledProblem, settings: Settings, on_step: OnStep | None, hints: Mapping[str, Any]
) -> tuple[Posed, Outcome]:
    """What was asked in the end, and what was found."""
    goal = max_goal(p)
    if not goal.has_scalar:  # nothing but the disturbance: resisted at every magnitude or at none
        p = replace(p, w0=p.direction, wrench=p.along)
    if goal.maximised and p.is_given and not p.w0.any():  # what slips without limits slips with them
        free = scaled_problem.build(p.grasp, p.wrench, p.along, eta=p.eta, mdp=p.mdp)
        posed, alone = _search(free, settings, on_step, {})
        if alone.bound == INF:
            return posed, alone
    elif goal.maximised and not (p.w0.any() or p.f_c.any()):  # beside limits there is the load alone
        # no search tells small magnitudes from 0, which every limit allows; what slips without limits slips with them
        free = scaled_problem.build(p.grasp, p.along, eta=p.eta, mdp=p.mdp)
        alone = solve(free, ANY_STATE, settings, on_step)
        if alone.bound == INF:
            return Posed(free, ANY_STATE), alone
    found = solve(p, goal, settings, on_step, **hints)
    if found.bound == INF and goal.has_scalar and settings.method == "engine" and runs_away(p.grasp):
        if goal.homogeneous:  # by the same rows with any preload
            found = solve(p, goal, settings, on_step, within=(goal.search_range(p)[0], INF)).after(found)
    elif found.bound == INF and goal.has_scalar and settings.method == "engine":
        found = without_end(p, goal, settings, on_step, found)
    interrupted = found.stop is Stop.INTERRUPTED
    if found.witness is None and found.bound < INF and goal.maximised and not interrupted:
        alone = solve(p, ANY_STATE, time_left(settings, found), None)  # is the base load resisted, at least?
        found = found.after(alone)
        if alone.witness is not None:
            found = replace(found, witness=alone.witness, value=0.0, point=None)
    return Posed(p, goal), found


def _preload_share(w: Witness, grasp: Grasp) -> float:
    """The lambda of a homogeneous witness: what it has of the grasp's largest command, given torque or friction."""
    own, given = (np.concatenate([g.command, g.given_torques, g.joint_friction]) for g in (w.grasp, grasp))
    k = int(np.argmax(np.abs(given)))
    return float(own[k] / given[k])


def _scaled(w: Witness, s: float, grasp: Grasp) -> Witness:
    """A homogeneous witness (w = d, commands lambda f_c) scaled so that the commands are the grasp's own."""
    return Witness(grasp.with_preload(s * w.grasp.command), s * w.wrench, w.state.scaled(s), w.eta, w.mdp)
