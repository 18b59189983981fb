"""Equivalents of joints' laws: by hand, as the search has them, and against the laws themselves."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from flint import fmpq
from scipy.optimize import linprog

from benchmarks.grasps import random_case
from handfast import check
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.proofs.certificate import Certificate
from handfast.proofs.checker import verify
from handfast.proofs.equations import RightSide, equations_of
from handfast.proofs.existence import prove
from handfast.proofs.fields import Array, BadFile, rational, rationals
from handfast.proofs.grasp import GraspData, StartData, read_grasp
from handfast.proofs.joint_laws import Equivalent, equivalent_of
from handfast.proofs.kinds import Row
from handfast.proofs.question import Question, read_question
from handfast.proofs.rows import LeafRows, row_values
from handfast.proofs.states import Problem, State
from handfast.readers.grasp_file import from_dict, to_dict
from handfast.stability.problem import equivalent_grasp
from tests.support.law_grasps import curled, jaw, random_law_grasp
from tests.support.refused import refused

INF = np.inf
Actuators = Mapping[str, tuple[list[float], Mapping[str, bool]]]
MOTOR: Actuators = {"motor": ([1.0], {})}


def grasp(
    laws: list[dict[str, Any]],
    actuators: Actuators | None = None,
    preload: Mapping[str, float] | None = None,
    couplings: list[list[float]] | None = None,
) -> GraspData:
    """A contact and one revolute joint for each of the laws; actuators: name -> weights of the joints, flags."""
    return read_grasp(grasp_file(laws, actuators, preload, couplings), "g")


def grasp_file(
    laws: list[dict[str, Any]],
    actuators: Actuators | None = None,
    preload: Mapping[str, float] | None = None,
    couplings: list[list[float]] | None = None,
) -> dict[str, Any]:
    """The same as it stands in a file."""
    names = [f"j{k}" for k in range(len(laws))]
    joints = [
        {"name": name, "axis": [0, 0, 1], "origin": [0, 1, 0], "moves": [0]} | law
        for name, law in zip(names, laws, strict=True)
    ]
    rows = [
        {"name": name, "joints": dict(zip(names, row, strict=True))} | dict(flags)
        for name, (row, flags) in (actuators or {}).items()
    ]
    tied = [dict(zip(names, row, strict=True)) for row in couplings or []]
    return {
        "schema": "handfast/grasp/1",
        "contacts": [{"position": [0, 0, 0], "normal": [1, 0, 0], "friction": 0.5}],
        "joints": joints,
        "mechanism": {"actuators": rows, "couplings": tied},
        "preload": dict(preload or {}),
    }


def parts(e: Equivalent) -> tuple[int, list[Any], list[Any], list[Any], list[Any], list[Any]]:
    """Sliders, R, A, tendon, command, torque."""
    return (e.sliders, *(x.tolist() for x in (e.R, e.A, e.tendon, e.command, e.torque)))


# --- by hand, one law after the other


def test_without_laws_it_is_the_grasp() -> None:
    g = grasp([{}, {}], {"a": ([1, 0], {}), "t": ([0, 2], {"tendon": True})}, {"a": -0.5}, [[1, -1]])
    e = equivalent_of(g, None, ())
    assert parts(e) == (0, [[1, 0], [0, 2]], [[1, -1]], [False, True], [-0.5, 0], [0, 0])
    assert (e.kept.tolist(), e.drives, e.held.tolist()) == ([0, 1], False, [False, False])
    sought = equivalent_of(g, np.array([False, True]), ())
    assert sought.command.tolist() == [0, 0]
    assert equivalent_of(g, np.array([True, False]), ()).command.tolist() == [-0.5, 0]


def test_a_given_torque() -> None:
    e = equivalent_of(grasp([{"torque": -0.25}]), None, ())
    assert parts(e) == (0, [], [], [], [], [-0.25])
    assert (e.drives, e.held.tolist()) == (True, [False])
    assert equivalent_of(grasp([{"torque": -0.25}, {}]), None, ()).drives  # of one of two joints


@pytest.mark.parametrize(("stop", "row"), [("lower", 1.0), ("upper", -1.0)])
def test_a_stop_is_a_tendon_away_from_it(stop: str, row: float) -> None:
    e = equivalent_of(grasp([{}, {"stop": stop}]), None, ())
    assert parts(e) == (0, [[0, row]], [], [True], [0], [0, 0])
    assert (e.drives, e.held.tolist()) == (False, [False, False])


def test_a_joint_at_both_stops_is_tied() -> None:
    e = equivalent_of(grasp([{}, {"stop": "both", "friction": 0.5}, {}], couplings=[[1, 0, 2]]), None, ())
    assert parts(e) == (0, [], [[1, 0, 2], [0, 1, 0]], [], [], [0, 0, 0])
    assert e.held.tolist() == [False, True, False]
    e = equivalent_of(grasp([{"stop": "both"}, {}, {"stop": "both"}], couplings=[[1, 0, 2]]), None, ())
    assert e.A.tolist() == [[1, 0, 2], [1, 0, 0], [0, 0, 1]]


@pytest.mark.parametrize(("stop", "row"), [("lower", 1.0), ("upper", -1.0)])
def test_friction_beside_a_stop_is_a_given_torque(stop: str, row: float) -> None:
    """At the lower stop q >= 0: rho = -F where it moves, and the stop carries upwards from -F on."""
    e = equivalent_of(grasp([{"stop": stop, "friction": 0.5}]), None, ())
    assert parts(e) == (0, [[row]], [], [True], [0], [-row * 0.5])
    assert not e.drives  # friction only takes


@pytest.mark.parametrize(
    ("weight", "command", "sense"), [(1.0, 2.0, 1.0), (1.0, -2.0, -1.0), (-3.0, 2.0, -1.0), (-3.0, -2.0, 1.0)]
)
def test_friction_behind_a_commanded_motor_is_a_given_torque(weight: float, command: float, sense: float) -> None:
    e = equivalent_of(grasp([{"friction": 0.5}], {"m": ([weight], {})}, {"m": command}), None, ())
    assert parts(e) == (0, [[weight]], [], [False], [command], [-sense * 0.5])
    assert e.held.tolist() == [False]


def test_friction_behind_motors_of_two_joints_is_given_to_each() -> None:
    motors: Actuators = {"m": ([1, 0], {}), "n": ([0, -1], {})}
    e = equivalent_of(grasp([{"friction": 0.5}, {"friction": 0.25}], motors, {"m": 1, "n": 1}), None, ())
    assert (e.sliders, e.torque.tolist()) == (0, [-0.5, 0.25])


@pytest.mark.parametrize("weight", [1.0, -2.0])
def test_friction_behind_a_tendon_is_a_given_torque(weight: float) -> None:
    e = equivalent_of(grasp([{"friction": 0.5}], {"t": ([weight], {"tendon": True})}), None, ())
    assert parts(e) == (0, [[weight]], [], [True], [0], [-np.sign(weight) * 0.5])


def test_friction_of_a_locked_joint_does_nothing() -> None:
    e = equivalent_of(grasp([{"friction": 0.5, "stop": "upper"}], MOTOR), None, ())
    assert parts(e) == (0, [[1]], [], [False], [0], [0])
    assert e.held.tolist() == [True]


# q + F rows u, u - q: f1 + f2 = 2 F, q carries F - f2
SLIDER = (1, [[0, 1], [-1, 1]], [], [True, True], [0, 0], [0.5, -1.0])


def test_friction_of_a_free_joint_has_a_slider() -> None:
    e = equivalent_of(grasp([{"friction": 0.5}]), None, ())
    assert parts(e) == SLIDER
    assert (e.kept.tolist(), e.drives, e.held.tolist()) == ([], False, [False])


@pytest.mark.parametrize("command", [0.0, 2.0, -2.0])
def test_an_actuator_with_a_limit_is_left_out_of_the_mergers(command: float) -> None:
    """Locked or commanded: a row of its own beside the slider."""
    g = grasp([{"friction": 0.5}], MOTOR, {"motor": command} if command else {})
    e = equivalent_of(g, None, ("other", "motor"))
    assert parts(e) == (
        1,
        [[1, 0], [0, 1], [-1, 1]],
        [],
        [False, True, True],
        [command, 0, 0],
        [0.5, -1.0],
    )
    assert e.held.tolist() == [False]
    assert equivalent_of(g, None, ("other",)).sliders == 0
    tendon = grasp([{"friction": 0.5}], {"motor": ([1.0], {"tendon": True})})
    assert equivalent_of(tendon, None, ("motor",)).sliders == 1


def test_a_motor_over_two_joints_leaves_both_senses() -> None:
    g = grasp([{"friction": 0.5}, {}], {"t": ([1, 1], {"tendon": True})}, {"t": 2})
    e = equivalent_of(g, None, ())
    assert parts(e) == (
        1,
        [[1, 1, 0], [0, 0, 1], [-1, 0, 1]],
        [],
        [True, True, True],
        [2, 0, 0],
        [0.5, 0, -1.0],
    )


def test_a_motor_over_a_joint_and_one_that_is_held_leaves_one_sense() -> None:
    g = grasp([{"friction": 0.5}, {"stop": "both"}], {"t": ([-1, 1], {"tendon": True})}, {"t": 2})
    e = equivalent_of(g, None, ())
    assert parts(e) == (0, [[-1, 1]], [[0, 1]], [True], [2], [0.5, 0])
    assert e.held.tolist() == [False, True]


def test_what_is_tied_to_held_joints_is_held() -> None:
    """j1 is at both stops, (0, 1, -2) holds j2, and with it (-3, 0, 4) j0: in this order of rows, two rounds."""
    laws = [{"friction": 0.5, "stop": "lower"}, {"stop": "both"}, {"friction": 0.25}, {"friction": 0.125}]
    g = grasp(laws, couplings=[[-3, 0, 4, 0], [0, 1, -2, 0]])
    e = equivalent_of(g, None, ())
    assert e.held.tolist() == [True, True, True, False]
    assert e.sliders == 1
    assert e.A[:, :4].tolist() == [[-3, 0, 4, 0], [0, 1, -2, 0], [0, 1, 0, 0]]
    assert not e.A[:, 4].any()
    assert e.R.tolist() == [[0, 0, 0, 0, 1], [0, 0, 0, -1, 1]]  # no stop of what is held
    assert e.torque.tolist() == [0, 0, 0, 0.125, -0.25]


def test_joints_tied_by_a_locked_motor_are_held_or_tied() -> None:
    """A locked motor over two joints ties them, as a coupling does: q1 = -q0 / 2."""
    g = grasp([{"friction": 0.5}, {"friction": 0.25}], {"m": ([1, 2], {})})
    e = equivalent_of(g, None, ())
    # along q0: weights F sign(rate) over 1, the power of two above 0.75
    assert e.sliders == 1
    assert e.R.tolist() == [[1, 2, 0], [0, 0, 1], [-0.5, 0.25, 1]]
    assert e.torque.tolist() == [0.5, -0.25, -2]
    both = equivalent_of(g, None, ("m",))  # with a limit it ties nothing: each joint has its own
    assert both.sliders == 2
    assert both.torque.tolist() == [0.5, 0.25, -1.0, -0.5]
    assert both.R.tolist() == [[1, 2, 0, 0], [0, 0, 1, 0], [-1, 0, 1, 0], [0, 0, 0, 1], [0, -1, 0, 1]]


@pytest.mark.parametrize(("row", "sign"), [([1.0, -1 / 3], 1.0), ([1.0, 1 / 3], -1.0)])
def test_tied_joints_have_one_friction(row: list[float], sign: float) -> None:
    """q0 - q1 / 3 = 0: q1 = 3 q0. Both rub: one slider for (0.3 q0 + 0.1 q1) / 0.5; against the tie, with -q1."""
    g = grasp([{"friction": 0.3}, {"friction": 0.1}], couplings=[row])
    e = equivalent_of(g, None, ())
    assert e.sliders == 1
    assert e.A.tolist() == [[*row, 0]]
    np.testing.assert_allclose(e.R, [[0, 0, 1], [-0.6, -sign * 0.2, 1]], rtol=1e-14)
    np.testing.assert_allclose(e.torque, [0.3, sign * 0.1, -1.0], rtol=1e-14)
    assert e.held.tolist() == [False, False]


def test_of_tied_joints_those_that_rub_count() -> None:
    g = grasp([{}, {"friction": 0.5}, {"friction": 0.25}], couplings=[[1, -2, 0], [0, 1, 1]])
    e = equivalent_of(g, None, ())
    # q1 = q0 / 2, q2 = -q1: along q0
    assert e.R.tolist() == [[0, 0, 0, 1], [0, -0.5, 0.25, 1]]
    assert e.torque.tolist() == [0, 0.5, -0.25, -2]


@pytest.mark.parametrize("stop", ["lower", "upper"])
@pytest.mark.parametrize("ratio", [2.0, -2.0])
@pytest.mark.parametrize("at", [0, 1])
def test_of_tied_joints_a_stop_of_one_decides_for_all(stop: str, ratio: float, at: int) -> None:
    """q0 = ratio q1, or q1 = q0 / ratio, and a stop of one of both: -s F on each along its own motion."""
    laws: list[dict[str, Any]] = [{"friction": 0.5}, {"friction": 0.25}]
    laws[at]["stop"] = stop
    e = equivalent_of(grasp(laws, couplings=[[1, -ratio]]), None, ())
    sense = 1.0 if stop == "lower" else -1.0  # of the joint at the stop
    other = sense * np.sign(ratio)
    senses = [sense, other] if at == 0 else [other, sense]
    assert e.sliders == 0
    assert e.torque.tolist() == [-0.5 * senses[0], -0.25 * senses[1]]
    assert e.R.tolist() == [[sense, 0] if at == 0 else [0, sense]]


@pytest.mark.parametrize("ratio", [2.0, -2.0])
@pytest.mark.parametrize("weight", [1.0, -1.0])
@pytest.mark.parametrize("command", [1.0, -1.0])
def test_of_tied_joints_a_motor_of_one_decides_for_all(ratio: float, weight: float, command: float) -> None:
    g = grasp(
        [{"friction": 0.5}, {"friction": 0.25}], {"m": ([0, weight], {})}, {"m": command}, couplings=[[1, -ratio]]
    )
    e = equivalent_of(g, None, ())
    sense = weight * command  # of j1
    assert e.sliders == 0
    assert e.torque.tolist() == [-0.5 * sense * np.sign(ratio), -0.25 * sense]


def test_chains_of_ties_join_groups() -> None:
    """(0, 1), (2, 3), then (1, 3): q1 = 2 q0, q3 = -q2, q3 = 4 q1 = 8 q0, so that q2 = -8 q0."""
    laws = [{"friction": f} for f in (0.5, 0.25, 0.125, 0.125)]
    g = grasp(laws, couplings=[[-2, 1, 0, 0], [0, 0, 1, 1], [0, -4, 0, 1], [1, -0.5, 0, 0]])
    e = equivalent_of(g, None, ())
    assert e.sliders == 1
    assert e.torque.tolist() == [0.5, 0.25, -0.125, 0.125, -2.0]
    assert e.R.tolist() == [[0, 0, 0, 0, 1], [-0.5, -0.25, 0.125, -0.125, 1]]


def test_a_tie_that_is_there_twice_or_contradicts_changes_nothing() -> None:
    """q1 = 2 q0, and again, or q1 = -q0, which leaves rest alone: friction along the first of them."""
    for second in ([-4, 2], [1, 1]):
        e = equivalent_of(grasp([{"friction": 0.5}, {"friction": 0.25}], couplings=[[-2, 1], second]), None, ())
        assert (e.sliders, e.torque.tolist()) == (1, [0.5, 0.25, -2])


def test_a_tie_is_one_wherever_its_row_stands() -> None:
    """After a coupling of three joints: q0 = 2 q1."""
    laws = [{"friction": 0.5}, {"friction": 0.25}, {}]
    for rows in ([[1, 1, 1], [1, -2, 0]], [[1, -2, 0], [1, 1, 1]]):
        e = equivalent_of(grasp(laws, couplings=rows), None, ())
        assert (e.sliders, e.torque.tolist()) == (1, [0.5, 0.25, 0, -2])


@pytest.mark.parametrize(("stop", "sign"), [("lower", 1.0), ("upper", -1.0)])
@pytest.mark.parametrize("left", [0.25, 2.0])
def test_what_had_left_its_stop_or_was_slack_moves_both_ways(stop: str, sign: float, left: float) -> None:
    """In a step: its friction has a slider, beside the stop or the tendon, which are as far away as they were."""
    g = grasp([{"friction": 0.5, "stop": stop}, {"friction": 0.25}], {"t": ([0, 1], {"tendon": True})})
    at_rest = equivalent_of(g, None, ())
    assert parts(at_rest)[0] == 0
    assert at_rest.torque.tolist() == [-sign * 0.5, -0.25]
    before = StartData(np.zeros(1), np.array([left, 0.0]), np.array([left]))
    e = equivalent_of(g.with_start(before), None, ())
    assert e.R.tolist() == [
        [0, 1, 0, 0], [sign, 0, 0, 0], [0, 0, 1, 0], [-1, 0, 1, 0], [0, 0, 0, 1], [0, -1, 0, 1]
    ]  # fmt: skip
    assert e.slack.tolist() == [left, left, 0, 0, 0, 0]
    assert e.torque.tolist() == [0.5, 0.25, -1, -0.5]


def test_couplings_over_three_joints_tie_none_to_each_other() -> None:
    laws = [{"friction": 0.5}, {"friction": 0.25}, {}]
    e = equivalent_of(grasp(laws, couplings=[[1, 1, 1]]), None, ())
    assert e.sliders == 2
    assert e.torque.tolist() == [0.5, 0.25, 0, -1.0, -0.5]
    # the third held: the other two are tied, q1 = -q0
    laws[2]["stop"] = "both"
    e = equivalent_of(grasp(laws, couplings=[[1, 1, 1]]), None, ())
    assert e.sliders == 1
    assert e.torque.tolist() == [0.5, -0.25, 0, -2]


def test_a_backdrivable_motor_is_a_given_torque() -> None:
    back = {"backdrivable": True}
    g = grasp([{"torque": 0.25}, {}], {"b": ([2, 0], back), "m": ([0, 1], {}), "c": ([1, -1], back)}, {"b": 3, "c": -1})
    e = equivalent_of(g, None, ())
    assert parts(e) == (0, [[0, 1]], [], [False], [0], [0.25 + 6 - 1, 1])
    assert (e.kept.tolist(), e.drives) == ([1], True)
    # sought commands leave it as it is, and lock what is not sought
    sought = equivalent_of(g, np.array([False, True, False]), ())
    assert sought.torque.tolist() == [5.25, 1]
    assert sought.drives


def test_a_backdrivable_motor_without_command_drives_nothing() -> None:
    g = grasp([{}], {"b": ([2], {"backdrivable": True})})
    e = equivalent_of(g, None, ())
    assert parts(e) == (0, [], [], [], [], [0])
    assert (e.kept.tolist(), e.drives, e.held.tolist()) == ([], False, [False])


def test_a_backdrivable_motor_cannot_be_sought() -> None:
    back = {"backdrivable": True}
    g = grasp([{}], {"a": ([1], {}), "b": ([2], back), "c": ([1], back)}, {"b": 3})
    problem = "has '{}', which is backdrivable: its command is given, not sought"
    for sought, name in [([True, True, True], "b"), ([False, False, True], "c")]:
        with refused(problem.format(name), "driven"):
            equivalent_of(g, np.array(sought), ())
    assert equivalent_of(g, np.array([True, False, False]), ()).torque.tolist() == [6]


@pytest.mark.parametrize(
    ("sought", "command", "torque", "held"),
    [
        (None, 2.0, -0.5, False),
        (None, -2.0, 0.5, False),
        (None, 0.0, 0.0, True),
        ([True], 2.0, -0.5, False),
        ([True], -2.0, 0.5, False),
        ([True], 0.0, -0.5, False),  # sought in the sense +
        ([False], 2.0, 0.0, True),  # locked
    ],
)
def test_senses_of_commands_that_are_sought(
    sought: list[bool] | None, command: float, torque: float, held: bool
) -> None:
    g = grasp([{"friction": 0.5}], MOTOR, {"motor": command})
    e = equivalent_of(g, None if sought is None else np.array(sought), ())
    assert e.torque.tolist() == [torque]
    assert e.held.tolist() == [held]
    assert e.command.tolist() == [0 if sought == [False] else command]


EXACT = {  # what acts on a joint: friction beside the lower stop (-F), a spring, R and command of a backdrivable motor
    "rounds": (0.1, 0.3, 0.0, 0.0),
    "cancels": (0.3, 0.3, 0.0, 0.0),
    "cancels but for an ulp": (0.3, np.nextafter(0.3, 1), 0.0, 0.0),
    "cancels but for what is far below": (2.0**60, 2.0**60, 2.0**-30, -(2.0**-40)),
    "three of ten": (0.1, 0.0, 0.3, 1.0),
    "a product that rounds": (0.1, 1 / 3, -1 / 3, 1.0 + 2.0**-52),
    "below all floats": (0.0, 0.0, 1e-45, 1e-290),
}


@pytest.mark.parametrize("case", EXACT)
def test_sums_of_torques_are_exact(case: str) -> None:
    friction, torque, weight, command = EXACT[case]
    law = {"friction": friction, "torque": torque, "stop": "lower"}
    back = {"b": ([weight or 1.0], {"backdrivable": True})}
    e = equivalent_of(grasp([law], back, {"b": command} if command else {}), None, ())
    exact = Fraction(torque) - Fraction(friction) + Fraction(weight) * Fraction(command)
    assert Fraction(int(e.exact[0].p), int(e.exact[0].q)) == exact
    assert e.torque[0] == float(exact) or (float(exact) == 0 and e.torque[0] == np.sign(exact) * 5e-324)
    assert e.torque.any() == bool(exact)


@pytest.mark.parametrize("scale", [1.0, 3e-11, 7e10, 1e-40, 1e40])
def test_what_tied_joints_share_is_their_friction_exactly(scale: float) -> None:
    """The slider carries 2 F together; each joint has its own friction of that, with no rounding."""
    for seed in range(40):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(1, 5))
        frictions = (scale * rng.exponential(size=n) ** rng.integers(1, 4)).tolist()
        rates = rng.choice([-1, 1], n - 1) * rng.exponential(size=n - 1)
        tied = [[rate if j == 0 else -1.0 if j == k + 1 else 0.0 for j in range(n)] for k, rate in enumerate(rates)]
        e = equivalent_of(grasp([{"friction": F} for F in frictions], couplings=tied), None, ())
        weights, total = -e.R[1, :n], Fraction(-e.torque[n]) / 2
        signed = [F * s for F, s in zip(frictions, [1.0, *np.sign(rates)], strict=True)]
        assert [Fraction(w) * total for w in weights] == [Fraction(F) for F in signed]
        assert e.torque[:n].tolist() == signed
        assert 0.5 <= np.abs(weights).sum() <= 1 + 1e-15  # u is no farther than the joints


def test_chains_of_ties_keep_their_senses_beyond_all_numbers() -> None:
    """Rates of 1e100 each, four joints on: no float has their product."""
    laws = [{"friction": F} for F in (0.5, 0.25, 0.125, 0.0625, 0.0625)]
    for far in (1e50, 1e-50):
        rows = [[0.0] * k + [-far, 1 / far] + [0.0] * (3 - k) for k in range(4)]
        rows[1][2] *= -1
        e = equivalent_of(grasp(laws, couplings=rows), None, ())
        assert e.torque.tolist() == [0.5, 0.25, -0.125, -0.0625, -0.0625, -2.0]
        assert e.R.tolist() == [[0, 0, 0, 0, 0, 1], [-0.5, -0.25, 0.125, 0.0625, 0.0625, 1]]


def test_the_equations_have_given_torques_exactly() -> None:
    """0.3 - 0.1 and 2^60 + 1 are no floats: right-hand side, column of the scalar, balance of energy."""
    laws = [{"friction": 0.1, "torque": 0.3, "stop": "lower"}, {"torque": 2.0**60}]
    g = grasp_file(laws, {"b": ([0, 1.0], {"backdrivable": True})}, {"b": 1.0})
    exact = [rational(0.3) - rational(0.1), fmpq(2**60 + 1)]
    asked = read_question({"grasp": g, "goal": "check", "wrench": [1.0, 0, 0, 0, 0, 0]}, "")
    equations = equations_of(asked)
    side = RightSide.of(asked, None, len(equations.E))
    assert side.h[6:].tolist() == asked.equivalent.torque.tolist() == [0.3 - 0.1, 2.0**60]
    assert side.exact == [*rationals(side.h[:6]), *exact]
    some = LeafRows(*(np.array([x]) for x in (int(Row.ENERGY), 0, 0, 0, 0)), np.array([[1.0, 0.0]]))
    value, _ = row_values(asked, None, some)
    none, q = np.zeros(0, np.int64), equations.columns.q.start
    assert equations.exact_rows(value, none, q + np.arange(2)) == [exact]
    least = read_question({"grasp": g, "goal": "smallest preload", "wrench": [0.0] * 6, "direction": [1.0] * 6}, "")
    equations = equations_of(least)
    at = equations.columns.scalar.start
    assert equations.exact_rows(value[:0], np.array([6, 7]), np.array([at])) == [[-x] for x in exact]
    assert RightSide.of(least, (0.0, 1.0), len(equations.E)).exact[6:] == [0, 0]


@pytest.mark.parametrize("scale", [1e-10, 1e-5, 1.0, 1e5, 1e10])
@pytest.mark.parametrize("strong", [2.0**k for k in (0, 20, 40, 44, 46, 50)])
def test_a_spring_is_not_lost_beside_its_friction(scale: float, strong: float) -> None:
    """A spring pushes a block against a wall, friction beside its stop takes all but 1 N of it: the push holds 0.1 N.

    A proof that without it nothing holds is no proof about this question.
    """
    unit = 2.0 ** round(np.log2(scale))
    forged = proof_of_slip(grasp_of_block(unit, unit), 0.1 * unit)
    assert verify(forged).ok
    q = block_asked(grasp_of_block(strong * unit, (strong - 1) * unit), 0.1 * unit)
    assert q.equivalent.torque.tolist() == [unit]
    assert not verify(replace(forged, question=q)).ok
    c = [1.0, *(q.grasp.frames[0].T @ [-0.05, 0, 0])[1:], 1.0, *(q.grasp.frames[1].T @ [-0.05, 0, 0])[1:]]
    none = np.zeros(0)
    parts = ([0, 1.0, 0, 0, 0, 0], [2.0], c, none, none, [1 - strong], [0.0, 0.0])
    x = State(*(unit * np.array(part, dtype=float) for part in parts))
    found = prove(Problem.of(q, q.grasp.command, q.wrench), x)
    assert found.exact or found.tolerant


def grasp_of_block(torque: float, friction: float) -> dict[str, Any]:
    contacts = [{"position": [0, 0.05 * s, 0], "normal": [0, -s, 0], "friction": 0.5} for s in (-1, 1)]
    law = {"friction": friction, "torque": torque, "stop": "lower"}
    joint = {"name": "a", "type": "prismatic", "axis": [0, 1, 0], "origin": [0, 0, 0], "moves": [0]} | law
    none = {"actuators": [], "couplings": []}
    return {"schema": "handfast/grasp/1", "contacts": contacts, "joints": [joint], "mechanism": none}


def block_asked(grasp: dict[str, Any], load: float) -> Question:
    return read_question({"grasp": grasp, "goal": "check", "wrench": [load, 0, 0, 0, 0, 0]}, "")


def proof_of_slip(grasp: dict[str, Any], load: float) -> Certificate:
    answer = check(from_dict(grasp), [load, 0, 0, 0, 0, 0])
    assert answer.certificate is not None
    return answer.certificate


def test_rows_behind_those_of_the_grasp() -> None:
    """First its actuators, then stops, then pairs of friction; sliders behind the joints, in the order of joints."""
    laws = [{"friction": 0.5}, {"stop": "upper"}, {"friction": 0.25}, {"stop": "lower"}]
    g = grasp(laws, {"m": ([0, 0, 0, 1], {})}, {"m": 1})
    e = equivalent_of(g, None, ())
    assert parts(e) == (
        2,
        [
            [0, 0, 0, 1, 0, 0],
            [0, -1, 0, 0, 0, 0],
            [0, 0, 0, 1, 0, 0],
            [0, 0, 0, 0, 1, 0],
            [-1, 0, 0, 0, 1, 0],
            [0, 0, 0, 0, 0, 1],
            [0, 0, -1, 0, 0, 1],
        ],
        [],
        [False, True, True, True, True, True, True],
        [1, 0, 0, 0, 0, 0, 0],
        [0.5, 0, 0.25, 0, -1.0, -0.5],
    )


# --- as the search has it


def cases() -> Iterator[tuple[Grasp, np.ndarray | None, tuple[str, ...]]]:
    """Grasps with and without laws, which commands are sought, which actuators have a limit."""
    for seed in range(200):
        rng = np.random.default_rng(seed)
        g = random_law_grasp(rng, 0.5)
        names, back = g.mechanism.actuators, np.array(g.mechanism.backdrivable, dtype=bool)
        limited = tuple(name for name in names if rng.random() < 0.2)
        yield g, None, limited
        yield g, ~back & (rng.random(g.mechanism.a) < 0.6), limited
    for seed in range(20):  # fingers of several joints, tied, with laws
        rng = np.random.default_rng(seed)
        plain = random_case(3, 1_500_000 + seed).grasp
        laws = {"friction": [0.0, 0.03, 0.1], "torque": [0.0, 0.0, -0.05], "stop": ["", "", "lower", "upper", "both"]}
        joints = [
            GraspJoint(j.name, j.axis, j.origin, j.moves, j.type, **{k: rng.choice(v).item() for k, v in laws.items()})
            for j in plain.joints
        ]
        ties = np.zeros((2, plain.l))
        for row in ties:
            row[rng.choice(plain.l, 2, replace=False)] = 1.0, -1 / 3
        R, tendon = plain.mechanism.R[:-2], tuple(rng.random(plain.mechanism.a - 2) < 0.3)
        names = plain.mechanism.actuators[:-2]
        command = np.where(tendon, np.abs(plain.command[:-2]), plain.command[:-2])
        g = Grasp(plain.contacts, joints, Mechanism(names, R, ties, tendon), command)
        yield g, None, ()
        yield g, rng.random(len(names)) < 0.5, names[:1]


@pytest.mark.slow
def test_the_search_has_the_same() -> None:
    seen = np.zeros(6, dtype=int)
    for g, sought, limited in cases():
        its = equivalent_grasp.equivalent_of(g, sought, limited)
        e = equivalent_of(read_grasp(to_dict(g), "g"), sought, limited)
        mech = its.plain.mechanism
        assert np.array_equal(e.R, mech.R)
        assert np.array_equal(e.A, mech.A)
        assert np.array_equal(e.tendon, np.array(mech.tendon, dtype=bool))
        assert np.array_equal(e.torque, its.plain.given_torques)
        assert np.array_equal(e.kept, its.kept)
        assert np.array_equal(e.held, its.held)
        assert e.sliders == its.plain.l - g.l
        if sought is None or g.has_laws:  # else the search keeps commands, and does not read those that are not sought
            assert np.array_equal(e.command, its.plain.command)
        if g.has_laws:
            assert e.drives == its.drives
        seen += [e.sliders > 0, e.sliders > 1, e.held.any(), e.drives, len(e.kept) < g.mechanism.a, len(its.stops) > 0]
    assert (seen > 20).all()


def test_both_refuse_a_backdrivable_motor_that_is_sought() -> None:
    g = jaw(Mechanism(("motor",), np.eye(1), np.zeros((0, 1)), (False,), (True,)))
    with pytest.raises(InputError, match="is backdrivable: its command is given, not sought"):
        equivalent_grasp.equivalent_of(g, np.array([True]), ())
    with pytest.raises(BadFile, match="is backdrivable: its command is given, not sought"):
        equivalent_of(read_grasp(to_dict(g), "g"), np.array([True]), ())


# --- against the laws themselves: at each motion, the same torques

Ranges = list[tuple[float, float]]
STILL = 1e-12


def force_ranges(R: Array, command: Array, tendon: Array, limit: Array, q: Array) -> Ranges | None:
    """(lo, hi) of each actuator's force at a motion, (8); None where the motion cannot be."""
    out = []
    for t, f, pulls, most in zip(R @ q, command, tendon, limit, strict=True):
        sense = -1.0 if f < 0 else 1.0
        if f == 0 and not pulls:
            if abs(t) > STILL:
                return None
            own = (-INF, INF)
        elif sense * t < -STILL:
            return None
        elif sense * t > STILL:
            own = (f, f)
        else:
            own = (f, INF) if sense > 0 else (-INF, f)
        own = max(own[0], -most), min(own[1], most)
        if own[0] > own[1]:
            return None
        out.append(own)
    return out


