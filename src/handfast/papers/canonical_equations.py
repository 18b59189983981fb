"""Builds the canonical system of any task, and the point of its variables that a configuration is.

Departures from the paper, none of which changes the number of variables or equations of its own tasks:

- Couplings are on the angle. The authors equate cosines about the middle of the range, which the mirror
  image of the follower's angle satisfies too. Here one equation equates the cosines from the lower end of
  the range, where the cosine is injective up to half a turn: (R_j a') . b of the one joint and of the other.
- Caps are not Bezier patches; see `patch_form`.
- Prismatic joints: (8) with a travel along the axis, (9) for two vectors; cylindrical ones: (8) with a travel
  and (9); spherical ones: (8) alone. A joint without limits (a full turn and more) has no (12) to (14).
- The palm's pose is among the variables, with a box of no width, as Table 2 counts it.
"""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.core.errors import InputError
from handfast.model.bernstein import evaluate
from handfast.papers.canonical_system import (
    Canonical,
    Limit,
    Patch,
    Polynomial,
    Quadratic,
    Side,
    VariableLayout,
    monomial,
    multiplied,
    scaled,
    total,
)
from handfast.papers.kinematic_loops import MIN_JOINT_RANGE, Assembly, Kind, Loops, loops
from handfast.papers.patch_form import COEFFICIENT_ROUNDING, PatchForm
from handfast.synthesis.task import Task

XYZ = "xyz"
REDUNDANT = {Kind.REVOLUTE: 1, Kind.CYLINDRICAL: 1, Kind.PRISMATIC: 3, Kind.UNIVERSAL: 0, Kind.SPHERICAL: 0}


def canonical(task: Task, *, unit: float = 1.0) -> Canonical:
    """The canonical system of a task.

    Args:
        unit: [m] lengths are counted in it; the paper's table is in millimetres (0.001).

    Raises:
        InputError: limits and couplings that leave nothing, or a coupling that one equation in cosines
            cannot say exactly: of a ratio other than 1 and -1, over more than half a turn, or of an angle to
            a length.
    """
    if not (np.isfinite(unit) and unit > 0):
        raise InputError(f"is {unit:g}; a positive length [m] is needed", field="unit")
    return _Builder(task, unit).system()


def point(system: Canonical, q: Array, pose: Array, parameters: Array) -> Array:
    """(n_v,) all variables at a configuration; a solution if the contacts are met there.

    Args:
        q: (l,) joint values of the hand.
        pose: (4, 4) the object's frame in the palm's.
        parameters: (b, 4) of u, v, s, t in [0, 1] of each contact (of a cap: see `cap_parameters`).
    """
    at, out = system.layout, np.zeros(system.n_v)
    poses = np.concatenate([system.loops.body_poses(np.asarray(q, dtype=float)), pose[None]])
    out[at.position] = poses[:, :3, 3] / system.unit
    out[at.axes] = poses[:, :3, :3]
    for limit in at.limits:
        a, b = limit.angle.vectors(limit.angle.middle)
        out[limit.a] = poses[limit.parent, :3, :3] @ a
        out[limit.b] = poses[limit.child, :3, :3] @ b
        out[limit.c] = out[limit.a] @ out[limit.b]
    for joint, variable in at.slides:
        out[variable] = (q[joint] - system.task.hand.joints[joint].ref) / system.unit
    for sides, values in zip(at.sides, np.asarray(parameters, dtype=float), strict=True):
        for side, (u, v) in zip(sides, (values[:2], values[2:]), strict=True):
            form = side.form
            normal = evaluate(form.normals, u, v)
            norm = float(np.linalg.norm(normal))
            where = form.at(u, v, normal / norm)
            out[side.point], out[side.normal], out[side.unit] = where, normal, normal / norm
            out[side.norm], out[list(side.parameters)] = norm, (u, v)
    return out


