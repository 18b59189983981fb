"""The solids behind a grasp file: hand and object as they were, if their files are still the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

from handfast.core.errors import InputError
from handfast.report.drawing import Mesh, scene_meshes

if TYPE_CHECKING:
    from handfast.model.grasp import Grasp


def source_meshes(grasp: Grasp) -> tuple[list[Mesh], list[str]]:
    """Hand and object behind a grasp, in the object frame, and why they are not there, a sentence each.

    They are read from the files that the grasp's provenance names, if all three are there with the same checksums.
    The checksum is that of the file itself: a mesh that a hand file names may have changed all the same.
    """
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
            return scene_meshes(hand, q, body, placed.pose), []
        except InputError as fault:
            faults = [str(fault)]
    return [], [f"Hand and object are not shown: {'; '.join(faults)}."]
