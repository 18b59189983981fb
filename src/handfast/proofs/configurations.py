"""A configuration in floats, and whether an exact one is in the box about it: interval arithmetic alone.

A proof of existence is a configuration in floats, which meets the contact equations but for rounding, and a box
around some of its coordinates. It claims: with every other coordinate frozen at its float, the box contains an exact
solution, and nowhere in the box is a limit, a patch's edge or a bound reached.

With F(x) = 0 the contact equations in the dependent coordinates x, the others frozen, X = c + [-r, r] the
proof's box, J an enclosure of F' over X and any matrix Y,

    K = c - Y F(c) + (I - Y J) (X - c)

lies inside X only if X contains a solution, just one, and that lies in K (Krawczyk 1969). Then limits,
patches and bounds are tested over all of X. Equations and coordinates are those of `contact_equations`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.proofs.contact_equations import ContactEquations, Values
from handfast.proofs.fields import EQUALITY_TOLERANCE, Array, BadFile, Fields, Integers, numbers
from handfast.proofs.intervals import MACHINE_EPSILON, Interval, cos, join, sqr, sqrt
from handfast.proofs.replay import Refused, Replay
from handfast.proofs.tasks import TaskData

SCHEMA = "handfast/existence/1"
MIN_QUATERNION = 1e-3  # length of a quaternion below which it is none
CLAIM = "an exact one exists in its box"
AND = "; and "  # between the reasons of a configuration that is refused for several


@dataclass(frozen=True)
class ContactPoint:
    """Where a contact touches.

    Attributes:
        link: name of the hand link, as in the task.
        object: (s, t) on the object region.
        hand: (u, v) on the hand region; None on a cap, where the normal says the point.
    """

    link: str
    object: tuple[float, float]
    hand: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Existence:
    """A configuration in floats and the box in which an exact one is claimed.

    Attributes:
        joints: value of every free joint by name [rad, m].
        position: (3,) [m] of the object in the palm frame.
        quaternion: (4,) w, x, y, z of the object in the palm frame, not normalised.
        contacts: one for each contact of the task, in its order.
        dependent: labels of the coordinates that the equations determine, as many as there are equations.
        radii: (E,) half widths of the box in these coordinates, in their order and units.

    Raises:
        BadFile: wrong shapes, NaN or infinity.
    """

    joints: Mapping[str, float]
    position: Array
    quaternion: Array
    contacts: tuple[ContactPoint, ...]
    dependent: tuple[str, ...]
    radii: Array

    def __post_init__(self) -> None:
        for name, n in (("position", 3), ("quaternion", 4), ("radii", len(self.dependent))):
            a = np.array(getattr(self, name), dtype=float)
            if a.shape != (n,) or not np.isfinite(a).all():
                raise BadFile(f"has shape {a.shape}; {n} finite numbers are needed", name)
            a.flags.writeable = False
            object.__setattr__(self, name, a)
        for name, value in (("joints", self.joints.values()), ("contacts", (x for c in self.contacts for x in _uv(c)))):
            if not np.isfinite(list(value)).all():
                raise BadFile("has a number that is not finite", name)

    @property
    def coordinates(self) -> dict[str, float]:
        """Every coordinate's float by its label."""
        out = {f"joint:{name}": value for name, value in self.joints.items()}
        out |= {f"position:{i}": x for i, x in enumerate(self.position.tolist())}
        out |= {f"quaternion:{i}": x for i, x in enumerate(self.quaternion.tolist())}
        for k, contact in enumerate(self.contacts):
            out |= {f"contact:{k}:{name}": x for name, x in zip("stuv", _uv(contact), strict=False)}
        return out

    def to_json(self) -> dict[str, Any]:
        """The proof as a `handfast/existence/1` object; numbers come back exactly."""
        return {
            "schema": SCHEMA,
            "joints": dict(self.joints),
            "position": self.position.tolist(),
            "quaternion": self.quaternion.tolist(),
            "contacts": [
                {"link": c.link, "object": list(c.object), "hand": None if c.hand is None else list(c.hand)}
                for c in self.contacts
            ],
            "dependent": list(self.dependent),
            "radii": self.radii.tolist(),
        }


def read_existence(data: Any, place: str = "") -> Existence:
    """The proof in a parsed object; `BadFile` with the field and what is wrong."""
    f = Fields(data, place)
    f.text("schema", among=[SCHEMA])
    contacts = []
    for part in f.objects("contacts"):
        link, on_object, on_hand = part.text("link"), part.numbers("object", (2,)), part.take("hand")
        uv = None if on_hand is None else numbers(on_hand, (2,), part.at("hand")).tolist()
        contacts.append(ContactPoint(link, (on_object[0], on_object[1]), uv and (uv[0], uv[1])))
        part.done()
    pose = f.numbers("position", (3,)), f.numbers("quaternion", (4,))
    dependent = f.texts("dependent")
    out = Existence(f.named("joints"), *pose, tuple(contacts), dependent, f.numbers("radii", (len(dependent),)))
    f.done()
    return out


