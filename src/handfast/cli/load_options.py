"""What is asked about and what is to be held, as options: hand, object, configuration, loads, searches for grasps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from tyro.conf import Positional, UseAppendAction, arg

from handfast.cli.options import (
    ALL_OPTIONS,
    Command,
    Gravity,
    Numbers,
    Reported,
    TorqueLimits,
    Triple,
    WorkOptions,
    Wrench,
    torque_limits,
)
from handfast.core import bundled
from handfast.core.errors import InputError
from handfast.model.body import Body
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.model.hand import Hand
from handfast.model.hand.joint_law import laws_named
from handfast.model.shape import Mesh
from handfast.pictures.words import num, place_text
from handfast.planning.question import PlanLimits, SearchOptions
from handfast.readers.configuration_file import load_configuration
from handfast.readers.load_body import body_of
from handfast.readers.load_hand import load_hand
from handfast.readers.registry import MESHES, ending
from handfast.stability.problem.loads import LOAD_AXES, Loads, load_loads
from handfast.stability.problem.scaled_problem import as_wrench

LinkPairs = UseAppendAction[tuple[Annotated[tuple[str, str], arg(metavar="LINK")], ...]]


# What a search for grasps counts unless asked: the friction in models of hands is often there to calm a simulator, and
# no grasp is to be found, or missed, for such a number.
DEFAULT_LAWS = "stops,springs"


@dataclass(kw_only=True)
class JointLawOptions:
    """Laws of the joints."""

    joint_laws: Annotated[str, arg(metavar="LAWS")] = "all"
    """what counts of the joints' stops, friction and springs in the hand's file: all, none, or names with commas"""
    backdrivable: UseAppendAction[tuple[Annotated[str, arg(metavar="ACTUATOR")], ...]] = ()
    """a motor that gives what it is commanded and no more, whichever way it is turned; repeatable"""

    def lawful(self, hand: Hand) -> Hand:
        """A hand as these options want it."""
        laws_named(self.joint_laws, "--joint-laws")
        try:
            return hand.with_laws(self.joint_laws).with_backdrivable(self.backdrivable)
        except InputError as fault:
            raise InputError(fault.problem, field="--backdrivable") from None


@dataclass(kw_only=True)
class ObjectOptions:
    """What is said of an object in place of its file."""

    friction: Annotated[float | None, arg(metavar="MU")] = None
    """friction coefficient between hand and object; the object file's, or 0.5"""
    mass: Annotated[float | None, arg(metavar="KG")] = None
    """mass of the object [kg], in place of its file's"""
    center_of_mass: Annotated[Triple, arg(aliases=["--com"])] = ()
    """centre of mass in the object's frame [m]; the object file's, or the centre of its volume; --com for short"""

    def load_object(self, name: str, scale: float = 1.0, meshes: list[Mesh] | None = None) -> Body:
        """The object of a name as these options want it."""
        about: dict[str, Any] = {"mass": self.mass, "friction": self.friction, "center_of_mass": self.center_of_mass}
        return load_object(name, scale=scale, meshes=meshes, **about)


@dataclass(kw_only=True)
class SceneOptions(JointLawOptions, ObjectOptions):
    """A hand and an object."""

    hand: Annotated[Positional[str], arg(metavar="HAND")]
    """a URDF, MJCF or GraspIt! file (#LINK: what hangs on it), a bundled name, menagerie:... or ..._description"""
    root: Annotated[str | None, arg(metavar="LINK")] = None
    """read only what hangs on this link of the robot: the hand without its arm, one of two hands"""
    srdf: Annotated[str | None, arg(metavar="FILE")] = None
    """SRDF file that says which links do not collide; the URDF's namesake beside it"""
    object: Annotated[Positional[str], arg(metavar="OBJECT")]
    """a mesh, URDF, SDF, GraspIt! or handfast/body/1 file, a folder of meshes, or a bundled object"""
    scale: Annotated[float, arg(metavar="M")] = 1.0
    """metres per unit of a mesh file"""

    def load_scene(self) -> tuple[Hand, Body]:
        """Hand and object."""
        return self.load_own_hand(), self.load_object(self.object, self.scale)

    def load_own_hand(self) -> Hand:
        """The hand."""
        if ending(Path(self.hand)) in (".json", *MESHES):
            raise InputError("is an object; the hand comes first, then the object", source=self.hand)
        hand = load_hand(self.hand, root=self.root, srdf=self.srdf)
        if self.root:  # saved files load it again by its source, from anywhere
            file, _, link = hand.source.rpartition("#")
            self.hand = f"{Path(file).resolve()}#{link}"
        return self.lawful(hand)


