"""What a HOLDS leans on: margins derived by hand, laws, planted states and planted wrong claims."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handfast import check, load_grasp, save_grasp, verify
from handfast.cli import main
from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.pictures import Entry, write_report
from handfast.stability.answers.margin import FRAGILE_MOTION, Flip, Margin
from handfast.stability.problem import model
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.model import state_of
from handfast.stability.problem.settings import Settings
from handfast.stability.problem.witness import Witness
from handfast.stability.search.least_motion import least_motion
from handfast.stability.studies import margin_search
from handfast.stability.studies.margin_search import FRICTION_RESOLUTION, TILT_RESOLUTION, margin, why_fragile
from tests.support.problems import Solved, moved, pinch, solved, table


@pytest.fixture(autouse=True)
def _any_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples are decided, or left at a number of nodes, however long that takes."""
    monkeypatch.setattr("handfast.stability.studies.margin_search.CHECK_TIME_LIMIT", math.inf)


def slope(angle: float, mu: float, contacts: int) -> tuple[Grasp, Array]:
    """A block of 1 N, its middle of mass in the middle of its contacts, on a slope of `angle` [rad]."""
    grasp = table(mu, contacts)
    force = np.array([np.sin(angle), 0.0, -np.cos(angle)])
    middle = np.mean([c.position for c in grasp.contacts], axis=0)
    return grasp, np.r_[force, np.cross(middle, force)]


def asked(grasp: Grasp, wrench: Array, **options) -> Margin:
    found = margin(grasp, wrench, **options)
    assert found is not None
    return found


@cache
def of_pinch(load: float) -> Margin:
    """Of a pinch that a load pulls along -y [N]."""
    return asked(pinch(), np.array([0, -load, 0, 0, 0, 0]))


def assert_brackets(flip: Flip, value: float, resolution: float) -> None:
    """The flip lies between what holds and what slips, which are as near as asked, and the slip is proved."""
    assert flip.slips is not None
    assert flip.holds <= value <= flip.slips
    assert flip.slips - flip.holds <= resolution
    assert flip.undecided == 0
    assert flip.certified
    assert flip.answer is not None
    assert flip.answer.verdict is Verdict.SLIPS
    assert verify(flip.answer).ok


# --- by hand ------------------------------------------------------------------------------------


@pytest.mark.parametrize("contacts", [1, 3])
@pytest.mark.slow
def test_a_block_on_a_slope_keeps_the_tangent_of_the_slope(contacts: int) -> None:
    """Coulomb: it slides once mu < tan(angle); springs share the weight, cos(angle) / contacts each."""
    grasp, wrench = slope(0.2, 0.5, contacts)
    m = asked(grasp, wrench, stiffness=2000.0)
    assert_brackets(m.less, 1 - np.tan(0.2) / 0.5, FRICTION_RESOLUTION)
    assert (m.more.holds, m.more.slips, m.more.undecided, m.more.certified) == (1.0, None, 0, False)
    assert m.friction is m.less
    squeeze = 1e3 * np.cos(0.2) / contacts / 2000.0
    assert (m.motion, m.squeeze) == (pytest.approx(squeeze), pytest.approx(squeeze))
    assert m.why == ()
    assert not m.fragile


@pytest.mark.parametrize("contacts", [1, 4])
def test_a_block_on_a_slope_keeps_the_rest_of_the_friction_angle(contacts: int) -> None:
    """All normals tilted by a are a slope steeper by a: it slides beyond atan(mu) - angle."""
    grasp, wrench = slope(0.35, 0.5, contacts)
    tilt = asked(grasp, wrench).tilt
    assert_brackets(tilt, np.degrees(np.arctan(0.5) - 0.35), TILT_RESOLUTION)
    assert tilt.contacts == tuple(range(contacts))
    assert tilt.towards is not None
    downhill = np.tile([1.0, 0.0, 0.0], (contacts, 1))  # across the normal z, where the weight pulls
    np.testing.assert_allclose(tilt.towards, downhill, atol=1e-12)


