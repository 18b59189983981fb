"""Fingers, palm, wrist and closing senses of hands that nobody prepared."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handfast import load_hand
from handfast.model.hand import Hand
from handfast.model.hand.anatomy import Anatomy, with_guessed_senses
from handfast.model.hand.hand import guess_closing
from tests.support.unprepared_hands import jaws, overlapping, wristed


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> Hand:
    return load_hand(wristed(tmp_path_factory.mktemp("hands")))


def senses(hand: Hand) -> dict[str, int]:
    return {name: int(s) for name, s in zip(hand.joint_names, hand.closing, strict=True)}


def names(hand: Hand, links: tuple[int, ...]) -> list[str]:
    return [hand.link_names[i] for i in links]


def test_a_finger_begins_at_the_first_joint_that_not_all_share(hand: Hand) -> None:
    anatomy = Anatomy.of(hand)
    assert names(hand, anatomy.tips) == ["index_tip", "ring_tip", "thumb_tip"]
    assert [hand.joint_names[j] for j in anatomy.wrist] == ["wrist_turn", "wrist_bend"]
    fingers = {name: anatomy.finger(i) for i, name in enumerate(hand.link_names)}
    assert {fingers[n] for n in ("forearm", "wrist", "palm")} == {-1}
    assert fingers["index_base"] == fingers["index_tip"] == hand.joint("index_side")
    assert len({fingers[n] for n in ("index_tip", "ring_tip", "thumb_tip")}) == 3


def test_the_palm_is_what_the_fingers_hang_on_not_the_forearm(hand: Hand) -> None:
    assert names(hand, Anatomy.of(hand).palm) == ["palm"]


def test_a_palm_without_solids_is_the_nearest_link_that_has_some(hand: Hand) -> None:
    bare = replace(hand, links=tuple(replace(k, shapes=()) if k.name == "palm" else k for k in hand.links))
    assert names(bare, Anatomy.of(bare).palm) == ["wrist"]


def test_parts_that_move_as_one_end_in_one_tip() -> None:
    hand = load_hand("barrett-bh8-280")
    tip = hand.link("finger_1_dist")
    nail = replace(hand.links[tip], name="nail", parent=tip, pose=np.eye(4), joints=())
    camera = replace(nail, name="camera", parent=0)
    both = replace(hand, links=(*hand.links, nail, camera))
    assert sorted(names(both, Anatomy.of(both).tips)) == ["finger_2_dist", "finger_3_dist", "nail"]


def test_the_wrist_and_abductions_do_not_close(hand: Hand) -> None:
    still = {"wrist_turn", "wrist_bend", "index_side", "ring_side"}
    assert senses(hand) == {name: 0 if name in still else 1 for name in hand.joint_names}
    assert guess_closing(hand.joints, hand.couplings)[hand.joint("wrist_turn")] == -1  # as the limits have it


@pytest.mark.parametrize(("grows", "sense"), [(True, 1), (False, -1)])
def test_jaws_close_towards_each_other_whatever_the_limits_say(tmp_path: Path, grows: bool, sense: int) -> None:
    assert senses(load_hand(jaws(tmp_path, grows=grows))) == {"right_slide": sense, "left_slide": sense}


def test_a_finger_whose_range_is_turned_round_closes_the_other_way(hand: Hand) -> None:
    j = hand.joint("ring_bend")
    turned = replace(hand.joints[j], axis=-hand.joints[j].axis, lower=-hand.joints[j].upper, upper=0.17)
    joints = tuple(turned if k == j else joint for k, joint in enumerate(hand.joints))
    changed = with_guessed_senses(replace(hand, joints=joints, closing=guess_closing(joints, ())))
    assert changed.closing[j] == -1
    assert changed.closing[hand.joint("ring_curl")] == 1


def test_bends_both_ways_close_where_they_reach_further_than_spreads_do(hand: Hand) -> None:
    joints = tuple(replace(j, lower=-1.5, upper=1.5) if j.name.endswith("bend") else j for j in hand.joints)
    free = replace(hand, joints=joints, closing=guess_closing(joints, ()))
    assert free.closing[hand.joint("index_bend")] == 0
    guessed = senses(with_guessed_senses(free))
    assert guessed["index_bend"] == guessed["ring_bend"] == guessed["thumb_bend"] == 1
    assert guessed["index_side"] == 0


def test_a_lopsided_bend_about_the_axis_of_those_further_out_is_no_abduction(hand: Hand) -> None:
    def with_range(name: str, lower: float, upper: float) -> dict[str, int]:
        new = {f"{finger}_{name}": np.radians([lower, upper]) for finger in ("index", "ring")}
        joints = tuple(
            replace(j, lower=new[j.name][0], upper=new[j.name][1]) if j.name in new else j for j in hand.joints
        )
        free = replace(hand, joints=joints, closing=guess_closing(joints, ()))
        assert free.closing[hand.joint(f"index_{name}")] == 0
        return senses(with_guessed_senses(free))

    wide = with_range("bend", -80, 45)
    assert wide["index_bend"] == wide["ring_bend"] == 1
    assert wide["index_side"] == wide["ring_side"] == 0
    assert with_range("side", -80, 45)["index_side"] == 0  # across the axes of bend and curl
    assert with_range("bend", -45, 40)["index_bend"] == 0  # no further than an abduction may go


def test_a_joint_that_goes_further_back_than_it_closes_opens_all_the_way(hand: Hand) -> None:
    j = hand.joint("index_bend")

    def opened(lower: float, upper: float) -> float:
        joints = tuple(replace(x, lower=lower, upper=upper) if k == j else x for k, x in enumerate(hand.joints))
        changed = replace(hand, joints=joints)
        return float(Anatomy.of(changed).ends(changed.closing)[0][j])

    assert opened(-1.4, 0.8) == -1.4
    assert opened(-0.8, 1.4) == pytest.approx(np.radians(-30))
    assert opened(-1.1, 0.8) == pytest.approx(np.radians(-30))


def test_without_solids_the_limits_decide(hand: Hand) -> None:
    bare = replace(hand, links=tuple(replace(k, shapes=()) for k in hand.links))
    np.testing.assert_array_equal(with_guessed_senses(bare).closing, hand.closing)
    assert Anatomy.of(bare).palm == ()


def test_bundled_hands_close_as_stated() -> None:
    assert senses(load_hand("barrett-bh8-280"))["finger_1_spread"] == 0
    assert senses(load_hand("parallel-gripper")) == {"left_slide": 1, "right_slide": 1}


def test_an_open_finger_is_hardly_bent_back_and_a_spread_is_in_the_middle(hand: Hand) -> None:
    j = hand.joint("index_bend")
    joints = tuple(replace(joint, lower=-2.0) if k == j else joint for k, joint in enumerate(hand.joints))
    opened, closed = Anatomy.of(replace(hand, joints=joints)).ends(hand.closing)
    assert np.degrees(opened[j]) == pytest.approx(-30)
    assert np.degrees(closed[j]) == pytest.approx(90)
    assert opened[hand.joint("wrist_turn")] == opened[hand.joint("index_side")] == 0
    barrett = load_hand("barrett-bh8-280")
    assert Anatomy.of(barrett).ends(barrett.closing)[0][0] == pytest.approx(np.pi / 2)


def test_the_hand_with_racks_closes_too(tmp_path: Path) -> None:
    assert senses(load_hand(overlapping(tmp_path))) == {"right_slide": 1, "left_slide": 1}
