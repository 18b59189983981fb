"""Energies that planners of dexterous grasps descend along, as benchmarks of their grasps report them.

All are smaller for better grasps and know nothing of the hand. Benchmarks (DexGraspBench) take torques about the
middle of the contacts and divide them by the contacts' mean distance from it, see `benchmark_scale`.
"""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.measures.conic_program import ConicProgram
from handfast.measures.wrench_scale import WrenchScale, edge_forces
from handfast.model.grasp import Grasp

FORCE_DIRECTIONS = 1000  # of forces, over the sphere
LOAD, FORCE_ROUNDING = 0.1, 1e-6  # [N] of the program's load; what is left below is the solver's rounding
TOTAL, MAX_NORMAL_FORCE = 1.0, 1.0  # [N] the least that all normal forces together are in it, and the most that one is
GRASPQP_MOST, GRASPQP_OFFSET, GRASPQP_SHARE = 50.0, 1e-2, 0.1


def benchmark_scale(grasp: Grasp) -> WrenchScale:
    """About the middle of the contacts, by their mean distance from it."""
    mean = float(np.linalg.norm(grasp.positions - grasp.middle, axis=1).mean())
    return WrenchScale(grasp.middle, mean if mean > 1e-9 else 1.0)


def dfc(G: Array) -> float:
    """|sum of the wrenches of unit normal forces| [N] of a grasp map (6, 3m) in a scale: 0 if normals balance.

    The differentiable force closure estimator of Liu, Liu, Jiao, Zhu and Zhu, *Synthesizing diverse and physically
    stable grasps with arbitrary hand structures* (IEEE RA-L 2021): friction is left out, and all normal forces are
    alike. The norm alone, as in DexGraspNet, which squares it.
    """
    return float(np.linalg.norm(G[:, ::3].sum(axis=1)))


def sphere(count: int) -> Array:
    """(count, 3) directions spread evenly over the sphere, on a Fibonacci spiral."""
    k = np.arange(count) + 0.5
    height, angle = 1 - 2 * k / count, np.pi * (1 + np.sqrt(5)) * k
    flat = np.sqrt(1 - height**2)
    return np.column_stack([flat * np.cos(angle), flat * np.sin(angle), height])


def tdg(grasp: Grasp, G: Array, count: int = FORCE_DIRECTIONS) -> float:
    """Mean of 1 - cos between force directions and what the contacts together answer in them; 0 to 2.

    Chen, Chen, Zhang and Wang, *Task-oriented dexterous grasp synthesis via differentiable grasp wrench boundary
    estimator* (2023), for the task of force closure. Each contact answers a direction, brought to its own frame,
    with the point of the disc at the end of its friction cone that lies in it, or the rim's nearest to it; what
    points away from the object fades out, as in the authors' benchmark.

    Args:
        G: (6, 3m) grasp map in a scale.
        count: of directions.
    """
    directions = sphere(count)
    wanted = np.einsum("kd,dj->kj", directions, G[:3]).reshape(count, grasp.m, 3)
    wanted /= np.maximum(np.linalg.norm(wanted, axis=2, keepdims=True), 1e-12)
    along, across = wanted[:, :, 0], np.linalg.norm(wanted[:, :, 1:], axis=2)
    side = wanted[:, :, 1:] / np.maximum(across, 1e-12)[:, :, None]
    mu = grasp.mu[None]
    slope = np.where(along > 0, across / np.maximum(along, 1e-12), np.inf)
    away = np.maximum(-along, 0.0)
    fade = np.where(along < 0, across / np.maximum(across + 2 * mu * away, 1e-12), 1.0)
    c = np.concatenate([np.ones((count, grasp.m, 1)), np.minimum(slope, mu)[:, :, None] * side], axis=2)
    w = (fade[:, :, None] * c).reshape(count, -1) @ G.T
    length = np.linalg.norm(w, axis=1)
    cosine = np.einsum("kd,kd->k", w[:, :3], directions) / np.maximum(length, 1e-12)
    return float((1 - np.where(length > 1e-9, cosine, 0.0)).mean())


def wrench_error(grasp: Grasp, G: Array, edges: int = 4) -> float:
    """Mean of what is left over [N] of 0.1 N along the six ways of the axes when contact forces answer best.

    The quadratic program of Chen, Ke and Wang, *BODex* (ICRA 2025), as its benchmark evaluates grasps: normal
    forces of 1 N at most each and 1 N at least in all, friction cones of four edges.

    Raises:
        NotMeasured: clarabel is not installed.
    """
    forces = [edge_forces(mu, edges) for mu in grasp.mu]
    W = np.hstack([G[:, 3 * i : 3 * i + 3] @ f.T for i, f in enumerate(forces)])
    n = W.shape[1]
    left = []
    for u in np.vstack([np.eye(3), -np.eye(3)]):
        load = LOAD * np.r_[u, np.zeros(3)]
        p = ConicProgram(n)
        p.at_most(-np.eye(n), np.zeros(n))
        p.at_most(np.repeat(np.eye(grasp.m), edges, axis=1), np.full(grasp.m, MAX_NORMAL_FORCE))
        p.at_most(-np.ones((1, n)), np.array([-TOTAL]))
        x = p.solve(load @ W, W.T @ W)
        rest = np.inf if x is None else float(np.linalg.norm(W @ x + load))
        left.append(rest if rest > FORCE_ROUNDING else 0.0)
    return float(np.mean(left))


def graspqp(grasp: Grasp, G: Array, edges: int = 4) -> float:
    """Energy of Zurbrügg, Cramariuc and Hutter, *GraspQP* (CoRL 2025), of a grasp map (6, 3m) in a scale.

    2 (q + 0.01) exp(-0.1 s): q is the least half square of the wrench that forces along four edges of each cone,
    each at least 1 of its units, leave over; s is the geometric mean of the singular values of the map of these
    forces, so that a larger wrench space counts for better. Constants are those of the authors' published code,
    which has torques in units of 0.2 m about the centre of mass.
    """
    from scipy.optimize import lsq_linear

    forces = [edge_forces(mu, edges) / np.hypot(1.0, mu) / edges for mu in grasp.mu]
    F = np.hstack([G[:, 3 * i : 3 * i + 3] @ f.T for i, f in enumerate(forces)])
    found = lsq_linear(F, np.zeros(6), bounds=(1.0, 1.0 + GRASPQP_MOST), method="bvls")
    sizes = np.linalg.svd(F, compute_uv=False)
    mean = float(np.prod(sizes[:6]) ** (1 / 6)) if len(sizes) >= 6 else 0.0
    return float(2 * (found.cost + GRASPQP_OFFSET) * np.exp(-GRASPQP_SHARE * mean))
