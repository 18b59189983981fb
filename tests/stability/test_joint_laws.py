"""Laws of joints against numbers that are derived by hand, see docs/joint-laws.md."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import (
    InputError,
    Settings,
    Verdict,
    check,
    check_many,
    hold,
    max_many,
    maximum,
    prepare,
    torques,
)
from handfast.model.grasp import Grasp
from handfast.model.mechanism import Mechanism
from handfast.papers import algorithm1
from handfast.proofs.answers import read_answer, replay
from handfast.readers.grasp_file import from_dict, to_dict
from handfast.stability.problem import judge, model
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.loads import Loads
from tests.support.law_grasps import BACKDRIVABLE, DOWN, OPENS, curled, jaw

MOTOR = Mechanism.direct(["hinge"])
NOTHING = np.zeros(6)
# the hinge is 0.1 m from the contact: a force F on the finger is a torque of 0.1 F
BY_HAND: list[tuple[dict[str, Any], list[int], float]] = [
    ({}, OPENS, 0.0),  # a free finger holds nothing
    ({"friction": 0.2}, OPENS, 2.0),  # friction holds its torque, 0.2 / 0.1, and not more
    ({"friction": 0.2}, DOWN, 0.0),  # but presses nothing together
    ({"torque": 0.2}, OPENS, 2.0),  # a spring presses with its torque
    ({"torque": 0.2}, DOWN, 2.0),  # and squeezes with 2 N at both contacts, mu 0.5 each
    ({"torque": 0.2, "friction": 0.1}, OPENS, 3.0),  # friction helps what is pushed back,
    ({"torque": 0.2, "friction": 0.1}, DOWN, 1.0),  # and takes from what squeezes
    ({"torque": -0.1, "friction": 0.2}, OPENS, 1.0),  # friction against a spring that opens
    ({"torque": -0.3, "friction": 0.2}, OPENS, 0.0),  # which is too strong
    ({"stop": "lower"}, OPENS, np.inf),  # stands at its limit: no motor could carry as much
    ({"stop": "upper"}, OPENS, 0.0),  # a stop that is on the other side
    ({"stop": "both"}, OPENS, np.inf),
    ({"stop": "upper", "friction": 0.2}, OPENS, 2.0),
    ({"stop": "lower", "torque": 0.2}, DOWN, 2.0),  # a spring that presses on at a limit
    ({"mechanism": MOTOR, "preload": {"hinge": 0.5}, "friction": 0.2}, DOWN, 3.0),  # 0.5 - 0.2 arrives
    ({"mechanism": MOTOR, "preload": {"hinge": 0.1}, "friction": 0.2}, DOWN, 0.0),  # too weak to turn
    ({"mechanism": MOTOR, "preload": {"hinge": 0.5}, "friction": 0.2}, OPENS, np.inf),  # gears hold, whatever friction
    ({"mechanism": MOTOR, "friction": 0.2}, OPENS, np.inf),  # locked
    ({"mechanism": MOTOR, "preload": {"hinge": 0.5}, "stop": "upper"}, DOWN, 0.0),  # cannot close: locked
    ({"mechanism": BACKDRIVABLE, "preload": {"motor": 0.5}}, OPENS, 5.0),  # its torque exactly
    ({"mechanism": BACKDRIVABLE, "preload": {"motor": 0.5}}, DOWN, 5.0),
    ({"mechanism": BACKDRIVABLE, "preload": {"motor": 0.5}, "friction": 0.2}, OPENS, 7.0),
    ({"mechanism": BACKDRIVABLE, "preload": {"motor": 0.5}, "friction": 0.2}, DOWN, 3.0),
    ({"mechanism": BACKDRIVABLE}, OPENS, 0.0),  # without command it swings freely
    ({"mechanism": BACKDRIVABLE, "stop": "lower", "preload": {"motor": 0.1}}, OPENS, np.inf),
]


def balanced(answer: Any) -> None:
    """The witness solves the model, and its energies add up, term by term."""
    w = answer.witness
    assert w.valid
    energy, g, state = w.energy, w.grasp, w.state
    size = sum(map(abs, (energy.disturbance, energy.preload, energy.given))) + energy.stored
    assert energy.residual == pytest.approx(0.0, abs=1e-9 * max(size, 1.0))
    assert energy.joints == pytest.approx(g.joint_friction * np.abs(state.q), abs=1e-9 * max(size, 1.0))
    assert energy.stored == pytest.approx(float((state.c[::3] ** 2).sum()), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(("laws", "direction", "most"), BY_HAND, ids=str)
@pytest.mark.slow
def test_the_largest_load_is_the_one_by_hand(laws: dict[str, Any], direction: list[int], most: float) -> None:
    """Alone, beside a base load along the same line, in a batch and prepared; each answer replayed."""
    grasp = jaw(**laws)
    found = maximum(grasp, direction)
    verified = found.verify()
    assert verified.ok, verified.reason
    if most == np.inf:
        assert found.unbounded
    elif most == 0:
        assert found.verdict is Verdict.SLIPS
    else:
        assert found.lower == pytest.approx(most, rel=1e-5)
        assert most <= found.upper <= 1.002 * most
    if found.witness:
        balanced(found)
    less, more = 0.99 * min(most, 5.0), 1.01 * most if np.isfinite(most) else 0.0
    loads = np.outer([less, more] if most else [0.5, 1.0], direction)
    expected = [Verdict.HOLDS, Verdict.SLIPS if most < np.inf else Verdict.HOLDS] if most else [Verdict.SLIPS] * 2
    answers = [check(grasp, w) for w in loads]
    if more or not most:
        assert [a.verdict for a in answers] == expected
        assert all(a.verify().ok for a in answers)
        assert check_many(grasp, loads).verdict.tolist() == [str(v) for v in expected]
        prepared = prepare(grasp)
        assert [prepared.check(w).verdict for w in loads] == expected
    many = max_many(grasp, [direction, direction])
    assert many.lower == pytest.approx([found.lower] * 2, rel=1e-2)


def test_a_base_load_is_beside_what_is_given() -> None:
    """Friction holds 2 N in all."""
    found = maximum(jaw(friction=0.2), OPENS, base=[0.5, 0, 0])
    assert found.lower == pytest.approx(1.5, rel=1e-6)
    assert found.verify().ok


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6])
def test_answers_of_any_precision_are_replayed(gap: float) -> None:
    """The magnitude is that of the state, whose commands and friction are the grasp's to the last digits."""
    grasp = jaw(BACKDRIVABLE, {"motor": 0.3}, friction=0.07)
    found = maximum(grasp, DOWN, settings=Settings(gap=gap))
    assert found.verify().ok
    assert found.lower == pytest.approx(2.3, rel=gap)
    assert found.lower <= 2.3 * (1 + 1e-9) <= found.upper * (1 + 2e-9)


