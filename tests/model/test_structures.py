"""Hands from finger structures: degrees of freedom of Table 1, couplings, and a pinch that each one can take."""

from __future__ import annotations

import json

import numpy as np
import pytest

from handfast.core.answer import Reach
from handfast.core.errors import InputError
from handfast.model.hand import Hand
from handfast.model.hand.structures import TABLE_1, Dimensions, hand_from_structure, table_1_hand
from handfast.model.region import Bezier, Cap
from handfast.model.shape import Shape
from handfast.synthesis.query import synthesize
from handfast.synthesis.task import PAD_DIRECTION, fingertip, pinch
from tests.support.feasible import Feasible, missed
from tests.support.places import FEASIBLE as FEASIBLE_FILE

STORED = json.loads(FEASIBLE_FILE.read_text())
DOF = {  # synthesis paper, Table 1, column DOF
    "dist": 16,
    "robonaut": 12,
    "lms": 16,
    "ultralight": 10,
    "gifu-2": 16,
    "shadow": 18,
    "dlr-2": 13,
    "ubh-3": 20,
    "ma-1": 16,
    "sa": 13,
    "twendy-one": 13,
}


@pytest.fixture(scope="module")
def hands() -> dict[str, Hand]:
    return {name: table_1_hand(name) for name in TABLE_1}


@pytest.mark.parametrize("name", DOF)
def test_degrees_of_freedom_are_those_of_the_table(name: str, hands: dict[str, Hand]) -> None:
    hand = hands[name]
    assert hand.mechanism.a == DOF[name] == TABLE_1[name].dof
    assert hand.l - len(hand.couplings) == DOF[name]
    assert np.linalg.matrix_rank(np.vstack([hand.mechanism.R, hand.mechanism.A])) == hand.l


def test_there_are_eleven() -> None:
    assert set(DOF) == set(TABLE_1)
    assert len({d.title for d in TABLE_1.values()}) == 11
    with pytest.raises(InputError, match="unknown hand 'claw'; known: dist, robonaut"):
        table_1_hand("claw")


def test_joints_and_links_of_a_structure() -> None:
    hand = hand_from_structure("h", {"index": "U(RR)", "little": "RU(RR)", "thumb": "RUR"})
    index = ("index_abduction", "index_proximal", "index_middle", "index_distal")
    little = tuple(f"little_{p}" for p in ("base", "abduction", "proximal", "middle", "distal"))
    thumb = ("thumb_base", "thumb_abduction", "thumb_proximal", "thumb_distal")
    assert hand.joint_names == little + index + thumb  # from the little finger to the thumb, whatever the order given
    assert hand.link_names[0] == "palm"
    assert hand.moved_by(hand.link("index_distal")) == tuple(hand.joint(n) for n in index)
    assert [(hand.joint_names[c.joint], hand.joint_names[c.driver]) for c in hand.couplings] == [
        ("little_distal", "little_middle"),
        ("index_distal", "index_middle"),
    ]
    assert hand.configuration({"index_middle": 0.7})[hand.joint("index_distal")] == pytest.approx(0.7)
    assert hand.closing[hand.joint("index_abduction")] == 0
    assert hand.closing[hand.joint("index_distal")] == 1


def test_a_coupled_universal_joint_couples_the_flexions_alone() -> None:
    """Section 2.1: "On a coupling UR only the parallel axes are coupled"."""
    hand = hand_from_structure("h", {"thumb": "(URR)"})
    q = hand.configuration({"thumb_abduction": 0.2, "thumb_proximal": 0.5})
    assert q == pytest.approx([0.2, 0.5, 0.5, 0.5])
    assert hand.mechanism.a == 2
    both = hand_from_structure("h", {"thumb": "UUR"})
    assert both.joint_names[2:4] == ("thumb_middle_abduction", "thumb_middle")
    assert both.mechanism.a == 5


def test_the_palm_of_robonaut_cups_both_fingers_at_once(hands: dict[str, Hand]) -> None:
    q = hands["robonaut"].configuration({"ring_base": 0.3})
    assert q[hands["robonaut"].joint("little_base")] == pytest.approx(0.3)


@pytest.mark.parametrize("structure", ["", "R", "RU", "UUUR", "RRRRR", "URX", "U(RR", "UR)R", "((RR)R", "URRR"])
def test_structures_that_are_not_understood(structure: str) -> None:
    with pytest.raises(InputError, match=r"fingers.index: is '.*'; R and U, coupled ones in brackets"):
        hand_from_structure("h", {"index": structure})


