"""The claims of a whole answer of synthesis: what follows is checked, what contradicts itself is refused."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.impossibility import Impossibility
from handfast.proofs.pose_by_pose import impossible_at_every_pose
from handfast.proofs.replay import Refused, Replay
from handfast.proofs.synthesis import (
    NAMES_CLAIM,
    SYNTHESIS_COURSE,
    _contradiction,
    _features,
    _following,
    _none,
    _Searched,
    replay,
)
from handfast.proofs.tasks import read_task
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.query import synthesize
from handfast.synthesis.task_file import load_task
from tests.support.holds import LARGE, grip, pinch, turned
from tests.support.places import ROOT

Data = dict[str, Any]
Change = Callable[[Data], object]


@cache
def _text(name: str) -> str:
    answers = {
        "found": lambda: synthesize(pinch(), count=2),
        "none": lambda: synthesize(grip(0.12)),
        "turned": lambda: synthesize(turned(grip(0.05))),
        "gripped": lambda: synthesize(grip(0.05), count=1),
        "undecided": lambda: synthesize(pinch(LARGE), timeout=None, nodes=2000, seed=3),
    }
    return json.dumps(answers[name]().to_file())


def changed(name: str, change: Change) -> Data:
    data: Data = json.loads(_text(name))
    change(data)
    return data


def same(_: Data) -> None:
    """No change."""


def first(data: Data) -> Data:
    return data["answer"]["configurations"][0]


def reason(data: Data) -> str:
    try:
        return replay(data).reason
    except BadFile as fault:
        return str(fault)


def test_what_is_proved_of_configurations() -> None:
    done = replay(changed("found", same))
    assert done.ok, done.reason
    assert [part.name for part in done.parts] == ["configuration 0", "configuration 1", "spread"]
    assert list(done.replayed) == ["an exact one exists in its box"] * 2
    assert done.not_replayed == (SYNTHESIS_COURSE, NAMES_CLAIM)
    figures = done.parts[0].figures
    assert 0 < figures["gap"] < 1e-12
    assert figures["contraction"] + figures["step"] < 1


def test_what_is_proved_of_none() -> None:
    done = replay(changed("none", same))
    assert (done.ok, done.not_replayed) == (True, (SYNTHESIS_COURSE, NAMES_CLAIM))
    assert list(done.replayed) == ["contacts 0 and 1 exclude each other, by 1 box of the checker's own"]
    assert done.parts == (Replay("none", *done.replayed, "", {"boxes": 1}),)


def test_nothing_is_claimed_of_an_undecided_answer() -> None:
    done = replay(changed("undecided", same))
    assert (done.ok, done.parts) == (True, ())
    assert "% of the space holds no configuration: the boxes that were discarded are not kept" in done.not_replayed[0]
    assert done.not_replayed[1:] == (SYNTHESIS_COURSE, NAMES_CLAIM)


def test_why_none_cannot_be_judged_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(*_: object, **__: object) -> None:
        raise Refused("why")

    monkeypatch.setattr("handfast.proofs.synthesis.impossible", refuses)
    done = replay(changed("none", same))
    assert done.parts == (Replay("none", "", "NONE rests on the search itself, ask it again: why"),)


def of_poses(name: str, boxes: int, monkeypatch: pytest.MonkeyPatch) -> Replay:
    """A file that says that nothing is left pose by pose."""
    monkeypatch.setattr(
        "handfast.proofs.synthesis.impossible_at_every_pose", partial(impossible_at_every_pose, boxes=boxes)
    )
    return replay(changed(name, of_search(by="all contacts, pose by pose")))


def test_what_is_proved_of_none_pose_by_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    done = of_poses("turned", 5000, monkeypatch)
    assert (done.ok, done.not_replayed) == (True, (SYNTHESIS_COURSE, NAMES_CLAIM))
    claim = r"all contacts, pose by pose exclude each other, by \d+ boxes of the checker's own"
    assert re.fullmatch(claim, done.parts[0].claim)
    monkeypatch.setattr("handfast.proofs.synthesis.impossible_at_every_pose", lambda _: Impossibility(True, 4, 1.0))
    data = changed("turned", of_search(by="all contacts, pose by pose"))
    data["task"]["pose"]["axes"][1][2] = [-1.0, 0.5]
    told = "all contacts, pose by pose exclude each other, where axes of the object are bounded, by 4 boxes"
    assert replay(data).parts[0].claim.startswith(told)


def test_a_forged_none_of_a_possible_task_is_not_accepted_pose_by_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    data = changed("none", of_search(by="all contacts, pose by pose"))
    data["task"] = json.loads(_text("found"))["task"]
    monkeypatch.setattr(
        "handfast.proofs.synthesis.impossible_at_every_pose", partial(impossible_at_every_pose, boxes=1000)
    )
    done = replay(data)
    assert not done.ok
    assert not done.replayed
    assert "of all contacts, pose by pose the checker by itself could discard" in done.reason
    data["answer"]["searched"]["by"] = "all contacts, pose by pose, more or less"
    assert "'all contacts, pose by pose, more or less' names no contacts of the task" in replay(data).reason


# --- keys that contradict each other ---


def said(**keys: Any) -> Change:
    return lambda d: d["answer"].update(keys)


def of_search(**keys: Any) -> Change:
    none = {"by": "contacts 0 and 1", "nodes": 0, "discarded": 0.5, "depth": 0, "pending": 1}
    none |= {"smallest": 0.0, "largest": 0.0}
    return lambda d: d["answer"].update(searched=(d["answer"]["searched"] or none) | keys)


CONTRADICTIONS: list[tuple[str, Change, str]] = [
    ("found", said(configurations=[]), "FOUND without a configuration"),
    ("found", said(verdict="none"), "NONE with a configuration"),
    ("found", said(verdict="undecided"), "UNDECIDED with a configuration"),
    ("found", lambda d: d.update(state={}), "FOUND with a state to go on from"),
    ("found", said(nodes=7), "nodes is 7, of the search 0"),
    ("found", of_search(nodes=3), "nodes is 0, of the search 3"),
    ("found", of_search(discarded=1.0), "FOUND of a search that discarded all"),
    ("found", of_search(discarded=1.0, pending=0), "FOUND of a search that discarded all"),
    ("found", said(spread=None), "spread: is None, of these configurations "),
    ("found", lambda d: said(spread=d["answer"]["spread"] + 1e-6)(d), "spread: is "),
    ("none", said(stop="time"), "NONE of a search that discarded less than all or did not end"),
    ("none", said(searched=None, nodes=0), "NONE of a search that discarded less than all or did not end"),
    ("none", of_search(discarded=0.999), "NONE of a search that discarded less than all or did not end"),
    ("none", of_search(pending=1), "NONE of a search that discarded less than all or did not end"),
    ("none", lambda d: d.update(state={}), "NONE with a state to go on from"),
    ("none", of_search(by="contact 0"), "NONE rests on the search itself, ask it again: of contact 0 the checker"),
    (
        "none",
        of_search(by="contacts 0 and 5"),
        "NONE rests on the search itself, ask it again: 'contacts 0 and 5' names no",
    ),
    ("undecided", lambda d: d.update(state=None), "UNDECIDED without a state to go on from"),
    ("undecided", of_search(discarded=1.0), "UNDECIDED of a search that discarded all"),
    ("undecided", said(stop="complete"), "UNDECIDED of a search that is complete"),
]


@pytest.mark.parametrize(("name", "change", "words"), CONTRADICTIONS)
def test_contradictions_are_refused(name: str, change: Change, words: str) -> None:
    fault = reason(changed(name, change))
    assert words in fault
    assert fault.removeprefix("none: ").startswith(words)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (said(verdict="perhaps"), "answer.verdict: is 'perhaps'; 'found' or 'none' or 'undecided' is needed"),
        (said(stop="never"), "answer.stop: is 'never'; "),
        (said(query="check"), "answer.query: is 'check'; 'synthesize' is needed"),
        (said(schema="handfast/answer/2"), "answer.schema: "),
        (said(seconds=-1.0), "answer.seconds: is -1; 0 or more is needed"),
        (said(starts=-1), "answer.starts: is -1; a whole number of 0 or more is needed"),
        (said(unproved=0.5), "answer.unproved: is 0.5; a whole number"),
        (said(seed=True), "answer.seed: is True; a whole number"),
        (said(note=1), "answer.note: is not a known field"),
        (lambda d: d.update(note=1), "note: is not a known field"),
        (lambda d: d.pop("state"), "state: is missing"),
        (lambda d: d.update(schema="handfast/result/1"), "schema: is 'handfast/result/1'"),
        (lambda d: first(d).update(note=1), "answer.configurations[0].note: is not a known field"),
        (lambda d: first(d).pop("slacks"), "answer.configurations[0].slacks: is missing"),
        (of_search(discarded=1.5), "answer.searched: has a share beyond 1"),
        (of_search(smallest=2.0, largest=1.0), "answer.searched: has a share beyond 1, or a smallest box larger"),
        (of_search(discarded=-0.1), "answer.searched.discarded: is -0.1; 0 or more is needed"),
        (of_search(depth=-1), "answer.searched.depth: is -1"),
    ],
)
def test_what_is_no_answer_is_refused_with_its_field(change: Change, words: str) -> None:
    with pytest.raises(BadFile) as fault:
        replay(changed("found", change))
    assert str(fault.value).startswith(words)


# --- what is said beside a proof ---


def moved(key: str, by: float) -> Change:
    """The first configuration's, by a little."""

    def change(data: Data) -> None:
        at = first(data)
        if key == "joints":
            at["joints"]["index_middle"] += by
        elif key == "position":
            at["object_pose"]["position"][2] += by
        elif key == "quaternion":
            at["object_pose"]["quaternion"][1] += by
        elif key in ("point", "normal"):
            at["contacts"][1][key][0] += by
        else:
            at["slacks"][key] += by

    return change