def load_object(name: str, *, scale: float, center_of_mass: Numbers = (), **about: Any) -> Body:
    """The object that a command names; `InputError` for a scale that its file would not take."""
    file = bundled.resolve("objects", name)
    if scale != 1 and file.lower().endswith(".json"):
        raise InputError("states its own size; --scale is for mesh files", source=name)
    return body_of(name, scale=scale, center_of_mass=center_of_mass or None, **about)


def weight_note(body: Body) -> str:
    """What a grasp file says of the object's weight, for people."""
    if body.mass is None:
        return "Its mass is unknown; give --mass KG, here or when its weight is asked about."
    return f"The object weighs {num(body.mass)} kg, its centre of mass is {place_text(body.center_of_mass)}."


def load_placed(path: str) -> Configuration:
    """A configuration by path or bundled name."""
    return load_configuration(bundled.resolve("configurations", path))


Axis = Literal["x", "-x", "y", "-y", "z", "-z"]


@dataclass(kw_only=True)
class WeightOptions(Command):
    """What makes a weight of a direction of gravity: of the grasp file, unless given."""

    mass: Annotated[float | None, arg(metavar="KG")] = None
    """mass of the object [kg], for --gravity, instead of the grasp file's"""
    center_of_mass: Annotated[Triple, arg(aliases=["--com"])] = ()
    """centre of mass in the object's frame [m], for --gravity, instead of the grasp file's; --com for short"""

    def weighed(self, grasp: Grasp, source: str) -> Grasp:
        """The grasp with mass and centre of mass as asked for.

        Raises:
            InputError: one of them is neither given nor in the file, where the grasp comes from.
        """
        grasp = grasp.about(mass=self.mass, center_of_mass=self.center_of_mass or None)
        if grasp.mass is None:
            raise InputError("does not say the object's mass; --gravity needs --mass KG", source=source)
        if grasp.center_of_mass is None:
            right = "--gravity needs --com X Y Z [m] in the object's frame; 0 0 0 is its origin"
            raise InputError(f"does not say where the centre of mass is; {right}", source=source)
        return grasp

    def weight_text(self, grasp: Grasp) -> str:
        """What was weighed: 'Weight of 0.3 kg at (0, 0, 10) mm: mass and centre of mass as the grasp file says'."""
        heavy = grasp.about(mass=self.mass, center_of_mass=self.center_of_mass or None)
        if heavy.mass is None or heavy.center_of_mass is None:
            return ""
        given = [name for name, value in (("mass", self.mass), ("centre of mass", self.center_of_mass)) if value]
        both = "mass and centre of mass as the grasp file says"
        told = {0: both, 1: f"the {''.join(given)} as given, the rest as the grasp file says", 2: "both as given"}
        return f"Weight of {num(heavy.mass)} kg {place_text(heavy.center_of_mass)}: {told[len(given)]}."

    def check_one(self, *given: object) -> None:
        """`InputError` unless one of the options of `one_of` is given."""
        if sum(map(bool, given)) != 1:
            which = "give one of the two" if any(given) else "missing"
            raise InputError(f"{which}: {self.needed()}")

    def one_wrench(self, wrench: Numbers, gravity: Numbers, grasp: Grasp, source: str) -> Numbers:
        """(6,) a wrench as it is given, or the object's weight in a direction of gravity."""
        self.check_one(wrench, gravity)
        if wrench:
            self.refuse_weight()
            return wrench
        return tuple(self.weighed(grasp, source).gravity_wrench(gravity).tolist())

    def refuse_weight(self) -> None:
        """Mass or centre of mass without a direction of gravity would be passed over."""
        for name, value in (("--mass", self.mass is not None), ("--center-of-mass", self.center_of_mass)):
            if value:
                raise InputError(f"{name} is for --gravity; a wrench is taken as it stands")


