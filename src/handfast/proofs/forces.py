"""Forces in play in a question [N]: how far a search for a maximum has to go, and how far a cap has to reach.

All are measured as forces at a contact, so that units, axes and the place of the origin change nothing.
"""

from __future__ import annotations

import numpy as np

from handfast.proofs.fields import Array
from handfast.proofs.grasp import GraspData
from handfast.proofs.question import Question

ENDLESS = 1e3  # times the other forces in play: a disturbance that is resisted up to there counts as unbounded
FAR = 1e4  # times all forces in play: a proof for motions inside a cap counts as complete from there on


def size_of(g: GraspData, w: Array) -> float:
    """[N] a wrench (6,): its force, or its torque about the middle of the contacts over the grasp's size."""
    torque = w[3:] - np.cross(g.positions.mean(axis=0), w[:3])
    return float(max(np.linalg.norm(w[:3]), np.linalg.norm(torque) / g.size))


def drives(q: Question) -> float:
    """[N] the largest of commands, limits, given torques and friction of joints, each where it meets a contact."""
    g, e = q.grasp, q.equivalent
    touching = g.J.any(axis=0) | g.twist_jacobian.any(axis=0)
    moves = (g.R[:, touching] != 0).any(axis=1)
    limits = np.array([q.torque_limits.get(name, 0.0) for name in g.actuators])
    of_actuators = (np.maximum(np.abs(g.command) * (not q.seeks_commands), limits) / g.actuator_arms)[moves]
    free = touching & ~e.held
    of_joints = ((np.abs(g.torque) + g.friction) / g.joint_arms)[free]
    back = (np.abs(g.command) / g.actuator_arms)[moves & g.backdrivable]
    force = q.force_limit if np.isfinite(q.force_limit) else 0.0
    return float(max(x.max(initial=0.0) for x in (of_actuators, of_joints, back, np.array([force]))))


def farthest(q: Question) -> float:
    """The magnitude up to which a maximum is to be sought at least: `ENDLESS` times the other forces in play.

    Endless where the direction is no force.
    """
    others = max(size_of(q.grasp, q.wrench), drives(q))
    along = size_of(q.grasp, q.direction)
    return ENDLESS * (others or along) / along if along else np.inf
