"""What is refused of one preload for many loads: planted faults in `handfast/hold/1` files."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handfast.core.answer import Verdict
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.proofs import answers, holds
from handfast.proofs.answers import ANSWER_NOT_REPLAYED, SavedAnswer, read_answer
from handfast.proofs.certificate import Certificate
from handfast.proofs.fields import BadFile
from handfast.proofs.files import verify
from handfast.proofs.grasp import StartData
from handfast.proofs.path_steps import LOADING, OTHER_PATHS, SavedPath
from handfast.proofs.question import LARGEST_GOAL, TORQUES, Question, read_question
from handfast.proofs.replay import Refused, Replay
from handfast.proofs.tolerance import in_play
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.loads import Loads
from handfast.stability.studies.questions import check, hold, maximum, torques
from tests.support.problems import nest, pinch

UP, SIDE = np.array([0, 1.0, 0, 0, 0, 0]), np.array([0.2, 0, 0, 0, 0, 0])
LOADS = Loads(("up", "side"), np.array([UP, SIDE]))
PULL = Loads(("pull",), np.array([[0, 0, 1.0, 0, 0, 0]]))
TURN = Loads(("up", "turn"), np.array([UP, [0, 0, 0, 0.01, 0, 0]]))  # about the line between the tips of the pinch
HOLDS = {
    "held": lambda: hold(pinch(), LOADS),
    "locked": lambda: hold(pinch(), Loads(("side",), SIDE[None])),
    "impossible": lambda: hold(nest(), PULL),
    "unbalanced": lambda: hold(pinch(), TURN),
    "too weak": lambda: hold(pinch(), LOADS, command_limit=0.04),
    "with margins": lambda: hold(pinch(), LOADS, margins=True),
}


@cache
def text(name: str) -> str:
    return json.dumps(HOLDS[name]().to_file())


def saved(name: str = "held") -> dict[str, Any]:
    return json.loads(text(name))


def reason(data: dict[str, Any]) -> str:
    """Why a file is refused, in one line."""
    try:
        done = verify(data)
    except BadFile as fault:
        return f"{fault.field}: {fault.problem}"
    assert not done.ok
    assert "\n" not in done.reason
    return done.reason


@pytest.mark.parametrize("name", HOLDS)
def test_what_is_saved_is_proved(name: str) -> None:
    done = verify(saved(name))
    assert done.ok, done.reason
    names = {
        "held": ["up", "side", "up, least commands"],
        "locked": ["side"],
        "impossible": ["pull, no commands"],
        "unbalanced": ["turn, no forces"],
        "too weak": ["up, no commands"],
        "with margins": ["up", "side", "up, least commands", "up, margin", "side, margin"],
    }
    assert [part.name for part in done.parts] == names[name]
    assert any("hardest" in line for line in done.not_replayed)
    assert (saved(name)["answer"]["verdict"] == "holds") == (name in ("held", "locked", "with margins"))


# --- the loads and the preload -----------------------------------------------------------------------


def renamed(data: dict[str, Any]) -> None:
    data["answer"]["loads"] = {f"{name}?": load for name, load in data["answer"]["loads"].items()}


def swapped(data: dict[str, Any]) -> None:
    data["checks"] = {"up": data["checks"]["side"], "side": data["checks"]["up"]}


def other_load(data: dict[str, Any]) -> None:
    for loads in (data["question"]["loads"], data["answer"]["loads"]):
        loads["up"] = (2 * UP).tolist()


def more_of_it(data: dict[str, Any]) -> None:
    data["answer"]["preload"] = {name: 2 * x for name, x in data["answer"]["preload"].items()}
    data["answer"]["upper"] *= 2


def bounded_above(data: dict[str, Any]) -> None:
    """Of a larger load: true of that, but not of these."""
    other = torques(pinch(), 1.5 * UP)
    data["answer"]["lower"], data["bounding"]["result"] = other.lower, other.to_file()


FAULTS: list[tuple[Callable[[dict[str, Any]], Any], str]] = [
    (lambda d: d["checks"].clear(), "answer: up has no answer"),
    (lambda d: d["checks"].pop("side"), "answer: side has no answer"),
    (lambda d: d["checks"].update(more=d["checks"]["up"]), "checks.more: is not a known field"),
    (lambda d: d["answer"].update(preload=None), "answer: its preload is not of the actuators"),
    (lambda d: d["answer"]["preload"].update(thumb=0.0), "answer: its preload is not of the actuators"),
    (lambda d: d["answer"]["preload"].pop("left"), "answer: its preload is not of the actuators"),
    (more_of_it, "answer: up: the answer is about another preload"),
    (renamed, "answer: loads are not those of the question"),
    (swapped, "answer: up: the answer is about another load"),
    (other_load, "answer: up: the answer is about another load"),
    (bounded_above, "answer: up: the answer is about another load"),
    (lambda d: d["answer"].update(upper=9.0), r"answer: its largest command is 0\.1\d*, not 9"),
    (lambda d: d["answer"].update(lower=1e-6), "answer: the bound 1e-06 is not that of up"),
    (lambda d: d.update(bounding=None), "answer: nothing is there that shows the bound"),
    (lambda d: d["bounding"].update(load="side"), "answer: side: the answer is about another load"),
    (lambda d: d["bounding"].update(load="nobody"), "answer: nobody: the answer is about another load"),
    (lambda d: d["bounding"].update(result=d["checks"]["up"]), "answer: the bound .* is not that of up"),
    (lambda d: d["question"].update(command_limit=0.09), r"answer: its largest command is 0\.1\d*; the limit is 0\.09"),
    (
        lambda d: d["question"].update(actuators=["left"]),
        "answer: up: the answer is not about all commands|its preload",
    ),
    (lambda d: d["question"].update(actuators=["left", "thumb"]), "question"),
    (lambda d: d["question"].update(eta=0.05), "answer: up: the answer is within other limits"),
    (lambda d: d["question"].update(force_limit=50.0), "answer: up: the answer is within other limits"),
    (lambda d: d["question"].update(torque_limits={"left": 9.0}), "answer: up: the answer is within other limits"),
    (
        lambda d: d["question"]["grasp"]["contacts"][0].update(friction=0.4),
        "answer: up: the answer is about another grasp",
    ),
    (lambda d: d["answer"].update(verdict="slips"), "answer: SLIPS without a load that no preload resists"),
    (lambda d: d["answer"].update(verdict="undecided"), "answer: undecided with a preload"),
    (lambda d: d["answer"].update(verdict="maybe"), "answer: maybe with a preload"),
    (lambda d: d["answer"].update(colour="red"), "answer: has other keys than"),
    (lambda d: d["answer"].pop("hardest"), "answer: has other keys than"),
    (lambda d: d["answer"].update(exact=None), "answer: exact is not what"),
    (lambda d: d["answer"].update(residuals=[0.0, 0.0]), "answer: residuals is not what"),
    (lambda d: d["checks"]["up"]["witness"]["r"].__setitem__(1, -9.0), "up: witness: "),
    (lambda d: d.update(colour="red"), "colour: is not a known field"),
    (lambda d: d.update(schema="handfast/hold/2"), "schema: is 'handfast/hold/2'"),
    (lambda d: d["question"].update(loads={}), "question.loads: is empty"),
]


@pytest.mark.parametrize(("change", "why"), FAULTS, ids=range(len(FAULTS)))
@pytest.mark.slow
def test_planted_faults_are_refused(change: Callable[[dict[str, Any]], Any], why: str) -> None:
    data = saved()
    change(data)
    said = reason(data)
    assert re.match(why, said) or ("|" in why and re.search(why, said)), said


# --- senses, and commands that are given ------------------------------------------------------------------


DOWN = Loads(("down",), [[0, 0, -1.0, 0, 0, 0]])
BETWEEN = [Contact([-0.01, 0, 0], [1, 0, 0], 0.5), Contact([0.01, 0, 0], [-1, 0, 0], 0.5)]


def pressed(command: float, backdrivable: bool) -> Grasp:
    """A fixed contact and one that a slide presses: 1 N down is held from commands of 1 N on, and by no pull."""
    joints = [GraspJoint("j", [-1, 0, 0], [0, 0, 0], (1,), "prismatic")]
    mechanism = Mechanism.direct(["j"])
    if backdrivable:  # beside one that is sought, and moves nothing
        joints.append(GraspJoint("k", [0, 0, 1], [0.01, 0, 0], ()))
        mechanism = Mechanism(("j", "k"), np.eye(2), np.zeros((0, 2)), (False, False), backdrivable=(True, False))
    return Grasp(BETWEEN, joints, mechanism, {"j": command} if command else {})


@pytest.mark.parametrize(
    ("good", "bad", "backdrivable", "why"),
    [
        (5.0, 0.1, True, "answer: down: the answer is about other commands of backdrivable actuators"),
        (0.0, -0.1, False, "answer: down: the answer seeks commands in another sense"),
    ],
)
def test_a_proof_about_other_commands_is_none(good: float, bad: float, backdrivable: bool, why: str) -> None:
    holds, slips = (hold(pressed(x, backdrivable), DOWN) for x in (good, bad))
    assert (holds.verdict, slips.verdict) == (Verdict.HOLDS, Verdict.SLIPS)
    assert holds.verify().ok
    assert slips.verify().ok
    assert reason(slips.to_file() | {"question": holds.to_file()["question"]}) == why


def test_a_preload_of_another_sense_is_none() -> None:
    less = Loads(("down",), 0.25 * DOWN.wrenches)
    held, asked = hold(pressed(0.0, False), less).to_file(), hold(pressed(-0.1, False), less).to_file()
    held["bounding"], held["answer"]["lower"] = None, 0
    assert (
        reason(held | {"question": asked["question"]})
        == "answer: its preload has another sense than the grasp's commands"
    )


def test_a_preload_is_held_by_answers_that_hold_alone() -> None:
    """A tenth of the preload that is needed: what is saved of the load is a proof that it slips."""
    data, weak = hold(pressed(0.0, False), DOWN).to_file(), check(pressed(0.1, False), DOWN.wrenches[0])
    assert weak.verify().ok
    data["checks"], data["bounding"] = {"down": weak.to_file()}, None
    data["answer"] |= {"preload": {"j": 0.1}, "upper": 0.1, "lower": 0, "exact": None, "residuals": [None]}
    assert reason(data) == "answer: down is not resisted"


# --- margins ------------------------------------------------------------------------------------------


def of_another_preload(data: dict[str, Any]) -> None:
    more = maximum(pinch().with_commands({name: 2 * x for name, x in data["answer"]["preload"].items()}), UP)
    data["margins"]["up"] = more.to_file()


def above_a_base(data: dict[str, Any]) -> None:
    """More than a load beside the load: true, but no multiple of it."""
    data["margins"]["up"] = maximum(pinch().with_commands(data["answer"]["preload"]), UP, base=0.1 * UP).to_file()


MARGIN_FAULTS: list[tuple[Callable[[dict[str, Any]], Any], str]] = [
    (lambda d: d.pop("margins"), "answer: has other keys than"),
    (lambda d: d["margins"].pop("up"), "answer: has no margin of up, and the least is that of all"),
    (lambda d: d["margins"].update(more=d["margins"]["up"]), "margins.more: is not a known field"),
    (lambda d: d["answer"].update(margin=1.5), "answer: margin is not what"),
    (lambda d: d["answer"]["margins"]["up"].update(lower=1.5), "answer: margins is not what"),
    (lambda d: d["answer"].pop("margin"), "answer: has other keys than"),
    (lambda d: d["margins"].update(up=d["margins"]["side"]), "answer: up: the answer is about another load"),
    (lambda d: d["margins"].update(up=d["checks"]["up"]), "answer: up: the answer does not say how much"),
    (lambda d: d["margins"]["up"]["answer"].update(lower="much"), "answer: lower is 'much', no number|up, margin: "),
    (of_another_preload, "answer: up: its margin is that of another preload"),
    (above_a_base, "answer: up: the answer is about another load"),
]


@pytest.mark.parametrize(("change", "why"), MARGIN_FAULTS, ids=range(len(MARGIN_FAULTS)))
def test_planted_faults_of_margins_are_refused(change: Callable[[dict[str, Any]], Any], why: str) -> None:
    data = saved("with margins")
    change(data)
    said = reason(data)
    assert any(said.startswith(text) for text in why.split("|")), said


def test_what_slips_has_no_margins() -> None:
    data = saved("impossible")
    data["margins"] = {"pull": maximum(pinch(), PULL.wrenches[0]).to_file()}
    assert reason(data) == "answer: has margins of loads without a preload that holds"


# --- answers that say less than what they stand for -----------------------------------------------------


def test_a_check_without_the_dissipation_principle() -> None:
    data, preload = saved(), saved()["answer"]["preload"]
    data["checks"]["up"] = check(pinch().with_commands(preload), UP, mdp=False).to_file()
    data["answer"]["exact"] = all(part["answer"]["exact"] for part in data["checks"].values())
    assert data["checks"]["up"]["answer"]["verdict"] == "holds"
    assert reason(data) == "answer: up: the answer is within other limits, or of another law of friction"


@pytest.mark.parametrize(
    "limits", [GraspLimits(0.02), GraspLimits(force_limit=50.0), GraspLimits(torque_limits={"left": 9.0})]
)
@pytest.mark.parametrize("part", ["checks", "bounding"])
def test_parts_of_other_limits(part: str, limits: GraspLimits) -> None:
    data, preload = saved(), saved()["answer"]["preload"]
    if part == "checks":
        held = check(pinch().with_commands({name: 1.5 * x for name, x in preload.items()}), UP, limits=limits)
        data["checks"]["up"] = held.to_file()
    else:
        bound = torques(pinch(), UP, limits=limits)
        data["bounding"]["result"], data["answer"]["lower"] = bound.to_file(), bound.lower
    assert reason(data) == "answer: up: the answer is within other limits, or of another law of friction"


def test_a_bound_of_the_sum_of_commands() -> None:
    """What bounds the sum of all commands bounds no largest one, whatever its number."""
    data, summed = saved(), torques(pinch(), UP, objective="sum")
    data["bounding"]["result"], data["answer"]["lower"] = summed.to_file(), summed.lower
    assert verify(data["bounding"]["result"]).ok
    assert re.fullmatch(r"answer: the bound \S+ is not that of up", reason(data))


def test_a_bound_above_the_command() -> None:
    data = saved()
    data["bounding"]["result"]["answer"]["lower"] = data["answer"]["lower"] = 0.2
    assert re.fullmatch(r"answer: the bound 0\.2 is above the command 0\.1\d*", reason(data))


def test_a_command_limit_that_is_just_kept() -> None:
    data = saved()
    data["question"] |= {"command_limit": data["answer"]["upper"], "loading": None}  # null is as good as left out
    assert verify(data).ok


def test_a_preload_of_more_than_one_grasp() -> None:
    data, preload = saved(), saved()["answer"]["preload"]
    rough = check(pinch(mu=0.9).with_commands(preload), UP)
    assert rough.verdict is Verdict.HOLDS
    data["checks"]["up"] = rough.to_file()
    assert "up: the answer is about another grasp" in reason(data)


# --- loads that no preload holds ------------------------------------------------------------------------


def test_locked_motors_do_not_show_that_no_commands_hold() -> None:
    """Of two jaws that can squeeze: locked, of one jaw, or within limits that nobody asked for, they drop it."""
    bare = pinch().with_preload(None)
    data = json.loads(json.dumps(hold(bare, Loads(("up",), UP[None])).to_file()))
    assert verify(data).ok
    data |= {"checks": {}, "bounding": None}
    data["answer"] |= {"verdict": "slips", "preload": None, "lower": None, "upper": None} | {
        "exact": None,
        "residuals": [],
    }
    for answer, why in (
        (check(bare, UP), "answer: up: the answer is not about all commands that were sought"),
        (torques(bare, UP, limits=GraspLimits(force_limit=1e-3)), "answer: up: the answer is within other limits"),
        (torques(bare, 2 * UP, limits=GraspLimits(force_limit=1e-3)), "answer: up: the answer is about another load"),
        (torques(bare, UP), "answer: up: the answer does not say that it slips"),
    ):
        data["refuted"] = {"load": "up", "result": answer.to_file()}
        assert reason(data).startswith(why)
    data["refuted"] = {"load": "up", "result": None}
    assert reason(data) == "up, no forces: forces at the contacts may balance it"
    data["refuted"] = {"load": "nobody", "result": None}
    assert reason(data) == "answer: 'nobody' is none of its loads"


def test_a_load_that_slips_beside_a_preload() -> None:
    data = saved("impossible")
    data["answer"] |= {"preload": {}}
    assert reason(data) == "answer: SLIPS with a preload"
    data = saved("impossible")
    data["bounding"] = data["refuted"]
    assert "SLIPS without a load that no preload resists, or with a preload" in reason(data)


def test_a_command_limit_that_more_is_needed_than() -> None:
    data = saved("too weak")
    data["question"]["command_limit"] = 0.2
    assert reason(data) == "answer: up: the answer does not say that it slips"


def test_loads_that_no_forces_balance_up_to_a_cap(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three points of a line, but for rounding: a torque about it would need motions of 10^13 N. The claim says so."""
    line = np.array([1, 2, 3]) / np.sqrt(14)
    normal = np.array([2, -1, 0]) / np.sqrt(5)
    contacts = [
        {"position": (x * line).tolist(), "normal": (sign * normal).tolist(), "friction": 0.5}
        for x, sign in ((0.01, 1), (0.03, -1), (0.07, 1))
    ]
    grasp = {"schema": "handfast/grasp/1", "contacts": contacts}
    q = read_question({"grasp": grasp, "goal": "torques", "wrench": [0, 0, 0, *line]}, "")
    saved = holds.SavedHold(q, {"turn": q.wrench}, np.inf, {}, {}, None, ("turn", None), {})
    done = holds._unbalanced(saved, "turn")
    assert done.ok
    assert re.fullmatch(
        r"no forces .* balance turn and what acts on the joints, up to virtual motions of \d\.\d+e\+16 N", done.claim
    )
    monkeypatch.setattr(holds.answers, "COMPLETE_CAP", 1e20)
    assert "it is proved for motions up to" in holds._unbalanced(saved, "turn").reason


