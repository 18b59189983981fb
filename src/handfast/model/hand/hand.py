"""Hand: links, joints, limits and mechanism, with forward kinematics in plain numpy."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError, unknown_name
from handfast.core.presented import Presented
from handfast.core.transforms import MAX_COORDINATE, cross, rigid
from handfast.model.hand.joint_law import LAWS, NO_LAW, JointLaw, PassiveTendon, laws_named
from handfast.model.hand.loop import Loop, LoopClosure
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape

LIMIT_TOLERANCE = 1e-6  # [rad or m] rounding of a limit in a file is not a violation
MOST_LINKS, MOST_JOINTS, MOST_SHAPES = 300, 300, 3000  # robots have about a hundred links
LOOP_TOLERANCE = 0.01  # [rad or m] by which a simulated joint may be off, as simulators let the ends of a loop part


@dataclass(frozen=True, eq=False)
class Joint:
    """One degree of freedom of the link that carries it.

    Attributes:
        name: unique in the hand.
        type: "revolute" [rad] or "prismatic" [m].
        axis: (3,) unit, frame of the link it moves, taken when all of that link's joints are at `ref`.
        anchor: (3,) [m], a point on the axis, same frame.
        lower, upper: limits.
        ref: the value at which the link stands at its `pose` (0 in a URDF).
        law: dry friction, spring and stops of the joint itself; none unless given.
    """

    name: str
    type: Literal["revolute", "prismatic"]
    axis: Array
    anchor: Array
    lower: float
    upper: float
    ref: float = 0.0
    law: JointLaw = NO_LAW

    def __post_init__(self) -> None:
        if self.type not in ("revolute", "prismatic"):
            raise InputError(f"is {self.type}; revolute or prismatic is needed", field=self.name)
        axis = frozen(self.axis, (3,), f"{self.name}.axis")
        length = math.hypot(*axis)
        if length < 1e-9:
            raise InputError("is zero; a direction is needed", field=f"{self.name}.axis")
        if length > 1e9:
            raise InputError(f"has length {length:.3g}; a direction is needed", field=f"{self.name}.axis")
        object.__setattr__(self, "axis", frozen(axis / length, (3,), f"{self.name}.axis"))
        object.__setattr__(self, "anchor", frozen(self.anchor, (3,), f"{self.name}.anchor"))
        if np.abs(self.anchor).max() > MAX_COORDINATE:
            raise InputError(f"is more than {MAX_COORDINATE:g} m away", field=f"{self.name}.anchor")
        if not all(abs(x) <= MAX_COORDINATE for x in (self.lower, self.upper, self.ref)):
            numbers = f"are {self.lower:g} and {self.upper:g}, its reference {self.ref:g}"
            raise InputError(f"{numbers}; at most {MAX_COORDINATE:g} is possible", field=f"{self.name} limits")
        if not self.lower <= self.upper:
            limits = f"[{self.lower:g}, {self.upper:g}]"
            raise InputError(f"are {limits}; the lower one comes first", field=f"{self.name} limits")

    @cached_property
    def screw(self) -> Array:
        """(3, 4, 4) factors of the motion: of the travel, of the turn's sine, of 1 - its cosine (Rodrigues)."""
        out = np.zeros((3, 4, 4))
        if self.type == "prismatic":
            out[0, :3, 3] = self.axis
            return out
        x, y, z = self.axis
        skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        for factor, turn in zip(out[1:], (skew, skew @ skew), strict=True):
            factor[:3, :3], factor[:3, 3] = turn, -turn @ self.anchor
        return out

    def motion(self, value: float) -> Array:
        """(4, 4) how far a joint value moves the link from where it stands at `ref`, link frame."""
        x = value - self.ref
        return np.eye(4) + np.tensordot([x, np.sin(x), 1 - np.cos(x)], self.screw, axes=1)


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid part of the hand.

    Attributes:
        name: unique in the hand.
        parent: index of the parent link, -1 for the base; a parent comes before its children.
        pose: (4, 4) in the parent link's frame, with the link's joints at their `ref`.
        joints: indices into `Hand.joints` of the joints between the parent and this link, in order;
            () for a fixed link.
        shapes: convex collision shapes in the link frame; () if the file gives none.
        torsion: coefficient of torsional friction [m] of each shape, 0 for a hard one; () if all are hard.
    """

    name: str
    parent: int
    pose: Array
    joints: tuple[int, ...] = ()
    shapes: tuple[Shape, ...] = ()
    torsion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", rigid(self.pose, f"{self.name}.pose"))
        if len(self.torsion) not in (0, len(self.shapes)):
            raise InputError(f"has {len(self.torsion)} numbers for {len(self.shapes)} shapes", field="torsion")


@dataclass(frozen=True)
class Coupling:
    """A joint tied to another: q[joint] = ratio * q[driver] + offset; driver -1 ties it to `offset` alone."""

    joint: int
    driver: int
    ratio: float
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Hand(Presented):
    """A robot hand: a tree of links. Frame: the base link's, unless a method says otherwise. SI, radians.

    Attributes:
        name: of the hand.
        links: base first, parents before children.
        joints: length l, the order of every configuration q.
        mechanism: R (a, l) and A (k, l); the rows of A are the `couplings`, in order.
        couplings: the same with their offsets, so that a configuration can be completed.
        closing: (l,) of -1, 0, +1, the sense in which each joint closes the hand. The loaders guess it
            from the limits (see `guess_closing`), a heuristic; `with_closing` overrides it.
        breakaway: a coupled joint goes on alone when its driver is stopped by a contact further in on
            the same finger, like the Barrett hand's clutch; False for a rigid linkage.
        source: the file it was read from.
        non_colliding: pairs of link names that are not checked against each other, in either order.
        loops: pins that close loops of the linkage. Some joints follow from the others then (`dependent`), and
            how they do changes with the configuration: `mechanism_at` says it.
        tendons: those with friction, a spring or stops of their own.
        strengths: actuator -> largest force of its motor [N m or N] as the hand's file states it, without those of
            which it states none. They limit nothing by themselves: questions take them as `torque_limits`.
    """

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    mechanism: Mechanism
    couplings: tuple[Coupling, ...]
    closing: Array
    breakaway: bool = True
    source: str = ""
    non_colliding: frozenset[tuple[str, str]] = frozenset()
    loops: tuple[Loop, ...] = ()
    tendons: tuple[PassiveTendon, ...] = ()
    strengths: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for kind, names in (("link", self.link_names), ("joint", self.joint_names)):
            twice = sorted({n for n in names if names.count(n) > 1})
            if twice:
                raise InputError(f"{kind} '{twice[0]}' is defined twice", source=self.source or None)
        moved = [j for link in self.links for j in link.joints]
        if len(set(moved)) < len(moved):
            joint = self.joint_names[next(j for j in moved if moved.count(j) > 1)]
            raise InputError("moves two links, or one link twice; once is right", field=joint)
        self._refuse_circles()
        object.__setattr__(self, "closing", frozen(np.sign(self.closing), (self.l,), "closing"))
        if self.mechanism.R.shape[1] != self.l:
            columns = self.mechanism.R.shape[1]
            raise InputError(f"has {columns} columns for {self.l} joints", field="mechanism")
        for tendon in self.tendons:
            if tendon.row.shape != (self.l,):
                raise InputError(f"has {tendon.row.size} numbers for {self.l} joints", field=f"tendon {tendon.name}")
        for pair in self.non_colliding:
            for name in pair:
                if name not in self.link_names:
                    raise unknown_name("link", name, self.link_names, field="non_colliding")
        if self.loops:
            _ = self._closure  # loops that cannot be closed are refused here

    def _refuse_circles(self) -> None:
        """Couplings that are no numbers, tie a joint twice, or lead from a joint back to itself."""
        driver: dict[int, int] = {}
        for c in self.couplings:
            name = self.joint_names[c.joint]
            if not all(abs(x) <= MAX_COORDINATE for x in (c.ratio, c.offset)):
                numbers = f"ratio {c.ratio:g} and offset {c.offset:g}"
                raise InputError(f"has {numbers}; at most {MAX_COORDINATE:g} is possible", field=name)
            if c.joint in driver:
                raise InputError("is tied to two joints at once; one driver is needed", field=name)
            driver[c.joint] = c.driver
        for start in driver:
            j = start
            for _ in driver:
                j = driver.get(j, -1)
            if j in driver:
                problem = "follows itself, directly or through others; a joint that drives is needed"
                raise InputError(problem, field=self.joint_names[start])

    @property
    def l(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @cached_property
    def link_names(self) -> tuple[str, ...]:
        """Names of the links, base first."""
        return tuple(link.name for link in self.links)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of q."""
        return tuple(joint.name for joint in self.joints)

    @cached_property
    def closing_actuators(self) -> tuple[str, ...]:
        """Names of the actuators that drive a joint which closes: those that squeeze, without spreads."""
        squeezes = (self.mechanism.R != 0) @ (self.closing != 0)
        return tuple(n for n, yes in zip(self.mechanism.actuators, squeezes, strict=True) if yes)

    @cached_property
    def limits(self) -> Array:
        """(l, 2) lower and upper joint limits."""
        return frozen([[j.lower, j.upper] for j in self.joints], (self.l, 2), "limits")

    @cached_property
    def dependent(self) -> tuple[int, ...]:
        """Indices of the joints that follow from the others because the linkage closes loops; () for a tree."""
        return self._closure.dependent if self.loops else ()

    @cached_property
    def idle(self) -> tuple[int, ...]:
        """Indices of the joints of loops that no motor moves and that follow from none: they give way."""
        if not self.loops:
            return ()
        driven = np.abs(np.vstack([self.mechanism.R, self.mechanism.A])).max(axis=0, initial=0.0) > 0
        moves = np.abs(self.loop_rows(self.assembled, refuse=False)).max(axis=0) > 0
        return tuple(j for j in np.flatnonzero(moves & ~driven).tolist() if j not in self.dependent)

    @property
    def assembled(self) -> Array:
        """(l,) a configuration at which the loops are closed; of a tree, the joints' references."""
        return self._closure.assembled if self.loops else np.array([j.ref for j in self.joints])

    def may_collide(self, first: str, second: str) -> bool:
        """Whether two links, by name, are checked against each other."""
        return not {(first, second), (second, first)} & self.non_colliding

    def link(self, name: str) -> int:
        """Index of a link; `InputError` listing the known ones if there is none."""
        if name not in self.link_names:
            raise unknown_name("link", name, self.link_names)
        return self.link_names.index(name)

    def joint(self, name: str, *, field: str | None = None) -> int:
        """Index of a joint; `InputError` listing the known ones if there is none."""
        if name not in self.joint_names:
            raise unknown_name("joint", name, self.joint_names, field=field)
        return self.joint_names.index(name)

    def with_closing(self, closing: Mapping[str, int]) -> Hand:
        """The same hand with the closing sense of the named joints set to -1, 0 or +1.

        A coupled joint follows its driver unless it is named too.
        """
        signs = self.closing.copy()
        for name, sign in closing.items():
            if sign not in (-1, 0, 1):
                raise InputError(f"is {sign}; -1, 0 or 1 is needed", field=f"closing.{name}")
            signs[self.joint(name, field="closing")] = sign
        for c in self.couplings:
            if self.joints[c.joint].name not in closing:
                signs[c.joint] = np.sign(c.ratio) * signs[c.driver] if c.driver >= 0 else 0
        return replace(self, closing=signs)

    def with_laws(self, laws: str) -> Hand:
        """The same hand with some laws of its joints and tendons, of what it has, and no others.

        Args:
            laws: "all", "none", or some of "stops", "friction", "springs" with commas.
        """
        kept = laws_named(laws)
        if len(kept) == len(LAWS):
            return self
        tendons = tuple(replace(t, law=t.law.only(kept)) for t in self.tendons)
        joints = tuple(replace(j, law=j.law.only(kept)) for j in self.joints)
        return replace(self, joints=joints, tendons=tuple(t for t in tendons if t.law.any))

    def with_backdrivable(self, actuators: Collection[str]) -> Hand:
        """The same hand with some motors that give what they are commanded, whichever way they are turned.

        A tendon among them is then no more than its command. `InputError` for an unknown actuator.
        """
        if not actuators:
            return self
        known, m = self.mechanism.actuators, self.mechanism
        for name in actuators:
            if name not in known:
                raise unknown_name("actuator", name, known, field="backdrivable")
        free = tuple(n in actuators or b for n, b in zip(known, m.backdrivable, strict=True))
        tendon = tuple(t and not b for t, b in zip(m.tendon, free, strict=True))
        return replace(self, mechanism=replace(m, tendon=tendon, backdrivable=free))

    def configuration(self, values: Mapping[str, float] | None = None) -> Array:
        """(l,) full configuration from some joint values by name [rad, m].

        A missing coupled joint follows its driver (or the driver it); any other missing joint is 0,
        clipped to its limits. A joint given explicitly keeps its value even against a coupling, because
        a clutch may have opened. Joints that follow from loops are where these close; a value given for
        one has to be that to `LOOP_TOLERANCE`.

        Raises:
            InputError: unknown joint (the known ones are listed), a value that is not finite, given or
                coupled outside the limits by more than 1e-6, loops that cannot be closed.
        """
        q = np.full(self.l, np.nan)
        for name, value in (values or {}).items():
            j = self.joint(name)
            if not np.isfinite(value):
                raise InputError(f"is {value}; a finite number is needed", field=name)
            q[j] = value
        given = q[list(self.dependent)]
        for j, value in zip(self.dependent, given, strict=True):
            q[j] = self._closure.assembled[j] if np.isnan(value) else value
        self._follow(q)
        for j in range(self.l):
            drives = any(c.driver == j for c in self.couplings)
            if np.isnan(q[j]) and (drives or not any(c.joint == j for c in self.couplings)):
                q[j] = np.clip(0.0, self.joints[j].lower, self.joints[j].upper)
                self._follow(q)
        if self.loops:
            q = self.closed(q)
            for j, value in zip(self.dependent, given, strict=True):
                if abs(value - q[j]) > LOOP_TOLERANCE:  # not where it was not given
                    right = f"the loop that it is in puts it at {q[j]:.6g}; leave it out"
                    raise InputError(f"is {value:g}, but {right}", field=self.joint_names[j])
        for j, (joint, value) in enumerate(zip(self.joints, q, strict=True)):
            if not joint.lower - LIMIT_TOLERANCE <= value <= joint.upper + LIMIT_TOLERANCE:
                through = "loop" if j in self.dependent else "coupling"
                how = "" if joint.name in (values or {}) else f" through its {through}"
                raise InputError(
                    f"is {value:g}{how}; the limits are [{joint.lower:g}, {joint.upper:g}]", field=joint.name
                )
        return q

    def _follow(self, q: Array) -> None:
        """Fill in the NaN of q that a coupling to a known joint determines, until nothing changes."""
        for _ in range(len(self.couplings)):
            for c in self.couplings:
                if np.isnan(q[c.joint]) and c.driver < 0:
                    q[c.joint] = c.offset
                elif np.isnan(q[c.joint]):
                    q[c.joint] = c.ratio * q[c.driver] + c.offset
                elif c.driver >= 0 and np.isnan(q[c.driver]) and c.ratio:
                    q[c.driver] = (q[c.joint] - c.offset) / c.ratio

    def closed(self, q: Array, start: Array | None = None, *, as_far_as_possible: bool = False) -> Array:
        """q (l,) with the joints that follow from loops where these close; of a tree, q. See `LoopClosure.closed`."""
        return self._closure.closed(q, start, as_far_as_possible=as_far_as_possible) if self.loops else q

    def mechanism_at(self, q: Array) -> Mechanism:
        """The mechanism, with the loops as they are at q (l,): rows of A that hold to first order there.

        By virtual work their multipliers are the forces in the pins; no motor sees them. See `LoopClosure.rows`.
        """
        if not self.loops:
            return self.mechanism
        return replace(self.mechanism, A=np.vstack([self.mechanism.A, self.loop_rows(q)]))

    def loop_rows(self, q: Array, *, refuse: bool = True) -> Array:
        """(k, l) of the joints that follow from loops: see `LoopClosure.rows`; of a tree, none."""
        return self._closure.rows(q, refuse=refuse) if self.loops else np.zeros((0, self.l))

    @cached_property
    def _closure(self) -> LoopClosure:
        """The loops, assembled from where the links stand at their `pose`."""
        follow, offset = np.eye(self.l), np.zeros(self.l)
        for c in self.couplings:
            follow[c.joint] = 0.0
        for _ in self.couplings:  # a driver may itself be coupled
            for c in self.couplings:
                follow[c.joint] = c.ratio * follow[c.driver] if c.driver >= 0 else 0.0
                offset[c.joint] = c.offset + (c.ratio * offset[c.driver] if c.driver >= 0 else 0.0)
        return LoopClosure.of(
            self.joint_names,
            self._gaps,
            (follow, offset),
            self.limits,
            [j.type == "prismatic" for j in self.joints],
            tuple(loop.name for loop in self.loops),
            np.array([j.ref for j in self.joints]),
            np.abs(self.mechanism.R @ follow).max(axis=0, initial=0.0) > 0,
        )

    @cached_property
    def _pin_chains(self) -> Array:
        """(n, 2, l) 1 for the joints that move the first end of each pin, -1 for those that move the second."""
        out = np.zeros((len(self.loops), 2, self.l))
        for k, loop in enumerate(self.loops):
            out[k, 0, list(self.moved_by(loop.first))] = 1.0
            out[k, 1, list(self.moved_by(loop.second))] = -1.0
        return out

    def _gaps(self, q: Array) -> tuple[Array, Array]:
        """(3n,) [m] from the second link's point of each pin to the first's, base frame, and the Jacobian (3n, l)."""
        poses, axes, origins = self._frames(q)
        slides = np.array([j.type == "prismatic" for j in self.joints])
        ends = [[(o.first, o.on_first), (o.second, o.on_second)] for o in self.loops]
        at = np.array([[poses[i][:3, :3] @ x + poses[i][:3, 3] for i, x in pair] for pair in ends])  # (n, 2, 3)
        arm = at[:, :, None] - origins
        turned = axes[:, [1, 2, 0]] * arm[..., [2, 0, 1]] - axes[:, [2, 0, 1]] * arm[..., [1, 2, 0]]
        speed = np.where(slides[:, None], axes, turned)  # (n, 2, l, 3) of each end by each joint
        J = np.einsum("nel,nelk->nkl", self._pin_chains, speed)
        return (at[:, 0] - at[:, 1]).ravel(), J.reshape(-1, self.l)

    def values(self, q: Array) -> dict[str, float]:
        """A configuration by joint name."""
        return {name: float(value) for name, value in zip(self.joint_names, q, strict=True)}

    @cached_property
    def _screws(self) -> tuple[Array, Array]:
        """`ref` (l,) and `screw` (3, l, 1, 4, 4) of all joints."""
        screws = np.array([j.screw for j in self.joints]).reshape(-1, 3, 1, 4, 4).swapaxes(0, 1)
        return np.array([j.ref for j in self.joints]), np.ascontiguousarray(screws)

    def motions(self, q: Array) -> Array:
        """(l, ..., 4, 4) `Joint.motion` of every joint at q (..., l)."""
        ref, (travel, turn, twice) = self._screws
        x = (q - ref).reshape(math.prod(q.shape[:-1]), self.l).T[:, :, None, None]
        T = np.eye(4) + x * travel + np.sin(x) * turn + (1 - np.cos(x)) * twice
        return np.asarray(T.reshape(self.l, *q.shape[:-1], 4, 4))

    def link_poses(self, q: Array) -> Array:
        """(n_links, ..., 4, 4) link frames in the base frame at q (..., l)."""
        motions = self.motions(q)
        poses = np.empty((len(self.links), *q.shape[:-1], 4, 4))
        for i, link in enumerate(self.links):
            T = poses[link.parent] @ link.pose if link.parent >= 0 else np.eye(4)
            for j in link.joints:
                T = T @ motions[j]
            poses[i] = T
        return poses

    def joint_axes(self, q: Array) -> tuple[Array, Array]:
        """Unit axes (l, 3) and points on them (l, 3) [m] in the base frame at q (l,)."""
        return self._frames(q)[1:]

    def _frames(self, q: Array) -> tuple[Array, Array, Array]:
        """`link_poses`, and `joint_axes`."""
        axes, origins = np.zeros((self.l, 3)), np.zeros((self.l, 3))
        poses, motions = np.empty((len(self.links), 4, 4)), self.motions(q)
        for i, link in enumerate(self.links):
            T = poses[link.parent] @ link.pose if link.parent >= 0 else np.eye(4)
            for j in link.joints:
                axes[j] = T[:3, :3] @ self.joints[j].axis
                origins[j] = T[:3, :3] @ self.joints[j].anchor + T[:3, 3]
                T = T @ motions[j]
            poses[i] = T
        return poses, axes, origins

    def moved_by(self, link: int) -> tuple[int, ...]:
        """Indices of the joints between the base and a link, base first: those that move it."""
        chain: list[int] = []
        while link >= 0:
            chain[:0] = self.links[link].joints
            link = self.links[link].parent
        return tuple(chain)

    def jacobian(self, link: int, point: Array, q: Array) -> Array:
        """(3, l) velocity of a point (3,) [m], base frame, fixed to a link, per unit joint speed."""
        return self.jacobian_about(link, point, *self.joint_axes(q))

    def jacobian_about(self, link: int, point: Array, axes: Array, origins: Array) -> Array:
        """As `jacobian`, from the joints' axes (l, 3) and points on them (l, 3): `joint_axes`."""
        J = np.zeros((3, self.l))
        for j in self.moved_by(link):
            straight = self.joints[j].type == "prismatic"
            J[:, j] = axes[j] if straight else cross(axes[j], point - origins[j])
        return J

    def __repr__(self) -> str:
        return f"Hand({self.name!r}, {len(self.links)} links, {self.l} joints, {self.mechanism.a} actuators)"