def law_ranges(g: GraspData, limit: Array, q: Array) -> Ranges | None:
    """(lo, hi) of actuators, multipliers and reactions of a grasp at a motion, by the laws."""
    if np.abs(g.A @ q).max(initial=0.0) > STILL:
        return None
    kept = ~g.backdrivable
    forces = force_ranges(g.R[kept], g.command[kept], g.tendon[kept], limit[kept], q)
    if forces is None:
        return None
    reactions = []
    for j, moved in enumerate(q):
        stop = ("", "lower", "upper", "both")[g.stop[j]]
        lo = -INF if stop in ("upper", "both") else -g.friction[j]
        hi = INF if stop in ("lower", "both") else g.friction[j]
        end = (lo, hi) if abs(moved) <= STILL else (lo, lo) if moved > 0 else (hi, hi)
        if np.isinf(end[0]) and end[0] == end[1]:  # moves into its stop
            return None
        reactions.append(end)
    return [*forces, *[(-INF, INF)] * len(g.A), *reactions]


def most(columns: Array, given: Array, bounds: Ranges, along: Array) -> float | None:
    """The largest along . tau with tau = columns x + given; what is behind tau is 0. None where there is no x."""
    l = len(along)
    equal = {"A_eq": columns[l:], "b_eq": -given[l:]} if len(columns) > l else {}
    if not columns.shape[1]:
        return float(along @ given[:l]) if not given[l:].any() else None
    found = linprog(-along @ columns[:l], bounds=bounds, **equal)
    if found.status == 2:
        return None
    assert found.status in (0, 3)
    return INF if found.status == 3 else float(along @ given[:l] - found.fun)