# --- what a file claims, without its parts ----------------------------------------------------------------

TWO = {"a": np.array([1.0, 0, 0, 0, 0, 0]), "b": np.array([0, 1.0, 0, 0, 0, 0])}


def bare(goal: str = TORQUES, wrench: Any = (0,) * 6, **more: Any) -> Question:
    contacts = [{"position": [x, 0, 0], "normal": [-x, 0, 0], "friction": 0.5} for x in (1.0, -1.0)]
    grasp = {"schema": "handfast/grasp/1", "contacts": contacts}
    return read_question({"grasp": grasp, "goal": goal, "wrench": list(wrench)} | more, "")


def claims(said: dict[str, Any], loads: Any = TWO, **more: Any) -> holds.SavedHold:
    every = dict.fromkeys(holds.HOLD_KEYS) | {"loads": {name: w.tolist() for name, w in loads.items()}} | said
    given: dict[str, Any] = {"bounding": None, "refuted": None} | more
    return holds.SavedHold(bare(), loads, np.inf, every, {}, margins={}, **given)


@cache
def pulled() -> SavedAnswer:
    return read_answer(json.loads(json.dumps(check(nest(), PULL.wrenches[0]).to_file())))


def test_what_is_undecided_claims_nothing() -> None:
    undecided = {"verdict": "undecided", "lower": 0}
    done = holds.replay(claims(undecided))
    assert (done.ok, done.claim) == (True, "")
    for more, verdict in (({"preload": {}}, "undecided"), ({"upper": 1.0}, "UNDECIDED"), ({"verdict": "?"}, "?")):
        assert holds.replay(claims(undecided | more)).reason == f"answer: {verdict} with a preload"
    held = replace(claims(undecided), checks={"a": pulled()})
    assert holds.replay(held).reason == "answer: undecided with a preload"