@dataclass(kw_only=True)
class Load(WeightOptions):
    """The disturbance: a wrench, or the weight of the object."""

    one_of = "--wrench FX FY FZ TX TY TZ", "--gravity GX GY GZ"
    wrench: Wrench = ()
    """force [N] and torque [N m] on the object at its origin; three numbers are a force"""
    gravity: Triple = ()
    """instead: the direction in which gravity pulls, object axes; mass and centre of mass as in the grasp file"""


@dataclass(kw_only=True)
class LoadDirection(WeightOptions):
    """What a disturbance is a multiple of: a wrench, or the weight of the object."""

    one_of = "--direction FX FY FZ TX TY TZ", "--gravity GX GY GZ"
    direction: Wrench = ()
    """direction of force and torque; the answer multiplies it as it is given; three numbers are a force"""
    gravity: Triple = ()
    """instead: the direction in which gravity pulls, object axes; the answer multiplies the object's weight"""


@dataclass(kw_only=True)
class Disturbances(WeightOptions):
    """The disturbances, one or several, each a question of its own: wrenches, or weights of the object."""

    one_of = "--wrench FX FY FZ TX TY TZ", "--loads FILE", "--gravity GX GY GZ"
    wrench: UseAppendAction[tuple[Wrench, ...]] = ()
    """force [N] and torque [N m] on the object at its origin; three numbers are a force; once for each question"""
    gravity: UseAppendAction[tuple[Gravity, ...]] = ()
    """instead: a direction in which gravity pulls, object axes, or all for its axes both ways; mass as in the file"""
    loads: Annotated[Path | None, arg(metavar="FILE.json")] = None
    """instead, or beside --wrench: a handfast/loads/1 file of named disturbances"""

    def disturbances(self, grasp: Grasp, source: str) -> Loads:
        """What was asked about, by name."""
        self.check_given()
        named: list[tuple[str, Sequence[float]]] = []
        if not self.gravity:
            self.refuse_weight()
            named += [(name, as_wrench(w, name).tolist()) for name, w in _numbered(self.wrench)]
            if self.loads:
                named += load_loads(self.loads).by_name.items()
        else:
            heavy = self.weighed(grasp, source)
            for g in self.gravity:
                ways = (
                    {name: axis_vector(name) for name in LOAD_AXES}
                    if g == ALL_OPTIONS
                    else {" ".join(f"{x:g}" for x in g): g}
                )
                named += [(f"gravity {name}", heavy.gravity_wrench(way).tolist()) for name, way in ways.items()]
        twice = [name for k, (name, _) in enumerate(named) if name in [n for n, _ in named[:k]]]
        if twice:
            raise InputError(f"'{twice[0]}' is asked about twice")
        return Loads(tuple(name for name, _ in named), np.array([w for _, w in named], dtype=float))

    @classmethod
    def needed(cls) -> str:
        wrench, loads, gravity = cls.one_of
        return f"{wrench} (or {loads}), or {gravity}"

    def check_given(self) -> None:
        """`InputError` unless wrenches or weights are asked about."""
        self.check_one(self.wrench or self.loads, self.gravity)


def _numbered(wrenches: Sequence[Numbers]) -> list[tuple[str, Numbers]]:
    """Wrenches by the names that answers have for them."""
    return [("wrench" if len(wrenches) == 1 else f"wrench {k + 1}", w) for k, w in enumerate(wrenches)]


def axis_vector(axis: str) -> Numbers:
    """The unit vector of an axis such as "-z"."""
    sign = -1.0 if axis[0] == "-" else 1.0
    return tuple(sign if a == axis[-1] else 0.0 for a in "xyz")


