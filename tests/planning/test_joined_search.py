"""The search for a proof that every configuration is discarded: what it finds, what it may never lose."""

from __future__ import annotations

import copy
import json
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import InputError, Reach, Stop, Task, grasp_for, load_hand, synthesize, verify
from handfast.cli import main
from handfast.cli.grasp import joined_text
from handfast.core.arrays import Array
from handfast.core.transforms import quaternion_matrix, transform
from handfast.model.body import Body
from handfast.model.region import Cap
from handfast.model.shape import Shape
from handfast.planning.evaluation import local_search
from handfast.planning.evaluation.evaluator import requests
from handfast.planning.joined_search import NO_CLAIM, ContactSetSearch
from handfast.planning.results import grasps_file
from handfast.planning.results.grasps import Grasps
from handfast.planning.results.verify import proved_grasps
from handfast.proofs.discarded_boxes import Boxes
from handfast.proofs.fields import Integers
from handfast.proofs.intervals import Interval
from handfast.proofs.posed_boxes import OBJECT_LINK, ContactBoxes
from handfast.proofs.tasks import read_task
from handfast.proofs.unbalanced import BoxBounds
from handfast.stability.problem.loads import Loads
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.task import ContactPair, PoseBounds
from tests.support.forged_grasps import renew
from tests.support.holds import grip, pinch, square
from tests.support.joined_searches import LIGHT, block, collisions_of, coordinates, drawn, joined, replayed, walled


def weights(center: Any, mass: float = 0.1) -> Loads:
    """From six sides."""
    forces = 9.81 * mass * np.vstack([np.eye(3), -np.eye(3)])
    return Loads(tuple("abcdef"), np.hstack([forces, np.cross(center, forces)]))


# --- cases known by hand ------------------------------------------------------------------------------


@pytest.mark.parametrize(("gap", "shown"), [(0.003, True), (0.006, True), (0.008, True), (0.05, False)])
@pytest.mark.slow
def test_a_wall_before_the_side_to_touch(gap: float, shown: bool) -> None:
    """The fingertip is 18 mm thick: no room for it before a wall some millimetres away, enough before one at 50 mm."""
    task = grip(0.05)
    search = joined(task, walled(gap))
    part = search.sets[0]
    assert part.chosen == (0,)
    while not part.over and part.boxes < 1500:
        part.step()
    assert part.shown == shown
    if shown:
        done = replayed(search, task)
        assert done.ok, done.reason
        assert "left_finger" in done.claim
        assert "right_finger" not in done.claim


def test_what_is_let_pass_decides() -> None:
    """A wall that the centre of the fingertip is 2 mm inside; beyond 40 mm no solids of this size overlap."""
    task, body = grip(0.05), walled(0.003)
    for depth, shown in ((6e-3, True), (0.04, False)):
        search = joined(task, body, depth=depth)
        search.run(400)
        assert search.shown == shown


def upright(lowest: float, highest: float) -> PoseBounds:
    """The block stands as the palm does, to some degrees, its middle above the palm's frame."""
    near = [[0.99, 1], [-0.06, 0.06], [-0.06, 0.06]]
    axes = np.array([near, [near[1], near[0], near[2]], [[-1, 1]] * 3])
    return PoseBounds(np.array([[-0.012, 0.012], [-0.003, 0.003], [lowest, highest]]), axes)


@pytest.mark.slow
def test_a_post_that_meets_the_palm() -> None:
    """Below the block: its end is 30 mm or more inside the palm, or 10 mm above it if it is short."""
    task = grip(0.05, pose=upright(0.09, 0.1))
    for long, shown in ((0.08, True), (0.02, False)):
        post = block((0.024, 0.024, long), (0, 0, -long / 2))
        search = joined(task, Body.of([block((0.03, 0.05, 0.03), (0, 0, 0)), post], mass=0.1))
        search.sets = search.sets[:1]
        search.run(4000 if shown else 1000)
        assert search.shown == shown
        if shown:
            done = replayed(search, task)
            assert done.ok, done.reason
            assert "palm" in done.claim


