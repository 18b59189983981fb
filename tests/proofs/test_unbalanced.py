"""The proof that no contact forces balance a load, wherever the contacts are: cases derived by hand, wrong proofs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.model.region import Bezier, Cap, Region
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.intervals import Dual, Interval
from handfast.proofs.regions import RegionData, read_region
from handfast.proofs.replay import Replay
from handfast.proofs.tolerance import MIN_FORCE_SCALE
from handfast.proofs.unbalanced import BoxBounds, Motions, Placements, _positive, down, replay_unbalanced
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
    "no such contact": ({"motions": [{**MOTION, "line": [1, 2]}]}, r"line: is \[1, 2\]; two of the contacts 0 to 1"),
    "both": ({"motions": [{**MOTION, "twist": [0.0] * 6}]}, "needs either a line or a twist"),
    "neither": ({"motions": [{"loads": {"w": 1.0}}]}, "needs either a line or a twist"),
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


def test_figures_are_rounded_down() -> None:
    assert [down(x) for x in (4.1999, 0.0123456, 356.7, 8.0)] == ["4.19", "0.0123", "356", "8"]
