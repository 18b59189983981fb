"""Contacts of a flat face: those at its corners make every wrench that the others make, nearly, if they are many."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import normal_frame
from handfast.geometry.patch import few
from handfast.model.grasp import Contact

TURNED = 1e-3  # [rad] normals that differ by less are one
OFF = 2e-5  # [m] points that are less out of a plane, or out of a line, are in it


def spanning(contacts: Sequence[Contact]) -> tuple[Contact, ...]:
    """Without those that lie between others of the same link, plane, normal and friction.

    A force at a point between others is a sum of parallel forces at these, each within its friction cone, with the same
    torque. Contacts of a pad that is made of many small solids, a dozen in a plane, would cost a search thousands of
    times more, and answer the same. Of more than four corners the four stay that are spread most, as of a single pair
    of solids: the others could do whatever these do, so that statics are judged too strictly, if anything.
    """
    left, kept = list(range(len(contacts))), set[int]()
    while left:
        lead = contacts[left[0]]
        face = [i for i in left if _one_face(contacts[i], lead)]
        left = [i for i in left if i not in face]
        flat = np.array([contacts[i].position for i in face]) @ normal_frame(lead.normal)[:, 1:]
        kept |= {face[k] for k in _corners(flat)}
    return tuple(contacts[i] for i in sorted(kept))


def _one_face(a: Contact, b: Contact) -> bool:
    """Whether two contacts press one plane of the object with one link."""
    apart = abs(float((a.position - b.position) @ b.normal))
    same = a.link == b.link and a.friction == b.friction
    return bool(same and a.normal @ b.normal >= np.cos(TURNED) and apart <= OFF)


def _corners(points: Array) -> list[int]:
    """Which of some points (n, 2) [m] span them: corners of their hull, four at most, ends of a line, or one alone."""
    from scipy.spatial import ConvexHull

    if len(points) < 3:
        return list(range(len(points)))
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    along, across = (points @ axes.T).T
    if np.ptp(across) <= OFF:
        return sorted({int(along.argmin()), int(along.argmax())})
    hull = ConvexHull(points).vertices
    kept = few(points[hull])
    return sorted(int(k) for k in hull if (points[k] == kept).all(axis=1).any())
