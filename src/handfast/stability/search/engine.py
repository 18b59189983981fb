"""The engine as the method of a query: reduce, search, judge the witness."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from handfast.core.answer import SearchLimits, Stop
from handfast.core.arrays import Array
from handfast.core.parallel import default_jobs
from handfast.proofs.constants import END_TOLERANCE
from handfast.proofs.states import State
from handfast.stability.problem.objective import ANY_STATE, INF, LARGEST_MAGNITUDE, Objective, Range
from handfast.stability.problem.scaled_problem import ScaledProblem
from handfast.stability.problem.settings import MIN_SEARCH_TIME, OnStep, Progress, Settings
from handfast.stability.problem.witness import Witness
from handfast.stability.search import arrays
from handfast.stability.search.bounded_motion import FIRST_HELP_NODES, Capped
from handfast.stability.search.certificate_polish import Rays
from handfast.stability.search.machine import LIBRARY
from handfast.stability.search.proof import Outcome, Proof
from handfast.stability.search.reduced import Reduced, reduce
from handfast.stability.search.search import WITNESS_INSET, Search, exact_solution

FINER_GAPS = 1e-4, 1e-5, 1e-6  # what a search leaves unresolved is tried with smaller gaps in turn,
# share of the time for the search itself where a number is sought: what waits is closed, and the proof is replayed, in
# the rest; that takes as long as the search
SEARCHING, REPLAYED = 0.9, 0.5
BEST, FIRST_TURN_NODES = 3, 2048  # searches that go on in turn where no box does well, and nodes of their first turn
SPLIT_ROUNDS = 8  # in which leaves that are not proved without a cap are split
REPORT_INTERVAL = 0.05  # [s] between two reports of progress


def search(
    p: ScaledProblem,
    goal: Objective,
    settings: Settings,
    on_progress: OnStep | None = None,
    *,
    near: Sequence[tuple[State, float]] = (),
    endless: bool = False,
    within: Range | None = None,
    capped: bool = True,
    least: float = 0.0,
    refuted: bool = True,
) -> Outcome:
    """Branch and bound until value and bound are as near as asked; Ctrl-C leaves what was reached.

    Args:
        near: states and their magnitudes of questions that are nearly the same: Newton's method starts from them, too.
        endless, within: see `reduce`.
        capped: may the bound be one for motions up to a cap, where there is no other?
        least: (scaled) command of an actuator that turns, at least, where commands are sought.
        refuted: is it proved where there is no state at all? Not if a search of a longer range follows.
    """
    LIBRARY.functions  # noqa: B018  the first search compiles, or loads what was: no search's time
    start, limits = time.monotonic(), SearchLimits(settings.timeout)
    r = replace(reduce(p, goal, endless=endless, within=within), least=least, refuted=refuted)
    guess = [r.at_magnitude(*known) for known in near]
    if not goal.has_scalar and not (r.load.w_a.any() or r.load.f_a.any()):
        guess = [*guess, np.zeros(len(r.cost))]  # nothing acts: nothing moves

    def beyond(value: float, nodes: int, seconds: float) -> Array | None:
        return _beyond(r, value, replace(settings, nodes=nodes, timeout=max(seconds, MIN_SEARCH_TIME), verify=False))

    beside = Capped(r, *_gaps(r, goal, settings), settings.jobs or default_jobs(), bounds=capped, beyond=beyond)
    tries = settings.verify and r.may_try
    out = _search(p, goal, settings, on_progress, replace(r, tries=tries), limits, beside, guess)
    again = [settings.gap] * tries  # in another order, without trials
    for gap in (*again, *(g for g in FINER_GAPS if g < settings.gap)):  # the tolerances of programs go with the gap
        nodes = settings.nodes - out.nodes
        if out.stop is not Stop.NUMERICAL or nodes <= 0 or limits.late:
            break
        finer = replace(settings, gap=gap, nodes=nodes)
        out = _better(out, _search(p, goal, finer, on_progress, r, limits, guess=guess))
    if out.stop is Stop.NUMERICAL and out.nodes < settings.nodes and not limits.late:
        out = _to_cap(beside, goal, settings, limits, out)
    if beside.better is not None and out.stop is not Stop.COMPLETE:
        out = _improved(r, out, beside.better, out.stop)
    if out.stop is Stop.NUMERICAL and goal.maximised and -INF < out.bound < out.value and not limits.late:
        out = _below_bound(r, out, replace(settings, timeout=max(limits.seconds_left, MIN_SEARCH_TIME)))
    stop = Stop.TIME if out.stop is Stop.NUMERICAL and limits.late else out.stop
    return replace(out, stop=stop, seconds=time.monotonic() - start)


def _better(a: Outcome, b: Outcome) -> Outcome:
    """What two searches of the same question, the second more finely, have shown together."""
    nodes = a.nodes + b.nodes
    if b.stop is Stop.COMPLETE:
        return replace(b, nodes=nodes)
    low, high = (b if b.value <= a.value else a), (b if b.bound >= a.bound else a)
    return replace(low, bound=high.bound, proof=high.proof, verified=high.verified, stop=b.stop, nodes=nodes)


def _search(
    p: ScaledProblem,
    goal: Objective,
    settings: Settings,
    on_progress: OnStep | None,
    r: Reduced,
    limits: SearchLimits,
    beside: Capped | None = None,
    guess: Sequence[Array] = (),
) -> Outcome:
    """One search, within what is left of the time."""
    start = time.monotonic()
    share = 1.0 if r.objective == arrays.ANY else REPLAYED if settings.verify else SEARCHING
    searching = SearchLimits(share * limits.seconds_left)
    gap, gap_absolute = _gaps(r, goal, settings)
    searches: list[Search] = []

    def turns() -> Iterator[tuple[Search, float]]:
        """Searches, and nodes up to which each goes on; inf where it does as long as it is healthy."""
        for box in r.boxes:
            best = [s.z for s in searches if s.z is not None]
            workers = settings.jobs or default_jobs()
            s = Search(
                r.beginning(box),
                gap=gap,
                gap_absolute=gap_absolute,
                workers=workers,
                guess=best or guess,
            )
            searches.append(s)
            yield s, INF
        for turn in itertools.count():  # programs break down wherever they begin: on with those that do best, in turn
            for s in sorted(searches, key=lambda s: s.trouble)[:BEST]:
                yield s, FIRST_TURN_NODES * 2.0**turn

    shown, bound = start, -INF
    try:
        for s, until in turns():
            spent = sum(other.nodes for other in searches if other is not s)
            s.node_limit = settings.nodes - spent
            s.time_limit = searching.seconds_left
            for state in s:
                if on_progress and (state.stop or time.monotonic() - shown > REPORT_INTERVAL):
                    shown = time.monotonic()
                    bound = min(max(bound, state.bound), state.best)  # the end is proved to the gap, points say more
                    nodes = spent + state.nodes
                    on_progress(Progress(*goal.bounds(p, state.best * r.scale, bound * r.scale), nodes))
                other = beside.watch(state, settings.nodes - spent, searching) if beside else None
                if beside and other:
                    return _outcome(other, goal, settings, limits, spent + s.nodes + beside.nodes - other.nodes)
                if state.stop is None and (state.nodes >= until or (until == INF and not state.healthy)):
                    break
            if s.stop is not None:
                break
    except KeyboardInterrupt:
        s.stop = Stop.INTERRUPTED
    return _outcome(s, goal, settings, limits, spent + (beside.nodes if beside else 0))


def _gaps(r: Reduced, goal: Objective, settings: Settings) -> tuple[float, float]:
    """Relative and absolute distance of value and bound at which a search may stop."""
    gap = settings.gap * (1 - 2 * WITNESS_INSET)  # leaves room for rounding, and for a witness inside
    return goal.gaps(gap)


def _to_cap(beside: Capped, goal: Objective, settings: Settings, limits: SearchLimits, found: Outcome) -> Outcome:
    """What was found, but with a bound for motions up to a cap, if as many nodes as were spent give one.

    That there is no state is said only where there is none up to the largest of the caps.
    """
    spent = beside.nodes
    if not beside.possible or not beside.bounds:
        return found
    nodes = min(max(found.nodes, FIRST_HELP_NODES), settings.nodes - found.nodes)
    try:
        s = beside.run(found.point, nodes, limits)
        if beside.any and s.stop is Stop.COMPLETE and s.z is None:
            for s in beside.farther(found.point, nodes, limits):
                if s.stop is not Stop.COMPLETE or s.z is not None:
                    break
        elif s.stop is Stop.COMPLETE:
            if beside.contradicted(int(nodes), settings.nodes, limits):
                return replace(found, nodes=found.nodes + beside.nodes - spent)
            s = beside.search or s
    except KeyboardInterrupt:
        return replace(found, stop=Stop.INTERRUPTED)
    out = _outcome(s, goal, settings, limits, found.nodes + beside.nodes - spent - s.nodes)
    if s.stop is not Stop.COMPLETE or out.stop is not Stop.COMPLETE or (out.bound > found.value and not beside.any):
        return replace(found, nodes=out.nodes)  # also where a state beyond the cap says otherwise
    if found.value < out.value:
        out = replace(out, value=found.value, witness=found.witness, point=found.point)
    return out


def _outcome(s: Search, goal: Objective, settings: Settings, limits: SearchLimits, spent: int) -> Outcome:
    """What a finished search has shown; limits: of all that is still to do, spent: nodes that other searches had."""
    r = s.reduced
    stop = s.stop or Stop.INTERRUPTED
    found = None if s.z is None else r.witness(r.point(s.z))
    z, best, refused = s.z, s.best, found is not None and not found.valid
    if refused and goal.maximised:  # all forces may vanish there, but for rounding
        below = _just_below(r.p, s.best, replace(settings, timeout=max(limits.seconds_left, MIN_SEARCH_TIME)))
        if below is not None:
            z, best, found, refused = None, s.best * (1 - WITNESS_INSET * settings.gap), below, False
    if refused:  # the judge has the last word; everything the search cut off by it is open again
        return Outcome(INF, -INF, None, Stop.NUMERICAL, limits.seconds, spent + s.nodes)
    value = best * r.scale
    if found and z is not None and r.objective == arrays.SCALAR:
        value = r.scalar(z)  # by which its commands are the grasp's
    shown = s.end if found else INF
    bound = r.scale * (shown if stop is Stop.COMPLETE else s.close(limits.end))
    first = float(r.lo[0]) if r.objective == arrays.SCALAR else -INF
    at_end = found is not None and first > -INF and s.best <= first + END_TOLERANCE * abs(first)
    if not goal.has_scalar:
        value, bound = (0.0, -INF) if found else (INF, bound)
    elif goal.seeks_commands and found and (s.best <= s.gap_absolute or s.end < r.lo[0]):
        stop, bound = Stop.COMPLETE, -INF  # nothing is less than none, which needs no proof
    elif at_end:
        bound = -INF  # unbounded, as far as the search goes
    proof, verified = None, False
    if bound == INF and not r.refuted:
        return Outcome(value, bound, found, stop, limits.seconds, spent + s.nodes)
    if bound > -INF:
        try:
            proof, verified = _proved(s, settings, limits)
        except KeyboardInterrupt:
            stop = Stop.INTERRUPTED
        if proof is None:
            stop, bound = (Stop.TIME if limits.late else Stop.NUMERICAL) if stop is Stop.COMPLETE else stop, -INF
    if goal.seeks_commands:
        bound = max(bound, 0.0)
    if found and z is not None and r.objective == arrays.SCALAR and not at_end:
        z, value, found = _inside(r, z, value, settings.gap, found)
    return Outcome(value, bound, found, stop, limits.seconds, spent + s.nodes, proof=proof, point=z, verified=verified)


def _just_below(p: ScaledProblem, best: float, settings: Settings) -> Witness | None:
    """A witness a little inside the largest magnitude, of the objective best, found anew."""
    s = LARGEST_MAGNITUDE.magnitude(p, best) * (1 - WITNESS_INSET * settings.gap)
    return _resisting(p, s, replace(settings, verify=False)) if s > 0 else None


def _resisting(p: ScaledProblem, s: float, settings: Settings) -> Witness | None:
    """A witness that resists the magnitude s."""
    there = replace(p, w0=p.w0 + s / p.direction_scale * p.direction, wrench=p.wrench + s * p.along)
    return search(there, ANY_STATE, settings).witness


def _beyond(r: Reduced, value: float, settings: Settings) -> Array | None:
    """A point (n,) whose objective, a magnitude's, is a little below a value; None if none was found.

    Bounds up to a cap on motions are tried by it: what moves more may resist more.
    """
    if value == 0:
        return None
    return _at(r, r.goal.magnitude(r.p, value) * (1 + WITNESS_INSET * settings.gap), settings)


def _below_bound(r: Reduced, out: Outcome, settings: Settings) -> Outcome:
    """With a state for a magnitude within the gap of the bound, if rounding left the search without and one is found.

    On flat grasps with a base load programs break down near states that Newton's method finds at a given magnitude.
    """
    limit = max(settings.nodes - out.nodes, 1)
    settings = replace(settings, verify=False, nodes=limit)
    s = r.goal.magnitude(r.p, out.bound) * (1 - settings.gap / 2)
    point = _at(r, s, settings) if s > 0 else None
    return out if point is None else _improved(r, out, point, Stop.COMPLETE)


def _at(r: Reduced, magnitude: float, settings: Settings) -> Array | None:
    """A point (n,) that resists a magnitude; None if none was found."""
    found = _resisting(r.p, magnitude, settings)
    return None if found is None else r.at_magnitude(found.state, magnitude)


def _improved(r: Reduced, out: Outcome, point: Array, stop: Stop) -> Outcome:
    """With the state at a point (n,), and the stop it gives, if it is valid and better than what was found."""
    value, state = r.scalar(point), r.witness(r.point(point))
    if not state.valid or value >= out.value:
        return out
    return replace(out, value=value, witness=state, point=point, stop=stop)


def _proved(s: Search, settings: Settings, limits: SearchLimits) -> tuple[Proof | None, bool]:
    """What the finished search proves, and was it replayed? None if the checker does not accept it.

    Leaves that are proved within a cap only, or not at all, are split: the more is decided, the more rows there are.
    """
    r = s.reduced
    s.trim()
    proof = Proof(r, s.pool, s.end)
    if not settings.verify:
        return proof, False
    best: Proof | None = None
    known: dict[bytes, Rays] = {}
    for _ in range(SPLIT_ROUNDS):
        proof, ok, unproved = proof.checked(limits.end, known)
        if ok and (best is None or proof.cap is None or (best.cap is not None and proof.cap > best.cap)):
            best = proof
        done = ok and (not len(unproved) or r.cap < INF)
        if done or limits.late or not s.split_leaves(unproved):
            break
        s.time_limit = limits.seconds_left
        for _state in s:
            pass
        if s.stop is not Stop.COMPLETE:
            break
        s.trim()
        proof = Proof(r, s.pool, s.end)
    return best, best is not None


def _inside(r: Reduced, z: Array, value: float, gap: float, found: Witness) -> tuple[Array, float, Witness]:
    """The witness a little inside the largest magnitude: at the very end, rounding decides whether it is resisted."""
    little = WITNESS_INSET * gap * (1 if value > 0 else -1)
    near = replace(r, lo=np.r_[value * (1 + little), r.lo[1:]])
    inner = exact_solution(near, z, hold=True)
    if inner is None:
        return z, value, found
    w = r.witness(r.point(inner))
    return (inner, r.scalar(inner), w) if w.valid else (z, value, found)
