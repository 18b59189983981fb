"""Synthesis: right answers where they are known, nothing unproved, resumed and replayed, and no fault passes."""

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
from handfast.core.answer import Reach, Stop
from handfast.core.errors import InputError
from handfast.model.hand import Coupling
from handfast.model.region import Bezier, Cap
from handfast.synthesis import queries, result_file
from handfast.synthesis.answers import Solution, Synthesis, point_and_normal
from handfast.synthesis.embedded import digest, fingerprint, task_from_dict, task_to_dict
from handfast.synthesis.placed import whole
from handfast.synthesis.queries import synthesize
from handfast.synthesis.search.prover import Disproof
from handfast.synthesis.search.starts import Certified, Starts
from handfast.synthesis.task import PoseBounds, Task, Touch
from tests.support.holds import LARGE, OPEN, flat_grip, grip, pinch


@pytest.fixture(scope="module")
def found() -> Synthesis:
    return synthesize(grip(0.05))


@pytest.fixture(scope="module")
def pinched() -> Synthesis:
    return synthesize(pinch())


@pytest.fixture(scope="module")
def undecided() -> Synthesis:
    return synthesize(pinch(LARGE), timeout=None, nodes=2000, seed=3)


# --- verdicts -----------------------------------------------------------------------------------


def test_a_block_that_fits_is_gripped(found: Synthesis) -> None:
    """The jaws stand apart by the width of the block but for its tilt."""
    assert (found.verdict, found.stop, len(found.solutions)) == (Reach.FOUND, Stop.COMPLETE, 1)
    (s,) = found.solutions
    assert s.joints["left_slide"] == s.joints["right_slide"]
    # a fingertip's centre is 5 mm behind the plane y = 0 of its finger, both normals of the block are +-y
    apart = 2 * (0.045 - s.joints["left_slide"])
    assert np.hypot(*(s.points[0] - s.points[1])[[0, 2]]) < 0.06
    assert apart >= 0.05 + 2 * 0.005 - 1e-9
    assert found.verify().ok


@pytest.mark.parametrize("width, verdict", [(0.079, Reach.FOUND), (0.081, Reach.NONE), (0.12, Reach.NONE)])
def test_it_is_found_exactly_where_it_exists(width: float, verdict: Reach) -> None:
    answer = synthesize(grip(width), timeout=60)
    assert (answer.verdict, answer.stop) == (verdict, Stop.COMPLETE)
    assert len(answer.solutions) == (verdict is Reach.FOUND)
    if verdict is Reach.NONE:
        assert answer.searched is not None
        assert (answer.searched.discarded, answer.searched.by, answer.state) == (1.0, "contacts 0 and 1", {})


def test_what_is_possible_only_on_a_limit_stays_undecided() -> None:
    """Neither certified nor excluded, however long it takes: boxes about the limit remain."""
    answer = synthesize(grip(OPEN), timeout=None)
    assert (answer.verdict, answer.stop, answer.solutions) == (Reach.UNDECIDED, Stop.RESOLUTION, ())
    assert answer.searched is not None
    assert answer.searched.pending > 0
    assert answer.searched.smallest < 1e-3


def test_a_node_limit_leaves_it_undecided(undecided: Synthesis) -> None:
    assert (undecided.verdict, undecided.stop, undecided.solutions) == (Reach.UNDECIDED, Stop.NODES, ())
    assert undecided.state
    assert undecided.searched is not None
    assert undecided.nodes >= 2000
    assert undecided.searched.pending > 0
    assert undecided.searched.discarded < 1


