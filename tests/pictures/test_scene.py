"""Hand and object behind a grasp, drawn with joints displaced."""

from __future__ import annotations

import numpy as np

from benchmarks.simulation_floor import pinch
from handfast.pictures.scene import moving_scene, source_meshes
from handfast.readers.grasp_file import load_grasp


def test_a_displaced_joint_moves_its_finger_and_nothing_else() -> None:
    grasp = load_grasp("fig11")
    scene, faults = moving_scene(grasp)
    assert scene is not None
    assert not faults
    still, moved = scene({}), scene({"finger_1_prox": 0.1})
    far = [float(np.abs(a.vertices - b.vertices).max()) for a, b in zip(still, moved, strict=True)]
    assert [m.kind for m in still] == [m.kind for m in source_meshes(grasp)[0]]
    assert far[0] == 0
    assert 0 < sum(x > 0 for x in far) < len(far) / 2
    joint = next(j for j in grasp.joints if j.name == "finger_1_prox")
    tip = grasp.contacts[joint.moves[0]].position
    assert max(far) > 0.05 * float(np.linalg.norm(joint.velocity_at(tip)))


def test_what_came_from_no_file_has_no_scene() -> None:
    scene, faults = moving_scene(pinch(0.5))
    assert scene is None
    assert "Hand and object are not shown" in faults[0]