def test_what_is_limited_is_beside_friction() -> None:
    """A limit is of motor and gears together: friction carries 0.2 N m beside them, 0.3 / 0.1 N in all."""
    found = maximum(jaw(MOTOR, friction=0.2), OPENS, limits=GraspLimits(torque_limits={"hinge": 0.1}))
    assert found.lower == pytest.approx(3.0, rel=1e-6)
    assert found.verify().ok
    commanded = maximum(
        jaw(MOTOR, {"hinge": 0.3}, friction=0.2), OPENS, limits=GraspLimits(torque_limits={"hinge": 0.4})
    )
    assert commanded.lower == pytest.approx(6.0, rel=1e-6)
    assert commanded.verify().ok


@pytest.mark.parametrize(
    ("laws", "most"),
    [
        ({}, 0.0),  # the difference of the two joints is free
        # f + rho_1 = 0.1 c and f + rho_2 = 0.04 c, so that rho_1 - rho_2 = 0.06 c
        ({"tip": {"friction": 0.05}}, 0.05 / 0.06),
        ({"knuckle": {"friction": 0.05}}, 0.05 / 0.06),
        ({"knuckle": {"friction": 0.05}, "tip": {"friction": 0.04}}, 1.5),
        ({"tip": {"stop": "upper"}}, np.inf),  # the tendon would straighten the knuckle and bend the tip further
        ({"knuckle": {"stop": "lower"}}, np.inf),
        ({"tip": {"stop": "lower"}}, 0.0),
        ({"knuckle": {"stop": "upper"}}, 0.0),
    ],
    ids=str,
)
def test_a_tendon_over_two_joints_leaves_their_difference_free(laws: dict[str, Any], most: float) -> None:
    """As the coupled distal joints of real hands: without stops and friction such a finger gives way."""
    found = maximum(curled(**laws), OPENS)
    verified = found.verify()
    assert verified.ok, verified.reason
    assert found.unbounded == (most == np.inf)
    if 0 < most < np.inf:
        assert found.lower == pytest.approx(most, rel=1e-5)
        balanced(found)
    assert found.verdict is (Verdict.HOLDS if most else Verdict.SLIPS)


