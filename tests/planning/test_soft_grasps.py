"""Soft fingers in `grasp` and `plan`: found or none by torsion, edges by hand, what may never be lost, forged files."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.flat_pads import BLOCK, jaws
from handfast import InputError, Reach, Task, grasp_for, load_body, load_hand, plan, verify
from handfast.cli import main
from handfast.core.arrays import Array
from handfast.model.body import Body
from handfast.model.grasp import Contact, Grasp
from handfast.model.shape import Shape
from handfast.planning.filters.balance import balances, circumscribed, imbalance, least_load_factor, load_factor, rim
from handfast.planning.grasp_for import motors_of
from handfast.planning.joined_search import JoinedSearch
from handfast.planning.load_bound import LoadBound
from handfast.planning.no_balance import NO_MOTION, NoBalance
from handfast.planning.question import Allowed, PlanLimits, PlanOptions, TaskGraspOptions
from handfast.planning.results import grasps_file
from handfast.planning.results.folder import PlanFolder
from handfast.planning.results.grasps import Grasps
from handfast.planning.results.verify import proved_grasps
from handfast.proofs import few_contacts
from handfast.proofs.convex_solids import SolidsData
from handfast.proofs.discarded_boxes import replay_no_grasp
from handfast.proofs.few_contacts import Fewest, Held
from handfast.proofs.fields import Fields
from handfast.proofs.tasks import read_task
from handfast.proofs.unbalanced import replay_unbalanced
from handfast.stability.problem.loads import Loads
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.task import ContactPair
from tests.planning.test_no_balance import cut_around
from tests.support.forged_grasps import refusals, renew
from tests.support.held_bodies import BALL, held, stone
from tests.support.holds import grip, pinch, square
from tests.support.joined_searches import collisions_of

MU, TORSION, WEIGHT = 0.5, 0.004, 0.1 * 9.81
CENTERED = Body.of([Shape("box", (0.02, 0.05, 0.02))], mass=0.1, friction=MU)
OFF = replace(CENTERED, center_of_mass=np.array([0.03, 0, 0]))  # of regions that reach to 10 mm: 20 mm or more away


def needed(arm: float, torsion: float = TORSION, weight: float = WEIGHT) -> float:
    """[N] normal force of each of two opposed fingers that carry half a weight and half of its moment about them."""
    return 0.5 * weight * float(np.hypot(1 / MU, arm / torsion))


def tiny_grip() -> Task:
    return Task.of(
        load_hand("parallel-gripper"),
        tuple(
            replace(p, object=square(s, s * 0.025, 1e-5))
            for p, s in zip(grip(0.05).contact_pairs, (1, -1), strict=True)
        ),
    )


# --- by hand ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arm", [0.0, 0.01, 0.05])
@pytest.mark.parametrize(("share", "shown"), [(0.88, True), (1.1, False)])
def test_two_fingers_carry_a_weight_beside_their_line(arm: float, share: float, shown: bool) -> None:
    loads = Loads.wrench(WEIGHT * np.array([0, 0, -1, 0, arm, 0]))
    limit = share * needed(arm)
    search = NoBalance(tiny_grip(), loads, MU, center=np.zeros(3), force_limits=limit, torsion=TORSION)
    search.run(64)
    assert search.shown == shown
    assert (search.balanced is not None) != shown
    if shown:
        regions = read_task(task_to_dict(search.task)).on_object
        proof, wrenches = json.dumps(search.to_json()), {"wrench": loads.wrenches[0]}

        def proved(torsion: float) -> bool:
            return replay_unbalanced(regions, wrenches, MU, limit, None, Fields(json.loads(proof)), torsion=torsion).ok

        assert proved(TORSION)
        assert proved(0.9 * TORSION)
        assert not arm or not proved(1.3 * TORSION)


@pytest.mark.parametrize("arm", [0.01, 0.05])
@pytest.mark.slow
def test_the_bound_is_what_both_fingers_can_carry(arm: float) -> None:
    loads = Loads.wrench(WEIGHT * np.array([0, 0, -1, 0, arm, 0]))
    bound = LoadBound(tiny_grip(), loads, MU, center=np.zeros(3), force_limits=1.0, torsion=TORSION)
    bound.run(100)
    due = 1 / needed(arm)
    assert due <= bound.factor <= 1.1 * due  # pyramids about the cones choose the twist
    assert 0.85 * due <= bound.reached <= due * (1 + 1e-9)


@pytest.mark.parametrize(("share", "shown"), [(0.93, True), (1.05, False)])
@pytest.mark.slow
def test_a_motor_too_weak_for_a_weight_beside_the_line(share: float, shown: bool) -> None:
    """One motor for both flat jaws, the block's centre of mass 5 mm off their line, 4 mm at the least.

    A motor too weak is shown with 280 boxes: with more of them a strong one is not.
    """
    arm, torsion, task = 0.005, 0.005, jaws()
    most = 2 * share * needed(arm, torsion, 9.81)
    loads = Loads.wrench(9.81 * np.array([0, 0, -1, 0, arm, 0]))
    limits = PlanLimits(torque_limits={"grip": most})
    balance = NoBalance(task, loads, MU, center=np.zeros(3), torsion=torsion)
    joined = JoinedSearch(task, collisions_of(task, BLOCK), Allowed(), balance, motors_of(task, limits))
    part = joined.sets[-1]
    while not part.over and part.boxes < (6000 if shown else 320):
        part.step()
    assert part.shown == shown
    if shown:
        data = read_task(task_to_dict(task))
        solids = SolidsData.read(Fields(json.loads(json.dumps(joined.said))), [link.name for link in data.hand.links])
        proof = json.dumps(part.to_json())
        for its, ok in ((torsion, True), (1.2 * torsion, False)):
            placements = replace(balance.placements, torsion=its)
            said = Fields(json.loads(proof))
            done = replay_no_grasp(data, solids, placements, balance.names, motors_of(task, limits), said)
            assert done.ok == ok


# --- pyramids -----------------------------------------------------------------------------------------


def test_pyramids_of_soft_fingers_are_within_and_about_their_cones() -> None:
    rng, edges = np.random.default_rng(0), rim(soft=True)
    assert np.linalg.norm(edges, axis=1) == pytest.approx(1.0)
    ways = rng.normal(size=(20_000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    least = (ways @ edges.T).max(axis=1).min()  # the support of the hull: 1 of the ball
    assert 1 / circumscribed(soft=True) <= least <= 1.02 / circumscribed(soft=True)
    assert circumscribed() == pytest.approx(1 / np.cos(np.pi / 8))


def coin(torsion: float) -> Grasp:
    return Grasp([Contact([0, 0, s * 0.001], [0, 0, -s], MU, torsion=torsion) for s in (1, -1)])


def test_soft_fingers_hold_a_coin_against_turning() -> None:
    turn = np.array([[0, 0, 0, 0, 0, 1.0]])
    assert imbalance(coin(0.0), turn)[0] == pytest.approx(1.0)
    assert imbalance(coin(1e-3), turn)[0] == 0.0
    assert balances(coin(1e-3), turn)
    assert not balances(coin(0.0), turn)
    one = Grasp([Contact([0, 0, 0.001], [0, 0, -1], MU, torsion=0.002)])
    pushed = np.array([[0, 0, 1.0, 0, 0, 0.001], [0, 0, 1.0, 0, 0, 0.003]])  # up to 2 mm
    assert imbalance(one, pushed).tolist()[0] == 0.0
    assert imbalance(one, pushed, circumscribed(soft=True))[1] > 0.0


@pytest.mark.parametrize("seed", range(4))
def test_what_forces_in_the_cones_balance_is_balanced_by_pyramids_about_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(50):
        (p, n), torsions = anywhere(rng, 3), [0.0, 0.003, 0.03]
        contacts = [Contact(*at, 0.4, torsion=t) for at, t in zip(zip(p, n, strict=True), torsions, strict=True)]
        wrench = sum(pushed(c, rng) for c in contacts)
        assert balances(Grasp(contacts), wrench[None])


def anywhere(rng: np.random.Generator, contacts: int) -> tuple[Array, Array]:
    """Points and normals (K, 3)."""
    p, n = rng.normal(size=(2, contacts, 3))
    return 0.03 * p, n / np.linalg.norm(n, axis=1, keepdims=True)


def pushed(c: Contact, rng: np.random.Generator) -> Array:
    """(6,) what a random force of a contact balances; half of them are on the edge of its cone."""
    rims = rng.normal(size=3) * [1, 1, c.torsion > 0]
    rims *= rng.choice([1.0, rng.random()]) / np.linalg.norm(rims)
    force = c.frame @ np.r_[1.0, c.friction * rims[:2]]
    return -rng.exponential() * np.r_[force, np.cross(c.position, force) + c.torsion * rims[2] * c.normal]


def test_load_factors_know_torsion() -> None:
    sides = np.array([[0, 0.02, 0], [0, -0.02, 0.0]]), np.array([[0, -1.0, 0], [0, 1.0, 0]])
    turn, one = np.array([0, 0, 0, 0, 1.0, 0]), np.ones(2)
    assert load_factor(*sides, MU, one, turn)[0] == pytest.approx(0.0, abs=1e-9)
    assert load_factor(*sides, MU, one, turn, torsion=0.01)[0] == pytest.approx(0.02)
    assert least_load_factor(*sides, MU, one, np.array([turn, -2 * turn]), torsion=0.01) == pytest.approx(0.01)


# --- no false proof -----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.slow
def test_boxes_about_placements_that_hold_with_torsion_are_never_refuted(seed: int) -> None:
    """Contacts anywhere, loads that forces in the soft cones balance, half with a limit that one of them reaches."""
    rng, hand, tip = np.random.default_rng(seed), load_hand("schunk-sah"), pinch().contact_pairs[0].hand
    lost = 0
    for k in range(30):
        K, torsion = 2 + k % 3, float(10.0 ** rng.uniform(-3, -1))
        p, n = anywhere(rng, K)
        contacts = [Contact(*at, 0.6, torsion=torsion) for at in zip(p, n, strict=True)]
        sizes = rng.exponential(size=K)
        wrench = np.zeros(6)
        for c, size in zip(contacts, sizes, strict=True):
            edge = rng.normal(size=3)
            edge *= rng.choice([1.0, 1.0, rng.random()]) / np.linalg.norm(edge)
            force = size * c.frame @ np.r_[1.0, 0.6 * edge[:2]]
            wrench -= np.r_[force, np.cross(c.position, force) + size * torsion * edge[2] * c.normal]
        limit = float(sizes.max() * (1 + 1e-9)) if k % 2 else np.inf
        pairs = [ContactPair("index_distal", tip, cut_around(c.position, c.normal, 2e-3)) for c in contacts]
        task = Task.of(hand, tuple(pairs))

        def searched(most: float, soft: float, task: Task = task, wrench: Array = wrench) -> NoBalance:
            how: dict[str, Any] = {"center": np.zeros(3), "force_limits": most, "torsion": soft}
            return NoBalance(task, Loads.wrench(wrench), 0.6 * (1 + 1e-9), **how)

        search = searched(limit, torsion * (1 + 1e-9))
        size = 10.0 ** rng.uniform(-6, 0, size=(8, 1))
        low, high = (np.clip(0.5 + s * size * rng.random((8, 2 * K)), 0, 1) for s in (-1, 1))
        boxes = np.stack([low, high], axis=2)
        assert (search.examined(boxes, np.full(8, NO_MOTION))[0] == NO_MOTION).all()
        weaker = searched(0.9 * limit, 0.5 * torsion)  # what would show it there shows nothing here
        closed, tried, _ = weaker.examined(boxes, np.full(8, NO_MOTION))
        lost += int((closed != NO_MOTION).any())
        for motion in set(tried.tolist()) - {NO_MOTION}:
            assert not search.placements.examined(boxes, weaker.motions[np.full(8, motion)]).refuted.any()
    assert lost > 3


# --- few contacts -------------------------------------------------------------------------------------


def test_how_many_soft_contacts_an_object_takes() -> None:
    shape = stone(1, 5)
    center = shape.centroid + 0.004
    assert held(shape, 0.02, center).fewest() == Fewest(3, "line")
    assert replace(held(shape, 0.02, center), torsion=1e-4).fewest() == Fewest(2, "opposed")
    turn = held(BALL, 0.75, np.zeros(3), loads=Loads.wrench([0, 0, 0, 0, 0, 0.1]), limit=1.0)
    assert turn.fewest() == Fewest(3, "force")  # 0.1 / (0.03 x 1.25)
    assert replace(turn, torsion=0.012).fewest() == Fewest(3, "force")  # 0.1 / (0.0375 + 0.012)
    assert replace(turn, torsion=0.013).fewest() == Fewest(2, "force")
    assert replace(turn, torsion=0.063).fewest() == Fewest(1)


def test_what_is_said_of_point_contacts_is_not_proved_of_soft_ones() -> None:
    one = held(stone(1, 5), 0.02, stone(1, 5).centroid + 0.004)
    said = few_contacts.to_json(one, [f"w{k}" for k in range(len(one.loads))], "thing", one.fewest())
    assert "torsion" not in said
    assert few_contacts.replay(said).ok
    soft = few_contacts.replay(said | {"torsion": 1e-4})
    assert not soft.ok
    assert "a torsion of 0.1 mm" in soft.claim
    again = few_contacts.to_json(replace(one, torsion=1e-4), [f"w{k}" for k in range(6)], "thing", Fewest(2))
    assert few_contacts.replay(json.loads(json.dumps(again))).ok
    turning = Held((), np.zeros(3), np.vstack([np.eye(6), -np.eye(6)]), 0.0)
    assert turning.opposed(0.1) == Fewest(4, "opposed")
    assert replace(turning, torsion=0.1).opposed(0.1) == Fewest(2, "opposed")


# --- grasp --------------------------------------------------------------------------------------------


def asked(body: Body, **how: Any) -> Grasps:
    return grasp_for(grip(0.05), body, jobs=1, count=1, **({"timeout": 60} | how))


@pytest.fixture(scope="module")
def found() -> Grasps:
    return asked(CENTERED, torsion=0.003)


@pytest.fixture(scope="module")
def none() -> Grasps:
    """2 x 4 mm x 1 N is less than 0.981 N at 20 mm."""
    return asked(OFF, torsion=TORSION, limits=PlanLimits(force_limit=1.0))


def test_two_soft_fingers_hold_a_weight_from_every_side(found: Grasps) -> None:
    assert found.verdict is Reach.FOUND
    (g,) = found.grasps
    assert [c.torsion for c in g.grasp.contacts] == [0.003, 0.003]
    assert not g.fragile
    assert found.verify().ok
    states = [a.witness.state for a in g.answer.checks if a.witness]
    assert len(states) == 6
    assert any(state.torsion.any() for state in states)


def test_limited_forces_have_too_little_torsion(none: Grasps, tmp_path: Path) -> None:
    assert none.verdict is Reach.NONE
    assert none.verify().ok
    none.save(tmp_path / "none.json")
    assert verify(tmp_path / "none.json").ok
    strong = asked(OFF, torsion=TORSION, limits=PlanLimits(force_limit=2.5 * needed(0.02)))
    assert strong.verdict is Reach.FOUND
    assert strong.verify().ok


def of_file(answer: Grasps) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(json.dumps(grasps_file.to_dict(answer.saved)))
    return data


def of_contacts(value: float | None) -> Callable[[dict[str, Any]], None]:
    def change(data: dict[str, Any]) -> None:
        for grasp in data["grasps"]:
            for contact in grasp["grasp"]["contacts"]:
                contact["torsion"] = value
                if value is None:
                    del contact["torsion"]

    return change


def of_question(value: float | None) -> Callable[[dict[str, Any]], None]:
    def change(data: dict[str, Any]) -> None:
        data["question"]["torsion"] = value
        if value is None:
            del data["question"]["torsion"]

    return change


def torques_left_out(data: dict[str, Any]) -> None:
    for state in data["grasps"][0]["witnesses"].values():
        state.pop("torsion", None)


FORGED = {
    "the question is about point contacts": ([of_question(None)], "torsion at its contacts is not 0 m"),
    "about softer ones": ([of_question(0.01)], "torsion at its contacts is not 0.01 m"),
    "the contacts are points": ([of_contacts(None)], "is not 0 at a point contact"),
    "the contacts are softer": ([of_contacts(0.004)], "torsion at its contacts is not 0.003 m"),
    "all are points": ([of_question(None), of_contacts(None), torques_left_out], "grasp 1"),
    "all are harder": ([of_question(1e-4), of_contacts(1e-4)], "grasp 1"),
    "witnesses without torsion": ([torques_left_out], "grasp 1"),
    "below 0": ([of_question(-0.003)], "torsion"),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_torsion_is_refused(found: Grasps, name: str) -> None:
    changes, match = FORGED[name]
    data = of_file(found)
    before = copy.deepcopy(data)
    for change in changes:
        change(data)
    assert data != before
    lines = refusals(renew(data))
    assert any(match in line for line in lines), lines


@pytest.mark.parametrize("change", ["softer", "point contacts proved, soft ones said", "no limit"])
def test_a_forged_none_is_refused(none: Grasps, change: str) -> None:
    data = of_file(none)
    if change == "softer":
        data["question"]["torsion"] = 0.03
    elif change == "no limit":
        data["question"]["force_limit"] = None
    else:
        hard = of_file(asked(OFF))
        assert proved_grasps(hard).ok
        data = hard
        data["question"]["torsion"] = 1e-4
    assert not proved_grasps(renew(data)).ok


def test_less_torsion_is_none_as_well(none: Grasps) -> None:
    data = of_file(none)
    data["question"]["torsion"] = 0.001
    assert proved_grasps(renew(data)).ok
    del data["question"]["torsion"]
    assert proved_grasps(renew(data)).ok


def test_torsion_is_part_of_the_question(found: Grasps) -> None:
    assert found.search.question != asked(CENTERED, torsion=0.004, timeout=1e-3).search.question
    assert asked(CENTERED, timeout=1e-3).search.question == asked(CENTERED, torsion=0.0, timeout=1e-3).search.question


@pytest.mark.parametrize(
    ("how", "match"),
    [
        ({"torsion": -0.001}, "torsion: is -0.001; a coefficient of torsional friction is 0 or more"),
        ({"torsion": np.nan}, "torsion: is nan"),
        ({"torsion": 0.002, "limits": PlanLimits(eta=0.1)}, "torsion: is 0.002 m; uncertain normals"),
    ],
)
def test_what_is_no_torsion_is_said_so(how: dict[str, Any], match: str) -> None:
    for kind in (TaskGraspOptions, PlanOptions):
        with pytest.raises(InputError, match=match):
            kind(**how)


def test_the_dynamics_engine_knows_no_torsion() -> None:
    with pytest.raises(InputError, match=r"torsion: is 0\.002 m; the dynamics engine"):
        PlanOptions(torsion=0.002, simulate=True)


def test_torsion_needs_friction() -> None:
    slippery = replace(CENTERED, friction=0.0)
    with pytest.raises(InputError, match=r"torsion: is 0\.002 m where friction is 0"):
        asked(slippery, torsion=0.002)
    with pytest.raises(InputError, match=r"torsion: is 0\.002 m where friction is 0"):
        plan(load_hand("parallel-gripper"), slippery, torsion=0.002)


@pytest.mark.slow
def test_the_command_says_it(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    folder = str(tmp_path / "out")
    how = ["--torsion", "0.002", "--force-limit", "0.3", "--safety", "1", "-o", folder, "--jobs", "1"]
    assert main(["grasp", "scalpel-upholding", *how]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert out.startswith("NONE ")
    assert "a torsion of 2 mm" in out
    assert main(["verify", f"{folder}/grasps.json"]) == 0
    assert "friction 0.5, torsion 2 mm" in capsys.readouterr().out
    assert main(["grasp", "scalpel-upholding", "--torsion", "-1"]) == 2
    assert "--torsion: is -1; a coefficient of torsional friction" in capsys.readouterr().err


# --- plan ---------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_plans_have_soft_contacts(tmp_path: Path) -> None:
    hand, body = load_hand("parallel-gripper"), load_body("egg")
    loads = Loads.gravity(body, ["-z"])
    folder: PlanFolder = PlanFolder(tmp_path, "parallel-gripper", "egg")
    found = plan(hand, body, loads=loads, count=1, jobs=1, torsion=0.003, journal=folder, timeout=120)
    assert found.grasps
    assert {c.torsion for g in found.grasps for c in g.grasp.contacts} == {0.003}
    assert found.verify().ok
    done = verify(tmp_path)
    assert done.ok, done.reason
    said = json.loads((tmp_path / "plan.json").read_text("utf-8"))
    (tmp_path / "plan.json").write_text(json.dumps(said | {"torsion": 0.004}), "utf-8")
    assert "its torsion is not that of the plan, 0.004 m" in verify(tmp_path).reason
    for wrong in (None, "a", [0.005]):
        (tmp_path / "plan.json").write_text(json.dumps(said | {"torsion": wrong}), "utf-8")
        with pytest.raises(InputError, match=r"plan\.json.*torsion"):
            verify(tmp_path)
    hard = replace(found.asked, options=replace(found.asked.options, torsion=0.0))
    assert "its contacts have another torsion" in replace(found, asked=hard).verify().reason
