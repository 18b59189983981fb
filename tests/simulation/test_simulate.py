"""Simulated grasps whose thresholds are known by hand: a slope, a pinch, a coupling, a tendon."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.simulation_floor import Damped, Rubbing, across, block, on_slope, pinch, pushed_pinch
from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.readers.grasp_file import load_grasp
from handfast.simulation.result import EVIDENT, LOST_DISTANCE, REST_RATE, SLIP, Ending, judge
from handfast.simulation.simulate import force_unit, simulate
from handfast.simulation.stepper import Stepper
from handfast.simulation.twin import DRAG_TIME, TWIN_STIFFNESS
from tests.support.soft_fingers import MU, SQUEEZE, TORSION, coin

QUICK = {"ramp": 1.0}


def ended(grasp: Grasp, wrench: object, **options: object) -> Ending:
    return simulate(grasp, wrench, **(QUICK | options)).ending  # type: ignore[arg-type]


@pytest.mark.parametrize("mu", [0.2, 1.0])
def test_a_block_slips_where_the_slope_is_steeper_than_its_friction(mu: float) -> None:
    """tan alpha = mu; nothing is preloaded."""
    assert ended(block(mu), on_slope(mu, 0.95), loading="together") is Ending.HOLDS
    assert ended(block(mu), on_slope(mu, 1.05), loading="together") is Ending.SLIPS


@pytest.mark.parametrize("share", [0.9, 1.1])
@pytest.mark.parametrize("torque", [0.0, 0.8, 1.0])
def test_a_coin_turns_where_the_ellipsoid_of_soft_fingers_ends(torque: float, share: float) -> None:
    """A torque about the line through both contacts, where no contact moves, and a force across, on the ellipse."""
    force = np.sqrt(1 - torque**2)
    load = share * np.array([2 * MU * SQUEEZE * force, 0, 0, 0, 0, 2 * TORSION * SQUEEZE * torque])
    assert ended(coin(half=0.02), load) is (Ending.HOLDS if share < 1 else Ending.SLIPS)


def test_a_pinch_carries_twice_mu_times_its_command_across() -> None:
    """2 mu f: 0.8 N for mu = 0.4, f = 1 N, whatever the unit of force; twice the command carries twice."""
    found = simulate(pinch(0.4), 1.25 * across(0.4, 1.0), ramp=4.0)
    assert found.ending is Ending.SLIPS
    assert found.onset is not None
    assert 1.25 * found.onset == pytest.approx(1.0, abs=0.04)
    assert ended(pinch(0.4, 200.0), 200 * across(0.4, 0.95)) is Ending.HOLDS
    assert ended(pinch(0.4, 200.0), 200 * across(0.4, 1.06)) is Ending.SLIPS


def test_forces_balance_the_load_and_belong_to_their_contacts() -> None:
    """Pushed by 3 N onto the driven finger, which is commanded to 1 N and does not turn back; the other lets go."""
    found = simulate(pinch(0.5), [3, 0, 0], **QUICK)
    assert found.ending is Ending.HOLDS
    assert found.touching == (0,)
    assert found.forces[-1, :, 0] == pytest.approx([3, 0], abs=1e-3)
    carried = sum(c.frame @ f for c, f in zip(found.grasp.contacts, found.forces[-1], strict=True))
    assert carried == pytest.approx([-3, 0, 0], abs=1e-3)
    assert abs(found.joints[-1, 0] - found.joints[found.load == 0][-1, 0]) < 1e-9


def test_pulled_off_its_finger_an_object_has_the_command_and_no_more() -> None:
    """1 N of command pushes; 0.5 N more from the load: the fixed finger answers 1.5 N, the driven one 1 N."""
    found = simulate(pinch(0.5), [-0.5, 0, 0], **QUICK)
    assert found.forces[-1, :, 0] == pytest.approx([1.0, 1.5], abs=2e-3)


def test_every_contact_is_as_stiff_as_said() -> None:
    """The force unit presses a contact in by 1 / STIFFNESS grasp sizes."""
    found = simulate(pinch(0.5), [3, 0, 0], **QUICK)
    # from touching at 0 to 3 N, the unit, on the driven side alone
    expected = found.grasp.size / TWIN_STIFFNESS
    assert found.shift[-1, 0] + found.joints[-1, 0] == pytest.approx(expected, rel=0.02)


def test_a_moving_limit_neither_opens_nor_gains_squeeze() -> None:
    """Beside it the ways that were not taken: a damper creeps open, dry friction squeezes with what it can hold."""

    def squeezed(kind: type[Stepper]) -> tuple[float, float]:
        stepper = pushed_pinch(kind)
        stepper.run(1500)
        squeeze = float(stepper.moment().forces[0, 0])
        stepper.run(300, 1 / 300)
        at = float(stepper.moment().joints[0])
        stepper.run(1000)
        return squeeze, at - float(stepper.moment().joints[0])

    assert squeezed(Stepper) == pytest.approx((1.0, 0.0), abs=1e-3)
    assert squeezed(Damped)[1] > 1e-3
    assert squeezed(Rubbing)[0] > 5


def finger(command: float, ratio: float = 1.0, *, tendon: bool = False) -> Grasp:
    """A pinch whose driven contact hangs on two slides; the second goes `ratio` times as far as the first."""
    grasp = pinch(0.5)
    joints = [replace(grasp.joints[0], name="first"), replace(grasp.joints[0], name="second")]
    mech = Mechanism(("motor",), np.array([[1.0, 0.0]]), np.array([[-ratio, 1.0]]), (tendon,))
    return Grasp(grasp.contacts, joints, mech, {"motor": command} if command else None, "finger")


def test_a_coupling_shares_the_motors_force() -> None:
    """The contact moves 1 + 2 times as far as the motor: it presses with a third of the command."""
    found = simulate(finger(3.0, 2.0), [0, 0, -1e-3], **QUICK)
    assert found.forces[-1, 0, 0] == pytest.approx(1.0, abs=5e-3)
    assert found.joints[-1, 1] == pytest.approx(2 * found.joints[-1, 0], rel=1e-2)


def slid(**laws: object) -> Grasp:
    """The pinch of 1 N and friction 0.5 whose slide has these besides; motor=True makes its motor backdrivable."""
    grasp = pinch(0.5)
    motor = bool(laws.pop("motor", False))
    mechanism = replace(grasp.mechanism, backdrivable=(motor,))
    return Grasp(grasp.contacts, [replace(grasp.joints[0], **laws)], mechanism, grasp.preload, "slid")  # type: ignore[arg-type]


def test_a_joints_friction_takes_of_the_command_and_a_given_force_adds_to_it() -> None:
    # the engine's dry friction creeps, and the gearing keeps what the finger closes by that: 1 % here
    for grasp, squeeze in ((slid(friction=0.3), 0.7), (slid(torque=0.5), 1.5)):
        found = simulate(grasp, [0, 0, -0.95 * squeeze], **QUICK)
        assert found.ending is Ending.HOLDS
        assert found.forces[-1, :, 0] == pytest.approx([squeeze, squeeze], abs=0.015)
        assert ended(grasp, [0, 0, -1.07 * squeeze]) is Ending.SLIPS


def test_a_spring_that_presses_alone_is_the_largest_force() -> None:
    """1e6 N of it carry 1e6 N across, however small the command beside it; a locked joint's presses nothing."""
    grasp = slid(torque=1e6)
    assert force_unit(grasp, np.zeros(6)) == pytest.approx(1e6)
    assert ended(grasp, [0, 0, -0.9e6]) is Ending.HOLDS
    assert ended(grasp, [0, 0, -1]) is Ending.UNDECIDED  # the engine could not tell it from none
    assert force_unit(grasp.with_preload(None), np.r_[0, 0, 1.0, 0, 0, 0]) == 1.0


