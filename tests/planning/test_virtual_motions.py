"""That a grasp slips whatever its motors do within their limits: cases derived by hand, what may never be lost."""

from __future__ import annotations

import copy
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import flat_pads
from benchmarks.flat_pads import BLOCK, LONG, jaws, levers
from handfast import InputError, Reach, Task, grasp_for, synthesize, verify
from handfast.core.arrays import Array
from handfast.planning.grasp_for import motors_of
from handfast.planning.joined_search import BalanceProposer, JoinedSearch
from handfast.planning.no_balance import NO_MOTION
from handfast.planning.question import PlanLimits
from handfast.planning.results import grasps_file
from handfast.planning.results.verify import proved_grasps
from handfast.proofs.chains import joint_rates
from handfast.proofs.discarded_boxes import Boxes, hand_motion
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.intervals import Dual, Interval
from handfast.proofs.posed_boxes import ContactBoxes
from handfast.proofs.tasks import read_task
from handfast.proofs.unbalanced import Motions
from handfast.stability.problem.loads import Loads
from handfast.synthesis.embedded_task import task_to_dict
from tests.support.forged_grasps import renew
from tests.support.holds import pinch
from tests.support.joined_searches import coordinates, drawn, joined, replayed
from tests.support.slow_cases import slow_after

# the weight across the way of the pads: each pushes with W / (2 mu), 9.81 N
CASES = [(jaws, "-z", 2 * 9.81, 0.02), (levers, "-x", LONG * 9.81, 0.03)]


def asked(task: Task, side: str, limit: float) -> tuple[JoinedSearch, PlanLimits]:
    limits = PlanLimits(torque_limits=dict.fromkeys(task.hand.mechanism.actuators, limit))
    return joined(task, BLOCK, Loads.gravity(BLOCK, side), 0.5, limits=limits), limits


