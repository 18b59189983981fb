"""All measures: what each is called, its unit, where it is from, what it takes the hand to be, and how it is asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError, refuse_other_kinds
from handfast.measures import conic_program, energies, wrench_space
from handfast.measures.internal_forces import InternalForces, contact_robustness, grasp_robustness, internal_forces
from handfast.measures.wrench_scale import CONE_EDGES, WrenchScale, edge_forces, edge_wrenches
from handfast.measures.wrench_space import MIN_CLOSURE_MARGIN, force_closure
from handfast.model.grasp import Grasp
from handfast.stability.problem.scaled_problem import beyond_range
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.batch import max_many

ANY_FORCES = "presses at will"  # no joint, motor or command is looked at
MAP = "none, no friction"
NORMALS = "equal pushes"
RIGID_JOINTS = "joints, no motors"
OURS = "joints and commands"
# of each direction's search: a limit that every machine meets at the same place
MEASURE_NODES, MEASURE_GAP = 1000, 1e-2


# --- our own: passive maxima ---


@dataclass(frozen=True, eq=False)
class PassiveMaxima:
    """The largest resisted wrench in twelve directions (stability paper, (23) to (25)), with the grasp's commands.

    Attributes:
        names: of the directions, see `WrenchScale.axes`.
        lower: (12,) [N] shown to be resisted, of a torque divided by the characteristic length; inf if unbounded.
        upper: (12,) [N] no more is resisted.
    """

    names: tuple[str, ...]
    lower: Array
    upper: Array

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            values = np.array(getattr(self, name), dtype=float)  # some may be infinite
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @property
    def worst(self) -> tuple[float, float]:
        """Bounds [N] of the smallest of the maxima: shown to be resisted, and at most."""
        return float(self.lower.min()), float(self.upper.min())

    @property
    def worst_direction(self) -> str:
        """The name of the direction with the smallest maximum that is shown."""
        return self.names[int(np.argmin(self.lower))]


def passive_maxima(
    grasp: Grasp, scale: WrenchScale | None = None, *, settings: Settings | None = None, jobs: int | None = 1
) -> PassiveMaxima:
    """Ask `maximum` in the twelve directions of a scale.

    Args:
        scale: `WrenchScale.of(grasp)` unless given.
        settings: of each search; unless given, bounds within 1 % are enough and 1000 nodes are the most. An interval
            between the bounds is left where that does not suffice.
        jobs: cores to use.
    """
    chosen = scale or WrenchScale.of(grasp)
    names, wrenches = chosen.axes()
    G = chosen.grasp_map(grasp)
    possible = np.array([beyond_range(G, u) is None for u in chosen.scaled(wrenches.T).T])
    asked = settings or Settings(nodes=MEASURE_NODES, gap=MEASURE_GAP, verify=False)
    lower, upper = np.zeros(len(names)), np.zeros(len(names))
    if possible.any():
        found = max_many(grasp, wrenches[possible], settings=asked, jobs=jobs)
        known = found.error == ""  # all of them, unless Ctrl-C came first
        lower[possible] = np.where(found.unbounded, np.inf, np.where(known, found.lower, 0.0))
        upper[possible] = np.where(known & ~found.unbounded, found.upper, np.inf)
    return PassiveMaxima(names, lower, upper)


# --- the list ---


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasureOptions:
    """What measures are made with.

    Attributes:
        edges: of the pyramids that stand for friction cones.
        force_limit: [N] the largest normal force at each contact, where a measure has one.
        torque_limits: of actuators by name; for the largest wrench and the smallest forces alone, which a controller
            chooses.
        settings: of the searches for passive maxima; unless given, 1 % between the bounds is enough and 1000 nodes are
            the most.
        jobs: cores for these.

    Raises:
        InputError: a number of edges or a force that cannot be.
    """

    edges: int = CONE_EDGES
    force_limit: float = 1.0
    torque_limits: Mapping[str, float] = field(default_factory=dict)
    settings: Settings | None = None
    jobs: int | None = 1

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        edge_forces(0.0, self.edges)  # refuses a number that cannot be, whatever is wanted
        if not (np.isfinite(self.force_limit) and self.force_limit > 0):
            raise InputError(f"is {self.force_limit:g}; a force above 0 [N] is needed", field="force_limit")


@dataclass(frozen=True, eq=False)
class MeasuredGrasp(MeasureOptions):
    """A grasp, the choices that its measures are made with, and what several measures share.

    Attributes:
        scale: of all measures but the energies.
        energy_scale: of the energies.
    """

    grasp: Grasp
    scale: WrenchScale
    energy_scale: WrenchScale

    @cached_property
    def G(self) -> Array:
        """(6, 3m) the grasp map in the scale."""
        return self.scale.grasp_map(self.grasp)

    @cached_property
    def H(self) -> Array:
        """(6, 3m) the grasp map in the energies' scale."""
        return self.energy_scale.grasp_map(self.grasp)

    @cached_property
    def cones(self) -> Array:
        """(m, edges, 6) wrenches of the cones' edges in the scale."""
        return edge_wrenches(self.grasp, self.scale, self.edges)

    @cached_property
    def l1(self) -> wrench_space.L1Space:
        return wrench_space.L1Space(self.cones)

    @cached_property
    def closure(self) -> tuple[bool, float]:
        margin = self.l1.closure_margin  # at next to no cost, as the hull is there
        return force_closure(self.cones) if margin is None else (margin > MIN_CLOSURE_MARGIN, margin)

    @cached_property
    def internal(self) -> InternalForces:
        return internal_forces(self.grasp, self.G)

    @cached_property
    def units(self) -> Array:
        """(12, 6) the directions of `WrenchScale.axes`, in the scale."""
        return self.scale.scaled(self.scale.axes()[1].T).T

    @cached_property
    def chosen(self) -> Array:
        """(12,) [N] the largest wrench that chosen forces balance in each of the twelve directions."""
        options = {"force": self.force_limit, "torque_limits": self.torque_limits}
        found = [conic_program.largest_wrench(self.grasp, self.G, u, **options) for u in self.units]  # type: ignore[arg-type]
        return np.array(found)

    @cached_property
    def least_forces(self) -> float:
        """[N per N] the largest contact force, of the least ones, against the worst of the twelve."""
        limits = self.torque_limits
        return max(conic_program.smallest_forces(self.grasp, self.G, u, torque_limits=limits) for u in self.units)

    @cached_property
    def passive(self) -> PassiveMaxima:
        return passive_maxima(self.grasp, self.scale, settings=self.settings, jobs=self.jobs)

    @cached_property
    def robust(self) -> tuple[float, tuple[int, ...]]:
        return grasp_robustness(self.grasp, self.G, force=self.force_limit)

    @cached_property
    def q1(self) -> float:
        """Epsilon in the energies' scale."""
        turned = np.column_stack([self.energy_scale.scaled(self.scale.wrench(unit)) for unit in np.eye(6)])
        return self.l1.epsilon_in(turned)


