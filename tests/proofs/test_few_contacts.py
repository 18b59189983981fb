"""Few contacts cannot hold an object: cases by hand, parts of its surface, wrong claims, nothing possible lost."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from handfast import check
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.model.body import Body
from handfast.model.grasp import Contact, Grasp
from handfast.model.shape import Kind, Shape
from handfast.planning.filters.balance import imbalance
from handfast.proofs import few_contacts
from handfast.proofs.few_contacts import Fewest, Held, _meets, replay, replay_of_loads, to_json, words
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.solids import EIGHTHS, ConvexSolid, SurfaceParts, angle, hidden
from handfast.stability.problem.loads import Loads
from tests.support.held_bodies import BALL, CENTER, held, stone

UP = np.array([0.0, 0.0, 1.0])


# --- loads alone --------------------------------------------------------------------------------------


def test_loads_of_both_signs_need_more_frictionless_contacts_than_directions() -> None:
    assert held(BALL, 0.0, np.zeros(3)).fewest() == Fewest(4, "opposed")
    assert held(BALL, 0.0).fewest() == Fewest(None, "turning")  # its weight is off its middle
    both = Loads(("a", "b"), np.array([[1.0, 0, 0, 0, 0, 0], [-2.0, 0, 0, 0, 0, 0]]))
    assert held(BALL, 0.0, np.zeros(3), loads=both).fewest() == Fewest(2, "opposed")
    turns = Loads(("a", "b"), np.array([[0, 0, 0, 1.0, 0, 0], [0, 0, 0, -1.0, 0, 0]]))
    assert held(stone(0), 0.0, loads=turns).fewest() == Fewest(2, "opposed")
    assert held(stone(0), 0.5, loads=turns).fewest() == Fewest(2, "opposed")


def test_what_a_state_may_miss_of_the_loads_is_no_direction() -> None:
    """Loads along x with torques of 1e-12 N m: two contacts that face each other along x hold all four, to 1e-9."""
    loads = np.zeros((4, 6))
    loads[:, 0], loads[:2, 4], loads[2:, 5] = (1, -1, 1, -1), (1e-12, -1e-12), (1e-12, -1e-12)
    grasp = Grasp([Contact((0.03, 0, 0), (-1, 0, 0), 0.0), Contact((-0.03, 0, 0), (1, 0, 0), 0.0)])
    for load in loads:
        answer = check(grasp, load)
        assert answer.verdict is Verdict.HOLDS
        assert answer.verify().ok
    box = Shape("box", [0.06, 0.06, 0.06])
    assert held(box, 0.0, np.zeros(3), loads=Loads(tuple("abcd"), loads)).fewest() == Fewest(2, "opposed")


def test_of_one_load_nothing_is_said() -> None:
    assert held(stone(0), 0.0, loads=Loads.wrench([0, 0, 1.0])).fewest() == Fewest(1)
    none = Loads(("none", "up"), np.array([[0.0] * 6, [0, 0, 1, 0, 0, 0]]))  # no load is not one of both signs
    assert held(stone(0), 0.5, loads=none).fewest() == Fewest(1)
    slanted = Loads(("a", "b"), np.array([[1.0, 0, 0, 0, 0, 0], [-1.0, 0, 1e-6, 0, 0, 0]]))
    assert held(stone(0), 0.0, loads=slanted).fewest() == Fewest(1)


def test_without_friction_a_round_object_turns() -> None:
    turn = Loads.wrench([0, 0, 0, 0, 0, 0.1])
    for kind, size in (("cylinder", [0.03, 0.1]), ("capsule", [0.03, 0.1]), ("ellipsoid", [0.03, 0.03, 0.05])):
        assert held(Shape(kind, size), 0.0, loads=turn).fewest() == Fewest(None, "turning")
    assert held(BALL, 0.0, loads=Loads.wrench([0, 0, 0, 0.1, 0.2, 0])).fewest() == Fewest(None, "turning")
    can = Shape("cylinder", [0.03, 0.1])
    for other in (held(can, 1e-6, loads=turn), held(can, 0.0, loads=Loads.wrench([0, 0, 0, 0.1, 0, 0]))):
        assert other.fewest() == Fewest(1)
    assert held(Shape("ellipsoid", [0.03, 0.031, 0.05]), 0.0, loads=turn).fewest() == Fewest(1)


def test_what_is_not_round_does_not_turn() -> None:
    egg, none = Shape("ellipsoid", [0.03, 0.03, 0.05]), Shape("ellipsoid", [0.03, 0.04, 0.05])
    across, aslant = Loads.wrench([0, 0, 0, 0.1, 0, 0]), Loads.wrench([0, 0, 0, 0.1, 0, 0.1])
    assert held(egg, 0.0, np.zeros(3), loads=across).fewest() == Fewest(1)
    assert held([BALL, none], 0.0, np.zeros(3), loads=aslant).fewest() == Fewest(1)
    assert held([BALL, stone(0)], 0.0, np.zeros(3), loads=aslant).fewest() == Fewest(1)
    for turns in (egg, Shape("cylinder", [0.03, 0.1])):  # a part of it is about the axis
        assert held(turns, 0.0, np.zeros(3), loads=aslant).fewest() == Fewest(None, "turning")


def test_round_solids_have_to_have_one_axis() -> None:
    turn = Loads.wrench([0, 0, 0, 0, 0, 0.1])

    def beside(x: float, z: float = 0.05) -> list[Shape]:
        pose = np.eye(4)
        pose[:3, 3] = x, 0, z
        return [Shape("cylinder", [0.03, 0.1]), Shape("sphere", [0.02], pose)]

    assert held(beside(0), 0.0, loads=turn).fewest().contacts is None
    assert held(beside(1e-8), 0.0, loads=turn).fewest() == Fewest(1)
    assert held([*beside(0), stone(0)], 0.0, loads=turn).fewest() == Fewest(1)
    assert held([*beside(0, 0.0)], 0.0, loads=Loads.wrench([0.1, 0, 0, 0, 0, 0])).fewest() == Fewest(1)


def test_limited_forces_do_not_add_up_to_the_loads() -> None:
    down = Loads.wrench([0, 0, -9.9])
    assert held(BALL, 0.0, np.zeros(3), loads=down, limit=1.0).fewest() == Fewest(10, "force")
    assert held(BALL, 1.0, np.zeros(3), loads=down, limit=1.0).fewest() == Fewest(8, "force")  # 9.9 / sqrt(2)
    # from six sides a normal between two axes gives 2 (1 + mu) / sqrt(2) + 2 mu, without friction one between three
    # sqrt(3): 19.6 and 34.6 contacts; directions are looked at in steps, which takes 3 % at most
    assert held(BALL, 0.5, np.zeros(3), limit=1 / 10.2).fewest() == Fewest(20, "force")
    assert held(BALL, 0.0, np.zeros(3), limit=1 / 10.0).fewest() == Fewest(34, "force")
    turn = Loads.wrench([0, 0, 0, 0, 0, 0.1])  # at 30 mm from the middle
    assert held(BALL, 0.0, np.zeros(3), loads=turn, limit=1.0).fewest().contacts is None
    assert held(BALL, 0.75, np.zeros(3), loads=turn, limit=1.0).fewest() == Fewest(3, "force")  # 0.1 / 0.03 / 1.25
    assert held(BALL, 0.0, np.zeros(3), limit=10.0).fewest() == Fewest(4, "opposed")  # the stronger of both


# --- two contacts -------------------------------------------------------------------------------------


def sampled(shape: Shape, center: Array, lines: int = 100_000) -> float:
    """The least friction with which two contacts on faces hold, over random lines through the centre of mass."""
    vertices, faces = shape.triangles()
    a, b, c = vertices[faces].swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = ((a - center) * normal).sum(axis=1)
    along = np.random.default_rng(0).normal(size=(lines, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    out = np.zeros(lines)
    for way in (along @ normal.T, -along @ normal.T):
        first = np.where(way > 1e-9, height / np.maximum(way, 1e-9), np.inf).argmin(axis=1)
        out = np.maximum(out, np.arccos(np.clip(way[np.arange(lines), first], -1, 1)))
    return float(np.tan(out.min()))


@pytest.mark.parametrize(("seed", "share"), [(1, 0.5), (5, 0.5)])
def test_two_contacts_need_the_friction_that_the_best_line_needs(seed: int, share: float) -> None:
    shape = stone(seed, 5)
    center = shape.centroid + 0.004
    least = sampled(shape, center)
    assert held(shape, 1.001 * least, center).fewest().contacts == 2
    assert held(shape, share * least, center).fewest() == Fewest(3, "line")


def test_it_needs_weights_from_every_side() -> None:
    shape = stone(1, 5)
    center = shape.centroid + 0.004
    mu = 0.02
    assert held(shape, mu, center).fewest() == Fewest(3, "line")
    body = Body.of([shape], mass=1.0, center_of_mass=center)
    flat = Loads.gravity(body, ["+x", "-x", "+y", "-y"])
    assert held(shape, mu, center, loads=flat).fewest() == Fewest(2, "opposed")
    ways = np.array([[1.0, 0, 0], [0, 1, 0], [1, 1, 0]])
    assert held(shape, mu, center, loads=Loads.gravity(body, np.vstack([ways, -ways]))).fewest() == Fewest(2, "opposed")
    nearly = Loads.gravity(body, np.vstack([ways, -ways]) + [0, 0, 0.01] * np.array([[1], [0], [0], [-1], [0], [0]]))
    for size in (1e-3, 1.0, 1e3):  # what counts is where weights point, not how large they are
        assert held(shape, mu, center, loads=replace(nearly, wrenches=size * nearly.wrenches)).fewest().contacts == 2
        every = Loads.gravity(body)
        assert held(shape, mu, center, loads=replace(every, wrenches=size * every.wrenches)).fewest().contacts == 3
    off = Loads((*flat.names, "a", "b"), np.vstack([flat.wrenches, [[0, 0, 1.0, 0, 0, 0], [0, 0, -1.0, 0, 0, 0]]]))
    assert held(shape, mu, center, loads=off).fewest() == Fewest(2, "opposed")


def test_where_solids_meet_is_no_surface() -> None:
    shape = stone(1, 5)
    center = shape.centroid + 0.004
    v, normal = shape.vertices, np.array([0.6, 0.0, 0.8])
    height = (v - center) @ normal
    ends = [(a, b) for a in range(len(v)) for b in range(len(v)) if height[a] < 0 < height[b]]
    cut = [v[a] + (v[b] - v[a]) * height[a] / (height[a] - height[b]) for a, b in ends]
    halves = [Shape.hull(np.vstack([v[sign * height > 0], cut])) for sign in (1, -1)]
    within = Shape("sphere", [0.001], np.block([[np.eye(3), center[:, None]], [np.zeros(3), 1.0]]))
    assert held([shape, within], 0.02, center).fewest() == Fewest(3, "line")
    assert held([*halves, within], 0.02, center).fewest() == Fewest(3, "line")
    touching = ", where solids touch that are less than 1e-05 of the object's length apart"
    for solids, more in (([shape, within], touching), ([shape], "")):
        claim = replay(said(held(solids, 0.02, center))).claim
        assert claim.endswith("and there is no such line" + more)
    one = held(halves, 0.02, center)
    parts = one.solids[0].parts()
    assert parts is not None
    assert not hidden(parts, one.solids[:1]).any()
    flat = np.abs((parts.points - center) @ normal).max(axis=1) < 1e-9
    inner = flat & (angle(parts.normals, normal) % np.pi < 1e-6).all(axis=1)
    assert inner.any()
    assert hidden(parts, one.solids)[inner].all()
    assert not hidden(parts, one.solids).all()


def test_what_is_no_closed_convex_mesh_shows_nothing() -> None:
    one = held(stone(1, 5), 0.02, stone(1, 5).centroid + 0.004)
    (solid,) = one.solids
    assert one.fewest().contacts == 3
    assert replace(one, solids=(replace(solid, faces=solid.faces[1:]),)).fewest().contacts == 2
    broken = replace(solid, faces=solid.faces[1:])
    for solids in ((solid, broken), (broken, solid)):
        assert not replace(one, solids=solids)._no_line()
    other = solid_of(stone(3, 20))
    dented = other.vertices.copy()
    dented[0] = 0.1 * dented[0] + 0.9 * dented.mean(axis=0)
    assert other.parts() is not None
    assert replace(other, vertices=dented).parts() is None
    assert replace(solid, faces=np.vstack([solid.faces, solid.faces[:1] * 0])).parts() is None


def test_directions_are_those_of_forces_and_of_lines_through_the_centre_of_mass() -> None:
    one = held(stone(2, 12), 0.3)
    parts = one.solids[0].parts()
    assert parts is not None
    for _ in range(6):
        parts = parts[one._against(parts)].halves(one.center)
    parts = parts[one._against(parts)]
    axis, half, owner = one._lines(parts)
    way, within, push, pushed, _ = one._seen(parts)
    assert (angle(axis, push[owner]) <= half + pushed[owner]).all()
    assert (np.minimum(angle(axis, way[owner]), angle(axis, -way[owner])) <= half + within[owner]).all()
    assert set(owner.tolist()) == {*range(len(parts))}


def test_two_contacts_that_hold_are_never_refuted() -> None:
    rng = np.random.default_rng(4)
    for seed in range(8):
        shape = stone(seed)
        vertices, faces = shape.triangles()
        a, b = (vertices[faces[k]] for k in rng.choice(len(faces), size=2, replace=False))
        p, q = (rng.dirichlet([1, 1, 1]) @ corners for corners in (a, b))
        normals = [np.cross(c[1] - c[0], c[2] - c[0]) for c in (a, b)]
        center, along = p + rng.random() * (q - p), q - p
        turned = [float(angle(-n, s * along)) for n, s in zip(normals, (1, -1), strict=True)]
        if max(turned) > 1.3:
            continue
        mu = float(np.tan(max(turned))) * (1 + 1e-9)
        one = held(shape, mu, center)
        contacts = [Contact(x, -n / np.linalg.norm(n), mu) for x, n in zip((p, q), normals, strict=True)]
        assert not imbalance(Grasp(contacts), one.loads, 1.1).any()
        assert one.fewest().contacts == 2


# --- parts of the surface -----------------------------------------------------------------------------

POSE = np.eye(4)
POSE[:3, :3] = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0] * [1, 1, 1]
POSE[:3, 0] *= np.linalg.det(POSE[:3, :3])
POSE[:3, 3] = 0.1, -0.2, 0.3
ROUND: tuple[tuple[Kind, list[float]], ...] = (
    ("sphere", [0.03]),
    ("capsule", [0.02, 0.05]),
    ("cylinder", [0.02, 0.05]),
    ("ellipsoid", [0.02, 0.03, 0.05]),
)


def solid_of(shape: Shape) -> ConvexSolid:
    (out,) = held(shape, 0.5).solids
    return out


def on_surface(shape: Shape, rng: np.random.Generator, n: int = 16) -> tuple[Array, Array]:
    """Points, and a normal at each: the points that are farthest along random normals, some along flat faces."""
    local = rng.normal(size=(n, 3))
    local[: n // 4, 2] = 0.0
    local[n // 4 : n // 3] = UP
    normals = local @ shape.pose[:3, :3].T
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    features = [shape.feature(normal, 1e-9) for normal in normals]
    return np.array([rng.dirichlet(np.ones(len(f))) @ f for f in features]), normals


@pytest.mark.parametrize(
    "shape", [*(Shape(k, s, POSE) for k, s in ROUND), Shape("box", [0.02, 0.03, 0.05], POSE), stone(3)]
)
@pytest.mark.slow
def test_parts_hold_every_point_with_every_normal(shape: Shape) -> None:
    rng, solid = np.random.default_rng(2), solid_of(shape)
    parts = solid.parts()
    assert parts is not None
    points, normals = on_surface(shape, rng)
    for _ in range(36):
        axis, half = parts.cones()
        middle, reach = parts.balls()
        near = np.linalg.norm(points[:, None] - middle, axis=2) <= reach + 1e-9
        near &= angle(normals[:, None], axis) <= half + 1e-9
        assert near.any(axis=1).all()
        parts = parts[near.any(axis=0)].halves(np.zeros(3))


@pytest.mark.parametrize("shape", [*(Shape(k, s, POSE) for k, s in ROUND), stone(3)])
def test_depth_and_reach_are_those_of_the_shape(shape: Shape) -> None:
    solid, points = solid_of(shape), POSE[:3, 3] + 0.05 * np.random.default_rng(0).normal(size=(100, 3))
    inside = shape.depth(points) > 0
    assert ((solid.depth(points) > 0) == inside).all()
    assert solid.depth(points[inside]) == pytest.approx(shape.depth(points[inside]))
    surface, normals = on_surface(shape, np.random.default_rng(2))
    assert (solid.farthest(normals) * normals).sum(axis=1) == pytest.approx((surface * normals).sum(axis=1))
    low, high = solid.box
    assert (surface >= low - 1e-9).all()
    assert (surface <= high + 1e-9).all()
    assert np.linalg.norm(surface - CENTER, axis=1).max() <= solid.reach(CENTER)


@pytest.mark.parametrize("shape", [*(Shape(k, s, POSE) for k, s in ROUND), stone(3)])
def test_normals_of_parts_are_unit_vectors(shape: Shape) -> None:
    """A radius goes along them. Cut twice, too."""
    parts = solid_of(shape).parts()
    assert parts is not None
    for _ in range(3):
        assert np.linalg.norm(parts.normals, axis=2) == pytest.approx(np.ones((len(parts), 3)), abs=1e-12)
        parts = parts[:: len(parts) // 8].halves(CENTER)


def test_halves_are_no_larger_than_the_whole() -> None:
    parts = solid_of(Shape("box", [0.02, 0.03, 0.05])).parts()
    assert parts is not None
    for _ in range(12):
        parts = parts[:40].halves(CENTER)
    _, half = parts.cones()
    _, reach = parts.balls()
    assert half.max() < 0.3
    assert reach.max() < 0.01


def test_only_what_is_inside_as_a_whole_is_hidden() -> None:
    box = solid_of(Shape("box", [0.04, 0.04, 0.04]))
    normals = np.tile(UP, (3, 3, 1))
    at = np.array([[0.019, 0, 0], [0, 0.019, 0], [0, 0, 0.01]])
    deep, out = at, at + np.array([0.002, 0, 0])
    face = np.array([[0.01, 0, 0.02], [0, 0.01, 0.02], [0, 0, 0.02]])
    below = face * [1, 1, -1]
    parts = SurfaceParts.of(np.stack([deep, out, below]), normals)
    assert hidden(replace(parts, solid=parts.solid + 1), [box]).tolist() == [True, False, True]
    parts = SurfaceParts.of(np.stack([deep, out, face]), normals)
    elsewhere = replace(parts, solid=parts.solid + 1)
    assert hidden(elsewhere, [box]).tolist() == [True, False, False]
    assert hidden(replace(elsewhere, normals=-normals), [box]).tolist() == [True, False, True]
    assert hidden(replace(elsewhere, slack=np.full(3, 0.02)), [box]).tolist() == [False] * 3
    assert not hidden(parts, [box]).any()
    ball = solid_of(Shape("sphere", [0.02]))
    corner = np.array([[0.015, 0.015, 0], [0, 0.019, 0], [0, 0, 0.01]])
    of_ball = SurfaceParts.of(np.stack([at, corner]), normals[:2])
    assert hidden(replace(of_ball, solid=of_ball.solid + 1), [ball]).tolist() == [True, False]
    # eighths of a ball of 4 mm: their arcs may rise sqrt 3 - 1 of that over their corners, which are 3.5 or 2.5 mm deep
    for z, upper in ((0.0125, True), (0.0135, False)):
        eighths = SurfaceParts.of(np.tile([0, 0, z], (8, 3, 1)), EIGHTHS, 0.004)
        assert hidden(replace(eighths, solid=eighths.solid + 1), [box]).tolist() == [upper, True] * 4


# --- files --------------------------------------------------------------------------------------------


def said(one: Held, **changed: Any) -> dict[str, Any]:
    return to_json(one, [f"w{k}" for k in range(len(one.loads))], "thing", one.fewest()) | changed


def test_claims_are_replayed_and_larger_ones_are_refused() -> None:
    one = held(Shape("cylinder", [0.03, 0.1]), 0.0, np.zeros(3))
    assert replay(said(one)).ok
    assert "1 to 3 contacts on its surface cannot hold" in replay(said(one)).claim
    assert replay(said(one, contacts=3)).ok
    for more in (5, None):
        done = replay(said(one, contacts=more))
        assert not done.ok
        assert "shown is only that 1 to 3 contacts" in done.reason
        few = "no number of contacts" if more is None else "1 to 4 contacts"
        assert done.claim.endswith(f": {few} on its surface {'can' if more is None else 'cannot'} hold")
    assert not replay(said(one, friction=0.5)).ok
    turned = held(Shape("cylinder", [0.03, 0.1]), 0.0, loads=Loads.wrench([0, 0, 0, 0, 0, 1.0]))
    assert "no number of contacts" in replay(said(turned)).claim
    assert replay(said(turned, contacts=7)).ok
    assert words(Fewest(3, "line")).startswith("1 or 2 contacts on its surface cannot hold: two point contacts")
    assert words(Fewest(2)) == "1 contact on its surface cannot hold"


def test_meshes_and_limits_are_read_as_they_are_written() -> None:
    """1 N between two contacts of 0.3 N and a friction of 0.5: 1 / (0.3 x 1.118), so that it takes three."""
    one = held(stone(1, 5), 0.5, loads=Loads.wrench([0, 0, -1.0]), limit=0.3)
    (solid,) = said(one)["solids"]
    assert (solid["vertices"], solid["faces"]) == (one.solids[0].vertices.tolist(), one.solids[0].faces.tolist())
    done = replay(said(one))
    assert done.ok
    assert done.figures == {"contacts": 3}
    assert "with a friction of 0.5 and normal forces up to 0.3 N, of" in done.claim
    assert not replay(said(one, force_limit=None)).ok
    assert done.name == "contacts"
    assert "normal" not in replay(said(one, force_limit=None)).claim
    twisted = replay(said(one, torsion=0.005)).claim
    assert "with a friction of 0.5, a torsion of 5 mm and normal forces up to 0.3 N, of w0: " in twisted
    line = held(stone(1, 5), 0.02, stone(1, 5).centroid + 0.004)
    assert replay(said(line)).figures == {"contacts": 3}


@pytest.mark.parametrize("size", [1e-12, 1e12])
def test_no_load_is_small_or_large_by_itself(size: float) -> None:
    every = Loads.gravity(Body.of([BALL], mass=1.0))
    scaled = replace(every, wrenches=size * every.wrenches)
    assert held(BALL, 0.0, np.zeros(3), loads=scaled).fewest() == Fewest(4, "opposed")
    turn = Loads.wrench([0, 0, 0, 0, 0, size])
    assert held(Shape("cylinder", [0.03, 0.1]), 0.0, loads=turn).fewest() == Fewest(None, "turning")


def test_the_largest_torque_counts_of_several() -> None:
    """0.1 and 1e-3 N m at 30 mm from the middle, by 1 N with a friction of 0.75: 0.1 / 0.03 / 1.25 = 2.7 contacts."""
    turns = Loads(("a", "b"), np.array([[0, 0, 0, 0, 0, 0.1], [0, 0, 0, 0, 0, 1e-3]]))
    assert held(BALL, 0.75, np.zeros(3), loads=turns, limit=1.0).fewest() == Fewest(3, "force")
    pose = np.eye(4)
    pose[0, 3] = 0.1  # another ball reaches out to 0.13 m: 0.1 / 0.13 / 1.25 = 0.6
    both = [BALL, Shape("sphere", [0.03], pose)]
    assert held(both, 0.75, np.zeros(3), loads=turns, limit=1.0).fewest() == Fewest(1)


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"contacts": 0}, "1 or more"),
        ({"friction": -1.0}, "0 or more"),
        ({"torsion": -0.5}, "0 or more"),
        ({"solids": [{"kind": "cone"}]}, "'sphere'"),
        ({"solids": [{"kind": "sphere", "size": [-1.0]}]}, "not positive"),
        ({"solids": [{"kind": "sphere", "size": [1.0], "pose": (2 * np.eye(4)).tolist()}]}, "not rigid"),
        ({"solids": [{"kind": "sphere", "size": [1.0], "pose": (1.001 * np.eye(4)).tolist()}]}, "not rigid"),
        ({"solids": [{"kind": "mesh", "vertices": [[0, 0, 0]], "faces": [[0, 0, 1]]}]}, "not there"),
        ({"more": 1}, "known field"),
        ({"force_limit": -1.0}, "^force_limit: is -1; 0 or more is needed$"),
        ({"schema": "handfast/contacts/2"}, "^schema: is 'handfast/contacts/2'; 'handfast/contacts/1' is needed"),
        ({"solids": []}, "^solids: is empty"),
        ({"loads": {}}, "^loads: is empty"),
    ],
)
def test_faults_of_a_file_are_named(changed: dict[str, Any], fault: str) -> None:
    with pytest.raises(BadFile, match=fault):
        replay(said(held(BALL, 0.0, np.zeros(3)), **changed))


# --- what a file of loads alone claims ------------------------------------------------------------------


def of_loads(fewest: Any, loads: dict[str, list[float]], friction: float = 0.0, **how: Any) -> Any:
    named = {name: np.array(w) for name, w in loads.items()}
    f = Fields({"fewest_contacts": fewest} | how.pop("more", {}), "balance")
    return replay_of_loads(how.pop("contacts", 2), 0.1, named, friction, f, **how)


def test_that_loads_alone_take_more_contacts_than_there_are() -> None:
    """Of both signs in two directions they take three without friction, two with any."""
    flat = {
        "a": [1.0, 0, 0, 0, 0, 0],
        "b": [-1.0, 0, 0, 0, 0, 0],
        "c": [0, 2.0, 0, 0, 0, 0],
        "d": [0, -2.0, 0, 0, 0, 0],
    }
    done = of_loads(3, flat)
    assert (done.name, done.ok, done.figures) == ("balance", True, {"contacts": 3})
    assert done.claim == (
        "2 contacts cannot hold a, b, c, d with a friction of 0: "
        "loads of both signs need more contacts than the directions that these span"
    )
    assert of_loads(2, flat, contacts=1).ok
    for few, contacts, friction in ((4, 2, 0.0), (3, 3, 0.0), (2, 2, 0.0), (3, 2, 0.5)):
        refused = of_loads(few, flat, friction, contacts=contacts)
        assert not refused.ok
        assert refused.reason == f"shown is only that it takes {2 if friction else 3}"
    assert of_loads(2, flat, 0.5, contacts=1).ok
    assert not of_loads(3, flat, torsion=0.01).ok
    one = of_loads(2, {"a": [1.0, 0, 0, 0, 0, 0]}, contacts=1)
    assert (one.claim, one.ok) == ("1 contacts cannot hold a with a friction of 0", False)
    assert one.reason == "shown is only that it takes 1"
    for more, line in (({"fewest_contacts": 0}, "^balance.fewest_contacts: is 0"), ({"x": 1}, "^balance.x: is not a")):
        with pytest.raises(BadFile, match=line):
            of_loads(1, flat, more=more)


def test_torques_count_by_the_farthest_place_of_a_contact() -> None:
    """Within 0.1 m one of 1e-4 N m takes a thousandth of 1 N; here each is there twice, and sqrt 2 as much as one."""
    for size, few in ((0.72e-4, 3), (0.69e-4, 2)):
        both = {"a": [1.0, 0, 0, 0, 0, 0], "b": [-1.0, 0, 0, 0, 0, 0]}
        turns = {"c": [1.0, 0, 0, 0, 0, size], "d": [-1.0, 0, 0, 0, 0, -size]}
        turned = {"e": [1.0, 0, 0, 0, size, 0], "f": [-1.0, 0, 0, 0, -size, 0]}
        assert of_loads(few, both | turns | turned, contacts=1).ok
        assert not of_loads(few + 1, both | turns | turned, contacts=1).ok


def test_a_torque_beside_a_thousand_times_a_larger_one_is_no_direction() -> None:
    for size, few in ((1.5e-3, 3), (0.5e-3, 2)):
        turns = {
            name: [0, 0, 0, x, 0, z] for name, x, z in (("a", 0, 1), ("b", 0, -1), ("c", size, 0), ("d", -size, 0))
        }
        assert of_loads(few, turns, contacts=1).ok
        assert not of_loads(few + 1, turns, contacts=1).ok


def test_forces_and_torques_are_directions_of_their_own() -> None:
    """A force along z and a torque about x take two contacts each, not three together."""
    both: dict[str, list[float]] = {
        "a": [0, 0, 1, 0, 0, 0],
        "b": [0, 0, -1, 0, 0, 0],
        "c": [0, 0, 0, 0.1, 0, 0],
        "d": [0, 0, 0, -0.1, 0, 0],
    }
    assert of_loads(2, both, contacts=1).ok
    assert not of_loads(3, both).ok


def test_why_is_said_with_what_is_shown() -> None:
    one = loaded([[0, 0, 1, 0, 0, 0]], 0.5, force_limit=0.4, torsion=0.01)
    data = to_json(one, ["w"], "thing", one.fewest())
    assert (data["contacts"], data["reason"], data["torsion"], data["force_limit"]) == (3, "force", 0.01, 0.4)
    why = "the normal forces that are allowed do not add up to the loads"
    assert replay(data).claim.endswith(f"1 or 2 contacts on its surface cannot hold: {why}")
    plain = to_json(loaded([[0, 0, 1, 0, 0, 0]]), ["w"], "thing", Fewest(1))
    assert "torsion" not in plain
    assert [set(solid) for solid in plain["solids"]] == [{"kind", "size", "pose"}]
    claim = "with a friction of 0, of w: 1 contact on its surface cannot hold"
    assert replay(plain | {"contacts": 2}).claim == claim
    nothing = "any number of contacts on its surface may hold"
    assert replay(plain | {"contacts": 2}).reason == f"shown is only that {nothing}"
    assert replay(plain | {"contacts": 1}).claim == f"with a friction of 0, of w: {nothing}"
    with pytest.raises(BadFile, match=r"^filter\.reason: is missing$"):
        replay({key: x for key, x in plain.items() if key != "reason"}, "filter")
    assert plain["force_limit"] is None


def convex(vertices: Any, faces: Any) -> ConvexSolid:
    mesh = {"kind": "mesh", "vertices": np.asarray(vertices).tolist(), "faces": faces}
    return ConvexSolid.read(Fields(mesh, ""))


BOX_FACES = [
    *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
    *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
]


def test_many_loads_are_looked_at_some_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """As all at once: up and down in turns, and of 60 N in all each contact gives the half of 1 N to one of them."""
    some = np.tile([[0, 0, 1.0, 0, 0, 0], [0, 0, -2.0, 0, 0, 0]], (20, 1))
    whole = loaded(some, force_limit=1.0)._force()
    monkeypatch.setattr(few_contacts, "LOAD_BATCH", 500)
    one = loaded(some, force_limit=1.0)
    assert one._both(0.5).all()
    assert one._force() == whole == Fewest(3, "force")
    monkeypatch.setattr(few_contacts, "MAX_LOADS", 40)
    assert replay(said(one)).ok
    with pytest.raises(BadFile, match=r"^loads: has 41 loads; at most 40 are possible$"):
        replay(said(loaded([*some.tolist(), [0.0] * 6], force_limit=1.0)))


# --- what turns without friction --------------------------------------------------------------------------


@pytest.mark.parametrize("a", [1.0, 1e-150, 1e-170, 1e-300])
def test_places_that_are_not_on_a_line_are_on_none_however_near(a: float) -> None:
    """Balls at the origin, at a along x and at a along y; those along x alone turn about x."""
    place = np.eye(4)

    def ball(x: float, y: float) -> ConvexSolid:
        pose = place.copy()
        pose[:2, 3] = x, y
        return ConvexSolid.read(Fields({"kind": "sphere", "size": [1.0], "pose": pose.tolist()}, ""))

    turn = np.array([[0, 0, 0, 1.0, 0, 0]])
    for y, turns in ((a, False), (0.0, True)):
        found = Held((ball(0, 0), ball(a, 0), ball(2 * a, y)), np.zeros(3), turn, 0.0)._turning()
        assert found == (Fewest(None, "turning") if turns else Fewest(1))
    # differences of places are not rounded: 1e-20 is lost beside 1
    found = Held((ball(1, 1e-20), ball(2, 1e-20), ball(3, 0)), np.zeros(3), turn, 0.0)._turning()
    assert found == Fewest(1)
    assert Held((ball(0, 0),), np.zeros(3), 1e-101 * turn, 0.0)._turning() == Fewest(1)  # below all that is bounded


def pieces(*said: tuple[str, list[float]]) -> tuple[ConvexSolid, ...]:
    return tuple(ConvexSolid.read(Fields({"kind": kind, "size": size}, "")) for kind, size in said)


@pytest.mark.parametrize(
    ("kind", "size", "turns"),
    [
        ("ellipsoid", [0.03, 0.03, 0.03], True),
        ("ellipsoid", [0.03, 0.03, 0.04], False),
        ("sphere", [0.03], True),
        ("capsule", [0.03, 0.03], False),
        ("cylinder", [0.03, 0.03], False),
    ],
)
def test_a_ball_turns_about_any_axis(kind: str, size: list[float], turns: bool) -> None:
    across = Held(pieces((kind, size)), np.zeros(3), np.array([[0, 0, 0, 0, 0.1, 0]]), 0.0)
    assert across._turning() == (Fewest(None, "turning") if turns else Fewest(1))


def test_a_ball_turns_about_its_own_middle_with_any_of_the_loads() -> None:
    place = np.eye(4)
    place[0, 3] = 0.1
    ball = ConvexSolid.read(Fields({"kind": "sphere", "size": [0.03], "pose": place.tolist()}, ""))
    up, turn = [0, 0, 1, 0, -0.1, 0], [0, 0, 0, 0, 0, 0.1]  # up through its middle
    for loads, turns in (([turn], True), ([[0] * 6, turn], True), ([up, turn], True), ([up], False)):
        found = Held((ball,), np.zeros(3), np.array(loads, dtype=float), 0.0)._turning()
        assert found == (Fewest(None, "turning") if turns else Fewest(1))


@pytest.mark.parametrize(
    ("loads", "least"),
    [
        ([[1, 0, 0, 0, 0, 1]], 0.13),
        ([[1, 0, 0, 0, 0, 1], [100, 0, 0, 0, 0, 0]], 0.13),
        ([[1, 0, 0, 5, 0, 1]], 5.13),
        ([[1, 0, 0, 0, 0, 1], [0, 0, 0, 100, 0, 0]], 0.13),
    ],
)
def test_a_torque_about_the_axis_is_one_beside_its_load(loads: list[list[float]], least: float) -> None:
    """A millionth of its size, 1 N being 0.13 N m at the end of the can, which is farther than that of the ball."""
    solids = pieces(("cylinder", [0.03, 0.1]), ("sphere", [0.02]))
    for share, turns in ((1.02, True), (0.98, False)):
        some = np.array(loads, dtype=float)
        some[0, 5] = share * 1e-6 * least
        found = Held(solids, np.zeros(3), some, 0.0)._turning()
        assert found == (Fewest(None, "turning") if turns else Fewest(1))


@pytest.mark.parametrize("size", [1e-10, 1.0, 1e10])
def test_loads_have_the_other_sign_if_they_have_the_other_direction(size: float) -> None:
    loads = size * np.array(
        [[1.0, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [-3, 0, 0, 0, 0, 0], [0, -1, 1e-6, 0, 0, 0], [0] * 6]
    )
    assert loaded(loads)._both(0.5).tolist() == [True, False, True, False, False]
    assert loaded(loads).opposed() == Fewest(2, "opposed")


@pytest.mark.parametrize("size", [1e-7, 0.1, 1e6])
def test_torques_have_the_other_sign_beside_what_contacts_can_reach(size: float) -> None:
    """Half edges of `size`. Contacts at (size, e, 0) and (-size, 0, e) push with 1 N along x, each under one load.

    Their torques, (0, 0, -e) and (0, -e, 0), are opposite to sqrt 2 e of `size` sqrt 3; below 1e-9 they are opposite
    forces with no torque, which take two contacts.
    """
    corners = [[x, y, z] for x in (-size, size) for y in (-size, size) for z in (-size, size)]
    for e, both in ((5e-3 * size, False), (1.3e-9 * size, False), (1.2e-9 * size, True)):
        loads = np.array([[1, 0, 0, 0, 0, -e], [-1, 0, 0, 0, -e, 0]])
        body = Held((convex(corners, BOX_FACES),), np.zeros(3), loads, 0.0)
        assert body._both(body._reach).tolist() == [both] * 2
        assert body.opposed() == Fewest(2 if both else 1, "opposed" if both else "")
    far = np.array([[1.0, 0, 0, 0, 0, -1e-12], [-1, 0, 0, 0, -1e-12, 0]])
    assert Held((), np.zeros(3), far, 0.0).opposed(1e-12) == Fewest(1)
    assert Held((), np.zeros(3), far, 0.0).opposed(0.0) == Fewest(1)  # nothing is said at the origin alone


def test_torques_about_the_centre_of_mass_are_rounded_once() -> None:
    """1 N along z at (1e8 + 1/8, 0, 0), and -1 N 1 m beside it: 1e8 + 1/8 N m cancel to 1/8 and -7/8."""
    loads = np.array([[0, 0, 1, 0, -1e8 - 0.125, 0], [0, 0, -1, 0, 1e8 + 1.125 - 2, 0], [0, 0.1, 0, 0, 0, 1e7]])
    about = loaded(loads)._torques(np.array([1e8, 0, 0]))
    assert about[:2].tolist() == [[0, -0.125, 0], [0, -0.875, 0]]
    assert about[2, 2] == float(Fraction(10**7) - 10**8 * Fraction(0.1))  # -5.55e-10: in floats 0


@pytest.mark.parametrize(("friction", "few"), [(1e10, 1), (1.1e8, 1), (0.9e8, 2), (1e3, 2)])
def test_forces_in_a_wide_cone_may_all_but_cancel(friction: float, few: int) -> None:
    """Loads (1, 0, -1e-10) and (-1, 0, -1e-10): one contact that pushes along z balances both if 1 <= 1e-10 mu."""
    loads = [[1, 0, -1e-10, 0, 0, 0], [-1, 0, -1e-10, 0, 0, 0]]
    assert loaded(loads, friction).opposed().contacts == few
    # and torsion of 4.5 m, 9 times the 0.5 m of the ball, makes a load 10 times as large as what is behind it
    assert loaded(loads, friction / 10, torsion=4.5).opposed().contacts == few


@pytest.mark.parametrize(("up", "weighed"), [(0.11, True), (0.09, False), (0.0, False)])
def test_weights_are_from_every_side_that_are_not_nearly_in_a_plane(up: float, weighed: bool) -> None:
    """Along x, y and (sqrt(1 - up^2), 0, up): the least singular value of all six is up."""
    ways = np.array([[1.0, 0, 0], [0, 1, 0], [np.sqrt(1 - up**2), 0, up]])
    for sizes in (1.0, np.array([[1.0], [50.0], [0.01]])):
        every = np.vstack([sizes * ways, -sizes * ways])
        assert loaded(np.hstack([every, 0 * every]))._weighed() == weighed


def test_weights_beside_the_centre_of_mass_are_far_off_as_seen_from_a_contact_near_it() -> None:
    """A tetrahedron with its tip at the origin and its base 1 m below, and another one 1e4 m away.

    Weights act at (0, 0, -0.1): the tip and (0, 0, -1) hold them without friction. The centre of mass is said 9e-6 m
    beside that, 0.9e-9 of the reach; from there the tip is 9e-5 rad from the line, where friction gives 3.6e-5.
    """
    side = np.sqrt(0.75)
    corners = [[0.0, 0, 0], [1, 0, -1], [-0.5, side, -1], [-0.5, -side, -1]]
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    ways = np.vstack([np.eye(3), -np.eye(3)])
    loads = np.hstack([ways, np.cross([0, 0, -0.1], ways)])
    aside = np.array([[0.1, 0.6, 0.7], [0.9, 0.2, -0.6], [-0.8, 0.9, -0.5], [-0.3, -0.6, -0.55]])
    near, other = convex(corners, faces), convex(aside + np.array([1e4, 0, 0]), faces)
    for center in (np.array([0, 0, -0.1]), np.array([9e-6, 0, -0.1])):
        one = Held((near, other), center, loads, 3.6e-5)
        assert one._weighed()
        assert one.fewest() == Fewest(2, "opposed")


@pytest.mark.parametrize("friction", [0.75, 0.0])
def test_what_weights_miss_turns_a_force_the_more_the_nearer_it_is(friction: float) -> None:
    """Six weights along axes, the least singular value sqrt 2: 5e-9 of 0.5 m times sqrt(6 / 2) and sqrt(1 + mu^2).

    Seen from 1 m and from 0.01 m, within 0.5 and 0.005 m.
    """
    ways = np.vstack([np.eye(3), -np.eye(3)])
    one = loaded(np.hstack([ways, 0 * ways]), friction)
    aside = 2.5e-9 * np.sqrt(3) * np.hypot(1, friction)
    assert one._aside == pytest.approx(aside, rel=1e-5)  # and 1e-14 of the largest coordinate
    for far in (1.0, 0.01):
        (_,), (within,), _, (pushed,), _ = one._seen(part([0, 0, far], UP, far / 2))
        assert within - np.pi / 6 == pytest.approx(MARGIN + aside / (far / 2), abs=1e-11)
        assert pushed - np.arctan(friction) - 1e-7 == pytest.approx(MARGIN + aside / (far / 2), abs=1e-11)
    (_,), (within,), _, (pushed,), _ = one._seen(part([0, 0, 2e-9], UP, 0.0))
    assert within == pytest.approx(np.pi + MARGIN)
    assert pushed == np.pi
    assert loaded(np.vstack([one.loads] * 4), friction)._aside == pytest.approx(aside, rel=1e-5)


def test_with_all_but_endless_friction_no_line_is_excluded(monkeypatch: pytest.MonkeyPatch) -> None:
    one = held(stone(1, 5), 0.02, stone(1, 5).centroid + 0.004)
    for most, shown in ((0.02, True), (0.0199, False)):
        monkeypatch.setattr(few_contacts, "MAX_LINE_FRICTION", most)
        assert one._no_line() == shown


@pytest.mark.parametrize(("off", "weighed"), [(0.0, True), (0.4e-9, True), (0.6e-9, False), (1.1e-9, False)])
def test_weights_act_at_the_centre_of_mass(off: float, weighed: bool) -> None:
    """But for a part in 1e9 of what they are at 0.5 m, each of its own."""
    every = np.vstack([np.eye(3), -np.eye(3)])
    assert loaded(np.hstack([every, off * np.roll(every, 1, axis=1)]))._weighed() == weighed


# --- limits of forces -----------------------------------------------------------------------------------


def loaded(loads: Any, friction: float = 0.0, **how: Any) -> Held:
    ball = ConvexSolid.read(Fields({"kind": "sphere", "size": [0.5]}, ""))
    return Held((ball,), np.zeros(3), np.array(loads, dtype=float), friction, **how)


@pytest.mark.parametrize(
    ("limit", "few"), [(2.0, 1), (1.001, 1), (1.0, 1), (0.999, 2), (0.5, 2), (0.499, 3), (0.0, 10**9)]
)
def test_forces_up_to_a_limit_add_up_to_a_load(limit: float, few: int) -> None:
    """1 N; just as much as contacts may give is let pass."""
    found = loaded([[0, 0, 1, 0, 0, 0]], force_limit=limit).fewest()
    assert found == (Fewest(few, "force") if few > 1 else Fewest(1))
    assert loaded([[0, 0, 1, 0, 0, 0]], force_limit=limit)._force() == found


def test_the_largest_force_counts_of_several() -> None:
    """2 N along one way take three contacts of 0.9 N; 3 N in all, of which one contact gives twice 0.9, take two."""
    assert loaded([[0, 0, 1, 0, 0, 0], [0, 0, 2, 0, 0, 0]], force_limit=0.9)._force() == Fewest(3, "force")


@pytest.mark.parametrize(("friction", "torsion", "arm"), [(0.0, 0.0, 0.5), (0.75, 0.0, 0.625), (0.75, 0.25, 0.875)])
def test_a_torque_is_a_force_at_the_farthest_point_or_torsion(friction: float, torsion: float, arm: float) -> None:
    """3.5 N m: that over the arm of a contact of 1 N, and never more than that."""
    at = loaded([[0, 0, 0, 0, 0, 3.5], [0, 0, 0, -3.5, 0, 0]], friction, force_limit=1.0, torsion=torsion)
    most = 3.5 / arm
    assert at._force() == Fewest(int(np.ceil(most)) if most % 1 > 1e-9 else round(most), "force")


CORNER = np.ones(3) / np.sqrt(3)


@pytest.mark.parametrize("along", [*np.eye(3), *-np.eye(3), [0, -0.8, 0.6], CORNER])
@pytest.mark.parametrize(("friction", "size"), [(0.0, 0.3), (0.75, 3.0)])
def test_what_a_contact_gives_to_one_load_is_no_less_than_it_can(along: Any, friction: float, size: float) -> None:
    """sqrt(1 + mu^2) of a newton of its normal force, but for the steps between the directions that are tried."""
    loads = np.array([[*size * np.array(along), 0, 0, 0], [0.0] * 6])
    force = loads[:, :3]
    gives = size / loaded(loads, friction)._in_all_directions(force, np.linalg.norm(force, axis=1))
    between = 1.01 * np.sqrt(2) / 199 * np.hypot(1, friction)
    assert np.hypot(1, friction) <= gives <= np.hypot(1, friction) + between + 1e-12
    assert loaded(loads, friction)._in_all_directions(0 * force, np.zeros(2)) == 0


def test_directions_are_tried_in_steps_over_the_faces_of_a_cube() -> None:
    """200 by 200: the corners, and 1 / 199 to either side of the axes; between them 1.01 of half a cell."""
    between = 1.01 * np.sqrt(2) / 199
    for along, nearest in ((CORNER, 1.0), (UP, 1 / np.sqrt(1 + 2 / 199**2)), (-UP, 1 / np.sqrt(1 + 2 / 199**2))):
        gives = 1 / loaded([[0.0] * 6])._in_all_directions(along[None], np.ones(1))
        assert gives == pytest.approx(nearest + between, rel=1e-12)
    gives = 1 / loaded([[0.0] * 6], 0.75)._in_all_directions(UP[None], np.ones(1))
    assert gives == pytest.approx(1.25 * (1 + between), rel=3e-5)


def test_what_a_contact_gives_to_loads_of_both_signs_is_to_one_of_them() -> None:
    """1 N along x and 4 N the other way: 5 N over the 1 N of one contact; a push along y gives each its friction."""
    both = np.array([[1.0, 0, 0], [-4.0, 0, 0]])
    for friction, due in ((0.0, 5.0), (2.0, 5 / 4)):
        found = loaded([[0.0] * 6], friction)._in_all_directions(both, np.array([1.0, 4.0]))
        assert due * 0.97 < found <= due


# --- lines through the centre of mass -------------------------------------------------------------------


def part(points: Any, normal: Any = UP, solid: float = 0.0) -> SurfaceParts:
    at, along = (np.broadcast_to(np.asarray(a, dtype=float), (1, 3, 3)) for a in (points, normal))
    return SurfaceParts.of(at, along, slack=solid)


MARGIN = 1e-6


@pytest.mark.parametrize("friction", [0.25, 2.0])
def test_a_force_pushes_back_to_the_centre_or_away_from_it(friction: float) -> None:
    """From 1 m above the centre, within 0.5 m: an angle of pi / 6 about the way there, and the cone of friction."""
    one = replace(loaded([[0.0] * 6], friction), center=np.array([0.1, 0, 0]))
    above, below = part([0.1, 0, 1], UP, 0.5), part([0.1, 0, -2], UP, 0.5)
    for some, way, angles in ((above, UP, [np.pi, 0]), (below, -UP, [0, np.pi])):
        (found,), (within,), (push,), (pushed,), (miss,) = one._seen(some)
        assert found == pytest.approx(way)
        assert within == pytest.approx(np.arcsin(0.5 if some is above else 0.25) + MARGIN, abs=1e-10)
        assert pushed == pytest.approx(np.arctan(friction) + 1e-7 + MARGIN, abs=1e-10)
        assert push == pytest.approx(-UP)
        assert miss == pytest.approx(np.array(angles) - within - pushed)
        assert one._against(some).tolist() == [True]
        axis, half, owner = one._lines(some)
        assert axis == pytest.approx(-UP[None])
        assert (half.tolist(), owner.tolist()) == ([min(within, pushed)], [0])
    (_,), (within,), _, _, _ = one._seen(part([0.1, 0, 0.4], UP, 0.5))  # it may be at the centre
    assert within == pytest.approx(np.pi + MARGIN)
    _, _, owner = one._lines(SurfaceParts.joined([part([5, 0, 0.1], UP, 0.01), above, below]))
    assert owner.tolist() == [2, 1] if friction < 1 else [1, 2]


def test_a_force_across_the_way_to_the_centre_is_on_no_line_with_it() -> None:
    """1 m aside, within 0.5 m: friction has to turn it by pi / 3."""
    for friction, can in ((np.tan(np.pi / 3) - 1e-5, False), (np.tan(np.pi / 3), True)):
        one = loaded([[0.0] * 6], friction)
        for x in (-1, 1):
            side = part([x, 0, 0], UP, 0.5)
            assert one._against(side).tolist() == [can]
            axis, half, owner = one._lines(side)
            assert len(axis) == len(half) == len(owner) == 2 * can
    assert angle(axis, np.array([UP * 0 + [1, 0, 0], [-1, 0, 0]])).tolist() == [0, 0]


def test_the_narrower_of_two_cones_is_where_forces_point() -> None:
    """0.25 m around a place 1 m above, seen aslant; with little friction forces stay by the normal, else by the way."""
    lean = np.array([np.sin(0.3), 0, np.cos(0.3)])
    for friction, by_way in ((0.1, False), (2.0, True)):
        axis, half, _ = loaded([[0.0] * 6], friction)._lines(part([0, 0, 1], lean, 0.25))
        assert axis[0] == pytest.approx(-UP if by_way else -lean)
        due = np.arcsin(0.25) if by_way else np.arctan(0.1) + 1e-7
        assert half[0] == pytest.approx(due + MARGIN, abs=1e-10)


def test_cones_meet_that_are_opposite_but_for_their_angles() -> None:
    """Along z, against it but for 0.3, and along x."""
    aslant = np.array([np.sin(0.3), 0, -np.cos(0.3)])
    axis, owner = np.array([UP, aslant, [1.0, 0, 0], UP]), np.array([3, 0, 1, 2])
    for halves, meets in (
        ([0.16, 0.15, 0.1, 0.1], [True, False, False, True]),
        ([0.14, 0.15, 0.1, 0.1], [False] * 4),
        ([0.1, 0.15, 0.1, 0.16], [True, False, True, False]),
        ([0.1, 0.1, np.pi / 2, 0.1], [True] * 4),
    ):
        assert _meets(axis, np.array(halves), owner).tolist() == meets
    assert _meets(axis[2:3], np.array([1.5]), np.array([1])).tolist() == [False, False]


def test_of_many_cones_each_is_compared_with_all() -> None:
    axis = np.tile(UP, (600, 1))
    axis[300] *= -1
    assert _meets(axis, np.full(600, 0.1), np.arange(600)).all()
    axis[300] = 1, 0, 0
    assert not _meets(axis, np.full(600, 0.1), np.arange(600)).any()


def test_of_very_many_parts_nothing_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two ellipsoids have 8192 parts each; no more are made once there are too many."""
    made, parts = [], ConvexSolid.parts
    monkeypatch.setattr(ConvexSolid, "parts", lambda self: made.append(self) or parts(self))
    none = np.zeros((0, 3))
    solids = [ConvexSolid("ellipsoid", (0.3, 0.31, 0.32), shifted(x), none, none.astype(int)) for x in (0.0, 1.0, 2.0)]
    apart = Held(tuple(solids), np.zeros(3), np.zeros((1, 6)), 0.5)
    for most, count in ((8191, 1), (16383, 2), (3 * 8192, 3)):
        monkeypatch.setattr(few_contacts, "FIRST_PARTS", most)
        made.clear()
        apart._no_line()
        assert len(made) == count


def shifted(x: float) -> Array:
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


def test_a_claim_has_the_reason_that_is_shown() -> None:
    one = held(Shape("cylinder", [0.03, 0.1]), 0.0, np.zeros(3))
    assert replay(said(one) | {"reason": ""}).ok
    assert not replay(said(one) | {"reason": "line"}).ok
    with pytest.raises(BadFile, match="'magic'"):
        replay(said(one) | {"reason": "magic"})
