"""Paths of a load: what the checker asks of the steps and of the answer, beside the proofs of the states.

A jaw on a slide presses an object against a wall with 1 N; friction is 0.5. Across, both sides hold 1 N. Pushed back
and across alike, the jaw holds 2/3 N. Of what is sought, the jaw needs 0.6 N to hold 0.6 N across.
"""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.proofs import path_commands, path_steps
from handfast.proofs.answers import ANSWER_NOT_REPLAYED, COURSE_KEYS, UNBOUNDED_CLAIM, UNPROVED_STATE
from handfast.proofs.existence import Proved
from handfast.proofs.fields import BadFile
from handfast.proofs.grasp import StartData
from handfast.proofs.path_steps import SavedPath, Step, is_scale_free, near_enough, read_path, replay
from handfast.proofs.question import Question, read_question
from handfast.proofs.replay import Refused, Replay, down
from handfast.proofs.states import Problem
from handfast.proofs.tolerance import load_scale
from handfast.stability.problem.grasp_data import grasp_data
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check, maximum, torques

Data = dict[str, Any]
Change = Callable[[Data], Any]
FIRST = "preload-first"


def jaw(friction: float = 0.5, command: float = 1.0) -> Grasp:
    contacts = [Contact((-1, 0, 0), (1, 0, 0), friction), Contact((1, 0, 0), (-1, 0, 0), friction)]
    slide = GraspJoint("jaw", (1, 0, 0), (-1, 0, 0), (0,), "prismatic")
    return Grasp(contacts, [slide], None, {"jaw": command} if command else {}, "jaw")


ASKED = {
    "across": lambda: check(jaw(), [0, 0.5, 0], loading=FIRST),
    "back": lambda: check(jaw(), [-0.8, 0.8, 0], loading=FIRST),
    "most": lambda: maximum(jaw(), [-1, 1, 0], loading=FIRST, settings=Settings(gap=1e-2)),
    "endless": lambda: maximum(jaw(), [1, 0, 0], loading=FIRST),
    "sought": lambda: torques(jaw(), [0, 0.6, 0], loading=FIRST, settings=Settings(gap=1e-2)),
    "none": lambda: torques(jaw(0.0), [0, 0.6, 0], loading=FIRST),
}


@cache
def _saved(name: str) -> str:
    return json.dumps(ASKED[name]().to_file())


def saved(name: str, *changes: Change) -> Data:
    data: Data = json.loads(_saved(name))
    for change in changes:
        change(data)
    return data


def fault(name: str, *changes: Change) -> str:
    return replay(read_path(saved(name, *changes))).fault


def said(**values: Any) -> Change:
    return lambda data: data["answer"].update(values)


def step(k: int, **values: Any) -> Change:
    return lambda data: data["steps"][k].update(values)


def larger(data: Data) -> None:
    """The whole load is 1/1.25 of what it was: each step is of 1.25 times more of it, and the last ones beyond it."""
    data["question"]["wrench"] = [x / 1.25 for x in data["question"]["wrench"]]
    for one in data["steps"]:
        one["magnitude"] *= 1.25


def start(name: str, k: int, by: float) -> Change:
    def change(data: Data) -> None:
        data["steps"][1]["from"][name][k] += by

    return change


def swapped(data: Data) -> None:
    one, other = data["steps"][2:4]
    one["from"], other["from"] = other["from"], one["from"]


def halved(data: Data) -> None:
    """The question and all witnesses speak of half of the load."""
    for part in (data["question"], *(one["witness"] for one in data["steps"])):
        part["wrench"] = [x / 2 for x in part["wrench"]]


def with_certificate(data: Data) -> None:
    data["steps"][-1]["certificate"] = copy.deepcopy(saved("back")["steps"][-1]["certificate"])


def without_bound(data: Data) -> None:
    data["bound"] = None
    data["answer"]["certified"] = False


@pytest.mark.parametrize("name", ASKED)
def test_what_is_answered_is_proved(name: str) -> None:
    assert fault(name) == ""


def test_claims_of_steps_by_hand() -> None:
    done = replay(read_path(saved("across")))
    assert done.name == "check"
    first, second = done.parts
    assert (first.name, second.name) == ("step 0", "step 1")
    # the jaw closes by 2 N: its contact and the wall's give way by 1 N each; from there nothing moves
    assert first.claim == "the commands alone are in balance, with virtual motions of 2 N"
    assert second.claim.startswith("1 times the load is resisted from the state before, with virtual motions of")
    assert saved("across")["answer"]["motion"] == pytest.approx(2.0)
    *_, last = replay(read_path(saved("back"))).parts
    at, before = (saved("back")["steps"][k]["magnitude"] for k in (-1, -2))
    assert before <= 2 / 3 / 0.8 <= at
    assert last.claim.startswith(f"{at:.6g} times the load is not resisted from the state at {before:.6g} times")
    bound = replay(read_path(saved("sought"))).part("bound")
    assert bound is not None
    lower = saved("sought")["answer"]["lower"]
    assert 0.59 < lower <= 0.6
    assert f"hold the load on a path below {down(lower)}, with forces and motions up to" in bound.claim
    assert bound.figures == {"leaves": len(saved("sought")["bound"]["leaves"]), "lower": lower}