class _Builder:
    """Variables and equations, one after the other."""

    def __init__(self, task: Task, unit: float) -> None:
        self.task, self.unit, self.loops = task, unit, loops(task)
        self.names: list[str] = []
        self.lower: list[float] = []
        self.upper: list[float] = []
        self.equations: list[Quadratic | Patch] = []
        self.links = (*self.loops.bodies, "object" if "object" not in self.loops.bodies else "(object)")

    def system(self) -> Canonical:
        count = len(self.links)
        self.position, self.axes = np.zeros((count, 3), dtype=np.intp), np.zeros((count, 3, 3), dtype=np.intp)
        forms = [
            (PatchForm.of(t.hand, pose, self.unit), PatchForm.of(t.object, np.eye(4), self.unit))
            for t, (_, pose) in zip(self.task.contact_pairs, self.loops.carriers, strict=True)
        ]
        self._poses(forms)
        slides, limits = [], []
        for a in self.loops.assemblies:
            slide = self._joint(a)
            slides += [slide] if slide else []
            limits += self._limits(a)
        sides = tuple(self._contact(n, *pair) for n, pair in enumerate(forms))
        for coupling in self.loops.coupled:
            self._coupling(coupling, {limit.angle.joint: limit for limit in limits}, dict(slides))
        layout = VariableLayout(self.links, self.position, self.axes, tuple(limits), tuple(slides), sides)
        redundant = sum(REDUNDANT[a.kind] for a in self.loops.assemblies) + len(forms)
        lower, upper = np.array(self.lower), np.array(self.upper)
        lower.flags.writeable = upper.flags.writeable = False
        return Canonical(
            self.task, self.unit, tuple(self.names), lower, upper, tuple(self.equations), redundant, self.loops, layout
        )

    # --- one variable, one equation ---------------------------------------------------------------

    def _variable(self, name: str, lower: float, upper: float) -> int:
        self.names.append(name)
        self.lower.append(float(lower))
        self.upper.append(float(upper))
        return len(self.names) - 1

    def _vector(self, name: str, box: Array) -> Indices:
        return np.array([self._variable(f"{name}.{i}", lo, hi) for i, lo, hi in zip(XYZ, *box, strict=True)])

    def _equations(self, number: str, of: str, *polynomials: Polynomial) -> None:
        """0 = each of them."""
        self.equations += [Quadratic(number, of, {m: v for m, v in p.items() if v}) for p in polynomials]

    def _turned(self, link: int, vector: Array) -> list[Polynomial]:
        """The three components of R_l v, v known."""
        return [{(int(self.axes[link, i, k]),): float(v) for k, v in enumerate(vector)} for i in range(3)]

    def _turned_variable(self, link: int, vector: Indices) -> list[Polynomial]:
        """The three components of R_l v, v of variables."""
        return [total(*(monomial(self.axes[link, i, k], v) for k, v in enumerate(vector))) for i in range(3)]

    def _origin(self, link: int) -> list[Polynomial]:
        return [{(int(i),): 1.0} for i in self.position[link]]

    # --- links (4) to (7) ---------------------------------------------------------------------------

    def _poses(self, forms: list[tuple[PatchForm, PatchForm]]) -> None:
        boxes = _position_boxes(self.loops, self.task, forms, self.unit)
        for l, name in enumerate(self.links):
            axes = np.array([-np.ones((3, 3)), np.ones((3, 3))])  # (2, k, i)
            if l == 0:
                axes = np.array([np.eye(3), np.eye(3)])
            elif l == len(self.links) - 1:
                bounds = self.task.pose.axes
                axes = np.array([np.maximum(bounds[:, :, 0], -1.0), np.minimum(bounds[:, :, 1], 1.0)])
            self.position[l] = self._vector(f"r[{name}]", boxes[l])
            for k, column in enumerate("cde"):
                self.axes[l, :, k] = self._vector(f"{column}[{name}]", axes[:, k])
            c, d, e = self.axes[l].T
            self._equations("(4)", name, total(*(monomial(i, i) for i in c), {(): -1.0}))
            self._equations("(5)", name, total(*(monomial(i, i) for i in d), {(): -1.0}))
            self._equations("(6)", name, total(*(monomial(i, j) for i, j in zip(c, d, strict=True))))
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                self._equations(
                    "(7)", name, total(monomial(c[j], d[k]), monomial(c[k], d[j], -1.0), {(int(e[i]),): -1.0})
                )

    # --- joints (8) to (11) and their limits (12) to (14) ---------------------------------------------

    def _joint(self, a: Assembly) -> tuple[int, int] | None:
        """The equations of a joint; joint and variable of its slide, if it has one."""
        name = " + ".join(self.task.hand.joint_names[m.joint] for m in a.motions)
        points, vectors = ("(10)", "(11)") if a.kind is Kind.UNIVERSAL else ("(8)", "(9)")
        ends = [
            self._origin(a.parent), self._turned(a.parent, a.p / self.unit),
            [scaled(x, -1.0) for x in self._origin(a.child)], self._turned(a.child, -a.q / self.unit),
        ]  # fmt: skip
        slide = None
        if a.slide is not None:
            joint = self.task.hand.joints[a.slide]
            lower, upper = (self.loops.ranges[a.slide] - joint.ref) / self.unit
            slide = a.slide, self._variable(f"slide[{joint.name}]", lower, upper)
            u = a.aligned[0][0]
            along = [
                total(*(monomial(self.axes[a.parent, i, k], slide[1], u[k]) for k in range(3) if u[k]))
                for i in range(3)
            ]
            ends.append(along)
        self._equations(points, name, *(total(*terms) for terms in zip(*ends, strict=True)))
        for u, v in a.aligned:
            pairs = zip(self._turned(a.parent, u), self._turned(a.child, -v), strict=True)
            self._equations(vectors, name, *(total(*pair) for pair in pairs))
        for u, v in a.crossed:
            pairs = zip(self._turned(a.parent, u), self._turned(a.child, v), strict=True)
            self._equations(vectors, name, total(*(multiplied(x, y) for x, y in pairs)))
        return slide

    def _limits(self, assembly: Assembly) -> list[Limit]:
        out, ball = [], np.array([-np.ones(3), np.ones(3)])
        for angle in assembly.angles:
            name = self.task.hand.joint_names[angle.joint]
            a, b = self._vector(f"a[{name}]", ball), self._vector(f"b[{name}]", ball)
            half = min((angle.upper - angle.lower) / 2, np.pi)
            c = self._variable(f"cos[{name}]", max(np.cos(half) - COEFFICIENT_ROUNDING, -1.0), 1.0)
            self._equations("(12)", name, total(*(monomial(i, j) for i, j in zip(a, b, strict=True)), {(c,): -1.0}))
            vectors = angle.vectors(angle.middle)
            sides = ("(13)", a, assembly.parent, vectors[0]), ("(14)", b, assembly.child, vectors[1])
            for number, variables, link, vector in sides:
                pairs = zip(self._turned(link, vector), variables, strict=True)
                self._equations(number, name, *(total(x, {(int(i),): -1.0}) for x, i in pairs))
            out.append(Limit(angle, assembly.parent, assembly.child, a, b, c))
        return out

    def _coupling(
        self, coupling: tuple[int, int, float, float], limits: dict[int, Limit], slides: dict[int, int]
    ) -> None:
        """q[j] = ratio q[k] + offset in one equation, linear for slides, else in cosines from the lower end."""
        j, k, ratio, offset = coupling
        joints = self.task.hand.joints
        field = f"couplings.{joints[j].name}"
        if joints[j].type != joints[k].type:
            raise InputError(f"ties an angle to a length ({joints[k].name}), which no cosine can say", field=field)
        if joints[j].type == "prismatic":
            shift = (ratio * joints[k].ref + offset - joints[j].ref) / self.unit
            terms: Polynomial = {(slides[j],): 1.0, (slides[k],): -ratio, (): -shift}
            self._equations("coupling", joints[j].name, terms)
            return
        if abs(abs(ratio) - 1) > MIN_JOINT_RANGE:
            raise InputError(f"has ratio {ratio:g} to {joints[k].name}; cosines can say 1 and -1 only", field=field)
        lower, upper = self.loops.ranges[k]
        if upper - lower > np.pi + MIN_JOINT_RANGE:
            problem = f"ties {joints[k].name} over {np.degrees(upper - lower):.4g} degrees"
            raise InputError(f"{problem}; the cosine tells angles apart up to 180", field=field)
        first = self._cosine(limits[j], ratio * lower + offset)
        self._equations("coupling", joints[j].name, total(first, scaled(self._cosine(limits[k], lower), -1.0)))

    def _cosine(self, limit: Limit, value: float) -> Polynomial:
        """cos(q - value) of a limited joint: the vector that turns, for `value`, times the other one's variables."""
        turning = limit.angle.turning(value)
        link, other = (limit.parent, limit.b) if limit.angle.parent_turns else (limit.child, limit.a)
        return total(
            *(multiplied(x, {(int(i),): 1.0}) for x, i in zip(self._turned(link, turning), other, strict=True))
        )

    # --- contacts (15) to (18), (20) to (25) ------------------------------------------------------------

    def _contact(self, n: int, hand: PatchForm, obj: PatchForm) -> tuple[Side, Side]:
        name, last = f"contact {n}", len(self.links) - 1
        h = self._side(n, hand, self.loops.carriers[n][0], ("h", "m", "mhat", "mu", "u", "v"), (17, 20, 22, 24))
        o = self._side(n, obj, last, ("o", "n", "nhat", "nu", "s", "t"), (18, 21, 23, 25))
        meet = [self._origin(h.body), self._turned_variable(h.body, h.point)]
        meet += [[scaled(x, -1.0) for x in side] for side in (self._origin(last), self._turned_variable(last, o.point))]
        self._equations("(15)", name, *(total(*terms) for terms in zip(*meet, strict=True)))
        normals = zip(self._turned_variable(h.body, h.unit), self._turned_variable(last, o.unit), strict=True)
        self._equations("(16)", name, *(total(*pair) for pair in normals))
        return h, o

    def _side(
        self, n: int, form: PatchForm, body: int, names: tuple[str, ...], numbers: tuple[int, int, int, int]
    ) -> Side:
        name = f"contact {n}"
        boxes = (form.point_box, form.normal_box, form.unit_box)
        point, normal, unit = (self._vector(f"{x}[{n}]", box) for x, box in zip(names, boxes, strict=False))
        norm = self._variable(f"{names[3]}[{n}]", *form.norm)
        u, v = (self._variable(f"{x}[{n}]", 0.0, 1.0) for x in names[4:])
        at, length, along, patch = (f"({x})" for x in numbers)
        if form.points is None:
            for i in range(3):
                terms: Polynomial = {(int(point[i]),): 1.0, (int(unit[i]),): -form.radius, (): -form.center[i]}
                terms[(v,)] = -form.along[i]
                self._equations(at, name, terms)
        else:
            self.equations += [Patch(at, name, int(point[i]), u, v, form.points[:, :, i]) for i in range(3)]
        self._equations(length, name, total(monomial(norm, norm), *(monomial(i, i, -1.0) for i in normal)))
        for i in range(3):
            self._equations(along, name, total({(int(normal[i]),): 1.0}, monomial(norm, unit[i], -1.0)))
        self.equations += [Patch(patch, name, int(normal[i]), u, v, form.normals[:, :, i]) for i in range(3)]
        return Side(point, normal, unit, norm, (u, v), body, form)


