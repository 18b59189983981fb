"""Curvature at the contacts of a configuration: do the surfaces that touch there curve into each other?"""

from __future__ import annotations

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.geometry.curvature import curvature_at, relative_curvature
from handfast.synthesis.solution import Solution


def relative_curvatures(solution: Solution) -> Array:
    """(b,) [1/m] the relative curvature at each contact of a configuration; negative: the surfaces interpenetrate.

    Raises:
        InputError: a patch without a normal at a contact (the contact is named).
    """
    task, proof = solution.task, solution.existence
    links, out = task.hand.link_poses(solution.q), []
    for k, (pair, spot, n) in enumerate(zip(task.contact_pairs, proof.contacts, solution.normals, strict=True)):
        hand, its = links[task.hand.link(pair.link), :3, :3], solution.pose[:3, :3]
        try:
            K_hand = curvature_at(pair.hand, spot.hand, hand, n)
            K_object = curvature_at(pair.object, spot.object, its, n)
        except InputError as fault:
            raise fault.within(f"contacts[{k}]") from None
        out.append(relative_curvature(K_hand, K_object, n))
    return frozen(out, (len(out),), "curvature")