def test_a_candidate_that_cannot_be_proved_is_not_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The local search says: three candidates in every block, none of them certified."""

    def hopeful(starts: Starts, numbers: Any, many: int) -> tuple[list[Certified], int]:
        starts.unproved += 3
        return [], len(numbers)

    monkeypatch.setattr(Starts, "_find", hopeful)
    answer = synthesize(grip(0.05), timeout=None, nodes=1)
    assert (answer.verdict, answer.stop, answer.solutions) == (Reach.UNDECIDED, Stop.NODES, ())
    assert answer.unproved == 3 * queries.FIRST


def test_solutions_that_are_not_isolated_are_not_found() -> None:
    """Flat on flat on both sides: each side turns the block the same way, so no choice of coordinates is regular."""
    answer = synthesize(flat_grip(0.05), timeout=None, nodes=1)
    assert (answer.verdict, answer.solutions) == (Reach.UNDECIDED, ())


def test_limits_hold_of_joints_that_only_follow() -> None:
    """A follower that moves no contact keeps its limits, and with them its leader's range."""
    hand = pinch().hand
    leader, follower = hand.joint("index_proximal"), hand.joint("ring_proximal")
    tied = replace(hand, couplings=(*hand.couplings, Coupling(follower, leader, 1.0)))
    joints = list(tied.joints)
    joints[follower] = replace(joints[follower], lower=0.3, upper=0.5)
    task = replace(pinch(), hand=replace(tied, joints=tuple(joints)))
    answer = synthesize(task, count=20)
    assert len(answer.solutions) == 20
    for s in answer.solutions:
        assert 0.3 < s.joints["index_proximal"] < 0.5
        assert s.joints["ring_proximal"] == s.joints["index_proximal"]
    assert answer.verify().ok


def test_one_contact_alone() -> None:
    task = grip(0.05)
    answer = synthesize(replace(task, touches=task.touches[:1]))
    assert answer.verdict is Reach.FOUND
    assert answer.verify().ok


# --- what a configuration is ----------------------------------------------------------------------


def test_points_coincide_and_normals_oppose(pinched: Synthesis) -> None:
    """Seen from the hand: on the cap's sphere, the outward normal pointing into the object, within the cone."""
    (s,) = pinched.solutions
    links = s.task.hand.link_poses(s.q)
    for touch, point, normal in zip(s.task.touches, s.points, s.normals, strict=True):
        T = links[s.task.hand.link(touch.link)]
        centre = T[:3, :3] @ touch.hand.center + T[:3, 3]
        assert np.allclose(point, centre + touch.hand.radius * normal, atol=1e-9)
        assert np.linalg.norm(normal) == pytest.approx(1, abs=1e-12)
        assert np.arccos(normal @ T[:3, :3] @ touch.hand.axis) < touch.hand.half_angle
        inside = np.linalg.inv(s.pose) @ [*(point + 1e-3 * normal), 1]
        assert np.abs(inside[1]) < 0.015  # a millimetre further along the normal is within the block


def test_hand_patch_and_object_cap() -> None:
    """The other way round: a flat finger on a ball. All of the ball's points are as far from its centre."""
    task = grip(0.05)
    ball = Cap((0, 0, 0), 0.02, (0, 1, 0), 3.0)
    pad = Bezier(np.array([[[u, 0, v] for v in (0.03, 0.06)] for u in (-0.01, 0.01)]))
    answer = synthesize(replace(task, touches=(Touch("left_finger", pad, ball),)))
    (s,) = answer.solutions
    assert answer.verify().ok
    assert np.linalg.norm(s.points[0] - s.pose[:3, 3]) == pytest.approx(0.02, abs=1e-12)
    assert s.normals[0] == pytest.approx([0, -1, 0], abs=1e-9)
    assert {"contact:0:s", "contact:0:u", "contact:0:v"} <= set(s.slacks)
    assert s.points[0][1] == pytest.approx(0.04 - s.joints["left_slide"], abs=1e-9)


def test_region_points_and_normals() -> None:
    point, normal = point_and_normal(Cap((1, 0, 0), 2.0, (0, 0, 1), 1.0, flip=True), 0.0, 0.3)
    assert (point, normal) == (pytest.approx([1, 0, 2]), pytest.approx([0, 0, -1]))
    point, normal = point_and_normal(Bezier([[[0, 0, 0], [0, 1, 0]], [[2, 0, 0], [2, 1, 0]]]), 0.5, 0.25)
    assert (point, normal) == (pytest.approx([1, 0.25, 0]), pytest.approx([0, 0, 1]))


