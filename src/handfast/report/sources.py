"""The solids behind a grasp file: hand and object as they were, if their files are still the same."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from handfast.core.errors import InputError
from handfast.report.drawing import Mesh, scene_meshes

if TYPE_CHECKING:
    from handfast.core.arrays import Array
    from handfast.model.grasp import Grasp
    from handfast.model.hand.hand import Hand
    from handfast.model.shape import Shape

Scene = Callable[[Mapping[str, float]], list[Mesh]]
OFF = 5e-3  # [m] beyond its gap or depth, a contact that is this far off a surface is none of it


def source_meshes(grasp: Grasp) -> tuple[list[Mesh], list[str]]:
    """Hand and object behind a grasp, in the object frame, and why they are not there, a sentence each.

    They are read from the files that the grasp's provenance names, if all three are there with the same checksums,
    and shown if the grasp's contacts lie on them: a contact or a scale that was changed afterwards has no checksum.
    The checksum is that of the file itself: a mesh that a hand file names may have changed all the same.
    """
    scene, faults = moving_scene(grasp)
    return (scene({}) if scene else []), faults


def moving_scene(grasp: Grasp) -> tuple[Scene | None, list[str]]:
    """The same for any displacement [rad, m] of joints by name; the object stays where it is. None if unknown."""
    from handfast.model.body import load_body
    from handfast.model.configuration import load_configuration
    from handfast.model.hand.load import load_hand
    from handfast.model.provenance import Provenance

    came = grasp.provenance or Provenance()
    faults = came.faults()
    if not faults and came.hand and came.object and came.configuration:
        try:
            placed = load_configuration(came.configuration.path)
            hand, q = placed.applied(load_hand(came.hand.path))
            body = load_body(came.object.path, scale=came.object.scale)
            faults = _off(grasp, hand, np.linalg.inv(placed.pose) @ hand.link_poses(q), body.pieces)
            if not faults:

                def at(moved: Mapping[str, float]) -> list[Mesh]:
                    more = np.array([moved.get(name, 0.0) for name in hand.joint_names])
                    return scene_meshes(hand, q + more, body, placed.pose)

                return at, []
        except InputError as fault:
            faults = [str(fault)]
    return None, [f"Hand and object are not shown: {'; '.join(faults)}."]


def _off(grasp: Grasp, hand: Hand, poses: Array, pieces: Sequence[Shape]) -> list[str]:
    """A sentence about the first contact that is not on the object, or not on its link; `poses` in the object frame."""
    for i, contact in enumerate(grasp.contacts):
        solids = {"the object": pieces}
        if contact.link in hand.link_names:
            k = hand.link(contact.link)
            solids[contact.link] = [shape.placed(poses[k]) for shape in hand.links[k].shapes]
        for name, shapes in solids.items():
            depth = max((float(s.depth(contact.position[None])[0]) for s in shapes), default=0.0)
            if abs(depth) > OFF + abs(contact.depth):
                changed = "contacts, scale or configuration are not those of this grasp"
                return [f"contact {i} is at least {1e3 * abs(depth):.3g} mm off the surface of {name}: {changed}"]
    return []
