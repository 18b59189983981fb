"""A hand with the laws of its joints, an object and a configuration, as options of the commands that make grasps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, UseAppendAction, arg

from handfast.cli.options import Numbers, Triple
from handfast.core import bundled
from handfast.core.errors import InputError
from handfast.model.body import Body
from handfast.model.configuration import Configuration
from handfast.model.hand import Hand
from handfast.model.hand.joint_law import laws_named
from handfast.pictures.words import num, place_text
from handfast.readers.configuration_file import load_configuration
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.readers.registry import MESHES, ending

LinkPairs = UseAppendAction[tuple[Annotated[tuple[str, str], arg(metavar="LINK")], ...]]


# What a search for grasps counts unless asked: the friction in models of hands is often there to calm a simulator, and
# no grasp is to be found, or missed, for such a number.
SOLID = "stops,springs"


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

    def load_object(self, name: str, scale: float = 1.0) -> Body:
        """The object of a name as these options want it."""
        about: dict[str, Any] = {"mass": self.mass, "friction": self.friction, "center_of_mass": self.center_of_mass}
        return load_object(name, scale=scale, **about)


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

        if ending(Path(self.hand)) in (".json", *MESHES):
            raise InputError("is an object; the hand comes first, then the object", source=self.hand)
        hand = load_hand(self.hand, root=self.root, srdf=self.srdf)
        if self.root:  # saved files load it again by its source, from anywhere
            file, _, link = hand.source.rpartition("#")
            self.hand = f"{Path(file).resolve()}#{link}"
        return self.lawful(hand), self.load_object(self.object, self.scale)


def load_object(name: str, *, scale: float, center_of_mass: Numbers = (), **about: Any) -> Body:
    """The object that a command names; `InputError` for a scale that its file would not take."""

    file = bundled.resolve("objects", name)
    if scale != 1 and file.lower().endswith(".json"):
        raise InputError("states its own size; --scale is for mesh files", source=name)
    return load_body(name, scale=scale, center_of_mass=center_of_mass or None, **about)


def weight_note(body: Body) -> str:
    """What a grasp file says of the object's weight, for people."""

    if body.mass is None:
        return "Its mass is unknown; give --mass KG, here or when its weight is asked about."
    return f"The object weighs {num(body.mass)} kg, its centre of mass is {place_text(body.center_of_mass)}."


def load_placed(path: str) -> Configuration:
    """A configuration by path or bundled name."""

    return load_configuration(bundled.resolve("configurations", path))
