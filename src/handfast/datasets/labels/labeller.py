"""The label of one grasp: what it holds, by how much, and with which commands."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError, require_not_negative, require_positive
from handfast.core.schema import LEFT_OUT, InFiles, Vectors3
from handfast.datasets.labels.label_columns import MEASURES, WRENCHES, LabelColumn, wrench_column
from handfast.datasets.labels.questions import LargestLoad, LeastCommands, Questions, largest_command
from handfast.measures.measuring import measure_columns
from handfast.model.grasp import Grasp
from handfast.stability.answers.load_path import comes_after
from handfast.stability.problem.settings import Loading, Settings

LABEL_DIRECTIONS = (
    (1.0, 0.0, 0.0),
    (-1.0, 0.0, 0.0),
    (0.0, 1.0, 0.0),
    (0.0, -1.0, 0.0),
    (0.0, 0.0, 1.0),
    (0.0, 0.0, -1.0),
)
QUESTION_NODES = 320_000  # of a question of one contact, over the square of the contacts: a node costs as much more
GRASP_NODE_FACTOR = 10  # times the nodes of a question, for all questions about a grasp: nearly all need a hundredth
LABEL_TIME_LIMIT = 600.0  # [s]


@dataclass(frozen=True)
class Labelling:
    """What is asked of every grasp.

    Attributes:
        gravity: directions in which gravity pulls, object axes, any length.
        directions: how many directions of forces the worst is sought among, spread evenly over the sphere.
        g: [m/s^2].
        gap: relative distance of the two bounds at which a number is exact enough.
        nodes: of each question, `GRASP_NODE_FACTOR` times it for all questions about a grasp: what decides where one
            stays open, so that labels do not hang on the clock. None: `QUESTION_NODES` over the square of the contacts.
        timeout: [s] of a grasp, for all its questions: a fuse.
        replay: replay every proof with the independent checker. States are checked in any case; that a load slips, and
            upper bounds, then rest on the search's word. It takes more than ten times as long.
        loading: as of `check`. With "preload-first" maxima are where paths end, weights are held on their paths, and
            no bound of commands is sought.
    """

    gravity: tuple[tuple[float, float, float], ...] = LABEL_DIRECTIONS
    directions: int = 32
    g: float = 9.81
    gap: float = 1e-3
    nodes: float | None = None
    timeout: float = LABEL_TIME_LIMIT
    replay: bool = False
    loading: Loading = "together"

    def __post_init__(self) -> None:
        comes_after(self.loading)
        for v in self.gravity:
            if not (np.isfinite(v).all() and np.linalg.norm(v) > 1e-12):
                raise InputError("is zero or not finite; a direction is needed", field="gravity")
        if not self.gravity:
            raise InputError("is empty; at least one direction is needed", field="gravity")
        if self.directions < 1:
            raise InputError(f"is {self.directions}; at least 1 is needed", field="directions")
        require_positive(self.g, "g")
        if self.nodes is not None and not np.isfinite(self.nodes):
            raise InputError("is not finite; a number above 0 is needed", field="nodes")
        require_positive(self.timeout, "timeout", "a number above 0 [s] is needed")
        self.settings(1)

    def settings(self, contacts: int) -> Settings:
        """Of each question about a grasp, but for its time. One thread: cores are for grasps."""
        nodes = QUESTION_NODES / contacts**2 if self.nodes is None else self.nodes
        return Settings(gap=self.gap, nodes=nodes, jobs=1, verify=self.replay)

    @property
    def questions(self) -> LabelQuestions:
        """The same with the directions written out."""
        pulls = np.array([np.array(v) / np.linalg.norm(v) for v in self.gravity])
        limits = self.nodes, self.timeout, self.replay, self.loading
        return LabelQuestions(pulls, spread(self.directions), self.g, self.gap, *limits)


@dataclass(frozen=True, eq=False)
class LabelQuestions(InFiles):
    """A `Labelling` as the metadata of a table have it: gravity (n, 3) and directions (k, 3) are unit vectors."""

    gravity: Vectors3
    directions: Vectors3
    g: float
    gap: float
    nodes: float | None
    timeout: float
    replay: bool
    loading: Loading = field(default="together", metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        require_positive(self.g, "g")
        require_not_negative(self.gap, "gap")


def spread(count: int) -> Array:
    """(count, 3) unit vectors, evenly spread: a Fibonacci lattice, each the golden angle further about z."""
    k = np.arange(count)
    z, turn = 1 - (2 * k + 1) / count, np.pi * (3 - np.sqrt(5)) * k
    flat = np.sqrt(1 - z * z)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])


def label(grasp: Grasp, labelling: Labelling) -> dict[str, Any]:
    """The label of a grasp: values by column, those of the row and of the dataset left out."""
    start = time.perf_counter()
    settings = labelling.settings(grasp.m)
    ask = Questions(grasp, settings, labelling.timeout, GRASP_NODE_FACTOR * settings.nodes, labelling.loading)
    center = center_of(grasp)
    axes, forces = _axes(ask, center)
    out = described_grasp(grasp) | axes
    if grasp.mass:
        out |= _under_gravity(ask, labelling, grasp.mass * labelling.g, center, forces)
    out |= _worst(ask, spread(labelling.directions), center, forces)
    out |= measured(grasp)
    out |= {"open": ask.open, "stop": str(ask.stop), "nodes": ask.nodes}
    return out | {"status": "labelled", "seconds": time.perf_counter() - start}


def center_of(grasp: Grasp) -> Array:
    """(3,) [m] where disturbances act."""
    return np.zeros(3) if grasp.center_of_mass is None else grasp.center_of_mass


def described_grasp(grasp: Grasp) -> dict[str, Any]:
    """What was labelled."""
    return {
        "contacts": grasp.m,
        "contact_positions": grasp.positions.tolist(),
        "contact_normals": [c.normal.tolist() for c in grasp.contacts],
        "contact_frictions": grasp.mu.tolist(),
        "contact_links": [c.link for c in grasp.contacts],
        "motors": list(grasp.mechanism.actuators),
        "preload": grasp.command.tolist(),
        "mass": grasp.mass,
        "center": center_of(grasp).tolist(),
    }


def _axes(ask: Questions, center: Array) -> tuple[dict[str, Any], dict[tuple[float, ...], LargestLoad]]:
    """The largest disturbances along the axes both ways: columns, and those of forces by direction."""
    wrenches = [axis_wrench(name, center) for name in WRENCHES]
    found = ask.largest(wrenches)
    out: dict[str, Any] = {}
    for name, most in zip(WRENCHES, found, strict=True):
        out |= _bounds(wrench_column(name), most)
    forces = {_key(w[:3]): most for w, most in zip(wrenches, found, strict=True) if w[:3].any()}
    return out, forces


def axis_wrench(name: str, center: Array) -> Array:
    """(6,) the unit disturbance of a name such as "+fx", at the origin."""
    axis = (1.0 if name[0] == "+" else -1.0) * np.eye(3)["xyz".index(name[2])]
    return force_at(axis, center) if name[1] == "f" else np.r_[np.zeros(3), axis]


def measured(grasp: Grasp) -> dict[str, Any]:
    """The classical measures, torques about the centre of mass or, without one, the contacts' middle."""
    said = measure_columns(grasp, only=[c.name for c in MEASURES], passive=False)
    return {c.name: _counted(c, said[c.name]) for c in MEASURES}


