"""Contacts, joints and mechanism of a grasp as plain arrays, read from a `handfast/grasp/1` object.

All numbers are in the object frame and in SI units. The grasp map G and the Jacobian J of equations (1) to (3) are
there three times: rounded, as sums of absolute values that bound the rounding, and exactly, as rational numbers of the
positions, axes and contact frames as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from flint import fmpq

from handfast.proofs.constants import MAX_GRASP_SIZE, MIN_LEVER
from handfast.proofs.fields import Array, BadFile, Fields, Integers, Mask, cross_rows, exact, refuse_unknown

UNIT_TOLERANCE = 1e-3  # a normal or an axis may be off unit length by rounding in a file; it is then normalised
STOP_SIDES = "", "lower", "upper", "both"
Maps = tuple[Array, Array, Array, Array]  # G, J, twist map and twist Jacobian
LENGTH_ROUNDING = 1e-14  # relative: what rounding leaves of a length that is none


@dataclass(frozen=True, eq=False)
class StartData:
    """The state that a step of a load's path starts from, as far as the step knows it: how far it has come.

    A hand squeezes, then the load comes and grows; see docs/load-path.md. In each step friction and commanded gearing
    know what moves in that step alone. Springs of contacts, stops, and tendons that nobody commands know the whole
    motion, of which these numbers are the part from before. What a step proves is about exactly them. The step after
    has those of the witness, but for 1e-9 of the load (`states.came_from`).

    Attributes:
        gaps: (m,) [N] d_n of the contacts at unit stiffness; negative where a spring is pressed.
        stops: (l,) >= 0, of joints away from their stop. slack: (a,) >= 0, t of tendons that nobody commands.
    """

    gaps: Array
    stops: Array
    slack: Array


@dataclass(frozen=True, eq=False)
class GraspData:
    """A grasp, as the equations know it.

    Attributes:
        positions: (m, 3) [m]. frames: (m, 3, 3) columns n, t1, t2; n points into the object.
        mu: (m,) friction. lever: (m,) [m] torsional friction over friction; 0 is a point contact.
        links: (m,) names of the hand's links.
        joints: (l,) names. axes, origins: (l, 3). revolute: (l,) bool. moves: (m, l) bool, which joint moves which
            contact.
        friction, torque: (l,) [N m or N] dry friction of the joints, and what acts on them whatever moves.
        stop: (l,) place in `STOP_SIDES`.
        actuators: (a,) names. R: (a, l), A: (k, l) of the mechanism. tendon, backdrivable: (a,) bool.
        command: (a,) f_c [N m or N]; 0 is a locked actuator.
        start: of a step of a load's path; None where nothing has moved yet.
    """

    positions: Array
    frames: Array
    mu: Array
    lever: Array
    links: tuple[str, ...]
    joints: tuple[str, ...]
    axes: Array
    origins: Array
    revolute: Mask
    moves: Mask
    friction: Array
    torque: Array
    stop: Integers
    actuators: tuple[str, ...]
    R: Array
    A: Array
    tendon: Mask
    backdrivable: Mask
    command: Array
    start: StartData | None = None

    @property
    def m(self) -> int:
        """Number of contacts."""
        return len(self.mu)

    @property
    def l(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def a(self) -> int:
        """Number of actuators."""
        return len(self.actuators)

    @cached_property
    def soft(self) -> Integers:
        """(s,) which contacts are soft fingers."""
        return np.flatnonzero(self.lever > 0)

    @cached_property
    def stops(self) -> tuple[Mask, Mask]:
        """(l,) bool each: does the joint stand at its lower stop, and at its upper one? Not where it left it before."""
        both, there = self.stop == STOP_SIDES.index("both"), self.stops_left == 0
        lower, upper = ((self.stop == STOP_SIDES.index(name)) & there for name in ("lower", "upper"))
        return lower | both, upper | both

    @property
    def has_laws(self) -> bool:
        """Has any joint friction, a given torque or a stop, or is a motor backdrivable?"""
        return bool(self.friction.any() or self.torque.any() or self.stop.any() or self.backdrivable.any())

    def with_command(self, command: Array) -> GraspData:
        """With other commands (a,), and all that was worked out of the rest."""
        return self._with_known(replace(self, command=command), ())

    def with_start(self, start: StartData | None) -> GraspData:
        """In a step that starts from there. What all steps of a path need is worked out here, once."""
        _ = self.rows, self.row_units, self.column_units, self.contact_rows, self.actuator_arms, self._exact_tables
        return self._with_known(replace(self, start=start), ("gaps", "stops", "stops_left", "independent_rows"))

    def _with_known(self, out: GraspData, but: Sequence[str]) -> GraspData:
        """With what was worked out of this one."""
        known = {name: x for name, x in self.__dict__.items() if name not in out.__dict__ and name not in but}
        out.__dict__.update(known)
        return out

    @cached_property
    def gaps(self) -> Array:
        """(m,) [N] of the contacts before the step."""
        return np.zeros(self.m) if self.start is None else self.start.gaps

    @property
    def slack(self) -> Array:
        """(a,) of the actuators before the step; 0 of all but tendons that nobody commands."""
        own = np.zeros(self.a) if self.start is None else self.start.slack
        return np.where(self.tendon & (self.command == 0), own, 0.0)

    @property
    def stop_side(self) -> Array:
        """(l,) the sense in which each joint leaves its stop: 1 at the lower one, -1 at the upper one, else 0."""
        return np.array([0.0, 1.0, -1.0, 0.0])[self.stop]  # as `STOP_SIDES`

    @cached_property
    def stops_left(self) -> Array:
        """(l,) how far each joint had left its stop before the step, negative at an upper one; 0 without a stop."""
        return self.stop_side * (0.0 if self.start is None else self.start.stops)

    def same_but_commands(self, other: GraspData) -> bool:
        """Are all other numbers and names the same, but for commands and the start of a step?"""
        own = "command", "start"
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self) if f.name not in own)
        return all(np.array_equal(a, b) for a, b in pairs)

    def commands(self, by_name: dict[str, float], field: str) -> Array:
        """(a,) commands by name, 0 where none is named. `BadFile` for an unknown name, or a tendon that pushes."""
        out = np.zeros(self.a)
        for name, value in by_name.items():
            refuse_unknown(name, self.actuators, "actuator", field)
            i = self.actuators.index(name)
            if self.tendon[i] and value < 0:
                raise BadFile(f"is {value:g}; a tendon can only pull", f"{field}.{name}")
            out[i] = value
        return out

    # --- sizes; each is in proportion to the grasp, however large or small that is

    @cached_property
    def centroid(self) -> Array:
        """(3,) [m] the middle of the contacts."""
        return np.asarray(self.positions.mean(axis=0))

    @cached_property
    def _radius(self) -> float:
        """[m] the largest distance of a contact from the contacts' centroid."""
        return float(np.linalg.norm(self.positions - self.centroid, axis=1).max())

    @property
    def spans(self) -> bool:
        """Are contacts apart, but for rounding?"""
        return self._radius > LENGTH_ROUNDING * float(np.abs(self.positions).max())

    @cached_property
    def size(self) -> float:
        """[m] the largest distance of a contact from the contacts' centroid.

        Where that is none but for rounding: the largest distance of a contact from a joint that turns it, else from
        the origin; 1 if there is no length at all.
        """
        if self.spans:
            return self._radius
        far = float(np.abs(self.positions).max())
        arms = np.linalg.norm(self.positions[:, None] - self.origins[None], axis=2) * (self.moves & self.revolute)
        return float(arms.max(initial=0.0)) or far or 1.0

    @cached_property
    def joint_units(self) -> Array:
        """(l,) torque or force of a joint that counts as much as a unit of force: `size` if it is revolute, else 1."""
        return np.where(self.revolute, self.size, 1.0)

    @cached_property
    def joint_arms(self) -> Array:
        """(l,) motion of the contacts for a unit of joint motion, with the turning of soft fingers times their levers.

        J's column norms but for rounding, and those of the twist Jacobian; where both are none the joint's unit.
        """
        return self.arms_of(np.eye(self.l))

    def arms_of(self, moved: Array) -> Array:
        """(d,) the same for a unit of each of d ways (l, d) in which joints move together."""
        arms, sums = (np.sqrt((x * x).sum(axis=0)) for x in (self.J @ moved, self.sizes[1] @ np.abs(moved)))
        turned = np.sqrt(((self.twist_jacobian @ moved) ** 2).sum(axis=0))
        units = self.joint_units @ np.abs(moved)
        both = np.hypot(np.where(arms > LENGTH_ROUNDING * sums, arms, 0.0), turned)
        return np.where(both > 0, both, units)

    @cached_property
    def actuator_arms(self) -> Array:
        """(a,) motion of the contacts for a unit of actuator motion, the least of the joints that it drives."""
        R = np.abs(self.R)
        if not R.size:
            return np.ones(self.a)
        return np.where(R > 0, self.joint_arms / np.where(R > 0, R, 1.0), np.inf).min(axis=1)

    @cached_property
    def parts(self) -> tuple[slice, slice, slice, slice, slice]:
        """Where the rows of `rows` begin and end: forces, torsions, actuators, couplings, joints."""
        ends = np.cumsum([0, 3 * self.m, len(self.soft), self.a, len(self.A), self.l]).tolist()
        one, two, three, four, five = (slice(x, y) for x, y in pairwise(ends))
        return one, two, three, four, five

    @cached_property
    def rows(self) -> tuple[Array, Array]:
        """(N + 1, 6 + l) each: motions for (r, q), and sums of absolute values that bound the rounding.

        Motions of the object against the fingers (3) and turning of soft fingers, R q and A q, q itself; a last row of
        zeros stands for what a contact has not. The same rows, transposed, take the forces that belong to them to (1)
        and (2).
        """
        sizes = self._table(self.sizes, np.abs(self.R), np.abs(self.A), np.abs)
        return self._table(self._maps, self.R, self.A, np.negative), sizes

    def _table(self, maps: Maps, R: Array, A: Array, sign: Callable[[Array], Array]) -> Array:
        """(N + 1, 6 + l) rows; sign: what becomes of J."""
        G, J, twist, turned = maps
        own = np.vstack([R, A, np.eye(self.l, dtype=G.dtype), np.zeros((1, self.l), dtype=G.dtype)])
        top = np.hstack([np.vstack([G.T, twist.T]), sign(np.vstack([J, turned]))])
        return np.vstack([top, np.hstack([np.zeros((len(own), 6), dtype=G.dtype), own])])

    @cached_property
    def column_units(self) -> Array:
        """(6 + l,) of r and q, so that each moves the contacts by about 1."""
        return np.concatenate([[1.0, 1.0, 1.0], np.full(3, 1.0 / self.size), 1.0 / self.joint_arms])

    @cached_property
    def row_units(self) -> Array:
        """(N + 1,) motions of `rows` per unit of motion at the contacts; forces are the other way round."""
        return self._units_of(self.rows[0])

    @cached_property
    def told_units(self) -> Array:
        """(N + 1,) the same with turns about the contacts' centroid: wherever the origin is."""
        M = self.rows[0].copy()
        M[:, 3:6] -= cross_rows(self.centroid, M[:, :3])
        return self._units_of(M)

    def _units_of(self, M: Array) -> Array:
        size = np.sqrt(((M * self.column_units) ** 2).sum(axis=1))
        return np.where(size > 0, size, 1.0)

    @cached_property
    def force_arms(self) -> tuple[Array, Array]:
        """(m,) [m] and (m, l): torques that a force at a contact makes at most, its torsion over the lever among it.

        About the contacts' centroid, and of each joint.
        """
        J = np.sqrt((self.J.reshape(self.m, 3, self.l) ** 2).sum(axis=1))
        J[self.soft] += np.abs(self.twist_jacobian)
        return np.linalg.norm(self.positions - self.centroid, axis=1) + self.lever, J

    @cached_property
    def contact_rows(self) -> Integers:
        """(m, 4) rows of d_n, d_t1, d_t2 and the turning of each contact; N, which is none, at point contacts."""
        out = np.full((self.m, 4), len(self.rows[0]) - 1)
        out[:, :3] = np.arange(3 * self.m).reshape(-1, 3)
        out[self.soft, 3] = 3 * self.m + np.arange(len(self.soft))
        return out

    @property
    def exact_table(self) -> Array:
        """(N + 1, 6 + l) `rows` as rational numbers."""
        if not self._exact_tables:
            places = self.positions, self.frames, self.axes, self.origins, self.lever
            maps = self._built(cross_rows, np.subtract, *(exact(x) for x in places))
            self._exact_tables.append(self._table(maps, exact(self.R), exact(self.A), np.negative))
        return self._exact_tables[0]

    @cached_property
    def _exact_tables(self) -> list[Array]:
        """`exact_table`, once somebody asked for it: of all steps of a path."""
        return []

    @cached_property
    def exact_rows(self) -> list[list[fmpq]]:
        """The same as lists."""
        return self.exact_table.tolist()

    @cached_property
    def independent_rows(self) -> dict[bytes, Integers | None]:
        """Of sets of held rows: some that the others follow from, exactly; None if that is not so. Filled in use."""
        return {}

    # --- the maps, rounded, and the absolute values behind them

    @cached_property
    def _maps(self) -> Maps:
        return self._built(cross_rows, np.subtract, self.positions, self.frames, self.axes, self.origins, self.lever)

    @cached_property
    def sizes(self) -> Maps:
        """As G, J, twist map and twist Jacobian, sums of absolute values: rounding is at most a few ulp of these.

        They are 0 only where the exact entries are, though products underflow.
        """
        places = [np.abs(x) for x in (self.positions, self.frames, self.axes, self.origins, self.lever)]
        sums, some = (self._built(_crossed, np.add, *own) for own in (places, [(x > 0).astype(float) for x in places]))
        G, J, twist, turned = (np.where(y > 0, np.maximum(x, 5e-324), 0.0) for x, y in zip(sums, some, strict=True))
        return G, J, twist, turned

    def _built(
        self, product: Any, less: Any, positions: Array, frames: Array, axes: Array, origins: Array, lever: Array
    ) -> Maps:
        """Of floats or rational numbers. product, less: the cross product and the difference, or bounds of these."""
        m, l, soft = self.m, self.l, self.soft
        columns = frames.transpose(0, 2, 1)  # (m, 3 directions, 3)
        G = np.concatenate([columns, product(positions[:, None], columns)], axis=2).reshape(3 * m, 6).T
        arm = less(positions[:, None], origins[None])
        speed = np.where(self.revolute[None, :, None], product(axes[None], arm), axes[None]) * self.moves[..., None]
        J = np.einsum("ikx,ijx->ikj", columns, speed).reshape(3 * m, l)
        normals = lever[soft, None] * columns[soft, 0]
        twist_map = np.concatenate([np.zeros((3, len(soft)), dtype=G.dtype), normals.T])
        return G, J, twist_map, (normals @ axes.T) * (self.moves & self.revolute)[soft]

    @property
    def G(self) -> Array:
        """(6, 3m) grasp map: contact forces (n, t1, t2 each) to the wrench on the object, (1)."""
        return self._maps[0]

    @property
    def J(self) -> Array:
        """(3m, l) contact Jacobian: joint motion to the finger's motion in the contact frames, (3)."""
        return self._maps[1]

    @property
    def twist_map(self) -> Array:
        """(6, s) torsions of soft fingers over their levers [N] to the wrench on the object."""
        return self._maps[2]

    @property
    def twist_jacobian(self) -> Array:
        """(s, l) joint motion to the turning about the normal of each soft finger, times its lever [m]."""
        return self._maps[3]