def by_law(g: GraspData, limit: Array, q: Array, along: Array) -> float | None:
    """The largest along . tau at a motion q, by the laws; None where the motion cannot be."""
    bounds = law_ranges(g, limit, q)
    if bounds is None:
        return None
    kept = ~g.backdrivable
    given = g.torque + g.R[g.backdrivable].T @ g.command[g.backdrivable]
    return most(np.hstack([g.R[kept].T, g.A.T, np.eye(g.l)]), given, bounds, along)


def by_equivalent(e: Equivalent, limit: Array, q: Array, u: Array, along: Array) -> float | None:
    """The same of the equivalent, whose sliders move by u."""
    whole = np.concatenate([q, u])
    if np.abs(e.A @ whole).max(initial=0.0) > STILL:
        return None
    limits = np.concatenate([limit[e.kept], np.full(len(e.R) - len(e.kept), INF)])
    forces = force_ranges(e.R, e.command, e.tendon, limits, whole)
    if forces is None:
        return None
    return most(np.hstack([e.R.T, e.A.T]), e.torque, [*forces, *[(-INF, INF)] * len(e.A)], along)


# flags, command, limit, senses in which the joint may move; all with the weight -2
ACTUATORS: dict[str, tuple[dict[str, bool] | None, float, float, set[float]]] = {
    "none": (None, 0.0, INF, {-1.0, 1.0}),
    "locked": ({}, 0.0, INF, set()),
    "opens": ({}, 0.2, INF, {-1.0}),
    "closes": ({}, -0.2, INF, {1.0}),
    "tendon": ({"tendon": True}, 0.2, INF, {-1.0}),
    "slack tendon": ({"tendon": True}, 0.0, INF, {-1.0}),
    "backdrivable": ({"backdrivable": True}, -0.2, INF, {-1.0, 1.0}),
    "limited": ({}, 0.2, 0.9, {-1.0}),
    "locked up to a limit": ({}, 0.0, 0.9, set()),
}
STOPPED = {"": set(), "lower": {-1.0}, "upper": {1.0}, "both": {-1.0, 1.0}}