@pytest.mark.parametrize(
    ("place", "value", "field"),
    [
        ("schema", "?", "here.schema"),
        ("question", {}, "here.question.loads"),
        ("answer", {}, "here.answer.query"),
        ("checks", {"up": {}}, "here.checks.up.schema"),
        ("bounding", {"load": "up", "result": {}}, "here.bounding.result.schema"),
        ("refuted", {"load": "up", "more": 1}, "here.refuted.more"),
        ("margins", {"up": {}}, "here.margins.up.schema"),
        ("margins", {"more": {}}, "here.margins.more"),
        ("more", 1, "here.more"),
    ],
)
def test_faults_are_named_by_their_place(place: str, value: Any, field: str) -> None:
    with pytest.raises(BadFile) as fault:
        holds.read_hold(saved() | {place: value}, "here")
    assert fault.value.field == field


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("verdict", (3, None, {})),
        ("stop", ([1], {}, False, 3, None, "x")),
        ("hardest", ([1], {}, False, 3)),
        ("nodes", ("x", [1], {}, False, -1, 1.5, None)),
        ("seconds", ("x", [1], {}, False, -0.1, None)),
        ("lower", ("x", [1], {}, False)),
        ("upper", ("x", [1], {}, True)),
        ("preload", ("x", [1], 3, {"left": "1.0"}, {"left": [1]}, {"left": None}, {"left": True})),
    ],
)
def test_what_no_answer_says_under_a_key(key: str, values: tuple[Any, ...]) -> None:
    """Of the bound of the largest command, which is compared with it, too."""
    for value in values:
        data = saved()
        data["answer"][key] = value
        with pytest.raises(BadFile, match=rf"^answer\.{key}(\.left)?: is "):
            verify(data)


