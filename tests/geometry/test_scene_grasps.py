"""A scene compiled once, joints by name and poses as position and quaternion: all say the same."""

from __future__ import annotations

import numpy as np
import pytest

from handfast import (
    InputError,
    Scene,
    close,
    contact_grasp,
    find_contacts,
    load_body,
    load_configuration,
    load_hand,
)
from handfast.geometry.scene import checked_pose
from handfast.readers.grasp_file import file_dict

PLACED = load_configuration("fig9")
HAND, Q = PLACED.applied(load_hand("barrett-bh8-280"))
FLASK = load_body("flask")
PAIR = (PLACED.object_pose.position, PLACED.object_pose.quaternion)


def test_a_scene_gives_what_hand_and_object_give() -> None:
    scene = Scene(HAND, FLASK)
    old = contact_grasp(HAND, Q, FLASK, PLACED.pose, preload=PLACED.preload)
    for q in (Q, HAND.values(Q)):
        for pose in (PLACED.pose, PAIR, [list(x) for x in PAIR]):
            assert len(find_contacts(HAND, q, FLASK, pose, scene=scene)) == old.m  # type: ignore[arg-type]
            again = contact_grasp(HAND, q, FLASK, pose, preload=PLACED.preload, scene=scene)  # type: ignore[arg-type]
            assert file_dict(again) == file_dict(old)
    assert len(find_contacts(HAND, HAND.values(Q), FLASK, PAIR)) == old.m
    assert old.provenance is not None
    assert (old.provenance.hand.path, old.provenance.object.path) == ("barrett-bh8-280", "flask")  # type: ignore[union-attr]


def test_close_takes_joints_by_name_and_a_pose_in_parts() -> None:
    one = close(HAND, HAND.configuration({"finger_1_spread": 0.0}), FLASK, PLACED.pose)
    other = close(HAND, {"finger_1_spread": 0.0}, FLASK, PAIR)
    assert np.array_equal(one.q, other.q)


@pytest.mark.parametrize(
    "q, pose, says",
    [
        ({"thumb": 1.0}, PAIR, "unknown joint 'thumb'"),
        ({"finger_1_prox": 99.0}, PAIR, "finger_1_prox"),
        ([0.0], PAIR, "needs 8 finite joint values"),
        (Q, (PAIR[0], (1.0, 1.0, 0, 0)), r"object_pose\.quaternion: has length 1\.414; a unit quaternion w, x, y, z"),
        (Q, (PAIR[0], (1.0, 0, 0)), r"object_pose\.quaternion: has shape \(3,\)"),
        (Q, ((0, 0), PAIR[1]), r"object_pose\.position: has shape \(2,\)"),
        (Q, np.zeros((4, 4)), "is not a rigid motion"),
    ],
)
def test_wrong_places_are_named(q, pose, says: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=says):
        close(HAND, q, FLASK, pose)


def test_a_matrix_and_its_parts_are_the_same_pose() -> None:
    assert np.allclose(checked_pose(PAIR), PLACED.pose)


def test_a_scene_of_something_else_is_refused() -> None:
    scene, pose = Scene(load_hand("barrett-bh8-280"), load_body("slab")), np.eye(4)
    again = load_hand("barrett-bh8-280")
    with pytest.raises(InputError, match="scene: is of the object slab, not of mug"):
        contact_grasp(again, {}, load_body("mug"), pose, scene=scene)
    gripper = load_hand("parallel-gripper")
    with pytest.raises(InputError, match="scene: is of the hand barrett-bh8-280, not of parallel-gripper"):
        find_contacts(gripper, {}, load_body("slab"), pose, scene=scene)
    assert find_contacts(again, {}, load_body("slab"), pose, scene=scene)