@pytest.mark.parametrize("stop", ["", "lower", "upper", "both"])
@pytest.mark.parametrize("kind", ACTUATORS)
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_one_joint_carries_what_its_laws_say(kind: str, stop: str, friction: float) -> None:
    """All motions of the joint and of its slider: the torques are the same, and no slider allows another."""
    flags, command, most_force, senses = ACTUATORS[kind]
    actuators = {} if flags is None else {"m": ([-2.0], flags)}
    g = grasp([{"friction": friction, "stop": stop, "torque": 0.125}], actuators, {"m": command} if command else {})
    limit = np.full(g.a, most_force)
    e = equivalent_of(g, None, ("m",) if np.isfinite(most_force) else ())
    for q, along in itertools.product((-1.0, 0.0, 1.0), (1.0, -1.0)):
        law = by_law(g, limit, np.array([q]), np.array([along]))
        assert (law is not None) == (q == 0 or q in senses - STOPPED[stop])
        sliders = itertools.product((-1.0, 0.0, 0.5, 1.0, 2.0), repeat=e.sliders)
        for u in sliders:
            here = law is not None and u == (max(0.0, q),) * e.sliders
            found = by_equivalent(e, limit, np.array([q]), np.array(u), np.array([along]))
            assert found == (pytest.approx(law, abs=1e-12) if here else None), (q, u)