def test_a_tendon_that_is_pulled_needs_a_stop_or_friction() -> None:
    """Under no load at all: pulled with 0.2 N m the finger runs away, as a published grasp of such a hand does."""
    assert check(curled(0.2), NOTHING).verdict is Verdict.SLIPS
    assert check(curled(0.2, tip={"friction": 0.02}), NOTHING).verdict is Verdict.SLIPS
    stopped = check(curled(0.2, tip={"stop": "upper"}), NOTHING)
    assert stopped.witness is not None
    assert stopped.witness.state.c[[0, 3]] == pytest.approx([2.0, 2.0])  # 0.2 / 0.1
    assert stopped.witness.state.reaction == pytest.approx([0.0, -0.12])  # 0.04 * 2 - 0.2
    rubbed = check(curled(0.2, knuckle={"friction": 0.1}, tip={"friction": 0.12}), NOTHING)
    assert rubbed.verdict is Verdict.HOLDS
    balanced(rubbed)


@pytest.mark.parametrize(
    ("grasp", "wrench", "least"),
    [
        (jaw(MOTOR, friction=0.2), [0, 0, -3], 0.5),  # 0.3 squeezes, 0.2 is lost
        (jaw(MOTOR, {"hinge": -0.1}, friction=0.2), [0, 0, -3], np.inf),  # opening never squeezes
        (jaw(MOTOR, torque=0.1), [0, 0, -3], 0.2),  # the spring helps
        (curled(knuckle={"friction": 0.05}, tip={"friction": 0.1}), [0, 0, -2], 0.18),  # the tip closes: 0.08 + 0.1
        (jaw(Mechanism(("a", "b"), np.ones((2, 1)), np.zeros((0, 1)), (False,) * 2, (False, True)), {"b": 0.1}),
         [0, 0, -3], 0.2),  # one is backdrivable and stays as it is
    ],
    ids=["rubs", "opens", "spring", "tendon", "backdrivable"],
)  # fmt: skip
def test_the_least_commands(grasp: Grasp, wrench: list[float], least: float) -> None:
    found = torques(grasp, wrench)
    assert found.verify().ok
    if least == np.inf:
        assert found.verdict is Verdict.SLIPS
        return
    assert found.upper == pytest.approx(least, rel=2e-3)
    assert found.lower <= least
    assert found.lower == pytest.approx(least, rel=2e-3)
    held = hold(grasp, Loads(("pulled",), np.array([[*wrench, 0, 0, 0]], dtype=float)), least=True)
    assert held.verdict is Verdict.HOLDS
    assert held.upper <= 1.3 * least
    assert held.verify().ok


def test_limits_of_friction_are_the_old_laws() -> None:
    """None is a free joint, much a locked one; a stop beside a command locks, too."""
    for load in ([1, 0, -0.4], [1, 0, 0.2], [2, 0, 0], [-1, 0, 0.3]):
        free, locked = check(jaw(), load), check(jaw(MOTOR), load)
        assert check(jaw(friction=1e-9), load).verdict is free.verdict
        assert check(jaw(friction=50.0), load).verdict is locked.verdict
        assert check(jaw(MOTOR, {"hinge": 0.1}, stop="upper"), load).verdict is locked.verdict


def test_smaller_loads_are_resisted_as_well() -> None:
    """States over a whole range of magnitudes have reactions, too, and a file of them is replayed."""
    found = maximum(jaw(MOTOR, {"hinge": 0.5}, friction=0.2), DOWN, interval=True)
    assert found.interval is not None
    assert found.interval.holds_from_zero_to == pytest.approx(3.0)
    assert found.verify().ok


