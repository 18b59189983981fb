"""Small mechanisms for the solver of the paper, and what multipliers prove, in exact arithmetic."""

from __future__ import annotations

from fractions import Fraction as F

import numpy as np

from handfast.model.region import Bezier, Cap
from handfast.papers.canonical_equations import canonical, point
from handfast.papers.canonical_system import Canonical
from handfast.papers.linear_programs import LinearRows
from handfast.synthesis.task import ContactPair, PoseBounds, Task
from tests.support.planted import HOME, X, Z, bump, chain, joint, plant, pose


def exact(a) -> list[F]:
    return [F(float(x)) for x in a]


# --- small mechanisms ------------------------------------------------------------------------------------


def finger(height: float, upper: float = 1.4) -> Canonical:
    """One joint, a round tip at 0.2 m, under a plate at a height [m]; the object does not move.

    The tip touches where 0.2 sin q + 0.01 is the height, with its top, once for q in [0, upper] or never.
    """
    hand = chain(("finger", "palm", HOME, [joint("a", Z, 0.0, upper)]))
    tip = Cap(0.2 * X, 0.01, X, 1.5)
    corners = [[[x, height, z] for z in (-0.02, 0.02)] for x in (0.0, 0.2)]
    still = PoseBounds(np.zeros((3, 2)), np.stack([np.eye(3), np.eye(3)], axis=2))
    task = Task.of(hand, (ContactPair("finger", tip, Bezier(np.array(corners))),), pose=still)
    return canonical(task, unit=0.1)


def wall(half_width: float) -> Canonical:
    """The finger of `finger`, free to turn 1.4 rad to both sides, before a wall 0.175 m away.

    The tip touches at q = 0.6 and -0.6, where y is 0.1129 and -0.1129 m; the wall ends at +-half_width.
    """
    hand = chain(("finger", "palm", HOME, [joint("a", Z, -1.4, 1.4)]))
    tip, x = Cap(0.2 * X, 0.01, X, 1.0), 0.01 + 0.2 * np.cos(0.6)
    corners = [[[x, y, z] for y in (-half_width, half_width)] for z in (-0.02, 0.02)]
    still = PoseBounds(np.zeros((3, 2)), np.stack([np.eye(3), np.eye(3)], axis=2))
    return canonical(Task.of(hand, (ContactPair("finger", tip, Bezier(np.array(corners))),), pose=still), unit=0.1)


def touching(system: Canonical, height: float) -> np.ndarray:
    """The solution of `finger` in the variables x."""
    from handfast.papers.patch_form import cap_parameters

    q = np.arcsin((height - 0.01) / 0.2)
    tip = system.task.contact_pairs[0].hand
    assert isinstance(tip, Cap)
    u, v = cap_parameters(tip, np.array([np.sin(q), np.cos(q), 0.0]))
    x = point(system, np.array([q]), HOME, np.array([[u, v, np.cos(q), 0.5]]))
    assert np.abs(system.residual(x)).max() < 1e-12
    return system.expanded.lift(x)


def gripper(seed: int):
    """Two short fingers, one turning and one sliding, with a cap and a patch on an object that is free to move."""
    rng = np.random.default_rng(seed)
    hand = chain(
        ("left", "palm", pose(-0.05 * X), [joint("l", Z, -0.5, 0.5)]),
        ("right", "palm", pose(0.05 * X), [joint("r", X, -0.02, 0.02, type="prismatic")]),
    )
    tip = Cap(0.03 * X, 0.01, X, 1.0)
    planted = plant(hand, [("left", tip, bump(rng, (1, 2))), ("right", bump(rng, (1, 1)), bump(rng, (2, 1)))], rng)
    system = canonical(planted.task, unit=0.1)
    return system, system.expanded.lift(point(system, planted.q, planted.pose, planted.parameters))


def exact_below(rows: LinearRows, y, lower, upper, column=None, sign=1.0) -> F:
    """The bound of `DualBound.below` in rationals."""
    out, d = F(0), [F(0)] * rows.A.shape[1]
    if column is not None:
        d[column] = F(sign)
    for weight, row, lo, hi in zip(exact(y), rows.A.toarray(), rows.lo, rows.hi, strict=True):
        end = lo if weight > 0 else hi
        if weight == 0 or not np.isfinite(end):
            continue
        out += weight * F(float(end))
        for k in np.flatnonzero(row):
            d[k] -= weight * F(float(row[k]))
    for slope, l, u in zip(d, exact(lower), exact(upper), strict=True):
        out += min(slope * l, slope * u)
    return out