def _counted(column: LabelColumn, value: float | bool | None) -> float | int | None:
    if value is None or column.kind == "integer":
        return value if value is None else int(value)
    return _finite(value)


def _under_gravity(
    ask: Questions, labelling: Labelling, weight: float, center: Array, forces: dict[tuple[float, ...], LargestLoad]
) -> dict[str, Any]:
    """Verdicts, the least factor on the weight [N], and the smallest commands where that is least."""
    pulls = [np.array(v) / np.linalg.norm(v) for v in labelling.gravity]
    new = [v for v in pulls if _key(v) not in forces]
    known = forces | dict(zip(map(_key, new), ask.largest([force_at(v, center) for v in new]), strict=True))
    most = [known[_key(v)] for v in pulls]
    # beyond the largest that is resisted nothing is; what is below it may slip all the same, on a path both may be
    maybe = [k for k, m in enumerate(most) if m.upper >= weight or ask.along_paths]
    verdicts = [Verdict.SLIPS] * len(pulls)
    for k, verdict in zip(maybe, ask.held([weight * force_at(pulls[k], center) for k in maybe]), strict=True):
        verdicts[k] = verdict
    most = [  # a weight that is held is a witness, too, where the search for the largest found less within its limits
        replace(m, lower=max(m.lower, min(weight, m.upper))) if v is Verdict.HOLDS else m
        for m, v in zip(most, verdicts, strict=True)
    ]
    loads = [weight * force_at(v, center) for v in pulls]
    order = sorted(range(len(pulls)), key=lambda k: (most[k].lower, most[k].upper, k))
    lost, resisting = ask.resisted_by_none(loads, (k for k in order if verdicts[k] is Verdict.SLIPS))
    # of those that are resisted equally little the hardest is one that no commands resist
    least = (most[order[0]].lower, most[order[0]].upper)
    worst = lost if lost is not None and (most[lost].lower, most[lost].upper) == least else order[0]
    # commands that hold no other direction need not be the least
    smallest = LeastCommands(None, np.inf) if worst == lost else ask.commands(loads[worst], rough=lost is not None)
    if lost is None:
        resisting |= {k: ask.grasp.preload for k, verdict in enumerate(verdicts) if verdict is Verdict.HOLDS}
        held_by, holding = _held_by(ask, loads, all_hold(verdicts), worst, smallest, resisting)
    else:
        held_by, holding = "none", None
    own = ask.grasp.command if verdicts[worst] is Verdict.HOLDS else None
    scaled = LargestLoad(most[worst].lower / weight, most[worst].upper / weight, most[worst].unbounded)
    return (
        _bounds("weight_factor", scaled)
        | {
            "verdict": str(all_hold(verdicts)),
            "verdicts": [str(v) for v in verdicts],
            "held_by": held_by,
            "holding_commands": None if holding is None else holding.tolist(),
            "hardest": pulls[worst].tolist(),
        }
        | _least_commands(ask.grasp, smallest, [c for c in (own, holding) if c is not None])
    )