KEYS = ("joints", "position", "quaternion", "point", "normal", "contact:0:cone", "contact:1:s", "joint:index_proximal")


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("by", [1e-6, -1e-6, 3e-9, -3e-9])
def test_numbers_that_do_not_follow_are_refused(key: str, by: float) -> None:
    fault = reason(changed("found", moved(key, by)))
    assert fault.startswith("configuration 0: ")
    assert "are not those of its proof" in fault


@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("by", [3e-10, -3e-10])
def test_rounding_is_let_pass(key: str, by: float) -> None:
    """Of lengths, of the object's size."""
    size = read_task(changed("found", same)["task"]).size if key in ("position", "point") else 1.0
    assert 0.01 < size <= 1
    assert reason(changed("found", moved(key, by * size))) == ""


def test_a_quaternion_and_its_negative_are_the_same_pose() -> None:
    def turned(data: Data) -> None:
        q = first(data)["object_pose"]["quaternion"]
        first(data)["object_pose"]["quaternion"] = [-x for x in q]

    assert reason(changed("found", turned)) == ""


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: first(d)["joints"].pop("ring_distal"), "joints are not those of its proof: the joints are ring_"),
        (lambda d: first(d)["joints"].update(tail=0.0), "joints are not those of its proof: the joints are ring_"),
        (lambda d: first(d)["contacts"].pop(), "contacts are not those of its proof"),
        (lambda d: first(d)["contacts"][0].update(link="palm"), "contacts are not those of its proof"),
        (lambda d: first(d)["slacks"].update(more=1.0), "slacks are not those of its proof"),
        (lambda d: first(d)["slacks"].popitem(), "slacks are not those of its proof"),
        (lambda d: first(d).update(object_pose=None), "object_pose are not those of its proof"),
        (lambda d: first(d)["object_pose"].pop("quaternion"), "object_pose are not those of its proof"),
    ],
)
def test_what_is_left_out_or_added_is_refused(change: Change, words: str) -> None:
    assert reason(changed("found", change)).startswith(f"configuration 0: {words}")