def test_what_an_answer_need_not_say_is_null() -> None:
    data = saved("impossible")
    assert [data["answer"][key] for key in ("preload", "upper")] == [None, None]
    assert verify(data | {"answer": data["answer"] | {"hardest": None}}).ok


def test_what_a_file_about_paths_says() -> None:
    undecided = {"verdict": "undecided", "lower": 0}
    assert holds.replay(claims(undecided, along=True)).reason.startswith("answer: has other keys than schema, query,")
    other = claims(undecided | {"loading": "together"}, along=True)
    assert holds.replay(other).reason == "answer: loading is not what the rest of the file shows"
    assert holds.replay(claims(undecided | {"loading": LOADING}, along=True)).ok
    for path, words in ((False, ""), (True, " on paths")):
        done = holds.replay(claims({"verdict": "holds", "lower": 0.5}, along=path))
        assert done.reason == f"answer: nothing is there that shows the bound 0.5{words}"
        assert done.claim == f"one preload holds 2 loads{', on the path of each' if path else ''}"


def test_what_a_file_says_slips() -> None:
    together = "what no commands resist together with the load is not shown of its path"
    done = holds.replay(claims({"verdict": "slips"}, refuted=("b", pulled()), along=True))
    assert (done.reason, done.claim) == (f"answer: b: {together}", "no preload holds b")
    assert holds.replay(claims({"verdict": "slips"})).claim == "no preload holds some load"
    limited = replace(claims({"verdict": "slips"}), command_limit=0.5)
    assert holds.replay(limited).claim == "no preload holds some load with commands up to 0.5"