def refuse_large(links: int, joints: int, shapes: int) -> None:
    """`InputError` for numbers that no hand has: what is asked of pairs of links or shapes would come to no end."""
    for count, most, what in (
        (links, MOST_LINKS, "links"),
        (joints, MOST_JOINTS, "joints"),
        (shapes, MOST_SHAPES, "collision shapes"),
    ):
        if count > most:
            raise InputError(f"has {count} {what}; a hand has at most {most}")


def guess_closing(joints: tuple[Joint, ...], couplings: tuple[Coupling, ...]) -> Array:
    """(l,) closing senses guessed from the limits alone: a heuristic, to be overridden where it is wrong.

    A joint that can go at least twice as far one way as the other closes that way; any other joint is
    taken for a spread or an abduction, which does not close (0). A spread with a one-sided range is
    guessed wrong: say so with `Hand.with_closing`. Coupled joints follow their drivers.
    """
    closing = np.zeros(len(joints))
    for j, joint in enumerate(joints):
        if abs(joint.upper) >= 2 * abs(joint.lower) and joint.upper > 0:
            closing[j] = 1
        elif abs(joint.lower) >= 2 * abs(joint.upper) and joint.lower < 0:
            closing[j] = -1
    for c in couplings:
        closing[c.joint] = np.sign(c.ratio) * closing[c.driver] if c.driver >= 0 else 0
    return closing


def coupling_rows(couplings: tuple[Coupling, ...], joints: int) -> Array:
    """(k, l) rows of A for l joints: q[joint] - ratio * q[driver] is constant."""
    A = np.zeros((len(couplings), joints))
    for row, c in zip(A, couplings, strict=True):
        row[c.joint] = 1.0
        if c.driver >= 0:
            row[c.driver] = -c.ratio
    return A


def direct_mechanism(joints: Sequence[str], couplings: tuple[Coupling, ...]) -> Mechanism:
    """One motor for each joint, by name, that is coupled to no other, named like the joint."""
    l, tied = len(joints), {c.joint for c in couplings}
    driven = [j for j in range(l) if j not in tied]
    names = tuple(joints[j] for j in driven)
    return Mechanism(names, np.eye(l)[driven], coupling_rows(couplings, l), (False,) * len(driven))
