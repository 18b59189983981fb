"""Maps and sweeps as files have them, asked again: every number of every curve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.proofs import path_steps
from handfast.proofs.answers import VERDICTS
from handfast.proofs.constants import MAX_ETA
from handfast.proofs.fields import EQUALITY_TOLERANCE, BadFile, Fields, number, numbers
from handfast.proofs.question import Range
from handfast.proofs.replay import SEARCH_STOPS, Replay
from handfast.readers import grasp_file
from handfast.stability.problem.grasp_limits import AskedWith, GraspLimits
from handfast.stability.problem.settings import INF
from handfast.stability.studies.ask_again import Asking, BoundsClaim, Claim, IntervalClaim, asked, together
from handfast.stability.studies.maps import PLANES, forces_at, in_plane, of_all

MAP_NOT_REPLAYED = "stop, seconds, nodes: the course of the search is recorded, and nothing rests on it"
OLD = "is missing, so that it cannot be asked again: the file was written by an older Handfast; make it anew"
OF_INTERVALS = "holds_from_zero_to", "holes", "unproved"


@dataclass(frozen=True, eq=False)
class Cell:
    """What a file says of one maximum, and where: `place` with the name of a number in it.

    Attributes:
        lower: 0 for none, or not reached. upper: inf for none. verdict: None where the file says none.
    """

    place: str
    lower: float
    upper: float
    unbounded: bool
    verdict: Verdict | None = None

    def at(self, name: str) -> str:
        return self.place.format(name)

    @property
    def due(self) -> Verdict:
        """The verdict that its numbers say."""
        if self.lower > 0 or self.unbounded:
            return Verdict.HOLDS
        return Verdict.SLIPS if self.upper == 0 else Verdict.UNDECIDED

    @property
    def contradiction(self) -> Replay | None:
        """What of it contradicts itself; None if nothing."""
        if self.unbounded and self.upper < INF:
            return Replay(self.at("unbounded"), "it is unbounded", f"is true, with an upper bound of {self.upper:.9g}")
        if self.lower > self.upper * (1 + EQUALITY_TOLERANCE):
            fault = f"is {self.lower:.9g}, above its upper bound {self.upper:.9g}"
            return Replay(self.at("lower"), "it is at most its upper bound", fault)
        if self.verdict is not None and self.verdict is not self.due:
            return Replay(
                self.at("verdicts"), "it is what its bounds say", f"is '{self.verdict}'; its bounds say '{self.due}'"
            )
        return None

    def claim(self, grasp: Grasp, load: Array, terms: AskedWith) -> Claim:
        """To be asked."""
        where = self.at("unbounded" if self.unbounded else "lower")
        return BoundsClaim(where, grasp, load, terms, self.lower, self.upper, self.unbounded, self.at("upper"))


def read_question(f: Fields) -> tuple[Grasp, AskedWith]:
    """What a map or a sweep was asked with. Raises `BadFile`, and `InputError` for the grasp."""
    grasp = grasp_of(f)
    eta, mdp, gap = f.number("eta", least=0.0), f.flag("mdp"), f.number("gap", least=0.0)
    limits = f.named("torque_limits")
    force = f.number("force_limit", least=0.0) if f.has("force_limit") else None
    loading: Any = f.text("loading", among=[path_steps.LOADING]) if f.has("loading") else "together"
    for name in ("force_limit", "loading"):
        f.take(name, None)
    f.done()
    if not (eta < MAX_ETA and 0 < gap < INF):
        raise BadFile("has an eta beyond 45 degrees, or a gap that is not above 0", f.place)
    return grasp, AskedWith(GraspLimits(eta, limits, force), mdp, gap, loading)


def grasp_of(f: Fields, name: str = "grasp") -> Grasp:
    """The grasp in a field; `InputError` names the field."""
    try:
        return grasp_file.from_dict(f.take(name))
    except InputError as fault:
        raise fault.within(f.at(name)) from None


def replay_map(data: Any, how: Asking) -> Replay:
    """A map, every number of it asked again. Raises `BadFile` and `InputError`."""
    f, verdict = _header(data, "map")
    grasp, terms = read_question(f.object("question"))
    plane: Any = f.text("plane", among=PLANES)
    point, eta = f.numbers("at", (3,)), f.number("eta", least=0.0)
    directions, preload = f.numbers("directions", (-1, 3)), f.named("preload")
    n = len(directions)
    curves = [("without_preload", grasp.with_preload(None), f.object("without_preload"))]
    if f.has("with_preload"):
        curves.append(("with_preload", grasp, f.object("with_preload")))
    f.take("with_preload", None)
    f.done()
    faults = _same_question(grasp, terms, preload, eta)
    if (len(curves) > 1) != bool(grasp.preload):
        raise BadFile("is for grasps with a preload, and for each of them", "with_preload")
    if not n:
        raise BadFile("is empty", "directions")
    due = in_plane(plane, n)
    for k in np.flatnonzero(np.abs(directions - due).max(axis=1) > EQUALITY_TOLERANCE).tolist():
        fault = f"is {directions[k].tolist()}; of {n} in the {plane} plane it is {due[k].tolist()}"
        faults.append(Replay(f"directions[{k}]", "it is a direction of the plane", fault))
    parts = []
    cells: list[Cell] = []
    for name, of, curve in curves:
        told = _curve(curve, n)
        loads = list(forces_at(point, directions))
        parts.append((name, "largest forces by direction", told, [(of, load) for load in loads]))
        cells = told.cells  # of the grasp as it is: the last
    faults += _of_all(verdict, cells)
    return _asked("map", parts, terms, faults, how)


def replay_sweep(data: Any, how: Asking) -> Replay:
    """A sweep, every number of it asked again. Raises `BadFile` and `InputError`."""
    f, verdict = _header(data, "sweep")
    grasp, terms = read_question(f.object("question"))
    name = f.text("joint", among=grasp.mechanism.actuators)
    directions = f.numbers("directions", (-1, 6))
    columns: list[_Told] = [_Told([], []) for _ in directions]
    cases: list[list[tuple[Grasp, Array]]] = [[] for _ in directions]
    for i, row in enumerate(f.objects("rows")):
        of = grasp.with_preload(grasp.preload | {name: row.number("preload")})
        lower, upper, unbounded = (_column(row, key, len(directions)) for key in ("lower", "upper", "unbounded"))
        row.done()
        for k, direction in enumerate(directions):
            columns[k].cells.append(_cell("", f"rows[{i}].{{}}[{k}]", lower[k], upper[k], unbounded[k]))
            cases[k].append((of, direction))
    f.done()
    parts = [
        (f"direction {k}", f"largest magnitudes by command of {name}", columns[k], cases[k])
        for k in range(len(directions))
    ]
    faults = _of_all(verdict, [cell for told in columns for cell in told.cells])
    return _asked("sweep", parts, terms, faults, how)


@dataclass(frozen=True, eq=False)
class _Told:
    """A curve: its cells, and (to, holes, unproved) of each where they were asked."""

    cells: list[Cell]
    intervals: list[tuple[float, tuple[Range, ...], tuple[Range, ...]]]


def _header(data: Any, query: str) -> tuple[Fields, Verdict]:
    f = Fields(data)
    f.text("schema", among=["handfast/answer/1"])
    f.text("query", among=[query])
    verdict = Verdict(f.text("verdict", among=VERDICTS))
    f.text("stop", among=SEARCH_STOPS)
    f.number("seconds", least=0.0)
    f.whole("nodes")
    if not f.has("question"):
        raise BadFile(OLD, "question")
    return f, verdict


def _same_question(grasp: Grasp, terms: AskedWith, preload: dict[str, float], eta: float) -> list[Replay]:
    """What the answer says of its question beside it, where that is something else."""
    out = []
    for name in {**grasp.preload, **preload}:
        if preload.get(name) != grasp.preload.get(name):
            fault = f"is {preload.get(name)}; the question's is {grasp.preload.get(name)}"
            out.append(Replay(f"preload.{name}", "it is that of the question", fault))
    degrees = float(np.degrees(terms.limits.eta))
    if abs(eta - degrees) > EQUALITY_TOLERANCE:
        fault = f"is {eta:g} degrees; the question's is {degrees:g}"
        out.append(Replay("eta", "it is that of the question", fault))
    return out


def _of_all(verdict: Verdict, cells: Sequence[Cell]) -> list[Replay]:
    due = of_all([cell.due for cell in cells])
    if verdict is due:
        return []
    return [Replay("verdict", "it is what all bounds say", f"is '{verdict}'; the bounds say '{due}'")]


def _curve(f: Fields, n: int) -> _Told:
    """A curve of a map."""
    lower, upper, unbounded, verdicts = (_column(f, key, n) for key in ("lower", "upper", "unbounded", "verdicts"))
    for k, word in enumerate(verdicts):
        if word not in VERDICTS:
            raise BadFile(f"is {word!r}; {' or '.join(map(repr, VERDICTS))} is needed", f.at(f"verdicts[{k}]"))
    cells = [
        _cell(f"{f.place}.", f"{{}}[{k}]", lower[k], upper[k], unbounded[k], Verdict(verdicts[k])) for k in range(n)
    ]
    intervals: list[tuple[float, tuple[Range, ...], tuple[Range, ...]]] = []
    if any(f.has(key) for key in OF_INTERVALS):
        to, holes = _column(f, "holds_from_zero_to", n), _column(f, "holes", n)
        unproved = _column(f, "unproved", n)
        for k in range(n):
            first = number(to[k], f.at(f"holds_from_zero_to[{k}]"), 0.0)
            slips, left = (_ranges(x[k], f.at(f"{key}[{k}]")) for key, x in (("holes", holes), ("unproved", unproved)))
            intervals.append((first, slips, left))
    f.done()
    return _Told(cells, intervals)


def _ranges(data: Any, place: str) -> tuple[Range, ...]:
    out = tuple((a, b) for a, b in numbers(data, (-1, 2), place).tolist())
    for a, b in out:
        if not 0 <= a <= b:
            raise BadFile(f"has {a:g} to {b:g}; magnitudes are needed, the smaller one first", place)
    return out


def _column(f: Fields, name: str, n: int) -> list[Any]:
    values = f.take(name)
    if not isinstance(values, list) or len(values) != n:
        raise BadFile(f"is no list of {n}", f.at(name))
    return values


def _cell(within: str, place: str, lower: Any, upper: Any, unbounded: Any, verdict: Verdict | None = None) -> Cell:
    """The numbers of one maximum; within: of what the place is a part."""
    if not isinstance(unbounded, bool):
        raise BadFile(f"is {unbounded!r}; true or false is needed", within + place.format("unbounded"))
    low = 0.0 if lower is None else number(lower, within + place.format("lower"), 0.0)
    high = INF if upper is None else number(upper, within + place.format("upper"), 0.0)
    return Cell(place, low, high, unbounded, verdict)


_Part = tuple[str, str, _Told, list[tuple[Grasp, Array]]]  # name, what it is, what is said of each case, the cases


def _asked(query: str, parts: Sequence[_Part], terms: AskedWith, faults: list[Replay], how: Asking) -> Replay:
    """All of it in one go, part by part."""
    claims: list[Claim] = []
    owner: list[int] = []
    wrong: list[list[Replay]] = [[] for _ in parts]
    for i, (_, _, told, cases) in enumerate(parts):
        of: list[Claim] = []
        for k, (cell, (grasp, load)) in enumerate(zip(told.cells, cases, strict=True)):
            contradiction = cell.contradiction
            if contradiction is not None:
                wrong[i].append(contradiction)
                continue
            of.append(cell.claim(grasp, load, terms))
            if told.intervals and (cell.due is Verdict.HOLDS or any(told.intervals[k])):
                of.append(IntervalClaim(cell.at("holds_from_zero_to"), grasp, load, terms, *told.intervals[k]))
        claims += of
        owner += [i] * len(of)
    done = asked(claims, how)
    out = []
    for i, (name, what, _, _) in enumerate(parts):
        found = [part for k, told_again in zip(owner, done, strict=True) if k == i for part in told_again]
        out.append(together(name, what, [*wrong[i], *found]))
    return Replay(query, parts=(*faults, *out), not_replayed=(MAP_NOT_REPLAYED,))