def test_the_same_configuration_twice_is_no_spread() -> None:
    def doubled(data: Data) -> None:
        data["answer"]["configurations"][1] = first(data)

    assert "spread: is " in reason(changed("found", doubled))
    doubled_and_said = changed("found", lambda d: (doubled(d), said(spread=0.0)(d)))
    assert replay(doubled_and_said).ok  # two of the same are 0 apart


def test_a_task_in_which_nothing_can_be_proved_is_refused_as_a_whole() -> None:
    def crooked(data: Data) -> None:
        data["task"]["hand"]["links"][9]["pose"][0][0] += 1e-3

    (part,) = replay(changed("found", crooked)).parts
    assert (part.name, part.claim) == ("task", "")
    assert "does not stand at a rotation" in part.refused


def test_the_proof_of_another_task_is_none() -> None:
    """The index finger's limits are so that it cannot be where it is said to be."""

    def narrow(data: Data) -> None:
        joint = next(j for j in data["task"]["hand"]["joints"] if j["name"] == "index_proximal")
        joint["limits"] = [0.0, 1e-3]

    assert "joint index_proximal comes to" in reason(changed("found", narrow))
    assert math.isfinite(replay(changed("found", narrow)).parts[0].figures["gap"])


# --- each claim alone ---


def searched(**keys: Any) -> _Searched:
    said = {"by": "contacts 0 and 1", "nodes": 4, "discarded": 1, "depth": 0, "pending": 0, "smallest": 0, "largest": 0}
    return _Searched(Fields(said | keys, "searched"))


