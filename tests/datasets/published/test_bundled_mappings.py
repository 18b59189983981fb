"""Bundled mappings put a file's numbers at the joints that they name, and the hand's frame where it belongs."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.core.transforms import transform
from handfast.datasets.published.mapping_file import mapping_for, object_pose, placed, read_mapping
from handfast.datasets.published.recorded import Posture, RecordedGrasp
from handfast.model.hand import Hand
from handfast.model.hand.hand import Joint, Link
from handfast.model.mechanism import Mechanism

SHADOW = ["WRJ2", "WRJ1", *(f"{finger}J{k}" for finger in ("FF", "MF", "RF") for k in (4, 3, 2, 1))]
SHADOW += [f"{finger}J{k}" for finger in ("LF", "TH") for k in (5, 4, 3, 2, 1)]
LEAP = [f"{f}_{j}" for f in ("if", "mf", "rf") for j in ("mcp", "rot", "pip", "dip")]
LEAP += ["th_cmc", "th_axl", "th_mcp", "th_ipl"]


def chained(link: str, names: list[str]) -> Hand:
    """A base, a link of a name 10 mm off it, and one joint after the other."""
    joints = tuple(Joint(n, "revolute", np.array([1.0, 0, 0]), np.zeros(3), -3, 3) for n in names)
    links = [Link("world", -1, np.eye(4)), Link(link, 0, transform([0.01, 0, 0], np.eye(3)))]
    links += [Link(f"after_{n}", k + 1, np.eye(4), (k,)) for k, n in enumerate(names)]
    return Hand(link, tuple(links), joints, Mechanism.direct(list(names)), (), np.zeros(len(names)))


@pytest.mark.parametrize(
    ("layout", "name", "link", "names"),
    [
        ("multidex", "shadow-multidex", "forearm", SHADOW),
        ("multidex", "barrett-multidex", "bh_base_link", [f"bh_j{k}_joint" for k in (32, 33, 11, 12, 13, 21, 22, 23)]),
        ("dexgraspbench", "leap-mjcf-named", "palm", LEAP),
    ],
)
def test_numbers_go_to_the_joints_in_the_files_order(layout: str, name: str, link: str, names: list[str]) -> None:
    hand = chained(link, sorted(names))  # the model's own order is another
    found, mapping = mapping_for(layout, hand)
    assert found == name
    numbers = np.linspace(0.1, 0.9, len(names))
    there = placed(hand, mapping, RecordedGrasp(0, Posture(np.eye(4), numbers)))
    assert hand.values(there.q) == pytest.approx(dict(zip(names, numbers, strict=True)))


def test_the_robotiq_of_three_fingers_has_eleven_joints_and_no_first_knuckle() -> None:
    order = read_mapping("robotiq-3f-multidex").joints or []
    assert len(order) == 11
    assert order[:3] == ["gripper_fingerA_joint_2", "gripper_fingerA_joint_3", "gripper_fingerA_joint_4"]
    assert order[3] == "gripper_fingerB_knuckle"
    assert order[7] == "gripper_fingerC_knuckle"


def test_a_left_allegro_is_not_taken_for_a_right_one() -> None:
    order = [f"joint_{k}.0" for k in range(16)]
    with pytest.raises(InputError, match=r"bundled for multidex: barrett-multidex, robotiq-3f-multidex, shadow"):
        mapping_for("multidex", chained("base_link", order))
    asked = read_mapping("allegro-left-multidex")
    assert asked.fits(chained("base_link", order))
    assert (asked.joints or [])[:5] == ["joint_8.0", "joint_9.0", "joint_10.0", "joint_11.0", "joint_4.0"]


def test_leap_by_name_and_by_number_are_one_hand() -> None:
    for layout in ("mjcf", "bodex"):
        numbered, named = read_mapping(f"leap-{layout}"), read_mapping(f"leap-{layout}-named")
        assert np.array_equal(numbered.offset.matrix, named.offset.matrix)
        assert numbered.layouts == named.layouts
    mjcf, bodex = (read_mapping(f"leap-{layout}") for layout in ("mjcf", "bodex"))
    same = dict(zip(mjcf.joints or [], LEAP, strict=True))
    assert read_mapping("leap-bodex-named").names == {file: same[joint] for file, joint in bodex.names.items()}


def test_graspgens_closing_direction_is_x_and_the_robotiqs_y() -> None:
    hand = chained("robotiq_arg2f_base_link", ["finger_joint"])
    name, mapping = mapping_for("graspgen", hand)
    assert name == "robotiq-2f-140"
    at = transform([0.1, 0.2, 0.3], np.eye(3))  # the gripper's frame in the object's
    pose = object_pose(hand, mapping, Posture(at, {}), hand.configuration())
    link = np.linalg.inv(pose) @ hand.link_poses(hand.configuration())[1]  # in the object's frame
    np.testing.assert_allclose(link[:3, 1], [-1, 0, 0], atol=1e-12)  # the left finger is at -y, in the files at +x
    np.testing.assert_allclose(link[:3, 2], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(link[:3, 3], [0.1, 0.2, 0.3], atol=1e-12)
    there = placed(hand, mapping, RecordedGrasp(0, Posture(at, {})))
    assert there.squeeze == pytest.approx([0.7])
