"""Which loads does a planar grasp with immobile fingers resist? Decided exactly, in polynomial time.

Source: M. Haas-Heger, C. Papadimitriou, M. Yannakakis, G. Iyengar, M. Ciocarlie, "Passive Static Equilibrium with
Frictional Contacts and Application to Grasp Stability Analysis", Robotics: Science and Systems 2018, reference 19 of
the stability paper, as that paper's section II tells it. The laws are (1) to (7) of the stability paper in the plane.

The signs of all normal and tangential motions are a face of the arrangement of the 2 m planes N_i x = 0, T_i x = 0 in
the space of motions x = (v_x, v_y, turn). On a face everything is linear: a contact is open, sticks (T_i x = 0), or
slides with c_t = -mu c_n sign(T_i x), where c_n = -N_i x. So loads that a face resists are a polyhedral cone, and all
that are resisted are the union of at most quadratically many. A polyhedral cone is closed: every load that is
approached by resisted ones, with motions however large, is itself resisted with a finite motion, and every maximum is
attained. Where a magnitude has no largest value, a linear program has a ray.

Everything is decided in rational arithmetic, for the numbers of the grasp as they are. Nothing here knows the engine.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.model.grasp import NORMAL_TOLERANCE, Contact, Grasp
from handfast.papers.arrangement import Face, faces
from handfast.papers.rational_simplex import ONE, ZERO, RationalProgram
from handfast.proofs.fields import rational, rounded

Load = Sequence[float] | Array
Range = tuple[fmpq, fmpq | None]
Vector = tuple[fmpq, fmpq, fmpq]


# --- the grasp ---


@dataclass(frozen=True, eq=False)
class PlanarContact:
    """A point contact with friction in the plane.

    Attributes:
        position: (2,) [m], object frame.
        normal: (2,) unit, object frame, pointing into the object; taken as the numbers that it has, not normalised.
        friction: coefficient mu >= 0.
    """

    position: Array
    normal: Array
    friction: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", frozen(self.position, (2,), "position"))
        object.__setattr__(self, "normal", frozen(self.normal, (2,), "normal"))
        length, mu = float(np.hypot(*self.normal)), float(self.friction)
        if abs(length - 1.0) > NORMAL_TOLERANCE:
            raise InputError(f"has length {length:.6g}; a unit vector is needed", field="normal")
        if not np.isfinite(mu) or mu < 0:
            raise InputError(f"is {mu}; a friction coefficient is 0 or more", field="friction")
        object.__setattr__(self, "friction", mu)

    @property
    def rows(self) -> tuple[Vector, Vector]:
        """Exact rows N, T: with the motion x = (v_x, v_y, turn) of the object, d_n = N x and d_t = T x.

        They are the unit forces' load (f_x, f_y, torque) on the object, too. The tangent is the normal turned by 90
        degrees to the left.
        """
        x, y = (rational(v) for v in self.position)
        a, b = (rational(v) for v in self.normal)
        return (a, b, x * b - y * a), (-b, a, x * a + y * b)


@dataclass(frozen=True, eq=False)
class PlanarGrasp:
    """Contacts with immobile fingers in the plane z = 0.

    Loads are (f_x, f_y, torque) on the object [N, N, N m], the torque about the object's origin.

    Raises:
        InputError: no contacts.
    """

    contacts: tuple[PlanarContact, ...]

    def __init__(self, contacts: Sequence[PlanarContact]) -> None:
        if not contacts:
            raise InputError("is empty; a grasp needs at least one contact", field="contacts")
        object.__setattr__(self, "contacts", tuple(contacts))

    @classmethod
    def of(cls, grasp: Grasp) -> PlanarGrasp:
        """The planar grasp that a spatial one is.

        Raises:
            InputError: a contact that is not in the plane z = 0, a normal that leaves it, or a joint that may move.
        """
        grasp.refuse_soft_fingers("a planar grasp")
        for i, c in enumerate(grasp.contacts):
            if c.position[2] != 0 or c.normal[2] != 0:
                raise InputError("is not in the plane z = 0; a planar grasp is needed", field=f"contacts[{i}]")
        mech = grasp.mechanism
        fixed = np.linalg.matrix_rank(np.vstack([mech.R, mech.A])) == grasp.l if grasp.l else True
        if grasp.command.any() or any(mech.tendon) or any(mech.backdrivable) or not fixed:
            raise InputError("may move; every joint has to be locked, without a command", field="joints")
        return cls([PlanarContact(c.position[:2], c.normal[:2], c.friction) for c in grasp.contacts])

    def spatial(self, name: str = "planar") -> Grasp:
        """The same contacts in space, without joints."""
        return Grasp(
            [Contact(np.r_[c.position, 0.0], np.r_[c.normal, 0.0], c.friction) for c in self.contacts], name=name
        )

    @staticmethod
    def spatial_load(load: Sequence[float] | Array) -> Array:
        """(6,) of a load (3,)."""
        fx, fy, torque = (float(v) for v in load)
        return np.array([fx, fy, 0, 0, 0, torque])


# --- which loads it resists ---


@dataclass(frozen=True, eq=False)
class PlanarState:
    """An exact solution of the model.

    Attributes:
        motion: (v_x, v_y, turn) of the object, in units of the contact springs.
        forces: (c_n, c_t) of every contact [N], c_t along the normal turned by 90 degrees to the left.
    """

    motion: Vector
    forces: tuple[tuple[fmpq, fmpq], ...]

    def solves(self, grasp: PlanarGrasp, load: Sequence[fmpq]) -> bool:
        """Does it solve (1) and (4) to (7) exactly?"""
        total = list(load)
        for contact, (cn, ct) in zip(grasp.contacts, self.forces, strict=True):
            N, T = contact.rows
            dn, dt = _dot(N, self.motion), _dot(T, self.motion)
            mu = rational(contact.friction)
            spring = cn == max(-dn, ZERO)
            cone = abs(ct) <= mu * cn
            slides = dt == 0 or ct == (-mu * cn if dt > 0 else mu * cn)
            if not (spring and cone and slides):
                return False
            total = [w + cn * n + ct * t for w, n, t in zip(total, N, T, strict=True)]
        return not any(total)


@dataclass(frozen=True, eq=False)
class PlanarRanges:
    """All magnitudes s >= 0 for which base + s direction is resisted.

    Attributes:
        ranges: closed ranges, disjoint and in order; the last has no end (None) if nothing ends it.
        state: at the largest resisted magnitude; None if there is no largest, or none at all.
        programs: number of linear programs that were solved.
    """

    ranges: tuple[Range, ...]
    state: PlanarState | None
    programs: int

    @property
    def unbounded(self) -> bool:
        return bool(self.ranges) and self.ranges[-1][1] is None

    @property
    def maximum(self) -> fmpq | None:
        """The largest magnitude; None if there is none, or nothing is resisted."""
        return self.ranges[-1][1] if self.ranges else None

    def holds(self, s: float | fmpq) -> bool:
        """Is this magnitude resisted?"""
        at = s if isinstance(s, fmpq) else rational(s)
        return any(lo <= at and (hi is None or at <= hi) for lo, hi in self.ranges)

    @property
    def shown(self) -> list[tuple[float, float | None]]:
        """The ranges, rounded."""
        return [(rounded(lo), None if hi is None else rounded(hi)) for lo, hi in self.ranges]


def planar_check(grasp: PlanarGrasp, load: Load, *, within: Load | None = None) -> PlanarState | None:
    """A state that resists the load (3,) [N, N, N m]; None: there is none, of whatever motion.

    within: (3,) positive, how far off the load may be: |off_x| / within_x + ... <= 1. For states of other methods that
        solve the model nearly.
    """
    w = tuple(rational(v) for v in load)
    if not any(w):
        return PlanarState((ZERO, ZERO, ZERO), ((ZERO, ZERO),) * len(grasp.contacts))
    about = None if within is None else tuple(rational(v) for v in within)
    for case in _cases(grasp):
        program = case.program(w, None, about)
        if program.feasible:
            return case.state(program.x)
    return None


def planar_least_motion(grasp: PlanarGrasp, load: Load, *, along: Load | None = None) -> PlanarState | None:
    """The state that resists the load (3,) and moves least, by the sum of all |d_n| + |d_t|; None if there is none.

    along: (3,); any load + s along with s >= 0 will do.
    """
    w = tuple(rational(v) for v in load)
    free = None if along is None else tuple(rational(v) for v in along)
    best: tuple[fmpq, PlanarState] | None = None
    for case in _cases(grasp):
        program = case.program(w, free)
        if not program.feasible:
            continue
        # no sign changes on a face, so the sum is linear in the weights of its rays
        cost = [-sum((abs(_dot(row, ray)) for pair in case.rows for row in pair), ZERO) for ray in case.rays]
        program.maximise(cost + [ZERO] * (program.columns - len(cost)))
        total = -sum((a * b for a, b in zip(cost, program.x, strict=False)), ZERO)
        if best is None or total < best[0]:
            best = total, case.state(program.x)
    return best[1] if best else None


def planar_ranges(grasp: PlanarGrasp, direction: Load, base: Load = (0.0, 0.0, 0.0)) -> PlanarRanges:
    """All s >= 0 such that base + s direction is resisted; direction, base: (3,) [N, N, N m]."""
    along, w = (tuple(rational(v) for v in load) for load in (direction, base))
    found: list[Range] = [] if any(w) else [(ZERO, ZERO)]
    state, top, count = None, None, 0
    for case in _cases(grasp):
        count += 1
        program = case.program(w, along)
        if not program.feasible:
            continue
        s = len(program.x) - 1
        cost = [ZERO] * s + [ONE]
        program.maximise([-v for v in cost])
        low = program.x[s]
        if program.maximise(cost):
            high = program.x[s]
            found.append((low, high))
            if top is None or high > top:
                top, state = high, case.state(program.x)
        else:
            found.append((low, None))
    ranges = _union(found)
    bounded = bool(ranges) and ranges[-1][1] is not None
    return PlanarRanges(ranges, state if bounded else None, count)


@dataclass(frozen=True, eq=False)
class _Case:
    """What the contacts do on the closure of a face, as a linear program over its rays' weights."""

    face: Face
    rays: tuple[Vector, ...]
    rows: tuple[tuple[Vector, Vector], ...]
    mu: tuple[fmpq, ...]
    sticking: tuple[int, ...]

    def program(
        self, w: Sequence[fmpq], along: Sequence[fmpq] | None, within: Sequence[fmpq] | None = None
    ) -> RationalProgram:
        """Unknowns: weights of the rays; of each sticking contact mu c_n - c_t and mu c_n + c_t; s if there is one.

        At a sticking contact the forces begin from c_t = mu c_n. With `within`, seven more: shares of it that the load
        is off by, either way, and what is left of 1.
        """
        k, more, held = len(self.rays), 0 if along is None else 1, len(self.sticking)
        A = [[ZERO] * (k + 2 * held + more) for _ in range(3 + held)]
        for j, ray in enumerate(self.rays):
            for i, (N, T) in enumerate(self.rows):
                if self.face.signs[2 * i] >= 0:
                    continue
                cn = -_dot(N, ray)
                side = -int(self.face.signs[2 * i + 1]) or 1
                for a in range(3):
                    A[a][j] += cn * (N[a] + side * self.mu[i] * T[a])
            for h, i in enumerate(self.sticking):
                A[3 + h][j] = 2 * self.mu[i] * _dot(self.rows[i][0], ray)
        for h, i in enumerate(self.sticking):
            for a in range(3):
                A[a][k + 2 * h] = -self.rows[i][1][a]
            A[3 + h][k + 2 * h] = A[3 + h][k + 2 * h + 1] = ONE
        if along is not None:
            for a in range(3):
                A[a][-1] = along[a]
        right = [-v for v in w] + [ZERO] * held
        if within is not None:
            for a, row in enumerate(A):
                row += [sign * within[a] if b == a else ZERO for b in range(3) for sign in (1, -1)] + [ZERO]
            A.append([ZERO] * (len(A[0]) - 7) + [ONE] * 7)
            right.append(ONE)
        return RationalProgram.of(A, right)

    def state(self, x: Sequence[fmpq]) -> PlanarState:
        """The state of the program's solution."""
        k = len(self.rays)
        a, b, c = (sum((x[j] * ray[axis] for j, ray in enumerate(self.rays)), ZERO) for axis in range(3))
        motion = (a, b, c)
        forces = []
        for i, (N, _) in enumerate(self.rows):
            cn = max(-_dot(N, motion), ZERO)
            side = -int(self.face.signs[2 * i + 1]) or 1
            ct = side * self.mu[i] * cn
            if i in self.sticking:
                ct -= x[k + 2 * self.sticking.index(i)]
            forces.append((cn, ct))
        return PlanarState(motion, tuple(forces))


