"""Many maxima at once: maps of resisted forces (Figs 6, 8, 10) and sweeps over a preload (Fig. 12)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from handfast.core.answer import Stop, Verdict, header
from handfast.core.arrays import Array, Mask, frozen
from handfast.core.errors import InputError, kinds_checked, unknown_name
from handfast.core.presented import Presented
from handfast.model.grasp import Grasp
from handfast.proofs.replay import Replay
from handfast.readers.grasp_file import to_dict
from handfast.stability.answers import MaxAnswer
from handfast.stability.answers.answer import finite
from handfast.stability.answers.batch_answer import BatchAnswer
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.grasp_limits import AskedWith
from handfast.stability.problem.scaled_problem import as_wrench
from handfast.stability.studies.batch import BatchOptions, OnItem, max_many

if TYPE_CHECKING:
    from handfast.stability.search.interval_search import ResistedInterval

Plane = Literal["xy", "xz", "yz"]
NO_PROOFS = "maps and sweeps keep no witnesses and certificates; `handfast.verify(answer, replay=True)` asks again"
MAX_MAP_DIRECTIONS = 1_000_000  # directions
PLANES: tuple[Plane, ...] = ("xy", "xz", "yz")


@dataclass(frozen=True, eq=False)
class Curve:
    """Maxima over a list of cases.

    Attributes:
        lower, upper: (n,) bounds of the maximum; nan where a case was not reached.
        unbounded: (n,) bool.
        verdicts, stops: (n,) of `Verdict` and `Stop`.
        intervals: (n,) which smaller magnitudes are resisted, None where none is; empty if that was not asked.
    """

    lower: Array
    upper: Array
    unbounded: Mask
    verdicts: tuple[Verdict, ...]
    stops: tuple[Stop, ...]
    intervals: tuple[ResistedInterval | None, ...] = ()

    @classmethod
    def of(cls, answers: Sequence[MaxAnswer | None]) -> Curve:
        """From answers one by one; None is a case that an interruption left out."""
        return cls(
            lower=np.array([a.lower if a else np.nan for a in answers]),
            upper=np.array([a.upper if a else np.nan for a in answers]),
            unbounded=np.array([bool(a and a.unbounded) for a in answers], dtype=bool),
            verdicts=tuple(a.verdict if a else Verdict.UNDECIDED for a in answers),
            stops=tuple(a.stop if a else Stop.INTERRUPTED for a in answers),
        )

    @classmethod
    def of_rows(cls, answers: BatchAnswer, rows: tuple[Any, ...]) -> Curve:
        """Of some rows of maxima; those that an interruption left out are undecided."""
        pick = np.arange(answers.verdict.size).reshape(answers.shape)[rows].ravel()
        return cls(
            lower=answers.lower[rows],
            upper=answers.upper[rows],
            unbounded=answers.unbounded[rows],
            verdicts=tuple(Verdict(v) if v else Verdict.UNDECIDED for v in answers.verdict[rows].tolist()),
            stops=tuple(Stop(s) if s else Stop.INTERRUPTED for s in answers.stop[rows].tolist()),
            intervals=tuple(answers.intervals[i] for i in pick) if answers.intervals is not None else (),
        )

    def to_json(self) -> dict[str, Any]:
        return {
            "lower": [finite(x) for x in self.lower],
            "upper": [finite(x) for x in self.upper],
            "unbounded": self.unbounded.tolist(),
            "verdicts": [str(v) for v in self.verdicts],
        } | self._intervals_json()

    def _intervals_json(self) -> dict[str, Any]:
        if not self.intervals:
            return {}
        return {
            "holds_from_zero_to": [i.holds_from_zero_to if i else 0.0 for i in self.intervals],
            "holes": [[list(r) for r in i.holes] if i else [] for i in self.intervals],
            "unproved": [[list(r) for r in i.unproved] if i else [] for i in self.intervals],
        }


def of_all(verdicts: Sequence[Verdict]) -> Verdict:
    """HOLDS if all are, SLIPS if any is, else UNDECIDED."""
    return next((v for v in (Verdict.SLIPS, Verdict.UNDECIDED) if v in verdicts), Verdict.HOLDS)


class _Curves(Presented):
    """The verdict and stop of an answer that consists of curves."""

    grasp: Grasp
    terms: AskedWith
    curves: tuple[Curve, ...]

    def question_json(self) -> dict[str, Any]:
        """What all of it was asked with."""
        return {"grasp": to_dict(self.grasp)} | self.terms.to_json()

    def verify(self) -> Replay:
        """Nothing of it can be replayed: curves keep neither witnesses nor certificates."""
        return Replay("curves", "", NO_PROOFS, not_replayed=(f"lower, upper, unbounded, verdicts: {NO_PROOFS}",))

    @property
    def verdict(self) -> Verdict:
        """HOLDS if something is resisted in every case, SLIPS if nothing is in some, UNDECIDED if that is not known.

        Of a map, with the grasp's preload if it has one.
        """
        return of_all(self.verdicts)

    @property
    def verdicts(self) -> list[Verdict]:
        """Of every case."""
        return [v for c in self.judged for v in c.verdicts]

    @property
    def judged(self) -> tuple[Curve, ...]:
        """The curves of the grasp as it is."""
        return self.curves

    @property
    def stop(self) -> Stop:
        """The most telling stop of all cases."""
        stops = [s for c in self.curves for s in c.stops]
        order = (Stop.INTERRUPTED, Stop.TIME, Stop.NODES, Stop.NUMERICAL, Stop.RESOLUTION)
        return next((s for s in order if s in stops), Stop.COMPLETE)


@dataclass(frozen=True, eq=False)
class MapAnswer(_Curves):
    """The resisted forces in a plane of the object frame, without and with the preload.

    Attributes:
        plane: "xy", "xz" or "yz".
        directions: (n, 3) unit forces.
        passive: the curve with every actuator locked.
        preloaded: the curve with the grasp's preload; None if it has none.
        at: (3,) [m] the point of the object at which the forces act, object frame.
        terms: limits, law and gap as asked.
    """

    grasp: Grasp
    plane: Plane
    directions: Array
    passive: Curve
    preloaded: Curve | None
    seconds: float
    nodes: int
    at: Array = field(default_factory=lambda: np.zeros(3))
    terms: AskedWith = field(default=AskedWith(), repr=False)

    @property
    def eta(self) -> float:
        """[rad] uncertainty of the contact normals."""
        return self.terms.limits.eta

    @property
    def curves(self) -> tuple[Curve, ...]:  # type: ignore[override]
        return (self.passive, *([self.preloaded] if self.preloaded else []))

    @property
    def judged(self) -> tuple[Curve, ...]:
        return self.curves[-1:]

    def to_json(self) -> dict[str, Any]:
        return header(self, "map") | {
            "question": self.question_json(),
            "plane": self.plane,
            "at": self.at.tolist(),
            "eta": float(np.degrees(self.eta)),
            "directions": self.directions.tolist(),
            "preload": self.grasp.preload,
            "without_preload": self.passive.to_json(),
            "with_preload": self.preloaded.to_json() if self.preloaded else None,
        }


@dataclass(frozen=True, eq=False)
class SweepAnswer(_Curves):
    """The maxima in some directions while one actuator's command grows.

    Attributes:
        actuator: whose command varies.
        values: (n,) commands [N m or N].
        directions: (k, 6) disturbances.
        curves: one per direction, over the values.
        terms: limits, law and gap as asked.
    """

    grasp: Grasp
    actuator: str
    values: Array
    directions: Array
    curves: tuple[Curve, ...]
    seconds: float
    nodes: int
    terms: AskedWith = field(default=AskedWith(), repr=False)

    def to_json(self) -> dict[str, Any]:
        return header(self, "sweep") | {
            "question": self.question_json(),
            "joint": self.actuator,
            "directions": self.directions.tolist(),
            "rows": [
                {
                    "preload": float(value),
                    "lower": [finite(c.lower[i]) for c in self.curves],
                    "upper": [finite(c.upper[i]) for c in self.curves],
                    "unbounded": [bool(c.unbounded[i]) for c in self.curves],
                }
                for i, value in enumerate(self.values)
            ],
        }


def ask_map(
    grasp: Grasp,
    plane: Plane = "xy",
    *,
    at: Sequence[float] | Array = (0.0, 0.0, 0.0),
    steps: int = 360,
    interval: bool = False,
    on_progress: OnItem | None = None,
    **options: Any,
) -> MapAnswer:
    """What `handfast.force_map` answers, whose arguments and errors these are."""
    if plane not in PLANES:
        raise InputError(f"is '{plane}'; one of {', '.join(PLANES)} is needed", field="plane")
    if not 1 <= steps <= MAX_MAP_DIRECTIONS:
        raise InputError(f"is {steps}; 1 to {MAX_MAP_DIRECTIONS} directions are possible", field="steps")
    point = frozen(at, (3,), "at")
    directions = in_plane(plane, steps)
    grasps = [grasp.with_preload(None), *([grasp] if grasp.preload else [])]
    wrenches = forces_at(point, directions)
    # the first two span the others: bad input's one line is raised here, not half way through
    asked = _asked(grasps[0], wrenches[:2], options)
    start = time.monotonic()
    answers = max_many(grasps, wrenches, interval=interval, on_progress=on_progress, **vars(asked))
    return MapAnswer(
        grasp=grasp,
        plane=plane,
        directions=directions,
        passive=Curve.of_rows(answers, (0,)),
        preloaded=Curve.of_rows(answers, (1,)) if grasp.preload else None,
        seconds=time.monotonic() - start,
        nodes=int(answers.nodes.sum()),
        at=point,
        terms=AskedWith(asked.limits, gap=asked.settings.gap, loading=asked.loading),
    )


def _asked(grasp: Grasp, directions: Array, options: dict[str, Any]) -> BatchOptions:
    """The options of curves, which keep no proofs, so that none is replayed; refuses directions that cannot be."""
    asked = BatchOptions(**options)
    for w in directions:
        scaled_problem.build(grasp, np.zeros(6), w, limits=asked.limits)
    return replace(asked, settings=replace(asked.settings, verify=False))


def in_plane(plane: Plane, steps: int) -> Array:
    """(steps, 3) unit vectors, evenly spaced, from the plane's first axis towards its second."""
    angles = 2 * np.pi * np.arange(steps) / steps
    i, j = ("xyz".index(axis) for axis in plane)
    directions = np.zeros((steps, 3))
    directions[:, i], directions[:, j] = np.cos(angles), np.sin(angles)
    directions[np.abs(directions) < 1e-12] = 0.0
    return directions