@dataclass(frozen=True)
class Measure:
    """A measure.

    Attributes:
        key: its name in programs and tables.
        name: in words.
        unit: of its value in the scale; "" for a pure number.
        better: is "more" or "less" of it better, or neither ("")?
        assumes: what it takes the hand to be.
        source: authors and year; the full title stands in the docstring of its function and in docs/measures.md.
        value: of a grasp that is asked about. Raises `NotMeasured` where there is none.
    """

    key: str
    name: str
    unit: str
    better: Literal["more", "less", ""]
    assumes: str
    source: str
    value: Callable[[MeasuredGrasp], float | bool]


CATALOGUE: tuple[Measure, ...] = (
    Measure(
        "passive_worst", "passive maximum, worst of 12", "N", "more", OURS,
        "Haas-Heger, Ciocarlie 2020", lambda a: a.passive.worst[0],
    ),
    Measure("epsilon_l1", "epsilon, L1", "N", "more", ANY_FORCES, "Ferrari, Canny 1992", lambda a: a.l1.epsilon),
    Measure(
        "epsilon_linf", "epsilon, L infinity", "N", "more", ANY_FORCES,
        "Ferrari, Canny 1992", lambda a: a.force_limit * wrench_space.linf_epsilon(a.cones),
    ),
    Measure("volume_l1", "volume, L1", "N^6", "more", ANY_FORCES, "Ferrari, Canny 1992", lambda a: a.l1.volume),
    Measure(
        "volume_linf", "volume, L infinity", "N^6", "more", ANY_FORCES,
        "Ferrari, Canny 1992", lambda a: a.force_limit**6 * wrench_space.linf_volume(a.cones),
    ),
    Measure(
        "force_closure", "force closure", "", "more", ANY_FORCES, "Prattichizzo, Trinkle 2008", lambda a: a.closure[0],
    ),
    Measure(
        "closure_margin", "margin of force closure", "", "more", ANY_FORCES,
        "Prattichizzo, Trinkle 2008", lambda a: a.closure[1],
    ),
    Measure(
        "largest_wrench", "largest wrench, worst of 12", "N", "more", ANY_FORCES,
        "Han, Trinkle, Li 2000", lambda a: float(a.chosen.min()),
    ),
    Measure(
        "smallest_forces", "smallest forces, worst of 12", "N/N", "less", ANY_FORCES,
        "Boyd, Wegbreit 2007", lambda a: a.least_forces,
    ),
    Measure(
        "internal_dimension", "internal forces", "dimensions", "", RIGID_JOINTS,
        "Bicchi 1994", lambda a: a.internal.dimension,
    ),
    Measure(
        "controllable_dimension", "that joints control", "dimensions", "more", RIGID_JOINTS,
        "Bicchi 1994", lambda a: a.internal.controllable.shape[1],
    ),
    Measure(
        "passive_dimension", "that no joint changes", "dimensions", "", RIGID_JOINTS,
        "Bicchi 1994", lambda a: a.internal.passive.shape[1],
    ),
    Measure(
        "pcr", "contact robustness PCR", "N", "more", RIGID_JOINTS,
        "Prattichizzo et al. 1997", lambda a: contact_robustness(a.grasp, a.G, force=a.force_limit),
    ),
    Measure(
        "pgr", "grasp robustness PGR", "N", "more", RIGID_JOINTS,
        "Prattichizzo et al. 1997", lambda a: a.robust[0],
    ),
    Measure(
        "smallest_singular_value", "smallest singular value", "", "more", MAP,
        "Li, Sastry 1988", lambda a: wrench_space.smallest_singular_value(a.G),
    ),
    Measure(
        "ellipsoid_volume", "volume of the ellipsoid", "", "more", MAP,
        "Li, Sastry 1988", lambda a: wrench_space.ellipsoid_volume(a.G),
    ),
    Measure("isotropy", "isotropy", "", "more", MAP, "Kim et al. 2001", lambda a: wrench_space.isotropy(a.G)),
    Measure("q1", "Q1, as benchmarks scale it", "N", "more", ANY_FORCES, "Ferrari, Canny 1992", lambda a: a.q1),
    Measure(
        "qp", "wrench error QP", "N", "less", ANY_FORCES,
        "Chen, Ke, Wang 2025", lambda a: energies.wrench_error(a.grasp, a.H),
    ),
    Measure(
        "graspqp", "energy GraspQP", "", "less", ANY_FORCES,
        "Zurbrügg et al. 2025", lambda a: energies.graspqp(a.grasp, a.H),
    ),
    Measure("tdg", "energy TDG", "", "less", NORMALS, "Chen et al. 2023", lambda a: energies.tdg(a.grasp, a.H)),
    Measure("dfc", "energy DFC", "N", "less", NORMALS, "Liu et al. 2021", lambda a: energies.dfc(a.H)),
)  # fmt: skip
MEASURE_KEYS: tuple[str, ...] = tuple(m.key for m in CATALOGUE)
PASSIVE = "passive_worst"