@pytest.mark.slow
def test_forces_and_walls_discard_together() -> None:
    """The line through both contacts meets the centre of mass, 8 mm off the middle, only where a wall is."""
    task, half = grip(0.05, pose=upright(0.09, 0.1)), block((0.06, 0.02, 0.08), (0.033, 0.035 + 0.004, 0))
    search = joined(task, Body.of([block((0.03, 0.05, 0.03), (0, 0, 0)), half], mass=0.1), weights([0.008, 0, 0]), 0.5)
    (*alone, both) = search.sets
    while not both.over and both.boxes < 10_000:
        both.step()
    assert both.shown
    assert both.boxes < 330  # 252; 388 where the side is that of the reason that was asked last
    for part in alone:  # as many would do, if forces or walls alone did
        while not part.over and part.boxes < both.boxes:
            part.step()
    assert not any(part.shown for part in alone)
    done = replayed(search, task)
    assert done.ok, done.reason
    assert done.figures["balance"]
    assert done.figures["collision"]


@dataclass
class Told:
    """A reason that says of every box how near it is, and which side counts; what it was asked of."""

    near: list[float]
    side: int
    asked: list[int] = field(default_factory=list)

    @property
    def reason(self) -> Any:
        return self

    def propose(self, boxes: Boxes, last: Integers) -> Integers:
        self.asked.append(len(last))
        return np.zeros(len(last), dtype=np.int64)

    def examined(self, boxes: Boxes, claims: Integers) -> BoxBounds:
        near = np.array(self.near)[boxes.charts]
        reach = np.tile(np.eye(boxes.box.shape[1])[self.side], (len(claims), 1))
        return BoxBounds(near == 1, reach, 1 - near, near)


def test_sides_are_those_of_the_nearest_reason_and_the_cheap_one_comes_first() -> None:
    part = joined(grip(0.05), walled(0.05)).sets[0]
    forces, collisions = Told([0.3, 0.6, 1.0, 0.0], side=1), Told([0.5, 0.2, 0.9, 1.0], side=2)
    part.proposers = [forces, collisions]
    boxes = Boxes.of(part.contacts, np.tile(part.contacts.root, (4, 1, 1)), np.arange(4))
    claimed, reach = part._claimed(boxes, np.arange(4), np.full((4, 2), NO_CLAIM))
    assert claimed.tolist() == [-1, -1, 0, 1]
    assert reach[:2].argmax(axis=1).tolist() == [2, 1]
    assert (collisions.asked, forces.asked) == ([4], [3])


# --- where links stand ----------------------------------------------------------------------------------


def cap_of(name: str) -> Task:
    """A cap on the last link of a hand, which couplings may move."""
    hand = load_hand(name)
    return Task.of(
        hand, (ContactPair(hand.link_names[-1], Cap((0, 0, 0.02), 0.01, (1, 0, 0), 1.0), square(1.0, 0.02)),)
    )


@pytest.mark.parametrize("make", [lambda: grip(0.05), pinch, lambda: cap_of("barrett-bh8-280")])
def test_links_stand_where_the_hand_puts_them(make: Any) -> None:
    task, rng = make(), np.random.default_rng(2)
    data = read_task(task_to_dict(task))
    for k in range(len(data.links)):
        contacts = ContactBoxes.of(data.part([k]))
        x, chart, q, pose = next(drawn(task, contacts, rng, 200))
        again, same = coordinates(contacts, task, q, pose, x[-2:])
        assert np.allclose(again, x, atol=1e-9) or same != chart
        at, poses = contacts.at(Interval.of(x[None]), np.array([chart]), 0), task.hand.link_poses(q)
        assert len(contacts.placed) > 1
        for link in contacts.placed:
            point = rng.normal(size=3)
            due = poses[link][:3, :3] @ point + poses[link][:3, 3]
            seen = at.seen(link, OBJECT_LINK, point[None]).value
            assert np.allclose(seen.mid[0], (due - pose[:3, 3]) @ pose[:3, :3], atol=1e-9)
            assert (seen.hi - seen.lo).max() < 1e-9
            other = data.links[k]
            seen = at.seen(link, other, point[None]).value
            assert np.allclose(seen.mid[0], (due - poses[other][:3, 3]) @ poses[other][:3, :3], atol=1e-9)


# --- no false proof -------------------------------------------------------------------------------------


