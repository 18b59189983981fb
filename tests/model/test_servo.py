"""What position servos command: signs by hand, and the grasp's own convention."""

from __future__ import annotations

import numpy as np
import pytest

from handfast import InputError, contact_grasp, load_body, load_configuration, load_hand
from handfast.geometry.contacts import grasp_of
from handfast.model.grasp import Contact
from handfast.model.hand import Hand
from handfast.model.hand.hand import Joint, Link
from handfast.model.mechanism import Mechanism
from handfast.model.servo import servo_commands

Z = np.array([0.0, 0, 1])


def two_fingers(R: np.ndarray, actuators: tuple[str, ...], tendon: tuple[bool, ...] | None = None) -> Hand:
    """Two hinges; a closes the hand by growing, b by falling."""
    joints = [Joint(name, "revolute", Z, np.zeros(3), -2.0, 2.0) for name in "ab"]
    links = (Link("palm", -1, np.eye(4)), *(Link(f"tip_{j}", 0, np.eye(4), (k,)) for k, j in enumerate("ab")))
    mechanism = Mechanism(actuators, R, np.zeros((0, 2)), tendon or (False,) * len(actuators))
    return Hand("two", links, tuple(joints), mechanism, (), np.array([1, -1]))


DIRECT = two_fingers(np.eye(2), ("a", "b"))


def test_torque_is_gain_times_target_less_value_and_positive_closes() -> None:
    """At (0.5, -0.5) with targets 0.1 rad further in: 0.2 N m each, which close both; further out they open."""
    q = np.array([0.5, -0.5])
    assert servo_commands(DIRECT, q, {"a": 0.6, "b": -0.6}, 2.0) == pytest.approx({"a": 0.2, "b": 0.2})
    assert servo_commands(DIRECT, q, {"a": 0.4, "b": -0.4}, 2.0) == pytest.approx({"a": -0.2, "b": -0.2})
    by_name = servo_commands(DIRECT, {"a": 0.5, "b": -0.5}, {"b": -0.6}, {"a": 1.0, "b": 3.0})
    assert by_name == pytest.approx({"b": 0.3})
    assert servo_commands(DIRECT, q, {"a": 0.6, "b": -0.6}, 2.0, largest={"a": 0.15})["a"] == pytest.approx(0.15)
    assert servo_commands(DIRECT, q, {"a": 0.5}, 2.0) == {"a": 0.0}


def test_the_joint_torques_of_the_grasp_are_those_of_the_servos() -> None:
    """R^T f of the grasp, turned back into the hand's senses, is kp (target - q) of each joint."""
    rng = np.random.default_rng(0)
    q, target, kp = rng.uniform(-1, 1, 2), rng.uniform(-1, 1, 2), 1.7
    for R in (np.eye(2), -np.eye(2)):
        hand = two_fingers(R, ("m", "n"))
        commands = servo_commands(hand, q, dict(zip("ab", target, strict=True)), kp)
        contacts = [Contact(np.array([0.1, 0, 0]), -Z, 0.5, f"tip_{j}") for j in "ab"]
        grasp = grasp_of(hand, q, contacts, np.eye(4), preload=commands)
        torques = grasp.mechanism.R.T @ grasp.command * np.sign(hand.closing)
        assert torques == pytest.approx(kp * (target - q))


def test_a_gear_counts_in_the_actuators_displacement() -> None:
    """A motor that turns thrice as far as its joint: f = kp 3 (target - q), torque 3 f."""
    geared = two_fingers(np.array([[3.0, 0], [0, -1.0]]), ("m", "n"))
    q = np.array([0.5, -0.5])
    assert servo_commands(geared, q, {"a": 0.6}, 2.0) == pytest.approx({"m": 2 * 3 * 0.1})
    assert servo_commands(geared, q, {"m": 1.8}, 2.0) == pytest.approx({"m": 2 * (1.8 - 1.5)})


def test_a_real_hand_squeezes() -> None:
    placed = load_configuration("fig9")
    hand, q = placed.applied(load_hand("barrett-bh8-280"))
    targets = {f"finger_{k}_prox": hand.values(q)[f"finger_{k}_prox"] + 0.05 for k in (1, 2, 3)}
    commands = servo_commands(hand, q, targets, 2.0)
    assert commands == pytest.approx(dict.fromkeys(targets, 0.1))
    assert contact_grasp(hand, q, load_body("flask"), placed.pose, preload=commands).preload == pytest.approx(commands)


@pytest.mark.parametrize(
    "given, says",
    [
        ({"targets": {"c": 1.0}}, "targets: unknown actuator 'c'; known: a, b"),
        ({"targets": {"a": np.nan}}, "targets.a: is nan"),
        ({"gains": {"b": 1.0}}, "gains.a: is missing"),
        ({"gains": 0}, "gains: is 0; a positive number"),
        ({"gains": {"a": -1.0}}, "gains.a: is -1"),
        ({"largest": {"a": 0.0}}, "largest.a: is 0"),
        ({"q": [0.0]}, "q: needs 2 finite joint values"),
        ({"q": {"x": 1.0}}, "unknown joint 'x'"),
        ({"mechanism": "both"}, "mechanism: is 'both'"),
    ],
)
def test_refusals(given: dict[str, object], says: str) -> None:
    asked = {"q": np.zeros(2), "targets": {"a": 0.1}, "gains": 1.0} | given
    with pytest.raises(InputError, match=says):
        servo_commands(DIRECT, **asked)  # type: ignore[arg-type]


def test_tendons_pull_and_joints_that_share_a_motor_have_no_target_of_their_own() -> None:
    both = two_fingers(np.array([[1.0, -1.0]]), ("rope",), (True,))
    assert servo_commands(both, np.zeros(2), {"rope": 0.2}, 5.0) == pytest.approx({"rope": 1.0})
    with pytest.raises(InputError, match=r"targets\.rope: asks its tendon to push with 1 N"):
        servo_commands(both, np.zeros(2), {"rope": -0.2}, 5.0)
    with pytest.raises(InputError, match="'a' is a joint that no actuator drives alone"):
        servo_commands(both, np.zeros(2), {"a": 0.2}, 5.0)
    named = two_fingers(np.eye(2), ("m", "n"))
    with pytest.raises(InputError, match="'a' is the actuator 'm', which has a value"):
        servo_commands(named, np.zeros(2), {"m": 0.2, "a": 0.2}, 5.0)
