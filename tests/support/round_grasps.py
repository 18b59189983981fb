"""Grasps whose measures can be worked out by hand: contacts round a circle, fingers that press inwards."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handfast.model.grasp import Contact, Grasp, GraspJoint


def round_grasp(degrees: Sequence[float], mu: float, *, fingers: bool = False, radius: float = 1.0) -> Grasp:
    """Contacts at angles [degrees] about z, normals inwards; `fingers` slide along them, a motor each."""
    out = [np.array([np.cos(a), np.sin(a), 0.0]) for a in np.radians(degrees)]
    contacts = [Contact(radius * u, -u, mu) for u in out]
    joints = [GraspJoint(f"finger_{i}", -u, radius * u, (i,), "prismatic") for i, u in enumerate(out)]
    return Grasp(contacts, joints if fingers else (), name="round")


def pair(mu: float, **others: float | bool) -> Grasp:
    """Two contacts that face each other along x."""
    return round_grasp((0, 180), mu, **others)  # type: ignore[arg-type]


def three(mu: float, **others: float | bool) -> Grasp:
    """Three contacts, 120 degrees apart."""
    return round_grasp((90, 210, 330), mu, **others)  # type: ignore[arg-type]


def four(mu: float, **others: float | bool) -> Grasp:
    """Four contacts in the middles of four faces of a cube."""
    return round_grasp((0, 90, 180, 270), mu, **others)  # type: ignore[arg-type]