REFUSED = {
    "as large": ("across", (step(1, magnitude=0.0),), "step 1: its load is not larger than the one before$"),
    "from rest": ("across", (lambda data: data["steps"][1].pop("from"),), "step 1: does not say where it starts from$"),
    "presses more": ("across", (start("gaps", 1, -1e-6),), "step 1: its gaps are not those to which the state before"),
    "off a stop": ("across", (start("stops", 0, 1.0),), "step 1: its stops are not those to which the state before"),
    "slack": ("across", (start("slack", 0, 1.0),), "step 1: its slack are not those to which the state before came$"),
    "skipped": ("back", (lambda data: data["steps"].pop(2),), "step 2: its gaps are not those"),
    "swapped": ("back", (swapped,), "step 2: its gaps are not those"),
    "halved": ("across", (halved,), "step 1: .*missed"),
    "of less": ("back", (step(-1, magnitude=0.82),), "certificate: leaf .* is not proved"),
    "not refuted": (
        "back",
        (step(-1, certificate=None),),
        "step 5: has neither a witness nor, as the",
    ),
    "not from rest": ("across", (lambda d: d["steps"][0].update({"from": d["steps"][1]["from"]}),), "step 0: is not"),
    "at once": ("across", (step(0, magnitude=0.5),), "step 0: is not of the commands alone, from rest$"),
    "both": ("across", (with_certificate,), "step 1: has a witness and a certificate$"),
    "neither": ("across", (step(1, witness=None),), "step 1: has neither a witness nor, as the last one, a cert"),
    "half way": ("across", (said(verdict="holds"), lambda data: data["steps"].pop()), "HOLDS, but the whole load"),
    "with an end": ("back", (said(verdict="holds"),), "HOLDS, but the whole load is not reached$"),
    "no end": ("across", (said(verdict="slips"),), "SLIPS, but no step of the load is shown to have no state$"),
    "beyond": ("back", (larger,), "SLIPS, but no step of the load is shown to have no state$"),
    "open": ("back", (said(verdict="undecided"),), "UNDECIDED with a certificate$"),
    "slips at": ("back", (said(slips_at=0.8),), "slips_at"),
    "reached": ("back", (said(reached=0.9),), "reached"),
    "exact": ("across", (said(exact=False),), "exact"),
    "motion": ("across", (said(motion=1.0),), "motion"),
    "cap": ("back", (said(motion_cap=1.0),), "motion_cap"),
    "count": ("back", (said(steps=3),), "steps"),
    "certified": ("across", (said(certified=True),), "certified"),
    "loaded": ("across", (lambda d: d["steps"][1]["witness"].update(wrench=[0, 0.4, 0, 0, 0, 0]),), "another load"),
    "commanded": ("across", (lambda d: d["steps"][1]["witness"].update(command={"jaw": 1.1}),), "other commands"),
    "more": ("most", (said(lower=0.7),), "lower"),
    "less above": ("most", (said(upper=0.6),), "upper"),
    "gap": ("most", (said(gap=1e-9),), "gap"),
    "never": ("most", (said(verdict="slips"),), "SLIPS is not what its steps show$"),
    "no limit": ("most", (said(unbounded=True),), "unbounded, but its path ends$"),
    "not far": ("endless", (lambda data: data["steps"].pop(),), "unbounded, but its path ends$"),
    "a limit": ("endless", (said(unbounded=False),), "gap|unbounded"),
    "lowest": ("sought", (said(lower=0.61),), "its cases show .* the answer says 0.61$"),
    "no bound": ("sought", (without_bound,), r"a lower bound of 0\.59\d*; 0 is shown$"),
    "costs": ("sought", (said(upper=0.5),), "upper"),
    "no path": ("sought", (lambda data: data["steps"].pop(),), "HOLDS, but the whole load is not reached$"),
    "below 0": ("sought", (said(lower=-0.1),), "a lower bound of -0.1; "),
    "not known": ("sought", (said(lower=None),), "a lower bound of None; "),
    "undecided": ("sought", (said(verdict="undecided"),), "UNDECIDED with commands, or with a path$"),
    "no proof": ("none", (without_bound,), "SLIPS, but it is not shown that no commands hold the load$"),
    "sought none": ("none", (said(verdict="undecided", lower=None), without_bound), "a lower bound of None; 0 is"),
    "sought less": ("none", (said(verdict="undecided", lower=1.0), without_bound), "a lower bound of 1.0; 0 is shown$"),
}


@pytest.mark.parametrize(("name", "changes", "reason"), REFUSED.values(), ids=REFUSED)
def test_what_is_said_otherwise_is_refused(name: str, changes: tuple[Change, ...], reason: str) -> None:
    why = fault(name, *changes)
    assert re.search(reason, why), why


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda data: data["question"].update(mdp=False), "^question: is no check from rest with the dissipation"),
        (lambda data: data["question"].update(wrench=[0.0]), r"^question\.wrench"),
        (said(loading="together"), r"^answer\.loading"),
        (said(query="weights"), r"^answer\.query"),
        (lambda data: data.update(more=1), "more"),
        (step(1, more=1), r"^steps\[1\].*more"),
        (step(1, magnitude=-0.5), r"^steps\[1\]\.magnitude: is -0.5; 0 or more is needed"),
        (lambda data: data["steps"][1]["from"].update(slack=[-1.0]), r"^steps\[1\]\.from\.slack: has a negative"),
    ],
)
def test_what_no_path_says(change: Change, why: str) -> None:
    with pytest.raises(BadFile, match=why):
        fault("across", change)