@pytest.mark.parametrize(("make", "side", "edge", "close"), slow_after(1, CASES))
@pytest.mark.slow
def test_the_least_limit_that_holds_the_weight(
    make: Callable[[Path], Task], side: str, edge: float, close: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Just below it the proof is found, and replayed; just above it no box with the middle in it is discarded."""
    for name in ("HALF", "TURN"):
        monkeypatch.setattr(flat_pads, name, 1e-4)  # narrow regions: fewer boxes are to be discarded
    task = make(tmp_path)
    search, limits = asked(task, side, (1 - close) * edge)
    part = search.sets[-1]
    while not part.over and part.boxes < 4000:
        part.step()
    assert part.shown
    search.sets = [part]
    done = replayed(search, task, limits=limits)
    assert done.ok, done.reason
    assert done.figures["slips"]
    assert "it slips, whatever the motors do within their limits" in done.claim
    above = PlanLimits(torque_limits=dict.fromkeys(task.hand.mechanism.actuators, 1.001 * edge))
    assert not replayed(search, task, limits=above).ok
    assert not replayed(search, task, limits=PlanLimits()).ok  # gearing carries anything
    search, _ = asked(task, side, 1.001 * edge)
    for _ in range(6):
        search.sets[-1].step()
    assert not search.sets[-1].shown


# --- how the hand moves -------------------------------------------------------------------------------


def test_joints_that_couplings_drive_move_with_their_drivers() -> None:
    hand = read_task(task_to_dict(jaws())).hand
    left, right = (hand.joints.index(name) for name in ("left_slide", "right_slide"))
    own = np.zeros((2, 2))
    own[0, left], own[1, right] = 3.0, 5.0  # the right one follows the left one
    rates = joint_rates(hand, own)
    assert rates.mid[0, right] == pytest.approx(3.0)
    assert not rates.ends[1].any()


@pytest.mark.parametrize("seed", range(3))
def test_contacts_move_as_the_hand_says(seed: int) -> None:
    """The velocity of each contact's point by the hand's own Jacobian, turned into the object's frame."""
    rng, task = np.random.default_rng(seed), pinch()
    task = replace(task, hand=task.hand.with_laws("none"))
    contacts = ContactBoxes.of(read_task(task_to_dict(task)).part([seed % 2]))
    x, chart, q, pose = next(drawn(task, contacts, rng, 300))
    hand = contacts.task.hand
    own = np.where([bool(hand.driving(j)) for j in range(len(q))], 0.0, rng.normal(size=len(q)))
    boxes = Boxes.of(contacts, np.stack([x, x], axis=1)[None], np.array([chart]))
    limits = PlanLimits(torque_limits=dict.fromkeys(task.hand.mechanism.actuators, 2.0))
    moved = hand_motion(contacts, motors_of(task, limits), boxes, own[None])
    at = contacts.sides.object.at(Interval.of(x[None])).point.value.mid[0, 0]
    about = rng.normal(size=3) * 0.01

    point = Dual.constant(Interval.of((at - about)[None, None]), 0)
    found = moved.velocity(point, about[None], middle=True).value
    rates = joint_rates(hand, own[None]).mid[0]
    p = pose[:3, :3] @ at + pose[:3, 3]
    due = pose[:3, :3].T @ task.hand.jacobian(contacts.task.links[0], p, q)[:, : len(q)] @ rates
    assert np.allclose(found.mid[0, 0], due, atol=1e-9)
    assert np.abs(found.hi - found.lo).max() < 1e-8
    each = np.abs(task.hand.mechanism.R @ rates)
    assert moved.resisted[0] == pytest.approx(2.0 * each.sum(), rel=1e-9)
    assert moved.turned[0] == pytest.approx(np.abs(rates).sum(), rel=1e-9)


# --- no false proof -------------------------------------------------------------------------------------


def kept(
    task: Task, q: Array, pose: Array, points: Array, normals: Array, rng: np.random.Generator, torsion: float = 0.0
) -> Any:
    """A load (6,) that contact forces within cones of 0.5 balance, and the torques that they take from each motor."""
    hand, wrench, torques = task.hand, np.zeros(6), np.zeros(task.hand.l)
    data = read_task(task_to_dict(task)).hand
    for pair, p, n in zip(task.contact_pairs, points, normals, strict=True):
        t = np.cross(n, rng.normal(size=3))
        size, share, angle = rng.exponential(), rng.choice([0.0, 0.9, 1.0]), np.pi * rng.random() if torsion else 0.0
        force = size * (n + 0.5 * share * np.cos(angle) * t / np.linalg.norm(t))
        about = size * torsion * share * np.sin(angle) * rng.choice([-1.0, 1.0]) * n
        wrench -= np.r_[force, np.cross(p, force) + about]
        link, at = hand.link_names.index(pair.link), pose[:3, :3] @ p + pose[:3, 3]
        torques += hand.jacobian(link, at, q).T @ (pose[:3, :3] @ force)
        one = np.linalg.svd(n[None])[2][1]
        other = np.cross(n, one)  # the torque as two opposite forces, 1 m apart
        beside = hand.jacobian(link, at + pose[:3, :3] @ one, q) - hand.jacobian(link, at, q)
        torques += beside.T @ (pose[:3, :3] @ other) * (about @ n)
    leads = [j for j in range(hand.l) if not data.driving(j)]
    moves = joint_rates(data, np.eye(hand.l)[leads]).mid
    forces = np.linalg.lstsq((moves @ hand.mechanism.R.T), moves @ torques, rcond=None)[0]
    assert np.allclose(moves @ hand.mechanism.R.T @ forces, moves @ torques, atol=1e-9)
    return wrench, dict(zip(hand.mechanism.actuators, np.abs(forces) * (1 + 1e-9) + 1e-12, strict=True))


@pytest.fixture(scope="module")
def pinched() -> Any:
    task = pinch(0.03)
    task = replace(task, hand=task.hand.with_laws("none"))
    return task, synthesize(task, count=3, timeout=None).solutions


@pytest.mark.parametrize(("seed", "torsion"), [*enumerate([0.0, 0.005, 0.05])])
@pytest.mark.slow
def test_boxes_about_grasps_that_hold_within_their_limits_are_never_discarded(
    pinched: Any, seed: int, torsion: float
) -> None:
    task, found = pinched
    rng, solution = np.random.default_rng(seed), found[seed % len(found)]
    spots = solution.existence.contacts
    contact = np.concatenate([[*spot.object, *(spot.hand or ())] for spot in spots])
    both = [(p.object, spot.object) for p, spot in zip(task.contact_pairs, spots, strict=True)]
    points, normals = np.array([r.at(*at) for r, at in both]), -np.array([r.outward(*at) for r, at in both])
    wrench, torques = kept(task, solution.q, solution.pose, points, normals, rng, torsion)
    limits = PlanLimits(torque_limits=torques)
    soft = torsion * (1 + 1e-9)
    search = joined(task, BLOCK, Loads.wrench(wrench), 0.5 * (1 + 1e-9), limits=limits, torsion=soft)
    proposer = search.sets[-1].proposers[0]
    assert isinstance(proposer, BalanceProposer)
    x, chart = coordinates(proposer.contacts, task, solution.q, solution.pose, contact)
    low, high = proposer.contacts.root.T
    sizes = 10.0 ** rng.uniform(-7, 0, size=(16, 1)) * (high - low)
    lower, upper = (np.clip(x + sign * sizes * rng.random((16, len(x))), low, high) for sign in (-1, 1))
    boxes = Boxes.of(proposer.contacts, np.stack([lower, upper], axis=2), np.full(16, chart))
    with np.errstate(all="ignore"):
        tried = proposer.propose(boxes, np.full(16, NO_MOTION))
        # what would show it with a little less torque, and motions of any kind
        weak = {name: 0.9 * x for name, x in torques.items()}
        less = {"limits": PlanLimits(torque_limits=weak), "torsion": torsion}
        weaker = joined(task, BLOCK, Loads.wrench(wrench), 0.5, **less).sets[-1]
        other = weaker.proposers[0]
        assert isinstance(other, BalanceProposer)
        other.propose(boxes, np.full(16, NO_MOTION))
        motions = other.balance.motions
        assert other.reason.examined(boxes, np.full(16, len(motions) - 1)).refuted.any() == bool(len(motions))
        assert motions.joints.any()
        k = proposer.balance.add_motions(motions)
        claims = np.concatenate([np.repeat(k, 16), tried[tried >= 0]])
        which = np.concatenate([np.tile(np.arange(16), len(k)), np.flatnonzero(tried >= 0)])
        assert not proposer.reason.examined(boxes.some(which), claims).refuted.any()


# --- files ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def none() -> Any:
    """12 N for both jaws; each contact alone is known to push with no more than that, which would be enough.

    Nothing is certified: after one unit and few starts all is left to the last proof.
    """
    limits, planning = PlanLimits(torque_limits={"grip": 12.0}), sys.modules["handfast.planning.grasp_for"]
    with pytest.MonkeyPatch.context() as patch:
        for name in ("BALANCE_SHARE", "JOINED_SHARE"):
            patch.setattr(planning, name, 0.0)
        patch.setattr(planning, "FRUITLESS", 1)
        patch.setattr(planning, "synthesize", partial(synthesize, nodes=1))
        return grasp_for(jaws(), BLOCK, Loads.gravity(BLOCK, "-z"), timeout=300, friction=0.5, jobs=1, limits=limits)


@pytest.mark.slow
def test_motors_too_weak_together_are_none(none: Any, tmp_path: Path) -> None:
    assert none.verdict is Reach.NONE
    assert none.joined.shown
    none.save(tmp_path / "none.json")
    assert verify(tmp_path / "none.json").ok


def forged(change: str, data: dict[str, Any]) -> None:
    motions, question = [m for m in data["none"]["motions"] if "joints" in m], data["question"]
    match change:
        case "joints at rest":
            for motion in motions:
                del motion["joints"]
        case "joints the other way":
            for motion in motions:
                motion["joints"] = {name: -x for name, x in motion["joints"].items()}
        case "a joint that is driven":
            for motion in motions:
                motion["joints"]["right_slide"] = 1.0
        case "an unknown joint":
            motions[0]["joints"]["elbow"] = 1.0
        case "a twist the other way":
            for motion in motions:
                motion["twist"] = [-x for x in motion["twist"]]
        case "stronger motors":
            question["torque_limits"]["grip"] = 19.7
        case "motors without a limit":
            question["torque_limits"] = {}
        case "more friction":
            question["friction"] = 0.82
        case "a stop to lean on":
            laws = {"friction": 0.0, "stiffness": 0.0, "rest": [0.0, 0.0], "stops": [0.02, None]}
            data["motors"]["laws"] = {"left_slide": laws}
        case "dry friction":
            laws = {"friction": 1.0, "stiffness": 0.0, "rest": [0.0, 0.0], "stops": [None, None]}
            data["motors"]["laws"] = {"left_slide": laws}
        case "a spring":
            laws = {"friction": 0.0, "stiffness": 1.0, "rest": [0.0, 0.0], "stops": [None, None]}
            data["motors"]["laws"] = {"left_slide": laws}
        case "a motor for the other jaw":
            data["motors"]["actuators"].append({"name": "more", "joints": {"right_slide": 1.0}})
        case "another ratio":
            data["task"]["hand"]["couplings"][0]["ratio"] = 0.5
        case "a lighter block":
            question["object"]["mass"] *= 0.6


CHANGES = [
    "joints at rest",
    "joints the other way",
    "a joint that is driven",
    "an unknown joint",
    "a twist the other way",
    "stronger motors",
    "motors without a limit",
    "more friction",
    "a stop to lean on",
    "dry friction",
    "a spring",
    "a motor for the other jaw",
    "another ratio",
    "a lighter block",
]


@pytest.mark.parametrize("change", slow_after(0, CHANGES))
@pytest.mark.slow
def test_a_forged_proof_is_refused(none: Any, change: str) -> None:
    data = json.loads(json.dumps(grasps_file.to_dict(none.saved)))
    before = copy.deepcopy(data)
    forged(change, data)
    assert data != before
    renew(data)
    try:
        assert not proved_grasps(data).ok
    except InputError:
        return


def test_motions_of_joints_need_configurations() -> None:
    """Where only placements on the object are looked at, no joint is known."""

    said = {"motions": [{"loads": {"w": 1.0}, "twist": [0, 0, 1, 0, 0, 0], "joints": {"a": 1.0}}]}
    with pytest.raises(BadFile, match="has unknown joint 'a'"):
        Motions.read(Fields(said), ["w"], 2)
    assert Motions.read(Fields(copy.deepcopy(said)), ["w"], 2, ["", "a"]).joints.tolist() == [[0.0, 1.0]]