def scattered(rng: np.random.Generator, solids: int) -> Body:
    """The block of `grip` or `pinch` with solids of all kinds about it."""
    shapes = [block((0.024, 0.028, 0.024), (0, 0, 0))]
    for _ in range(solids):
        kind = str(rng.choice(["box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh"]))
        away = rng.normal(size=3)
        pose = transform(away / np.linalg.norm(away) * rng.uniform(0.04, 0.1), quaternion_matrix(rng.normal(size=4)))
        n = {"box": 3, "sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "mesh": 0}[kind]
        if kind == "mesh":
            shapes.append(Shape.hull(rng.normal(size=(60, 3)) * 0.004, pose))
        else:
            shapes.append(Shape(kind, rng.uniform(0.004, 0.015, size=n), pose))  # type: ignore[arg-type]
    return Body.of(shapes, name="scattered", mass=0.1)


def never_discarded(part: ContactSetSearch, x: Array, chart: int, others: Integers, rng: np.random.Generator) -> int:
    """Boxes about a configuration that is free: none is emptied, none discarded; how many claims there were."""
    low, high = part.contacts.root.T
    sizes = 10.0 ** rng.uniform(-6, 0.3, size=(24, 1)) * (high - low)
    lower = np.clip(x - sizes * rng.random((24, len(x))), low, high)
    upper = np.clip(x + sizes * rng.random((24, len(x))), low, high)
    with np.errstate(all="ignore"):
        boxes = Boxes.of(part.contacts, np.stack([lower, upper], axis=2), np.full(24, chart))
        alive, kept, _ = part.contacts.narrowed(boxes.box, boxes.over, boxes.middle)
        assert alive.all()
        assert (kept[..., 0] <= x + 1e-12).all()
        assert (kept[..., 1] >= x - 1e-12).all()
        tried = np.full((24, len(part.proposers)), NO_CLAIM)
        claimed, _ = part._claimed(boxes, np.arange(24), tried)
        assert (claimed == NO_CLAIM).all()
        for other in others:  # neither does what was found elsewhere
            assert not part.collision.reason.examined(boxes, np.full(24, other)).refuted.any()
    return int((tried >= 0).sum())


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.slow
def test_boxes_about_free_configurations_are_never_discarded(seed: int) -> None:
    """Of one contact, drawn at random among solids: mujoco measures that nothing is too deep in anything."""
    rng = np.random.default_rng(seed)
    task, depth, body = *((grip(0.028), 8e-3), (pinch(0.028), 1e-3))[seed % 2], scattered(rng, 2)
    measure, search = collisions_of(task, body), joined(task, body, depth=depth)
    tried = planted = 0
    for part in search.sets[:2]:
        for _ in range(8):
            if not part.over:
                part.step()
        claims = len(part.collision.reason)
        for x, chart, q, pose in drawn(task, part.contacts, rng, 1500):
            if planted < 6 * (1 + part.chosen[0]) and measure.clearances(q, pose).free(depth, depth, depth):
                tried += never_discarded(part, x, chart, rng.integers(claims, size=min(claims, 3)), rng)
                planted += 1
    assert planted >= 4
    assert tried


@pytest.mark.parametrize("make", [lambda: grip(0.028), lambda: pinch(0.028)])
def test_boxes_about_configurations_of_synthesis_are_never_discarded(make: Any) -> None:
    task, rng = make(), np.random.default_rng(7)
    found = synthesize(task, count=8, timeout=None).solutions
    planted = 0
    body, depth = scattered(rng, 1), 8e-3
    measure, search = collisions_of(task, body), joined(task, body, depth=depth)
    for solution in found:
        if not measure.clearances(solution.q, solution.pose, requests(solution)).free(depth, depth, depth):
            continue
        for part in search.sets:
            spots = [solution.existence.contacts[k] for k in part.chosen]
            contact = np.concatenate([[*spot.object, *(spot.hand or ())] for spot in spots])
            x, chart = coordinates(part.contacts, task, solution.q, solution.pose, contact)
            part.proposers = [part.collision]
            never_discarded(part, x, chart, np.array([], dtype=np.int64), rng)
            planted += 1
    assert planted >= 3


# --- grasps of a task -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def none() -> Grasps:
    """The proof is sought to its end after a few starts, however long they took."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(local_search, "RAW", 6)
        patch.setattr(sys.modules["handfast.planning.grasp_for"], "JOINED_SHARE", 1e6)
        return grasp_for(grip(0.05), walled(0.006), LIGHT, timeout=300, friction=0.8, jobs=1)


def test_a_task_that_an_obstacle_forbids_is_none(
    none: Grasps, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (none.verdict, none.stop) == (Reach.NONE, Stop.COMPLETE)
    assert none.balance
    assert not none.balance.shown
    assert none.joined
    assert none.joined.shown
    none.save(tmp_path / "none.json")
    capsys.readouterr()
    assert main(["verify", str(tmp_path / "none.json")]) == 0
    assert "inside the object" in " ".join(capsys.readouterr().out.split())


@pytest.mark.slow
def test_what_is_left_of_an_undecided_one_is_said() -> None:
    """Boxes of the set that was discarded most, the largest of them, what has been discarded and why."""
    search = joined(grip(0.05), walled(0.012))
    assert search.searched is None
    search.run(1000)
    told = search.searched
    assert told
    assert told.open
    assert not told.shown
    assert told.proof is None
    assert 0 < told.discarded < 1
    assert set(told.open) == set(search.sets[told.contacts[0]].contacts.sides.column)
    assert "_finger are discarded" in joined_text(told, grip(0.05))
    assert json.loads(json.dumps(told.to_json()))["pending"] == told.pending


def file_of(none: Grasps) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(json.dumps(grasps_file.to_dict(none.saved)))
    return data


def forged(change: str, data: dict[str, Any]) -> None:
    proof, solids = data["none"], data["question"]["solids"]
    match change:
        case "contacts that can be made":
            proof["tree"] = [-1 if x < 0 else x for x in proof["tree"]]
        case "a point elsewhere":
            for claim in proof["collisions"]:
                claim["point"] = [0.0, 0.0, 1.0]
        case "another solid":
            for claim in proof["collisions"]:
                claim["other"] = 1 - claim["other"]
        case "another link":
            for claim in proof["collisions"]:
                claim["link"] = "right_finger"
        case "another contact":
            proof["contacts"] = [1]
        case "a smaller wall":
            solids["object"][1]["size"] = [0.001] * 3
        case "a smaller finger":
            for part in solids["links"]:
                for solid in part["solids"]:
                    solid["size"] = [x / 4 for x in solid["size"]]
        case "more let pass":
            solids["depth"] = 0.05
        case "no wall":
            solids["object"].pop()
        case "a wider region":
            points = data["task"]["contacts"][0]["object"]["bezier"]
            data["task"]["contacts"][0]["object"]["bezier"] = [
                [[10 * x, y, 10 * z] for x, y, z in row] for row in points
            ]


CHANGES = [
    "contacts that can be made",
    "a point elsewhere",
    "another solid",
    "another link",
    "another contact",
    "a smaller wall",
    "a smaller finger",
    "more let pass",
    "no wall",
    "a wider region",
]


@pytest.mark.parametrize("change", CHANGES)
def test_a_forged_proof_is_refused(none: Grasps, change: str) -> None:
    """Checksums and question are those of the changed file: the checker refuses it, or it is no such file."""
    data = file_of(none)
    before = copy.deepcopy(data)
    forged(change, data)
    assert data != before
    renew(data)
    try:
        assert not proved_grasps(data).ok
    except InputError:
        return


def test_other_solids_are_another_question(none: Grasps, tmp_path: Path) -> None:
    data = file_of(none)
    data["question"]["solids"]["object"][1]["size"][0] *= 1.5
    renew(data, question=False)
    (tmp_path / "changed.json").write_text(json.dumps(data))
    done = verify(tmp_path / "changed.json")
    assert "another question" in done.reason


@pytest.mark.slow
def test_a_search_goes_on_from_a_file() -> None:
    """Trees that were saved half way and read again end like those that were not, and what is altered is refused."""
    task, body = grip(0.05), walled(0.008)
    first = joined(task, body)
    first.sets = first.sets[:1]
    for _ in range(4):
        first.sets[0].step()
    assert not first.over
    saved = json.loads(json.dumps(first.to_json()))
    again = joined(task, body, saved=saved)
    assert again.to_json() == saved
    assert 0 < again.sets[0].boxes <= first.sets[0].boxes
    assert again.sets[0].discarded == pytest.approx(first.sets[0].discarded)
    again.sets = again.sets[:1]
    while not again.over:
        again.sets[0].step()
    assert again.shown
    assert replayed(again, task).ok
    wrong = copy.deepcopy(saved)
    k = next(k for k, x in enumerate(wrong[0]["tree"]) if x is None)
    wrong[0]["tree"][k] = -1
    with pytest.raises(InputError, match="not discarded"):
        joined(task, body, saved=wrong)
