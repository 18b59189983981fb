"""First the squeeze, then the load in steps: the path of a load, each step an exact state from the one before it.

State 0 is that of the commands alone, the one of least motion. Each step is a check of a grasp that starts where the
state before left it (`Grasp.with_start`): springs, stops and tendons that nobody commands know the whole motion,
friction and commanded gearing the step's alone. Of several states of a step the path goes on from the one of least
motion; it is followed once more from the states as the search met them, where these are others. Steps become a
quarter as long until what the path says stays the same: see docs/load-path.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from handfast.core.answer import SearchLimits, Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.schema import written
from handfast.model.grasp import Grasp
from handfast.model.start import Start
from handfast.proofs import path_steps
from handfast.proofs.certificate import proof_to_dict
from handfast.proofs.existence import Proved
from handfast.proofs.states import Problem, State, came_from
from handfast.proofs.tolerance import UNBOUNDED_FACTOR, farthest
from handfast.stability.answers.answer import Answer, any_state, witness_json
from handfast.stability.problem import judge, scaled_problem
from handfast.stability.problem.bound_problem import BoundProblem
from handfast.stability.problem.grasp_data import grasp_data
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.model import relative_motion, state_of
from handfast.stability.problem.objective import ANY_STATE, LARGEST_MAGNITUDE
from handfast.stability.problem.scaled_problem import ScaledProblem
from handfast.stability.problem.settings import OnStep, Settings
from handfast.stability.problem.witness import VALID, Witness
from handfast.stability.search.solve import clock_of, solve, time_left

A = TypeVar("A", bound=Answer)
STEP_COUNTS = 1, 4, 16, 64  # steps to the whole load, or to where one step leads, until two paths in turn say the same
AGREE = 0.01  # relative: ends of two paths that differ by less are the same
STEP_FACTORS = 2, 4, 8  # times the last step, where that is left open: farther on it may be shown to have no state
STEP_INFLATION = 1 + 1e-9  # rounding
MOST_NODES = 4000  # for where one step leads, by which steps are only sized
OTHER = 1e-6  # relative to the forces that act: states whose motions differ by less are the same


@dataclass(frozen=True, eq=False)
class StepAnswer(Answer):
    """Is there a state of a step?"""

    query = "check"

    @property
    def _may_move_less(self) -> bool:
        return False  # of the choices among states the path makes its own

    def _within(self, p: Problem, x: State) -> float:
        return path_steps.near_enough(p, x)

    def said(self) -> dict[str, Any]:
        return self.state_json()


@dataclass(frozen=True, eq=False)
class LoadPath:
    """A load's path.

    Attributes:
        whole: the question of the whole load, from rest.
        magnitudes: of the load, one for each of `steps`.
        steps: state 0, then each step; the last may be one that is shown to have none.
        by_steps: how far paths of 1, 4, 16 ... steps came, this one among them; 1 is the whole load of a check.
        other_choice: how far the path of as many steps comes that goes on from states as the search met them; None
            where there was nothing to choose.
        resolution: to what share of the load steps were refined at most, or ends of paths agree; 0 where shorter steps
            lead through the same states.
        nodes: of all steps that were tried.
    """

    whole: BoundProblem
    magnitudes: tuple[float, ...]
    steps: tuple[StepAnswer, ...]
    by_steps: dict[int, float] = field(default_factory=dict)
    other_choice: float | None = None
    resolution: float = 1.0 / STEP_COUNTS[-1]
    nodes: int = 0

    @property
    def rest(self) -> StepAnswer | None:
        """State 0, of the commands alone, or that it is shown to be none: for other paths of the grasp."""
        return None if self.steps[0].verdict is Verdict.UNDECIDED else self.steps[0]

    @property
    def held(self) -> tuple[StepAnswer, ...]:
        """The steps that have a state."""
        return tuple(s for s in self.steps if s.verdict is Verdict.HOLDS)

    @property
    def reached(self) -> float | None:
        """The largest magnitude that has a state; None where the commands alone have none."""
        return self.magnitudes[len(self.held) - 1] if self.held else None

    @property
    def upper(self) -> float | None:
        """`slips_at`, or 0 where none however small has one; None if that was not shown."""
        begun = self.steps[-1].question
        none = not self.reached and begun and path_steps.is_scale_free(self.whole.question, begun.grasp)
        return 0.0 if none and self.slips_at is not None else self.slips_at

    @property
    def slips_at(self) -> float | None:
        """The magnitude at which no state exists from the last one; None if that was not shown."""
        return self.magnitudes[-1] if self.steps[-1].verdict is Verdict.SLIPS else None

    @property
    def exact(self) -> bool | None:
        """Is an exact state of every step proved to exist? None without any."""
        return all(bool(s.exact) for s in self.held) if self.held else None

    @property
    def shown(self) -> tuple[Witness, Proved | None] | None:
        """The last state as its step shows it, and what is proved of it."""
        return self.held[-1]._shown if self.held else None

    @property
    def moved(self) -> tuple[Array, Array]:
        """(6,), (l,) how far object and joints have come from rest, all steps together, see `State`; 0 without any."""
        states = [s.witness.state for s in self.held if s.witness is not None]
        g = self.whole.problem.grasp
        return sum((x.r for x in states), np.zeros(6)), sum((x.q for x in states), np.zeros(g.l))

    @property
    def motion(self) -> float | None:
        """[N] how large the virtual motions of a step are at most; None without any."""
        return max((s.motion for s in self.held if s.motion is not None), default=None)

    def backing(self, seconds: float) -> dict[str, Any]:
        """The fields of an answer that rests on it."""
        last, held = self.steps[-1], self.held
        return {
            "verdict": last.verdict,
            "stop": last.stop,
            "seconds": seconds,
            "nodes": self.nodes,
            "found": held[-1].found if held else None,
            "proof": last.proof if last.verdict is Verdict.SLIPS else None,
            "posed": self._posed,
            "path": self,
            "verified": all(s.verified for s in self.steps),
        }

    @property
    def _decided(self) -> list[tuple[float, StepAnswer]]:
        """Magnitudes and steps that have a state, or are shown to have none."""
        each = zip(self.magnitudes, self.steps, strict=True)
        return [(m, s) for m, s in each if s.verdict is not Verdict.UNDECIDED]

    @property
    def _posed(self) -> BoundProblem:
        """Of the last state: its problem, with the load that grows as the direction."""
        if not self.held or self.held[-1].posed is None:
            return self.whole
        return BoundProblem(replace(self.held[-1].posed.problem, along=self.whole.problem.wrench), ANY_STATE)

    def said(self) -> dict[str, Any]:
        """The keys that an answer has by its path."""
        return {
            "loading": path_steps.LOADING,
            "steps": sum(m > 0 for m, _ in self._decided),
            "by_steps": {str(n): end for n, end in self.by_steps.items()},
            "other_choice": self.other_choice,
            "resolution": self.resolution,
        }

    def to_file(self, answer: dict[str, Any]) -> dict[str, Any]:
        """The `handfast/path/1` object with the JSON of its answer."""
        return {
            "schema": path_steps.SCHEMA,
            "question": self.whole.to_json(),
            "answer": answer,
            "steps": [{"magnitude": m, **_step_json(s)} for m, s in self._decided],
        }


def _step_json(s: StepAnswer) -> dict[str, Any]:
    assert s.posed is not None
    start = s.posed.problem.grasp.start
    return {
        "from": None if start is None else written(start),
        "witness": None if s.witness is None else witness_json(s.witness),
        "certificate": None if s.certificate is None else proof_to_dict(s.certificate),
    }


def start_after(step: StepAnswer, w: Witness) -> Start:
    """What the next step starts from, after a state of this one."""
    came, _, _ = came_from(step._problem(w), w.state)
    return Start(came.gaps, came.stops, came.slack)


# --- following it ---------------------------------------------------------------------------------

Pick = Callable[[StepAnswer], Witness | None]
Known = tuple[float, State]  # a magnitude of the load, and a state that it has


def _forces(x: State) -> tuple[Array, ...]:
    return x.c, x.f, x.coupling, x.reaction, x.torsion


def shown(step: StepAnswer) -> Witness | None:
    """The state of least motion."""
    return step.witness


def met(step: StepAnswer) -> Witness | None:
    """The state as the search met it."""
    return step.found


@dataclass(eq=False)
class Follower:
    """Follows the path of a load.

    Attributes:
        whole: the scaled problem of the whole load, from rest; limits: of the question's time.
        made: (magnitude, bytes of the start) -> what was found: paths of other steps begin alike.
        before: of each start the magnitude and the state before it, and the same of the one before that, None at first.
        straight: of each choice the first steps of its last path, as far as shorter ones lead through the same states.
    """

    whole: ScaledProblem
    settings: Settings
    limits: SearchLimits
    on_progress: OnStep | None
    made: dict[tuple[float, bytes], StepAnswer] = field(default_factory=dict)
    before: dict[Start, tuple[Known, Known | None]] = field(default_factory=dict)
    straight: dict[Pick, list[tuple[float, StepAnswer]]] = field(default_factory=dict)
    nodes: int = 0

    @classmethod
    def of(
        cls, p: ScaledProblem, settings: Settings, on_progress: OnStep | None, rest: StepAnswer | None = None
    ) -> Follower:
        """Of a question that begins now; rest: its state 0, if it is known.

        Raises:
            InputError: the grasp is one of a path's states, not at rest.
        """
        if p.grasp.start is not None:
            right = "ask of the grasp itself, grasp.with_start(None)"
            raise InputError(
                f"'preload-first' begins at rest, and this grasp at a state of a path; {right}", field="loading"
            )
        return cls(p, settings, clock_of(settings), on_progress, {} if rest is None else {(0.0, b""): rest})

    def step(self, grasp: Grasp, magnitude: float, prove: bool = True) -> StepAnswer:
        """Is there a state at a magnitude of the load, from where the grasp starts? prove: that there is none, too."""
        start = grasp.start
        key = magnitude, b"" if start is None else b"".join(x.tobytes() for x in (start.gaps, start.stops, start.slack))
        found = self.made.get(key)
        if found is None or (prove and self.settings.verify and not found.verified):
            p, left = self.whole, time_left(self.settings, self.limits)
            left = replace(left, nodes=max(self.settings.nodes - self.nodes, 1), verify=prove and left.verify)
            posed = scaled_problem.build(grasp, magnitude * p.wrench, limits=p.limits)
            hints = {} if start is None else {"near": [(x, 0.0) for x in self._guesses(start, magnitude)]}
            found = any_state(StepAnswer, posed, left, self.on_progress, **hints)
            found = found.settled(self.limits.end)
            self.made[key], self.nodes = found, self.nodes + found.nodes
        return self.made[key]

    def _guesses(self, start: Start, magnitude: float) -> list[State]:
        """Where a step may lead: on as the step before it did, and nowhere; states that go on are found first."""
        (m, x), earlier = self.before[start]
        rest = state_of(0 * x.r, 0 * x.q, x.c, x.f, x.coupling, x.reaction, x.torsion)
        if earlier is None:
            return [rest]
        share = (magnitude - m) / (m - earlier[0])
        y = earlier[1]
        forces = ((a, b) for a, b in zip(_forces(x), _forces(y), strict=True))
        return [state_of(share * x.r, share * x.q, *(a + share * (a - b) for a, b in forces)), rest]

    def after(self, step: StepAnswer, magnitude: float, pick: Pick) -> Grasp | None:
        """The grasp after a state of a step at a magnitude; None without one."""
        w = pick(step)
        if w is None:
            return None
        start, own = start_after(step, w), w.grasp.start
        earlier = None if own is None else self.before[own][0]
        self.before[start] = (magnitude, w.state), earlier
        return self.whole.grasp.with_start(start)

    def is_straight(self, w: Witness) -> bool:
        """Do shorter steps lead to the same state, along the line from the state before it?

        Yes, if the middle of the line is a state of the step. In the share of the line each equation is linear, or a
        product of two linear terms that keep their signs, which is 0 at the end and in the middle: so it is 0 all
        along. The rest of the step from anywhere on the line has the same direction, so the same holds for it.
        """
        start = w.grasp.start
        if start is None:
            return True
        (m, x), _ = self.before[start]
        forces = ((a + b) / 2 for a, b in zip(_forces(x), _forces(w.state), strict=True))
        load = (m * self.whole.wrench + w.wrench) / 2
        middle = state_of(w.state.r / 2, w.state.q / 2, *forces)
        return bool(judge.residuals(w.grasp, load, middle, eta=w.eta).worst <= VALID)

    def along(self, magnitudes: Array, pick: Pick = shown, prove: float = np.inf) -> LoadPath:
        """The path with states at some magnitudes, the first of which is 0, as far as it goes.

        prove: that a step up to this magnitude has no state, too; the commands alone are always proved to have none.
        """
        line = list(self.straight.get(pick, ()))
        grasp, straight = self.whole.grasp, True
        if line:
            grasp = self.after(line[-1][1], line[-1][0], pick) or grasp
        for m in magnitudes[magnitudes > line[-1][0]].tolist() if line else magnitudes.tolist():
            step = self.step(grasp, m, m <= prove or m == 0)
            line.append((m, step))
            last = m == magnitudes[-1]
            w = None if step.verdict is not Verdict.HOLDS else step.found if last else pick(step)
            straight = straight and w is not None and self.is_straight(w)
            after = None if w is None or last else self.after(step, m, pick)
            if after is None:
                break
            grasp = after
            if straight:
                self.straight[pick] = list(line)
        path = self._path([s for _, s in line], [m for m, _ in line])
        return replace(path, resolution=0.0) if straight else path

    def to_end(self, size: float, share: float, last: float, pick: Pick = shown) -> LoadPath:
        """The path as far as it goes, or to the last magnitude; finer where it ends.

        In steps of a size at most, or of a share of the magnitude, where that is more: a path may go a thousand times
        as far as its first step.
        """
        steps, magnitudes, gap = [self.step(self.whole.grasp, 0.0)], [0.0], self.settings.gap
        step, asked, least = size, False, gap * last / UNBOUNDED_FACTOR
        grasp = self.after(steps[0], 0.0, pick) if steps[0].verdict is Verdict.HOLDS else None
        while grasp is not None and magnitudes[-1] < last:
            here = magnitudes[-1]
            target = min(here + step, last)
            found = self.step(grasp, target, prove=step <= gap * target * STEP_INFLATION)
            ends = found.verdict is Verdict.SLIPS or _is_open(found)  # rounding that left a step open ends no path
            if ends and step > gap * target * STEP_INFLATION and step > least:
                if asked:
                    step /= 2
                else:  # just below where one step leads, or as finely as can be
                    end = self.one_step_end(grasp, here, target)
                    step = end * (1 - gap / 2) - here if end is not None else 0.0
                step, asked = max(step, gap * here, least), True
                continue
            found = found if found.verdict is not Verdict.SLIPS else self.step(grasp, target)
            for factor in STEP_FACTORS if _is_open(found) else ():
                if _is_open(found):
                    target = min(here + factor * step, last)
                    found = self.step(grasp, target)
            steps.append(found)
            magnitudes.append(target)
            grasp = self.after(found, target, pick) if found.verdict is Verdict.HOLDS else None
            step, asked = (gap * target if asked else min(max(size, share * target), 2 * step)), False
        return self._path(steps, magnitudes)

    def one_step_end(self, grasp: Grasp, here: float, below: float) -> float | None:
        """About the largest magnitude between two that one step reaches, as the search says; None if it finds none."""
        p, w = self.whole, self.whole.wrench
        along = scaled_problem.build(grasp, np.zeros(6), w, limits=p.limits)
        end = min(below, along.last_magnitude)
        left = time_left(self.settings, self.limits)
        left = replace(left, verify=False, nodes=min(left.nodes, MOST_NODES))
        within = (-end / along.direction_scale, -here / along.direction_scale)
        found = solve(along, LARGEST_MAGNITUDE, left, None, within=within)
        self.nodes += found.nodes
        lower = LARGEST_MAGNITUDE.bounds(along, found.value, found.bound)[0] if found.witness is not None else 0.0
        return lower if lower > here else None

    def _path(self, steps: list[StepAnswer], magnitudes: list[float]) -> LoadPath:
        """As far as it goes on from states that are proved, see `path_steps.may_drift`."""
        whole, apart, kept, end = BoundProblem(self.whole, ANY_STATE), 0.0, -1, 0.0
        for k, (m, step) in enumerate(zip(magnitudes, steps, strict=False)):
            end = m if step.verdict is Verdict.HOLDS or not end else end
            if step.proved is not None and step.witness is not None:
                apart += path_steps.off_by(step._problem(step.witness), step.proved)
            kept = k if apart <= path_steps.may_drift(whole.question, end) else kept
        if kept + 1 < len(steps):
            steps = steps[: kept + 2]
            steps[-1] = replace(steps[-1], verdict=Verdict.UNDECIDED, stop=Stop.NUMERICAL, found=None, proof=None)
        return LoadPath(whole, tuple(magnitudes[: len(steps)]), tuple(steps))

    def chosen_otherwise(self, path: LoadPath) -> bool:
        """Does the search meet another state than that of least motion, anywhere a path goes on from?"""
        return any(_differ(s) for s in path.held[: len(path.steps) - 1])


def _is_open(step: StepAnswer) -> bool:
    """Did rounding leave it open?"""
    return step.verdict is Verdict.UNDECIDED and step.stop is Stop.NUMERICAL


def _differ(step: StepAnswer) -> bool:
    """Do the state of least motion and the one that was met lead to different starts?"""
    least, other = shown(step), met(step)
    if least is None or other is None or least is other:
        return False
    a, b = (start_after(step, w) for w in (least, other))
    acting = max(float(np.abs(least.state.c).max(initial=0.0)), float(np.abs(other.state.c).max(initial=0.0)))
    d = relative_motion(least.grasp, least.state.r - other.state.r, least.state.q - other.state.q)
    return float(max(np.abs(a.gaps - b.gaps).max(), np.abs(d).max())) > OTHER * acting


def comes_after(loading: str, mdp: bool = True, **others: object) -> bool:
    """Is the load to come after the commands? `InputError` for another word, or with what a path does not know."""
    if loading not in ("together", path_steps.LOADING):
        raise InputError(f"is '{loading}'; 'preload-first' or 'together' is needed", field="loading")
    if loading == "together":
        return False
    if not mdp:
        raise InputError("'preload-first' needs the maximum dissipation principle", field="loading")
    for name, value in others.items():
        if value is not None and value is not False:
            raise InputError(f"'preload-first' cannot be asked with {name}; leave one of the two out", field="loading")
    return True


def check_path(
    p: ScaledProblem, settings: Settings, on_progress: OnStep | None = None, rest: StepAnswer | None = None
) -> LoadPath:
    """The path to a load (`p.wrench`, base load alone, no direction): in ever more steps, until two say the same.

    rest: state 0 of another path of the same grasp and limits, so that it is not looked for again.
    """
    follower = Follower.of(p, settings, on_progress, rest)
    by_steps: dict[int, float] = {}
    before = None
    for n in STEP_COUNTS:
        slipped, magnitudes = before is Verdict.SLIPS, np.linspace(0.0, 1.0, n + 1)
        # a path that ends here, by `same` below, is proved to
        path = follower.along(magnitudes, prove=np.inf if n == STEP_COUNTS[-1] else magnitudes[-2] if slipped else 0.0)
        by_steps[n], verdict = path.reached or 0.0, path.steps[-1].verdict
        # a last step, from near the whole load, may be too long: shorter ones may come to the end
        same = verdict is before and (verdict is Verdict.HOLDS or path.magnitudes[-1] < 1.0)
        if not path.held or verdict is Verdict.UNDECIDED or path.resolution == 0 or same:
            break
        before = verdict
    other = None
    if follower.chosen_otherwise(path):
        other = follower.along(np.linspace(0.0, 1.0, n + 1), met, prove=0.0).reached or 0.0
    return replace(path, by_steps=by_steps, other_choice=other, nodes=follower.nodes)


def path_end(
    p: ScaledProblem, settings: Settings, on_progress: OnStep | None = None, rest: StepAnswer | None = None
) -> LoadPath:
    """The path of growing multiples of a load (`p.wrench`) to its end: in ever shorter steps, until ends agree.

    rest: as of `check_path`.
    """
    follower = Follower.of(p, settings, on_progress, rest)
    posed = BoundProblem(p, ANY_STATE)
    last = farthest(replace(posed.question, direction=p.wrench, wrench=np.zeros(6))) * (1 + AGREE)
    begun = follower.along(np.zeros(1))
    grasp = follower.after(begun.steps[0], 0.0, shown) if begun.held else None
    if grasp is None:
        return replace(begun, nodes=follower.nodes)
    by_steps: dict[int, float] = {}
    if not (p.f_c.any() or p.is_given):  # beside nothing but limits no search tells small magnitudes from none
        free = path_steps.is_scale_free(posed.question, grasp_data(grasp))
        first = follower.along(np.array([0.0, last if free else settings.gap * last / UNBOUNDED_FACTOR]))
        if free or first.steps[-1].verdict is not Verdict.HOLDS:
            return replace(first, by_steps={1: first.reached or 0.0}, nodes=follower.nodes)
    size = min(follower.one_step_end(grasp, 0.0, last) or last / UNBOUNDED_FACTOR, last)
    before = None
    for n in STEP_COUNTS[1:]:
        path = follower.to_end(size / n, 1 / n, last)
        end = by_steps[n] = path.reached or 0.0
        agree = before is not None and abs(end - before) <= AGREE * max(end, before)
        if path.steps[-1].verdict is Verdict.UNDECIDED or agree:
            break
        before = end
    other = None
    if follower.chosen_otherwise(path):
        other = follower.to_end(size / n, 1 / n, last, met).reached or 0.0
    return replace(path, by_steps=by_steps, other_choice=other, resolution=AGREE, nodes=follower.nodes)


class PathsFromRest:
    """The paths of many loads on a grasp: the state of the commands alone is found for the first, and kept."""

    def __init__(self, limits: GraspLimits) -> None:
        self.limits = limits
        self._rest: StepAnswer | None = None

    def answer(
        self,
        follow: Callable[..., A],
        grasp: Grasp,
        w: Array,
        settings: Settings,
        on_progress: OnStep | None = None,
    ) -> A:
        """The answer to a load or direction (6,), by `check_along` or `largest_along`; the grasp is always the same."""
        answer = follow(scaled_problem.build(grasp, w, limits=self.limits), settings, on_progress, rest=self._rest)
        assert isinstance(answer.path, LoadPath)
        self._rest = answer.path.rest
        return answer