def read_grasp(data: Any, place: str) -> GraspData:
    """The grasp in a parsed `handfast/grasp/1` object; what no equation knows is read past.

    Raises:
        BadFile: the field, what is wrong, and what would be right.
    """
    f = Fields(data, place)
    f.text("schema", among=["handfast/grasp/1"])
    for name in ("name", "mass", "center_of_mass", "provenance"):
        f.take(name, None)
    contacts, joints = list(f.objects("contacts")), list(f.objects("joints", []))
    if not 0 < len(contacts) <= MAX_GRASP_SIZE or len(joints) > MAX_GRASP_SIZE:
        raise BadFile(
            f"has {len(contacts)} contacts and {len(joints)} joints; 1 to {MAX_GRASP_SIZE} are possible", place
        )
    of_contacts = [_contact(c) for c in contacts]
    of_joints = [_joint(j, len(contacts)) for j in joints]
    names = tuple(str(j["name"]) for j in of_joints)
    _refuse_twice(names, f.at("joints"))
    moves = np.zeros((len(contacts), len(joints)), dtype=bool)
    for j, joint in enumerate(of_joints):
        moves[joint["moves"], j] = True
    actuators, R, A, tendon, backdrivable = _mechanism(f, names)

    def stacked(rows: list[dict[str, Any]], name: str, *shape: int) -> Array:
        return np.array([row[name] for row in rows], dtype=float).reshape(len(rows), *shape)

    out = GraspData(
        positions=stacked(of_contacts, "position", 3),
        frames=stacked(of_contacts, "frame", 3, 3),
        mu=stacked(of_contacts, "friction"),
        lever=stacked(of_contacts, "lever"),
        links=tuple(c["link"] for c in of_contacts),
        joints=names,
        axes=stacked(of_joints, "axis", 3),
        origins=stacked(of_joints, "origin", 3),
        revolute=np.array([j["type"] == "revolute" for j in of_joints], dtype=bool),
        moves=moves,
        friction=stacked(of_joints, "friction"),
        torque=stacked(of_joints, "torque"),
        stop=np.array([STOP_SIDES.index(j["stop"]) for j in of_joints], dtype=np.int64),
        actuators=actuators,
        R=R,
        A=A,
        tendon=tendon,
        backdrivable=backdrivable,
        command=np.zeros(len(actuators)),
    )
    command = out.commands(f.named("preload", {}), f.at("preload"))
    f.done()
    return out.with_command(command)


