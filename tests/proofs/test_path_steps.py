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
from typing import Any

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.proofs import path_steps
from handfast.proofs.existence import prove
from handfast.proofs.fields import BadFile
from handfast.proofs.path_steps import is_scale_free, near_enough, read_path, replay
from handfast.proofs.states import Problem
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
    assert f"hold the load on a path below {lower:.6g}, with forces and motions up to" in bound.claim
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
    monkeypatch.setattr(path_steps, "STATE_REACH", 1.0)  # 1.2 N is more than the load of 0.6 N
    assert re.search(r"its path moves by 1.2\d* N, of which its bound says nothing$", replay(path).fault)


def test_a_state_that_is_proved_farther_away_is_not_gone_on_from(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(path_steps, "prove", lambda *args, **asked: replace(prove(*args, **asked), radius=2e-6))
    why = fault("across")
    assert why == "step 0: the state that is proved is 2.0e-06 N from the numbers that the path goes on from"


def test_only_the_load_alone_may_be_scaled() -> None:
    driven, alone = (read_path(check(jaw(command=x), [1, 0, 0], loading=FIRST).to_file()).question for x in (1.0, 0.0))
    assert is_scale_free(alone)
    assert not is_scale_free(driven)
    assert not is_scale_free(replace(alone, force_limit=2.0))
    assert not is_scale_free(replace(alone, torque_limits={"jaw": 2.0}))


def test_how_near_a_state_is_grows_with_what_acts() -> None:
    """1e-6 of the largest force: of 40 N at the jaw, which are commanded, or of 300 N of load."""
    for command, load, acts in ((40.0, 1.0, 40.0), (1.0, 300.0, 300.0)):
        path = read_path(check(jaw(command=command), [load, 0, 0], loading=FIRST).to_file())
        last = path.steps[-1]
        assert last.witness is not None
        q = last.question
        near = near_enough(Problem.of(q, q.grasp.command, q.wrench), last.witness.state)
        assert near == pytest.approx(1e-6 * max(acts, float(np.abs(last.witness.state.c).max())))