def test_a_joints_friction_grows_with_the_command_it_takes_from() -> None:
    """With all of it from the beginning the finger would not touch before the load pulls: the object would jump."""
    assert ended(slid(friction=0.6), [0, 0, -0.9 * 0.4], loading="together", ramp=4.0) is Ending.HOLDS
    assert ended(slid(friction=0.6), [0, 0, -1.1 * 0.4], loading="together", ramp=4.0) is Ending.SLIPS


def test_a_joint_at_its_stop_does_not_move_that_way() -> None:
    """At its upper stop the finger presses nothing; at the lower one alone it does, and is held from behind."""
    assert ended(slid(stop="upper"), [0, 0, -0.5]) is Ending.SLIPS
    assert ended(slid(stop="lower"), [0, 0, -0.9]) is Ending.HOLDS
    assert ended(slid(stop="both"), [0, 0, -0.5]) is Ending.SLIPS


def test_a_backdrivable_motor_gives_way_to_more_than_its_command() -> None:
    """Pushed onto the driven finger, whose command is 1 N: a stop behind it holds what the motor does not."""
    assert ended(slid(motor=True), [0.9, 0, 0]) is Ending.HOLDS
    assert ended(slid(motor=True), [1.1, 0, 0]) is Ending.SLIPS
    assert ended(slid(motor=True, stop="lower"), [1.1, 0, 0]) is Ending.HOLDS
    assert ended(slid(), [1.1, 0, 0]) is Ending.HOLDS


