"""Planning with hands that nobody prepared, and what is said where that cannot succeed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import Verdict, check, load_hand
from handfast.cli import main
from handfast.cli.grasp import overlaps_text, starts_text
from handfast.cli.plan import PlanGrasps
from handfast.core.answer import Stop
from handfast.core.errors import InputError
from handfast.core.transforms import transform
from handfast.geometry.collision import always_meeting
from handfast.geometry.guess_regions import guess_regions
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand import Hand
from handfast.model.shape import Mesh, Shape
from handfast.planning.candidates import palm_poses
from handfast.planning.candidates.palm_poses import STANDARD, palm_of
from handfast.planning.candidates.surface import SurfaceSampler
from handfast.planning.evaluation.attempt import Attempts, Runner
from handfast.planning.filters.quick_look import QuickLook
from handfast.planning.plan_grasps import plan
from handfast.planning.question import PlanOptions, compared, hand_size
from handfast.planning.results.folder import PlanFolder
from handfast.planning.search import RejectionReason, Tally, diagnosis, fruitless
from handfast.readers.mesh_file import read_mesh
from handfast.stability.problem.loads import Loads
from tests.support.unprepared_hands import jaws, overlapping, wristed

BALL = Body.of([Shape("sphere", 0.03)], mass=0.05, name="ball")
BLOCK = Body.of([Shape("box", (0.04, 0.05, 0.06))], mass=0.05, name="block")
CLOSED = (RejectionReason.UNBALANCED, RejectionReason.SLIPS, RejectionReason.STRONG, RejectionReason.UNDECIDED)


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> Hand:
    return load_hand(wristed(tmp_path_factory.mktemp("hands")))


def runner(hand: Hand, body: Body = BLOCK, **more: Any) -> Runner:
    return Runner(Attempts(hand, body, Loads.gravity(body), PlanOptions(**more)))


# --- a wrist --------------------------------------------------------------------------------------


def test_the_palm_approaches_out_of_its_face_not_fingertips_first(hand: Hand) -> None:
    palm = palm_of(hand)
    assert palm.axis @ [0, 1, 0] > 0.9
    assert palm.center[1] > 0.03
    assert palm.center[2] > 0.04


def test_a_wrist_stays_at_rest_and_abductions_near_it(hand: Hand) -> None:
    palm, surface = palm_of(hand), SurfaceSampler(BALL)
    starts = [palm_poses.draw(np.random.default_rng(k), hand, palm, surface, STANDARD).q for k in range(200)]
    q = np.degrees(starts)
    assert not q[:, [hand.joint("wrist_turn"), hand.joint("wrist_bend")]].any()
    sides = np.abs(q[:, [hand.joint("index_side"), hand.joint("ring_side")]])
    assert 0 < sides.mean() < 8  # a third of the largest; drawn uniformly it would be half
    assert sides.max() > 15


def test_a_start_in_itself_gives_up_its_abductions_first(hand: Hand) -> None:
    palm = palm_of(hand)
    crossed = palm.opened.copy()
    crossed[[hand.joint("index_side"), hand.joint("ring_side")]] = np.radians([20, -20])
    look = QuickLook(Scene(hand, BALL))
    assert look.overlaps(crossed).itself > 1e-3
    assert look.overlaps(crossed).pair in {(a, b) for a in hand.link_names for b in hand.link_names}
    calm = palm_poses.calmer(palm, crossed, 0.0)
    assert look.overlaps(calm).itself == 0
    closing = hand.closing != 0
    np.testing.assert_array_equal(calm[closing], crossed[closing])


def test_a_wristed_hand_grasps(hand: Hand) -> None:
    found = plan(hand, BALL, count=1, attempts=80, jobs=1)
    assert found.verdict is Verdict.HOLDS
    assert all(check(found.grasps[0].grasp, w).verdict is Verdict.HOLDS for w in found.loads.wrenches)
    touching = {c.link.split("_")[0] for c in found.grasps[0].grasp.contacts}
    assert len(touching) >= 2


@pytest.mark.slow
def test_regions_are_guessed_by_finger_and_on_the_palm(hand: Hand) -> None:
    regions = guess_regions(hand)
    assert {r.finger for r in regions.of("tip")} == {"index", "ring", "thumb"}
    (palm,) = regions.of("palm")
    assert palm.link == "palm"
    assert palm.middle[1] @ [0, 1, 0] > 0.9


# --- jaws of either sense --------------------------------------------------------------------------


@pytest.mark.parametrize("grows", [True, False])
def test_jaws_of_either_sense_close_on_a_block(tmp_path: Path, grows: bool) -> None:
    hand = load_hand(jaws(tmp_path, grows=grows))
    one = runner(hand)
    pose = transform([0.004, 0, 0.085], np.eye(3))
    closed, moved = one._closed(one.asked.palm.opened, pose)
    assert {c.link for c in closed.contacts} == {"left", "right"}
    assert moved[0, 3] == pytest.approx(0, abs=1e-4)
    assert one.asked.palm.axis @ [0, 0, 1] > 0.99
    start = palm_poses.draw(np.random.default_rng(0), hand, one.asked.palm, one.surface, STANDARD)
    np.testing.assert_array_equal(start.q, one.asked.palm.opened)  # a gripper starts open


# --- links that overlap ----------------------------------------------------------------------------


def test_what_overlaps_at_rest_is_allowed_and_no_more(tmp_path: Path) -> None:
    hand = load_hand(overlapping(tmp_path))
    scene, still = Scene(hand, BLOCK), np.zeros(hand.l)
    assert always_meeting(scene) == ()
    assert scene.clearances(still, np.eye(4))[1].min() == pytest.approx(-4e-3, abs=1e-6)
    look = QuickLook(scene)
    assert look.overlaps(still).itself == 0
    look.at_rest[:] -= 2.5e-3  # as if the hand at rest had overlapped by so much less
    deep = look.overlaps(still)
    assert deep.itself == pytest.approx(2.5e-3, abs=1e-6)
    assert deep.pair == ("right", "left")


def test_overlapping_racks_forbid_no_start(tmp_path: Path) -> None:
    placed = [runner(load_hand(overlapping(tmp_path))).run(k).tally for k in range(3)]
    assert not any(t[RejectionReason.FOLDED] for t in placed)


def test_an_ignored_pair_is_not_looked_at(tmp_path: Path) -> None:
    hand = load_hand(overlapping(tmp_path))
    assert Scene(hand, BLOCK, [("left", "right")]).self_pairs == []
    with pytest.raises(InputError, match=r"link.*'nothing'.*left"):
        Scene(hand, BLOCK, [("left", "nothing")])
    with pytest.raises(InputError, match=r"'nothing'"):
        plan(hand, BLOCK, ignored=[("nothing", "left")])
    asked = [Attempts(hand, BLOCK, Loads.gravity(BLOCK), PlanOptions(ignored=p)) for p in ((), (("a", "b"),))]
    assert asked[0].question != asked[1].question


# --- what became of the starts ---------------------------------------------------------------------


def folded(times: int, depth: float = 4e-3) -> Tally:
    tally = Tally()
    for k in range(times):
        pair = ("index_tip", "ring_tip") if k % 4 else ("index_tip", "thumb_tip")
        tally.add(RejectionReason.FOLDED, overlap=(pair, depth * (1 if k % 4 else 2)))
    return tally


def test_the_worst_pairs_are_counted_named_and_kept(hand: Hand) -> None:
    tally = folded(8)
    tally.add(RejectionReason.MISSES, 3)
    text = starts_text(tally)
    assert text == "11 starts: 8 hand in itself (index_tip in ring_tip 4 mm), 3 would miss"
    told = overlaps_text(tally)[str(RejectionReason.FOLDED)]
    assert told == "index_tip in ring_tip 4 mm, 6 times; deepest index_tip in thumb_tip 8 mm"
    again = Tally.from_json(tally.to_json("kept", list(RejectionReason)), "kept", list(RejectionReason))
    again.take_overlaps(tally.overlaps_json())
    assert starts_text(again) == text
    whole = tally.copy()
    whole.add_all(tally)
    assert whole.rejected[RejectionReason.FOLDED].overlaps["index_tip", "ring_tip"] == (12, 4e-3)
    assert tally.rejected[RejectionReason.FOLDED].overlaps["index_tip", "ring_tip"] == (6, 4e-3)


def test_a_search_is_fruitless_when_nothing_came_through_the_filters() -> None:
    assert not fruitless(folded(29), 100)
    assert fruitless(folded(30), 100)  # all for one reason
    mixed = folded(98)
    mixed.add(RejectionReason.MISSES)
    assert not fruitless(mixed, 100)
    mixed.add(RejectionReason.MISSES)
    assert fruitless(mixed, 100)
    for reason in (RejectionReason.SLIPS, RejectionReason.STRONG, None):
        passed = mixed.copy()
        passed.add(reason)
        assert not fruitless(passed, 100)


def test_the_diagnosis_names_the_pair_and_the_option(hand: Hand) -> None:
    (said,) = diagnosis(folded(40), hand)
    assert "index_tip and ring_tip overlap in 30 of 40 starts, by up to 4.0 mm" in said
    assert "--ignore-pair index_tip ring_tip" in said
    tally = Tally()
    tally.add(RejectionReason.MISSES, 10)
    assert "--closing" in diagnosis(tally, hand)[0]


def test_a_hopeless_run_ends_early_and_says_why(hand: Hand, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wall = Body.of([Shape("box", (0.5, 0.5, 0.5))], mass=1.0, name="wall")
    found = plan(hand, wall, count=1, jobs=1, give_up=20)
    assert found.stop is Stop.FRUITLESS
    assert found.verdict is Verdict.UNDECIDED
    assert found.tried <= 20
    assert found.diagnosis
    source = wristed(tmp_path)
    command = PlanGrasps(hand=str(source), object="ball", closing=((("index_bend", 0.0),),), jobs=1, give_up=1)
    command.friction = 1e-6
    assert command.run() == 3
    out = capsys.readouterr().out
    assert "(stopped: fruitless)" in out


def test_overlaps_survive_a_resume(tmp_path: Path) -> None:
    hand = load_hand(overlapping(tmp_path))
    names = (str(tmp_path / "overlapping.xml"), "block")
    first = PlanFolder(tmp_path / "out", *names)
    found = plan(hand, BLOCK, count=50, attempts=12, jobs=1, journal=first)
    again = PlanFolder(tmp_path / "out", *names, resume=True).earlier(found.asked)
    assert again is not None
    assert again.tally.overlaps_json() == found.tally.overlaps_json()


# --- sizes -------------------------------------------------------------------------------------------


def test_a_mesh_in_millimetres_is_refused_with_both_sizes(hand: Hand) -> None:
    assert 0.15 < hand_size(hand) < 0.25  # without the forearm
    with pytest.raises(InputError, match=r"is 60 m long, the hand \d+ mm; .*--scale 0\.001"):
        compared(hand, sized(30.0))
    with pytest.raises(InputError, match=r"is 0\.06 mm long.*other units: --scale METRES"):
        plan(hand, sized(3e-5))
    with pytest.raises(InputError, match=r"is 0\.06 mm long.*in metres already: --scale 1"):
        plan(hand, replace(sized(3e-5), scale=0.001))
    assert "is 6 m long" in compared(hand, sized(3.0))
    for radius in (0.01, 0.05, 0.5):
        assert compared(hand, sized(radius)) == ""


def test_a_mesh_in_millimetres_is_refused_before_it_is_taken_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("handfast.cli.load_options.body_of", lambda *_, **__: pytest.fail("was taken apart"))
    (tmp_path / "mm.obj").write_text(
        "v 0 0 0\nv 90000 0 0\nv 0 90000 0\nv 0 0 90000\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    )
    assert main(["plan", "barrett-bh8-280", str(tmp_path / "mm.obj"), "--mass", "0.1"]) == 2
    assert "mm: size: is 9e+04 m long, the hand 380 mm; a mesh in millimetres" in capsys.readouterr().err


@pytest.mark.parametrize("command", [["plan", "barrett-bh8-280"], ["show"]])
def test_a_mesh_is_read_once(command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[Path] = []

    def reading(path: Path) -> list[Mesh]:
        read.append(path)
        return read_mesh(path)

    monkeypatch.setattr("handfast.readers.load_body.read_mesh", reading)
    mesh = tmp_path / "corner.obj"
    mesh.write_text("v 0 0 0\nv .09 0 0\nv 0 .09 0\nv 0 0 .09\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    asked = ["--mass", "0.1", "--attempts", "1"] if command[0] == "plan" else []
    main([*command, str(mesh), *asked])
    assert read == [mesh]


def sized(radius: float) -> Body:
    return Body.of([Shape("sphere", radius)], mass=0.05, name="ball")