def test_an_answer_with_reactions_comes_back_from_its_file(tmp_path: Path) -> None:
    found = check(jaw(friction=0.2), [1.5, 0, 0])
    found.save(tmp_path / "answer.json")
    saved = read_answer(json.loads((tmp_path / "answer.json").read_text()))
    assert saved.witness is not None
    assert saved.witness.state.reaction == pytest.approx([0.15])
    assert replay(saved).ok
    assert found.to_json()["joint_reactions"] == {"hinge": pytest.approx(0.15)}
    assert "joint_reactions" not in check(jaw(MOTOR), [1.5, 0, 0]).to_json()


def test_a_grasp_file_has_the_laws() -> None:
    grasp = jaw(BACKDRIVABLE, {"motor": 0.1}, friction=0.2, torque=-0.1, stop="lower")
    data = to_dict(grasp)
    assert to_dict(from_dict(data)) == data
    assert data["joints"][0]["stop"] == "lower"
    assert data["mechanism"]["actuators"][0]["backdrivable"] is True
    for name in ("friction", "torque", "stop"):
        del data["joints"][0][name]
    del data["mechanism"]["actuators"][0]["backdrivable"]
    assert not from_dict(data).has_laws  # as files were before


@pytest.mark.parametrize(
    ("changed", "right"),
    [
        ({"reaction": np.array([0.25])}, False),  # beyond friction
        ({"q": np.array([1.0])}, False),  # closes without its friction
        ({}, True),
    ],
    ids=["beyond", "moves", "as it is"],
)
def test_the_judge_sees_the_law_itself(changed: Mapping[str, Any], right: bool) -> None:
    """At 2 N friction carries 0.2 N m; the judge knows nothing of tendons that stand for it."""
    found = check(jaw(friction=0.2), [2.0, 0, 0])
    assert found.witness is not None
    state = replace(found.witness.state, **changed)
    worst = judge.residuals(jaw(friction=0.2), np.array([2.0, 0, 0, 0, 0, 0]), state)
    assert (worst.worst <= 1e-9) == right
    if "reaction" in changed:
        assert worst.reactions == pytest.approx(0.25)  # 0.05 N m at 0.1 m, of 2 N


@pytest.mark.parametrize("stop", ["upper", "lower"])
def test_nothing_moves_into_a_stop(stop: str) -> None:
    grasp = jaw(stop=stop)
    into = np.array([0.1 if stop == "upper" else -0.1])
    state = model.state_of(np.zeros(6), into, np.zeros(6), np.zeros(0), np.zeros(0))
    assert judge.residuals(grasp, NOTHING, state).reactions == pytest.approx(0.01)
    away = replace(state, q=-into)
    assert judge.residuals(grasp, NOTHING, away).reactions == 0.0


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda g: algorithm1.check(g, OPENS), "Algorithm 1 knows no friction"),
        (lambda g: torques(g, OPENS, actuators=["motor"]), "'motor' is backdrivable: its command is given"),
        (
            lambda g: check(g, OPENS, limits=GraspLimits(torque_limits={"motor": 0.05})),
            "'motor' is backdrivable and gives its command",
        ),
    ],
)
def test_what_knows_no_laws_says_so(ask: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        ask(jaw(BACKDRIVABLE, {"motor": 0.1}))


def test_more_laws_than_can_be_searched_are_refused() -> None:
    """Each joint that rubs takes five of the places that contacts, joints and actuators share."""
    joints = [replace(jaw().joints[0], name=f"j{i}", friction=0.1) for i in range(45)]
    grasp = Grasp(jaw().contacts, joints, Mechanism((), np.zeros((0, 45)), np.zeros((0, 45)), ()))
    with pytest.raises(InputError, match="45 joints rub and 0 stop, too many to search"):
        check(grasp, OPENS)


def test_a_backdrivable_motor_may_have_a_limit():
    """Its command is within the limit or refused, so that a limit changes no maximum."""
    grasp = jaw(BACKDRIVABLE, {"motor": 0.5}, friction=0.2)
    limited = maximum(grasp, OPENS, limits=GraspLimits(torque_limits={"motor": 0.6}))
    assert limited.lower == pytest.approx(7.0, rel=2e-3)
    assert limited.upper < 7.02
    assert limited.verify().ok
    with pytest.raises(InputError, match=r"gives its command, 0\.5"):
        maximum(grasp, OPENS, limits=GraspLimits(torque_limits={"motor": 0.4}))
