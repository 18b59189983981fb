"""The proof that no contact forces balance a load, wherever the contacts are: cases derived by hand, wrong proofs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.model.region import Bezier, Cap, Region
from handfast.proofs import unbalanced
from handfast.proofs.contact_force_limits import ForceLimits
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.intervals import Dual, Interval
from handfast.proofs.regions import RegionData, read_region
from handfast.proofs.replay import Refused, Replay, down
from handfast.proofs.tolerance import MIN_FORCE_SCALE
from handfast.proofs.unbalanced import (
    BoxBounds,
    HandMotion,
    Motions,
    MovedJoint,
    Placements,
    UnbalancedTree,
    _positive,
    _Scales,
    nearness,
    replay_unbalanced,
)
from handfast.readers.region_file import region_to_dict
from tests.support.holds import square

WIDTH, HALF = 0.04, 0.002
DOWN = np.array([0.0, 0.0, -1.0])


def weight(center: Sequence[float], force: Array = DOWN) -> Array:
    return np.r_[force, np.cross(center, force)]


def patch(origin: Sequence[float], u: Sequence[float], v: Sequence[float]) -> Bezier:
    """A parallelogram about a point, its outward normal along u x v."""
    return Bezier(
        np.array([[np.array(origin) + a * np.array(u) + b * np.array(v) for b in (-1, 1)] for a in (-1, 1)]), False
    )


def data(*regions: Region) -> list[RegionData]:
    return [read_region(Fields(region_to_dict(region))) for region in regions]


def jaws(half: float = HALF) -> list[RegionData]:
    """Contact 0 about y = 20 mm, contact 1 about y = -20 mm, both pushing inwards."""
    return data(square(1, WIDTH / 2, half), square(-1, -WIDTH / 2, half))


def replayed(regions: list[RegionData], loads: dict[str, Array], proof: Any, mu: float = 0.5, **how: Any) -> Replay:
    return replay_unbalanced(regions, loads, mu, how.get("limit", np.inf), how.get("center"), Fields(proof))


def of_line(i: int, j: int, **loads: float) -> dict[str, Any]:
    return {"motions": [{"loads": loads or {"w": 1.0}, "line": [i, j]}], "tree": [-1]}


def of_twist(*twist: float, **loads: float) -> dict[str, Any]:
    return {"motions": [{"loads": loads or {"w": 1.0}, "twist": list(twist)}], "tree": [-1]}


# --- two contacts and the line through them --------------------------------------------------------------

FAR = [0.03, 0.0, 0.0]  # of a centre of mass from the line: the weight turns the object about +y


def test_weight_off_the_line_turns_the_object_about_it() -> None:
    """The moment about the line is 0.03 N m along +y: from contact 1 to contact 0, not the other way round."""
    done = replayed(jaws(), {"w": weight(FAR)}, of_line(1, 0))
    assert done.ok
    assert done.claim == (
        "wherever in their regions the 2 contacts are, with a friction of 0.5 no contact forces balance w"
    )
    wrong = replayed(jaws(), {"w": weight(FAR)}, of_line(0, 1))
    assert wrong.reason == "1 of 1 boxes are not refuted, the first is leaf 0"


def test_friction_does_not_matter_about_the_line() -> None:
    assert replayed(jaws(), {"w": weight(FAR)}, of_line(1, 0), mu=1e6).ok
    assert replayed(jaws(), {"w": weight(FAR)}, of_line(1, 0), mu=0.0).ok


@pytest.mark.parametrize("offset", [0.0, 0.0019, 0.0021])
def test_line_reaches_as_far_as_the_regions(offset: float) -> None:
    """Lines through squares of 2 mm half side pass 2 mm from the middle at most."""
    proof = of_line(1, 0)
    done = replayed(jaws(), {"w": weight([offset, 0, 0])}, proof)
    assert done.ok == (offset > HALF)


def test_a_region_just_beyond_is_not_covered() -> None:
    load = {"w": weight([0.0021, 0, 0])}
    assert replayed(jaws(0.002), load, of_line(1, 0)).ok
    assert not replayed(jaws(0.0022), load, of_line(1, 0)).ok


def test_what_is_said_of_the_distance_is_a_lower_bound() -> None:
    """The nearest line runs along an edge of both squares: 30 - 2 mm away."""
    done = replayed(jaws(), {"w": weight(FAR)}, of_line(1, 0), center=np.array(FAR))
    assert 0.95 * 0.028 <= done.figures["line_distance"] <= 0.028  # type: ignore[operator]
    assert "the line through them is at least 2" in done.claim
    near = Placements.of(jaws(), weight(FAR)[None], 0.5).line_distance(np.zeros(3))
    assert near == 0.0


def test_loads_may_be_summed() -> None:
    """Half of each weight acts on the line y = 0 at x = 30 mm; one of them alone has no moment about it."""
    loads = {"a": weight([0.06, 0, 0]), "b": weight([0, 0, 0])}
    assert replayed(jaws(), loads, of_line(1, 0, a=1.0)).ok
    assert replayed(jaws(), loads, of_line(1, 0, a=0.5, b=0.5)).ok
    assert not replayed(jaws(), loads, of_line(1, 0, b=1.0)).ok


def test_nothing_is_shown_of_loads_that_are_too_small() -> None:
    for size, ok in ((0.1 * MIN_FORCE_SCALE, False), (1e3 * MIN_FORCE_SCALE, True)):
        assert replayed(jaws(), {"w": size * weight(FAR)}, of_line(1, 0)).ok == ok


def test_tolerance_of_states_is_granted() -> None:
    """A moment of 1e-9 of what the weight may have about the contacts is none."""
    tiny = jaws(1e-13)
    assert not replayed(tiny, {"w": weight([1e-11, 0, 0])}, of_line(1, 0)).ok
    assert replayed(tiny, {"w": weight([1e-9, 0, 0])}, of_line(1, 0)).ok


# --- constant twists ----------------------------------------------------------------------------------


def above() -> list[RegionData]:
    """Two contacts on top of the object, which can push it downwards alone."""
    return data(patch([0.02, 0, 0], [1e-3, 0, 0], [0, 1e-3, 0]), patch([-0.02, 0, 0], [1e-3, 0, 0], [0, 1e-3, 0]))


@pytest.mark.parametrize("degrees", [0, 30, 63, 64, 89, 180])
def test_a_twist_is_in_the_dual_cone_or_not(degrees: float) -> None:
    """mu = 0.5: u may be up to 90 - atan(0.5) = 63.4 degrees from the normal."""
    a = np.radians(degrees)
    done = replayed(above(), {"w": weight([0, 0, 0])}, of_twist(np.sin(a), 0, -np.cos(a), 0, 0, 0))
    assert done.ok == (degrees < 63.43)


def test_the_load_has_to_do_work() -> None:
    assert not replayed(above(), {"w": weight([0, 0, 0], -DOWN)}, of_twist(0, 0, -1, 0, 0, 0)).ok
    assert not replayed(above(), {"w": weight([0, 0, 0], np.array([1.0, 0, 0]))}, of_twist(0, 0, -1, 0, 0, 0)).ok


def test_a_third_contact_has_to_let_it_turn() -> None:
    """About the line of the jaws the weight at x = 30 mm sinks: a contact below resists, one above does not."""
    below = patch([0.03, 0, -0.01], [0, 1e-3, 0], [1e-3, 0, 0])  # its outward normal points down
    top = patch([0.03, 0, 0.01], [1e-3, 0, 0], [0, 1e-3, 0])
    regions = [square(1, WIDTH / 2, HALF), square(-1, -WIDTH / 2, HALF)]
    assert not replayed(data(*regions, below), {"w": weight(FAR)}, of_line(1, 0), mu=0.1).ok
    assert replayed(data(*regions, top), {"w": weight(FAR)}, of_line(1, 0), mu=0.1).ok


@pytest.mark.parametrize(("weighs", "shown"), [(1.01, True), (0.99, False)])
def test_limited_forces_carry_no_more_than_their_friction(weighs: float, shown: bool) -> None:
    """Jaws that push with up to 1 N, mu = 0.5: their friction carries 2 x 0.5 N, wherever they are."""
    loads = {"w": weight([0, 0, 0], weighs * DOWN)}
    done = replayed(jaws(), loads, of_twist(0, 0, -1, 0, 0, 0), limit=1.0)
    assert done.ok == shown
    assert "with a friction of 0.5 and normal forces up to 1 N no contact forces" in done.claim
    assert not replayed(jaws(), loads, of_twist(0, 0, -1, 0, 0, 0)).ok  # any force would do
    assert not replayed(jaws(), loads, of_twist(0, 0, 1, 0, 0, 0), limit=1.0).ok


@pytest.mark.parametrize(("weighs", "shown"), [(0.76, True), (0.74, False)])
def test_each_contact_has_its_own_limit(weighs: float, shown: bool) -> None:
    """1 N and 0.5 N, mu = 0.5: straight down their friction does no more than 0.75 N."""
    loads, down = {"w": weight([0, 0, 0], weighs * DOWN)}, of_twist(0, 0, -1, 0, 0, 0)
    done = replayed(jaws(), loads, down, limit=np.array([1.0, 0.5]))
    assert done.ok == shown
    assert "normal forces up to 1, 0.5 N" in done.claim
    assert not replayed(jaws(), loads, down, limit=np.array([1.0, np.inf])).ok


@pytest.mark.parametrize("times", [1e-30, 0.5, 3.0, 1e6, 1e49])
def test_limited_forces_count_as_often_as_their_loads(times: float) -> None:
    """Forces of each load add up with its weight: a load counted twice is not one twice as heavy."""
    for weighs, shown in ((1.01, True), (0.99, False)):
        loads = {name: weight([0, 0, 0], weighs * DOWN) for name in "wv"}
        for weights in ({"w": times}, {"w": times, "v": times}, {"w": times, "v": 1.0}):
            assert replayed(jaws(), loads, of_twist(0, 0, -1, 0, 0, 0, **weights), limit=1.0).ok == shown


def test_limited_forces_are_too_weak_wherever_they_point() -> None:
    """Around a whole ball the normal may be any: a force of 0.4 N and its friction, mu = 0.5, is at most 0.45 N."""
    ball = data(Cap((0, 0, 0), 0.02, (0, 0, -1), np.pi))
    for weighs, shown in ((0.46, True), (0.44, False)):
        done = replayed(ball, {"w": weight([0, 0, 0], weighs * DOWN)}, of_twist(0, 0, -1, 0, 0, 0), limit=0.4)
        assert done.ok == shown


def test_limited_forces_have_no_moment_about_their_line_either() -> None:
    for limit in (1e-3, 1.0, 1e9):
        assert replayed(jaws(), {"w": weight(FAR)}, of_line(1, 0), limit=limit).ok
        assert not replayed(jaws(), {"w": weight(FAR)}, of_line(0, 1), limit=limit).ok


@pytest.mark.parametrize(("pushes", "shown"), [(0.3, True), (0.45, False)])
def test_limited_third_contact_lets_it_turn(pushes: float, shown: bool) -> None:
    """1 N at 30 mm from the jaws' line against a contact below, which pushes up at 80 mm (79 to 81 mm)."""
    below = patch([0.08, 0, -0.01], [0, 1e-3, 0], [1e-3, 0, 0])
    regions = data(square(1, WIDTH / 2, 1e-5), square(-1, -WIDTH / 2, 1e-5), below)
    assert replayed(regions, {"w": weight(FAR)}, of_line(1, 0), mu=0.0, limit=pushes).ok == shown