def read_start(f: Fields, g: GraspData) -> GraspData:
    """The grasp in a step that starts from what the field `from` says. Raises `BadFile`."""
    start = f.object("from")
    out = StartData(*(start.numbers(name, (n,)) for name, n in (("gaps", g.m), ("stops", g.l), ("slack", g.a))))
    start.done()
    for name in ("stops", "slack"):
        if (getattr(out, name) < 0).any():
            raise BadFile("has a negative number; 0 or more is needed", start.at(name))
    return g.with_start(out)


def _contact(f: Fields) -> dict[str, Any]:
    normal, mu = _unit(f, "normal"), f.number("friction", least=0.0)
    out: dict[str, Any] = {"position": f.numbers("position", (3,)), "frame": _frame(normal), "friction": mu}
    torsion = f.number("torsion", 0.0, least=0.0)
    if torsion > 0 and mu == 0:
        raise BadFile(f"is {torsion:g} where friction is 0; a soft finger needs both", f.at("torsion"))
    if torsion > 0 and not MIN_LEVER < torsion / mu < 1 / MIN_LEVER:
        raise BadFile(f"is {torsion:g} beside a friction of {mu:g}; their ratio is a length of a hand", f.at("torsion"))
    out |= {"lever": torsion / mu if torsion > 0 else 0.0, "link": f.text("link", "")}
    f.take("depth", None)
    f.done()
    return out