@dataclass(kw_only=True)
class LoadsOptions:
    """Wrenches, each of which one preload has to hold."""

    up: Annotated[Axis | None, arg(metavar="AXIS")] = None
    """the object's axis that points up: its weight pulls the other way; by default along all six, one by one"""
    tilt: Annotated[tuple[str, float] | None, arg(metavar="AXIS DEG")] = None
    """tip the object about its axis x, y or z by up to DEG degrees from upright (--up, or z)"""
    wrench: UseAppendAction[tuple[Wrench, ...]] = ()
    """a load in place of the weight, or beside --up: force [N] and torque [N m] at the object's origin; repeatable"""
    loads: Annotated[Path | None, arg(metavar="FILE.json")] = None
    """a handfast/loads/1 file with more of them"""
    safety: Annotated[float, arg(metavar="FACTOR")] = 1.5
    """times every load is to be held: a grasp that holds its loads and no more lets go at the first disturbance"""

    def asked(self, body: Body) -> Loads:
        """All the loads that were asked for, without the factor of safety."""
        up = self.up or ("z" if self.tilt else None)
        found: list[Loads] = []
        if up:
            down = up[1:] if up.startswith("-") else f"-{up}"
            if self.tilt is None:
                found.append(Loads.gravity(body, down))
            else:
                axis, angle = self.tilt
                if axis not in ("x", "y", "z") or axis == up[-1]:
                    others = " or ".join(a for a in "xyz" if a != up[-1])
                    raise InputError(f"is about {axis}; {others} is needed, {up} points up", field="--tilt")
                about, vertical = np.array(axis_vector(axis)), np.array(axis_vector(down))
                found.append(Loads.tilt(body, about, np.radians(angle), down=vertical))
        found += [Loads.wrench(w, name) for name, w in _numbered(self.wrench)]
        if self.loads:
            found.append(load_loads(self.loads))
        whole = found[0] if found else Loads.gravity(body)
        for more in found[1:]:
            whole += more
        return whole


@dataclass(kw_only=True)
class SearchFlags(LoadsOptions, WorkOptions, Reported, Command):
    """A search for grasps."""

    joint_laws: Annotated[str, arg(metavar="LAWS")] = DEFAULT_LAWS
    """what counts of the joints' stops, friction and springs in the hand's file: all, none, or names with commas"""
    seed: Annotated[int, arg(metavar="S")] = 0
    """of the random starts: the same seed gives the same grasps"""
    ignore_pair: LinkPairs = ()
    """two links of the hand that may overlap, as their shapes do and the real links do not; repeatable"""
    command_limit: Annotated[float | None, arg(metavar="V")] = None
    """largest command of any actuator [N m or N]; by default ten times the largest load at the grasp's size"""
    torque_limit: TorqueLimits = ()
    """largest torque (force) of an actuator and its gearing, passive reaction included; hand: as its file states"""
    force_limit: Annotated[float | None, arg(metavar="N")] = None
    """largest normal force at any contact [N]"""
    eta: Annotated[float, arg(metavar="DEG")] = 0.0
    """how far the contact normals may be off [degrees]"""
    torsion: Annotated[float, arg(metavar="M")] = 0.0
    """torsional friction of soft fingers at every contact [m]; 0 is a point contact"""
    resume: bool = False
    """go on from what FOLDER holds; the same question, but for how many and how long, --pool and --jobs"""

    def options(self, kind: type[SearchOptions], hand: Callable[[], Hand], **more: Any) -> Any:
        """The options of the API, of a kind: by their names, `more` where these are others on the command line.

        Args:
            hand: reads the hand, for what its file states.
        """
        limits = PlanLimits(
            command_limit=self.command_limit,
            torque_limits=torque_limits(self.torque_limit, hand),
            force_limit=self.force_limit,
            eta=float(np.radians(self.eta)),
            loading=getattr(self, "loading", "together"),
        )
        seconds = getattr(self, "timeout", None)
        timeout = None if seconds == float("inf") else seconds
        try:
            return self.made(kind, **{"limits": limits, "timeout": timeout, "ignored": self.ignore_pair} | more)
        except InputError as fault:
            raise InputError(fault.problem, field=f"--{(fault.field or '').replace('_', '-')}") from None
