"""Contacts and grasps of a compiled scene, for programs that ask about many configurations of one hand and object."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from handfast.geometry.contacts import contact_grasp, find_contacts
from handfast.geometry.scene import Scene

if TYPE_CHECKING:
    from handfast.core.arrays import Array
    from handfast.geometry.scene import PoseLike
    from handfast.model.grasp import Contact, Grasp


def scene_contacts(
    scene: Scene, q: Array | Mapping[str, float], object_pose: PoseLike, **options: Any
) -> tuple[Contact, ...]:
    """Where the hand of a scene touches its object, in the object frame: `find_contacts` without compiling again.

    Args:
        q: (l,) configuration, or values by joint name; the others follow `Hand.configuration`.
        object_pose: of the object in the hand's base frame: (4, 4), or position (3,) [m] and quaternion (w, x, y, z).
        options: those of `find_contacts`, and its errors.
    """
    return find_contacts(scene.hand, q, scene.body, object_pose, scene=scene, **options)


def scene_grasp(scene: Scene, q: Array | Mapping[str, float], object_pose: PoseLike, **options: Any) -> Grasp:
    """The grasp that the hand of a scene has on its object: `contact_grasp` without compiling again.

    Args:
        q: and object_pose as for `scene_contacts`.
        options: those of `contact_grasp`, and its errors.
    """
    return contact_grasp(scene.hand, q, scene.body, object_pose, scene=scene, **options)