def test_a_bound_says_nothing_of_paths_that_move_farther(monkeypatch: pytest.MonkeyPatch) -> None:
    path = read_path(saved("sought"))
    assert path.reached == 1.0
    assert replace(path, steps=()).reached == -np.inf
    monkeypatch.setattr(path_commands, "STATE_REACH", 1.0)  # motions are more than the load of 0.6 N, and the command
    assert re.search(
        r"its path has forces or motions of [12].\d* N, of which its bound says nothing$", replay(path).fault
    )


def test_many_steps_do_not_drift_away() -> None:
    """The jaw presses with 1 N and carries 1 N across. 40 steps of 4e-7 more would let 1.00001 N of it be held."""
    grasp = Grasp(
        [Contact([-1, 0, 0], [1, 0, 0], 0.5, "a"), Contact([1, 0, 0], [-1, 0, 0], 0.5, "b")],
        [GraspJoint("jaw", [1, 0, 0], [0, 0, 0], (0,), "prismatic")],
        preload={"jaw": 1.0},
    )
    data = json.loads(json.dumps(check(grasp, [0, 0, -0.5], loading=FIRST).to_file()))
    steps, pressed, count = [data["steps"][0]], 1.0, 40
    steps[0]["witness"] |= {"r": [1.0, 0, 0, 0, 0, 0], "q": [2.0], "c": [1.0, 0, 0, 1.0, 0, 0], "f": [1.0]}
    for k in range(1, count + 1):
        start = {"gaps": [-pressed, -pressed], "stops": [0.0], "slack": [0.0]}
        pressed, across = pressed * (1 + 4e-7), 0.25 * k / count
        state = {"wrench": [0, 0, -2 * across, 0, 0, 0], "command": {"jaw": 1.0}, "r": [0.0] * 6, "q": [0.0]}
        state |= {"c": [pressed, across, 0, pressed, -across, 0], "f": [pressed], "coupling": []}
        steps.append({"magnitude": k / count, "from": start, "witness": state, "certificate": None})
    reasons = [part.reason for part in replay(read_path(data | {"steps": steps})).parts]
    assert reasons[:9] == [""] * 9  # 1e-5 of the load of 0.5 N are twelve of the step's 4e-7 N, with what boxes add
    assert re.match(r"all steps together go on from numbers .* N from the states that are proved$", reasons[-1])


def test_without_a_load_a_start_is_as_near_as_rounding() -> None:
    """The scale is that of the command, 10^6 N: 1e-9 of it would be 1e-3 of the load of 1 N that comes next."""
    data = json.loads(json.dumps(check(jaw(command=1e6), [0, 1.0, 0], loading=FIRST).to_file()))
    gaps = data["steps"][1]["from"]["gaps"]
    assert replay(read_path(data)).ok
    gaps[0] += 1e-6  # roundings of what is 10^6 are less
    assert "step 1: its gaps are not those to which the state before came" in replay(read_path(data)).reason
    first, second = (load_scale(s.question.grasp, s.question.wrench) for s in read_path(data).steps[:2])
    assert first == pytest.approx(1e6)
    assert second <= 1.0


@pytest.mark.parametrize(
    ("stop", "ratio", "factor"), [("", 1e6, 1), ("lower", 1e6, 1e6), ("both", 4.0, 4), ("lower", 0.1, 1)]
)
def test_a_stop_counts_by_what_couplings_move(stop: str, ratio: float, factor: float) -> None:
    """A joint that moves no contact, with a jaw that goes `ratio` times as far."""
    contacts = [Contact([x, 0, 0], [-x, 0, 0], 0.5) for x in (-1.0, 1.0)]
    joints = [
        GraspJoint("jaw", [1, 0, 0], [0, 0, 0], (0,), "prismatic"),
        GraspJoint("s", [1, 0, 0], [0, 0, 0], (), "prismatic", stop=stop),
    ]
    mechanism = Mechanism((), np.zeros((0, 2)), np.array([[1.0, -ratio]]), ())
    g = grasp_data(Grasp(contacts, joints, mechanism))
    assert path_steps.leverage(g) == pytest.approx(factor)
    found = SimpleNamespace(radius=2.0, exact=False, residual=0.5)
    p = SimpleNamespace(grasp=g, scale=3.0)
    assert path_steps.off_by(p, found) == pytest.approx(2 * factor + 1.5)
    found.exact = True
    assert path_steps.off_by(p, found) == pytest.approx(2 * factor)


def test_only_the_load_alone_may_be_scaled() -> None:
    driven, alone = (read_path(check(jaw(command=x), [1, 0, 0], loading=FIRST).to_file()).question for x in (1.0, 0.0))
    g = alone.grasp
    assert is_scale_free(alone, g)
    assert not is_scale_free(driven, g)
    assert not is_scale_free(replace(alone, force_limit=2.0), g)
    assert not is_scale_free(replace(alone, torque_limits={"jaw": 2.0}), g)
    for name in ("command", "torque", "friction"):  # whether they meet a contact or not
        acting = replace(alone.grasp, moves=alone.grasp.moves & False, **{name: np.ones(1)})
        assert not is_scale_free(replace(alone, grasp=acting), g)
    start = StartData(np.array([-1.0] * alone.grasp.m), np.zeros(1), np.zeros(1))
    assert not is_scale_free(replace(alone, grasp=g.with_start(start)), g)
    none, left, still = np.zeros(g.m), np.ones(1), np.zeros(1)
    assert is_scale_free(alone, g.with_start(StartData(none, still, still)))
    stopped = replace(g, stop=np.array([1]))
    for begun in (g.with_start(start), stopped.with_start(StartData(none, left, still))):
        assert not is_scale_free(alone, begun)


