"""What is drawn: colours, arrows, bar and map for states that hold, slip, wait or fail; and how the object goes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast.core.answer import Verdict
from handfast.model.shape import Shape
from handfast.pictures.camera import first_hit
from handfast.pictures.live.page_text import bar_html, map_svg, verdict_html
from handfast.pictures.live.shown_state import GREY, GREYING_DELAY, PERIOD, TONE_COLORS, escape, shown, slip_motion
from handfast.pictures.live.view_state import LOAD_ARROW, ViewState, reaches, rounded_up, stage_of
from tests.support.viewed import jaws, replies, two_fingers

HELD = ViewState.of(jaws()).with_plane("yz").pulled([0, 0, -5.0])
STAGE = stage_of(HELD.grasp)


def test_a_load_that_is_held() -> None:
    reply = replies(HELD)[-1]
    what = shown(HELD, STAGE, reply)
    assert (what.tone, what.grey, what.color) == ("holds", False, TONE_COLORS["holds"])
    assert what.share == pytest.approx(0.5, rel=1e-2)
    assert what.motion is None
    assert what.load[0] == pytest.approx(np.array([[0, 0, 0], [0, 0, -5 * STAGE.metres_per_newton]]))
    assert what.tip == pytest.approx(what.load[0, 1])
    pushed = (what.forces[:, 1] - what.forces[:, 0]).sum(axis=0)  # of the hand on the object: against the load
    assert pushed[2] > 0
    assert pushed[:2] == pytest.approx([0, 0], abs=1e-9)
    assert what.map is not None
    assert not what.map.grey
    radii = np.linalg.norm(what.map.outline, axis=1)
    assert radii == pytest.approx(10 * STAGE.metres_per_newton, rel=1e-2)
    assert "50" in bar_html(what)
    assert "Largest in this direction: 10 N." in " ".join(what.sentences)
    assert "Replayed" in " ".join(what.sentences)


def test_a_largest_load_whose_bounds_have_not_met_is_not_called_the_largest() -> None:
    reply = replies(HELD)[-1]
    assert reply.most is not None
    for upper in (25.0, np.inf):  # the search ended at its time limit
        what = shown(HELD, STAGE, replace(reply, most=replace(reply.most, upper=upper)))
        said = " ".join(what.sentences)
        assert "In this direction 10 N is resisted; how much more was not shown within the time." in said
        assert "Largest" not in said
        assert what.share is None


def test_a_load_that_slips_moves_the_object_along() -> None:
    state = HELD.with_force(12.0)
    what = shown(state, STAGE, replies(state)[-1])
    assert (what.tone, what.color) == ("slips", TONE_COLORS["slips"])
    assert len(what.forces) == 0
    assert what.motion is not None
    assert what.motion.twist[2] < 0
    position, rotation = what.motion.pose(0.0)
    assert position == pytest.approx([0, 0, 0])
    assert rotation == pytest.approx(np.eye(3))
    assert what.motion.pose(0.9 * PERIOD)[0] == pytest.approx(what.motion.twist[:3])
    assert "SLIPS" in verdict_html(what)


def test_while_an_answer_is_due_the_last_one_is_kept_and_greyed_when_it_is_late() -> None:
    reply = replies(HELD)[-1]
    state = HELD.with_force(12.0)
    soon, late = shown(state, STAGE, reply, GREYING_DELAY / 2), shown(state, STAGE, reply, 2 * GREYING_DELAY)
    assert (soon.tone, soon.grey, soon.color) == ("holds", False, TONE_COLORS["holds"])
    assert (late.tone, late.grey, late.color) == ("holds", True, GREY)
    assert late.headline == "HOLDS …"
    assert soon.share is None  # a share of another load would be wrong
    assert "Largest" not in " ".join(late.sentences)
    assert late.load[0, 1, 2] == pytest.approx(-12 * STAGE.metres_per_newton)  # the load follows the mouse all the same
    turned = shown(state.with_plane("xz"), STAGE, reply)
    assert turned.map is not None
    assert turned.map.grey


@pytest.mark.slow
def test_before_the_first_answer_and_after_a_fault_nothing_is_claimed() -> None:
    for what in (shown(HELD, STAGE, None), shown(HELD, STAGE, replies(HELD)[-1], fault="it broke & <b>")):
        assert (what.tone, what.color) == ("unknown", GREY)
    assert what.headline == "NO ANSWER"
    assert "it broke &amp; &lt;b&gt;" in verdict_html(what)
    other = replace(HELD, number=1)  # a reply about another grasp says nothing here
    assert shown(other, STAGE, replies(HELD)[-1]).tone == "unknown"


def test_an_undecided_answer_is_called_so() -> None:
    reply = replies(HELD)[0]
    assert reply.check is not None
    undecided = replace(reply, check=replace(reply.check, verdict=Verdict.UNDECIDED, found=None))
    what = shown(HELD, STAGE, undecided)
    assert (what.tone, what.color) == ("undecided", TONE_COLORS["undecided"])
    assert "Neither was shown" in " ".join(what.sentences)


@pytest.mark.slow
def test_loads_and_maps_are_cut_at_the_rim() -> None:
    state = ViewState.of(two_fingers())
    stage = stage_of(state.grasp)
    state = state.pulled(1000 * state.force)
    what = shown(state, stage, replies(state)[-1])  # down, any force is resisted
    assert what.tone == "holds"
    assert np.linalg.norm(what.load[0, 1] - what.load[0, 0]) == pytest.approx(LOAD_ARROW * stage.size)
    assert what.share == 0
    assert "no bound" in bar_html(what)
    assert what.map is not None
    assert what.map.cut.any()
    assert not what.map.cut.all()
    assert np.linalg.norm(what.map.outline, axis=1).max() == pytest.approx(LOAD_ARROW * stage.size)
    drawn = map_svg(state, stage, what)
    assert drawn.count("<polygon") == 1
    assert "and more" in drawn
    assert map_svg(state.with_plane("none"), stage, what) == ""


def test_a_torque_has_two_heads_and_its_own_unit() -> None:
    state = HELD.with_plane("yz").twisted([0, 0.02, 0])
    what = shown(state, STAGE, replies(state)[-1])
    assert len(what.load) == 2
    assert "N·m" in " ".join(what.sentences)


def test_two_contacts_bear_no_moment_about_their_line() -> None:
    state = HELD.twisted([0.02, 0, 0])
    told = replies(state)
    what = shown(state, STAGE, told[-1])
    assert told[0].check is None
    assert told[-1].most is None
    assert (what.tone, what.share) == ("slips", float("inf"))
    assert "No forces at these 2 contacts balance it" in " ".join(what.sentences)
    assert what.motion is not None
    assert what.motion.twist[3] > 0
    off = replies(HELD.with_plane("xz").moved(np.array([0, 0.01, 0])))[-1]  # forces beside the line: only along it
    assert off.map is not None
    assert off.map.sizes[[18, 54]] == pytest.approx([0, 0])
    assert off.map.sizes[0] > 0


def test_the_way_out_presses_no_contact() -> None:
    grasp = two_fingers()
    for load in ([0, 1.0, 0, 0, 0, 0], [0.3, 1.0, 0.2, 0, 0.01, 0.02]):
        r = escape(grasp, np.array(load))
        assert (grasp.G[:, ::3].T @ r >= -1e-9).all()
        assert r @ load > 0
    assert escape(grasp, np.zeros(6)) == pytest.approx(np.zeros(6))
    nothing = slip_motion(grasp, np.zeros(6), None)
    assert nothing is None


def test_a_stage_without_files_stands_on_its_contacts() -> None:
    grasp = two_fingers()
    stage = stage_of(grasp)
    assert stage.guessed
    assert stage.hand is None
    assert stage.fingers.shape == (4, 2, 3)
    assert "Hand and object are not shown" in stage.notes[0]
    low, high = stage.object[0].min(axis=0), stage.object[0].max(axis=0)
    assert (low[:2] <= grasp.positions.min(axis=0)[:2] + 0.1 * grasp.size).all()
    assert high[2] > 0 > low[2]  # a solid, although the contacts lie in a plane
    vertices, faces = stage.cones()
    assert faces.max() < len(vertices)
    assert len(faces) == 24 * 4


def test_a_stage_with_files_has_hand_and_object() -> None:
    from handfast import load_grasp

    stage = stage_of(load_grasp("barrett-mug"))
    assert not stage.guessed
    assert stage.hand is not None
    assert stage.hand[1].max() == len(stage.hand[0]) - 1
    assert stage.notes == ()
    assert stage.up == pytest.approx([0, 0, 1])


def test_a_ray_meets_the_near_side_first() -> None:
    box = Shape("box", (0.2, 0.2, 0.2))
    eye, far = np.array([1.1, 0.01, 0.02]), np.array([-0.1, 0.01, 0.02])
    vertices, faces = box.triangles()
    corners = vertices[faces]
    assert first_hit(corners, eye, far) == pytest.approx(1.0 / 1.2)
    assert first_hit(corners, eye, far + np.array([0, 0, 5])) == 1.0


def test_scales_are_round_and_follow_weight_or_preload() -> None:
    assert [rounded_up(x) for x in (0.3, 1.0, 1.1, 6.0, 95.0)] == pytest.approx([0.3, 1.0, 1.5, 7.0, 100.0])
    assert reaches(jaws(mass=0.4, center_of_mass=[0, 0, 0]))[0] == pytest.approx(10.0)
    assert reaches(jaws(preload=10.0))[0] == pytest.approx(20.0)
    assert reaches(jaws(preload=0.0))[0] == pytest.approx(5.0)