def test_slacks_are_those_that_the_checker_finds(pinched: Synthesis) -> None:
    (s,) = pinched.solutions
    checked = s.verify().slacks
    assert set(s.slacks) == set(checked)
    for label, slack in s.slacks.items():
        if label.endswith(":cone"):  # there a cosine
            cap = s.task.touches[int(label.split(":")[1])].hand
            slack = np.cos(cap.half_angle - slack) - np.cos(cap.half_angle)
        assert slack == pytest.approx(checked[label], abs=2e-6), label
    assert min(s.slacks.values()) > 0


def test_pose_bounds_are_kept() -> None:
    axes = np.tile([-1.0, 1.0], (3, 3, 1))
    axes[2, 2] = [0.95, 1.0]
    position = np.array([[-0.02, 0.02], [-np.inf, np.inf], [0.09, 0.12]])
    answer = synthesize(grip(0.05, pose=PoseBounds(position, axes)), count=8)
    assert len(answer.solutions) == 8
    for s in answer.solutions:
        assert s.pose[2, 2] > 0.95
        assert abs(s.pose[0, 3]) < 0.02
        assert 0.09 < s.pose[2, 3] < 0.12
        assert {"position:0", "position:2", "z_axis:2"} <= set(s.slacks)
        assert "position:1" not in s.slacks
    assert answer.verify().ok


def test_unused_joints_are_placed_within_their_limits() -> None:
    """Those that move no contact: as near to 0 as they may be, couplings followed."""
    task = pinch(limits={"ring_proximal": (0.2, 0.4), "middle_proximal": (-0.5, -0.1), "ring_middle": (0.3, 1.0)})
    (s,) = synthesize(task).solutions
    values = s.joints
    assert (values["ring_proximal"], values["middle_proximal"]) == (0.2, -0.1)
    assert values["ring_distal"] == values["ring_middle"] == 0.3
    assert values["index_distal"] == values["index_middle"] > 0
    limits = task.hand.limits
    assert ((s.q >= limits[:, 0]) & (s.q <= limits[:, 1])).all()


def test_configuration_can_be_saved_and_applied(pinched: Synthesis, tmp_path: Path) -> None:
    (s,) = pinched.solutions
    path = tmp_path / "c.json"
    handfast.model.configuration.save_configuration(s.configuration, path)
    back = handfast.load_configuration(path)
    hand, q = back.applied(handfast.load_hand(back.hand))
    assert np.array_equal(q, s.q)
    assert back.pose == pytest.approx(s.pose, abs=1e-12)
    assert hand.joint_names == s.task.hand.joint_names


# --- reproducible, stoppable, resumable --------------------------------------------------------------


def test_the_same_seed_finds_the_same(pinched: Synthesis) -> None:
    again, other = synthesize(pinch()), synthesize(pinch(), seed=1)
    assert np.array_equal(again.solutions[0].q, pinched.solutions[0].q)
    assert not np.array_equal(other.solutions[0].q, pinched.solutions[0].q)
    state = np.random.get_state()[1].copy()  # noqa: NPY002 - that it is not touched is the point
    synthesize(pinch(), count=3)
    assert np.array_equal(np.random.get_state()[1], state)  # noqa: NPY002


def test_a_time_limit_leaves_it_undecided() -> None:
    answer = synthesize(pinch(LARGE), timeout=0.3)
    assert (answer.verdict, answer.stop) == (Reach.UNDECIDED, Stop.TIME)
    assert answer.state


@pytest.mark.parametrize("when", [1, 3])
def test_ctrl_c_keeps_what_was_reached(when: int) -> None:
    """In the random starts, and in the search for a contradiction."""
    seen = []

    def step(progress: queries.Progress) -> None:
        seen.append(progress)
        if len(seen) == when:
            raise KeyboardInterrupt

    answer = synthesize(grip(OPEN), timeout=60, on_step=step)
    assert (answer.verdict, answer.stop) == (Reach.UNDECIDED, Stop.INTERRUPTED)
    again = synthesize(grip(OPEN), resume=answer, timeout=None, nodes=1)
    assert again.starts >= answer.starts