def _position_boxes(loops: Loops, task: Task, forms: list[tuple[PatchForm, PatchForm]], unit: float) -> list[Array]:
    """(2, 3) per link, in units: where its origin can be, by lengths alone."""
    size = np.linalg.norm
    ends = [(np.zeros(3), 0.0, np.zeros(3))]  # per body: a ball about its point q, and that point in its frame
    for a in loops.assemblies:
        center, radius, q = ends[a.parent]
        travel = 0.0
        if a.slide is not None:
            travel = float(np.abs(loops.ranges[a.slide] - loops.hand.joints[a.slide].ref).max())
        if a.parent == 0:
            center, radius = a.p, travel  # the palm does not move
        else:
            radius = radius + float(size(a.p - q)) + travel
        ends.append((center, radius, a.q))
    # a body's origin is as far from its point q as the point from it
    balls = [(center / unit, (radius + float(size(q))) / unit) for center, radius, q in ends]
    out = [np.array([c - r * (1 + COEFFICIENT_ROUNDING), c + r * (1 + COEFFICIENT_ROUNDING)]) for c, r in balls]
    bounds = task.pose.position.T / unit
    box = bounds
    for (hand, obj), (body, _) in zip(forms, loops.carriers, strict=True):
        center, radius = balls[body]
        radius += sum(float(size(np.abs(form.point_box).max(axis=0))) for form in (hand, obj))
        near = np.array([center - radius * (1 + COEFFICIENT_ROUNDING), center + radius * (1 + COEFFICIENT_ROUNDING)])
        both = np.array([np.maximum(box[0], near[0]), np.minimum(box[1], near[1])])
        # where the bounds contradict each other there is no solution and any of them is a bound
        box = np.where(both[0] <= both[1], both, near)
    return [*out, box]
