"""Maxima that are only approached: where a state leads as its virtual motion grows without end.

Many largest magnitudes are no state's: every state resists a little less than one that moves a little more. With the
motions (r, q) = rho / eps, |rho| = 1, and the modes of the contacts and actuators fixed, (1)-(8) read

    G c + w = 0,   eps c_n + d_n(rho) = 0 closed,   c_t + mu c_n d_t(rho) / |d_t(rho)| = 0 sliding,   ...

a square system that is smooth at eps = 0. It is followed from a witness towards eps = 0, as far as rounding allows;
the last step is extrapolated, for the magnitude is linear in eps there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.arrays import Array, Indices, Mask
from handfast.core.transforms import cross
from handfast.model.grasp import Grasp
from handfast.proofs.states import State
from handfast.stability.problem.objective import Objective
from handfast.stability.problem.scaled_problem import ScaledProblem
from handfast.stability.search.reduced import Reduced, reduce

EPSILON_RATIO = 0.25  # of eps from step to step
MIN_EPSILON = 1e-7  # (scaled) eps at which it is extrapolated: 1e-16 / eps is what rounding takes
LIMIT_ITERATIONS = 8
LIMIT_RESIDUAL = 1e-11  # scaled residual
ALLOWED = 1e-9  # (scaled) by which an inequality may be missed
ZERO_MOTION = 1e-7  # (scaled) motions below this are none, or below this share of the largest times MOTION
MIN_MOTION_SHARE = 1e-5
GROWTH_TOLERANCE = 1e-8  # relative: what grows by less does not grow


@dataclass(frozen=True, eq=False)
class Supremum:
    """A largest magnitude that no state attains.

    Attributes:
        value: the limit of the magnitudes [as the direction is given].
        motion: (6,) the object's virtual motion in the limit, of unit length in the grasp's size: translation [m of
            the size], rotation [rad]; object frame, at its origin.
        slides, sticks, opens: contacts that slide in the limit, that stick, that do not touch.
        words: the motion in words.
    """

    value: float
    motion: Array
    slides: tuple[int, ...]
    sticks: tuple[int, ...]
    opens: tuple[int, ...]
    words: str

    def to_json(self) -> dict[str, Any]:
        return {
            "value": self.value,
            "object_motion": self.motion.tolist(),
            "slides": list(self.slides),
            "sticks": list(self.sticks),
            "open": list(self.opens),
            "motion": self.words,
        }


def limit_from(p: ScaledProblem, goal: Objective, state: State, lower: float, upper: float) -> Supremum | None:
    """The limit to which the witness of a maximum leads; `limit_of` in the question's own units.

    state: it resists the magnitude `lower`, under the commands as they are.
    """
    r = reduce(p, goal)
    return limit_of(r, r.at_magnitude(state, lower), upper)


def limit_of(r: Reduced, z: Array, upper: float) -> Supremum | None:
    """The limit to which an exact point z (n,) of a maximum leads; None if the largest magnitude is a state's.

    upper: no magnitude above this is resisted. A limit beyond it is none.
    """
    path = _Path.of(r, z)
    if path is None:
        return None
    found = path.follow()
    if found is None:
        return None
    scalar, rho = found
    value, first = r.goal.magnitude(r.p, scalar), r.goal.magnitude(r.p, r.scalar(z))
    if not first * (1 - GROWTH_TOLERANCE) <= value <= upper * (1 + ALLOWED):
        return None
    p, x = r.p, r.M @ rho
    motion = p.lengths * x[:6]
    d = _speeds(r, r.D[:, : len(rho)] @ rho)
    slides = path.slides & (d > MIN_MOTION_SHARE)
    return Supremum(
        value=float(value),
        motion=motion / np.linalg.norm(x[:6]) if x[:6].any() else motion,
        slides=tuple(np.flatnonzero(slides).tolist()),
        sticks=tuple(np.flatnonzero(path.closed & ~slides).tolist()),
        opens=tuple(np.flatnonzero(~path.closed).tolist()),
        words=words_of(p.grasp, motion, slides, path.closed),
    )


def _tangents(r: Reduced, i: int) -> tuple[Indices, Indices]:
    """Which base values are friction of contact i, and its sliding: two components, of a soft finger three."""
    s = r.soft_fingers[i]
    more = [[] if s < 0 else [int(first + s)] for first in (r.question.twist, r.question.turning)]
    return np.array([3 * i + 1, 3 * i + 2, *more[0]]), np.array([3 * i + 1, 3 * i + 2, *more[1]])


def _speeds(r: Reduced, d: Array) -> Array:
    """(m,) lengths of sliding, from base values that are motions."""
    return np.array([np.linalg.norm(d[_tangents(r, i)[1]]) for i in range(len(r.p.mu))])


@dataclass(frozen=True, eq=False)
class _Path:
    """The square system in fixed modes; unknowns y = (rho, v)."""

    r: Reduced
    closed: Mask
    slides: Mask
    turns: Mask
    start: Array
    eps: float

    @classmethod
    def of(cls, r: Reduced, z: Array) -> _Path | None:
        """The modes that z shows; None if it does not move, or its path is not unique."""
        m, a, _ = r.sizes
        nu = r.M.shape[1]
        size = float(np.linalg.norm(z[:nu]))
        if size < 1.0:
            return None
        c, d = r.C @ z + r.off[: len(r.C)], r.D @ z
        tiny = max(ZERO_MOTION, size * 1e-12)
        closed = c[: 3 * m : 3] > ZERO_MOTION
        slides = closed & (_speeds(r, d) > tiny)
        turns = d[3 * m : 3 * m + a] > tiny
        path = cls(r, closed, slides, turns, np.r_[z[:nu] / size, z[nu:]], 1.0 / size)
        y, J, _ = path.step(path.start, path.eps)
        singular = np.linalg.svd(J, compute_uv=False)
        unique = len(singular) == len(y) and singular[-1] > 1e-12 * singular[0]
        return path if unique else None

    def base(self, y: Array) -> tuple[Array, Array]:
        """Forces, and motions per motion's length."""
        r = self.r
        nu = r.M.shape[1]
        return r.C[:, nu:] @ y[nu:] + r.off[: len(r.C)], r.D[:, :nu] @ y[:nu]

    def step(self, y: Array, eps: float) -> tuple[Array, Array, Array]:
        """y itself, the gradients and the values of all equations there."""
        r = self.r
        (m, a, _), nu, n = r.sizes, r.M.shape[1], len(y)
        cos, sin = np.cos(r.p.limits.eta), np.sin(r.p.limits.eta)
        c, d = self.base(y)
        C = np.hstack([np.zeros((len(r.C), nu)), r.C[:, nu:]])
        D = np.hstack([r.D[:, :nu], np.zeros((len(r.D), n - nu))])
        rows: list[Array] = []
        values: list[Array] = []

        def add(gradient: Array, value: Array) -> None:
            rows.append(np.atleast_2d(gradient))
            values.append(np.atleast_1d(value))

        for i in range(m):
            rub, slide = _tangents(r, i)
            if not self.closed[i]:
                add(C[[3 * i, *rub]], c[[3 * i, *rub]])
                continue
            dt, Dt = d[slide], D[slide]
            speed = float(np.linalg.norm(dt))
            u = dt / max(speed, 1e-300)
            slope, reach = (sin * u @ Dt, sin * speed) if self.slides[i] else (np.zeros(n), 0.0)
            add(eps * C[3 * i] + cos * D[3 * i] + slope, np.array(eps * c[3 * i] + cos * d[3 * i] + reach))
            if self.slides[i]:
                w = r.p.mu[i] * c[3 * i]
                turn = (np.eye(len(u)) - np.outer(u, u)) / max(speed, 1e-300)
                add(C[rub] + r.p.mu[i] * np.outer(u, C[3 * i]) + w * turn @ Dt, c[rub] + w * u)
            else:
                add(Dt, dt)
        for j in range(a):
            if self.turns[j]:
                add(C[3 * m + 2 * j], np.array(c[3 * m + 2 * j]))
            else:
                add(D[3 * m + j], np.array(d[3 * m + j]))
        length = np.zeros(n)
        length[:nu] = self.start[:nu]
        add(length, np.array(length @ y - 1.0))
        return y, np.vstack(rows), np.concatenate(values)

    def solved(self, y: Array, eps: float) -> Array | None:
        """A solution for this eps near y that keeps the inequalities; None if there is none."""
        for _ in range(LIMIT_ITERATIONS):
            _, J, g = self.step(y, eps)
            if np.abs(g).max() <= LIMIT_RESIDUAL * max(1.0, float(np.abs(y).max())):
                break
            y = y - np.linalg.lstsq(J, g, rcond=1e-13)[0]
        else:
            return None
        (m, a, _), r = self.r.sizes, self.r
        c, d = self.base(y)
        gap = np.cos(r.p.limits.eta) * d[: 3 * m : 3] + np.sin(r.p.limits.eta) * np.linalg.norm(
            d[: 3 * m].reshape(-1, 3)[:, 1:], axis=1
        )
        force = c[: 3 * m].reshape(-1, 3)
        rubs = np.array([np.linalg.norm(c[_tangents(r, i)[0]]) for i in range(m)])
        inside = rubs <= r.p.mu * force[:, 0] + ALLOWED
        slack, t = c[3 * m : 3 * m + 2 * a : 2], d[3 * m : 3 * m + a]
        limits = c[3 * m + 2 * a + 1 :]
        kept = (
            (force[self.closed, 0] >= -ALLOWED).all()
            and inside[self.closed].all()
            and (gap[~self.closed] >= -ALLOWED * max(eps, ALLOWED)).all()
            and (slack[~self.turns] >= -ALLOWED).all()
            and (t[self.turns] >= -ALLOWED * max(eps, ALLOWED)).all()
            and (limits >= r.lo[1 : 1 + len(limits)] - ALLOWED).all()
            and (limits <= r.hi[1 : 1 + len(limits)] + ALLOWED).all()
        )
        return y if kept else None

    def follow(self) -> tuple[float, Array] | None:
        """The objective as eps goes to 0, extrapolated, and rho; None if the path ends before, or leads down."""
        y = self.solved(self.start, self.eps)
        eps, nu = self.eps, self.r.M.shape[1]
        if y is None:
            return None
        values = [(eps, self.r.scalar(np.r_[np.zeros(nu), y[nu:]]))]
        while eps > MIN_EPSILON:
            eps = max(EPSILON_RATIO * eps, MIN_EPSILON)
            y = self.solved(y, eps)
            if y is None:
                return None
            values.append((eps, self.r.scalar(np.r_[np.zeros(nu), y[nu:]])))
        if len(values) < 2:  # the witness moves as far already
            nearer = self.solved(y, EPSILON_RATIO * eps)
            if nearer is None:
                return None
            y = nearer
            values.append((EPSILON_RATIO * eps, self.r.scalar(np.r_[np.zeros(nu), y[nu:]])))
        (e1, s1), (e2, s2) = values[-2:]
        last = s2 - e2 * (s1 - s2) / (e1 - e2)
        grows = s1 > s2 or abs(s1 - s2) <= LIMIT_RESIDUAL * max(1.0, abs(s2))  # the scalar is made small
        far = values[0][1] - last > GROWTH_TOLERANCE * abs(last)
        return (last, y[:nu]) if grows and far else None