def test_ctrl_c_keeps_those_of_many_that_were_found() -> None:
    def step(progress: queries.Progress) -> None:
        if progress.found >= 5:
            raise KeyboardInterrupt

    answer = synthesize(pinch(), count=1000, on_step=step)
    assert (answer.verdict, answer.stop) == (Reach.FOUND, Stop.INTERRUPTED)
    assert 5 <= len(answer.solutions) < 1000
    assert all(solution.verify().ok for solution in answer.solutions[:20])


def test_resumed_where_it_stopped(undecided: Synthesis, tmp_path: Path) -> None:
    """From a file and from the answer, and in the end as without the stop."""
    path = tmp_path / "s.json"
    undecided.save(path)
    again = synthesize(pinch(LARGE), resume=path, timeout=None, nodes=2000, seed=99)
    assert again.verdict is Reach.UNDECIDED
    assert again.nodes >= undecided.nodes + 2000
    assert again.seed == undecided.seed == 3
    assert again.state["block"] >= undecided.state["block"]
    ended = synthesize(pinch(LARGE), resume=again, timeout=60)
    assert (ended.verdict, ended.stop) == (Reach.NONE, Stop.COMPLETE)
    assert ended.nodes > again.nodes


def test_only_an_undecided_answer_of_the_same_task_is_resumed(undecided: Synthesis, found: Synthesis) -> None:
    with pytest.raises(InputError, match=r"^resume: is answered, FOUND; only an UNDECIDED one can go on$"):
        synthesize(grip(0.05), resume=found)
    for other in (pinch(LARGE + 1e-9), pinch(LARGE, limits={"index_proximal": (0.0, 0.3)}), grip(0.05)):
        with pytest.raises(
            InputError, match=r"^resume: is of another task: its hand, limits, bounds or regions differ"
        ):
            synthesize(other, resume=undecided)


class Scripted:
    """A prover that says what it is told, so that the turns of both searches can be seen."""

    script: list[bool]
    asked: list[dict[str, Any]]

    def __init__(self, problem: Any, *, workers: int = 2) -> None:
        self.nodes = 0

    def restore(self, state: dict[str, Any]) -> None:
        self.asked.append({"restored": state})

    def run(self, *, seconds: float, nodes: int | None, on_step: Any) -> Disproof:
        self.asked.append({"seconds": seconds, "nodes": nodes})
        self.nodes += 10
        empty = self.script.pop(0)
        return Disproof(empty, "contacts 0 and 1", self.nodes, 0.5, 1, 7, 0.1, 0.2)

    def save(self) -> dict[str, Any]:
        return {"at": self.nodes}

    def leaves(self) -> np.ndarray:
        return np.zeros((0, 1))


def test_none_only_if_the_prover_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("handfast.synthesis.search.prover.Prover", Scripted)
    Scripted.script, Scripted.asked = [False, False, True], []
    answer = synthesize(grip(OPEN), timeout=None)
    assert (answer.verdict, answer.nodes, answer.state) == (Reach.NONE, 30, {})
    assert [a["seconds"] for a in Scripted.asked] == [0.0, queries.TURN, 2 * queries.TURN]
    Scripted.script, Scripted.asked = [False, False], []
    answer = synthesize(grip(OPEN), timeout=None, nodes=20)
    assert (answer.verdict, answer.stop, answer.state["prover"]) == (Reach.UNDECIDED, Stop.NODES, {"at": 20})
    Scripted.script, Scripted.asked = [True], []
    assert synthesize(grip(OPEN), timeout=None, resume=answer).verdict is Reach.NONE
    assert Scripted.asked[0] == {"restored": {"at": 20}}