def _held_by(
    ask: Questions,
    loads: list[Array],
    verdict: Verdict,
    hardest: int,
    smallest: LeastCommands,
    known: dict[int, dict[str, float]],
) -> tuple[str, Array | None]:
    """Which commands resist all loads: a word of `HELD_BY`, and one preload (a,) that does, if one is known.

    Args:
        hardest: of the loads. smallest: commands that resist that one. known: some that resist others, by number.
    """
    if verdict is Verdict.HOLDS:
        return "these", ask.grasp.command
    if verdict is Verdict.UNDECIDED:
        return "undecided", None
    found, preload = ask.one_preload(loads, known, hardest, smallest)
    return {Verdict.HOLDS: "others", Verdict.SLIPS: "none"}.get(found, "undecided"), preload


def _least_commands(grasp: Grasp, smallest: LeastCommands, holding: list[Array]) -> dict[str, Any]:
    """The smallest commands, with others (a,) that are known to hold: no more is said to be needed than is enough."""
    other = np.array([name not in grasp.sought_actuators for name in grasp.mechanism.actuators], dtype=bool)
    same = [c for c in holding if (c[other] == grasp.command[other]).all()]  # of the motors that were asked about
    known = [*same, *([] if smallest.commands is None else [smallest.commands])]
    least = min(known, key=lambda c: largest_command(grasp, c), default=None)
    upper = np.inf if least is None else largest_command(grasp, least)
    lower = min(smallest.lower, upper)
    shown = lower > 0 or upper == 0
    return {
        "commands": None if least is None else least.tolist(),
        "largest_command": _finite(upper),
        "largest_command_lower": _finite(lower) if shown else None,
    }


def all_hold(verdicts: list[Verdict]) -> Verdict:
    if Verdict.SLIPS in verdicts:
        return Verdict.SLIPS
    return Verdict.HOLDS if set(verdicts) == {Verdict.HOLDS} else Verdict.UNDECIDED


def _worst(
    ask: Questions, directions: Array, center: Array, forces: dict[tuple[float, ...], LargestLoad]
) -> dict[str, Any]:
    """The least of the largest forces in these directions (n, 3).

    Where a direction is shown to resist as much as the least so far, its own largest does not matter: a check tells it
    sooner than a maximum, and many checks together sooner than one by one. Those that are likely to be the least come
    first. On paths each has its own: a path to a load may come farther than the one whose end is sought.
    """
    left = np.argsort(_guesses(directions, forces), kind="stable").tolist()
    worst, where = LargestLoad(np.inf, np.inf, False), left[0]
    while left and worst.upper > 0:
        k = left.pop(0)
        most = ask.largest([force_at(directions[k], center)])[0]
        if (most.lower, most.upper) < (worst.lower, worst.upper):
            worst, where = most, k
            if np.isfinite(worst.upper) and not ask.along_paths:
                verdicts = ask.held([worst.upper * force_at(directions[i], center) for i in left])
                left = [i for i, verdict in zip(left, verdicts, strict=True) if verdict is not Verdict.HOLDS]
    return _bounds("worst_force", worst) | {"worst_direction": directions[where].tolist()}


def _guesses(directions: Array, forces: dict[tuple[float, ...], LargestLoad]) -> Array:
    """(n,) what a grasp might resist in directions (n, 3), from what it resists along the axes: only for an order."""
    towards, away = (
        np.array([max(forces[_key(sign * axis)].lower, 1e-12) for axis in np.eye(3)]) for sign in (1.0, -1.0)
    )
    return 1 / (np.maximum(directions, 0.0) / towards + np.maximum(-directions, 0.0) / away).sum(axis=1)


def force_at(direction: Array, at: Array) -> Array:
    """(6,) the wrench of a force (3,) at a point (3,), at the origin."""
    (a, b, c), (x, y, z) = at.tolist(), direction.tolist()
    return np.array([x, y, z, b * z - c * y, c * x - a * z, a * y - b * x])


def _key(v: Array) -> tuple[float, ...]:
    return tuple((v + 0.0).tolist())  # no -0


def _bounds(name: str, most: LargestLoad) -> dict[str, Any]:
    return {name: _finite(most.lower), f"{name}_upper": _finite(most.upper)}


def _finite(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