def test_no_commands_at_all_are_a_preload() -> None:
    assert holds._held(claims({"preload": {}, "upper": 0.0}, {})) is None
    with pytest.raises(Refused, match=r"^its largest command is 0, not 1\.0$"):
        holds._held(claims({"preload": {}, "upper": 1.0}, {}))


@pytest.mark.parametrize("axis", range(6))
def test_margins_are_of_the_load_alone(axis: int) -> None:
    """Beside a base whose only part is one of six the largest multiple is another's."""
    direction = {"direction": TWO["b"].tolist()}
    for base in (np.zeros(6), np.eye(6)[axis]):
        answer = SavedAnswer(bare(LARGEST_GOAL, base, **direction), {"query": "max"}, None, None)
        if not base.any():
            assert holds._same_question(claims({}), "b", answer) is None
            continue
        with pytest.raises(Refused, match=r"^b: the answer is about another load$"):
            holds._same_question(claims({}), "b", answer)


def test_margins_are_the_least_that_is_shown() -> None:
    """A load that holds has a margin of 1 at least; one that any size of is held, none."""
    some = {"lower": 3.0, "upper": 4.0, "unbounded": False}
    assert holds.margins_json({"a": some})["margin"] == 3
    assert holds.margins_json({"a": some | {"lower": 0.5}})["margin"] == 1
    endless = {"lower": 1000.0, "upper": None, "unbounded": True}
    assert holds.margins_json({"a": endless})["margin"] is None
    assert holds.margins_json({"a": endless, "b": some})["margin"] == 3


