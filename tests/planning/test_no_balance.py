"""The search for a proof that no contact forces balance the loads: what it finds, what it may never lose."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import InputError, Reach, Stop, Task, grasp_for, load_body, load_task, verify
from handfast.cli import main
from handfast.core.arrays import Array
from handfast.model.grasp import Contact, Grasp
from handfast.model.region import Bezier
from handfast.planning.filters.balance import imbalance
from handfast.planning.no_balance import NO_MOTION, NoBalance
from handfast.planning.results.grasps import Grasps
from handfast.proofs.few_contacts import replay_of_loads
from handfast.proofs.fields import Fields
from handfast.proofs.unbalanced import replay_unbalanced
from handfast.readers.load_hand import load_hand
from handfast.stability.problem.loads import Loads
from handfast.synthesis.task import ContactPair
from tests.support.forged_grasps import renew
from tests.support.holds import grip, pinch

TWO = "scalpel-upholding"  # 8.6 mm between the centre of mass and every line through both contacts


def weights(center: Any, mass: float = 0.1) -> Loads:
    """From six sides."""
    forces = 9.81 * mass * np.vstack([np.eye(3), -np.eye(3)])
    return Loads(tuple("abcdef"), np.hstack([forces, np.cross(center, forces)]))


def searched(
    task: Task, loads: Loads, friction: float = 0.5, boxes: int = 600, limit: float | None = None
) -> NoBalance:
    search = NoBalance(task, loads, friction, center=np.zeros(3), force_limits=np.inf if limit is None else limit)
    search.run(boxes)
    return search


def replayed(search: NoBalance, loads: Loads, friction: float = 0.5) -> bool:
    from handfast.proofs.tasks import read_task
    from handfast.synthesis.embedded_task import task_to_dict

    wrenches = {name: np.array(w) for name, w in loads.by_name.items()}
    proof = json.loads(json.dumps(search.to_json()))
    regions = read_task(task_to_dict(search.task)).on_object
    return replay_unbalanced(regions, wrenches, friction, search.placements.force_limits, None, Fields(proof)).ok


# --- cases known by hand -----------------------------------------------------------------------------


@pytest.mark.parametrize(("offset", "shown"), [(0.03, True), (0.0105, True), (0.0095, False), (0.0, False)])
@pytest.mark.slow
def test_edge_of_two_contacts_is_where_lines_reach(offset: float, shown: bool) -> None:
    """Squares of 10 mm half side: a line passes the centre of mass up to 10 mm beside the middle (`grip`)."""
    loads = weights([offset, 0, 0])
    search = searched(grip(0.05), loads)
    assert search.shown == shown
    assert (search.balanced is not None) == (offset == 0.0) or not shown
    assert replayed(search, loads) == shown


def triangle(turned: float) -> Task:
    """Three contacts on the sides of a wedge: their normals are turned towards +y by an angle [degrees]."""
    a = np.radians(turned)
    hand, pairs = load_hand("schunk-sah"), []
    for link, side in (("index_distal", 1.0), ("middle_distal", 1.0), ("thumb_distal", -1.0)):
        n = np.array([side * np.cos(a), np.sin(a), 0.0])
        u, v = np.array([-n[1], n[0], 0.0]), np.array([0, 0, 1.0])
        at = 0.02 * np.array([side, 0, 0]) + np.array([0, 0, 0.01 if link == "index_distal" else -0.01])
        points = np.array([[at + 2e-3 * (s * u + t * v) for t in (-1, 1)] for s in (-1, 1)])
        pairs.append(ContactPair(link, pinch().contact_pairs[0].hand, Bezier(points, False)))
    return Task.of(hand, tuple(pairs), name="wedge")


@pytest.mark.parametrize(("degrees", "shown"), [(0.0, False), (20.0, False), (40.0, True)])
def test_three_contacts_on_a_wedge_slip_off_it(degrees: float, shown: bool) -> None:
    """With mu = 0.5 (26.6 degrees) contacts squeeze a wedge of 20 degrees, and not one of 40 degrees."""
    loads = weights([0, 0, 0])
    search = searched(triangle(degrees), loads, boxes=20_000)
    assert search.shown == shown
    assert (search.balanced is not None) != shown
    if shown:
        assert replayed(search, loads)
        assert not replayed(search, loads, friction=1.0)


@pytest.mark.parametrize(("weighs", "shown"), [(0.9, False), (1.1, True)])
def test_jaws_that_push_with_little_force_let_it_slip(weighs: float, shown: bool) -> None:
    """Friction of two contacts that push with up to 1 N, mu = 0.5, carries 1 N."""
    loads = weights([0, 0, 0], weighs / 9.81)
    search = searched(grip(0.05), loads, limit=1.0, boxes=3000)
    assert search.shown == shown
    assert replayed(search, loads) == shown
    assert not searched(grip(0.05), loads, boxes=64).shown


# --- no false proof -----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_boxes_about_placements_that_balance_are_never_refuted(seed: int) -> None:
    """Random boxes about placements at which inscribed pyramids balance every load, with all that the search tries."""
    rng = np.random.default_rng(seed)
    task = (triangle(10.0 * rng.random()), grip(0.05))[seed % 2]
    loads = Loads.wrench(rng.normal(size=6) * [1, 1, 1, 0.01, 0.01, 0.01]) if seed % 2 == 0 else weights([0, 0, 0])
    search = NoBalance(task, loads, 0.6, center=np.zeros(3))
    places: list[Array] = []
    while len(places) < 12:
        y = rng.random(2)
        x = rng.random(6) if seed % 2 == 0 else np.r_[y, 1 - y]  # two contacts that mirror each other
        p, n = (a[0] for a in search.placements.at(x[None]))
        grasp = Grasp([Contact(*at, 0.6) for at in zip(p, n, strict=True)])
        if not imbalance(grasp, loads.wrenches).any():
            places.append(x)
    sizes = 10.0 ** rng.uniform(-6, 0, size=(12, 1))
    low, high = (np.clip(np.array(places) + s * sizes * rng.random((12, len(search.whole))), 0, 1) for s in (-1, 1))
    closed, tried, _ = search.examined(np.stack([low, high], axis=2), np.full(12, NO_MOTION))
    assert (closed == NO_MOTION).all()
    for motion in set(tried.tolist()) - {NO_MOTION}:  # neither does what was found for another
        boxes = np.stack([low, high], axis=2)
        assert not search.placements.examined(boxes, search.motions[np.full(12, motion)]).refuted.any()


def cut_around(point: Array, normal: Array, half: float) -> Bezier:
    """A square about a contact, its outward normal against the contact's."""
    u = np.linalg.svd(normal[None])[2][1:]
    points = np.array([[point + half * (s * u[0] + t * u[1]) for t in (-1, 1)] for s in (-1, 1)])
    out = Bezier(points, False)
    return out if out.outward(0.5, 0.5) @ normal < 0 else Bezier(points, True)


