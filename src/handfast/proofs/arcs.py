"""States for whole ranges of magnitudes.

An arc is a Bezier curve in the unknowns of a state while the load goes along a straight line. Its range is cut into
pieces. In a piece the unknowns follow the curve's tangent at the middle, in the modes that the state has there, and
one box contains an exact state for each magnitude (`newton.Step`): all of the piece is resisted exactly. A piece that
is not proved is halved. Where modes change, something is always left over: magnitudes that are so near an exact one
that their load differs from its load by less than `tolerance.EPS` hold "to 1e-9 of load and commands", by definition.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import comb

import numpy as np

from handfast.proofs.existence import inequalities
from handfast.proofs.fields import Array, BadFile, Fields
from handfast.proofs.grasp import GraspData
from handfast.proofs.newton import NotShown, Step, System
from handfast.proofs.states import Problem, State, choices, modes_of, read_state
from handfast.proofs.tolerance import EPS, load_scale

DEGREE = 12  # at most
PIECES = 400  # that are looked at


@dataclass(frozen=True, eq=False)
class Arc:
    """At first + (last - first) t the state is sum of comb(k, i) t^i (1 - t)^(k - i) controls[i].

    Attributes:
        first, last: magnitudes, 0 <= first < last.
        controls: motions (k + 1, 6 + l) and forces (k + 1, N + 1) of `GraspData.rows`.
    """

    first: float
    last: float
    motions: Array
    forces: Array

    @classmethod
    def of(cls, g: GraspData, first: float, last: float, controls: list[State]) -> Arc:
        """Through the controls' states."""
        forces = np.array([x.forces(g) for x in controls])
        return cls(first, last, np.array([x.motion for x in controls]), forces)

    def at(self, s: float) -> tuple[Array, Array, Array, Array]:
        """Motions, forces, and both per unit of magnitude."""
        k, width = len(self.motions) - 1, self.last - self.first
        t = (s - self.first) / width
        now, slope = bernstein(k, t), k / width * bernstein(k - 1, t)
        steps = (x[1:] - x[:-1] for x in (self.motions, self.forces))
        return now @ self.motions, now @ self.forces, *(slope @ x for x in steps)


def read_arc(f: Fields, g: GraspData) -> Arc:
    """The arc in an object of a file. `BadFile` if it is none."""
    first, last = f.number("first", least=0.0), f.number("last")
    controls = [_control(x, g) for x in f.objects("controls")]
    f.done()
    if not first < last:
        raise BadFile(f"goes from {first:g} to {last:g}; a range of magnitudes is needed", f.place)
    if not 2 <= len(controls) <= DEGREE + 1:
        raise BadFile(f"has {len(controls)} controls; 2 to {DEGREE + 1} are possible", f.place)
    return Arc.of(g, first, last, controls)


def _control(f: Fields, g: GraspData) -> State:
    x = read_state(f, g)
    f.done()
    return x


def bernstein(k: int, t: float) -> Array:
    """(k + 1,) the Bernstein polynomials of degree k."""
    i = np.arange(k + 1)
    out: Array = np.array([comb(k, j) for j in range(k + 1)]) * t**i * (1.0 - t) ** (k - i)
    return out


def unproved(p: Problem, arc: Arc) -> list[tuple[float, float]]:
    """Ranges of the arc's magnitudes of which nothing is proved; none if all of them are resisted.

    p: its load is wrench + magnitude along. All are resisted exactly, but for ranges that are so narrow that they hold
    to 1e-9 of load and commands.
    """
    if is_homogeneous(p) and not arc.motions[0].any() and not arc.forces[0].any() and arc.first == 0:
        # multiples of a state solve the model under multiples of its load
        narrow = _narrow(p, arc.last)
        return [] if _resisted(p, arc, arc.last - narrow, arc.last) else [(arc.first, arc.last)]
    todo, left, looked = [(arc.first, arc.last)], [], 0
    while todo:
        a, b = todo.pop()
        looked += 1
        if looked <= PIECES and _resisted(p, arc, a, b):
            continue
        m = a + (b - a) / 2
        if looked > PIECES or b - a <= _narrow(p, a) / 4 or not a < m < b:
            left.append((a, b))
        else:
            todo += [(m, b), (a, m)]
    joined: list[tuple[float, float]] = []
    for a, b in sorted(left):
        if joined and a <= joined[-1][1]:
            joined[-1] = joined[-1][0], b
        else:
            joined.append((a, b))
    # beside what is left something exact has to be, as near as that
    return [(a, b) for a, b in joined if b - a > _narrow(p, a) or (a == arc.first and b == arc.last)]


def is_homogeneous(p: Problem) -> bool:
    """Does nothing act whose size is given, so that multiples of states are states?"""
    g = p.grasp
    acts = p.wrench.any() or g.command.any() or g.torque.any() or g.friction.any() or p.drive is not None
    return not acts


def _narrow(p: Problem, s: float) -> float:
    """By how much magnitudes near s may differ, so that their loads differ by `EPS` of the load."""
    along = p.along if p.along is not None else np.zeros(6)
    scales = load_scale(p.grasp, p.wrench + s * along) if (p.wrench + s * along).any() else 0.0
    return EPS * scales / load_scale(p.grasp, along) / 2


def _resisted(p: Problem, arc: Arc, a: float, b: float) -> bool:
    """Is there an exact state for each magnitude from a to b?"""
    middle = a + (b - a) / 2
    v, phi, v_slope, phi_slope = arc.at(middle)
    here, x = replace(p, magnitude=middle), State.of(p.grasp, v, phi)
    reach = max(b - middle, middle - a) * (1 + 1e-12)
    try:
        modes = modes_of(p.grasp, {name: kinds[0] for name, kinds in choices(here, x).items()})
        system = System.of(here, modes, x, True, False)
        inequalities(here, modes, system.box(Step(v_slope, phi_slope, reach)))
    except NotShown:
        return False
    return True