def test_a_load_that_is_shown_little_farther_has_no_margin_of_any_size() -> None:
    """Unbounded is told beside commands, which may be small: a foot at rest that 1/1000 N presses, its load of 1 N."""
    assert holds.margins_json({"a": {"lower": 1.1, "upper": None, "unbounded": True}})["margin"] == 1.1
    assert [holds.grown(x, True) for x in (0.9, 999.0, 1000 * (1 - 1e-10))] == [1, 999, np.inf]
    margin = one_answer(jaws(1.0, 2.0, LARGEST_GOAL, wrench=[0] * 6, direction=TWO["a"].tolist()), query="max")
    for unbounded, told in ((True, (answers.UNBOUNDED_CLAIM,)), (False, ())):
        of = replace(margin, said=margin.said | {"unbounded": unbounded})
        assert holds.replay(of_jaws({}, margins={"a": of})).not_replayed == (*told, holds.HOLD_NOT_REPLAYED)


def test_what_holds_says_of_no_load_that_it_slips() -> None:
    data = saved()
    data["refuted"] = {"load": "up", "result": saved("too weak")["refuted"]["result"]}
    assert reason(data) == "answer: says of a load that no preload holds it, and is no SLIPS"
    data["refuted"] = {"load": "of another name"}
    assert reason(data) == "answer: says of a load that no preload holds it, and is no SLIPS"


def test_loads_are_numbers() -> None:
    data = saved()
    assert data["answer"]["loads"]["up"][:2] == [0, 1]
    data["answer"]["loads"]["up"][:2] = [False, True]
    assert reason(data) == "answer: loads are not those of the question"


# --- files without any answer ------------------------------------------------------------------------------


def small(**more: Any) -> dict[str, Any]:
    """Of two contacts that nothing moves, and one load."""
    contacts = [{"position": [x, 0, 0], "normal": [-x, 0, 0], "friction": 0.5} for x in (1.0, -1.0)]
    asked = {"grasp": {"schema": "handfast/grasp/1", "contacts": contacts}, "loads": {"a": TWO["a"].tolist()}}
    asked |= {"eta": 0.0, "torque_limits": {}, "force_limit": None, "actuators": []} | more
    return {"schema": "handfast/hold/1", "question": asked, "answer": {"query": "hold"}, "checks": {}}


def test_what_is_asked_of_a_file() -> None:
    plain = holds.read_hold(small(), "here")
    assert (plain.along, plain.command_limit, plain.question.goal) == (False, np.inf, TORQUES)
    assert (plain.bounding, plain.refuted, plain.checks, plain.margins) == (None, None, {}, {})
    assert plain.question.wrench.tolist() == plain.loads["a"].tolist() == TWO["a"].tolist()
    path = holds.read_hold(small(loading=LOADING, command_limit=2.5), "here")
    assert (path.along, path.command_limit) == (True, 2.5)