def check_configuration(equations: ContactEquations, proof: Existence, name: str = "configuration") -> Replay:
    """Does an exact configuration of the task exist in the box of the proof?

    Its figures: `contraction`, the factor by which K is smaller than the box; `step`, how far c - Y F(c) is from c,
    in radii, both together below 1 where there is a solution; `gap` [m], the largest distance between two contact
    points at the floats; and by label, or by joint for joints that follow, by what each bound is missed at least
    anywhere in the box, where "contact:K:cone" and "contact:K:normals" are cosines, the latter 1 if opposite.
    """
    return examined(equations, proof, name)[0]


def examined(
    equations: ContactEquations, proof: Existence, name: str
) -> tuple[Replay, Values | None, dict[str, float]]:
    """The same, and if it came to that the values at the floats and over the box, and the slacks at the floats."""
    with np.errstate(all="ignore"):  # numbers that overflow end as NaN, which proves nothing
        try:
            box = _Box.of(equations, proof)
        except Refused as fault:
            return Replay(name, CLAIM, str(fault), dict.fromkeys(("contraction", "step", "gap"), np.inf)), None, {}
        at = equations.at(box.coordinates)
        reasons, figures = _krawczyk(box, at)
        bounds = Bounds.of(equations)
        inside = bounds.values(at)
        at_floats, slacks = bounds.slacks(inside)
    figures |= slacks
    reasons += [bounds.fault(label, inside[1]) for label, slack in slacks.items() if not slack > 0]
    return Replay(name, CLAIM, AND.join(reasons), figures), at, at_floats


def solution(equations: ContactEquations, proof: Existence, at: Values) -> Interval:
    """(1, n) coordinates between which the solution is that a proof shows; at: its values.

    The solution is in c - Y F(c) + (I - Y J) (X - c) for X about c that reach as far as it: no coordinate is farther
    from its float, in radii, than the step and the contraction times the farthest.
    """
    box, out = _Box.of(equations, proof), at.coordinates[:1]
    moved = _moved(box, at)
    if moved is None:
        return at.coordinates[1:]
    steps, changes = (x.mag / box.radii * (1 + 2 * MACHINE_EPSILON) for x in moved)
    contraction = float(changes.max())
    share = min(float(steps.max()) / (1 - contraction) * (1 + 4 * MACHINE_EPSILON), 1.0) if contraction < 1 else 1.0
    off = np.minimum((steps + share * changes) * (1 + 4 * MACHINE_EPSILON), 1.0) * box.radii
    ends = out.ends.copy()
    ends[0, box.dependent] = Interval.around(out.mid[0, box.dependent], off * (1 + 2 * MACHINE_EPSILON)).ends
    return Interval(ends)


def farther(equations: ContactEquations, x: Interval, at: Values) -> str:
    """What of the exact configuration, of `solution` x, is not that of the floats, but for rounding; '' if all is.

    Of a contact's coordinates those that are bounded count, and are told with what is left to their bounds.
    """
    task, there, bounds = equations.task, equations.at(x), Bounds.of(equations)
    of_joints = np.array([task.tolerance(j) for j in equations.sides.drive.joints])
    size = task.size * EQUALITY_TOLERANCE
    own = [re.match(r"contact:\d+:.$", label) is not None for label in bounds.labels]
    for name, exact, floats, allowed in (
        ("joints", there.joints, at.joints, of_joints),
        ("position", there.position, at.position, size),
        ("orientation", there.rotation, at.rotation, EQUALITY_TOLERANCE),
        ("points", there.point, at.point, size),
        ("normals", there.normal, at.normal, EQUALITY_TOLERANCE),
        ("contacts", bounds.values(there)[..., own], bounds.values(at)[..., own], EQUALITY_TOLERANCE),
    ):
        off = (exact[0] - floats.mid[0]).mag
        if not (off <= allowed).all():
            return f"{name} of the exact configuration may be {np.max(off):.2g} from what is said"
    return ""


def _uv(contact: ContactPoint) -> tuple[float, ...]:
    return contact.object + (contact.hand or ())