def forces_at(point: Array, directions: Array) -> Array:
    """(n, 6) wrenches of forces (n, 3) that act at a point (3,), at the origin."""
    out: Array = np.hstack([directions, np.cross(point, directions)]) + 0.0  # no -0
    return out


@kinds_checked
def sweep(
    grasp: Grasp,
    actuator: str,
    values: Sequence[float] | Array,
    directions: Sequence[Sequence[float]] | Array,
    *,
    on_progress: OnItem | None = None,
    **options: Any,
) -> SweepAnswer:
    """The largest resisted disturbance while one command varies, the others as in the grasp: Fig. 12.

    Args:
        actuator: whose command varies.
        values: (n,) commands [N m or N].
        directions: (k, 6) disturbances, one curve each; (k, 3) are forces.

    The other arguments and errors are those of `force_map`, and `InputError` for an unknown actuator.
    """
    if actuator not in grasp.mechanism.actuators:
        raise unknown_name("actuator", actuator, grasp.mechanism.actuators, field="joint")
    d = np.array([as_wrench(row, "direction") for row in np.atleast_2d(np.asarray(directions, dtype=float))])
    x = np.asarray(values, dtype=float)
    grasps = [grasp.with_preload(grasp.preload | {actuator: float(value)}) for value in x]
    asked = _asked(grasp, d, options)
    start = time.monotonic()
    answers = max_many(grasps, d, on_progress=on_progress, **vars(asked))
    return SweepAnswer(
        grasp=grasp,
        actuator=actuator,
        values=x,
        directions=d,
        curves=tuple(Curve.of_rows(answers, (slice(None), k)) for k in range(len(d))),
        seconds=time.monotonic() - start,
        nodes=int(answers.nodes.sum()),
        terms=AskedWith(asked.limits, gap=asked.settings.gap, loading=asked.loading),
    )
