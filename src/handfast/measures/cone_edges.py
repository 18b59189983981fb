"""Friction cones as pyramids: the wrenches of their edges, which polyhedral measures are made of."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.measures.wrench_scale import WrenchScale
from handfast.model.grasp import Grasp

EDGES = 8  # of a cone, as in GraspIt! and the benchmarks of dexterous grasps
FEWEST, MOST = 3, 64


def edge_forces(mu: float, edges: int) -> Array:
    """(edges, 3) contact forces (n, t1, t2) along the edges of a cone's pyramid, each with normal part 1.

    The pyramid lies inside the cone; its first edge leans towards t1.

    Raises:
        InputError: fewer than 3 edges, or more than 64.
    """
    if not FEWEST <= edges <= MOST:
        raise InputError(f"is {edges}; {FEWEST} to {MOST} edges of a friction cone are possible", field="edges")
    angle = 2 * np.pi * np.arange(edges) / edges
    return np.column_stack([np.ones(edges), mu * np.cos(angle), mu * np.sin(angle)])


def edge_wrenches(grasp: Grasp, scale: WrenchScale, edges: int = EDGES) -> Array:
    """(m, edges, 6) wrenches of these forces at each contact, in a scale."""
    maps = scale.grasp_map(grasp).T.reshape(grasp.m, 3, 6)
    return np.array([edge_forces(mu, edges) @ part for mu, part in zip(grasp.mu, maps, strict=True)])