def test_how_near_a_state_is_grows_with_what_acts() -> None:
    """1e-6 of the largest force: of 40 N at the jaw, which are commanded, or of 300 N of load."""
    for command, load, acts in ((40.0, 1.0, 40.0), (1.0, 300.0, 300.0)):
        path = read_path(check(jaw(command=command), [load, 0, 0], loading=FIRST).to_file())
        last = path.steps[-1]
        assert last.witness is not None
        q = last.question
        near = near_enough(Problem.of(q, q.grasp.command, q.wrench), last.witness.state)
        assert near == pytest.approx(1e-6 * max(acts, float(np.abs(last.witness.state.c).max())))


# --- what an answer may say, by steps that are made up ---------------------------------------------------

STATE: Any = SimpleNamespace(state=SimpleNamespace(motion=np.array([3.0, 0, 0, 0, 0, 0, 0])))
NO_STATE: Any = SimpleNamespace()
PROVED = Proved(True, False, "", 0.0, 0.25, 2.0)
INF = np.inf


def asked_grasp() -> Data:
    """A contact on a slide with a motor."""
    contact = {"position": [0, 0, 0], "normal": [1, 0, 0], "friction": 0.5}
    slide = {"name": "jaw", "type": "prismatic", "axis": [1, 0, 0], "origin": [0, 0, 0], "moves": [0]}
    return {"schema": "handfast/grasp/1", "contacts": [contact], "joints": [slide]}


@cache
def asked(command: float = 0.0) -> Question:
    """With 2 N of load."""
    grasp = asked_grasp() | {"preload": {"jaw": command} if command else {}}
    return read_question({"grasp": grasp, "goal": "check", "wrench": [0, 2, 0, 0, 0, 0]}, "")


def path(
    query: str, verdict: str, *magnitudes: float, end: float | None = None, q: Question | None = None, **more: Any
) -> SavedPath:
    """With a state at each magnitude, and a certificate at the end if it is given."""
    q = q or asked()
    steps = [Step(m, q, STATE, None) for m in magnitudes]
    steps += [] if end is None else [Step(end, q, None, NO_STATE)]
    parts = {name: more.pop(name) for name in ("sought", "bound") if name in more}
    said = {"schema": "handfast/path/1", "query": query, "verdict": verdict} | more
    return SavedPath(q, said, None, None, steps=tuple(steps), **parts)


def last(saved: SavedPath) -> tuple[Step | None, bool]:
    """The last step with a state; does the path end?"""
    states = [s for s in saved.steps if s.witness is not None]
    return (states[-1] if states else None), bool(saved.steps) and saved.steps[-1].witness is None


