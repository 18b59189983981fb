"""The equilibria in the modes of a witness, and the one among them that moves least.

Where it is fixed which contacts are open, stick and slide, and where to, and which actuators turn, the model is linear
but for the cones of sticking contacts: (1) to (4) are linear, (7) says c_t = -mu c_n u and d_t = |d_t| u with a fixed
u, or d_t = 0, and (8) f = f_c or t = 0. So these states are those inside of some second-order cones; mostly it is one
state alone. With uncertain normals an open contact has to move by u . d_t in place of |d_t|, which is no smaller.

The state of least motion is that of a small program. Of states that move equally far, but for a share of
`ALIKE_MOTION`, it is the one of small contact forces, and inside of all inequalities that leave room: no friction at
its limit, no contact that touches without a force, where that need not be. What comes out is judged by the equations
alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from handfast.core.arrays import Array, Mask
from handfast.stability.problem import model
from handfast.stability.problem.witness import VALID, Witness
from handfast.stability.search.interior_point import Cones, minimum
from handfast.stability.search.reduced import SINGULAR_TOLERANCE, Reduced

# forces and motions are in multiples of the largest force that acts
ALIKE_MOTION = 1e-6  # relative: states whose motions differ by less are alike
MOTION_TOLERANCE = 1e-9  # so near is the least motion found, and so much larger no larger one
FORCE_INSET = 1e-4  # how far forces may be from the smallest, to stay inside
INEQUALITY_LOOSENING = 1e-11  # by which inequalities are loosened, since some leave no room at all
MOTION_WEIGHT = 0.1  # weight of motions beside forces
FREE_WEIGHT = 1e-4  # and of what no contact feels


def least_in_same_modes(r: Reduced, found: Witness) -> Witness:
    """The witness of least motion in the modes of another; the other one if it is alone there, or none is better.

    r: the question, any state of it.
    """
    p = r.p
    scale = model.force_scale(found.wrench, found.state.c) / p.force
    states = _ModeStates.of(r, r.z(p.scaled(found.state)), VALID * scale)
    for x in states.least(scale, found.largest_motion / p.force):
        point = r.point(x)
        kept = (point.c[::3] <= p.cn_max * (1 + VALID)).all() and (np.abs(point.f) <= p.f_max * (1 + VALID)).all()
        other = replace(found, state=p.unscale(point))
        if kept and other.valid and other.largest_motion <= (1 + MOTION_TOLERANCE) * found.largest_motion:
            return other
    return found


@dataclass(frozen=True, eq=False)
class _Values:
    """Base values as rows over the reduced unknowns (n,), those of forces with constants.

    Attributes:
        normal, rubs: (m, n), (m, 3, n) c_n and `model.friction`; normal_0, rubs_0: (m,), (m, 3).
        d_n, slides: (m, n), (m, 3, n) d_n and `model.sliding`; gap_0: (m,) the gap d^_n where nothing moves.
        turn, slack: (a, n) t and f - f_c of the actuators that may move; turn_0, slack_0: (a,).
        motions: (2m, 3, n) of the object, and of it against the finger, at each contact.
    """

    normal: Array
    normal_0: Array
    rubs: Array
    rubs_0: Array
    d_n: Array
    gap_0: Array
    slides: Array
    turn: Array
    turn_0: Array
    slack: Array
    slack_0: Array
    motions: Array

    @classmethod
    def of(cls, r: Reduced) -> _Values:
        (m, a, F), p, n = r.sizes, r.p, len(r.cost)
        c, c_0, d = r.C[: 3 * m].reshape(m, 3, n), r.off[: 3 * m].reshape(m, 3), r.D[: 3 * m].reshape(m, 3, n)
        rubs, rubs_0, slides = np.zeros((m, 3, n)), np.zeros((m, 3)), np.zeros((m, 3, n))
        rubs[:, :2], rubs_0[:, :2], slides[:, :2] = c[:, 1:], c_0[:, 1:], d[:, 1:]
        s, turning = len(p.soft), r.question.turning
        rubs[p.soft, 2], rubs_0[p.soft, 2] = r.C[F - s : F], r.off[F - s : F]
        slides[p.soft, 2] = r.D[turning : turning + s]
        actuators = slice(3 * m, 3 * m + 2 * a, 2)
        of_object = np.zeros((3 * m, n))
        of_object[:, : r.M.shape[1]] = p.G.T @ r.M[:6]
        motions = np.concatenate([of_object.reshape(m, 3, n), d])
        turn, turn_0 = r.D[3 * m : 3 * m + a], r.before[3 * m : 3 * m + a]
        normal, slack = (c[:, 0], c_0[:, 0]), (r.C[actuators], r.off[actuators])
        return cls(*normal, rubs, rubs_0, d[:, 0], p.gaps, slides, turn, turn_0, *slack, motions)


@dataclass(frozen=True, eq=False)
class _ModeStates:
    """The states in some modes.

    Attributes:
        closed, slides: (m,) bool.
        along: (m, 3) unit, where a contact slides, turning included.
        turns: (a,) bool, of the actuators that may move.
    """

    r: Reduced
    values: _Values
    closed: Mask
    slides: Mask
    along: Array
    turns: Mask

    @classmethod
    def of(cls, r: Reduced, z: Array, tiny: float) -> _ModeStates:
        """In the modes of a point (n,); tiny: (scaled) forces and motions that are none."""
        v = _Values.of(r)
        slides = v.slides @ z
        length = np.linalg.norm(slides, axis=1)
        moves, closed = length > tiny, v.normal @ z + v.normal_0 > tiny
        along = np.where(moves[:, None], slides / np.where(moves, length, 1.0)[:, None], [1.0, 0.0, 0.0])
        return cls(r, v, closed, closed & moves & r.p.mdp, along, v.turn @ z + v.turn_0 > tiny)

    @cached_property
    def _free(self) -> tuple[Array, Array]:
        """Origin (n,) and basis (n, k) of the points that meet all equations."""
        v, p, n = self.values, self.r.p, len(self.r.cost)
        u, opens, slips = self.along, ~self.closed, self.slides
        sticks = self.closed & ~slips & p.mdp
        forward = self._forward
        across = v.slides - u[:, :, None] * forward[:, None]
        gap = v.normal + np.cos(p.limits.eta) * v.d_n + np.sin(p.limits.eta) * slips[:, None] * forward
        opposed = v.rubs + (p.mu[:, None] * u)[:, :, None] * v.normal[:, None]
        opposed_0 = v.rubs_0 + p.mu[:, None] * u * v.normal_0[:, None]
        equations = [  # (4), (5) to (7), (8)
            (v.normal[opens], v.normal_0[opens]),
            (v.rubs[opens], v.rubs_0[opens]),
            (gap[self.closed], (v.normal_0 + v.gap_0)[self.closed]),
            (v.slides[sticks], np.zeros((int(sticks.sum()), 3))),
            (across[slips], np.zeros((int(slips.sum()), 3))),
            (opposed[slips], opposed_0[slips]),
            (v.slack[self.turns], v.slack_0[self.turns]),
            (v.turn[~self.turns], v.turn_0[~self.turns]),
        ]
        A = np.concatenate([rows.reshape(-1, n) for rows, _ in equations])
        b = np.concatenate([constants.ravel() for _, constants in equations])
        U, s, Vt = np.linalg.svd(A)
        rank = int((s > SINGULAR_TOLERANCE * s[0]).sum())
        return -Vt[:rank].T @ ((U[:, :rank].T @ b) / s[:rank]), Vt[rank:].T

    @property
    def _forward(self) -> Array:
        """(m, n) u . d_t."""
        out: Array = np.einsum("mi,min->mn", self.along, self.values.slides)
        return out

    def _inside(self) -> tuple[Array, Array]:
        """(K, 4, n) and (K, 4): what has to be in second-order cones, an inequality with its first number."""
        v, r, p = self.values, self.r, self.r.p
        m, a, F = r.sizes
        opens, grips = ~self.closed, self.closed & ~self.slides
        gap, none = np.cos(p.limits.eta) * v.d_n + np.sin(p.limits.eta) * self._forward, np.zeros(len(opens))
        first = 3 * m + 2 * a
        bounds, bounds_0 = r.C[first:F], r.off[first:F]
        lo, hi = r.lo[: F - first], r.hi[: F - first]
        low, high = np.isfinite(lo), np.isfinite(hi)
        inequalities = [
            (gap[opens], v.gap_0[opens]),
            (v.normal[self.closed], v.normal_0[self.closed]),
            (self._forward[self.slides], none[self.slides]),
            (v.turn[self.turns], v.turn_0[self.turns]),
            (v.slack[~self.turns], v.slack_0[~self.turns]),
            (bounds[low], bounds_0[low] - lo[low]),
            (-bounds[high], hi[high] - bounds_0[high]),
        ]
        first_0 = np.concatenate([p.mu[grips] * v.normal_0[grips], *(constants for _, constants in inequalities)])
        rows, offset = np.zeros((len(first_0), 4, len(r.cost))), np.zeros((len(first_0), 4))
        rows[:, 0] = np.concatenate([p.mu[grips, None] * v.normal[grips], *(rows for rows, _ in inequalities)])
        count = int(grips.sum())
        rows[:count, 1:], offset[:, 0], offset[:count, 1:] = v.rubs[grips], first_0, v.rubs_0[grips]
        return rows, offset

    def _preferred(self) -> tuple[Array, Array]:
        """(., n) and (.,): what is to be small: contact forces, then motions, then what no contact feels."""
        v, p, r = self.values, self.r.p, self.r
        nu, n = r.M.shape[1], len(r.cost)
        middle = p.grasp.middle / p.length
        object_ = r.M[:6].copy()
        object_[:3] += np.cross(r.M[3:6], middle, axisa=0, axisc=0)  # wherever the object's frame is
        free = np.eye(n)
        free[:nu] = 0.0
        joints = np.zeros((len(r.M), n))
        joints[:6, :nu], joints[6:, :nu] = object_, r.M[6:]
        forces = [(v.normal, v.normal_0), (v.rubs, v.rubs_0)]
        rows = [
            *(x.reshape(-1, n) for x, _ in forces),
            MOTION_WEIGHT * v.motions.reshape(-1, n),
            FREE_WEIGHT * joints,
            FREE_WEIGHT * free,
        ]
        constants = np.concatenate([x.ravel() for _, x in forces])
        every = np.concatenate(rows)
        return every, np.r_[constants, np.zeros(len(every) - len(constants))]

    def least(self, scale: float, before: float) -> list[Array]:
        """Points (n,) of least motion: inside of all that leaves room, and as it was found; none if there is no choice.

        scale: the largest force that acts; before: a motion that none is to exceed.
        """
        origin, basis = self._free
        k = basis.shape[1]
        if not k:
            return []
        origin = origin / scale

        def along(rows: Array, offset: Array) -> tuple[Array, Array]:
            return rows @ basis, rows @ origin + offset / scale

        rows, offset = along(*self._inside())
        offset[:, 0] += INEQUALITY_LOOSENING
        inside = Cones(rows, offset).felt()
        moved = np.zeros((len(self.values.motions), 4, k)), np.zeros((len(self.values.motions), 4))
        moved[0][:, 1:], moved[1][:, 1:] = along(self.values.motions, np.zeros(self.values.motions.shape[:2]))
        every = Cones(*moved)
        motions = every.felt()
        found: list[Array] = []
        if len(motions.offset):
            floor = max(float(np.linalg.norm(every.unfelt().offset, axis=1).max(initial=0.0)), ALIKE_MOTION)
            first = _least_longest(motions, inside, floor)
            if first is None:
                return []
            found = [first]
            least = max(float(np.linalg.norm(motions.at(first), axis=1).max()), floor)
            cap = max(min((1 + ALIKE_MOTION) * least, before / scale), (1 + MOTION_TOLERANCE) * least)
            inside = Cones(motions.rows, motions.offset + np.array([cap, 0.0, 0.0, 0.0])).with_(inside)
        weights, constants = along(*self._preferred())
        second = minimum(inside, weights.T @ constants, weights.T @ weights, FORCE_INSET)
        return [scale * (origin + basis @ x) for x in ([] if second is None else [second]) + found]


def _least_longest(motions: Cones, inside: Cones, floor: float) -> Array | None:
    """The x (k,) inside of cones whose longest motion is least; what is below a floor is alike."""
    both, k = motions.with_(inside), motions.rows.shape[2]
    longest = np.zeros((len(both.offset), 4, 1))
    longest[: len(motions.offset), 0] = 1.0
    last = np.eye(k + 1)[-1:]
    above = Cones.at_least(last, np.array([-floor]))
    program = Cones(np.concatenate([both.rows, longest], axis=2), both.offset).with_(above)
    found = minimum(
        program, last[0], MOTION_TOLERANCE * FREE_WEIGHT * np.eye(k + 1), MOTION_TOLERANCE / len(program.offset)
    )
    return None if found is None else found[:k]
