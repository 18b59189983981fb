"""Searches for a proof that every configuration is discarded, and configurations that none may discard."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from handfast import Task
from handfast.core.arrays import Array
from handfast.core.transforms import matrix_quaternion, transform
from handfast.geometry.collision import Collisions
from handfast.geometry.scene import Scene, rest_overlaps
from handfast.model.body import Body
from handfast.model.shape import Shape
from handfast.planning.grasp_for import motors_of
from handfast.planning.joined_search import JoinedSearch
from handfast.planning.no_balance import NoBalance
from handfast.planning.question import Allowed, PlanLimits
from handfast.proofs.convex_solids import SolidsData
from handfast.proofs.discarded_boxes import replay_no_grasp
from handfast.proofs.fields import Fields
from handfast.proofs.intervals import Interval
from handfast.proofs.posed_boxes import ContactBoxes
from handfast.proofs.replay import Replay
from handfast.proofs.tasks import read_task
from handfast.stability.problem.loads import Loads
from handfast.synthesis.embedded_task import task_to_dict

LIGHT = Loads.wrench([0, 0, -0.5, 0, 0, 0])


def block(size: Any, at: Any) -> Shape:
    return Shape("box", size, transform(np.array(at, dtype=float), np.eye(3)))


def walled(gap: float, width: float = 0.05, half: float = 0.04) -> Body:
    """The block of `grip`, and a wall before the side that the left finger is to touch."""
    wall = block((2 * half, 0.02, 2 * half), (0, width / 2 + gap + 0.01, 0))
    return Body.of([block((0.03, width, 0.03), (0, 0, 0)), wall], name="walled", mass=0.1)


def collisions_of(task: Task, body: Body) -> Collisions:
    scene = Scene(task.hand, body)
    return Collisions(scene, cutoff=1e-3, at_rest=rest_overlaps(scene, at_zero=True))


def joined(
    task: Task,
    body: Body,
    loads: Loads = LIGHT,
    friction: float = 0.8,
    saved: Any = None,
    depth: float = 1e-3,
    limits: PlanLimits | None = None,
    torsion: float = 0.0,
) -> JoinedSearch:
    """Without what limits of torques say of forces at the contacts alone."""
    balance = NoBalance(task, loads, friction, center=np.zeros(3), torsion=torsion)
    motors = motors_of(task, limits or PlanLimits())
    return JoinedSearch(task, collisions_of(task, body), Allowed(depth, depth, depth), balance, motors, saved=saved)


def replayed(
    search: JoinedSearch, task: Task, proof: Any = None, solids: Any = None, limits: PlanLimits | None = None
) -> Replay:
    """As a file: through JSON, and with nothing of the search."""
    told = search.searched
    assert told is not None
    proof, solids = (json.loads(json.dumps(a or b)) for a, b in ((proof, told.proof), (solids, told.solids)))
    data = read_task(task_to_dict(task))
    balance = search.sets[-1].balance
    read = SolidsData.read(Fields(solids), [link.name for link in data.hand.links])
    motors = motors_of(task, limits or PlanLimits())
    return replay_no_grasp(data, read, balance.placements, balance.names, motors, Fields(proof))


def coordinates(contacts: ContactBoxes, task: Task, q: Array, pose: Array, contact: Array) -> tuple[Array, int]:
    """(n,) and the chart of a configuration; contact: parameters of the regions in their order."""
    first = task.hand.link_poses(q)[contacts.task.links[0]]
    quaternion = matrix_quaternion(first[:3, :3].T @ pose[:3, :3])
    chart = int(np.abs(quaternion).argmax())
    joints = q[list(contacts.task.free)]
    return np.concatenate([joints, np.delete(quaternion, chart) / quaternion[chart], contact]), chart


def drawn(
    task: Task, contacts: ContactBoxes, rng: np.random.Generator, count: int
) -> Iterator[tuple[Array, int, Array, Array]]:
    """Configurations in which a single cap touches: coordinates and chart, joints, the object's pose."""
    hand, (low, high) = task.hand, contacts.root.T
    x, charts = low + (high - low) * rng.random((count, len(low))), rng.integers(4, size=count)
    at = contacts.at(Interval.of(x), charts, 0)
    rows = at.rows.value.mid
    for n in np.flatnonzero((rows >= contacts.low - 1e-9).all(axis=1) & (rows <= contacts.high + 1e-9).all(axis=1)):
        q = hand.configuration({hand.joints[j].name: x[n, k] for k, j in enumerate(contacts.task.free)})
        R, p = at.object.rotation.value.mid[n], at.object.place.value.mid[n]
        there = transform(p - R @ at.contact.value.mid[n], R)
        yield x[n], int(charts[n]), q, hand.link_poses(q)[contacts.task.links[0]] @ there
