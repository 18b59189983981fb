"""Few contacts cannot hold an object: cases by hand, parts of its surface, wrong claims, nothing possible lost."""

from __future__ import annotations

from dataclasses import replace
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
from handfast.proofs.few_contacts import Fewest, Held, replay, to_json, words
from handfast.proofs.fields import BadFile
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
        ({"solids": []}, "^solids: is empty"),
        ({"loads": {}}, "^loads: is empty"),
    ],
)
def test_faults_of_a_file_are_named(changed: dict[str, Any], fault: str) -> None:
    with pytest.raises(BadFile, match=fault):
        replay(said(held(BALL, 0.0, np.zeros(3)), **changed))