def test_a_whole_cap_is_cut_into_boxes() -> None:
    """A ball's lower half pushes up: no weight that pulls up is balanced, by no other twist than straight up."""
    cap = data(Cap((0.01, 0, 0), 0.02, (0, 0, -1), np.radians(20)))
    lift = {"w": weight([0.01, 0, 0], -DOWN)}
    assert replayed(cap, lift, of_twist(0, 0, 1, 0, 0, 0), mu=1.0).ok  # 20 + 45 degrees are below 90
    tree = {**of_twist(0, 0, 1, 0, 0, 0), "tree": [0, 1, -1, -1, -1]}
    assert replayed(cap, lift, tree, mu=1.0).ok
    assert not replayed(cap, lift, tree, mu=4.0).ok


# --- the tree -----------------------------------------------------------------------------------------

RIGHT = {"motions": [{"loads": {"w": 1.0}, "line": [1, 0]}], "tree": [2, 0, -1, -1, -1]}
TREES = {
    "a box is missing": ([2, 0, -1, -1], "the tree leaves out 1 boxes"),
    "a box too many": ([2, 0, -1, -1, -1, -1], "the tree goes on after its last box, at entry 5"),
    "a box is open": ([2, 0, -1, None, -1], "1 boxes are open"),
    "nothing but a cut": ([2], "the tree leaves out 2 boxes"),
    "cut for ever": ([0] * 1100, "the tree halves a box that is too small"),
}


@pytest.mark.parametrize("name", TREES)
def test_a_tree_that_does_not_cover_all_is_refused(name: str) -> None:
    load = {"w": weight(FAR)}
    assert replayed(jaws(), load, RIGHT).ok
    tree, reason = TREES[name]
    assert replayed(jaws(), load, {**RIGHT, "tree": tree}).reason.startswith(reason)


