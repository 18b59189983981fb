"""The scale of a load, and the slack: by hand, in any frame, at any size."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.proofs.grasp import GraspData, StartData, read_grasp
from handfast.proofs.question import Question, read_question
from handfast.proofs.tolerance import (
    COMPLETE_CAP,
    ENOUGH_CAP,
    UNBOUNDED_FACTOR,
    drives,
    farthest,
    in_play,
    left_behind,
    load_scale,
    motion_size,
    passed_on,
    size_of,
    slack_units,
    travel,
    ways,
)
from tests.support.exact_states import data
from tests.support.small_grasp import small_grasp

HINGE = GraspJoint("hinge", [0, 0, 1], [0.1, 0, 0], (1,))
SLIDE = GraspJoint("slide", [1, 0, 0], [0, 0, 0], (1,), "prismatic")
CONTACTS = [Contact([-0.02, 0, 0], [1, 0, 0], 0.5), Contact([0.02, 0, 0], [-1, 0, 0], 0.5)]


def test_the_scale_is_that_of_the_load():
    g = data(Grasp(CONTACTS, [HINGE, SLIDE], preload={"hinge": 0.3, "slide": 2.0}))
    assert load_scale(g, np.array([3.0, 0, 4, 0, 0, 0])) == pytest.approx(5.0)
    assert load_scale(g, np.array([0.0, 0, 1, 0, 0, 0.1])) == pytest.approx(0.1 / 0.02)
    # without a load: 0.3 N m at the size 0.02 m is 15 N, 2 N of the slide is less
    assert load_scale(g, np.zeros(6)) == pytest.approx(15.0)
    spring = replace(g, torque=np.array([0.0, 40.0]))
    assert load_scale(spring, np.zeros(6)) == pytest.approx(40.0)
    weak = replace(g, command=g.command / 100, torque=np.array([0.0, 0.25]))
    assert load_scale(weak, np.zeros(6)) == pytest.approx(0.25)
    assert load_scale(data(Grasp(CONTACTS)), np.zeros(6)) == 1.0  # nothing acts


def test_the_scale_does_not_depend_on_the_origin():
    there = np.array([0.3, -0.2, 5.0])
    moved = data(Grasp([Contact(c.position + there, c.normal, 0.5) for c in CONTACTS]))
    here = data(Grasp(CONTACTS))
    w = np.array([1.0, -2, 0.5, 0.02, 0.01, -0.03])
    shifted = np.concatenate([w[:3], w[3:] + np.cross(there, w[:3])])
    assert load_scale(moved, shifted) == pytest.approx(load_scale(here, w), rel=1e-9)
    assert moved.size == pytest.approx(here.size)


def test_the_slack_has_the_units_of_its_rows():
    g = data(Grasp(CONTACTS, [HINGE, SLIDE]))
    np.testing.assert_allclose(slack_units(g), [1, 1, 1, 0.02, 0.02, 0.02, 0.02, 1.0])


@pytest.mark.parametrize("exponent", range(-20, 21, 4))
def test_sizes_are_in_proportion(exponent):
    """One contact on a hinge, contacts apart, contacts at one point: no length is absolute."""
    a = 10.0**exponent
    cases = [
        (CONTACTS, HINGE, 0.02, 0.08),
        ([Contact([0.02, 0, 0], [-1, 0, 0], 0.5)] * 2, HINGE, 0.08, 0.08),
        ([Contact([0.1, 0, 0], [-1, 0, 0], 0.5)] * 2, HINGE, 0.1, 0.1),
    ]
    for contacts, joint, size, arm in cases:
        g = data(Grasp(contacts, [joint]))
        scaled = replace(g, positions=a * g.positions, origins=a * g.origins)
        assert scaled.size == pytest.approx(a * size)
        assert scaled.joint_arms[0] == pytest.approx(a * arm)


# --- forces in play ------------------------------------------------------------

TURN = np.sqrt(5 / 16)  # [m] of joint "turn", with what it turns the soft finger by
SIZE = np.sqrt(0.09375)
# [m] how far contacts move where the tendon is held, which then turns `turn` 1/6 as far as `roll`
PUSH, ROLL, BACK = TURN / 3, TURN / 6, TURN / 24


def question(grasp: dict[str, Any], goal: str = "check", **fields: Any) -> Question:
    return read_question({"grasp": grasp, "goal": goal, "wrench": [0.0] * 6} | fields, "question")


def quiet(**commands: float) -> dict[str, Any]:
    """The small grasp with these commands alone, and without laws."""
    data = small_grasp() | {"preload": commands}
    for joint in data["joints"]:
        for name in ("friction", "torque", "stop"):
            joint.pop(name, None)
    return data


def test_constants() -> None:
    assert (UNBOUNDED_FACTOR, COMPLETE_CAP, ENOUGH_CAP) == (1e3, 1e4, 1e6)


@pytest.mark.parametrize(
    ("wrench", "size"),
    [
        # the force (0, 3, 4) at the middle: (1/4, -1/8, 1/8) x (0, 3, 4) = (-0.875, -1, 0.75)
        ([0, 3, 4, -0.875, -1, 0.75], 5.0),
        ([0, 3, 4, -0.875, -1, 0.75 + 10 * SIZE], 10.0),
        ([0, 3, 4, -0.875, -1, 0.75 + 4 * SIZE], 5.0),
        ([0, 0, 0, 0, 3, -4], 5 / SIZE),
        ([0, 0, 0, 0, 0, 0], 0.0),
        # a force at the origin: its torque about the middle is -(1/4, -1/8, 1/8) x (8, 0, 0) = (0, -1, -1)
        ([8, 0, 0, 0, 0, 0], 8.0),
        ([0.5, 0, 0, 0, 1 + 1 / 16, 1 / 16], 1 / SIZE),
    ],
)
def test_the_size_of_a_wrench(wrench: list[float], size: float) -> None:
    assert size_of(read_grasp(small_grasp(), "g"), np.array(wrench)) == pytest.approx(size, rel=1e-14)


@pytest.mark.parametrize(
    ("motion", "off", "size"),
    [
        ({0: 3, 1: 4}, {}, 5),
        # a turn of 8 about z moves the middle (1/4, -1/8, 1/8) by (1, 2, 0)
        ({0: -1, 1: 5, 5: 8}, {}, 7),
        ({0: -1, 1: -2, 5: 8}, {}, 8 * SIZE),
        ({1: 1, 2: 1, 3: 8}, {}, 8 * SIZE),  # a turn about x moves the middle by (0, -1, -1)
        ({0: -0.5, 2: 1, 4: 4}, {3: 1}, 5 * SIZE),  # about y by (1/2, 0, -1); by less than SIZE if it is off by 1
        ({0: 3, 1: 4}, {2: 2}, 7),
        ({0: 3, 1: 4}, {5: 1}, 5 + SIZE),  # the middle is SIZE away from the origin
        ({0: -1, 1: -2, 5: 8}, {4: 2}, 10 * SIZE),
        ({6: -50}, {}, 50 * SIZE),
        ({6: -50}, {6: 8}, 58 * SIZE),
    ],
)
def test_the_size_of_a_motion_by_hand_is_no_more_than_what_is_said(motion: Any, off: Any, size: float) -> None:
    g = read_grasp(small_grasp(), "g")
    v, more = np.zeros(6 + g.l), np.zeros(6 + g.l)
    v[list(motion)], more[list(off)] = list(motion.values()), list(off.values())
    assert size <= motion_size(g, v, more) <= size * (1 + 1e-11)


def test_the_size_of_several_motions_is_that_of_the_largest() -> None:
    g = read_grasp(small_grasp(), "g")
    one, two = np.zeros(6 + g.l), np.zeros(6 + g.l)
    one[[0, 1]], two[[3, 4]] = (3, 4), (6, 8)
    assert motion_size(g, np.stack([one, two])) == pytest.approx(5, rel=1e-11)
    assert motion_size(g, np.stack([one, one])) == motion_size(g, one)
    assert motion_size(g, np.stack([two, two])) == motion_size(g, two)


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_far_from_the_origin_turns_round_what_the_middle_moves_by(turn: float) -> None:
    """A turn about z with a way back leaves 1/8 and 1 along x of a middle 10^6 m away; 10^-9 of it may be rounding."""
    g, away = read_grasp(small_grasp(), "g"), np.array([1e6, 0, 0])
    far = replace(g, positions=g.positions + away, origins=g.origins + away)
    v = np.zeros(6 + g.l)
    v[[0, 1, 5]] = turn, turn * (-1e6 - 0.25), turn
    assert 1.125 + 0.9e-9 <= motion_size(far, v) <= 1.125 + 1.2e-9


def test_drives_by_hand() -> None:
    assert drives(question(quiet())) == 0
    assert drives(question(small_grasp())) == pytest.approx(6 / TURN)  # pull: 3 over half of it
    assert drives(question(quiet(push=-0.75))) == pytest.approx(0.75 / PUSH)
    assert drives(question(quiet(push=-0.75, back=-0.25))) == pytest.approx(0.25 / BACK)
    data = quiet(push=0.01)
    data["joints"][0] |= {"friction": 0.25, "torque": -0.5}  # what a joint carries adds up
    assert drives(question(data)) == pytest.approx(0.75 / TURN)
    data["joints"][2] |= {"torque": -2}
    assert drives(question(data)) == pytest.approx(2 / ROLL)


def test_commands_that_are_sought_count_as_far_as_they_are_bounded() -> None:
    asked = question(quiet(push=-0.75, pull=3.0), "torques", driven=["push"])
    assert drives(asked, 2.0) == pytest.approx(2 / PUSH)
    assert in_play(asked, 2.0) == max(load_scale(asked.grasp, asked.wrench), drives(asked, 2.0))
    assert drives(question(quiet(push=-0.75)), 2.0) == pytest.approx(0.75 / PUSH)  # none is sought


def test_commands_that_are_sought_do_not_count() -> None:
    assert drives(question(quiet(push=-0.75, pull=3.0), "torques", driven=["pull"])) == 0
    with_back = quiet(push=-0.75, back=-0.25)  # what a backdrivable motor is commanded is given
    assert drives(question(with_back, "torques", driven=["push"])) == pytest.approx(0.25 / BACK)
    limits = {"push": 5.0, "pull": 0.25}
    assert drives(question(with_back, "torques", driven=["push"], torque_limits=limits)) == pytest.approx(5 / PUSH)


def test_limits_count() -> None:
    limits = {"push": 5.0, "pull": 0.25}
    assert drives(question(quiet(push=-0.75), torque_limits=limits)) == pytest.approx(5 / PUSH)
    assert drives(question(quiet(push=-7.5), torque_limits=limits)) == pytest.approx(7.5 / PUSH)
    assert drives(question(quiet(push=-0.75), force_limit=90.0)) == 90
    assert drives(question(small_grasp(), force_limit=20.0)) == 20
    assert drives(question(small_grasp(), force_limit=2.0)) == pytest.approx(6 / TURN)


def test_what_moves_no_contact_does_not_count() -> None:
    data = quiet(push=-0.75)
    data["joints"].append(
        {"name": "idle", "axis": [0, 0, 1], "origin": [0, 0, 0], "moves": [], "torque": 50.0, "friction": 1.0}
    )
    data["mechanism"]["actuators"] += [
        {"name": "spin", "joints": {"idle": 1}},
        {"name": "turned", "joints": {"idle": 1}, "backdrivable": True},
    ]
    data["preload"] |= {"spin": 100.0, "turned": 70.0}
    assert drives(question(data)) == pytest.approx(0.75 / PUSH)
    # a joint whose axis goes through one of two soft fingers turns it, though it moves no point: 6 over the lever 1/2
    data["joints"][3] |= {"moves": [0], "origin": [0.5, 0, 7], "torque": 6.0, "friction": 0}
    data["contacts"][1]["torsion"] = 0.375
    data["mechanism"]["actuators"] = data["mechanism"]["actuators"][:3]
    data["preload"] = {"push": -0.75}
    assert drives(question(data)) == pytest.approx(12)


def test_what_is_held_does_not_count() -> None:
    data = quiet()
    data["joints"][0] |= {"torque": 5, "stop": "both"}
    assert drives(question(data)) == 0
    data["joints"][0]["stop"] = "lower"
    assert drives(question(data)) == pytest.approx(5 / TURN)


def test_the_farthest_magnitude() -> None:
    along = [0, 0, 0, 0, 3, -4]  # 5 / SIZE
    assert farthest(question(small_grasp(), "largest", direction=along)) == pytest.approx(1e3 * 6 / TURN * SIZE / 5)
    base = {"direction": along, "wrench": [0, 30, 40, -8.75, -10, 7.5]}
    assert farthest(question(small_grasp(), "largest", **base)) == pytest.approx(1e3 * 50 * SIZE / 5)
    base["wrench"] = [0, 3, 4, -0.875, -1, 0.75]
    assert farthest(question(small_grasp(), "largest", **base)) == pytest.approx(1e3 * 6 / TURN * SIZE / 5)
    assert farthest(question(quiet(), "largest", direction=along)) == 1e3  # nothing else is in play
    for grasp in (small_grasp(), quiet()):  # files with a direction that is zero are refused
        assert farthest(replace(question(grasp, "largest", direction=along), direction=np.zeros(6))) == np.inf


@pytest.mark.parametrize(
    ("magnitude", "command", "largest"), [(2.0, 0.0, 7.0), (-2.0, 0.0, 1.0), (2.0, 100.0, 0.0), (0.0, 0.0, 3.0)]
)
def test_in_play_are_the_whole_load_and_what_drives(magnitude: float, command: float, largest: float) -> None:
    """3 N at the middle, and 2 N along them for each unit of the scalar; or a command of 100 N m that is more."""
    along = np.array([0, 1, 0, *np.cross([1 / 4, -1 / 8, 1 / 8], [0, 1, 0])])
    commands = {next(iter(small_grasp()["preload"])): command}
    q = question(quiet(**commands), "largest", wrench=(3 * along).tolist(), direction=(2 * along).tolist())
    assert in_play(q, magnitude) == pytest.approx(largest or drives(q))
    assert (in_play(q, magnitude) == drives(q)) == (command > 0)


@pytest.mark.parametrize(("ratio", "force"), [(None, 0.0), (1.0, 300.0), (-1e-3, 3e5), (1e6, 3e-4)])
def test_what_a_coupling_drives_is_in_play(ratio: float | None, force: float) -> None:
    """A motor of 300 N on a slide that moves no contact, and a jaw that moves `ratio` times as far."""
    slides = [
        {"name": name, "type": "prismatic", "axis": [1, 0, 0], "origin": [0, 0, 0], "moves": moved}
        for name, moved in (("jaw", [1]), ("slide", []))
    ]
    grasp = quiet() | {"joints": slides, "preload": {"motor": 300.0}}
    coupled = [{"jaw": 1.0, "slide": -ratio}] if ratio else []
    grasp["mechanism"] = {"actuators": [{"name": "motor", "joints": {"slide": 1.0}}], "couplings": coupled}
    along = np.array([0, 1, 0, *np.cross([1 / 4, -1 / 8, 1 / 8], [0, 1, 0])])
    q = question(grasp, "largest", direction=along.tolist())
    assert drives(q) == pytest.approx(force)
    assert farthest(q) == pytest.approx(1e3 * (force or 1.0))


@pytest.mark.parametrize(("kind", "force"), [({}, 1200.0), ({"tendon": True}, 1200.0), ({"backdrivable": True}, 0.0)])
@pytest.mark.parametrize("commands", [{}, {"tie": 1e-6}])
def test_what_an_actuator_that_is_held_passes_on_is_in_play(kind: Any, force: float, commands: Any) -> None:
    """300 N on a slide that moves no contact; while the tie is held, the jaw moves a quarter as far."""
    slides = [
        {"name": name, "type": "prismatic", "axis": [1, 0, 0], "origin": [0, 0, 0], "moves": moved}
        for name, moved in (("jaw", [1]), ("slide", []))
    ]
    tie = {"name": "tie", "joints": {"jaw": 4.0, "slide": -1.0}} | kind
    motor = {"name": "motor", "joints": {"slide": 1.0}}
    grasp = quiet() | {"joints": slides, "preload": {"motor": 300.0} | commands}
    grasp["mechanism"] = {"actuators": [motor, tie], "couplings": []}
    assert drives(question(grasp)) == pytest.approx(force or sum(4 * c for c in commands.values()))


def test_torques_are_passed_on_by_chains_of_actuators() -> None:
    """From the first joint to the second with 2 / 1, from there to the third with 5 / 4; the last stands alone."""
    rows = np.array([[1.0, 2, 0, 0], [0, 4, 5, 0], [0, 0, 0, 7]])
    want = [[1, 2, 2.5, 0], [0.5, 1, 1.25, 0], [0.4, 0.8, 1, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(passed_on(rows), want)
    np.testing.assert_allclose(passed_on(np.stack([rows, np.zeros((3, 4))])), [want, np.eye(4)])
    np.testing.assert_array_equal(passed_on(np.zeros((0, 2))), np.eye(2))


@pytest.mark.parametrize(
    ("couplings", "moved"),
    [
        ([[1, -2, 0], [0, 1, -1]], [[2], [1], [1]]),  # the first moves twice as far as the second, that as the third
        ([[0, 4, 2]], [[1, 0], [0, -0.5], [0, 1]]),
        ([[1, -1, 0], [2, -2, 0]], [[1, 0], [1, 0], [0, 1]]),  # the same twice
        ([[3, 0, 0]], [[0, 0], [1, 0], [0, 1]]),  # a joint that stands
        (np.zeros((0, 3)), np.eye(3)),
        (np.zeros((0, 0)), np.zeros((0, 0))),
    ],
)
def test_how_joints_move_where_couplings_hold(couplings: Any, moved: Any) -> None:
    np.testing.assert_array_equal(ways(np.array(couplings, dtype=float)), moved)


def test_contacts_that_were_pressed_before_are_in_play() -> None:
    start = {"gaps": [-40.0, 5.0], "stops": [0.0] * 3, "slack": [0.0] * 3}
    assert drives(question(quiet(), **{"from": start})) == 40
    assert drives(question(quiet(), **{"from": start | {"gaps": [1.0, 5.0]}})) == 0


# --- how far contacts move with what others drive ---------------------------------------------------------


def chained(backdrivable: bool = False, ratio: float = 4.0) -> GraspData:
    """Slides: a jaw that moves a contact; "tied" `ratio` times as slow by a differential that is held; "idle" with that
    one, a tenth as slow, by a coupling; "free" by none of them."""
    data = quiet()
    data["joints"] = [
        {"name": name, "type": "prismatic", "axis": [1, 0, 0], "origin": [0, 0, 0], "moves": moved, "stop": "lower"}
        for name, moved in (("jaw", [1]), ("tied", []), ("idle", []), ("free", []))
    ]
    tie = {"name": "tie", "joints": {"tied": ratio, "jaw": -1.0}, "backdrivable": backdrivable}
    data["mechanism"] = {"actuators": [tie], "couplings": [{"tied": 1.0, "idle": -10.0}]}
    return read_grasp(data | {"preload": {}}, "g")


def test_how_far_contacts_move_with_what_others_drive() -> None:
    """With idle by 1 tied moves by 10, and the jaw, while the tie is held, by 40; with the tie by 1 the jaw by 1."""
    g = chained()
    assert travel(g, np.eye(4)).tolist() == pytest.approx([1.0, 4.0, 40.0, 1.0])
    assert travel(g, g.R).tolist() == pytest.approx([1.0])
    assert travel(g, np.zeros((0, 4))).tolist() == []
    alone = travel(chained(backdrivable=True), np.eye(4))  # what moves no contact counts by itself, and what it drives
    assert alone.tolist() == pytest.approx([1.0, 1.1, 11.0, 1.0])


def test_how_far_contacts_have_to_go_back() -> None:
    g, none = chained(), np.zeros(1)
    assert left_behind(g) == 0
    for gaps, stops, far in (([0.0, -3.0], [0.0] * 4, 3.0), ([2.0, 0.0], [0, 0.5, 0.25, 0], 10.0)):
        there = g.with_start(StartData(np.array(gaps), np.array(stops), none))
        assert left_behind(there) == pytest.approx(far)
    assert left_behind(g.with_start(StartData(np.zeros(2), np.zeros(4), none))) == 0
    pulled = replace(g, tendon=np.array([True]))
    slack = StartData(np.zeros(2), np.zeros(4), np.array([5.0]))
    assert left_behind(pulled.with_start(slack)) == pytest.approx(5.0)


def test_ways_of_joints_are_worked_out_once() -> None:
    A = np.array([[1.0, -2.0, 0.0]])
    assert ways(A) is ways(A.copy())
    assert ways(A).tolist() == [[2.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    assert ways(np.array([[1.0], [-2.0]]).reshape(2, 1)).shape == (1, 0)
    with pytest.raises(ValueError, match="read-only"):
        ways(A)[0, 0] = 1.0