def test_what_random_starts_find_ends_the_search_for_a_contradiction(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("handfast.synthesis.search.prover.Prover", Scripted)
    monkeypatch.setattr(queries, "FIRST", 0)
    Scripted.script, Scripted.asked = [False, False], []
    answer = synthesize(grip(0.05), timeout=None)
    assert (answer.verdict, answer.stop, len(Scripted.asked)) == (Reach.FOUND, Stop.COMPLETE, 1)


# --- files and replay ---------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 3])
def test_what_is_saved_is_proved(count: int, tmp_path: Path) -> None:
    answer, path = synthesize(pinch(), count=count), tmp_path / "s.json"
    answer.save(path)
    done = handfast.verify(path)
    assert done.ok, done.reason
    assert len(done.reports) == count
    assert handfast.verify(answer).ok
    back = result_file.load_synthesis(path)
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
    assert done.reports == ()


def test_none_cannot_be_replayed(tmp_path: Path) -> None:
    answer = synthesize(grip(0.12))
    answer.save(tmp_path / "s.json")
    done = handfast.verify(tmp_path / "s.json")
    assert done.reason == "NONE has no proof that can be replayed: it rests on the search itself, ask it again"


def changed(answer: Synthesis, change: Callable[[dict[str, Any]], Any], *, seal: bool) -> dict[str, Any]:
    """The file with a change, as one who does not know of the checksum, or does, would write it."""
    data = json.loads(json.dumps(result_file.to_dict(answer)))
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
    change, reason = FAULTS[name]
    path = tmp_path / "s.json"
    path.write_text(json.dumps(changed(pinched, change, seal=False)))
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


@pytest.mark.parametrize(
    "text, line",
    [
        ("{}", "schema: is missing; handfast/result/1, .* or handfast/grasps/2 is needed"),
        ('{"schema": "handfast/task/1"}', r"schema: is 'handfast/task/1'; handfast/result/1, "),
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
        np.array_equal(a.object.points, b.object.points) for a, b in zip(back.touches, task.touches, strict=True)
    )
    assert [t.object.flip for t in back.touches] == [t.object.flip for t in task.touches]


def test_fingerprints_tell_tasks_apart() -> None:
    mark = fingerprint(task_to_dict(pinch()))
    assert mark == fingerprint(task_to_dict(replace(pinch(), name="other")))
    others = [
        pinch(edge=0.03 + 1e-12),
        pinch(limits={"index_middle": (0.0, 1.0)}),
        pinch(pose=PoseBounds(np.array([[0, 1.0]] * 3), np.tile([-1.0, 1.0], (3, 3, 1)))),
        replace(pinch(), touches=pinch().touches[::-1]),
    ]
    assert len({mark, *(fingerprint(task_to_dict(t)) for t in others)}) == 5


# --- bad input ------------------------------------------------------------------------------------


def test_numbers_out_of_range() -> None:
    for arguments, line in (
        ({"count": 0}, "count: is 0; a number from 1 on is needed"),
        ({"seed": -1}, "seed: is -1; a number from 0 on is needed"),
        ({"timeout": 0.0}, "timeout: is 0 s; a positive number is needed"),
        ({"nodes": 0}, "nodes: is 0; a number from 1 on is needed"),
    ):
        with pytest.raises(InputError, match=f"^{re.escape(line)}$"):
            synthesize(grip(0.05), **arguments)


def test_couplings_that_leave_nothing_or_one_value() -> None:
    line = "limits.right_slide: leave nothing for left_slide, to which it is coupled"
    with pytest.raises(InputError, match=line):
        synthesize(grip(0.05, limits={"right_slide": (0.05, 0.06)}))
    line = "limits.right_slide: leave a single value for left_slide, to which it is coupled; widen them, or fix left_sl"
    with pytest.raises(InputError, match=line):
        synthesize(grip(0.05, limits={"right_slide": (0.02, 0.02)}))
    fixed = synthesize(grip(0.05, limits=dict.fromkeys(("left_slide", "right_slide"), (0.012, 0.012))))
    assert fixed.solutions[0].joints == {"left_slide": 0.012, "right_slide": 0.012}
    assert fixed.verify().ok


def test_whole_configuration_of_a_fixed_coupling() -> None:
    hand = replace(grip(0.05).hand, couplings=(Coupling(1, -1, 0.0, 0.013),))
    task: Task = replace(grip(0.05), hand=hand)
    assert whole(task, {"left_slide": 0.02}).tolist() == [0.02, 0.013]


def test_solution_of_another_task_is_refused(found: Synthesis) -> None:
    wrong = Solution.of(grip(0.06), found.solutions[0].existence)
    assert not wrong.verify().ok
