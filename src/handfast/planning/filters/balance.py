"""Statics alone: could contact forces within the friction cones balance a load, or each other?

Necessary conditions of (1) to (8), cheap to ask: where forces would have to leave their cones, they say by how much,
which tells a search in which direction to go. That forces are possible does not mean that they arise passively.
A load is asked of a grasp; a squeeze, of points that are to be touched, before there is a hand.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import cross_rows
from handfast.model.body import Body
from handfast.model.grasp import Grasp
from handfast.proofs.few_contacts import Held
from handfast.proofs.solids import ConvexSolid
from handfast.stability.problem.loads import Loads

PYRAMID_EDGES = 8  # of the pyramid in each friction cone, of a soft finger on each circle of latitude
LATITUDES = (0.0, 40.0, -40.0)  # [deg] of those circles, the last two half a step on; the poles are edges, too
BALANCE_SHARE = 1e-6  # share of a wrench below which it counts as balanced
SEPARATED = 1e-9  # of what is missing: a force along an edge that helps more than this shows that it was not all tried
MIN_TORQUE_ARM = 1e-9  # [m] contacts that are no further apart, or a single one from the origin, give torques no unit
LEAST_PUSH = 0.08  # of the squeezing force: a point that would carry less is left out of the first look

# --- pyramids ---------------------------------------------------------------------------------------


def rim(edges: int = PYRAMID_EDGES, *, soft: bool = False) -> Array:
    """(M, 3) where the edges of a pyramid in a cone with a normal force of 1 are: two tangents and torsion, each over
    its coefficient. Unit vectors: on a circle, of soft fingers on a sphere.
    """
    angle, circles = 2 * np.pi / edges * np.arange(edges), []
    for height in np.radians(LATITUDES) if soft else (0.0,):
        on = angle + np.pi / edges * (height != 0)
        circles.append(
            np.stack([np.cos(height) * np.cos(on), np.cos(height) * np.sin(on), np.sin(height) + 0 * on], axis=1)
        )
    return np.vstack([*circles, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]] if soft else circles)


@lru_cache
def circumscribed(edges: int = PYRAMID_EDGES, *, soft: bool = False) -> float:
    """The factor on friction and torsion with which the pyramids hold the cones."""
    from scipy.spatial import ConvexHull

    if not soft:
        return float(1 / np.cos(np.pi / edges))
    return float(-1 / ConvexHull(rim(edges, soft=True)).equations[:, -1].max()) * (1 + 1e-12)


# --- loads ------------------------------------------------------------------------------------------


def imbalance(grasp: Grasp, wrenches: Array, friction: float = 1.0) -> Array:
    """(k,) share of each wrench (k, 6) that no forces within the friction cones balance: 0 none, 1 all of it.

    Torques are divided by the grasp's size, by 1 m if that is below `MIN_TORQUE_ARM`. The cones are inscribed pyramids
    of 8 edges, those of soft fingers of 26. Where it is not 0, what is missing separates the wrench from all that such
    forces make (Farkas), which is checked.

    Args:
        friction: factor on every coefficient, torsion included: what is left with half the friction is a margin; with
            `circumscribed` the pyramids hold the cones.
    """
    from scipy.optimize import nnls

    A, scale = _edges(grasp, friction)
    out = np.zeros(len(wrenches))
    for k, w in enumerate(np.asarray(wrenches, dtype=float) * scale):
        size = float(np.linalg.norm(w))
        if size > 0:
            x, missing = nnls(A, -w / size)
            if missing > BALANCE_SHARE and (A.T @ (-w / size - A @ x)).max() <= SEPARATED * missing:
                out[k] = missing
    return out


def balances(grasp: Grasp, wrenches: Array) -> bool:
    """Whether forces within the friction cones can balance every wrench (k, 6), whatever the joints do.

    Necessary for every passive resistance; that they cannot is shown, see `imbalance`.
    """
    return not imbalance(grasp, wrenches, circumscribed(soft=len(grasp.soft) > 0)).any()


def friction_margin(grasp: Grasp, wrenches: Array) -> float:
    """The share of the friction without which forces could still balance every wrench (k, 6): 0 to 1, 0 if not at all.

    A margin of statics, in steps of 1/64; it says nothing of whether the forces arise passively.
    """
    low, high = 0, 64  # sixty-fourths of the friction: balanced with `high`, not known below
    if imbalance(grasp, wrenches).any():
        return 0.0
    while high - low > 1:
        middle = (low + high) // 2
        if imbalance(grasp, wrenches, middle / 64).any():
            low = middle
        else:
            high = middle
    return 1.0 - high / 64


def _edges(grasp: Grasp, friction: float) -> tuple[Array, Array]:
    """(6, M) unit wrenches of forces along the edges of the pyramids; (6,) the scale that they are in."""
    scale, soft = np.array([1.0] * 3 + [1 / grasp.size if grasp.size > MIN_TORQUE_ARM else 1.0] * 3), grasp.soft
    G = (scale[:, None] * grasp.G).reshape(6, -1, 3)
    hard = np.delete(np.arange(grasp.m), soft)
    parts = []
    for its, edges in ((hard, rim()), (soft, rim(soft=True))):
        rays = np.concatenate([np.ones((1, len(its), len(edges))), np.zeros((2, len(its), len(edges)))])
        rays[1:] = edges[:, :2].T[:, None] * (friction * grasp.mu[its])[:, None]
        parts.append(np.einsum("wmi,ime->wme", G[:, its], rays))
    torsion = scale[:, None] * grasp.twist_map * (friction * grasp.mu[soft])  # over the lever, as `twist_map` takes it
    parts[1] = parts[1] + torsion[..., None] * rim(soft=True)[:, 2]
    A = np.concatenate([part.reshape(6, -1) for part in parts], axis=1)
    return A / np.linalg.norm(A, axis=0), scale


def held_by_contacts(
    body: Body, loads: Loads, force_limit: float = np.inf, friction: float | None = None, torsion: float = 0.0
) -> Held:
    """An object and loads, to ask how many contacts on its surface they take at least: `Held.fewest`.

    Args:
        force_limit: [N] largest normal force at a contact. friction: coefficient; None for the object's.
        torsion: [m] of soft fingers; 0 for point contacts.
    """
    none = np.zeros((0, 3))
    solids = [
        ConvexSolid("mesh", (), np.eye(4), *s.triangles())
        if s.kind in ("box", "mesh")
        else ConvexSolid(s.kind, s.size, s.pose, none, none.astype(np.int64))
        for s in body.pieces
    ]
    center, mu = np.asarray(body.center_of_mass, dtype=float), body.friction if friction is None else friction
    return Held(tuple(solids), center, loads.wrenches, mu, force_limit, torsion)


# --- limited forces --------------------------------------------------------------------------------


def least_load_factor(
    points: Array,
    normals: Array,
    friction: float,
    limits: Array,
    loads: Array,
    *,
    least: float = 0.0,
    torsion: float = 0.0,
) -> float:
    """The largest factor at which forces in inscribed pyramids balance every load (k, 6), each alone; see below.

    least: one that is not larger need not be the least of all loads.
    """
    found = np.inf
    for load in loads:
        found = min(found, load_factor(points, normals, friction, limits, load, torsion=torsion)[0])
        if found <= least:
            break
    return found


def load_factor(
    points: Array,
    normals: Array,
    friction: float,
    limits: Array,
    load: Array,
    edges: int = PYRAMID_EDGES,
    torsion: float = 0.0,
) -> tuple[float, Array]:
    """The largest factor at which contact forces balance a load (6,), and the twist (6,) of the object that shows it.

    A linear program, solved in its dual form: of all twists on which the load does a work of 1, that on which the
    forces can do least against it. Where no limit of forces counts, the factor is inf and the twist 0.

    Args:
        points, normals: (K, ..., 3) [m], inward; forces of a contact with several may be at any of them.
        friction: coefficient; the cones are inscribed pyramids of so many edges (`rim`).
        torsion: [m] of soft fingers; 0 for point contacts. limits: (K,) [N] of the normal forces, inf for none.
    """
    from scipy.optimize import linprog

    K, everywhere = len(points), points.reshape(-1, 3)
    center = everywhere.mean(axis=0)
    size = max(float(np.linalg.norm(everywhere - center, axis=1).max()), MIN_TORQUE_ARM)
    wrenches = pyramid_wrenches(points, normals, friction, center, size, edges, torsion)
    own = np.r_[load[:3], (load[3:] - np.cross(center, load[:3])) / size]
    length, limited = float(np.linalg.norm(own)), np.isfinite(limits)
    if not (length and limited.any()):
        return np.inf, np.zeros(6)
    most = float(limits[limited].max())
    rows = -np.hstack([wrenches.reshape(-1, 6), np.repeat(np.eye(K), wrenches.shape[1], axis=0)])
    cost = np.r_[np.zeros(6), np.where(limited, limits, 0.0) / most]
    ends = [(None, None)] * 6 + [(0.0, None if bound else 0.0) for bound in limited.tolist()]
    due = np.r_[own / length, np.zeros(K)][None]
    done = linprog(cost, A_ub=rows, b_ub=np.zeros(len(rows)), A_eq=due, b_eq=[1.0], bounds=ends)
    if done.status != 0:
        return np.inf, np.zeros(6)
    z = done.x[:6]
    return float(done.fun) * most / length, np.r_[z[:3] - np.cross(z[3:] / size, center), z[3:] / size]


def pyramid_wrenches(
    points: Array,
    normals: Array,
    friction: float,
    center: Array,
    size: float,
    edges: int = PYRAMID_EDGES,
    torsion: float = 0.0,
) -> Array:
    """(K, M, 6) about a centre, torques over a size: forces of normal part 1 along edges of pyramids about normals.

    points, normals: (K, ..., 3). torsion: [m] of soft fingers; 0 for point contacts.
    """
    first = cross_rows(normals, np.eye(3)[np.abs(normals).argmin(axis=-1)])
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    one, two, turn = (a.reshape(-1, *[1] * normals.ndim) for a in rim(edges, soft=torsion > 0).T)
    around = one * first + two * cross_rows(normals, first)
    force = normals + friction * around
    torque = cross_rows((points - center) / size, force) + turn * (torsion / size) * normals
    out = np.concatenate([force, torque], axis=-1)
    return np.asarray(np.moveaxis(out, 0, 1).reshape(len(points), -1, 6))


# --- squeezes ---------------------------------------------------------------------------------------


def squeeze_imbalance(points: Array, normals: Array) -> Array:
    """(m,) how far k pushes along the inward normals are from balance, for m tuples; inf if one would have to pull.

    The pushes w sum to 1 and minimise |sum w n|^2 + |sum w (p - c) x n|^2 / s^2 about the middle c of the points,
    with s their mean distance from it: roughly the friction coefficient that makes up for the rest.

    Args:
        points: (m, k, 3) [m].
        normals: (m, k, 3) inward unit normals.
    """
    k = points.shape[1]
    arms = points - points.mean(axis=1, keepdims=True)
    size = np.maximum(np.linalg.norm(arms, axis=2).mean(axis=1), 1e-9)
    wrench = np.concatenate([normals, np.cross(arms, normals) / size[:, None, None]], axis=2)
    gram = wrench @ wrench.swapaxes(1, 2) + 1e-6 * np.eye(k)
    w = np.linalg.solve(gram, np.ones((*gram.shape[:2], 1)))[..., 0]
    w /= w.sum(axis=1, keepdims=True)
    rest = np.linalg.norm(np.einsum("mk,mkj->mj", w, wrench), axis=1)
    return np.where((w > LEAST_PUSH).all(axis=1), rest, np.inf)


def squeeze_margin(points: Array, normals: Array, friction: float) -> float:
    """How far within their friction cones balanced forces can be, relative to the friction: up to 1, below 0 if none.

    The largest t with sum c = 0, sum p x c = 0, sum c_n = 1 and |c_t| <= mu c_n - t at each of the k points, times
    k / mu. The circles are replaced by polygons inside them, so it is never too large. Positive means equilibrium with
    every contact strictly within its cone: force closure for three contacts that are not on a line and more (Nguyen
    1988), and for two up to turning about the line between them.

    Args:
        points: (k, 3) [m].
        normals: (k, 3) inward unit normals.
        friction: coefficient, positive.
    """
    from scipy.optimize import linprog

    k = len(points)
    arms = points - points.mean(axis=0)
    size = max(float(np.linalg.norm(arms, axis=1).mean()), 1e-9)
    balance, inside = np.zeros((7, 3 * k + 1)), np.zeros((PYRAMID_EDGES * k, 3 * k + 1))
    around = np.arange(PYRAMID_EDGES) * 2 * np.pi / PYRAMID_EDGES
    shrunk = np.cos(np.pi / PYRAMID_EDGES)
    for i, n in enumerate(normals):
        e1 = np.cross(n, np.eye(3)[np.abs(n).argmin()])
        e1 /= np.linalg.norm(e1)
        axes = np.array([n, e1, np.cross(n, e1)])
        own = slice(3 * i, 3 * i + 3)
        balance[:3, own] = axes.T
        balance[3:6, own] = np.cross(arms[i] / size, axes).T
        balance[6, 3 * i] = 1.0
        rows = slice(PYRAMID_EDGES * i, PYRAMID_EDGES * (i + 1))
        inside[rows, own] = np.column_stack(
            [np.full(PYRAMID_EDGES, -friction * shrunk), np.cos(around), np.sin(around)]
        )
        inside[rows, -1] = shrunk
    target = np.zeros(7)
    target[6] = 1.0
    cost = np.zeros(3 * k + 1)
    cost[-1] = -1.0
    bounds = [(0.0, None), (None, None), (None, None)] * k + [(-1.0, None)]
    found = linprog(cost, A_ub=inside, b_ub=np.zeros(len(inside)), A_eq=balance, b_eq=target, bounds=bounds)
    return float(-found.fun * k / friction) if found.status == 0 else -1.0