@pytest.mark.parametrize(
    ("by", "count", "contacts"),
    [
        ("contact 0", 1, ((0,), False)),
        ("contact 1", 1, None),
        ("contacts 0 and 1", 2, ((0, 1), False)),
        ("contacts 0, 2 and 3", 4, ((0, 2, 3), False)),
        ("contacts 0, 2 and 3", 3, None),
        ("contacts 0, 1", 3, ((0, 1), False)),
        ("contact 2 and the object's position", 3, ((2,), True)),
        ("contacts 0, 2 and the object's position", 3, ((0, 2), True)),
        ("contacts 0, 2 and the object's position", 2, None),
        ("contacts 1 and 0", 2, None),
        ("contacts 0 and 0", 2, None),
        ("contacts 0, 0 and the object's position", 2, None),
        ("the object's position", 2, None),
        ("contacts 0 and 1, more or less", 2, None),
        ("all contacts 0 and 1", 2, None),
        ("contacts 0 and its position", 2, None),
        (f"contact {'0' * 8}1", 2, ((1,), False)),
        (f"contact {'0' * 9}1", 2, None),
        ("contact " + "9" * 5000, 2, None),  # which Python turns into no number
        (f"contacts 0 and {'9' * 5000}", 2, None),
    ],
)
def test_which_contacts_a_search_names(by: str, count: int, contacts: Any) -> None:
    assert searched(by=by).contacts(count) == contacts


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"by": 3}, "^searched.by: is 3; a text is needed$"),
        ({"nodes": -1}, "^searched.nodes: is -1; a whole number of 0 or more"),
        ({"pending": 0.5}, "^searched.pending: is 0.5; a whole number"),
        ({"smallest": -0.5}, "^searched.smallest: is -0.5; 0 or more is needed$"),
        ({"largest": -0.5}, "^searched.largest: is -0.5; 0 or more is needed$"),
        ({"discarded": 1.0000001}, "^searched: has a share beyond 1, or a smallest box larger than the largest$"),
        ({"smallest": 0.5, "largest": 0.25}, "^searched: has a share beyond 1, or a smallest box larger"),
        ({"more": 1}, "^searched.more: is not a known field"),
    ],
)
def test_what_no_search_says(change: Data, line: str) -> None:
    assert searched(smallest=0.5, largest=0.5).discarded == 1
    with pytest.raises(BadFile, match=line):
        searched(**change)


LESS = "NONE of a search that discarded less than all or did not end"


@pytest.mark.parametrize(
    ("verdict", "stop", "found", "said", "nodes", "resumable", "fault"),
    [
        ("found", "complete", 1, None, 0, False, ""),
        ("found", "time", 2, {"discarded": 0.5}, 4, False, ""),
        ("found", "complete", 1, {}, 4, False, "FOUND of a search that discarded all"),
        ("none", "complete", 0, {}, 4, False, ""),
        ("none", "complete", 0, {"pending": 1}, 4, False, LESS),
        ("none", "time", 0, {}, 4, False, LESS),
        ("none", "complete", 0, {"discarded": 0.999}, 4, False, LESS),
        ("none", "complete", 0, None, 0, False, LESS),
        ("none", "complete", 0, {}, 3, False, "nodes is 3, of the search 4"),
        ("none", "complete", 0, {}, 4, True, "NONE with a state to go on from"),
        ("undecided", "time", 0, None, 0, True, ""),
        ("undecided", "time", 0, {"discarded": 0.5}, 4, True, ""),
        ("undecided", "complete", 0, {"discarded": 0.5}, 4, True, "UNDECIDED of a search that is complete"),
        ("undecided", "complete", 0, None, 0, True, "UNDECIDED of a search that is complete"),
        ("undecided", "time", 0, {}, 4, True, "UNDECIDED of a search that discarded all"),
        ("undecided", "time", 0, None, 1, True, "nodes is 1, of the search 0"),
        ("undecided", "time", 0, None, 0, False, "UNDECIDED without a state to go on from"),
    ],
)
def test_which_keys_contradict_each_other(
    verdict: str, stop: str, found: int, said: Data | None, nodes: int, resumable: bool, fault: str
) -> None:
    of = None if said is None else searched(**said)
    assert _contradiction(verdict, stop, found, of, nodes, resumable) == fault


