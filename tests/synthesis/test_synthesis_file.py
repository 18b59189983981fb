"""Saved syntheses: what is saved is replayed, what was changed is refused, the task in the file is the task."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import handfast
from handfast.core.answer import Reach
from handfast.core.errors import InputError
from handfast.proofs.synthesis import NAMES_CLAIM, SYNTHESIS_COURSE
from handfast.synthesis import synthesis_file
from handfast.synthesis.embedded_task import digest, fingerprint, task_from_dict, task_to_dict
from handfast.synthesis.query import synthesize
from handfast.synthesis.synthesis_answer import Searched, Synthesis
from handfast.synthesis.task import PoseBounds
from tests.support.holds import LARGE, pinch


@pytest.mark.parametrize("count", [1, 3])
def test_what_is_saved_is_proved(count: int, tmp_path: Path) -> None:
    answer, path = synthesize(pinch(), count=count), tmp_path / "s.json"
    answer.save(path)
    done = handfast.verify(path)
    assert done.ok, done.reason
    assert [part.name for part in done.parts] == [*(f"configuration {i}" for i in range(count)), "spread"]
    assert handfast.verify(answer).ok
    back = synthesis_file.load_synthesis(path)
    assert (back.verdict, back.seed, back.spread) == (answer.verdict, answer.seed, answer.spread)
    for a, b in zip(answer.solutions, back.solutions, strict=True):
        assert np.array_equal(a.q, b.q)
        assert dict(a.existence.coordinates) == dict(b.existence.coordinates)
    with pytest.raises(InputError, match="exists already; give --force to write over it"):
        answer.save(path)


def test_verification_needs_no_search(found: Synthesis, tmp_path: Path) -> None:
    found.save(tmp_path / "s.json")
    code = (
        "import sys, handfast; ok = handfast.verify(sys.argv[1]).ok; "
        "bad = [m for m in sys.modules if 'synthesis.search.kernel' in m or 'prover' in m or m == 'numba'];"
        "print(ok, bad)"
    )
    run = subprocess.run([sys.executable, "-c", code, tmp_path / "s.json"], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "True []"


def test_an_undecided_answer_claims_nothing(undecided: Synthesis, tmp_path: Path) -> None:
    undecided.save(tmp_path / "s.json")
    done = handfast.verify(tmp_path / "s.json")
    assert done.ok
    assert done.parts == ()
    assert done.replayed == ()


def test_what_was_replayed_is_said(found: Synthesis, undecided: Synthesis) -> None:
    done = found.verify()
    assert done.replayed == ("an exact one exists in its box",)
    named = done.part("configuration 0")
    assert named is not None
    assert named.replayed == done.replayed
    assert done.not_replayed == (SYNTHESIS_COURSE, NAMES_CLAIM)
    done = undecided.verify()
    assert done.replayed == ()
    assert re.fullmatch(r"\S+ % of the space holds no configuration: .* are not kept", done.not_replayed[0])


def test_configurations_belong_to_the_task_and_to_their_proofs(found: Synthesis) -> None:
    (first, *_) = found.solutions
    other = replace(found.task, pose=PoseBounds([[5, 6]] * 3, PoseBounds.none().axes))
    assert "pose.position[0] comes to" in replace(found, task=other).verify().reason
    wider = replace(found.task, pose=PoseBounds([[-9, 9]] * 3, PoseBounds.none().axes))
    done = replace(found, task=wider).verify()
    assert done.reason == "configuration 0: slacks are not those of its proof"  # those of the bounds are missing
    turned = np.diag([1, -1, -1, 1.0]) @ first.pose
    for change, reason in (
        ({"q": first.q + 1}, r"joints are not those of its proof: \w+ is not at the value that is proved"),
        ({"pose": turned}, "object_pose are not those of its proof"),
        ({"points": first.points + 1e-6}, "contacts are not those of its proof"),
        ({"normals": -first.normals}, "contacts are not those of its proof"),
    ):
        done = replace(found, solutions=(replace(first, **change),)).verify()
        assert re.fullmatch(f"configuration 0: {reason}", done.reason)


def test_none_is_shown_anew_by_the_checker(none: Synthesis, tmp_path: Path) -> None:
    none.save(tmp_path / "s.json")
    done = handfast.verify(tmp_path / "s.json")
    assert done.ok
    assert done.replayed == ("contacts 0 and 1 exclude each other, by 1 box of the checker's own",)
    assert done.not_replayed == (SYNTHESIS_COURSE, NAMES_CLAIM)


@pytest.mark.parametrize(
    ("by", "why"),
    [
        ("all contacts", "'all contacts' names no contacts of the task"),
        ("contacts 0 and 2", "'contacts 0 and 2' names no contacts of the task"),
        ("contacts 1 and 0", "'contacts 1 and 0' names no contacts of the task"),
        ("contact 0", r"of contact 0 the checker by itself could discard 0 % of the space in 0 boxes"),
        (
            "contact 0 and the object's position",
            r"of contact 0 and .* could discard \S+ % of the space in \d+ boxes",
        ),
    ],
)
@pytest.mark.slow
def test_none_that_the_checker_does_not_show_is_refused(by: str, why: str, none: Synthesis) -> None:
    assert none.searched is not None
    done = replace(none, searched=replace(none.searched, by=by)).verify()
    assert not done.ok
    assert re.fullmatch(f"none: NONE rests on the search itself, ask it again: {why}", done.reason)
    assert done.not_replayed == (done.reason.removeprefix("none: "), SYNTHESIS_COURSE, NAMES_CLAIM)
    assert done.replayed == ()


@pytest.mark.slow
def test_none_of_a_task_that_can_be_met_is_refused(found: Synthesis) -> None:
    searched = Searched("contacts 0 and 1", 1, 1.0, 1, 0, 0.0, 0.0)
    none = replace(found, verdict=Reach.NONE, solutions=(), searched=searched)
    assert re.match(
        "none: NONE rests on the search itself, .* contacts 0 and 1 the checker by itself", none.verify().reason
    )
    words = "NONE of a search that discarded less than all or did not end"
    for change in (None, replace(searched, discarded=0.5), replace(searched, pending=1)):
        assert replace(none, searched=change).verify().reason == words


def changed(answer: Synthesis, change: Callable[[dict[str, Any]], Any], *, seal: bool) -> dict[str, Any]:
    """The file with a change, as one who does not know of the checksum, or does, would write it."""
    data = json.loads(json.dumps(answer.to_file()))
    change(data)
    if seal:
        data.pop("checksum")
        data["checksum"] = digest(data)
    return data


def first(data: dict[str, Any]) -> dict[str, Any]:
    return data["answer"]["configurations"][0]


def moved(data: dict[str, Any], by: float) -> None:
    first(data)["existence"]["position"][2] += by


def limit(data: dict[str, Any], name: str, ends: list[float]) -> None:
    joint = next(j for j in data["task"]["hand"]["joints"] if j["name"] == name)
    joint["limits"] = ends


def verdict(data: dict[str, Any], word: str) -> None:
    data["answer"]["verdict"] = word


def searched(data: dict[str, Any], discarded: float = 1.0) -> None:
    of = {"by": "contacts 0 and 1", "nodes": 0, "depth": 0, "pending": 0, "smallest": 0.0, "largest": 0.0}
    data["answer"]["searched"] = of | {"discarded": discarded}


FAULTS: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "a coordinate": (lambda d: moved(d, 1e-4), "configuration 0: the floats do not meet the equations"),
    "a joint that is said": (
        lambda d: first(d)["joints"].update(index_middle=0.3),
        "joints are not those of its proof",
    ),
    "a point that is said": (lambda d: first(d)["contacts"][0]["point"].reverse(), "contacts are not those"),
    "a slack that is said": (lambda d: first(d)["slacks"].update({"contact:0:cone": 0.5}), "slacks are not those"),
    "a label": (
        lambda d: first(d)["existence"]["dependent"].__setitem__(0, "joint:ring_proximal"),
        "'joint:ring_proximal' is no coordinate of this task",
    ),
    "two labels": (
        lambda d: first(d)["existence"]["dependent"].__setitem__(0, first(d)["existence"]["dependent"][1]),
        "is dependent twice",
    ),
    "a radius": (lambda d: first(d)["existence"]["radii"].__setitem__(0, 0.0), "the radius of .* is 0; it must be"),
    "large radii": (lambda d: first(d)["existence"].update(radii=[0.5] * 6), "configuration 0: the box is too wide"),
    "a tight limit": (lambda d: limit(d, "index_proximal", [0.0, 1e-3]), "joint index_proximal comes to"),
    "the normal of a region": (lambda d: d["task"]["contacts"][0]["object"].update(flip=False), "configuration 0: "),
    "an undecided verdict": (lambda d: verdict(d, "undecided"), "state: is missing; the answer is undecided"),
    "all discarded beside it": (lambda d: searched(d), "FOUND of a search that discarded all"),
    "more boxes than those of the search": (lambda d: d["answer"].update(nodes=3), "nodes is 3, of the search 0"),
    "a spread of one": (lambda d: d["answer"].update(spread=0.5), "spread: is 0.5, of these configurations None"),
    "a share beyond 1": (lambda d: searched(d, discarded=1.5), "answer.searched: has a share beyond 1"),
    "a pose that is turned": (
        lambda d: first(d)["object_pose"]["quaternion"].reverse(),
        "configuration 0: object_pose are not those of its proof",
    ),
    "a joint that is free of its coupling": (
        lambda d: first(d)["joints"].update(ring_distal=0.3),
        "ring_distal does not follow its coupling",
    ),
    "an unused joint beyond its limits": (
        lambda d: first(d)["joints"].update(ring_proximal=3.0),
        "ring_proximal is beyond its limits",
    ),
    "no verdict": (lambda d: verdict(d, "none"), "NONE with a configuration"),
    "no configurations": (lambda d: d["answer"]["configurations"].clear(), "FOUND without a configuration"),
    "another joint": (
        lambda d: first(d)["existence"]["joints"].update(ring_proximal=0.0),
        "existence.joints: are not the free joints of the task",
    ),
    "a lost contact": (lambda d: first(d)["existence"]["contacts"].pop(), "has 1 entries; the task has 2 contacts"),
    "a region's parameter": (
        lambda d: first(d)["existence"]["contacts"][0].update(hand=[0.5, 0.5]),
        "contacts\\[0\\].hand: needs null, the region is a cap",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_no_fault_passes(name: str, pinched: Synthesis, tmp_path: Path) -> None:
    """Without its checksum a changed file is refused as a whole; with it, for what is wrong."""
    change, reason = FAULTS[name]
    path = tmp_path / "s.json"
    path.write_text(json.dumps(changed(pinched, change, seal=False)))
    with pytest.raises(InputError, match="checksum: does not fit: the file was changed after it was written"):
        synthesis_file.load(path)
    with pytest.raises(InputError, match="checksum: does not fit: the file was changed after it was written"):
        handfast.verify(path)
    path.write_text(json.dumps(changed(pinched, change, seal=True)))
    try:
        said = handfast.verify(path).reason
    except InputError as fault:
        said = str(fault)
    assert re.search(reason, said), said


def test_harmless_changes_are_seen_too(pinched: Synthesis, undecided: Synthesis, tmp_path: Path) -> None:
    """A wider limit leaves the proof right, a lost box the search wrong: the checksum refuses both."""
    path = tmp_path / "s.json"
    path.write_text(json.dumps(changed(pinched, lambda d: limit(d, "index_middle", [-3.0, 3.0]), seal=False)))
    with pytest.raises(InputError, match="checksum"):
        handfast.verify(path)
    for change in ({"block": 0}, {"seed": 4}, {"prover": {}}):
        path.write_text(json.dumps(changed(undecided, lambda d, c=change: d["state"].update(c), seal=False)))
        with pytest.raises(InputError, match="checksum"):
            synthesize(pinch(LARGE), resume=path)


def test_another_task_with_a_right_seal_is_not_resumed(undecided: Synthesis, tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    path.write_text(json.dumps(changed(undecided, lambda d: limit(d, "index_proximal", [0, 0.3]), seal=True)))
    with pytest.raises(InputError, match=r"state\.fingerprint: is of another task"):
        synthesize(pinch(LARGE), resume=path)


def test_a_file_without_its_checksum_is_refused(pinched: Synthesis, tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    path.write_text(json.dumps(changed(pinched, lambda d: d.pop("checksum"), seal=False)))
    with pytest.raises(InputError, match="checksum: is missing"):
        handfast.verify(path)


@pytest.mark.parametrize(
    "text, line",
    [
        (
            "{}",
            "schema: is missing; 'handfast/result/1' or .* or 'handfast/contacts/1' is needed",
        ),
        ('{"schema": "handfast/task/1"}', r"schema: is 'handfast/task/1'; 'handfast/result/1' or "),
        ('{"schema": "handfast/synthesis/1"}', "checksum: is missing"),
        ("[1]", "schema: is missing"),
    ],
)
def test_other_files_are_refused(text: str, line: str, tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    path.write_text(text)
    with pytest.raises(InputError, match=line):
        handfast.verify(path)


# --- the embedded task ---------------------------------------------------------------------------


def test_an_embedded_task_is_the_task() -> None:
    axes = np.tile([-1.0, 1.0], (3, 3, 1))
    axes[0, 1] = [-1.0, 0.5]
    pose = PoseBounds(np.array([[-np.inf, 0.3], [0, 1], [-np.inf, np.inf]]), axes)
    task = pinch(pose=pose, limits={"index_middle": (0.1, 0.7)})
    back = task_from_dict(json.loads(json.dumps(task_to_dict(task))))
    assert np.array_equal(back.pose.position, pose.position)
    assert np.array_equal(back.pose.axes, pose.axes)
    assert np.array_equal(back.hand.limits, task.hand.limits)
    assert back.hand.couplings == task.hand.couplings
    assert back.hand.joint_names == task.hand.joint_names
    q = 0.3 * np.ones(task.hand.l)
    assert np.allclose(back.hand.link_poses(q), task.hand.link_poses(q), atol=1e-15)
    assert all(
        np.array_equal(a.object.points, b.object.points)
        for a, b in zip(back.contact_pairs, task.contact_pairs, strict=True)
    )
    assert [t.object.flip for t in back.contact_pairs] == [t.object.flip for t in task.contact_pairs]


def test_fingerprints_tell_tasks_apart() -> None:
    mark = fingerprint(task_to_dict(pinch()))
    assert mark == fingerprint(task_to_dict(replace(pinch(), name="other")))
    others = [
        pinch(edge=0.03 + 1e-12),
        pinch(limits={"index_middle": (0.0, 1.0)}),
        pinch(pose=PoseBounds(np.array([[0, 1.0]] * 3), np.tile([-1.0, 1.0], (3, 3, 1)))),
        replace(pinch(), contact_pairs=pinch().contact_pairs[::-1]),
    ]
    assert len({mark, *(fingerprint(task_to_dict(t)) for t in others)}) == 5
