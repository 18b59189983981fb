"""What `contacts`, `close` and `demo` share: a hand, an object and a configuration by name or path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from handfast.core import bundled
from handfast.core.errors import InputError

if TYPE_CHECKING:
    from handfast.model.body import Body
    from handfast.model.configuration import Configuration
    from handfast.model.hand import Hand


@dataclass(kw_only=True)
class SceneOptions:
    """A hand and an object."""

    hand: Annotated[Positional[str], arg(metavar="HAND")]
    """a URDF or MJCF file or the name of a bundled hand"""
    object: Annotated[Positional[str], arg(metavar="OBJECT")]
    """a mesh (OBJ, STL, PLY, OFF) or handfast/body/1 file or the name of a bundled object"""
    friction: Annotated[float | None, arg(metavar="MU")] = None
    """friction coefficient between hand and object; the object file's, or 0.5"""
    mass: Annotated[float | None, arg(metavar="KG")] = None
    """mass of the object [kg]"""
    scale: Annotated[float, arg(metavar="M")] = 1.0
    """metres per unit of a mesh file"""

    def load_scene(self) -> tuple[Hand, Body]:
        """Hand and object."""
        from handfast.model.hand import load_hand

        hand = load_hand(self.hand)
        return hand, load_object(self.object, mass=self.mass, friction=self.friction, scale=self.scale)


def load_object(name: str, *, mass: float | None, friction: float | None, scale: float) -> Body:
    """The object that a command names; `InputError` for a scale that its file would not take."""
    from handfast.model.body import load_body

    file = bundled.resolve("objects", name)
    if scale != 1 and file.lower().endswith(".json"):
        raise InputError("states its own size; --scale is for mesh files", source=name)
    return load_body(name, mass=mass, friction=friction, scale=scale)


def load_placed(path: str) -> Configuration:
    """A configuration by path or bundled name."""
    from handfast.model.configuration import load_configuration

    return load_configuration(bundled.resolve("configurations", path))
