"""Contact and Grasp: the one table (G, J, mechanism, preload) where both halves of Handfast meet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from handfast.core.arrays import Array, Indices, Mask, frozen
from handfast.core.errors import InputError, refuse_other_kinds, require_not_negative
from handfast.core.presented import Presented
from handfast.core.schema import LEFT_OUT, InFiles, Vector3
from handfast.core.transforms import cross, normal_frame
from handfast.model.mechanism import Mechanism
from handfast.model.start import Start
from handfast.proofs.constants import MAX_GRASP_SIZE, MIN_LEVER

if TYPE_CHECKING:
    from handfast.model.provenance import Provenance

NORMAL_TOLERANCE = 1e-3  # a normal may be off unit length by rounding in a file; it is then normalised
# 3 x contacts + joints + 2 x actuators + 2 x soft fingers of a grasp at most. The search names its unknowns, at most
# this and 7, and the values that it bounds, at most this and 9 less two for each contact, by one byte
SPANS = 1e-6  # relative singular value of the grasp map from which on contact forces balance any disturbance
NO_LENGTH = 1e-14  # relative: what rounding leaves of a length that is none


def unit(v: object, field: str) -> Array:
    """`v` as a unit 3-vector; raises `InputError` unless its length is 1 within `NORMAL_TOLERANCE`."""
    a = frozen(v, (3,), field)
    length = float(np.linalg.norm(a))
    if length < 1e-12:
        raise InputError("is zero; a unit vector is needed", field=field)
    if abs(length - 1.0) > NORMAL_TOLERANCE:
        raise InputError(f"has length {length:.6g}; a unit vector is needed", field=field)
    # what is of unit length already is left as it is: files restore it exactly
    return a if abs(length - 1.0) <= 4e-16 else frozen(a / length, (3,), field)


@dataclass(frozen=True, eq=False)
class Contact(InFiles):
    """A point contact with friction (stability paper, section III), or a soft finger that resists torsion, too.

    The friction of a soft finger is in an ellipsoid, |c_t|^2 / mu^2 + tau^2 / mu_tau^2 <= c_n^2, with the torque tau
    about the normal; see docs/soft-fingers.md.

    Attributes:
        position: (3,) [m], object frame.
        normal: (3,) unit, object frame, pointing **into** the object.
        friction: coefficient mu >= 0.
        link: the hand link that touches; "" if unknown.
        depth: penetration [m]; negative is a gap. Information only, no equation uses it.
        torsion: coefficient mu_tau >= 0 of torsional friction [m]: the largest torque about the normal over the normal
            force. 0 is a point contact. Needs a friction above 0.
    """

    position: Vector3
    normal: Vector3
    friction: float
    link: str = ""
    depth: float = 0.0
    torsion: float = field(default=0.0, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        object.__setattr__(self, "position", frozen(self.position, (3,), "position"))
        object.__setattr__(self, "normal", unit(self.normal, "normal"))
        mu = float(self.friction)
        require_not_negative(mu, "friction", "a friction coefficient is 0 or more")
        object.__setattr__(self, "friction", mu)
        torsion = float(self.torsion)
        require_not_negative(torsion, "torsion", "a coefficient of torsional friction is 0 or more [m]")
        if torsion > 0 and mu == 0:
            right = "a soft finger needs a friction above 0, else set torsion to 0"
            problem = f"is {torsion:g} m where friction is 0; {right}"
            raise InputError(problem, field="torsion")
        if torsion > 0 and not MIN_LEVER < torsion / mu < 1 / MIN_LEVER:
            problem = f"is {torsion:g} m beside a friction of {mu:g}; their ratio is to be a length of a hand"
            raise InputError(problem, field="torsion")
        object.__setattr__(self, "torsion", torsion)

    @cached_property
    def frame(self) -> Array:
        """(3, 3) orthonormal columns n, t1, t2 in the object frame, see `normal_frame`."""
        return frozen(normal_frame(self.normal), (3, 3), "frame")


@dataclass(frozen=True, eq=False)
class GraspJoint(InFiles):
    """A joint as the grasp sees it, at the grasp's configuration.

    Attributes:
        name: unique among the joints.
        axis: (3,) unit, object frame. A positive motion about (along) it is the closing sense.
        origin: (3,) [m], a point on the axis, object frame.
        moves: indices of the contacts whose finger side this joint moves.
        type: "revolute" or "prismatic".
        friction: dry friction of the joint, the largest torque or force that it takes [N m, N]; 0 or more.
        torque: what acts on the joint besides, whatever it does, as of a spring [N m, N]; positive closes.
        stop: the limits at which the joint stands, beyond which it does not move: "lower" (it cannot open further),
            "upper" (it cannot close further), "both", or "" for none.
    """

    name: str
    axis: Vector3
    origin: Vector3
    moves: tuple[int, ...]
    type: Literal["revolute", "prismatic"] = "revolute"
    friction: float = field(default=0.0, metadata=LEFT_OUT)
    torque: float = field(default=0.0, metadata=LEFT_OUT)
    stop: Literal["", "lower", "upper", "both"] = field(default="", metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", unit(self.axis, "axis"))
        object.__setattr__(self, "origin", frozen(self.origin, (3,), "origin"))
        object.__setattr__(self, "moves", tuple(int(i) for i in self.moves))
        if self.type not in ("revolute", "prismatic"):
            raise InputError(f"is '{self.type}'; 'revolute' or 'prismatic' is needed", field="type")
        for name in ("friction", "torque"):
            value = float(getattr(self, name))
            if not np.isfinite(value):
                raise InputError(f"is {value}; a finite number is needed", field=name)
            object.__setattr__(self, name, value)
        if self.friction < 0:
            raise InputError(f"is {self.friction:g}; the friction of a joint is 0 or more [N m, N]", field="friction")
        if self.stop not in ("", "lower", "upper", "both"):
            raise InputError(f"is '{self.stop}'; 'lower', 'upper', 'both' or '' is needed", field="stop")

    def velocity_at(self, point: Array) -> Array:
        """(3,) velocity of a point of the moved finger per unit joint speed, object frame."""
        if self.type == "prismatic":
            return self.axis
        return cross(self.axis, point - self.origin)


@dataclass(frozen=True, eq=False)
class Grasp(Presented):
    """Contacts of a hand on an object, the joints behind them and what their actuators command.

    Everything is in the object frame and SI units. Immutable: `with_preload` and `with_friction`
    return changed copies. Build one from contacts and joints, from a hand (`handfast.geometry.contacts`), or
    read a `handfast/grasp/1` file (`handfast.load_grasp`).

    Attributes:
        contacts: at least one.
        joints: may be empty (a fixture).
        mechanism: R and A; `Mechanism.direct` unless given.
        command: (a,) commanded actuator forces f_c; 0 is a locked actuator.
        name: for reports.
        mass: of the object [kg]; None if unknown.
        center_of_mass: (3,) of the object [m], object frame; None if unknown. No equation uses mass or centre:
            a load says itself what it is, see `gravity_wrench`.
        provenance: the files of hand, object and configuration; None if unknown.
        start: the state that a step of a load's path starts from, see `with_start`; None where nothing has moved yet.

    Raises:
        InputError: no contacts, `moves` out of range, a joint named twice, names that are not one line of printable
            characters, a mechanism of the wrong size, more
            contacts, joints and actuators than can be searched (`MAX_GRASP_SIZE`).
    """

    contacts: tuple[Contact, ...]
    joints: tuple[GraspJoint, ...]
    mechanism: Mechanism
    command: Array
    name: str = "grasp"
    mass: float | None = None
    center_of_mass: Array | None = None
    provenance: Provenance | None = None
    start: Start | None = None

    def __init__(
        self,
        contacts: Sequence[Contact],
        joints: Sequence[GraspJoint] = (),
        mechanism: Mechanism | None = None,
        preload: Mapping[str, float] | Array | None = None,
        name: str = "grasp",
        *,
        mass: float | None = None,
        center_of_mass: object = None,
        provenance: Provenance | None = None,
    ) -> None:
        put = object.__setattr__
        for name_, value in _object_facts(mass, center_of_mass, provenance).items():
            put(self, name_, value)
        put(self, "contacts", tuple(contacts))
        put(self, "joints", tuple(joints))
        put(self, "name", name)
        if not self.contacts:
            raise InputError("is empty; a grasp needs at least one contact", field="contacts")
        names = [j.name for j in self.joints]
        for where, text in [("name", name), *((f"joints[{i}].name", n) for i, n in enumerate(names))]:
            if not text.isprintable():
                raise InputError(f"is {text!r}; a name is one line of printable characters", field=where)
        actuators = len(names) if mechanism is None else mechanism.a
        soft = sum(c.torsion > 0 for c in self.contacts)
        if 3 * self.m + self.l + 2 * actuators + 2 * soft > MAX_GRASP_SIZE:
            sizes = f"{self.m} contacts, {self.l} joints and {actuators} actuators"
            right = f"3 x contacts + joints + 2 x actuators may be {MAX_GRASP_SIZE} at most"
            if soft:
                right = f"3 x contacts + joints + 2 x actuators + 2 x soft fingers may be {MAX_GRASP_SIZE} at most"
            raise InputError(f"has {sizes}, too many to search; {right}", field="grasp")
        for i, joint in enumerate(self.joints):
            if names.index(joint.name) != i:
                raise InputError(f"'{joint.name}' is the name of two joints", field=f"joints[{i}].name")
            bad = [k for k in joint.moves if not 0 <= k < self.m]
            if bad:
                raise InputError(
                    f"has contact {bad[0]}, out of range: contacts are 0 to {self.m - 1}",
                    field=f"joints[{i}].moves",
                )
        put(self, "mechanism", Mechanism.direct(names) if mechanism is None else mechanism)
        if self.mechanism.R.shape[1] != self.l:
            raise InputError(
                f"has {self.mechanism.R.shape[1]} joint columns, the grasp has {self.l} joints",
                field="mechanism",
            )
        if preload is None or isinstance(preload, Mapping):
            put(self, "command", self.mechanism.commands(preload))
        else:
            put(self, "command", frozen(preload, (self.mechanism.a,), "preload"))
        put(self, "start", None)

    @classmethod
    def from_matrices(
        cls,
        G: object,
        J: object,
        friction: object,
        *,
        normal: int = 0,
        joints: Sequence[str] | None = None,
        types: Sequence[str] | None = None,
        mechanism: Mechanism | None = None,
        preload: Mapping[str, float] | Array | None = None,
        name: str = "grasp",
    ) -> Grasp:
        """A grasp from a grasp map and a hand Jacobian that are known already.

        The conventions are the stability paper's, (1) to (3). A contact force c_i has three components along the
        columns of contact i's frame F_i: normal, tangent, tangent. G maps all of them to the wrench on the object,
        w = G c, so that columns 3 i to 3 i + 2 of G are [F_i; p_i x F_i]: force on top, torque about the origin of the
        object's frame below. J maps joint motion to the motion of the fingers at the contacts in the same frames,
        J q, so that joint torques are tau = J^T c. Positions and frames are read off G; nothing else is needed.

        A column of J that no single joint has, as of coupled joints that were reduced to one, becomes several joints
        with rigid couplings, one for each contact. All answers depend on G, J, friction and the mechanism alone.

        Args:
            G: (6, 3 m). Each frame is orthonormal, of either hand; its normal points **into** the object. The grasp
                has its own tangents, see `Contact.frame`: its `G` and `J` are these in other tangents, and friction
                is the same in all of them.
            J: (3 m, l) [m/rad, or 1 for a prismatic joint]. A positive motion is the closing sense.
            friction: coefficients (m,), or one for all.
            normal: which of each contact's three columns is the normal: 0, or 2 where z is the normal.
            joints: l names; joint_1, joint_2, ... unless given.
            types: l of "revolute" and "prismatic"; all revolute unless given. They tell units: of commands, N m or N.
            mechanism: R and A over these l joints; one motor for each, named like it, unless given.
            preload: commanded actuator forces by name, or (a,); absent ones are locked.

        Raises:
            InputError: shapes that do not belong together, a frame that is not orthonormal, moments that are not those
                of a force at a point, NaN, another type, and what `Grasp` raises.
        """
        from handfast.model.matrices import numbers_of

        found = numbers_of(G, J, normal, joints, types, mechanism)
        m = len(found.positions)
        mu = frozen(np.full(m, friction) if np.ndim(friction) == 0 else friction, (m,), "friction")  # type: ignore[arg-type]
        contacts = [Contact(p, n, k) for p, n, k in zip(found.positions, found.normals, mu, strict=True)]
        return cls(contacts, [GraspJoint(*joint[:-1]) for joint in found.joints], found.mechanism, preload, name)

    @property
    def m(self) -> int:
        """Number of contacts."""
        return len(self.contacts)

    @property
    def l(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @cached_property
    def middle(self) -> Array:
        """(3,) [m] the mean of the contacts' positions, about which torques are measured."""
        return frozen(self.positions.mean(axis=0), (3,), "middle")

    @cached_property
    def mu(self) -> Array:
        """(m,) friction coefficients."""
        return frozen([c.friction for c in self.contacts], (self.m,), "friction")

    @cached_property
    def G(self) -> Array:
        """(6, 3m) grasp map: contact forces (n, t1, t2 each) to the wrench on the object, equation (1)."""
        G = np.zeros((6, 3 * self.m))
        for i, c in enumerate(self.contacts):
            for k in range(3):
                G[:3, 3 * i + k] = c.frame[:, k]
                G[3:, 3 * i + k] = cross(c.position, c.frame[:, k])
        return frozen(G, G.shape, "G")

    @cached_property
    def J(self) -> Array:
        """(3m, l) contact Jacobian: joint motion to finger motion in the contact frames, equation (3)."""
        J = np.zeros((3 * self.m, self.l))
        for j, joint in enumerate(self.joints):
            for i in joint.moves:
                c = self.contacts[i]
                J[3 * i : 3 * i + 3, j] = c.frame.T @ joint.velocity_at(c.position)
        return frozen(J, (3 * self.m, self.l), "J")

    @cached_property
    def soft(self) -> Indices:
        """(s,) which contacts are soft fingers."""
        out: Indices = np.flatnonzero([c.torsion > 0 for c in self.contacts])
        out.flags.writeable = False
        return out

    @cached_property
    def levers(self) -> Array:
        """(s,) [m] mu_tau / mu of the soft fingers: torsion over this is a force like c_t, see `twist_map`."""
        return frozen([c.torsion / c.friction for c in self.contacts if c.torsion > 0], (len(self.soft),), "levers")

    @cached_property
    def twist_map(self) -> Array:
        """(6, s) torsions of the soft fingers over their levers [N] to the wrench on the object."""
        out = np.zeros((6, len(self.soft)))
        for k, i in enumerate(self.soft):
            out[3:, k] = self.levers[k] * self.contacts[i].frame[:, 0]
        return frozen(out, out.shape, "twist_map")

    @cached_property
    def twist_jacobian(self) -> Array:
        """(s, l) joint motion to the finger's turning about the normal of each soft finger, times its lever [m]."""
        out = np.zeros((len(self.soft), self.l))
        for j, joint in enumerate(self.joints):
            for k, i in enumerate(self.soft):
                if joint.type == "revolute" and i in joint.moves:
                    out[k, j] = self.levers[k] * (self.contacts[i].frame[:, 0] @ joint.axis)
        return frozen(out, out.shape, "twist_jacobian")

    @cached_property
    def touches(self) -> Mask:
        """(l,) bool: which joints move a contact against the object."""
        out = np.asarray(self.J.any(axis=0) | self.twist_jacobian.any(axis=0))
        out.flags.writeable = False
        return out

    @cached_property
    def positions(self) -> Array:
        """(m, 3) [m] of the contacts, object frame."""
        return frozen([c.position for c in self.contacts], (self.m, 3), "positions")

    @cached_property
    def spacing(self) -> float:
        """[m] the least distance of two contacts, of a single one to the origin; 1 where all are one point."""
        p = self.positions
        apart = np.linalg.norm(p[:, None] - p[None], axis=2)
        nearest = apart[apart > 0].min(initial=np.inf)
        return float(nearest if np.isfinite(nearest) else np.linalg.norm(p[0])) or 1.0

    @cached_property
    def size(self) -> float:
        """Characteristic length [m]: the largest distance of a contact from the contacts' centroid.

        Where that is none but for rounding: the largest distance of a contact from a joint that turns it, else from
        the origin; 1 if there is no length at all.
        """
        p = self.positions
        r, far = float(np.linalg.norm(p - self.middle, axis=1).max()), float(np.abs(p).max())
        if r > NO_LENGTH * far:
            return r
        turns = [(p[i] - joint.origin) for joint in self.joints if joint.type == "revolute" for i in joint.moves]
        return max((float(np.linalg.norm(arm)) for arm in turns), default=0.0) or far or 1.0

    @cached_property
    def spans(self) -> bool:
        """Do some forces at the contacts, friction aside, balance any wrench, and not by rounding?"""
        alike = np.r_[np.ones(3), np.full(3, 1 / self.size)]
        sizes = np.linalg.svd(alike[:, None] * self.G, compute_uv=False)
        return len(sizes) == 6 and bool(sizes[-1] >= SPANS * sizes[0])

    @cached_property
    def given_torques(self) -> Array:
        """(l,) [N m or N] what acts on each joint whatever it does, see `GraspJoint.torque`."""
        return frozen([joint.torque for joint in self.joints], (self.l,), "torque")

    @cached_property
    def joint_friction(self) -> Array:
        """(l,) [N m or N] dry friction of each joint."""
        return frozen([joint.friction for joint in self.joints], (self.l,), "friction")

    @cached_property
    def has_laws(self) -> bool:
        """Has any joint friction, a given torque or a stop, or is a motor backdrivable?"""
        return any(joint.friction or joint.torque or joint.stop for joint in self.joints) or any(
            self.mechanism.backdrivable
        )

    def refuse_laws(self, what: str) -> None:
        """`InputError` if it has laws of joints, for what knows none: `what` in words."""
        if self.has_laws:
            problem = f"{what} knows no friction, springs and stops of joints, and no backdrivable motors"
            raise InputError(f"{problem}; leave them out", source=self.name, field="joints")

    def refuse_soft_fingers(self, what: str) -> None:
        """`InputError` if a contact has torsional friction, for what knows point contacts only: `what` in words."""
        if len(self.soft):
            problem = f"is {self.contacts[self.soft[0]].torsion:g} m; {what} knows point contacts only, leave it out"
            raise InputError(problem, source=self.name, field=f"contacts[{self.soft[0]}].torsion")

    @property
    def preload(self) -> dict[str, float]:
        """Commanded actuator forces by name, those that are not locked."""
        return {n: float(f) for n, f in zip(self.mechanism.actuators, self.command, strict=True) if f != 0}

    @property
    def sought_actuators(self) -> tuple[str, ...]:
        """Whose commands are sought unless others are named: those commanded now, or all; backdrivable ones never."""
        flags = zip(self.mechanism.actuators, self.command, self.mechanism.backdrivable, strict=True)
        own = [(name, f) for name, f, back in flags if not back]
        return tuple(name for name, f in own if f != 0) or tuple(name for name, _ in own)

    def with_commands(self, preload: Mapping[str, float]) -> Grasp:
        """As `with_preload`, but backdrivable motors that are not named stay as they are commanded."""
        back = dict(zip(self.mechanism.actuators, self.mechanism.backdrivable, strict=True))
        kept = {name: f for name, f in self.preload.items() if back[name]}
        return self.with_preload(kept | dict(preload))

    def with_laws_times(self, s: float) -> Grasp:
        """The same grasp with the friction and the given torques of its joints times s; as it is without any."""
        if s != 1.0 and self.start is not None:
            return self.with_start(None).with_laws_times(s).with_start(self.start.times(s))
        if not self.has_laws or s == 1.0:
            return self
        joints = [replace(joint, friction=s * joint.friction, torque=s * joint.torque) for joint in self.joints]
        out = self._changed(joints=tuple(joints))
        for cached in ("given_torques", "joint_friction"):
            out.__dict__.pop(cached, None)
        return out

    def with_preload(self, preload: Mapping[str, float] | Array | None) -> Grasp:
        """The same grasp with other commanded forces (absent actuators are locked)."""
        command = (
            self.mechanism.commands(preload)
            if preload is None or isinstance(preload, Mapping)
            else frozen(preload, (self.mechanism.a,), "preload")
        )
        return self._changed(command=command)  # on which nothing else depends

    def with_start(self, start: Start | None) -> Grasp:
        """The same grasp after a state, from which a step of a load's path starts; None for one where nothing moved.

        `with_contacts` and `about` leave it out.

        Raises:
            InputError: numbers that are not those of its contacts, joints and actuators.
        """
        if start is not None:
            for name, n in (("gaps", self.m), ("stops", self.l), ("slack", self.mechanism.a)):
                frozen(getattr(start, name), (n,), f"from.{name}")
        return self._changed(start=start)

    def _changed(self, **others: Any) -> Grasp:
        """A copy with other attributes: all of it has been checked."""
        out = object.__new__(Grasp)
        out.__dict__.update(self.__dict__, **others)
        return out

    def with_friction(self, mu: float) -> Grasp:
        """The same grasp with one friction coefficient at every contact; torsional friction stays as it is."""
        return self.with_contacts([replace(c, friction=mu) for c in self.contacts])

    def with_torsion(self, torsion: float) -> Grasp:
        """The same grasp with one coefficient of torsional friction [m] at every contact; 0 for point contacts."""
        return self.with_contacts([replace(c, torsion=torsion) for c in self.contacts])

    def with_contacts(self, contacts: Sequence[Contact]) -> Grasp:
        """The same grasp with other contacts; joints go on moving those in the same places."""
        other = Grasp(contacts, self.joints, self.mechanism, self.command, self.name)
        return other.about(mass=self.mass, center_of_mass=self.center_of_mass, provenance=self.provenance)

    def about(
        self,
        *,
        mass: float | None = None,
        center_of_mass: object = None,
        provenance: Provenance | None = None,
    ) -> Grasp:
        """The same grasp with what is known of its object; what is not given stays. Raises `InputError` as `Grasp`."""
        known = _object_facts(mass, center_of_mass, provenance)
        return self._changed(start=None, **{name: value for name, value in known.items() if value is not None})

    def from_configuration(self, path: str | Path) -> Grasp:
        """The same grasp, said to come from a configuration file, or a bundled one by name."""
        from handfast.model.provenance import Provenance

        return self.about(provenance=(self.provenance or Provenance()).with_configuration(path))

    def gravity_wrench(self, direction: object, g: float = 9.81) -> Array:
        """(6,) [N, N m] the object's weight as a wrench at its origin, object axes.

        Args:
            direction: (3,) in which gravity pulls, object axes, any length.
            g: [m/s^2].

        Raises:
            InputError: the mass or the centre of mass is unknown, or the direction is zero.
        """
        from handfast.model.body import weight

        if self.mass is None:
            raise InputError("is unknown; give it [kg]", source=self.name, field="mass")
        if self.center_of_mass is None:
            raise InputError("is unknown; give it [m], object frame", source=self.name, field="center_of_mass")
        return weight(self.mass, self.center_of_mass, direction, g)

    def __repr__(self) -> str:
        return f"Grasp({self.name!r}, {self.m} contacts, {self.l} joints, preload={self.preload})"


def _object_facts(mass: float | None, center_of_mass: object, provenance: Provenance | None) -> dict[str, Any]:
    """What is known of a grasp's object, by attribute; `InputError` for a negative mass, a centre that is no point."""
    if mass is not None:
        require_not_negative(mass, "mass", "a mass is 0 or more [kg]")
        mass = float(mass)
    centre = None if center_of_mass is None else frozen(center_of_mass, (3,), "center_of_mass")
    return {"mass": mass, "center_of_mass": centre, "provenance": provenance}