@pytest.mark.parametrize(
    ("more", "checks", "fault"),
    [
        ({"loading": "together"}, {}, "here.question.loading: is 'together'; 'preload-first' is needed"),
        ({}, {}, "here.answer.query: is 'max'; 'hold' is needed"),
        ({"more": 1}, {}, "here.question.more: is not a known field; leave it out"),
        ({"command_limit": -1}, {}, "here.question.command_limit: is -1; 0 or more is needed"),
        ({}, {"schema": "?"}, "here.checks.a.schema: is '?'; 'handfast/result/1' is needed"),
        ({"loading": LOADING}, {"schema": "?"}, "here.checks.a.schema: is '?'; 'handfast/path/1' is needed"),
    ],
)
def test_what_no_file_asks(more: dict[str, Any], checks: dict[str, Any], fault: str) -> None:
    data = small(**more) | {"checks": {"a": checks} if checks else {}}
    if fault.startswith("here.answer"):
        data["answer"]["query"] = "max"
    with pytest.raises(BadFile, match=f"^{re.escape(fault)}$"):
        holds.read_hold(data, "here")


def jaws(left: float, right: float, goal: str = "check", **more: Any) -> Question:
    """Two slides, each with a motor and its command."""
    contacts = [{"position": [x, 0, 0], "normal": [-x, 0, 0], "friction": 0.5} for x in (1.0, -1.0)]
    joints = [
        {"name": name, "type": "prismatic", "axis": [-x, 0, 0], "origin": [0, 0, 0], "moves": [k]}
        for k, (name, x) in enumerate((("left", 1.0), ("right", -1.0)))
    ]
    grasp = {"schema": "handfast/grasp/1", "contacts": contacts, "joints": joints}
    grasp |= {"preload": {"left": left, "right": right}}
    return read_question({"grasp": grasp, "goal": goal, "wrench": TWO["a"].tolist()} | more, "")


def one_answer(q: Question, **said: Any) -> SavedAnswer:
    return SavedAnswer(q, {"query": "check", "verdict": "holds"} | said, None, None)


def of_jaws(said: dict[str, Any], **parts: Any) -> holds.SavedHold:
    asked = jaws(1.0, 2.0, TORQUES, driven=["left", "right"])
    return replace(
        claims({"verdict": "holds", "preload": {"left": 1.0, "right": 2.0}} | said, TWO), question=asked, **parts
    )


@pytest.mark.parametrize(("left", "right"), [(1.5, 2.0), (1.0, 2.5)])
def test_each_command_of_a_preload_counts(left: float, right: float) -> None:
    """Of two, one is that of the preload."""
    own, other = one_answer(jaws(1.0, 2.0)), one_answer(jaws(left, right))
    one = of_jaws({"upper": 2.0}, loads={"a": TWO["a"]})
    assert holds._held(replace(one, checks={"a": own})) is None
    with pytest.raises(Refused, match=r"^a: the answer is about another preload$"):
        holds._held(replace(one, checks={"a": other}))
    along = {"direction": TWO["a"].tolist(), "wrench": [0] * 6}
    most, less = (one_answer(jaws(*x, LARGEST_GOAL, **along), query="max") for x in ((1.0, 2.0), (left, right)))
    assert [part.name for part in holds._margins(replace(one, margins={"a": most}))] == ["a, margin"]
    with pytest.raises(Refused, match=r"^a: its margin is that of another preload$"):
        holds._margins(replace(one, margins={"a": less}))


def test_what_slips_has_no_margin() -> None:
    along = {"direction": TWO["a"].tolist(), "wrench": [0] * 6}
    none = one_answer(jaws(1.0, 2.0, LARGEST_GOAL, **along), query="max", verdict="slips")
    with pytest.raises(Refused, match=r"^a: the answer does not say how much of it is resisted$"):
        holds._margins(of_jaws({}, margins={"a": none}))


def test_a_bound_may_be_the_command_itself() -> None:
    least = one_answer(jaws(1.0, 2.0, TORQUES, driven=["right", "left"]), query="torques", lower=2.0)
    for upper in (2.0, None):
        (part,) = holds._bounding(of_jaws({"lower": 2.0, "upper": upper}, bounding=("a", least)))
        assert part.name == "a, least commands"
    with pytest.raises(Refused, match=r"^the bound 2 is above the command 1\.99$"):
        holds._bounding(of_jaws({"lower": 2.0, "upper": 1.99}, bounding=("a", least)))


def test_a_bound_is_a_number() -> None:
    least = one_answer(jaws(1.0, 2.0, TORQUES, driven=["right", "left"]), query="torques", lower=None)
    with pytest.raises(Refused, match=r"^has no lower bound, of 0 where nothing is shown$"):
        holds._bounding(of_jaws({"lower": None, "upper": 2.0}, bounding=("a", least)))


def test_parts_are_replayed_as_what_they_are() -> None:
    none = holds.replay(claims({"verdict": "undecided", "lower": 0}))
    assert (none.name, none.not_replayed) == ("hold", (holds.HOLD_NOT_REPLAYED,))
    path = SavedPath(bare("check"), {"schema": "handfast/path/1", "query": "check", "verdict": "holds"}, None, None)
    found = holds._replayed(path, "a")
    assert (found.name, found.not_replayed) == ("a", (OTHER_PATHS, ANSWER_NOT_REPLAYED))