def _joint(f: Fields, m: int) -> dict[str, Any]:
    moves = f.numbers("moves", (-1,))
    if (moves != np.round(moves)).any() or (moves < 0).any() or (moves >= m).any():
        raise BadFile(f"has a contact that is none; they are 0 to {m - 1}", f.at("moves"))
    out: dict[str, Any] = {"name": f.text("name"), "axis": _unit(f, "axis"), "origin": f.numbers("origin", (3,))}
    out |= {"moves": moves.astype(np.intp), "type": f.text("type", "revolute", among=["revolute", "prismatic"])}
    out |= {"friction": f.number("friction", 0.0, least=0.0), "torque": f.number("torque", 0.0)}
    out["stop"] = f.text("stop", "", among=STOP_SIDES)
    f.done()
    return out


def _mechanism(f: Fields, joints: Sequence[str]) -> tuple[tuple[str, ...], Array, Array, Mask, Mask]:
    """Names, R, A, tendon and backdrivable; a motor for each joint where there is none."""
    l = len(joints)
    if not f.has("mechanism"):
        none = np.zeros(l, dtype=bool)
        return tuple(joints), np.eye(l), np.zeros((0, l)), none, none
    mech = f.object("mechanism")
    names, R, tendon, back = [], [], [], []
    for part in mech.objects("actuators"):
        names.append(part.text("name"))
        R.append(_row(part.named("joints"), joints, part.at("joints")))
        tendon.append(part.flag("tendon", False))
        back.append(part.flag("backdrivable", False))
        if tendon[-1] and back[-1]:
            raise BadFile(
                "is true of a tendon; leave tendon out, its command is all it pulls with", part.at("backdrivable")
            )
        part.done()
    tied = mech.take("couplings", [])
    if not isinstance(tied, Sequence) or isinstance(tied, str):
        raise BadFile("is no list", mech.at("couplings"))
    A = [_row(Fields({"x": row}).named("x"), joints, f"{mech.at('couplings')}[{i}]") for i, row in enumerate(tied)]
    mech.done()
    _refuse_twice(names, mech.at("actuators"))
    if len(names) > MAX_GRASP_SIZE or len(A) > MAX_GRASP_SIZE:
        raise BadFile(
            f"has {len(names)} actuators and {len(A)} couplings; at most {MAX_GRASP_SIZE} are possible", mech.place
        )
    shape = (-1, l) if l else (len(names), 0)
    flags = np.array(tendon, dtype=bool), np.array(back, dtype=bool)
    return tuple(names), np.array(R).reshape(shape), np.array(A).reshape(len(A), l), *flags


