"""Questions: loads by the table of the module, who may move and in which sense, claims, every refusal."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from handfast.proofs.question import (
    CHECK,
    GOALS,
    LARGEST_GOAL,
    MAX_ETA,
    SMALLEST_PRELOAD,
    TORQUES,
    Question,
    read_question,
)
from tests.support.refused import refused
from tests.support.small_grasp import small_grasp

INF = np.inf
W, D = [1.0, -2, 3, 0.5, 0, -1], [0.0, 1, 0, 0, 2, 0]
NONE = np.zeros(6).tolist()


def asked(goal: str = CHECK, grasp: dict[str, Any] | None = None, **fields: Any) -> dict[str, Any]:
    """A question as files state it. The small grasp: pull is a tendon with 3, push has -0.75, back is backdrivable."""
    needs = {"direction": D} if goal in (LARGEST_GOAL, SMALLEST_PRELOAD) else {}
    return {
        "grasp": grasp or small_grasp(),
        "goal": goal,
        "wrench": NONE if goal == SMALLEST_PRELOAD else W,
        **needs,
        **fields,
    }


def question(goal: str = CHECK, grasp: dict[str, Any] | None = None, **fields: Any) -> Question:
    return read_question(asked(goal, grasp, **fields), "question")


def bare(**contact: Any) -> dict[str, Any]:
    """One contact of a point, which nothing moves."""
    point = {"position": [0, 0, 0], "normal": [1, 0, 0], "friction": 0.5}
    return {"schema": "handfast/grasp/1", "contacts": [point | contact]}


def lawless() -> dict[str, Any]:
    """The small grasp without laws of joints and without the backdrivable motor; roll has a locked motor besides."""
    data = small_grasp()
    for joint in data["joints"]:
        for name in ("friction", "torque", "stop"):
            joint.pop(name, None)
    data["mechanism"]["actuators"][2] = {"name": "lock", "joints": {"roll": 1}}
    return data


# --- what is read


def test_goals() -> None:
    assert GOALS == ("check", "smallest preload", "largest", "torques")
    assert (CHECK, SMALLEST_PRELOAD, LARGEST_GOAL, TORQUES) == GOALS
    assert pytest.approx(np.pi / 4) == MAX_ETA


def test_what_is_read() -> None:
    q = question(
        TORQUES,
        lawless(),
        objective="sum",
        mdp=False,
        torque_limits={"push": 2},
        force_limit=50,
        driven=["pull", "push"],
    )
    assert (q.goal, q.sums, q.eta, q.mdp) == ("torques", True, 0.0, False)
    assert (dict(q.torque_limits), q.force_limit, q.driven) == ({"push": 2.0}, 50.0, ("pull", "push"))
    assert q.wrench.tolist() == W
    assert q.direction.tolist() == NONE
    assert q.grasp.actuators == ("pull", "push", "lock")
    assert q.sought.tolist() == [True, True, False]


def test_defaults() -> None:
    q = question()
    assert (q.sums, q.eta, q.mdp, dict(q.torque_limits), q.force_limit, q.driven) == (False, 0.0, True, {}, INF, ())
    assert q.sought.tolist() == [False, False, False]
    empty = question(direction=None, force_limit=None)
    assert (empty.direction.tolist(), empty.force_limit) == (NONE, INF)
    assert question(LARGEST_GOAL).direction.tolist() == D
    small = question(force_limit=0.5, torque_limits={"push": 0.25})
    assert (small.force_limit, dict(small.torque_limits)) == (0.5, {"push": 0.25})


@pytest.mark.parametrize(
    ("goal", "scalar", "homogeneous", "seeks"),
    [
        (CHECK, False, False, False),
        (SMALLEST_PRELOAD, True, True, False),
        (LARGEST_GOAL, True, False, False),
        (TORQUES, True, False, True),
    ],
)
def test_kinds_of_goals(goal: str, scalar: bool, homogeneous: bool, seeks: bool) -> None:
    q = question(goal)
    assert (q.has_scalar, q.homogeneous, q.seeks_commands) == (scalar, homogeneous, seeks)


# --- the table of the module, on the small grasp with its laws
#
# Its equivalent: rows pull and push (back is backdrivable), then the stop of roll at its upper end, -q. The joint turn
# rubs with 1/4, slide and roll do not; slide and roll are tied by (3, -1). A tendon over turn and slide lets neither
# move in one sense alone: a slider behind turn, with two rows and -2/4 on it, and 1/4 on turn. What is given to roll:
# -1/2, and back's command times -4.

COMMANDS = [3.0, 0.75, 0, 0, 0]
GIVEN = [0.25, 0, -0.5, -0.5]
Z2, Z5, Z4 = NONE, [0.0] * 5, [0.0] * 4


@pytest.mark.parametrize(
    ("goal", "load"),
    [
        (CHECK, (W, NONE, COMMANDS, Z5, GIVEN, Z4)),
        (SMALLEST_PRELOAD, (D, NONE, Z5, COMMANDS, Z4, GIVEN)),
        (LARGEST_GOAL, (W, D, COMMANDS, Z5, GIVEN, Z4)),
        (TORQUES, (W, NONE, Z5, Z5, GIVEN, Z4)),
    ],
)
def test_loads(goal: str, load: tuple[list[float], ...]) -> None:
    q = question(goal, **({"driven": ["push", "pull"]} if goal == TORQUES else {}))
    found = q.load
    assert [x.tolist() for x in (found.w_a, found.w_b, found.f_a, found.f_b, found.g_a, found.g_b)] == list(load)
    assert (q.actuators, q.joints) == (5, 4)


def test_a_backdrivable_motor_is_given_whatever_is_sought() -> None:
    data = small_grasp()
    data["preload"]["back"] = 0.125  # -4 times that on roll
    for goal in (CHECK, TORQUES):
        assert question(goal, data, **({"driven": ["push"]} if goal == TORQUES else {})).load.g_a[2] == -1.0
    assert question(SMALLEST_PRELOAD, data).load.g_b[2] == -1.0


@pytest.mark.parametrize("goal", GOALS)
def test_who_may_move(goal: str) -> None:
    driven = {"driven": ["push"]} if goal == TORQUES else {}
    data = lawless()
    assert question(goal, data, **driven).may_move.tolist() == [True, True, False]
    data["preload"] = {}  # a tendon may always
    assert question(goal, data, **driven).may_move.tolist() == [True, goal == TORQUES, False]
    assert question(goal, **driven).may_move.tolist() == [True] * 5


@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize("command", [-0.75, 0.0, 0.75])
def test_senses(goal: str, command: float) -> None:
    """Actuators are mirrored into the sense of their command; for torques, those whose command is sought."""
    data = small_grasp()
    data["preload"]["push"] = command
    sense = -1.0 if command < 0 else 1.0
    # push locks roll where it has no command, slide by the tie, too: then turn is the tendon's alone, without a slider
    more = [1.0] * 3 if command else []
    if goal != TORQUES:
        assert question(goal, data).sense.tolist() == [1, sense, *more]
        return
    assert question(goal, data, driven=["push"]).sense.tolist() == [1, sense, 1, 1, 1]
    assert question(goal, data, driven=["pull"]).sense.tolist() == [1, 1]
    plain = lawless()
    plain["preload"]["push"] = command
    assert question(goal, plain, driven=["push"]).sense.tolist() == [1, sense, 1]
    assert question(goal, plain, driven=["pull"]).sense.tolist() == [1, 1, 1]


def test_rows_of_the_equivalent_whose_command_is_sought() -> None:
    q = question(TORQUES, driven=["push"])
    assert q.is_driven.tolist() == [False, True, False, False, False]
    assert question().is_driven.tolist() == [False] * 5
    data = small_grasp()
    data["mechanism"]["actuators"].insert(0, data["mechanism"]["actuators"].pop())  # back, the backdrivable one, first
    q = question(TORQUES, data, driven=["push"], torque_limits={"push": 2, "back": 9})
    assert q.sought.tolist() == [False, False, True]
    assert q.is_driven.tolist() == [False, True, False, False, False]
    assert q.limit.tolist() == [INF, 2, INF, INF, INF]


def test_limits() -> None:
    assert question(torque_limits={"push": 2, "pull": 0.5}).limit.tolist() == [0.5, 2, INF, INF, INF]
    assert question().limit.tolist() == [INF] * 5


def test_limited_actuators_are_no_part_of_the_mergers() -> None:
    """A commanded motor alone on a joint that rubs takes the friction into its torque, unless it has a limit."""
    data = small_grasp()
    data["mechanism"] = {"actuators": [{"name": "push", "joints": {"turn": 1}}]}
    data["preload"] = {"push": 1.0}
    assert question(CHECK, data).equivalent.sliders == 0
    assert question(CHECK, data, torque_limits={"push": 2}).equivalent.sliders == 1
    assert question(TORQUES, data, driven=["push"]).equivalent.sliders == 0
    assert question(TORQUES, data).equivalent.held[0]  # locked where its command is not sought


def test_soft_fingers() -> None:
    data = small_grasp()
    assert question(CHECK, data).soft_fingers.tolist() == [0, -1]
    data["contacts"] = [data["contacts"][1], data["contacts"][0], data["contacts"][0]]
    q = question(CHECK, data)
    assert q.soft_fingers.tolist() == [-1, 0, 1]
    assert q.soft_fingers.dtype == np.int64


# --- claims


def test_claims() -> None:
    scalar = (0.25, 2.0)
    assert question(CHECK).claim(None) == "the disturbance is not resisted"
    assert question(LARGEST_GOAL).claim(scalar) == "0.25 to 2 times the direction is not resisted"
    assert question(SMALLEST_PRELOAD).claim(scalar) == "the direction is not resisted with 0.25 to 2 times the preload"
    assert question(TORQUES).claim(scalar) == "no commands of 0.25 to 2 suffice"
    assert question(TORQUES).claim((1 / 3, INF)) == "no commands of 0.333334 to inf suffice"


def test_magnitudes() -> None:
    assert question(LARGEST_GOAL).magnitudes((0.25, 2.0)) == (0.25, 2.0)
    assert question(LARGEST_GOAL).magnitudes((-1.0, 0.0)) == (-1.0, 0.0)
    assert question(CHECK).magnitudes(None) == (0.0, 0.0)
    preload = question(SMALLEST_PRELOAD)  # a share s of the preload is a magnitude of 1 / s
    assert preload.magnitudes((0.25, 2.0)) == (0.5, 4.0)
    assert preload.magnitudes((0.5, 0.8)) == (1.25, 2.0)
    assert preload.magnitudes((2.0, 4.0)) == (0.25, 0.5)
    assert preload.magnitudes((0.0, 2.0)) == (0.5, INF)
    assert preload.magnitudes((0.25, INF)) == (0.0, 4.0)
    assert preload.magnitudes((0.0, 0.0)) == (INF, INF)


# --- refusals


@pytest.mark.parametrize(
    ("fields", "field", "problem"),
    [
        ({"goal": "most"}, "goal", "is 'most'; 'check' or 'smallest preload' or 'largest' or 'torques' is needed"),
        ({"objective": "least"}, "objective", "is 'least'; 'max' or 'sum' is needed"),
        ({"objective": "sum"}, "objective", "is 'sum', which is for the goal 'torques'"),
        ({"wrench": [1, 2]}, "wrench", "has 2 numbers; 6 are needed"),
        ({"direction": D}, "direction", "has no meaning where the goal is 'check'"),
        ({"goal": TORQUES, "direction": D}, "direction", "has no meaning where the goal is 'torques'"),
        ({"goal": LARGEST_GOAL}, "direction", "is needed where the goal is 'largest'"),
        ({"goal": LARGEST_GOAL, "direction": None}, "direction", "is needed where the goal is 'largest'"),
        (
            {"goal": SMALLEST_PRELOAD, "wrench": NONE},
            "direction",
            "is needed where the goal is 'smallest preload'",
        ),
        ({"goal": LARGEST_GOAL, "direction": [1]}, "direction", "has 1 numbers; 6 are needed"),
        (
            {"goal": LARGEST_GOAL, "direction": NONE},
            "direction",
            "is zero: nothing is asked; a force, a torque or both are needed",
        ),
        (
            {"goal": LARGEST_GOAL, "direction": NONE, "wrench": NONE},
            "direction",
            "is zero: nothing is asked; a force, a torque or both are needed",
        ),
        (
            {"goal": SMALLEST_PRELOAD, "direction": [-0.0] * 6, "wrench": NONE},
            "direction",
            "is zero: nothing is asked; a force, a torque or both are needed",
        ),
        ({"eta": -0.1}, "eta", "is -0.1; 0 or more is needed"),
        ({"mdp": 1}, "mdp", "is 1; true or false is needed"),
        ({"torque_limits": [1]}, "torque_limits", "is no object of numbers by name"),
        (
            {"torque_limits": {"x": 1}},
            "torque_limits",
            "has unknown actuator 'x'; known are pull, push, back",
        ),
        ({"torque_limits": {"push": 0}}, "torque_limits.push", "is 0; a limit is positive"),
        ({"torque_limits": {"pull": 1, "push": -2}}, "torque_limits.push", "is -2; a limit is positive"),
        ({"force_limit": 0}, "force_limit", "is 0; a limit is positive"),
        ({"force_limit": -1}, "force_limit", "is -1; 0 or more is needed"),
        ({"driven": ["x"], "goal": TORQUES}, "driven", "has unknown actuator 'x'; known are pull, push, back"),
        ({"driven": "push", "goal": TORQUES}, "driven", "is no list of texts"),
        ({"driven": ["push", "push"], "goal": TORQUES}, "driven", "is for the goal 'torques', each actuator once"),
        ({"driven": ["push"]}, "driven", "is for the goal 'torques', each actuator once"),
        ({"more": 1}, "more", "is not a known field; leave it out"),
        ({"grasp": 1}, "grasp", "is no object"),
        ({"grasp": {"schema": "handfast/grasp/1"}}, "grasp.contacts", "is missing"),
    ],
)
def test_refusals(fields: dict[str, Any], field: str, problem: str) -> None:
    data = {"grasp": small_grasp(), "goal": CHECK, "wrench": W} | fields
    with refused(problem, f"question.{field}"):
        read_question(data, "question")


@pytest.mark.parametrize("name", ["grasp", "goal", "wrench"])
def test_what_is_missing(name: str) -> None:
    data = asked()
    del data[name]
    with refused("is missing", f"question.{name}"):
        read_question(data, "question")


@pytest.mark.parametrize(
    "fields", [{"wrench": W}, {"torque_limits": {"push": 1}}, {"force_limit": 3}, {"wrench": [0, 0, 0, 0, 0, 1e-30]}]
)
def test_a_share_of_the_preload_has_no_base_load_and_no_limits(fields: dict[str, Any]) -> None:
    with refused("'smallest preload' knows no base load and no limits", "question.goal"):
        question(SMALLEST_PRELOAD, **fields)
    assert question(LARGEST_GOAL, **fields).goal == LARGEST_GOAL


ETA = "0 to 0.7854 is possible, above 0 with the dissipation principle and point contacts alone"
STEPS_ALONE = "has no meaning here; it is for the goal 'check', with the dissipation principle"
REST = {"gaps": [0.0], "stops": [], "slack": []}


@pytest.mark.parametrize(
    ("fields", "field", "problem"),
    [
        ({"eta": MAX_ETA}, "eta", f"is 0.785398 rad; {ETA}"),
        ({"eta": 0.1, "mdp": False}, "eta", f"is 0.1 rad; {ETA}"),
        ({"eta": 0.1, "grasp": bare(torsion=0.25)}, "eta", f"is 0.1 rad; {ETA}"),
        ({"from": REST, "mdp": False}, "from", STEPS_ALONE),
        ({"from": REST, "goal": TORQUES}, "from", STEPS_ALONE),
        ({"from": REST | {"gaps": []}}, "from.gaps", "has 0 numbers; 1 are needed"),
    ],
)
def test_refusals_of_a_single_contact(fields: dict[str, Any], field: str, problem: str) -> None:
    with refused(problem, f"question.{field}"):
        read_question(asked(grasp=bare()) | fields, "question")


def test_a_step_starts_from_the_state_before() -> None:
    q = read_question(asked(grasp=bare()) | {"from": REST | {"gaps": [-0.5]}}, "q")
    assert q.grasp.start is not None
    assert q.grasp.start.gaps.tolist() == [-0.5]
    assert q.claim(None) == "the disturbance is not resisted from the state before"
    assert read_question(asked(grasp=bare()) | {"from": None}, "q").grasp.start is None
    assert question(grasp=bare(), mdp=False).eta == 0


def test_uncertain_normals() -> None:
    data = small_grasp()
    del data["contacts"][0]["torsion"]
    right = "0 to 0.7854 is possible, above 0 with the dissipation principle and point contacts alone"
    assert question(CHECK, data, eta=0.7853).eta == 0.7853
    below = float(np.nextafter(MAX_ETA, 0))
    assert question(CHECK, data, eta=below).eta == below
    with refused(f"is 0.785398 rad; {right}", "question.eta"):
        question(CHECK, data, eta=MAX_ETA)
    with refused(f"is 0.1 rad; {right}", "question.eta"):
        question(CHECK, data, eta=0.1, mdp=False)
    with refused(f"is 1e-09 rad; {right}", "question.eta"):
        question(eta=1e-9)  # a soft finger
    assert question(eta=0.0, mdp=False).mdp is False


def test_a_backdrivable_motor_is_not_sought() -> None:
    with refused("has 'back', which is backdrivable: its command is given, not sought", "driven"):
        _ = question(TORQUES, driven=["push", "back"]).equivalent