def test_a_step_from_another_state_is_no_answer_about_a_preload() -> None:
    """Contacts that were pressed before may hold what the preload does not."""
    own = one_answer(jaws(1.0, 2.0))
    g = own.question.grasp
    start = StartData(np.full(g.m, -200.0), np.zeros(g.l), np.zeros(g.a))
    pressed = replace(own, question=replace(own.question, grasp=g.with_start(start)))
    one = of_jaws({"upper": 2.0}, loads={"a": TWO["a"]})
    assert holds._held(replace(one, checks={"a": own})) is None
    with pytest.raises(Refused, match=r"^a: the answer is about a step from another state, not from rest$"):
        holds._held(replace(one, checks={"a": pressed}))


@pytest.mark.parametrize("driven", [["left"], []])
def test_what_shows_a_bound_seeks_all_commands(driven: list[str]) -> None:
    some = one_answer(jaws(1.0, 2.0, TORQUES, driven=driven), query="torques", lower=2.0, verdict="slips")
    for of, parts in ((holds._bounding, {"bounding": ("a", some)}), (holds._refuted, {"refuted": ("a", some)})):
        with pytest.raises(Refused, match=r"^a: the answer is not about all commands that were sought$"):
            of(of_jaws({"lower": 2.0}, **parts))


@pytest.mark.parametrize(
    ("limit", "verdict", "objective", "shown"),
    [
        (2.0, "undecided", "max", False),
        (1.9, "undecided", "max", True),
        (2.0, "slips", "max", True),
        (1.9, "undecided", "sum", False),  # of both, each of which may be 1
        (2.0, "slips", "sum", True),
    ],
)
def test_more_than_the_limit_is_needed_where_no_commands_within_it_hold(
    limit: float, verdict: str, objective: str, shown: bool
) -> None:
    asked = jaws(1.0, 2.0, TORQUES, driven=["left", "right"], objective=objective)
    least = one_answer(asked, query="torques", lower=2.0, verdict=verdict)
    saved = of_jaws({}, refuted=("a", least), command_limit=limit)
    if shown:
        assert [part.name for part in holds._refuted(saved)] == ["a, no commands"]
        return
    with pytest.raises(Refused, match=r"^a: the answer does not say that it slips$"):
        holds._refuted(saved)


@pytest.mark.parametrize(("cap", "refused"), [(None, False), (19e3, True), (21e3, False)])
def test_bounds_of_the_commands_reach_far(cap: float | None, refused: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """10^4 times the largest force in play, 2 N of the commands, whatever verdict and course they were found with."""
    asked = jaws(1.0, 2.0, TORQUES, driven=["left", "right"])
    least = one_answer(asked, query="torques", lower=2.0, verdict="undecided", stop="numerical")
    assert 2 * in_play(asked, 0.0) == pytest.approx(in_play(asked, 2.0)) == pytest.approx(2.0)
    part = Replay("certificate", "", "", {"motion_cap": cap})
    monkeypatch.setattr(holds.answers, "replay", lambda answer: Replay("torques", "", "", parts=(part,)))
    for shown, saved in (
        (holds._refuted, of_jaws({}, refuted=("a", least), command_limit=1.9)),
        (holds._bounding, of_jaws({"lower": 2.0, "upper": 2.0}, bounding=("a", least))),
    ):
        if refused:
            with pytest.raises(
                Refused, match=r"^a: it is proved for motions up to .* N only, not 10000 times the forces"
            ):
                shown(saved)
        else:
            assert shown(saved)[0].ok


def test_forces_that_balance_a_load_may_be_of_any_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def verified(c: Certificate) -> SimpleNamespace:
        asked.append((c.scalar, c.question.wrench.tolist()))
        return SimpleNamespace(reason="", cap=None)

    monkeypatch.setattr(holds.checker, "verify", verified)
    assert holds._unbalanced(of_jaws({}), "b").ok
    assert asked == [((0.0, np.inf), TWO["b"].tolist())]


def test_commands_that_are_not_sought_are_none() -> None:
    """The grasp has one for the right jaw, which is locked where it is not sought."""
    one = replace(of_jaws({"preload": {"left": 1.0}}), question=jaws(1.0, 2.0, TORQUES, driven=["left"]))
    assert holds._command(one).tolist() == [1, 0]


def test_a_bound_that_is_not_there_is_none() -> None:
    most = one_answer(jaws(1.0, 2.0), query="max", lower=None, upper=None)
    assert holds._bounds(most) == {"lower": 0.0, "upper": None, "unbounded": False}
    assert holds._bounds(replace(most, said=most.said | {"lower": 0.5, "upper": 2.0, "unbounded": True})) == {
        "lower": 0.5,
        "upper": 2.0,
        "unbounded": True,
    }