def _cases(grasp: PlanarGrasp) -> Iterator[_Case]:
    """The faces that are needed: those of which no larger one says the same.

    Where a face is the edge of a larger one with as many contacts that stick under load, the closure of the larger one
    contains all of its states. To lie in the span of a face, that is, to be in the planes T_i x = 0 of contacts that
    stick, takes as many different planes as dimensions are missing.
    """
    rows = tuple(c.rows for c in grasp.contacts)
    mu = tuple(rational(c.friction) for c in grasp.contacts)
    lines = [_line(T) for _, T in rows]
    for face in faces([row for pair in rows for row in pair]):
        normal, tangent = face.signs[0::2], face.signs[1::2]
        loaded = [i for i in range(len(rows)) if normal[i] < 0]
        sticking = tuple(i for i in loaded if tangent[i] == 0 and mu[i] > 0)
        if loaded and len({lines[i] for i in sticking}) >= 3 - face.dimension:
            yield _Case(face, tuple(_scaled(r) for r in face.rays), rows, mu, sticking)


def _line(row: Vector) -> tuple[fmpq, ...]:
    """The same for all rows of one plane; (n_x, n_y) of a row is never zero."""
    first = row[0] if row[0] != 0 else row[1]
    return tuple(v / first for v in row)


def _scaled(ray: Sequence[int]) -> Vector:
    """Of a size near one, by a power of two."""
    unit = 1 << max(abs(v) for v in ray).bit_length()
    a, b, c = (fmpq(v, unit) for v in ray)
    return a, b, c


def _dot(a: Vector, b: Vector) -> fmpq:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _union(found: Sequence[Range]) -> tuple[Range, ...]:
    """Disjoint closed ranges, in order."""
    out: list[Range] = []
    for low, high in sorted(found, key=lambda r: r[0]):
        if out:
            start, end = out[-1]
            if end is None:
                break
            if low <= end:
                out[-1] = (start, None if high is None else max(end, high))
                continue
        out.append((low, high))
    return tuple(out)