def test_names_that_are_not_known() -> None:
    with pytest.raises(InputError, match="fingers: unknown finger 'toe'; known: little, ring"):
        hand_from_structure("h", {"toe": "URR"})
    with pytest.raises(InputError, match="couplings: unknown joint 'x'; known: index_abduction"):
        hand_from_structure("h", {"index": "URR"}, couplings=(("x", "index_middle"),))


def test_the_nominal_fingers_lie_as_stated(hands: dict[str, Hand]) -> None:
    """Straight fingers point along palm z, flexion turns them to palm x, opposed thumbs point along x."""
    size = Dimensions()
    for name, hand in hands.items():
        poses = hand.link_poses(hand.configuration({}))
        straight = poses[hand.link("index_distal")]
        assert straight[:3, 0] == pytest.approx([0, 0, 1], abs=1e-12), name
        assert straight[2, 3] == pytest.approx(size.palm[0] + size.finger[0] + size.finger[1])
        bent = hand.link_poses(hand.configuration({"index_proximal": 0.5}))[hand.link("index_proximal")]
        assert bent[:3, 0] == pytest.approx([np.sin(0.5), 0, np.cos(0.5)])
        assert bent[:3, 2] == pytest.approx([np.cos(0.5), 0, -np.sin(0.5)])  # the pad
        opposed = {"thumb_base": np.pi / 2} if "thumb_base" in hand.joint_names else {}
        thumb = hand.link_poses(hand.configuration(opposed))[hand.link("thumb_distal")]
        assert thumb[0, 0] > 0.95, name
        assert thumb[:3, 2] == pytest.approx([0, 0, 1], abs=1e-12)
        assert all(link.shapes for link in hand.links)
        assert straight[1, 3] == pytest.approx(size.palm[1] / 2)


def test_flexion_and_its_range_can_be_chosen() -> None:
    hand = hand_from_structure("h", {"index": "UR"}, Dimensions(finger=(0.05, 0.04, 0.03), flexion=(0.1, 0.9)))
    assert hand.limits[hand.joint("index_distal")].tolist() == [0.1, 0.9]
    tip = hand.link_poses(np.zeros(3))[hand.link("index_distal")]
    assert tip[2, 3] == pytest.approx(0.095 + 0.09)  # with two phalanges the first takes the middle one's length


# --- the pinch -------------------------------------------------------------------------------------


def test_pads_and_faces_of_the_pinch(hands: dict[str, Hand]) -> None:
    task = pinch(hands["dist"], edge=0.03, patch=0.01)
    index, thumb = task.contact_pairs
    assert (index.link, thumb.link) == ("index_distal", "thumb_distal")
    assert isinstance(index.hand, Cap)
    assert isinstance(index.object, Bezier)
    assert isinstance(thumb.object, Bezier)
    ball = next(s for s in hands["dist"].links[task.links[0]].shapes if s.kind == "sphere")
    assert index.hand.center == pytest.approx(ball.pose[:3, 3])
    assert index.hand.radius == ball.size[0]
    assert index.hand.axis == pytest.approx(PAD_DIRECTION / np.linalg.norm(PAD_DIRECTION))
    cube = Shape("box", (0.03, 0.03, 0.03))
    for region, side in ((index.object, 1.0), (thumb.object, -1.0)):
        u, v = np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0])
        assert np.abs(cube.depth(region.at(u, v).reshape(-1, 3))).max() < 1e-12
        normal = region.normal(0.5, 0.5)
        assert normal / np.linalg.norm(normal) == pytest.approx([side, 0, 0])
        assert np.ptp(region.points.reshape(-1, 3), axis=0) == pytest.approx([0, 0.01, 0.01])
    assert index.object.points[..., 0] == pytest.approx(0.015)
    with pytest.raises(InputError, match="palm: has no sphere among its shapes"):
        fingertip(hands["dist"], "palm")


@pytest.mark.parametrize("name", DOF)
def test_every_hand_can_pinch(name: str, hands: dict[str, Hand]) -> None:
    task, found = pinch(hands[name]), Feasible.of(STORED["pinch"][name])
    assert missed(task, found) < 1e-9
    assert found.slack(task) > 1e-3


@pytest.mark.parametrize("name", list(TABLE_1))
def test_every_hand_takes_a_small_cube_between_index_and_thumb(name: str) -> None:
    answer = synthesize(pinch(table_1_hand(name)), timeout=30)
    assert answer.verdict is Reach.FOUND
    assert answer.verify().ok