@pytest.mark.parametrize(
    ("verdict", "magnitudes", "end", "shown"),
    [
        ("holds", (0.0, 0.5, 1.0), None, {"margin": None, "reached": 1.0, "slips_at": None, "state": "described"}),
        ("holds", (0.0, 0.5), None, "HOLDS, but the whole load is not reached"),
        ("holds", (), None, "HOLDS, but the whole load is not reached"),
        ("holds", (0.0, 1.0), 1.5, "HOLDS, but the whole load is not reached"),
        ("slips", (0.0, 0.5), 0.75, UNPROVED_STATE | {"margin": None, "reached": 0.5, "slips_at": 0.75}),
        ("slips", (0.0, 0.5), 1.0, UNPROVED_STATE | {"margin": None, "reached": 0.5, "slips_at": 1.0}),
        ("slips", (), 0.0, UNPROVED_STATE | {"margin": None, "reached": None, "slips_at": 0.0}),
        ("slips", (0.0, 0.5), 1.25, "SLIPS, but no step of the load is shown to have no state"),
        ("slips", (0.0, 0.5), None, "SLIPS, but no step of the load is shown to have no state"),
        ("undecided", (0.0, 0.5), None, UNPROVED_STATE | {"margin": None, "reached": 0.5, "slips_at": None}),
        ("undecided", (0.0, 0.5), 1.25, "UNDECIDED with a certificate"),
    ],
)
def test_what_a_check_may_say(
    verdict: str, magnitudes: Any, end: float | None, shown: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(path_steps, "described", lambda *of: {"state": "described"} if of[1] is STATE.state else {})
    saved = path("check", verdict, *magnitudes, end=end)
    before, ended = last(saved)
    if isinstance(shown, str):
        with pytest.raises(Refused, match=f"^{shown}$"):
            path_steps._check(saved, before, PROVED, ended)
    else:
        assert path_steps._check(saved, before, PROVED, ended) == shown


BOUNDS = {"attained": True, "limit": None, "holds_from_zero_to": None}


@pytest.mark.parametrize(
    ("verdict", "magnitudes", "end", "more", "shown"),
    [
        ("holds", (0.0, 0.5), 0.75, {}, (0.5, 0.75, 0.5)),
        ("holds", (0.0, 0.5), None, {}, (0.5, None, None)),
        ("slips", (0.0,), 0.25, {}, (0.0, 0.0, 0.0)),  # of nothing but the load any part slips
        ("slips", (), 0.0, {}, (0.0, 0.0, 0.0)),
        ("slips", (0.0,), 0.25, {"q": asked(1.0)}, "SLIPS is not what its steps show"),
        ("undecided", (0.0,), 0.25, {"q": asked(1.0)}, (0.0, 0.25, None)),
        ("undecided", (0.0,), 0.25, {}, "UNDECIDED is not what its steps show"),
        ("undecided", (0.0, 0.5), None, {}, "UNDECIDED is not what its steps show"),
        ("holds", (0.0,), None, {}, "HOLDS is not what its steps show"),
        ("slips", (0.0, 0.5), 0.75, {}, "SLIPS is not what its steps show"),
        ("holds", (0.0, 8.0), None, {"unbounded": True}, (8.0, None, 0.0)),
        ("holds", (0.0, 8.0 * (1 - 0.9e-9)), None, {"unbounded": True}, (8.0 * (1 - 0.9e-9), None, 0.0)),
        ("holds", (0.0, 8.0 * (1 - 1.1e-9)), None, {"unbounded": True}, "unbounded, but its path ends"),
        ("holds", (0.0, 9.0), 10.0, {"unbounded": True}, "unbounded, but its path ends"),
    ],
)
def test_what_the_end_of_a_path_may_say(
    verdict: str, magnitudes: Any, end: float | None, more: Any, shown: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(path_steps, "_end", lambda q: 8.0)
    saved = path("max", verdict, *magnitudes, end=end, **more)
    before, ended = last(saved)
    if isinstance(shown, str):
        with pytest.raises(Refused, match=f"^{shown}$"):
            path_steps._max(saved, before, PROVED, ended)
        return
    lower, upper, gap = shown
    found = path_steps._max(saved, before, PROVED, ended)
    assert found == BOUNDS | {"lower": lower, "upper": upper, "gap": gap, "unbounded": "unbounded" in more}


def test_that_a_path_never_ends_is_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(path_steps, "_compare", lambda *_: None)
    for unbounded, more in ((True, (UNBOUNDED_CLAIM,)), (False, ())):
        done = path_steps.replay(path("max", "holds", unbounded=unbounded))
        assert done.not_replayed == (*more, path_steps.OTHER_PATHS, ANSWER_NOT_REPLAYED)


def test_where_a_path_without_end_is_left() -> None:
    """At a thousand times the command of 4 N, over the load of 2 N; without one at a thousand times the load."""
    assert path_steps._end(asked(4.0)) == pytest.approx(2000)
    assert path_steps._end(asked()) == pytest.approx(1000)


def looked_for(sense: float = 1.0) -> Any:
    return SimpleNamespace(
        sought=np.array([0]),
        senses=np.array([sense]),
        cost=lambda c: float(abs(c[0])),
        reach=2e6,
        words="jaw",
        size_of=lambda states: 3.0 * len(states),
    )


@pytest.mark.parametrize(
    ("verdict", "magnitudes", "command", "lower", "lowest", "shown"),
    [
        ("undecided", (), 0.0, 0.5, 0.75, {"lower": 0.5}),
        ("undecided", (), 0.0, 0.75, 0.75, {"lower": 0.75}),
        ("undecided", (), 0.0, 0.0, 0.0, {"lower": 0.0}),
        ("undecided", (), 0.0, 0.8, 0.75, "a lower bound of 0.8; 0.75 is shown"),
        ("undecided", (), 0.0, -0.5, 0.75, "a lower bound of -0.5; 0.75 is shown"),
        ("undecided", (), 0.0, None, 0.75, "a lower bound of None; 0.75 is shown"),
        ("undecided", (0.0,), 0.0, 0.5, 0.75, "UNDECIDED with commands, or with a path"),
        ("undecided", (), 0.1, 0.5, 0.75, "UNDECIDED with commands, or with a path"),
        ("slips", (), 0.0, None, INF, {"lower": None}),
        ("slips", (), 0.0, None, 1e300, "SLIPS, but it is not shown that no commands hold the load"),
        ("slips", (0.0,), 0.0, None, INF, "SLIPS with commands, or with a path"),
        ("holds", (0.0, 1.0), 2.0, 1.0, 1.5, {"preload": {"jaw": 2.0}, "lower": 1.0, "upper": 2.0}),
        ("holds", (0.0, 1.0), 2.0, 2.0, INF, {"preload": {"jaw": 2.0}, "lower": 2.0, "upper": 2.0}),
        ("holds", (0.0, 1.0), -2.0, 1.0, 1.5, {"preload": {"jaw": -2.0}, "lower": 1.0, "upper": 2.0}),
        ("holds", (0.0, 1.0), 2.0, 1.75, 1.5, "a lower bound of 1.75; 1.5 is shown"),
        ("holds", (0.0, 1.0), 2.0, 2.25, INF, "a lower bound of 2.25; 2 is shown"),
        ("holds", (0.0, 1.0), 2.0, -1.0, 1.5, "a lower bound of -1.0; 1.5 is shown"),
        ("holds", (0.0, 1.0), 2.0, None, 1.5, "a lower bound of None; 1.5 is shown"),
        ("holds", (0.0, 0.5), 2.0, 1.0, 1.5, "HOLDS, but the whole load is not reached"),
        ("holds", (), 2.0, 1.0, 1.5, "HOLDS, but the whole load is not reached"),
    ],
)
def test_what_commands_on_a_path_may_say(
    verdict: str, magnitudes: Any, command: float, lower: float | None, lowest: float, shown: Any
) -> None:
    sought, q = looked_for(-1.0 if command < 0 else 1.0), asked(command)
    saved = path("torques", verdict, *magnitudes, q=q, lower=lower, sought=sought, bound=STATE)
    before, ended = last(saved)
    if isinstance(shown, str):
        with pytest.raises(Refused, match=f"^{re.escape(shown)}$"):
            path_steps._torques(saved, sought, before, ended, lowest)
        return
    none = {"certified": True, "preload": None, "upper": None}
    assert path_steps._torques(saved, sought, before, ended, lowest) == none | shown
    bare = replace(saved, bound=None)
    assert path_steps._torques(bare, sought, before, ended, lowest) == none | shown | {"certified": False}


def test_commands_of_a_path_have_their_sense_and_its_bound_a_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    saved = path("torques", "holds", 0.0, 1.0, q=asked(2.0), lower=1.0)
    before, _ = last(saved)
    with pytest.raises(Refused, match=r"^HOLDS, but the whole load is not reached$"):
        path_steps._torques(saved, looked_for(), before, True, 1.5)
    with pytest.raises(Refused, match=r"^a command has the wrong sense$"):
        path_steps._torques(saved, looked_for(-1.0), before, False, 1.5)
    # both states go to 3 N
    for reach, lower, ok in ((6.01, 1.0, True), (5.99, 1.0, False), (5.99, 0.0, True)):
        so_far = SimpleNamespace(**(vars(looked_for()) | {"reach": reach}))
        saved = path("torques", "holds", 0.0, 1.0, q=asked(2.0), lower=lower)
        if ok:
            assert path_steps._torques(saved, so_far, before, False, 1.5)["lower"] == lower
        else:
            with pytest.raises(Refused, match=r"^its path has forces or motions of 6 N, of which its bound says"):
                path_steps._torques(saved, so_far, before, False, 1.5)


class Bound:
    """Cases that show so much, or are none."""

    leaves = (1, 2, 3)

    def __init__(self, lowest: float | None) -> None:
        self.lowest = lowest

    def lower(self, sought: Any) -> float:
        if self.lowest is None:
            raise BadFile("is no case", "bound.leaves[0]")
        return self.lowest


@pytest.mark.parametrize(
    ("verdict", "lower", "lowest", "claim", "reason"),
    [
        ("holds", 1.0, 1.5, " below 1", ""),
        ("holds", 1.5, 1.5, " below 1.5", ""),
        ("undecided", None, 1.5, " below 0", ""),
        ("holds", 1.75, 1.5, " below 1.75", "its cases show 1.5, the answer says 1.75"),
        ("slips", None, INF, "", ""),
        ("slips", None, 1.5, "", "its cases show 1.5, the answer says inf"),
    ],
)
def test_what_cases_of_commands_show(verdict: str, lower: float | None, lowest: float, claim: str, reason: str) -> None:
    saved = path("torques", verdict, lower=lower, bound=Bound(lowest))
    found, (part,) = path_steps._bounded(saved, looked_for())
    assert (found, part.name, part.reason) == (lowest, "bound", reason)
    reach = ", with forces and motions up to 2e+06 N"
    assert part.claim == f"no commands of jaw hold the load on a path{claim}{reach}"
    assert part.figures == {"leaves": 3, "lower": lowest}
    assert path_steps._bounded(replace(saved, bound=None), looked_for()) == (0.0, [])
    none = replace(saved, bound=Bound(None))  # type: ignore[arg-type]
    assert path_steps._bounded(none, looked_for()) == (
        0.0,
        [Replay("bound", "no commands of jaw are enough", "bound.leaves[0]: is no case")],
    )


# --- steps, one after the other ---------------------------------------------------------------------------


def test_steps_follow_from_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    started = read_question(
        {"grasp": asked_grasp(), "goal": "check", "wrench": [0] * 6}
        | {"from": {"gaps": [0.0], "stops": [0.0], "slack": [0.0]}},
        "",
    )
    rest, more, none = (
        Step(0.0, asked(), STATE, None),
        Step(0.5, started, STATE, None),
        Step(0.5, started, None, NO_STATE),
    )
    steps = replace(path("check", "holds"), steps=(rest, more, replace(more, magnitude=1.0)))
    monkeypatch.setattr(
        path_steps,
        "_apart",
        lambda before, start: (0.25, "") if before is rest else (0.0, "is no step from there"),
    )
    assert path_steps._linked(steps, 0, rest, None) == 0
    assert path_steps._linked(steps, 1, more, rest) == 0.25
    for k, step, before, why in (
        (0, replace(rest, magnitude=0.5), None, "step 0: is not of the commands alone, from rest"),
        (0, replace(more, magnitude=0.0), None, "step 0: is not of the commands alone, from rest"),
        (1, more, None, "step 1: the one before it has no state"),
        (2, more, rest, "step 2: the one before it has no state"),  # but the one before that
        (1, replace(more, magnitude=0.0), rest, "step 1: its load is not larger than the one before"),
        (1, replace(more, question=asked()), rest, "step 1: does not say where it starts from"),
        (2, steps.steps[2], more, "step 2: is no step from there"),
    ):
        with pytest.raises(Refused, match=f"^{why}$"):
            path_steps._linked(steps, k, step, before)
    monkeypatch.setattr(
        path_steps,
        "refuted",
        lambda claim, c, *how, complete: Replay("certificate", claim, "", {"motion_cap": 2.0 if complete else None}),
    )
    ends = replace(steps, steps=(rest, none))
    claim = "0.5 times the load is not resisted from the state at 0 times"
    part, cap = path_steps._none(ends, 1, none, rest)
    assert (part.claim, cap) == (claim, 2.0)
    assert (
        path_steps._none(replace(steps, steps=(none,)), 0, none, None)[0].claim
        == "the commands alone are in no balance"
    )
    for k, step in ((1, replace(none, certificate=None)), (0, none)):
        with pytest.raises(Refused, match=f"^step {k}: has neither a witness nor, as the last one, a certificate$"):
            path_steps._none(ends, k, step, rest)


def witness(command: float = 1.0, load: float = 2.0) -> Any:
    return SimpleNamespace(command=np.array([command]), wrench=np.array([0, load, 0, 0, 0, 0]), state=STATE.state)


@pytest.mark.parametrize("near", [True, False])
def test_a_state_is_gone_on_from_where_it_is_proved(near: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    q = asked(1.0)
    monkeypatch.setattr(path_steps, "near_enough", lambda p, x: 0.5)
    monkeypatch.setattr(
        path_steps, "prove", lambda p, x, within: replace(PROVED, exact=near, reason="far") if within == 0.5 else None
    )
    step = Step(0.5, q, witness(), None)
    found, part = path_steps._state(2, step)
    assert (found.exact, part.name, part.reason) == (near, "step 2", "" if near else "far")
    assert part.claim.startswith("0.5 times the load is resisted from the state before")
    assert path_steps._state(0, step)[1].claim.startswith("the commands alone are in balance")
    for other in (witness(command=1.1), witness(load=2.1)):
        with pytest.raises(
            Refused, match=r"^step 2: its witness is a state under another load, or with other commands$"
        ):
            path_steps._state(2, replace(step, witness=other))
    with pytest.raises(Refused, match=r"^step 2: has a witness and a certificate$"):
        path_steps._state(2, replace(step, certificate=NO_STATE))


@pytest.mark.parametrize(("apart", "right"), [(1.9e-5, True), (2.1e-5, False), (np.nan, False)])
def test_all_steps_together_stay_near_what_is_proved(apart: float, right: bool) -> None:
    """1e-5 of the load at its magnitude: 2 N; of 1e4 N that act nothing is told."""
    most = path_steps.may_drift(asked(1.0), 1.0)
    assert most == pytest.approx(2e-5)
    far = f"all steps together go on from numbers {apart:.1e} N from the states that are proved"
    assert path_steps._drifted(apart, most) == ("" if right else far)


@pytest.mark.parametrize("fails", [False, True])
def test_what_all_states_of_a_path_have_in_common(fails: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is exact if all states are, and moves as far as the farthest; a cap is that of its end."""
    saved = path("check", "slips", 0.0, 0.5, 0.75, end=1.0)
    found = [replace(PROVED, exact=k != 1, motion=(2.0, 5.0, 3.0)[k]) for k in range(3)]
    seen: list[Any] = []

    def state(k: int, step: Step) -> tuple[Proved, Replay]:
        return found[k], Replay(f"step {k}", "", "is wrong" if fails and k == 1 else "")

    def linked(*link: Any) -> float:
        seen.append(link[1:])
        return 0.125 * link[1]

    def drifted(apart: float, most: float) -> str:
        before.append((apart, most))
        return ""

    before: list[tuple[float, float]] = []
    monkeypatch.setattr(path_steps, "_linked", linked)
    monkeypatch.setattr(path_steps, "_drifted", drifted)
    monkeypatch.setattr(path_steps, "may_drift", lambda q, magnitude: 3 * magnitude)
    monkeypatch.setattr(path_steps, "_state", state)
    monkeypatch.setattr(path_steps, "_none", lambda *end: (Replay("certificate"), 7.0))
    monkeypatch.setattr(path_steps, "_compare", lambda *said: seen.append(said))
    done = replay(saved)
    assert (done.name, done.ok, [part.name for part in done.parts]) == (
        "check", not fails, ["step 0", "step 1", "step 2", "certificate"]
    )  # fmt: skip
    # radii, and how far starts are from where they came; of the last step, which has no state, as well
    end = 3 * 0.75  # of the last load that has a state
    every = [(0.25, end), (2 * 0.25 + 0.125, end), (3 * 0.25 + 0.375, end), (3 * 0.25 + 0.75, end)]
    assert before == [every[k] for k in range(4) if not (fails and k == 1)]
    steps = saved.steps
    assert seen[:4] == [(0, steps[0], None), (1, steps[1], steps[0]), (2, steps[2], steps[1]), (3, steps[3], steps[2])]
    of_steps = {"exact": False, "motion": 5.0, "motion_cap": 7.0}
    assert seen[4:] == ([] if fails else [(saved, steps[2], found[2], of_steps, 0.0)])
    assert (done.claim, saved.reached) == ("", 0.75)
    if not fails:
        monkeypatch.setattr(path_steps, "_bounded", lambda saved, sought: (0.25, [Replay("bound")]))
        done = replay(path("torques", "holds", 0.0, 1.0, sought=looked_for()))
        assert [part.name for part in done.parts] == ["step 0", "step 1", "bound"]
        assert seen[-1][-1] == 0.25
    seen.clear()
    replay(path("check", "undecided"))
    assert seen[0][1:] == (None, None, {"exact": None, "motion": None, "motion_cap": None}, 0.0)


@pytest.mark.parametrize("more", [{"goal": "torques"}, {"from": {"gaps": [0.0], "stops": [0.0], "slack": [0.0]}}])
def test_a_path_is_of_a_check_from_rest(more: Data) -> None:
    question = {"grasp": asked_grasp(), "goal": "check", "wrench": [0, 2, 0, 0, 0, 0]} | more
    with pytest.raises(BadFile, match=r"^p\.question: is no check from rest with the dissipation principle$"):
        read_path({"schema": "handfast/path/1", "question": question}, "p")


@pytest.mark.parametrize(
    ("name", "by", "near"),
    [
        *(
            (name, room * sign, True)
            for name, room in (("gaps", 0.125), ("stops", 0.25), ("slack", 0.5))
            for sign in (1, -1)
        ),
        *(
            (name, room * sign, False)
            for name, room in (("gaps", 0.13), ("stops", 0.26), ("slack", 0.51))
            for sign in (1, -1)
        ),
        ("gaps", np.nan, False),
    ],
)
def test_how_far_a_start_may_be_from_where_the_state_came_to(
    name: str, by: float, near: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    came = StartData(np.array([1.0, 2.0]), np.array([3.0]), np.array([4.0]))
    room = StartData(np.array([9.0, 0.125]), np.array([0.25]), np.array([0.5]))
    monkeypatch.setattr(path_steps, "came_from", lambda p, x: (came, room, 0.0) if x is STATE.state else None)
    own = getattr(came, name).copy()
    own[-1] += by
    apart, fault = path_steps._apart(Step(0.5, asked(), STATE, None), replace(came, **{name: own}))
    unit = 1.0 if name == "gaps" else asked().grasp.row_units[asked().grasp.parts[2 if name == "slack" else 4]][-1]
    assert apart == (pytest.approx(abs(by) / unit) if near else 0.0)
    assert fault == ("" if near else f"its {name} are not those to which the state before came")


@pytest.mark.parametrize(("query", "of"), [("check", "_check"), ("max", "_max"), ("torques", "_torques")])
@pytest.mark.parametrize("end", [None, 1.5])
def test_what_answers_of_all_queries_say(
    query: str, of: str, end: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved = path(query, "holds", 0.0, 0.5, 1.0, end=end, sought=looked_for() if query == "torques" else None)
    before, ended = last(saved)
    told: list[Any] = []
    for name in ("_check", "_max", "_torques"):
        monkeypatch.setattr(path_steps, name, lambda *asked, name=name: told.append((name, asked)) or {"its": name})
    monkeypatch.setattr(path_steps, "compare", lambda *said: told.append(said))
    monkeypatch.setattr(path_steps, "described_rounding", lambda g, x: (g, x))
    path_steps._compare(saved, before, PROVED, {"exact": True}, 0.25)
    (name, given), (said, shown, course, rounding) = told
    assert rounding == (before.question.grasp, before.witness.state)
    if query == "torques":
        assert (name, given) == (of, (saved, saved.sought, before, ended, 0.25))
    else:
        assert (name, given) == (of, (saved, before, PROVED, ended))
    assert said is saved.said
    every = {
        "schema": "handfast/path/1",
        "query": query,
        "verdict": "holds",
        "loading": FIRST,
        "exact": True,
        "its": of,
    }
    assert shown == every | {"steps": 2 + (end is not None), "certified": end is not None}
    assert course == (*COURSE_KEYS, "by_steps", "other_choice", "resolution")


def test_each_command_of_a_path_has_its_sense() -> None:
    grasp = asked_grasp()
    grasp["joints"].append(grasp["joints"][0] | {"name": "thumb"})
    grasp["preload"] = {"jaw": 1.0, "thumb": 2.0}
    q = read_question({"grasp": grasp, "goal": "check", "wrench": [0, 2, 0, 0, 0, 0]}, "")
    saved = path("torques", "holds", 0.0, 1.0, q=q, lower=0.0)
    for senses in ([1.0, -1.0], [-1.0, 1.0]):
        sought = SimpleNamespace(**vars(looked_for()) | {"senses": np.array(senses)})
        with pytest.raises(Refused, match=r"^a command has the wrong sense$"):
            path_steps._torques(saved, sought, last(saved)[0], False, 1.5)


@pytest.mark.parametrize(("backdrivable", "factor"), [(False, 1e6), (True, 1.0)])
def test_a_stop_counts_by_what_actuators_that_are_held_move(backdrivable: bool, factor: float) -> None:
    """A joint that moves no contact; while a differential is held, a jaw goes a million times as far."""
    contacts = [Contact([x, 0, 0], [-x, 0, 0], 0.5) for x in (-1.0, 1.0)]
    joints = [
        GraspJoint("jaw", [1, 0, 0], [0, 0, 0], (0,), "prismatic"),
        GraspJoint("s", [1, 0, 0], [0, 0, 0], (), "prismatic", stop="lower"),
    ]
    tie = Mechanism(("tie",), np.array([[-1.0, 1e6]]), np.zeros((0, 2)), (False,), (backdrivable,))
    assert path_steps.leverage(grasp_data(Grasp(contacts, joints, tie))) == pytest.approx(factor)
