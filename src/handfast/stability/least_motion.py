"""The equilibrium that moves least, from any equilibrium of the same question.

A witness may move farther than it has to: an object that turns freely about a line, a finger that swings far from
what it does not touch. So the search is asked again for equilibria within ever smaller bounds of the motions at the
contacts. In the states of what it finds (which contacts are open, stick and slide, and where to) the model is linear
but for the cones of sticking contacts, and the least motion there is a linear program. What comes out is judged by the
equations alone. That nothing moves less is the search's word, not proved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from handfast.core.arrays import Array, Mask
from handfast.stability import model
from handfast.stability.goal import ANY_STATE
from handfast.stability.scaled_problem import ScaledPoint, ScaledProblem
from handfast.stability.search.reduced import Reduced, null_space, padded, reduce
from handfast.stability.search.search import Search
from handfast.stability.witness import VALID, Witness

EDGES = 16  # of the polygon inside the friction cone of a sticking contact
CUTS = 12  # rounds in which the lengths of motions are approximated more finely,
NEAR = 1e-3  # until they are this exact
WIDER = 4.0  # bounds of motions are tried from the largest contact force on, each so many times the last
NARROW = 1.1  # until a bound within which nothing was found is so near the motion of what was found
NODE_LIMIT, TIME_LIMIT = 2000, 2.0  # of each search; [s]
MOST_BOUNDS = 255  # that a search tells apart
_GOLDEN = (1 + 5**0.5) / 2
# (6, 3) the six axes of an icosahedron: bounds along them are nearly a ball, however contact frames are turned
AXES = np.array(
    [(0, 1, _GOLDEN), (0, -1, _GOLDEN), (1, _GOLDEN, 0), (-1, _GOLDEN, 0), (_GOLDEN, 0, 1), (_GOLDEN, 0, -1)]
)
AXES /= np.hypot(1, _GOLDEN)


def least_motion(p: ScaledProblem, found: Witness) -> Witness:
    """A witness of the same question whose `largest_motion` is not larger, and as small as the searches find.

    Args:
        p: the scaled question of a `check`.
        found: an exact equilibrium of it.
    """
    best = _refined(p, found)
    r = reduce(p, ANY_STATE)
    if len(r.lo) + 2 * p.sizes[0] * len(AXES) > MOST_BOUNDS:
        return best
    low, high = 0.0, np.inf  # nothing was found within the one, something within the other
    bound = max(float(np.abs(found.state.c).max()) / p.force, NEAR)
    while high > NARROW * low and NARROW * max(low, NEAR) < best.largest_motion / p.force:
        other = _within(r, bound)
        if other is None:
            low = bound
        else:
            high = bound
            best = min(best, _refined(p, other), key=lambda w: w.largest_motion)
        bound = WIDER * bound if np.isinf(high) else float(np.sqrt(low * high)) if low else bound / WIDER
    return best


def _within(r: Reduced, bound: float) -> Witness | None:
    """An equilibrium whose motions at contacts are at most `bound` (scaled) along each of `AXES`."""
    p = r.p
    motions = np.vstack([np.hstack([p.G.T, np.zeros(p.J.shape)]), np.hstack([p.G.T, -p.J])]) @ r.M
    rows = np.einsum("ak,ikn->ian", AXES, motions.reshape(-1, 3, motions.shape[1])).reshape(-1, motions.shape[1])
    at = 3 * len(p.mu) + len(r.active)  # behind what the model moves, before the balance of energy
    D = np.insert(r.D, at, np.hstack([rows, np.zeros((len(rows), r.D.shape[1] - rows.shape[1]))]), axis=0)
    where = len(r.lo) - (len(r.D) - at)
    narrowed = replace(
        r,
        D=D,
        DT=padded(D[:, : rows.shape[1]].T),
        lo=np.insert(r.lo, where, np.full(len(rows), -bound)),
        hi=np.insert(r.hi, where, np.full(len(rows), bound)),
        names=(*r.names[:where], *(("motion", i) for i in range(len(rows))), *r.names[where:]),
    )
    s = Search(narrowed, gap=1e-3, gap_absolute=0.0, node_limit=NODE_LIMIT, time_limit=TIME_LIMIT, workers=1)
    for _ in s:
        pass
    found = None if s.z is None else r.witness(r.point(s.z))
    return found if found is not None and found.valid else None


@dataclass(frozen=True, eq=False)
class _ContactModes:
    """What each contact and each actuator does.

    Attributes:
        contacts: m of "open", "stick", "slide".
        along: (m, 3) unit, where a sliding contact slides, turning included; of others, where their friction cone has a
            corner.
        turns: (a,) bool.
    """

    contacts: tuple[str, ...]
    along: Array
    turns: Mask

    @classmethod
    def of(cls, p: ScaledProblem, w: Witness) -> _ContactModes:
        """Those of a witness."""
        g, x = w.grasp, w.state
        d = model.sliding(g, model.relative_motion(g, x.r, x.q), model.turning(g, x.r, x.q))
        c = model.friction(g, x.c, x.torsion)
        states = tuple(w.contact_states)
        v = np.where(np.array([s == "stick" for s in states])[:, None], c, d)
        length = np.linalg.norm(v, axis=1)[:, None]
        along = np.where(length > 0, v / np.where(length > 0, length, 1.0), np.array([1.0, 0.0, 0.0]))
        t = p.R @ p.scaled(w.state).q
        tiny = VALID * model.force_scale(w.wrench, w.state.c) / p.force
        return cls(states, along, p.moves & (t > tiny))


def _refined(p: ScaledProblem, found: Witness) -> Witness:
    """The equilibrium of least motion in the same states; the same one if none is better."""
    from scipy.optimize import linprog

    states = _ContactModes.of(p, found)
    A, b, B, h = _equations(p, states)
    n = A.shape[1]
    motions = np.zeros((2, *p.G.T.shape[:1], n))  # of the object, and of it against the finger, at each contact
    motions[:, :, :6] = p.G.T
    motions[1, :, 6 : 6 + p.J.shape[1]] = -p.J
    motions = motions.reshape(-1, 3, n)
    cuts = [rows for k in range(3) for rows in (motions[:, k], -motions[:, k])]
    last = np.eye(n)[-1]
    options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    x = None
    for _ in range(CUTS):
        rows = np.vstack([B, *(cut - last for cut in cuts)])
        out = linprog(last, rows, np.r_[h, np.zeros(len(rows) - len(h))], A, b, (None, None), options=options)
        if out.status != 0:
            break
        x = out.x
        moved = motions @ x
        length = np.linalg.norm(moved, axis=1)
        if length.max() <= (1 + NEAR) * x[-1]:
            break
        far = length > x[-1]
        cuts.append(np.einsum("ik,ikn->in", moved[far] / length[far, None], motions[far]))
    if x is None:
        return found
    _, l, a, _ = p.sizes
    r, q, c, f, coupling, twist = np.split(x[:-1], np.cumsum([6, l, len(p.mu) * 3, a, p.sizes[3]]))
    better = replace(found, state=p.unscale(ScaledPoint(r, q, c, f, coupling, 0.0, twist)))
    sound = better.valid and _within_limits(p, c, f)
    return better if sound and better.largest_motion <= found.largest_motion else found


def _within_limits(p: ScaledProblem, c: Array, f: Array) -> bool:
    """Do scaled forces keep to the limits of forces?"""
    return bool((c[::3] <= p.cn_max * (1 + VALID)).all() and (np.abs(f) <= p.f_max * (1 + VALID)).all())


def _equations(p: ScaledProblem, states: _ContactModes) -> tuple[Array, Array, Array, Array]:
    """A x = b and B x <= h of the scaled model in these states, for x = (r, q, c, f, coupling, twist, largest
    motion)."""
    m, l, a, k = p.sizes
    n = 6 + l + 3 * m + a + k + len(p.soft) + 1
    at = np.cumsum([0, 6, l, 3 * m, a, k, len(p.soft)])
    r, q, c, f, coupling, twist = (slice(i, j) for i, j in pairwise(at))
    I = np.eye(n)

    def block(height: int, **parts: Array) -> Array:
        out = np.zeros((height, n))
        for name, value in parts.items():
            out[:, {"r": r, "q": q, "c": c, "f": f, "coupling": coupling, "twist": twist}[name]] = value
        return out

    D, C, F, T = block(3 * m, r=p.G.T, q=-p.J), I[c], I[f], block(a, q=p.R)
    balance = [
        (block(6, c=p.G, twist=p.twist_map), -p.w0),  # (1)
        (block(l, c=p.J.T, f=-p.R.T, coupling=-p.A.T, twist=p.twist_jacobian.T), p.torque),  # (2)
        (block(k, q=p.A), np.zeros(k)),
    ]
    equal = [row for rows, values in balance for row in zip(rows, values, strict=True)]
    below: list[tuple[Array, float]] = []

    for j in range(a):  # (8)
        if states.turns[j]:
            equal.append((F[j], p.f_c[j]))
            below.append((-T[j], 0.0))
        else:
            equal.append((T[j], 0.0))
            if p.moves[j]:
                below.append((-F[j], -p.f_c[j]))
        if np.isfinite(p.f_max[j]):
            below += [(F[j], p.f_max[j]), (-F[j], p.f_max[j])]

    cos, sin = np.cos(p.eta), np.sin(p.eta)
    edges = np.pi * (2 * np.arange(EDGES) + 1) / EDGES
    turning = block(len(p.soft), r=p.twist_map.T, q=-p.twist_jacobian)
    twists = dict(zip(p.soft.tolist(), I[twist], strict=True))
    spins = dict(zip(p.soft.tolist(), turning, strict=True))
    for i, (state, u) in enumerate(zip(states.contacts, states.along, strict=True)):
        d_n, d_t, c_n, c_t, mu = D[3 * i], D[3 * i + 1 : 3 * i + 3], C[3 * i], C[3 * i + 1 : 3 * i + 3], p.mu[i]
        if i in twists:
            d_t, c_t = np.vstack([d_t, spins[i]]), np.vstack([c_t, twists[i]])
        else:
            u = u[:2]
        across = null_space(u[None]).T
        if state == "open":  # with u . d_t in place of |d_t|, which is no smaller
            equal += [(row, 0.0) for row in (c_n, *c_t)]
            below.append((-(cos * d_n + sin * u @ d_t), 0.0))
            continue
        below.append((-c_n, 0.0))
        if np.isfinite(p.cn_max):
            below.append((c_n, p.cn_max))
        if state == "slide" and p.mdp:
            equal += [(row, 0.0) for row in across @ d_t]
            below.append((-(u @ d_t), 0.0))
            equal.append((c_n + cos * d_n + sin * (u @ d_t), 0.0))
            equal += [(row, 0.0) for row in c_t + mu * np.outer(u, c_n)]
            continue
        equal.append((c_n + cos * d_n, 0.0))
        if p.mdp:
            equal += [(row, 0.0) for row in d_t]
        if i in twists:  # an octahedron inside of the ball, with a corner along u
            sides = [u + s * across[0] + t * across[1] for s in (1, -1) for t in (1, -1)]
            below += [(e @ c_t - mu * c_n, 0.0) for side in sides for e in (side, side - 2 * u)]
            continue
        for angle in edges:
            e = np.cos(angle) * u + np.sin(angle) * across[0]
            below.append((e @ c_t - np.cos(np.pi / EDGES) * mu * c_n, 0.0))

    A, b = np.array([row for row, _ in equal]), np.array([value for _, value in equal])
    B, h = np.array([row for row, _ in below]).reshape(-1, n), np.array([value for _, value in below])
    return A, b, B, h