def test_a_negative_command_is_the_mirror_image() -> None:
    grasp = pinch(0.4)
    back = replace(grasp.joints[0], axis=-grasp.joints[0].axis)
    mirrored = Grasp(grasp.contacts, [back], Mechanism.direct(["slide"]), {"slide": -1.0})
    assert ended(mirrored, across(0.4, 0.95)) is Ending.HOLDS
    assert ended(mirrored, across(0.4, 1.06)) is Ending.SLIPS


def test_a_tendon_without_command_pulls_but_does_not_push() -> None:
    """Without command the finger is held against opening; nothing presses it against the object."""
    idle = finger(0.0, tendon=True)
    assert ended(idle, [1, 0, 0]) is Ending.HOLDS
    assert ended(idle, [0, 0, -1]) is Ending.SLIPS


def test_what_nothing_holds_drifts_as_fast_as_its_drag_lets_it() -> None:
    """Unit force on unit mass that stops within DRAG_TIME: as many grasp sizes a second."""
    found = simulate(block(0.5), [0, 0, 1], **QUICK)
    assert found.ending is Ending.SLIPS
    assert found.touching == ()
    assert found.rate == pytest.approx(DRAG_TIME * found.grasp.size, rel=1e-3)


def test_contacts_that_share_joints_in_no_tree_get_copies() -> None:
    """Joints a: contacts 0 and 1, b: contacts 1 and 2; the copies of one joint move together."""
    contacts = [Contact(np.array([x, 0.0, 0]), np.array([0, 0, -1.0]), 0.5) for x in (-0.05, 0.0, 0.05)]
    contacts += [
        Contact(np.array([x, y, -0.02]), np.array([0, 0, 1.0]), 0.5) for x, y in ((-0.05, 0), (0.05, 0), (0, 0.05))
    ]
    down = np.array([0.0, 0, -1])
    joints = [GraspJoint(n, down, np.zeros(3), moves, "prismatic") for n, moves in (("a", (0, 1)), ("b", (1, 2)))]
    grasp = Grasp(contacts, joints, None, {"a": 1.0, "b": 1.0})
    found = simulate(grasp, [0, 0, -0.1], **QUICK)
    assert found.ending is Ending.HOLDS
    # joint a carries contacts 0 and 1, b carries 1 and 2: each pair sums to its command
    n = found.forces[-1, :, 0]
    assert (n[0] + n[1], n[1] + n[2]) == pytest.approx((1.0, 1.0), abs=0.02)


@pytest.mark.parametrize("name", ["barrett-mallet"])
def test_what_rests_is_an_equilibrium_of_the_grasps_own_matrices(name: str) -> None:
    """G c + w = 0 with the contact forces in the grasp's frames; no actuator carries less than its command."""
    grasp = load_grasp(name)
    w = np.array([0.5, 0.3, -0.4, 0.01, 0, 0])
    found = simulate(grasp, w, ramp=2.0)
    c = found.forces[-1].ravel()
    assert grasp.G @ c == pytest.approx(-w, abs=2e-3 * np.abs(c).max())
    mech = grasp.mechanism
    carried = np.linalg.lstsq(np.vstack([mech.R, mech.A]).T, grasp.J.T @ c)[0][: mech.a]
    assert (carried[grasp.command > 0] > 0.99 * grasp.command[grasp.command > 0]).all()
    assert (np.linalg.norm(found.forces[-1][:, 1:], axis=1) <= grasp.mu * found.forces[-1][:, 0] + 1e-6).all()


@pytest.mark.parametrize(
    ("name", "direction", "most"),
    [
        ("fig1", (0, 1, 0), 2.225),
        ("fig11", (0, 1, 0), 0.9836),
        ("fig9", (0, -1, 0), 1.469),
        ("barrett-egg", (0, 0, 1), 1.770),
        ("barrett-ball", (0, 0, 1), 5.079),
    ],
)
def test_bundled_grasps_slip_within_five_per_cent_of_their_certified_maxima(
    name: str, direction: tuple[float, ...], most: float
) -> None:
    """Maxima as `handfast max` certifies them; nothing is set for any of them."""
    found = simulate(load_grasp(name), 1.1 * most * np.array(direction), ramp=3.0)
    assert found.ending is Ending.SLIPS
    assert found.onset is not None
    assert 1.1 * found.onset == pytest.approx(1.0, abs=0.05)


def test_the_same_question_has_the_same_history() -> None:
    a, b = (simulate(pinch(0.5), [0, 0, -0.5], ramp=0.5) for _ in range(2))
    assert np.array_equal(a.forces, b.forces)
    assert np.array_equal(a.motion, b.motion)


def test_a_load_too_small_to_be_seen_is_not_said_to_be_held() -> None:
    """Without friction nothing resists 0.01 N across; beside a command of 1000 N its drift is below what is rest."""
    for force in (0.01, 1e-300):  # the square of the second is none
        found = simulate(pinch(0.0, 1000.0), [0, 0, -force], ramp=0.5)
        assert found.ending is Ending.UNDECIDED
        assert "below 0.01 % of the largest force" in found.why