def words_of(grasp: Grasp, motion: Array, slides: Mask, closed: Mask) -> str:
    """'the object turns about the line through (0.01, 0, 0.02) m along (0, 0, 1); contacts 0 and 1 stick, 2 slides'."""
    v, w = motion[:3], motion[3:]
    turn = float(np.linalg.norm(w))
    if turn * grasp.size > MIN_MOTION_SHARE * float(np.linalg.norm(v)):
        axis = w / turn
        point = cross(w, v) / turn**2
        middle = grasp.middle
        point = point + axis * float(axis @ (middle - point))
        what = f"the object turns about the line through {_vector(point)} m along {_vector(axis)}"
        along = float(axis @ v) / turn
        if abs(along) > MIN_MOTION_SHARE * grasp.size:
            what += f", {1e3 * along:.3g} mm along it per radian"
    elif v.any():
        what = f"the object moves along {_vector(v / np.linalg.norm(v))}"
    else:
        what = "the object rests and the joints move"
    parts = [
        f"{_list(np.flatnonzero(mask))} {verb if mask.sum() > 1 else verb + 's'}"
        for mask, verb in ((closed & ~slides, "stick"), (slides, "slide"))
        if mask.any()
    ]
    return f"{what}; {', '.join(parts)}" if parts else what


def _vector(x: Array) -> str:
    return "(" + ", ".join(f"{v + 0.0:.4g}" for v in np.where(np.abs(x) < 1e-9, 0.0, x)) + ")"


def _list(numbers: Indices) -> str:
    names = [str(int(k)) for k in numbers]
    if len(names) == 1:
        return f"contact {names[0]}"
    return f"contacts {', '.join(names[:-1])} and {names[-1]}"