MOTION = {"loads": {"w": 1.0}, "line": [1, 0]}
BROKEN = {
    "no such motion": ({"tree": [-2]}, r"tree\[0\]: is -2; a parameter below 4, a motion or null"),
    "no such parameter": ({"tree": [4, -1, -1]}, r"tree\[0\]: is 4; a parameter below 4"),
    "a truth value": ({"tree": [True]}, r"tree\[0\]: is True"),
    "no tree": ({"tree": []}, "tree: is no list"),
    "another load": ({"motions": [{**MOTION, "loads": {"x": 1.0}}]}, r"motions\[0\].loads: has unknown load 'x'"),
    "a load that pulls": ({"motions": [{**MOTION, "loads": {"w": -1.0}}]}, "loads.w: is -1; 0 or more is needed"),
    "one contact": ({"motions": [{**MOTION, "line": [1, 1]}]}, r"line: is \[1, 1\]; two of the contacts 0 to 1"),
    "part of a contact": ({"motions": [{**MOTION, "line": [0, 1.9]}]}, "two of the contacts 0 to 1 are needed"),
    "no such contact": ({"motions": [{**MOTION, "line": [1, 2]}]}, r"line: is \[1, 2\]; two of the contacts 0 to 1"),
    "both": ({"motions": [{**MOTION, "twist": [0.0] * 6}]}, "needs either a line or a twist"),
    "neither": ({"motions": [{"loads": {"w": 1.0}}]}, r"^motions\[0\]: needs either a line or a twist"),
    "something else of a motion": ({"motions": [{**MOTION, "more": 1}]}, r"^motions\[0\].more: is not a known field"),
    "five numbers": ({"motions": [{"loads": {"w": 1.0}, "twist": [0.0] * 5}]}, "twist: has 5 numbers; 6 are needed"),
    "something else": ({"sum": 1}, "sum: is not a known field"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_no_proof_is_said_so(name: str) -> None:
    change, match = BROKEN[name]
    with pytest.raises(BadFile, match=match):
        replayed(jaws(), {"w": weight(FAR)}, {**RIGHT, **change})


def test_motions_that_show_nothing() -> None:
    load = {"w": weight(FAR)}
    for twist in ([0.0] * 6, [1e40] * 6, [1e-320] * 6):
        assert not replayed(jaws(), load, of_twist(*twist)).ok
    assert not replayed(jaws(), load, of_line(1, 0, w=0.0)).ok
    assert not replayed(jaws(), {"w": np.zeros(6)}, of_line(1, 0)).ok


# --- bounds and the formulas that they bound ------------------------------------------------------------


def skew(seed: int, contacts: int) -> tuple[list[Region], Array]:
    """Curved patches anywhere, and a load."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], indexing="ij"), axis=-1)
    out: list[Region] = []
    for k in range(contacts):
        u, v = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
        flat = rng.normal(size=3) * 0.05 + 0.01 * (grid @ np.array([u, v]))
        out.append(Bezier(flat + 1e-3 * rng.normal(size=flat.shape), bool(k % 2)))
    return out, rng.normal(size=6) * [1, 1, 1, 0.05, 0.05, 0.05]


def moved(region: Region, R: Array, t: Array, scale: float) -> Region:
    assert isinstance(region, Bezier)
    return Bezier(scale * (region.points @ R.T + t), region.flip)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.slow
def test_what_is_refuted_is_so_at_every_placement(seed: int) -> None:
    """Of random boxes and twists, at random placements: the definition in plain numbers."""
    rng, contacts = np.random.default_rng(seed), 2 + seed % 3
    regions, load = skew(seed, contacts)
    mu, limit = 0.3, (np.inf, 0.3)[seed % 2]
    placements = Placements.of(data(*regions), load[None], mu, limit)
    low = 0.8 * rng.random((200, 2 * contacts))
    boxes = np.stack([low, low + 0.2 * rng.random((200, 1))], axis=2)
    line = np.array([rng.permutation(contacts)[:2] if k % 2 else [-1, -1] for k in range(200)])
    twist = np.where(line[:, :1] < 0, rng.normal(size=(200, 6)) * [0.05, 0.05, 0.05, 1, 1, 1], 0.0)
    shown = placements.examined(boxes, Motions(np.ones((200, 1)), line, twist)).refuted
    held = []
    for box, pair, xi in zip(boxes, line, twist, strict=True):
        x = box[:, 0] + np.ptp(box, axis=1) * rng.random((20, 2 * contacts))
        p = np.stack([r.at(x[:, 2 * k], x[:, 2 * k + 1]) for k, r in enumerate(regions)], axis=1)
        n = -np.stack([r.outward(x[:, 2 * k], x[:, 2 * k + 1]) for k, r in enumerate(regions)], axis=1)
        omega = p[:, pair[1]] - p[:, pair[0]] if pair[0] >= 0 else np.tile(xi[3:], (20, 1))
        v = -np.cross(omega, p[:, pair[0]]) if pair[0] >= 0 else np.tile(xi[:3], (20, 1))
        u = v[:, None] + np.cross(omega[:, None], p)
        normal = (u * n).sum(axis=2)
        slip = np.linalg.norm(u - normal[..., None] * n, axis=2)
        rests = np.isin(np.arange(contacts), pair)
        short = np.where(rests, 0.0, np.maximum(mu * slip - normal, 0.0)).sum(axis=1)
        least = np.where(short > 0, limit * short, 0.0) if np.isfinite(limit) else np.where(short > 0, np.inf, 0.0)
        held.append(bool((v @ load[:3] + omega @ load[3:] > least).all()))
    assert not (shown & ~np.array(held)).any()
    if contacts == 2:
        assert shown.any()
        assert not shown.all()


def test_what_is_missing_is_known_by_hand() -> None:
    """Upwards both contacts slide on the jaws: friction may take 2 mu f of a weight of 1 N, which does 1 N on it.

    Turned by a small angle towards the first jaw, a contact that is not limited is pushed by the sine of it.
    """
    box = np.full((1, 4, 2), 0.5)
    down = Motions(np.ones((1, 1)), np.array([[-1, -1]]), np.array([[0, 0, -2.0, 0, 0, 0]]))
    for limit, due in ((1.2, 0.2), (1.05, 0.05), (0.95, 0.0)):
        found = Placements.of(jaws(), weight([0, 0, 0])[None], 0.5, limit).examined(box, down)
        assert found.missing[0] == pytest.approx(due, abs=1e-6)
        assert (found.refuted[0], found.near[0]) == (not due, float(not due))
    mu, angle = 0.5, 0.1
    aside = Motions(down.weights, down.line, 3 * np.array([[0, np.sin(angle), -np.cos(angle), 0, 0, 0]]))
    found = Placements.of(jaws(), weight([0, 0, 0])[None], mu).examined(box, aside)
    assert found.missing[0] == pytest.approx(np.sin(np.arctan(mu)) + np.sin(angle), abs=1e-6)  # of the first jaw
    assert not found.near[0]


@pytest.mark.parametrize("limit", [np.inf, 0.02])
def test_a_box_is_refuted_once_it_has_shrunk_to_what_is_near(limit: float) -> None:
    """To first order: always at 0.8 of that, and half of them not at 1.6 of it."""
    rng, (regions, load) = np.random.default_rng(3), skew(5, 2)
    placements = Placements.of(data(*regions), load[None], 0.3, limit)
    n = 200
    middle, half = 0.5 + 0.1 * rng.normal(size=(n, 4)), 0.4 * rng.random((n, 1))
    line = np.array([rng.permutation(2) if k % 2 else [-1, -1] for k in range(n)])
    twist = np.where(line[:, :1] < 0, rng.normal(size=(n, 6)) * [0.05, 0.05, 0.05, 1, 1, 1], 0.0)
    twist *= np.sign(twist @ load)[:, None]
    motions = Motions(np.ones((n, 1)), line, twist)

    def examined(share: Any) -> BoxBounds:
        return placements.examined(np.stack([middle - share * half, middle + share * half], axis=2), motions)

    found = examined(1.0)
    assert (found.refuted == (found.near == 1)).all()
    assert (found.refuted == (found.missing == 0)).all()
    its = (found.near > 0) & ~found.refuted
    assert its.sum() > 10
    near = found.near[:, None]
    assert examined(0.8 * near).refuted[its].all()
    assert not examined(1e-6).refuted[found.near == 0].any()
    low, high = near, np.ones_like(near)
    for _ in range(12):
        share = (low + high) / 2
        shown = examined(share).refuted[:, None]
        low, high = np.where(shown, share, low), np.where(shown, high, share)
    assert 1 <= np.median(low[its] / near[its]) < 1.6


@pytest.mark.parametrize("seed", range(4))
def test_frames_and_units_do_not_matter(seed: int) -> None:
    """The same in a turned frame and in millimetres and kilonewtons: the same boxes are refuted."""
    rng, (regions, load) = np.random.default_rng(seed), skew(seed, 2 + seed % 2)
    K, scale, force = len(regions), 1000.0, 1e-3
    R, t = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=3)
    R *= np.sign(np.linalg.det(R))
    F, M = R @ load[:3], R @ load[3:]
    other = force * np.r_[F, scale * (M + np.cross(t, F))]
    low = 0.8 * rng.random((300, 2 * K))
    boxes = np.stack([low, low + 1e-3], axis=2)  # intervals of turned vectors are wider
    line = np.array([rng.permutation(K)[:2] if k % 2 else [-1, -1] for k in range(300)])
    xi = np.where(line[:, :1] < 0, rng.normal(size=(300, 6)) * [0.05, 0.05, 0.05, 1, 1, 1], 0.0)
    omega = xi[:, 3:] @ R.T
    turned = np.hstack([scale * (xi[:, :3] @ R.T - np.cross(omega, t)), omega])
    motions, those = (Motions(np.ones((300, 1)), line, x) for x in (xi, turned))
    here = Placements.of(data(*regions), load[None], 0.3).examined(boxes, motions).refuted
    there = Placements.of(data(*(moved(r, R, t, scale) for r in regions)), other[None], 0.3)
    assert (here == there.examined(boxes, those).refuted).mean() > 0.98  # but for rounding at the edge
    assert here.any()


@pytest.mark.parametrize(
    ("value", "slope", "positive", "its"),
    [
        ((-1, 2), (3, 4), (0, 2), (0, 4)),
        ((-1, 2), (-4, -3), (0, 2), (-4, 0)),
        ((1, 2), (3, 4), (1, 2), (3, 4)),
        ((0.5, 2), (3, 4), (0.5, 2), (3, 4)),
        ((0, 2), (3, 4), (0, 2), (3, 4)),
        ((-1, 0), (3, 4), (0, 0), (0, 0)),
        ((-1, 0.5), (3, 4), (0, 0.5), (0, 4)),
        ((-2, -1), (3, 4), (0, 0), (0, 0)),
        ((-2, 9), (3, 4), (0, 2.5), (0, 4)),
        ((np.nan, np.nan), (3, 4), (0, 2.5), (0, 4)),
    ],
)
def test_derivative_of_the_positive_part(value: Any, slope: Any, positive: Any, its: Any) -> None:
    """Where the sign changes within a box, all that lies between the two derivatives."""
    (low, high), (first, last) = (np.array([[x] for x in ends], dtype=float) for ends in (value, slope))
    done = _positive(Dual(Interval.between(low, high), Interval.between(first[None], last[None])), np.array([2.5]))
    assert (done.value.lo.item(), done.value.hi.item()) == positive
    assert (done.slope.lo.item(), done.slope.hi.item()) == its


# --- motions with those of a hand ---------------------------------------------------------------------------


def joint(rates: Sequence[float], axis: Sequence[float], contacts: tuple[int, ...], **hinge: Any) -> list[MovedJoint]:
    """In boxes of two contacts, over these and in their middles; it turns about an anchor, or slides."""
    made, anchor = [], hinge.get("anchor")
    for n in (4, 0):
        ends = (np.tile(np.array(x, dtype=float), (len(rates), 1)) for x in (axis, anchor or [9.0] * 3))
        along, place = (Dual.constant(Interval.of(x), n) for x in ends)
        made.append(MovedJoint(Interval.of(np.array(rates)), along, place, anchor is not None, contacts))
    return made


def by_hand(boxes: int, *joints: list[MovedJoint], **work: Any) -> HandMotion:
    over, middle = zip(*joints, strict=True)
    sums = [np.broadcast_to(np.array(work.get(name, 0.0)), (boxes,)) for name in ("resisted", "turned", "slid")]
    return HandMotion(over, middle, *sums)


def rises(boxes: int = 1, spin: float = 0.0, weight: float = 1.0) -> Motions:
    """1 m/s upwards, and a turn about the axis z through the contact at x = 30 mm."""
    twist = np.tile([0, -0.03 * spin, 1.0, 0, 0, spin], (boxes, 1))
    return Motions(np.full((boxes, 1), weight), np.full((boxes, 2), -1), twist)


def pressed(lift: float, mu: float = 0.1, torsion: float = 0.0) -> Placements:
    """From above at x = 30 and 70 mm; a force lifts the object between both."""
    pads = [patch([x, 0, 0], [1e-6, 0, 0], [0, 1e-6, 0]) for x in (0.03, 0.07)]
    return Placements.of(data(*pads), weight([0.05, 0, 0], -lift * DOWN)[None], mu, np.inf, torsion)


WHOLE = np.tile([0.0, 1.0], (1, 4, 1))
SLIDE = [0, 0, 1.0]


def shown(placements: Placements, motions: Motions, hand: HandMotion) -> list[bool]:
    its = placements.examined(np.repeat(WHOLE, len(motions), axis=0), motions, hand).refuted
    return [bool(one) for one in its]


def test_fingers_that_give_way_do_what_their_motors_can() -> None:
    """Fingers rise by 1.1 m/s before an object that rises by 1 m/s: 2.2 W at most are due to their motors."""
    hand = by_hand(1, joint([1.1], SLIDE, (0, 1)), resisted=2.2)
    assert shown(pressed(2.3), rises(), hand) == [True]
    assert shown(pressed(2.1), rises(), hand) == [False]
    for share, at in ((1.1, True), (1.0, False)):  # so many times a load that counts twice
        assert shown(pressed(share * 1.1), rises(weight=2.0), by_hand(1, hand_joint(1.1), resisted=1.1)) == [at]
    assert shown(pressed(9.0), rises(), by_hand(1, hand_joint(0.9))) == [False]  # they are pushed against
    assert shown(pressed(9.0), rises(), by_hand(1, joint([1.1], SLIDE, (0,)))) == [False]  # so is the other
    either = joint([0.6], SLIDE, (0, 1)), joint([0.5], SLIDE, (0, 1))
    assert shown(pressed(9.0), rises(), by_hand(1, *either)) == [True]
    neither = joint([0.6], SLIDE, (0,)), joint([0.5], SLIDE, (1,))
    assert shown(pressed(9.0), rises(), by_hand(1, *neither)) == [False]


def hand_joint(rate: float) -> list[MovedJoint]:
    return joint([rate], SLIDE, (0, 1))


def test_limited_forces_and_motors_add_up() -> None:
    """Fingers that slide aside, at 2 m/s on a friction of 0.1 and up to 1 N each: 0.4 W, and 1 W of the motors."""
    regions = [patch([x, 0, 0], [1e-6, 0, 0], [0, 1e-6, 0]) for x in (0.03, 0.07)]
    hand = by_hand(1, joint([1.0], SLIDE, (0, 1)), joint([2.0], [0, 1.0, 0], (0, 1)), resisted=1.0)
    for lift, at in ((1.41, True), (1.39, False)):
        held = Placements.of(data(*regions), weight([0.05, 0, 0], -lift * DOWN)[None], 0.1, 1.0)
        assert shown(held, rises(), hand) == [at]


@pytest.mark.parametrize(("anchor", "at"), [(0.03, True), (0.04, False), (-0.03, True)])
def test_a_hinge_moves_a_contact_by_its_distance(anchor: float, at: bool) -> None:
    """30 rad/s at 40 mm are 1.2 m/s upwards, at 30 mm 0.9 m/s: less than the object."""
    turn = joint([30.0], [0, -1.0, 0], (1,), anchor=[anchor, 0, 0])
    assert shown(pressed(9.0), rises(), by_hand(1, joint([1.1], SLIDE, (0,)), turn)) == [at]


@pytest.mark.parametrize("torsion", [0.0, 0.1])
def test_a_soft_finger_that_turns_with_the_object_does_not_twist_it(torsion: float) -> None:
    """Both about the same axis, through one contact: a point contact does not know."""
    asked, up = pressed(9.0, 0.5, torsion), joint([1.1], SLIDE, (0, 1))
    turns = {rate: joint([rate], SLIDE, (0, 1), anchor=[0.03, 0, 0]) for rate in (10.0, -10.0)}
    for spin in (10.0, -10.0):
        assert shown(asked, rises(spin=spin), by_hand(1, up, turns[spin])) == [True]
        assert shown(asked, rises(spin=spin), by_hand(1, up, turns[-spin])) == [False]
    one = by_hand(1, up, joint([10.0], SLIDE, (0,), anchor=[0.03, 0, 0]))
    assert shown(asked, rises(), one) == [not torsion]  # which turns where it is
    slides = by_hand(1, up, joint([10.0], [1.0, 0, 0], (), anchor=None))
    assert shown(asked, rises(), slides) == [True]


def test_each_box_has_its_own_motions_of_a_hand() -> None:
    """In two groups, of twists and of lines, in turn; about the line through both contacts neither moves."""
    motions = rises(4)
    motions.line[1::2], motions.twist[1::2] = [1, 0], 0.0
    hand = by_hand(4, joint([1.1, 1.1, 0.9, 1.1], SLIDE, (0, 1)), resisted=[2.2, 2.2, 2.2, 9.9])
    assert shown(pressed(2.3), motions, hand) == [True, False, False, False]
    hand = by_hand(4, joint([1.1, 0.9, 1.1, 1.1], SLIDE, (0, 1)), resisted=[9.9, 2.2, 2.2, 2.2])
    assert shown(pressed(2.3), motions, hand) == [False, False, True, False]
    picked = hand.some(np.array([2, 0]))
    assert (picked.resisted.tolist(), picked.joints[0].rates.mid.tolist()) == ([2.2, 9.9], [1.1, 1.1])
    places = [np.arange(12.0).reshape(4, 3), np.arange(50.0, 62).reshape(4, 3)]
    moves = []
    for n in (4, 0):
        axis, anchor = (Dual.constant(Interval.of(x), n) for x in places)
        moves.append(MovedJoint(hand.joints[0].rates, axis, anchor, True, ()))
    some = HandMotion((moves[0],), (moves[1],), *[np.zeros(4)] * 3).some(np.array([3, 1]))
    for its, n in ((some.joints[0], 4), (some.middle[0], 0)):
        assert its.axis.value.mid.tolist() == [[9, 10, 11], [3, 4, 5]]
        assert its.anchor.value.mid.tolist() == [[59, 60, 61], [53, 54, 55]]
        assert its.axis.slope.shape == its.anchor.slope.shape == (n, 2, 3)


@pytest.mark.parametrize(
    ("work", "at"),
    [({"slid": 0.98e9}, True), ({"slid": 1.02e9}, False), ({"turned": 4.9e10}, True), ({"turned": 5.1e10}, False)],
)
def test_what_a_state_misses_of_joint_torques_counts(work: dict[str, float], at: bool) -> None:
    """1e-9 of 3 N, or of 3 N at 20 mm from the middle, times so many m/s or rad/s: 3 W of the load are 1e9 m/s."""
    assert shown(pressed(3.0), rises(), by_hand(1, hand_joint(1.1), **work)) == [at]


# --- how large loads are ------------------------------------------------------------------------------------


def scales(points: Any, about: Any, loads: Any, weights: Any) -> Any:
    loads, weights = np.array(loads, dtype=float), np.array(weights, dtype=float)
    placements = Placements.of(jaws(), loads, 0.5)
    return placements._scales(Interval.of(np.array(points, dtype=float)), np.array(about, dtype=float), weights)


def test_scales_of_loads_by_hand() -> None:
    """2 N along z at the origin, with contacts about x = 1: 2 N m about these, which are 0.3 m apart at most."""
    near, far = (size * np.array([[-3.0, 0, 0], [1, 0, 0], [2, 0, 0]]) + [0.25, 0, 0] for size in (0.1, 0.2))
    loads = [[0, 0, 2.0, 0, 0, 0], [0, 0, 0, 5.0, 0, 0]]
    found = scales([near, far, near], [[0.75, 0, 0]] * 3, loads, [[1, 0], [1, 0], [3, 2]])
    force = np.array([2 + 2 / 0.3, 2 + 2 / 0.6, 6 + 16 / 0.3])
    torque = np.array([2 * 0.3 + 2, 2 * 0.6 + 2, 6 * 0.3 + 16])
    for its, least in ((found.force, force), (found.torque, torque)):
        assert (its >= least).all()
        assert its == pytest.approx(least, rel=1e-12)
    assert found.center.mid == pytest.approx(np.tile([0.25, 0, 0], (3, 1)))  # from there
    assert (found.contacts, found.enough.tolist()) == (3, [True] * 3)
    alone = scales([[[0.0, 0, 0]]], [[1.0, 0, 0]], loads[:1], [[1]])
    assert (alone.force[0], alone.torque[0]) == (pytest.approx(2), pytest.approx(2))  # it has no size
    assert alone.contacts == 1


def known(contacts: int, force: float = 3.0, torque: float = 5.0, center: Sequence[float] = (0, 0, 0)) -> _Scales:
    f, m = np.array([force]), np.array([torque])
    return _Scales(Interval.of(np.array([center], dtype=float)), f, m, contacts, np.array([True]))


@pytest.mark.parametrize(
    ("contacts", "line", "work"),
    [(2, (-1, -1), 3 * 0.5 + 5 * 0.25), (2, (0, 1), 5 * 0.25), (2, (1, 0), 5 * 0.25), (3, (0, 1), 3 * 0.5 + 5 * 0.25)],
)
def test_the_most_that_loads_of_a_size_do(contacts: int, line: tuple[int, int], work: float) -> None:
    """0.5 m/s of the centroid and 0.25 rad/s; about the line through both contacts the centroid rests."""
    v, omega = (Interval.of(np.array([x], dtype=float)) for x in ([0.5, 0, 0.25], [0, 0.25, 0]))
    assert known(contacts, center=[1.0, 0, 0]).work((v, omega), line) == pytest.approx([work])


def test_a_centroid_that_rests_counts_for_nothing_where_contacts_coincide() -> None:
    v, omega = Interval.of(np.zeros((1, 3))), Interval.of(np.array([[0, 1.0, 0]]))
    with np.errstate(all="ignore"):
        assert known(2, force=np.inf).work((v, omega), (0, 1)) == pytest.approx([5.0])


def test_what_is_missed_of_joint_torques_by_hand() -> None:
    """1e-9 of 5 N m for each rad/s, and of 3 N for each m/s; a single contact has no size to compare with."""
    for turned, slid in ((0.0, 0.0), (2.0, 0.0), (0.0, 0.5), (2.0, 0.5)):
        least = 1e-9 * (5 * turned + 3 * slid)
        (found,) = known(2).of_joints(np.array([turned]), np.array([slid]))
        assert least <= found <= least * (1 + 1e-12)
        (alone,) = known(1).of_joints(np.array([turned]), np.array([slid]))
        assert alone == (np.inf if turned or slid else 0)
    with np.errstate(all="ignore"):
        assert known(2, force=np.inf).of_joints(np.array([2.0]), np.array([0.0])) == pytest.approx([1e-8])
    with_hand = by_hand(1, hand_joint(1.0), turned=2.0, slid=0.5)
    (alone,) = known(2).missed(np.array([7.0]), None)
    assert 7e-9 * (1 + 1e-14) <= alone <= 7e-9 * (1 + 1e-12)
    assert known(2).missed(np.array([7.0]), with_hand) == pytest.approx([7e-9 + 11.5e-9])
    small = replace(known(2), enough=np.array([False]))
    assert small.missed(np.array([7.0]), None) == [np.inf]


# --- a factor on the loads --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("factor", "weighs", "at"), [(2.0, 0.51, True), (2.0, 0.49, False), (0.5, 2.1, True), (0.5, 1.9, False)]
)
def test_so_many_times_a_load_is_not_balanced(factor: float, weighs: float, at: bool) -> None:
    """Jaws that push with up to 1 N, mu = 0.5, carry 1 N."""
    loads, twist = {"w": weight([0, 0, 0], weighs * DOWN)}, Fields(of_twist(0, 0, -1, 0, 0, 0))
    done = replay_unbalanced(jaws(), loads, 0.5, 1.0, None, twist, factor)
    assert done.ok == at
    assert done.claim.endswith(f"normal forces up to 1 N no contact forces balance {factor:g} times or more w")


def test_boxes_are_judged_one_by_one() -> None:
    """Points at which both jaws slide, with a weight that they carry and twice that, upwards and downwards."""
    box = np.full((4, 4, 2), 0.5)
    twist = np.array([[0, 0, z, 0, 0, 0] for z in (-1.0, 1, -1, -1)])
    motions = Motions(np.array([[1.0], [1], [0], [1]]), np.full((4, 2), -1), twist)
    placements = Placements.of(jaws(), weight([0, 0, 0])[None], 0.5, 1 / 1.25)
    found = placements.examined(box, motions)
    assert found.refuted.tolist() == [True, False, False, True]
    assert found.missing[[0, 3]].tolist() == [0, 0]
    assert found.missing[1] == pytest.approx(1.8)
    assert found.near.tolist() == [1, 0, 0, 1]
    assert found.reach.shape == (4, 4)
    assert found.reach[0].tolist() == [0] * 4  # nothing is left to change


@pytest.mark.parametrize(
    ("lower", "middle", "near"),
    [
        (1, 2, 1),
        (0, 2, 1),
        (-1, 3, 0.75),
        (-0.5, 1, 2 / 3),
        (-4, 4, 0.5),
        (-1, -2, 0),
        (np.nan, 1, 0),
        (-1, np.nan, 0),
        (-1, np.inf, 0),
    ],
)
def test_how_near_a_box_is_to_be_shown(lower: float, middle: float, near: float) -> None:
    with np.errstate(all="ignore"):
        assert nearness(np.array([[float(lower)]]), np.array([[float(middle)]]))[0, 0] == pytest.approx(near)


# --- distances ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("center", "least"),
    [
        ([0.05, 0, 0], 0.038),
        ([-0.03, 0, 0], 0.038),
        ([0.01, 0, 0.04], 0.038),
        ([0.05, 0.1, 0], 0.03 * np.cos(np.arctan(0.1))),  # from one edge to the other, 2 mm on 20 mm: 10 mm aside there
    ],
)
def test_the_distance_from_a_line_that_is_aside(center: list[float], least: float) -> None:
    """Squares of 2 mm half side about x = 10 mm: along their edges lines are nearer by as much."""
    sides = [patch([0.01, y, 0], [HALF, 0, 0], [0, 0, -HALF if y > 0 else HALF]) for y in (0.02, -0.02)]
    placements = Placements.of(data(*sides), weight(FAR)[None], 0.5)
    assert 0.95 * least <= placements.line_distance(np.array(center)) <= least


def test_contacts_that_may_coincide_have_no_line() -> None:
    region = square(1, WIDTH / 2, HALF)
    placements = Placements.of(data(region, region), weight(FAR)[None], 0.5)
    with np.errstate(all="ignore"):
        lower, _, _ = placements._line_distances(np.array([WHOLE[0], np.full((4, 2), 0.5)]), np.array([1.0, 0, 0]))
    assert lower.tolist() == [0, 0]


@pytest.mark.parametrize("seed", range(3))
def test_distances_of_boxes_are_lower_bounds(seed: int) -> None:
    rng, (regions, _) = np.random.default_rng(seed), skew(seed, 2)
    placements, center = Placements.of(data(*regions), weight(FAR)[None], 0.5), 0.05 * rng.normal(size=3)
    low = 0.9 * rng.random((50, 4))
    boxes = np.stack([low, low + 0.1 * rng.random((50, 1))], axis=2)
    with np.errstate(all="ignore"):
        lower, middle, reach = placements._line_distances(boxes, center)
    share = np.vstack([np.full(4, 0.5), rng.random((30, 4)), np.ones(4), np.zeros(4)])
    for k, box in enumerate(boxes):
        x = box[:, 0] + share * np.ptp(box, axis=1)
        p, q = (r.at(x[:, 2 * i], x[:, 2 * i + 1]) for i, r in enumerate(regions))
        away = np.linalg.norm(np.cross(p - center, q - p), axis=1) / np.linalg.norm(q - p, axis=1)
        assert middle[k] == pytest.approx(away[0])
        assert lower[k] <= away.min() + 1e-12
        assert lower[k] >= 2 * away.min() - away.max() - 0.01
        assert (reach[k] > 0).all()


def test_how_far_regions_reach() -> None:
    """The farthest corner of either region."""
    near, far = square(1, 0.01, 0.002), square(-1, -0.03, 0.004)
    reach = Placements.of(data(near, far), weight(FAR)[None], 0.5).reach
    assert np.sqrt(0.03**2 + 2 * 0.004**2) <= reach <= 0.0310


# --- files ---------------------------------------------------------------------------------------------------------

JOINTS = ["a", "", "c"]  # the second may not move


def test_motions_of_joints_in_a_file() -> None:
    given = [
        {"loads": {"w": 1.0}, "twist": [1.0, 2, 3, 4, 5, 6], "joints": {"c": 0.5}},
        {"loads": {"v": 2.0}, "line": [1, 0]},
        {"loads": {"w": 1.0, "v": 2.0}, "twist": [0.0] * 6, "joints": {"a": -1.0, "c": 2.0}},
        {"loads": {"w": 1.0}, "line": [0, 1]},
    ]
    read = Motions.read(Fields({"motions": given}), ["w", "v"], 2, JOINTS)
    assert read.joints.tolist() == [[0, 0, 0.5], [0, 0, 0], [-1, 0, 2], [0, 0, 0]]
    assert read.moved.tolist() == [True, False, True, False]
    assert read.line.tolist() == [[-1, -1], [1, 0], [-1, -1], [0, 1]]
    assert read.line.dtype == np.int64
    assert read.twist.tolist() == [given[0]["twist"], *[[0] * 6] * 3]
    assert read.to_json(["w", "v"], JOINTS) == given
    none = Motions.read(Fields({"motions": []}), ["w"], 2)
    assert (len(none), none.line.shape, none.line.dtype, none.twist.shape) == (0, (0, 2), np.int64, (0, 6))
    for name in ("b", ""):
        wrong = [given[1], given[0] | {"joints": {name: 1.0}}]
        with pytest.raises(BadFile, match=rf"^p.motions\[1\].joints: has unknown joint '{name}'; known are a, c$"):
            Motions.read(Fields({"motions": wrong}, "p"), ["w", "v"], 2, JOINTS)


def test_motions_with_and_without_joints_together() -> None:
    still, moving = rises(), replace(rises(), joints=np.array([[1.0, 2.0]]))
    assert still.joints.shape == (1, 0)
    assert still.with_more(moving).joints.tolist() == [[0, 0], [1, 2]]
    assert moving.with_more(still).joints.tolist() == [[1, 2], [0, 0]]
    assert still.with_more(still).joints.shape == (2, 0)


@pytest.mark.parametrize("ends", [[1.0, np.nextafter(1, 2)], [np.nextafter(1, 0), 1.0]])
def test_a_box_without_a_middle_is_not_halved(ends: list[float]) -> None:
    tree = UnbalancedTree(rises(), (0, None, None))
    with pytest.raises(Refused, match=r"^the tree halves a box that is too small, at entry 0$"):
        tree.leaves(np.array([ends, [0, 1]]))


def test_what_is_claimed_of_several_loads_and_limits() -> None:
    loads = {"a": weight([0.06, 0, 0]), "b": weight([0, 0, 0])}
    assert replayed(jaws(), loads, of_line(1, 0, a=0.5, b=0.5)).claim.endswith("contact forces balance all of a, b")
    assert replayed(jaws(), loads, of_line(1, 0, a=0.5)).claim.endswith("contact forces balance a")
    some = replayed(jaws(), loads, of_line(1, 0, a=0.5), limit=np.array([1.23456, np.inf]))
    assert "and normal forces up to 1.23456, any N no contact" in some.claim
    for tree, boxes in (([2, 0, -1, None, -1], 5), ([2, 0, -1, -1], 4)):
        refused = replayed(jaws(), {"w": weight(FAR)}, {**RIGHT, "tree": tree})
        assert refused.figures == {"boxes": boxes}
        assert refused.name == "balance"
        assert refused.claim.endswith("no contact forces balance w")
    one_each = of_line(1, 0, a=0.5) | {"tree": [2, -1, -2]}
    one_each["motions"] += of_line(1, 0, b=1.0)["motions"]
    both = replayed(jaws(), {"a": loads["a"], "b": loads["a"]}, one_each)
    assert both.ok
    assert both.claim.endswith("contact forces balance all of a, b")
    far = replayed(jaws(), {"w": weight(FAR)}, of_line(1, 0), center=np.array(FAR))
    assert f"is at least {down(1e3 * far.figures['line_distance'], 3)} mm from" in far.claim  # type: ignore[operator]
    on_it = replayed(jaws(), {"w": weight(FAR)}, of_line(1, 0), center=np.zeros(3))
    assert on_it.figures["line_distance"] == 0
    assert on_it.claim.endswith("no contact forces balance w")


def test_a_box_is_refuted_by_its_own_motion() -> None:
    proof = of_line(1, 0)
    proof["motions"] += of_line(0, 1)["motions"]
    for tree, ok in (([-1], True), ([-2], False), ([0, -1, -1], True), ([0, -1, -2], False), ([0, -2, -1], False)):
        assert replayed(jaws(), {"w": weight(FAR)}, proof | {"tree": tree}).ok == ok


def test_a_tree_has_so_many_entries_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unbalanced, "MAX_TREE_ENTRIES", 5)
    assert replayed(jaws(), {"w": weight(FAR)}, RIGHT).ok
    with pytest.raises(BadFile, match=r"^tree: is no list of 1 to 5 entries$"):
        replayed(jaws(), {"w": weight(FAR)}, {**RIGHT, "tree": [*RIGHT["tree"], -1]})  # type: ignore[misc]


@pytest.mark.parametrize(("sense", "at"), [(1.0, True), (-1.0, False)])
def test_a_contact_on_the_line_that_a_finger_moves_has_to_open(sense: float, at: bool) -> None:
    """The first jaw, at y = 20 mm, is drawn back along y, or pushes on."""
    line = Motions(np.ones((1, 1)), np.array([[1, 0]]), np.zeros((1, 6)))
    jaw = by_hand(1, joint([sense], [0, 1.0, 0], (0,)))
    for limit in (np.inf, 1e3):
        assert shown(Placements.of(jaws(), weight(FAR)[None], 0.5, limit), line, jaw) == [at]


@pytest.mark.parametrize(("torsion", "at"), [(0.0139, True), (0.0141, False)])
def test_soft_contacts_on_the_line_do_not_slide_wherever_they_are(torsion: float, at: bool) -> None:
    """28 mm at least from the weight of 1 N; each finger's torsion is that of 1 N."""
    done = replay_unbalanced(jaws(), {"w": weight(FAR)}, 0.5, 1.0, None, Fields(of_line(1, 0)), torsion=torsion)
    assert done.ok == at


@pytest.mark.parametrize(("pushes", "at"), [(0.35, True), (0.39, False)])
def test_a_limited_third_soft_contact_lets_it_turn(pushes: float, at: bool) -> None:
    """1 N at 30 mm from the line against a contact that pushes up at 80 mm, without friction to speak of."""
    below = patch([0.08, 0, -0.01], [0, 1e-5, 0], [1e-5, 0, 0])
    regions = data(square(1, WIDTH / 2, 1e-6), square(-1, -WIDTH / 2, 1e-6), below)
    proof = Fields(of_line(1, 0))
    assert replay_unbalanced(regions, {"w": weight(FAR)}, 1e-3, pushes, None, proof, torsion=1e-9).ok == at


def test_what_is_enough_to_prove_anything_of() -> None:
    """A force without a moment, or a moment without a force."""
    at = [[[-0.3, 0, 0], [0.3, 0, 0]]]
    for load, enough in (([0, 0, 2.0, 0, 0, 0], True), ([0, 0, 0, 0, 2.0, 0], True), ([0.0] * 6, False)):
        assert scales(at, [[0, 0, 0]], [load], [[1]]).enough.tolist() == [enough]


def test_forces_beyond_their_limits_by_hand() -> None:
    """By how much the second contact falls short, times 1e-9 of 2 times 5 N m and 0.25 times 3 N; 0 of the first."""
    limits = ForceLimits(np.array([1.0, 1.0]), np.array([0.0, 2.0]), np.array([0.0, 0.25]))
    for short, times in (([0.5, 0.0], 0.0), ([0.0, 0.5], 0.5), ([9.0, 0.25], 0.25)):
        least = 1e-9 * 10.75 * times
        (found,) = known(3).of_forces(np.array([short]), limits, [0, 1])
        assert least <= found <= least * (1 + 1e-12)
    with np.errstate(all="ignore"):  # nothing is missed, or nothing falls short, of something endless
        endless = replace(known(3), force=np.array([np.inf]))
        assert endless.of_forces(np.array([[np.inf, 0.0]]), limits, [0, 1]) == [0]


def test_each_box_has_its_own_factor() -> None:
    """0.6 N on jaws that carry 1 N: the same in both boxes, once and twice."""
    placements = Placements.of(jaws(), weight([0, 0, 0], 0.6 * DOWN)[None], 0.5, 1.0)
    down_ = Motions(np.ones((2, 1)), np.full((2, 2), -1), np.tile([0, 0, -1.0, 0, 0, 0], (2, 1)))
    ((_, bounds),) = placements._bounds(np.full((2, 4, 2), 0.5), down_)
    for factors in ([1.0, 2.0], [2.0, 1.0], [1.0, 1.0], [2.0, 2.0], [1.5, 1.8]):
        assert bounds.shown(np.array(factors)).refuted.tolist() == [factor > 1 / 0.6 for factor in factors]


def test_what_a_parameter_changes_is_a_share_of_each_claim_that_is_not_shown() -> None:
    """A twist about an axis aside, of which neither the work nor what either jaw does is shown."""
    motions = Motions(np.ones((2, 1)), np.full((2, 2), -1), np.tile([0.0, 0.01, 0.02, 1, 2, 3], (2, 1)))
    boxes = np.concatenate([WHOLE, 0.5 + 0.1 * (WHOLE - 0.5)])
    found = Placements.of(jaws(), weight([0, 0.01, 0])[None], 0.5).examined(boxes, motions)
    assert not found.refuted.any()
    claims = found.reach.sum(axis=1)
    assert claims == pytest.approx(np.round(claims))
    assert (claims >= 1).all()
    assert (found.reach > 0).any(axis=1).all()


def test_friction_and_torsion_are_rounded_upwards() -> None:
    """In rational numbers: the sine of the friction angle, and torsion over friction."""
    for friction in (0.1, 0.3, 0.5, 1.7, 12.0):
        placements = Placements.of(jaws(), weight(FAR)[None], friction, torsion=0.003)
        mu, sine = Fraction(friction), Fraction(placements.sine)
        assert mu**2 <= sine**2 * (1 + mu**2) <= mu**2 * (1 + Fraction(1, 10**13))
        assert Fraction(0.003) <= Fraction(placements.lever) * mu <= Fraction(0.003) * (1 + Fraction(1, 10**13))
    assert Placements.of(jaws(), weight(FAR)[None], 0.5).lever == 0


def test_points_and_normals_into_the_object() -> None:
    points, normals = Placements.of(jaws(), weight(FAR)[None], 0.5).at(np.full((2, 4), 0.5))
    assert points == pytest.approx(np.array([[[0, 0.02, 0], [0, -0.02, 0]]] * 2))
    assert normals == pytest.approx(np.array([[[0, -1, 0], [0, 1, 0]]] * 2))


def test_a_line_may_go_from_any_contact_to_any_other() -> None:
    """The third contact, above, lets the object turn about the jaws' line, one way for each weight."""
    top = patch([0, 0, 0.01], [1e-3, 0, 0], [0, 1e-3, 0])
    regions = data(square(1, WIDTH / 2, HALF), square(-1, -WIDTH / 2, HALF), top)
    lines = np.array([[0, 1], [0, 2], [2, 1], [1, 0], [1, 2], [2, 0]])
    for center in (FAR, [-0.03, 0, 0]):
        placements = Placements.of(regions, weight(center)[None], 0.1, 1e-6)
        motions = Motions(np.ones((6, 1)), lines, np.zeros((6, 6)))
        found = placements.examined(np.tile([0.0, 1.0], (6, 6, 1)), motions)
        each = [placements.examined(np.tile([0.0, 1.0], (1, 6, 1)), motions[k : k + 1]).refuted[0] for k in range(6)]
        assert found.refuted.tolist() == each
        assert (each[0], each[3]) == (center != FAR, center == FAR)


def test_what_is_not_known_of_boxes_is_no_number() -> None:
    nothing = BoxBounds.unknown(2, 3)
    assert (nothing.refuted.tolist(), nothing.near.tolist()) == ([False] * 2, [0, 0])
    assert np.isnan(nothing.reach).all()
    assert np.isnan(nothing.missing).all()
    assert nothing.reach.shape == (2, 3)


def test_the_least_factor_that_refutes_a_box() -> None:
    """1 N on jaws that carry 1 N between them, and half of that; upwards none."""
    twist = np.array([[0, 0, z, 0, 0, 0] for z in (-1.0, -1, 1)])
    motions = Motions(np.array([[1.0], [0.5], [1]]), np.full((3, 2), -1), twist)
    placements = Placements.of(jaws(), weight([0, 0, 0])[None], 0.5, 1.0, factor=7.0)
    factors, reach = placements.least_factors(np.tile([0.0, 1.0], (3, 4, 1)), motions)
    assert factors == pytest.approx([1, 1, np.inf], rel=1e-6)
    assert (reach.shape, reach.dtype) == ((3, 4), float)
    assert (factors[:2] >= 1).all()


@pytest.mark.parametrize(("apart", "known"), [(1e-12, True), (3e-14, True), (1e-14, False), (0.0, False)])
def test_of_contacts_in_one_place_nothing_is_known(apart: float, known: bool) -> None:
    """1 m from the object's origin: how much torque a state may miss there depends on the hand's joints."""
    with np.errstate(all="ignore"):
        found = scales([[[-apart, 0, 0], [apart, 0, 0]]], [[0, 1.0, 0]], [[0, 0, 1.0, 0, 0, 0]], [[1]])
    assert found.enough.tolist() == [known]