def test_a_pinch() -> None:
    """1 N each; half of 0.5 N at each tip, so at atan(0.25) to the normals: the cones' half angle is atan(0.5)."""
    m = of_pinch(0.5)
    assert_brackets(m.less, 0.5, FRICTION_RESOLUTION)
    assert_brackets(m.tilt, np.degrees(np.arctan(0.5) - np.arctan(0.25)), TILT_RESOLUTION)
    assert m.motion == pytest.approx(1e3 * 1.0 / margin_search.RUBBER_PAD, rel=1e-3)
    assert not m.fragile


def test_a_pinch_near_its_end_is_fragile() -> None:
    """0.95 of what it resists: 5 % of the friction to spare, and atan(0.5) - atan(0.475) = 1.16 degrees."""
    m = of_pinch(0.95)
    assert_brackets(m.less, 0.05, FRICTION_RESOLUTION)
    assert_brackets(m.tilt, np.degrees(np.arctan(0.5) - np.arctan(0.475)), TILT_RESOLUTION)
    assert m.why == why_fragile(m.witness.grasp, m.witness.wrench, NO_LIMITS, Settings()) == ("friction", "tilt")
    assert m.fragile


def test_only_what_holds_has_a_margin() -> None:
    slips = np.array([0, -1.05, 0, 0, 0, 0])
    assert margin(pinch(), slips) is None
    assert why_fragile(pinch(), slips, NO_LIMITS, Settings()) is None