def test_no_task_about_contacts_that_balance_is_none() -> None:
    rng, hand, tip = np.random.default_rng(5), load_hand("schunk-sah"), pinch().contact_pairs[0].hand
    tried = 0
    while tried < 40:
        K = 2 + tried % 3
        p, n = rng.normal(size=(K, 3)) * 0.03, rng.normal(size=(K, 3))
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        loads = Loads.wrench(rng.normal(size=6) * [1, 1, 1, 0.02, 0.02, 0.02])
        if K == 2:  # the line has to carry the load: a force through both points
            f = p[1] - p[0]
            n = np.array([f, -f]) / np.linalg.norm(f)
            loads = Loads.wrench(np.r_[f, np.cross(p[0], f)])
        if imbalance(Grasp([Contact(*at, 0.8) for at in zip(p, n, strict=True)]), loads.wrenches).any():
            continue
        tried += 1
        regions = [cut_around(*at, 1e-3) for at in zip(p, n, strict=True)]
        task = Task.of(hand, tuple(ContactPair("index_distal", tip, r) for r in regions))
        assert not searched(task, loads, 0.8, boxes=200).shown


# --- grasp --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def none() -> Grasps:
    return grasp_for(load_task(TWO), timeout=30, jobs=1)


def test_two_fingertips_carry_no_weight_off_their_line(none: Grasps) -> None:
    assert (none.verdict, none.stop, none.grasps) == (Reach.NONE, Stop.COMPLETE, ())
    assert none.balance is not None
    assert none.balance.shown
    assert none.balance.discarded == 1.0
    assert 0.005 < (none.balance.line_distance or 0) < 0.0087
    report, distance = none.verify(), none.balance.line_distance
    assert report.ok
    assert "at least" in report.replayed[0]
    assert report.part("balance").figures["line_distance"] == distance  # type: ignore[union-attr]