def told(verdict: str, stop: str, search: Data | None, **more: Any) -> Data:
    """A file that no search wrote, of a task that cannot be met."""
    none = {"by": "contacts 0 and 1", "nodes": 4, "discarded": 1, "depth": 0, "pending": 0, "smallest": 0, "largest": 0}
    answer = {"schema": "handfast/answer/1", "query": "synthesize", "verdict": verdict, "stop": stop, "seconds": 0.5}
    answer |= {"nodes": 4 if search is not None else 0, "starts": 0, "unproved": 0, "seed": 0, "configurations": []}
    answer |= {"searched": none | search if search is not None else None}
    state: Data | None = {} if verdict == "undecided" else None
    task = task_to_dict(grip(0.12))
    return {"schema": "handfast/synthesis/1", "task": task, "answer": answer, "state": state} | more


def test_the_share_of_the_space_that_an_undecided_search_discarded_is_not_replayed() -> None:
    done = replay(told("undecided", "time", {"discarded": 0.25}))
    assert (done.name, done.claim, done.reason, done.parts) == ("synthesis", "", "", ())
    share = "25 % of the space holds no configuration: the boxes that were discarded are not kept"
    assert done.not_replayed == (share, SYNTHESIS_COURSE, NAMES_CLAIM)
    assert replay(told("undecided", "time", None, checksum="x")).not_replayed == (SYNTHESIS_COURSE, NAMES_CLAIM)


def test_of_what_contradicts_itself_nothing_is_claimed() -> None:
    done = replay(told("undecided", "complete", {"discarded": 0.25}))
    assert (done.name, done.claim, done.refused) == ("synthesis", "", "UNDECIDED of a search that is complete")
    assert (done.parts, done.not_replayed) == ((), (SYNTHESIS_COURSE, NAMES_CLAIM))


def test_a_none_that_is_not_shown_again_is_not_replayed() -> None:
    done = replay(told("none", "complete", {"by": "contact 0"}))
    (part,) = done.parts
    assert (done.name, done.refused, part.name, part.ok) == ("synthesis", "", "none", False)
    assert part.reason.startswith("NONE rests on the search itself, ask it again: of contact 0 the checker")
    assert done.not_replayed == (part.reason, SYNTHESIS_COURSE, NAMES_CLAIM)
    shown = replay(told("none", "complete", {}))
    assert shown.ok
    assert (shown.name, shown.not_replayed) == ("synthesis", (SYNTHESIS_COURSE, NAMES_CLAIM))