def test_endings() -> None:
    quiet = {"fastest": 0.0, "moved": 0.0, "yielded": 1e-5, "broken": False}
    assert judge(REST_RATE / 2, **quiet) is Ending.HOLDS
    assert judge((REST_RATE + SLIP) / 2, **quiet) is Ending.UNDECIDED
    assert judge((REST_RATE + SLIP) / 2, **quiet, creeping=True) is Ending.HOLDS
    assert judge(2 * SLIP, **quiet, creeping=True) is Ending.SLIPS
    assert judge(2 * SLIP, **quiet) is Ending.SLIPS
    assert judge(REST_RATE / 2, **quiet | {"fastest": 2 * EVIDENT, "moved": 1e-3}) is Ending.SETTLES
    assert judge(REST_RATE / 2, **quiet | {"fastest": 2 * EVIDENT, "moved": 2e-5}) is Ending.HOLDS
    assert judge(REST_RATE / 2, **quiet, faint=True) is Ending.UNDECIDED
    assert judge(0.0, **quiet | {"moved": 2 * LOST_DISTANCE}) is Ending.SLIPS
    assert judge(0.0, **quiet | {"broken": True}) is Ending.ILL_POSED


def test_the_engines_own_creep_is_told_from_a_slip() -> None:
    """The grasp creeps faster than what rests in the pinch; ten times softer friction creeps ten times as fast."""
    found = simulate(load_grasp("barrett-mallet"), [20.0, 0, 0], ramp=2.0)
    assert found.rate / found.grasp.size > REST_RATE
    assert found.ending in (Ending.HOLDS, Ending.SETTLES)


def test_contacts_at_their_cones_do_not_walk_under_a_hard_load() -> None:
    """A solver that stopped before the last digit let this grasp slip at 0.8 of its maximum, 1.4735 N."""
    assert ended(load_grasp("barrett-egg"), [0, 1.326, 0], ramp=3.0) is Ending.HOLDS


def test_a_simulation_that_begins_at_an_equilibrium_stays_there() -> None:
    """The pinch pushed across with 0.5 N: 1 N at both contacts, from motions of 1 N of joint and object."""
    at = np.array([-0.5, 0, 0, 0, 0, 0]), np.array([1.5])
    grasp = pinch(0.5)
    found = simulate(grasp, [-0.5, 0, 0], start=(np.array([-1.5, 0, 0, 0, 0, 0]), np.array([2.5])))
    assert found.ending is Ending.HOLDS
    assert found.forces[-1, :, 0] == pytest.approx([1.0, 1.5], abs=2e-3)
    assert found.motion[-1] == pytest.approx(found.motion[0], rel=1e-2)
    elsewhere = simulate(grasp, [-0.5, 0, 0], start=at)
    assert np.ptp(elsewhere.motion) > 10 * np.ptp(found.motion)


def test_a_simulation_that_breaks_down_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(self: Stepper, steps: int, load_step: float = 0.0) -> None:
        raise FloatingPointError("the engine's numbers have run away")

    monkeypatch.setattr(Stepper, "run", broken)
    found = simulate(pinch(0.5), [0, 0, -0.1])
    assert found.ending is Ending.ILL_POSED
    assert found.why
    assert found.to_json()["ending"] == "ill-posed"


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        ({"wrench": [1, 2]}, "wrench: has 2 numbers; six are needed"),
        ({"wrench": [0, 0, 1e155]}, "wrench: has 1e.155; numbers up to 1e.100 are possible"),
        ({"wrench": [0, 0, 1], "ramp": 0}, "ramp: is 0; a number above 0"),
        ({"wrench": [0, 0, 1], "ramp": 1e9}, "ramp: is 1e.09; at most 10000 s"),
        ({"wrench": [0, 0, 1], "loading": "both"}, "'preload-first' or 'together'"),
    ],
)
def test_bad_questions(options: dict[str, object], fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        simulate(pinch(0.5), **options)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="nothing would happen"):
        force_unit(pinch(0.5).with_preload(None), np.zeros(6))


def test_the_unit_of_force_does_not_know_pulleys() -> None:
    """A motor on a pulley of 10 mm pulls a hundred times as hard for the same torque."""
    grasp = pinch(0.5)
    mech = grasp.mechanism
    pulley = Mechanism(mech.actuators, 0.01 * mech.R, mech.A, mech.tendon)
    same = Grasp(grasp.contacts, grasp.joints, pulley, 100 * grasp.command)
    assert force_unit(same, np.zeros(6)) == pytest.approx(force_unit(grasp, np.zeros(6)))