@pytest.mark.parametrize("seed", range(30))
def test_joints_that_are_tied_carry_what_their_laws_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    g = read_grasp(to_dict(random_law_grasp(rng)), "g")
    limited = tuple(name for name in g.actuators if rng.random() < 0.3 and not g.backdrivable[g.actuators.index(name)])
    limit = np.array([0.3 if name in limited else INF for name in g.actuators])
    e = equivalent_of(g, None, limited)
    weights = -e.R[len(e.R) - 2 * e.sliders :, : g.l][1::2]
    for q in [np.zeros(g.l), *rng.choice([-1.0, -0.5, 0.0, 0.5, 1.0, 2.0], (6, g.l))]:
        along = rng.normal(size=g.l)
        law = by_law(g, limit, q, along)
        u = np.maximum(0.0, weights @ q)
        found = by_equivalent(e, limit, q, u, along)
        assert found == (None if law is None else pytest.approx(law, abs=1e-9)), q
        if e.sliders:  # no other motion of the sliders
            assert by_equivalent(e, limit, q, u + rng.choice([-0.25, 0.25], e.sliders), along) is None


def test_the_jaw_and_the_curled_finger() -> None:
    """The hinge rubs freely: a slider. The tendon over two joints: one for each that rubs, stops are rows."""
    e = equivalent_of(read_grasp(to_dict(jaw(friction=0.2)), "g"), None, ())
    assert parts(e) == (1, [[0, 1], [-1, 1]], [], [True, True], [0, 0], [0.2, -0.4])
    g = curled(2.0, knuckle={"friction": 0.1}, tip={"stop": "upper"})
    e = equivalent_of(read_grasp(to_dict(g), "g"), None, ())
    assert parts(e) == (
        1,
        [[1, 1, 0], [0, -1, 0], [0, 0, 1], [-1, 0, 1]],
        [],
        [True] * 4,
        [2, 0, 0, 0],
        [0.1, 0, -0.2],
    )