# --- what the proof claims --------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Box:
    """The box of a proof.

    Attributes:
        dependent: (E,) columns of the dependent coordinates.
        labels: (E,) theirs; radii: (E,).
        coordinates: (2, N) all coordinates, at the floats and over the box.
    """

    dependent: list[int]
    labels: tuple[str, ...]
    radii: Array
    coordinates: Interval

    @classmethod
    def of(cls, equations: ContactEquations, proof: Existence) -> _Box:
        """The box; `Refused` for a proof that does not fit the task or contradicts itself."""
        _refuse_misfit(equations.task, proof)
        values, labels, column = proof.coordinates, proof.dependent, equations.column
        _refuse_empty(equations.task)
        if len(labels) != len(equations.rows):
            raise Refused(f"{len(labels)} coordinates are dependent; the {len(equations.rows)} equations need as many")
        for label, radius in zip(labels, proof.radii.tolist(), strict=True):
            if label not in column:
                raise Refused(f"'{label}' is no coordinate of this task; they are {', '.join(column)}")
            if labels.count(label) > 1:
                raise Refused(f"{label} is dependent twice")
            if not radius > 0:
                raise Refused(f"the radius of {label} is {radius:g}; it must be positive")
        if all(f"quaternion:{i}" in labels for i in range(4)):
            raise Refused("all of the quaternion is dependent; its length is free, so one component must be frozen")
        dependent = [column[label] for label in labels]
        middle = np.array([values[label] for label in column])
        both = Interval.of(np.stack([middle, middle]))
        both.ends[1, dependent] = Interval.around(middle[dependent], proof.radii).ends
        return cls(dependent, labels, proof.radii, both)


def _refuse_misfit(task: TaskData, proof: Existence) -> None:
    free = [task.hand.joints[j] for j in task.free]
    for name in free:
        if name not in proof.joints:
            raise Refused(f"has no value for joint {name}; the free joints are {', '.join(free)}")
    for name in proof.joints:
        if name not in free:
            raise Refused(f"has a value for joint {name}; the free joints are {', '.join(free) or 'none'}")
    if len(proof.contacts) != len(task.links):
        raise Refused(f"has {len(proof.contacts)} contacts; the task has {len(task.links)}")
    for k, (point, link, hand) in enumerate(zip(proof.contacts, task.links, task.on_hand, strict=True)):
        if point.link != task.hand.links[link].name:
            raise Refused(f"contact {k} is on {point.link}; in the task it is on {task.hand.links[link].name}")
        if hand.ball != (point.hand is None):
            needed = "a cap, which has no u and v" if hand.ball else "no cap, so it needs u and v"
            raise Refused(f"contact {k}: the hand region is {needed}")
    if not np.linalg.norm(proof.quaternion) > MIN_QUATERNION:
        raise Refused(f"the quaternion is shorter than {MIN_QUATERNION:g}")


def _refuse_empty(task: TaskData) -> None:
    for i, (lo, hi) in enumerate(task.position.tolist()):
        if lo == hi:
            raise Refused(f"pose.position[{i}] is bounded to {lo:g} alone; nothing lies strictly inside")
    for k, i in np.argwhere(task.axes[..., 0] == task.axes[..., 1]).tolist():
        only = task.axes[k, i, 0]
        raise Refused(f"pose.{'xyz'[k]}_axis[{i}] is bounded to {only:g} alone; nothing lies strictly inside")


# --- is there a solution? ---------------------------------------------------------------------------


def _krawczyk(box: _Box, at: Values) -> tuple[list[str], dict[str, float]]:
    """Reasons why no solution is shown; then the contraction, the step and the gap."""
    J = at.F.slope[box.dependent, 1].swapped()
    gaps = sqrt(sqr(at.gap[0]).sum()).hi
    figures = {"contraction": np.inf, "step": np.inf, "gap": float(gaps.max()) if not np.isnan(gaps).any() else np.inf}
    if not np.isfinite(J.mid).all():
        return ["the box is too wide: in it the equations have no finite derivatives"], figures
    moved = _moved(box, at)
    if moved is None:
        return ["the dependent coordinates are not determined: their Jacobian is singular"], figures
    step, change = moved
    steps, changes = step.mag / box.radii, change.mag / box.radii
    figures |= {"contraction": _most(changes), "step": _most(steps)}
    if not (changes < 1).all():
        worst = _worst(changes)
        why = "the box is too wide, or the equations too nearly singular"
        return [f"{why}: {box.labels[worst]} contracts by a factor of {changes[worst]:.3g} only"], figures
    if not (steps < 1).all():
        worst, k = _worst(steps), _worst(gaps)
        why = f"the floats do not meet the equations (contact {k} is open by {gaps[k]:.3g} m)"
        return [f"{why}: a Newton step moves {box.labels[worst]} by {steps[worst]:.3g} radii"], figures
    if not ((step - change).mag < box.radii).all():
        worst = _worst(steps + changes)
        return [f"the box is too tight: a solution near it may lie outside in {box.labels[worst]}"], figures
    return [], figures