@pytest.mark.parametrize(("boxes", "words"), [(1, "1 box"), (7, "7 boxes")])
@pytest.mark.parametrize("origin", [False, True])
def test_what_the_checker_finds_of_contacts_by_itself(
    boxes: int, words: str, origin: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    task = read_task(task_to_dict(grip(0.12)))
    by = "contact 1 and the object's position" if origin else "contacts 0 and 1"
    for shown in (True, False):

        def found(of: Any, which: Any, *, origin: bool, shown: bool = shown) -> Any:
            assert (of, which, origin) == (task, (1,) if "position" in by else (0, 1), "position" in by)
            return SimpleNamespace(boxes=boxes, discarded=0.25, shown=shown, axes=shown)

        monkeypatch.setattr("handfast.proofs.synthesis.impossible", found)
        monkeypatch.setattr("handfast.proofs.synthesis.impossible_at_every_pose", lambda _: None)
        done = _none(task, searched(by=by))
        assert (done.name, done.figures, done.ok) == ("none", {"boxes": boxes}, shown)
        bounded = ", where axes of the object are bounded" if shown else ""
        assert done.claim == f"{by} exclude each other{bounded}, by {words} of the checker's own"
        ask = "NONE rests on the search itself, ask it again: "
        share = f"of {by} the checker by itself could discard 25 % of the space in {words}"
        assert done.refused == ("" if shown else ask + share)


def test_every_pose_is_asked_for_by_its_own_words(monkeypatch: pytest.MonkeyPatch) -> None:
    task, every = read_task(task_to_dict(grip(0.12))), "all contacts, pose by pose"
    found = SimpleNamespace(boxes=3, discarded=1.0, shown=True, axes=False)
    monkeypatch.setattr("handfast.proofs.synthesis.impossible_at_every_pose", lambda of: found if of is task else None)
    monkeypatch.setattr("handfast.proofs.synthesis.impossible", lambda *_, **__: None)
    done = _none(task, searched(by=every))
    assert (done.claim, done.ok) == (f"{every} exclude each other, by 3 boxes of the checker's own", True)
    for said, by in ((None, ""), (searched(by="contacts 1 and 0"), "contacts 1 and 0"), (searched(by="x"), "x")):
        done = _none(task, said)
        assert (done.name, done.claim, done.figures) == ("none", "", {})
        assert done.refused == f"NONE rests on the search itself, ask it again: '{by}' names no contacts of the task"


def test_what_follows_from_a_configuration() -> None:
    """Pressed along -z, 0.3 rad from the axis of a cap of 0.5 rad; a flat finger has no cone."""
    hand = SimpleNamespace(links=[SimpleNamespace(name=name) for name in ("palm", "a", "b")])
    regions = [SimpleNamespace(sign=-1.0, half_angle=0.5), SimpleNamespace(sign=1.0, half_angle=0.0)]
    task: Any = SimpleNamespace(hand=hand, links=(2, 1), on_hand=regions)
    up, lean = np.array([[0.0, 0, 1]] * 2), np.array([[0, 2 * np.sin(0.3), 2 * np.cos(0.3)]] * 2)
    parts = {"point": np.arange(6.0).reshape(2, 3), "normal": up, "axis": lean}
    at: Any = SimpleNamespace(**{name: [SimpleNamespace(mid=x)] for name, x in parts.items()})
    slacks = {"contact:0:cone": 9.0, "contact:1:normals": 9.0, "joint:x": 0.25}
    found = _following(task, at, slacks, np.array([1.0, 2, 3]), np.array([0.0, 0, -2, 0]))
    assert found["slacks"] == {"contact:0:cone": pytest.approx(0.5 - 0.3), "joint:x": 0.25}
    assert found["object_pose"]["position"] == [1, 2, 3]
    assert found["object_pose"]["quaternion"].tolist() == [0, 0, -1, 0]
    due = [
        {"link": "b", "point": [0, 1, 2], "normal": [0, 0, -1]},
        {"link": "a", "point": [3, 4, 5], "normal": [0, 0, -1]},
    ]
    assert found["contacts"] == due


def test_of_configurations_that_are_refused_no_spread_is_shown() -> None:
    data = changed("found", moved("position", 1e-6))
    done = replay(data)
    assert [(part.name, part.ok) for part in done.parts] == [("configuration 0", False), ("configuration 1", True)]
    first(data)["existence"].popitem()
    with pytest.raises(BadFile, match=r"^answer\.configurations\[0\]\.existence\."):
        replay(data)


def test_what_the_distance_of_configurations_is_made_of() -> None:
    """Slides and places over 0.1 m, turns as they are, the object's axes over sqrt 2, points in its frame."""
    task = read_task(task_to_dict(grip(0.12)))
    names = [task.hand.joints[j] for j in task.free]
    assert (len(names), len(task.links), task.hand.revolute[task.free[0]]) == (1, 2, False)
    R = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    p, points = np.array([0.3, 0.2, 0.1]), np.array([[0.3, 0.25, 0.1], [0.31, 0.2, 0.13]])
    at: Any = SimpleNamespace(**{
        name: SimpleNamespace(mid=value[None]) for name, value in (("rotation", R), ("position", p), ("point", points))
    })  # fmt: skip
    moved = dict.fromkeys(task.hand.joints, 7.0) | {names[0]: 0.02}
    places = [3, 2, 1, *R.ravel() / np.sqrt(2), 0.5, 0, 0, 0, -0.1, 0.3]
    np.testing.assert_allclose(_features(task, moved, at), [0.2, *places], atol=1e-14)
    turning = replace(task, hand=replace(task.hand, revolute=~task.hand.revolute))
    np.testing.assert_allclose(_features(turning, moved, at), [0.02, *places], atol=1e-14)


def test_the_spread_is_the_least_distance_of_two() -> None:
    data = changed("found", same)
    own = data["answer"]
    own["configurations"].append(own["configurations"][0])
    assert replay(data).reason.startswith("spread: is ")
    own["spread"] = 0.0
    assert replay(data).ok
    own["configurations"], own["spread"] = own["configurations"][:1], None
    assert replay(data).ok
    own["spread"] = 0.0
    assert replay(data).reason == "spread: is 0.0, of these configurations None"


def test_a_pose_has_a_quaternion_of_four_numbers() -> None:
    fault = reason(changed("found", lambda d: first(d)["object_pose"].update(quaternion=[1.0, 0, 0])))
    assert fault == "object_pose.quaternion: has 3 numbers; 4 are needed"


# --- alone ---

HOOK = """
import sys, json

class Closed:
    def find_spec(self, name, path=None, target=None):
        top = name.split(".")[0]
        mine = name in ("handfast", "handfast.proofs") or name.startswith("handfast.proofs.")
        if not (mine or top in ("numpy", "flint") or top in sys.stdlib_module_names):
            raise ImportError(f"{name} is refused")

sys.meta_path.insert(0, Closed())
from handfast.proofs.synthesis import replay
for path in sys.argv[1:]:
    print(replay(json.loads(open(path).read())).reason or "proved")
"""


def test_nothing_but_proofs_numpy_and_flint_is_needed(tmp_path: Path) -> None:
    """In a process that can import nothing else: a bundled task that can be met, and a hold that cannot be."""
    files = []
    for name, answer in (("found", synthesize(load_task("scalpel-upholding"))), ("none", synthesize(grip(0.12)))):
        files.append(tmp_path / f"{name}.json")
        answer.save(files[-1])
    run = subprocess.run([sys.executable, "-c", HOOK, *files], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.stderr == ""
    assert run.stdout.split() == ["proved", "proved"]


def scaled_down(data: Data, size: float) -> Data:
    """A gripper and a block with all lengths times a size, and what is said of their configuration."""
    hand = data["task"]["hand"]
    slides = {j["name"] for j in hand["joints"] if j["type"] == "prismatic"}
    for link in hand["links"]:
        for i in range(3):
            link["pose"][i][3] *= size
    for joint in hand["joints"]:
        joint |= {"anchor": [x * size for x in joint["anchor"]], "limits": [x * size for x in joint["limits"]]}
        joint["ref"] *= size
    for side in (contact[name] for contact in data["task"]["contacts"] for name in ("hand", "object")):
        if "cap" in side:
            side["cap"] |= {"center": [x * size for x in side["cap"]["center"]], "radius": size * side["cap"]["radius"]}
        else:
            side["bezier"] = [[[x * size for x in p] for p in row] for row in side["bezier"]]
    said, lengths = first(data), {f"position:{i}" for i in range(3)} | {f"joint:{name}" for name in slides}
    proof = said["existence"]
    each = zip(proof["dependent"], proof["radii"], strict=True)
    proof["radii"] = [r * (size if name in lengths else 1) for name, r in each]
    for joints in (said["joints"], proof["joints"]):
        joints.update({name: size * joints[name] for name in slides & joints.keys()})
    for pose in (said["object_pose"], proof):
        pose["position"] = [x * size for x in pose["position"]]
    for contact in said["contacts"]:
        contact["point"] = [x * size for x in contact["point"]]
    said["slacks"] = {name: x * (size if name in lengths else 1) for name, x in said["slacks"].items()}
    return data


@pytest.mark.parametrize("size", [1.0, 2.0**-30])
def test_what_is_said_of_a_configuration_counts_beside_the_object(size: float) -> None:
    """The block is 50 mm wide; fingers move by 40 mm at most."""
    assert read_task(scaled_down(changed("gripped", same), size)["task"]).size < 0.1 * size
    assert reason(scaled_down(changed("gripped", same), size)) == ""
    for by, words in ((3e-9, "are not those of its proof"), (1e-11, "")):
        for where in ("position", "point", "joints", "slacks"):
            data = scaled_down(changed("gripped", same), size)
            at = first(data)
            if where == "position":
                at["object_pose"]["position"][0] += by * size
            elif where == "point":
                at["contacts"][0]["point"][1] += by * size
            elif where == "joints":
                at["joints"] = {name: x + by * size for name, x in at["joints"].items()}
            else:
                at["slacks"]["joint:left_slide"] += by * size
            assert words in reason(data), where
            assert bool(words) == bool(reason(data)), where


def test_a_configuration_that_is_said_is_the_exact_one_and_not_of_a_wide_box() -> None:
    """The block is touched where both fingers have moved by 15 mm; the floats of a wide box may say 24.9 mm."""
    data = changed("gripped", same)
    said = first(data)
    proof = said["existence"]
    proof |= {"joints": {"left_slide": 0.0249}, "position": [0, 0.004, 0.095], "quaternion": [1, 0, 0, 0]}
    proof["contacts"] = [{"link": c["link"], "object": [0.5, 0.5], "hand": None} for c in proof["contacts"]]
    proof["dependent"] = ["position:1", "joint:left_slide", *(f"contact:{k}:{n}" for k in (0, 1) for n in "st")]
    proof["radii"] = [0.03, 0.0149, *[1e-4] * 4]
    done = replay(data)
    assert done.reason.startswith("configuration 0: joints of the exact configuration may be 0.0099 from what is said")
    assert done.parts[0].figures["step"] < 1  # there is one in the box


def test_where_a_flat_fingertip_is_touched_is_that_of_the_solution(tmp_path: Path) -> None:
    """u of its 20 mm and 30 mm, of a box as wide as a fifth of it; what is left to its edge is told, too."""
    pad, balls = [[[x, 0, z] for z in (0.03, 0.06)] for x in (-0.01, 0.01)], {"center": [0, 0, 0], "radius": 0.02}
    contacts = [
        {
            "hand": {"link": f"{side}_finger", "region": {"bezier": pad, "flip": side == "right"}},
            "object": {"region": {"cap": balls | {"axis": [0, y, 0], "half_angle": 1.0}}},
        }
        for side, y in (("left", 1), ("right", -1))
    ]
    file = tmp_path / "pads.json"
    task = {"schema": "handfast/task/1", "hand": "parallel-gripper", "object": None, "contacts": contacts}
    file.write_text(json.dumps(task))
    data = synthesize(load_task(file), count=1).to_file()
    said = first(data)
    proof = said["existence"]
    u, number = proof["contacts"][1]["hand"][0], proof["dependent"].index("contact:1:u")
    assert 0.2 < u < 0.8
    proof["radii"][number] = 0.1
    for off, words in ((0.0, ""), (0.05, "contacts of the exact configuration may be 0.05 from what is said")):
        proof["contacts"][1]["hand"][0] = u - off
        said["slacks"]["contact:1:u"] = min(u - off, 1 - (u - off))
        assert reason(data) == (words and f"configuration 0: {words}")


def test_bounds_of_axes_are_named_where_they_exclude_contacts() -> None:
    """Two contacts that a gripper makes, but not with an object that is turned."""
    data = changed("none", same)
    data["task"] = changed("gripped", same)["task"]
    assert not replay(data).ok
    data["task"]["pose"]["axes"][1] = [[-0.1, 0.1], [-0.1, 0.1], [0.9, 1.0]]
    done = replay(data)
    assert done.ok
    assert done.parts[0].claim.startswith(
        "contacts 0 and 1 exclude each other, where axes of the object are bounded, by"
    )


def test_joints_that_follow_by_gears_are_where_the_solution_is() -> None:
    """A knob that drives both fingers, 10^3 times as far: 10^-9 of it is 1 um of these."""
    data = changed("gripped", same)
    hand, said = data["task"]["hand"], first(data)
    names = [j["name"] for j in hand["joints"]]
    assert names == ["left_slide", "right_slide"]
    knob = {"name": "knob", "type": "revolute", "axis": [0, 0, 1], "anchor": [0, 0, 0], "limits": [0, 1], "ref": 0.0}
    hand["joints"].append(knob)
    hand["couplings"] = [{"joint": k, "leader": 2, "ratio": 1000.0, "offset": 0.0} for k in (0, 1)]
    proof, wide = said["existence"], said["joints"]["left_slide"]
    proof["dependent"] = [x.replace("joint:left_slide", "joint:knob") for x in proof["dependent"]]
    slacks = "slacks are not those of its proof"  # those that are said are the fingers'
    for off, words in ((0.0, slacks), (9e-10, "joints of the exact configuration may be 9e-07 from what is said")):
        proof["joints"] = {"knob": wide / 1000 + off}
        at = 1000.0 * proof["joints"]["knob"]
        said["joints"] = {"left_slide": at, "right_slide": at, "knob": proof["joints"]["knob"]}
        assert reason(data) == f"configuration 0: {words}"


def test_an_orientation_is_that_of_the_solution_however_short_the_quaternion_is() -> None:
    """A thousandth of a component of length 1 is as much of one of length 1/1000."""
    for scale in (1.0, 2e-3):
        data = changed("gripped", same)
        proof = first(data)["existence"]
        proof["quaternion"] = [x * scale for x in proof["quaternion"]]
        proof["radii"] = [
            r * (scale if "quaternion" in name else 1)
            for name, r in zip(proof["dependent"], proof["radii"], strict=True)
        ]
        assert reason(data) == ""