@pytest.mark.parametrize(("degrees", "why"), [(2.4, ("tilt",)), (2.6, ())])
def test_why_a_grasp_is_fragile_takes_less_than_its_margin(
    degrees: float, why: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A block that slides with all normals tilted so far: on both sides of 2.5 degrees."""
    grasp, wrench = slope(np.arctan(0.5) - np.radians(degrees), 0.5, 1)
    count: list[object] = []

    def counted(*question, **how):
        count.append(question)
        return ask(*question, **how)

    ask = margin_search.check
    monkeypatch.setattr(margin_search, "check", counted)
    assert why_fragile(grasp, wrench, NO_LIMITS, Settings()) == why
    assert len(count) < 30  # 46 and 49 for the margin


def test_more_friction_can_slip() -> None:
    """Holding is not monotone in friction: what the samples found, `check` says of the grasp that they speak of."""
    grasp, wrench = load_grasp("barrett-can"), np.array([-3.97, 0.4, 0.26, 0, 0, 0])
    more = asked(grasp, wrench).more
    assert more.slips is not None
    assert more.certified
    assert 0.0 < more.holds < more.slips <= 0.2
    for change, verdict in ((more.holds, Verdict.HOLDS), (more.slips, Verdict.SLIPS)):
        changed = grasp.with_friction(grasp.contacts[0].friction * (1 + change))
        assert check(changed, wrench).verdict is verdict
    assert more.answer is not None
    assert more.answer.posed is not None
    expected = [c.friction * (1 + more.slips) for c in grasp.contacts]
    np.testing.assert_allclose(more.answer.posed.problem.grasp.mu, expected)
    assert verify(more.answer).ok


@pytest.mark.parametrize("stiffness", [0.0, -1.0, np.inf, np.nan])
def test_a_stiffness_is_positive(stiffness: float) -> None:
    with pytest.raises(InputError, match=r"stiffness.* a positive number is needed"):
        margin(pinch(), np.zeros(6), stiffness=stiffness)


# --- the motion ---------------------------------------------------------------------------------


def least(s: Solved) -> tuple[Witness, Witness]:
    """The first witness, and that of least motion, which is shown if it is proved as well as the first."""
    limits = GraspLimits(eta=s.eta)
    found = check(s.grasp, s.wrench, limits=limits).found
    assert found is not None
    return found, least_motion(found, limits)


@pytest.mark.parametrize(
    "seed, m, eta", [(0, 3, 0.1), (3, 6, 0.1), (9, 4, 0.1), (14, 5, 0.0), (16, 3, 0.0), (25, 4, 0.0)]
)
def test_no_planted_state_moves_less(seed: int, m: int, eta: float) -> None:
    """The planted state is an equilibrium, so the least motion is not larger; nor is it than the loaded springs'."""
    s = solved(seed, m=m, eta=eta)
    first, found = least(s)
    planted = Witness(s.grasp, s.wrench, s.state, s.eta, True)
    assert planted.valid
    assert found.valid
    np.testing.assert_allclose(found.wrench, s.wrench, rtol=1e-12, atol=1e-15)
    assert found.largest_motion <= min(first.largest_motion, 1.1 * planted.largest_motion)
    if eta == 0:
        assert found.largest_motion >= found.state.c[::3].max() * (1 - 1e-9)


def test_motion_is_that_of_object_or_relative_whichever_is_larger() -> None:
    """A finger that turns by 10 N / m at 0.1 m below an object that stays: 1 N, all of it relative."""
    grasp = pinch()
    still = state_of(np.zeros(6), np.array([10.0, 0.0]), np.zeros(6), np.zeros(2), np.zeros(0))
    assert Witness(grasp, np.zeros(6), still, 0.0, True).largest_motion == pytest.approx(1.0)
    moved = state_of(np.array([0, 3.0, 0, 0, 0, 0]), np.zeros(2), np.zeros(6), np.zeros(2), np.zeros(0))
    assert Witness(grasp, np.zeros(6), moved, 0.0, True).largest_motion == pytest.approx(3.0)


def test_a_strong_squeeze_alone_is_not_fragile() -> None:
    """100 N on a rubber pad give way by 10 mm in this model, without any leaning."""
    grasp, wrench = slope(0.2, 0.5, 1)
    m = asked(grasp, 100 * wrench)
    assert m.motion > FRAGILE_MOTION
    assert m.why == ()
    r = model.state_of(10 * m.witness.state.r, *(getattr(m.witness.state, n) for n in ("q", "c", "f", "coupling")))
    found = replace(m.witness, state=r)
    assert replace(m, held=replace(m.held, found=found, posed=None)).why == ("motion",)  # shown as it was found


# --- laws ---------------------------------------------------------------------------------------


def numbers(m: Margin) -> list[float | None]:
    return [x for f in (m.less, m.more, m.tilt) for x in (f.holds, f.slips, f.undecided)]


CASES = {
    "slope": slope(0.3, 0.5, 3),
    "random 8": (solved(8).grasp, solved(8).wrench),
}
SLOW = ("slope",)


CHANGES = "rotation", "order", "length", "force"


@cache
def as_it_is(case: str) -> Margin:
    return asked(*CASES[case])


@pytest.mark.parametrize(
    ("case", "changes"),
    [*(("random 8", (x,)) for x in CHANGES), *(pytest.param(x, CHANGES, marks=pytest.mark.slow) for x in SLOW)],
)
def test_axes_units_and_order_change_nothing(case: str, changes: tuple[str, ...]) -> None:
    """Each by itself; of grasps that take longer all together."""
    grasp, wrench = CASES[case]
    R, shift, order, length, force = np.eye(3), np.zeros(3), list(range(grasp.m)), 1.0, 1.0
    if "rotation" in changes:
        R, shift = Rotation.from_rotvec([0.3, -1.0, 0.7]).as_matrix(), np.array([0.2, -0.1, 0.4])
    if "order" in changes:
        order = order[::-1]
    if "length" in changes:
        length = 1000.0
    if "force" in changes:
        force = 100.0
    f = R @ wrench[:3]
    w = force * np.r_[f, length * (R @ wrench[3:] + np.cross(shift, f))]
    before, after = as_it_is(case), asked(moved(grasp, R, shift, order, length, force), w)
    assert numbers(after) == numbers(before)
    assert after.motion == pytest.approx(force * before.motion, rel=5e-3)
    assert {order[i] for i in after.tilt.contacts} == set(before.tilt.contacts)


def test_stiffness_scales_the_motion_alone() -> None:
    soft, hard = asked(pinch(), np.array([0, -0.5, 0, 0, 0, 0]), stiffness=1000.0), of_pinch(0.5)
    assert (soft.stiffness, hard.stiffness) == (1e3, 1e4)
    assert soft.motion == pytest.approx(10 * hard.motion)
    assert numbers(soft) == numbers(hard)


# --- honesty ------------------------------------------------------------------------------------


def test_the_four_sides_of_a_contact() -> None:
    """A pinch along x: the first side is where the load pulls, then away, then both ways along its joint's axis."""
    load, twist = np.array([0, -2.0, 0, 0, 0, 0]), np.array([0, 0, 0, 0, 0, 3.0])
    y, z = np.eye(3)[1:]
    right, left = margin_search.sides(pinch(), load)
    np.testing.assert_allclose(right, [-y, y, z, -z, 0 * z], atol=1e-12)
    np.testing.assert_allclose(left, [-y, y, -z, z, 0 * z], atol=1e-12)  # the normal points the other way
    right, left = margin_search.sides(
        pinch(), twist
    )  # about +z, it pulls the right contact along +y, the left one along -y
    np.testing.assert_allclose([right[0], left[0]], [y, -y], atol=1e-12)
    # nothing pulls across the normals, and outwards is along them: the joints' axes tell
    right, left = margin_search.sides(pinch(), np.zeros(6))
    np.testing.assert_allclose([right[0], left[0]], [z, -z], atol=1e-12)
    # a load of the same kind about another origin is told the same way
    shift = np.array([0.5, -0.3, 0.2])
    away = moved(pinch(), np.eye(3), shift, [0, 1], 1.0, 1.0)
    np.testing.assert_allclose(margin_search.sides(away, twist), margin_search.sides(pinch(), twist), atol=1e-12)
    there = np.r_[load[:3], np.cross(shift, load[:3])]
    np.testing.assert_allclose(margin_search.sides(away, there), margin_search.sides(pinch(), load), atol=1e-12)
    flat = table(0.5, 4)  # pushed onto it: its sides are turned by the torque about its middle, wherever the origin is
    push = np.array([0, 0, -5.0, 0, 0, 0.2])
    there = push + np.r_[np.zeros(3), np.cross(shift, push[:3])]
    moved_ = moved(flat, np.eye(3), shift, [0, 1, 2, 3], 1.0, 1.0)
    np.testing.assert_allclose(margin_search.sides(moved_, there), margin_search.sides(flat, push), atol=1e-9)


def test_what_is_undecided_is_neither(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples of friction lessened by 5 % or 10 % stay undecided: nothing above 2 % is said to hold."""
    real = check

    def doubtful(grasp: Grasp, wrench: Array, **options):
        answer = real(grasp, wrench, **options)
        factor = grasp.contacts[0].friction / 0.5
        return replace(answer, verdict=Verdict.UNDECIDED) if 0.85 < factor < 0.97 else answer

    monkeypatch.setattr(margin_search, "check", doubtful)
    less = asked(pinch(), np.array([0, -0.5, 0, 0, 0, 0])).less
    assert (less.holds, less.slips, less.undecided) == (0.02, 0.7, 2)


def test_ctrl_c_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    real, asked_for = check, []

    def interrupted(grasp: Grasp, wrench: Array, **options):
        asked_for.append(grasp)
        answer = real(grasp, wrench, **options)
        return replace(answer, stop=Stop.INTERRUPTED) if len(asked_for) == 4 else answer

    monkeypatch.setattr(margin_search, "check", interrupted)
    m = asked(pinch(), np.array([0, -0.5, 0, 0, 0, 0]))
    assert (m.stop, m.checks) == (Stop.INTERRUPTED, 3)
    assert len(asked_for) == 4  # the question itself, and three changes
    assert m.tilt.holds == 0.0


def test_a_slip_without_a_certificate_is_not_called_proved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(margin_search, "check", lambda *a, **options: replace(check(*a, **options), proof=None))
    grasp, wrench = slope(0.2, 0.5, 1)
    less = asked(grasp, wrench).less
    assert less.slips is not None
    assert not less.certified


def test_every_change_is_asked_of_check(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of one contact: eight sizes of friction each way, and four sides at each of six angles, no more and no less."""
    seen: list[Grasp] = []
    real = check

    def noted(grasp: Grasp, wrench: Array, **options):
        seen.append(grasp)
        return real(grasp, wrench, **options)

    monkeypatch.setattr(margin_search, "check", noted)
    grasp, wrench = slope(0.05, 2.0, 1)
    m = asked(grasp, wrench)
    assert m.tilt.slips is None
    assert m.tilt.holds == m.tilt.limit == margin_search.TILTS[-1]
    angles = [float(np.degrees(np.arccos(np.clip(g.contacts[0].normal[2], -1, 1)))) for g in seen]
    tilted = sorted(round(a, 6) for a in angles if a > 1e-3)
    assert tilted == sorted(4 * list(margin_search.TILTS))
    frictions = {round(g.contacts[0].friction / 2, 6) for g in seen}
    assert {round(1 + x, 6) for x in margin_search.FRICTION_CHANGES} <= frictions


# --- where it is said ---------------------------------------------------------------------------


def test_json_and_command_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    ask = ["check", "barrett-can", "--wrench", "0", "0", "0"]
    assert main([*ask, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["margin"] is None
    assert main([*ask, "--json", "--margin", "--stiffness", "2000", "--save", str(tmp_path / "a.json")]) == 0
    said = json.loads(capsys.readouterr().out)
    m = said["margin"]
    assert said["verdict"] == "holds"
    assert m["fragile"] is True
    assert m["stiffness"] == 2000.0
    assert m["motion"] > 5 * m["squeeze"] > 0
    assert m["tilt"]["slips"] <= 2.5
    assert m["tilt"]["certified"] is True
    assert len(m["tilt"]["towards"]) == len(m["tilt"]["contacts"])
    assert set(m["friction"]) == {"less", "more"}
    assert main([*ask, "--margin"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("HOLDS, FRAGILE")
    assert "motion at 10000 N/m" in out
    assert "no flip found" in out


def test_what_does_not_hold_says_null(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_grasp(pinch(), tmp_path / "pinch.json")
    assert main(["check", str(tmp_path / "pinch.json"), "--wrench", "0", "1.05", "0", "--margin", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["verdict"], said["margin"]) == ("slips", None)


def test_a_stiffness_needs_the_margin(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "fig1", "--wrench", "0", "1", "0", "--stiffness", "100"]) == 2
    assert "--stiffness is for --margin" in capsys.readouterr().err


def test_a_saved_answer_claims_no_margin(tmp_path: Path) -> None:
    """Nothing in the file proves one: it is not kept, and a file that claims one is refused."""
    answer = replace(check(pinch(), np.array([0, -0.5, 0, 0, 0, 0])), margin=of_pinch(0.5))
    path = tmp_path / "a.json"
    answer.save(path)
    data = json.loads(path.read_text())
    assert data["answer"]["margin"] is None
    assert verify(str(path)).ok
    data["answer"]["margin"] = answer.to_json()["margin"]
    path.write_text(json.dumps(data))
    done = verify(str(path))
    assert not done.ok
    assert "margin" in done.reason


def test_a_report_shows_it(tmp_path: Path) -> None:
    answer = check(pinch(), np.array([0, -0.95, 0, 0, 0, 0]))
    path = tmp_path / "a.html"
    write_report(path, pinch(), [Entry("Does it?", answer)])
    assert "What it leans on" not in path.read_text("utf-8")
    answer = replace(answer, margin=of_pinch(0.95))
    write_report(path, pinch(), [Entry("Does it?", answer)], force=True)
    text = path.read_text("utf-8")
    assert "HOLDS, FRAGILE</b>" in text
    assert "What it leans on" in text
    assert "Fragile: it leans on its friction and its normals." in text
    assert "no flip found" in text
