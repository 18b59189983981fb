"""The claims of a whole answer of synthesis: what follows is checked, what contradicts itself is refused."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest

from handfast.proofs.fields import BadFile
from handfast.proofs.pose_by_pose import impossible_at_every_pose
from handfast.proofs.replay import Refused, Replay
from handfast.proofs.synthesis import NAMES_CLAIM, SYNTHESIS_COURSE, replay
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
    assert reason(changed("found", moved(key, by))) == ""


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

    assert "does not stand at a rotation" in reason(changed("found", crooked))


def test_the_proof_of_another_task_is_none() -> None:
    """The index finger's limits are so that it cannot be where it is said to be."""

    def narrow(data: Data) -> None:
        joint = next(j for j in data["task"]["hand"]["joints"] if j["name"] == "index_proximal")
        joint["limits"] = [0.0, 1e-3]

    assert "joint index_proximal comes to" in reason(changed("found", narrow))
    assert math.isfinite(replay(changed("found", narrow)).parts[0].figures["gap"])


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