def _row(weights: dict[str, float], joints: Sequence[str], field: str) -> list[float]:
    for name in weights:
        refuse_unknown(name, joints, "joint", field)
    if not any(abs(x) >= 1e-50 for x in weights.values()):
        raise BadFile("moves no joint", field)
    return [weights.get(name, 0.0) for name in joints]


def _refuse_twice(names: Sequence[str], field: str) -> None:
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise BadFile(f"'{twice[0]}' is there twice", field)


def _unit(f: Fields, name: str) -> Array:
    """(3,) a unit vector; as it is where it is one but for rounding of its own."""
    v = f.numbers(name, (3,))
    length = float(np.linalg.norm(v))
    if not abs(length - 1.0) <= UNIT_TOLERANCE:
        raise BadFile(f"has length {length:.6g}; a unit vector is needed", f.at(name))
    return v if abs(length - 1.0) <= 4e-16 else v / length


def _frame(n: Array) -> Array:
    """(3, 3) columns n, t1, t2: t1 = n x e with the axis e that n is least along, the first of several; t2 = n x t1."""
    e = np.zeros(3)
    e[np.argmin(np.abs(n))] = 1.0
    t1 = cross_rows(n, e)
    t1 /= np.linalg.norm(t1)
    return np.column_stack([n, t1, cross_rows(n, t1)])


def _crossed(a: Array, b: Array) -> Array:
    """The cross product of absolute values, with plus signs."""
    a, b = np.broadcast_arrays(a, b)
    turned = (a[..., i] * b[..., j] + a[..., j] * b[..., i] for i, j in ((1, 2), (2, 0), (0, 1)))
    return np.stack(list(turned), axis=-1)