def test_none_is_saved_and_verified(none: Grasps, tmp_path: Path) -> None:
    none.save(tmp_path / "none.json")
    assert verify(tmp_path / "none.json").ok
    data = json.loads((tmp_path / "none.json").read_text("utf-8"))

    def refused(**changes: Any) -> str:
        changed = copy.deepcopy(data)
        for path, value in changes.items():
            *before, last = path.split("__")
            part = changed
            for key in before:
                part = part[key]
            part[last] = value
        (tmp_path / "changed.json").write_text(json.dumps(renew(changed)))
        return verify(tmp_path / "changed.json").reason

    assert "rests on the search itself" in refused(none=None)
    assert "UNDECIDED with a proof that there is none" in refused(answer__verdict="undecided")
    assert "balance: the tree leaves out 2 boxes" in refused(none__tree=[0])
    assert "the answer is about other loads" in refused(question__object__center_of_mass=[-0.008, 0, 0])
    contacts = copy.deepcopy(data["task"]["contacts"])
    contacts[0]["object"]["bezier"] = (np.array(contacts[0]["object"]["bezier"]) - [0.04, 0, 0]).tolist()
    assert "boxes are not refuted" in refused(task__contacts=contacts)  # lines on both sides of the centre of mass
    flipped = [{**m, "line": m["line"][::-1]} for m in data["none"]["motions"]]
    assert "boxes are not refuted" in refused(none__motions=flipped)


@pytest.mark.slow
def test_the_command_says_why(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    folder = str(tmp_path / "out")
    assert main(["grasp", TWO, "--timeout", "30", "-o", folder]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert out.startswith("NONE Two fingertips have no moment about the line between them, and the centre of mass")
    assert "never comes nearer to that line than " in out
    assert main(["verify", f"{folder}/grasps.json"]) == 0
    assert "Proved: no grasp of these regions holds each load alone" in capsys.readouterr().out
    assert main(["grasp", TWO, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["verdict"], said["balance"]["shown"], said["balance"]["balanced"]) == ("none", True, None)


def test_where_forces_balance_the_search_for_a_proof_ends() -> None:
    found = grasp_for(load_task("scalpel-incision"), loads=Loads.gravity(load_body("scalpel"), "z"), timeout=60, jobs=1)
    assert found.verdict is Reach.FOUND
    assert found.balance is None
    assert found.search.balance is None
    search = NoBalance(found.task, found.loads, 0.5, center=np.zeros(3))
    search.run(1)
    assert search.balanced is not None


# --- going on -----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_search_goes_on_where_it_was() -> None:
    loads = weights([0.0102, 0, 0.003])
    whole = searched(grip(0.05), loads, boxes=3000)
    assert whole.shown
    first = searched(grip(0.05), loads, boxes=64)
    assert 0 < len(first.open) < 200
    saved = json.loads(json.dumps(first.to_json()))
    again = NoBalance(grip(0.05), loads, 0.5, center=np.zeros(3), saved=saved)
    assert len(again.open) == len(first.open)
    assert again.discarded == pytest.approx(first.discarded)
    again.run(5000)
    assert again.shown
    assert replayed(again, loads)
    assert again.searched.discarded == 1.0
    other = {**saved, "tree": saved["tree"][:-1]}
    with pytest.raises(InputError, match="tree: the tree leaves out 1 boxes"):
        NoBalance(grip(0.05), loads, 0.5, center=np.zeros(3), saved=other)
    with pytest.raises(InputError, match="boxes are not refuted"):
        NoBalance(grip(0.05), weights([0, 0, 0]), 0.5, center=np.zeros(3), saved=whole.to_json())


def test_frictionless_contacts_fewer_than_directions_need_no_boxes() -> None:
    loads = weights([0, 0, 0])
    search = searched(grip(0.05), loads, 0.0)
    assert search.shown
    assert search.boxes == 0
    assert search.line_distance is None
    proof = search.searched.proof
    assert proof == {"fewest_contacts": 4}

    def proved(contacts: int, friction: float = 0.0, its: Loads = loads, **changed: int) -> bool:
        return replay_of_loads(contacts, 0.1, its.by_name, friction, Fields(proof | changed)).ok

    turning = [[f, 0, 0, t, 0, 0] for f, t in ((1, 1e-12), (-1, -1e-12), (1, -1e-12), (-1, 1e-12))]
    assert not proved(2, its=Loads(tuple("abcd"), np.array(turning)), fewest_contacts=3)  # 1e-11 of the force's arm

    assert proved(2)
    assert proved(3)
    assert not proved(4)
    assert not proved(4, fewest_contacts=5)
    assert not proved(2, 0.1)
    assert proved(2, fewest_contacts=3)
    assert not searched(grip(0.05), Loads.wrench([0, 0, 1.0]), 0.0, boxes=0).shown