def _moved(box: _Box, at: Values) -> tuple[Interval, Interval] | None:
    """(E,) each: Y F(c), and (I - Y J) (X - c); None where J has no inverse."""
    F, J = at.F.value[0], at.F.slope[box.dependent, 1].swapped()
    try:
        Y = np.linalg.inv(J.mid)
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(Y).all():
        return None
    by = Interval.of(Y) @ Interval(np.concatenate([F.ends[:, None], J.ends], axis=1))
    return by[:, 0], ((np.eye(len(Y)) - by[:, 1:]) @ Interval.around(0.0, box.radii)[:, None])[:, 0]


def _worst(x: Array) -> int:
    return int(np.where(np.isnan(x), np.inf, x).argmax())


def _most(x: Array) -> float:
    """The largest, as an upper bound: the quotients were rounded once."""
    most = float(x.max())
    return most * (1 + 2 * MACHINE_EPSILON) if most == most else np.inf


# --- is it strictly inside all bounds? --------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Bounds:
    """What has to lie strictly between two floats each: B of the coordinates, joints, axes and angles at contacts.

    Attributes:
        labels: (B,) see `check_configuration`. lower, upper: (B,).
        column: (B,) among the coordinates, the joints' values, the object's rotation and what hand and object face.
    """

    labels: tuple[str, ...]
    lower: Array
    upper: Array
    column: Integers

    @classmethod
    def of(cls, equations: ContactEquations) -> Bounds:
        """Those of a task."""
        task, column, joints = equations.task, equations.column, equations.sides.drive.joints
        found: list[tuple[str, float, float, int]] = []
        for i, j in enumerate(joints):
            lo, hi = task.hand.limits[j].tolist()
            if lo < hi:  # else it is fixed: `Drive.of` has seen to it
                found.append((f"joint:{task.hand.joints[j]}", lo, hi, len(column) + i))
        for i, (lo, hi) in enumerate(task.position.tolist()):
            found.append((f"position:{i}", lo, hi, column[f"position:{i}"]))
        turned = len(column) + len(joints)
        for k, i in np.ndindex(3, 3):
            lo, hi = task.axes[k, i].tolist()
            lo, hi = -np.inf if lo <= -1 else lo, np.inf if hi >= 1 else hi  # a component is never beyond 1
            found.append((f"{'xyz'[k]}_axis:{i}", lo, hi, turned + 3 * i + k))
        for k, (hand, thing) in enumerate(zip(task.on_hand, task.on_object, strict=True)):
            for name in "st" if hand.ball else "stuv":
                label, region = f"contact:{k}:{name}", thing if name in "st" else hand
                if not region.ball:
                    found.append((label, 0.0, 1.0, column[label]))
                elif name == "s" and region.half_angle < np.pi:  # -s is the point opposite, as far from the axis
                    found.append((label, -region.half_angle, region.half_angle, column[label]))
            if not hand.ball:
                found.append((f"contact:{k}:normals", 0.0, np.inf, turned + 9 + k))
            elif hand.half_angle < np.pi:
                cosine = float(cos(Interval.of(hand.half_angle)).hi)
                found.append((f"contact:{k}:cone", cosine, np.inf, turned + 9 + k))
        found = [one for one in found if one[1] > -np.inf or one[2] < np.inf]
        lower, upper = np.array([ends[1:3] for ends in found]).reshape(-1, 2).T
        return cls(tuple(one[0] for one in found), lower, upper, np.array([one[3] for one in found], dtype=np.int64))

    def values(self, at: Values) -> Interval:
        """(N, B) what is bounded."""
        return join([at.coordinates, at.joints, at.rotation.reshape(-1, 9), at.opposite.value], -1)[..., self.column]

    def slacks(self, inside: Interval) -> list[dict[str, float]]:
        """(N,) by what each bound is missed at least by values (N, B), by label; NaN where one of them is."""
        past = inside.ends + np.stack([self.lower, -self.upper], axis=-1)  # below 0 inside, but for one rounding
        least = np.nextafter(-past, -np.inf).min(axis=-1).tolist()
        return [dict(zip(self.labels, row, strict=True)) for row in least]

    def fault(self, label: str, inside: Interval) -> str:
        """What to say of one that is not met by values (B,)."""
        n = self.labels.index(label)
        lo, hi = float(inside.lo[n]), float(inside.hi[n])
        kind, which, *rest = label.split(":")
        if rest == ["normals"]:
            comes = f"their cosine comes to [{-hi:.9g}, {-lo:.9g}] in the box"
            return f"contact {which}: the normals are not opposite: {comes}"
        if rest == ["cone"]:
            return f"contact {which} may leave the hand's cap, by a cosine of {self.lower[n] - lo:.3g}"
        pose = f"pose.{kind}[{which}]"
        what = f"joint {which}" if kind == "joint" else label if kind == "contact" else pose
        ends = f"[{self.lower[n]:.9g}, {self.upper[n]:.9g}]"
        return f"{what} comes to [{lo:.9g}, {hi:.9g}] in the box, not strictly inside {ends}"
