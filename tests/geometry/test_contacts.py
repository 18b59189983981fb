"""Contacts with answers worked out by hand, and hidden faces."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handfast.core.errors import InputError
from handfast.core.transforms import quaternion_matrix, transform
from handfast.geometry.contact_patch import few, outline, overlap
from handfast.geometry.contacts import _merged, contact_grasp, deepest, find_contacts
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.grasp import Contact
from handfast.model.hand import Hand, Link
from handfast.model.shape import Shape
from handfast.proofs.constants import SIZE_COUNTS
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from tests.support.contact_cases import (
    NO_MOTION,
    contacts_of,
    jointless,
    random_pose,
)
from tests.support.places import SHARED


def test_box_between_two_planes() -> None:
    left = Shape("box", (0.2, 0.02, 0.2), transform([0, 0.03, 0]), name="left")
    right = Shape("box", (0.2, 0.02, 0.2), transform([0, -0.03, 0]), name="right")
    found = contacts_of(jointless(left, right), Shape("box", (0.06, 0.04, 0.10)))
    assert [c.link for c in found] == ["left"] * 4 + ["right"] * 4
    corners = np.array([[x, z] for x in (-0.03, 0.03) for z in (-0.05, 0.05)])
    for side, half in ((1, found[:4]), (-1, found[4:])):
        np.testing.assert_allclose([c.position for c in half], np.insert(corners, 1, 0.02 * side, axis=1), atol=1e-9)
        np.testing.assert_allclose([c.normal for c in half], [[0, -side, 0]] * 4, atol=1e-9)
        np.testing.assert_allclose([c.depth for c in half], 0, atol=1e-9)


@pytest.mark.parametrize("gap", [3e-4, 1e-5, 1e-8, 0.0, -1e-8, -1e-5, -1e-4])
def test_gap_and_depth_have_the_right_sign(gap: float) -> None:
    wall = Shape("box", (0.1, 0.1, 0.02), transform([0, 0, -0.01]), name="wall")
    (c,) = contacts_of(jointless(wall), Shape("sphere", 0.03), at=[0.01, 0, 0.03 + gap])
    assert c.depth == pytest.approx(-gap, abs=1e-10)
    np.testing.assert_allclose(c.position, [0, 0, -0.03 - gap / 2], atol=1e-9)  # midway between the surfaces
    np.testing.assert_allclose(c.normal, [0, 0, 1], atol=1e-6)


def test_sphere_in_a_v() -> None:
    half = np.radians(40)  # each wall leans this much from the vertical plane
    walls = []
    for side in (1, -1):
        n = np.array([-side * np.cos(half), 0, np.sin(half)])  # out of the wall, towards the sphere
        R = np.column_stack([np.cross([0, 1, 0], n), [0, 1, 0], n])
        walls.append(Shape("box", (0.4, 0.1, 0.02), transform(-0.01 * n, R), name=f"wall{side}"))
    r = 0.05
    found = contacts_of(jointless(*walls), Shape("sphere", r), at=[0, 0, r / np.sin(half)])
    assert [c.link for c in found] == ["wall1", "wall-1"]
    for side, c in zip((1, -1), found, strict=True):
        np.testing.assert_allclose(c.normal, [-side * np.cos(half), 0, np.sin(half)], atol=1e-6)
        np.testing.assert_allclose(c.position, -r * c.normal, atol=1e-7)


def test_capsule_on_a_wall_touches_at_its_two_ends() -> None:
    lying = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    finger = Shape("capsule", (0.01, 0.06), transform([0, 0, 0.01], lying), name="finger")
    found = contacts_of(jointless(finger), Shape("box", (0.2, 0.2, 0.02)), at=[0, 0, -0.01])
    np.testing.assert_allclose([c.position for c in found], [[-0.03, 0, 0.01], [0.03, 0, 0.01]], atol=1e-9)
    np.testing.assert_allclose([c.normal for c in found], [[0, 0, -1]] * 2, atol=1e-9)
    short = contacts_of(jointless(finger), Shape("box", (0.04, 0.2, 0.02)), at=[0, 0, -0.01])
    np.testing.assert_allclose([c.position[0] for c in short], [-0.02, 0.02], atol=1e-9)  # the wall ends first
    tilted = Shape("capsule", (0.01, 0.06), transform([0, 0, 0.01], lying @ quaternion_matrix([1, 0, 0.05, 0])))
    assert len(contacts_of(jointless(tilted), Shape("box", (0.2, 0.2, 0.02)), at=[0, 0, -0.01 - 0.00299])) == 1


def test_edge_across_an_edge_is_one_point() -> None:
    roof = Shape(
        "box",
        (0.04, 0.2, 0.04),
        transform([0, 0, 0], quaternion_matrix([np.cos(np.pi / 8), 0, np.sin(np.pi / 8), 0])),
    )
    other = transform([0, 0, np.sqrt(2) * 0.04 + 1e-5], quaternion_matrix([np.cos(np.pi / 8), np.sin(np.pi / 8), 0, 0]))
    found = find_contacts(jointless(roof), np.zeros(0), Body.of([Shape("box", (0.2, 0.04, 0.04))]), other)
    (c,) = found
    np.testing.assert_allclose(other[:3, :3] @ c.normal, [0, 0, 1], atol=1e-7)
    np.testing.assert_allclose((other @ [*c.position, 1])[:3], [0, 0, np.sqrt(2) * 0.02 + 5e-6], atol=1e-8)


def test_a_seam_between_pieces_gives_no_sideways_normal() -> None:
    """A fingertip pressed 0.1 mm into the seam of two pieces must feel the flat face only."""
    two = (
        Shape("box", (0.1, 0.1, 0.1), transform([-0.05, 0, 0])),
        Shape("box", (0.1, 0.1, 0.1), transform([0.05, 0, 0])),
    )
    for x in np.linspace(-2e-4, 2e-4, 9):
        tip = Shape("box", (0.01, 0.01, 0.01), transform([x - 0.005, 0, 0.0549]), name="tip")
        found = contacts_of(jointless(tip), *two)
        assert found
        for c in found:
            np.testing.assert_allclose(c.normal, [0, 0, -1], atol=1e-6)
    ball = Shape("sphere", 0.01, transform([0, 0, 0.0599]), name="tip")
    (c,) = contacts_of(jointless(ball), *two)
    np.testing.assert_allclose(c.normal, [0, 0, -1], atol=1e-2)


def test_a_box_in_a_concave_corner_keeps_both_faces() -> None:
    floor = Shape("box", (0.2, 0.1, 0.02), transform([0.09, 0, -0.01]))
    wall = Shape("box", (0.02, 0.1, 0.2), transform([-0.01, 0, 0.1]))
    block = Shape("box", (0.03, 0.04, 0.05), transform([0.015, 0, 0.025]), name="block")
    found = contacts_of(jointless(block), floor, wall)
    normals = sorted(tuple(c.normal.round(6) + 0.0) for c in found)
    assert normals == [(-1, 0, 0)] * 4 + [(0, 0, -1)] * 4


def test_the_same_patch_from_overlapping_pieces_counts_once() -> None:
    pieces = (Shape("box", (0.1, 0.1, 0.1)), Shape("box", (0.1, 0.1, 0.08), transform([0, 0, 0.01])))
    ball = Shape("sphere", 0.01, transform([0.02, 0, 0.06]), name="tip")
    assert len(contacts_of(jointless(ball), *pieces)) == 1
    plate = Shape("box", (0.03, 0.03, 0.01), transform([0, 0, 0.055]), name="plate")
    assert len(contacts_of(jointless(plate), *pieces)) == 4


@given(seed=st.integers(0, 2**31))
@settings(max_examples=25, deadline=None)
def test_contacts_do_not_depend_on_where_the_pair_stands(seed: int) -> None:
    """Move hand and object together: the contacts in the object frame stay the same."""
    wall = Shape("box", (0.08, 0.06, 0.02), transform([0.01, 0.0, -0.01]), name="wall")
    ball = Shape("sphere", 0.01, transform([0.0, 0.0, 0.06]), name="ball")
    body = Body.of([Shape("box", (0.04, 0.1, 0.05), transform([0, 0, 0.025]))])
    here = find_contacts(jointless(wall, ball), np.zeros(0), body, np.eye(4))
    T = random_pose(seed)
    there = find_contacts(jointless(wall.placed(T), ball.placed(T)), np.zeros(0), body, T)
    assert len(here) == len(there) == 5
    for link in ("wall", "ball"):
        a, b = ([c for c in found if c.link == link] for found in (here, there))
        far = np.linalg.norm([[c.position - d.position for d in b] for c in a], axis=2)
        assert far.min(axis=1).max() < 1e-6
        np.testing.assert_allclose([c.normal for c in b], [a[0].normal] * len(b), atol=1e-5)


def test_refusals() -> None:
    hand = jointless(Shape("sphere", 0.01, name="tip"))
    body = Body.of([Shape("sphere", 0.01)])
    with pytest.raises(InputError, match=r"no link is within 0.5 mm of the object; nearest: tip at 80 mm"):
        contact_grasp(hand, np.zeros(0), body, transform([0.1, 0, 0]))
    with pytest.raises(InputError, match=r"object_pose: is not a rigid motion"):
        find_contacts(hand, np.zeros(0), body, 2 * np.eye(4))
    with pytest.raises(InputError, match=r"q: needs 0 finite joint values"):
        find_contacts(hand, np.zeros(2), body, np.eye(4))
    with pytest.raises(InputError, match=r"threshold: is 0; a distance above 0"):
        find_contacts(hand, np.zeros(0), body, np.eye(4), threshold=0)
    with pytest.raises(InputError, match=r"mechanism: is 'motor'; 'hand' or 'direct'"):
        contact_grasp(hand, np.zeros(0), body, np.eye(4), mechanism="motor")  # type: ignore[arg-type]


def test_the_bundled_fingertip_meets_a_wall_in_one_point() -> None:
    """The sphere stands proud of the pad: a wall along the pad touches it alone, in its middle."""
    hand = load_hand("barrett-bh8-280")
    q = hand.configuration({"finger_3_prox": 0.3})
    T = hand.link_poses(q)[hand.link("finger_3_dist")]
    bend = np.radians(42)
    along = T[:3, :3] @ [np.cos(bend), 0, np.sin(bend)]
    inward = T[:3, :3] @ [-np.sin(bend), 0, np.cos(bend)]
    centre = T[:3, 3] + 0.05 * along
    R = np.column_stack([inward, along, np.cross(inward, along)])
    pose = transform(centre + 0.018 * inward, R)
    (c,) = find_contacts(hand, q, Body.of([Shape("box", (0.02, 0.06, 0.1))]), pose)
    np.testing.assert_allclose(c.position, [-0.01, 0, 0], atol=1e-6)
    np.testing.assert_allclose(c.normal, [1, 0, 0], atol=1e-6)


def test_scene_distance_per_link() -> None:
    hand = load_hand("parallel-gripper")
    scene = Scene(hand, Body.of([Shape("sphere", 0.01)]))
    d = scene.distance(hand.configuration({"left_slide": 0.02}), transform([0, 0, 0.095]), cutoff=0.2)
    np.testing.assert_allclose(d, [0.035, 0.01, 0.01], atol=1e-9)
    assert deepest([]) is None


def random_shape(rng: np.random.Generator, kind: str) -> Shape:
    s = rng.uniform(0.003, 0.04, 3)
    pose = transform(rng.normal(size=3) * 0.05, quaternion_matrix(rng.normal(size=4)))
    if kind == "mesh":
        return Shape.hull(rng.normal(size=(int(rng.integers(6, 40)), 3)) * s, pose)
    return Shape(kind, s[: SIZE_COUNTS[kind]], pose)  # type: ignore[arg-type]


def extent(shape: Shape, n: np.ndarray) -> float:
    """How far a shape reaches along n, exactly."""
    local, s = shape.pose[:3, :3].T @ n, shape.size
    if shape.kind == "cylinder":
        return shape.pose[:3, 3] @ n + s[0] * np.hypot(local[0], local[1]) + s[1] / 2 * abs(local[2])
    return float((shape.feature(n, 0.0) @ n).max())


def test_distances_carry_their_own_proof() -> None:
    """Two planes across the normal touch the two solids and are as far apart as the distance says.

    For solids that are apart this proves the distance; mujoco before 3.12 fails it, with distances of 0.
    """
    rng = np.random.default_rng(0)
    apart = 0
    for _ in range(250):
        a, b = (random_shape(rng, kind) for kind in rng.choice(list(SIZE_COUNTS), 2))
        (near,) = Scene(jointless(a), Body.of([b])).nearest(np.zeros(0), np.eye(4), 1.0)
        if near.distance < -0.01:
            continue  # so deep is no contact
        between = -extent(b, -near.normal) - extent(a, near.normal)
        assert near.distance == pytest.approx(between, abs=1e-7)
        assert abs(a.depth(near.on_hand)[0]) < 1e-6 or a.kind == "ellipsoid"
        apart += near.distance > 0
    assert apart > 50


def test_outlines_overlap() -> None:
    square = outline(np.array([[0, 0], [2, 0], [2, 2], [0, 2], [1, 0], [1, 1.0]]))
    assert len(square) == 4
    segment = outline(np.array([[-1, 1], [1, 1], [0, 1.0]]))
    np.testing.assert_allclose(sorted(map(tuple, outline(overlap(square, segment)))), [(0, 1), (1, 1)])
    assert len(overlap(square, square + 3)) == 0
    circle = np.array([[np.cos(t), np.sin(t)] for t in np.linspace(0, 2 * np.pi, 40, endpoint=False)])
    spread = few(outline(circle))
    assert len(spread) == 4
    assert np.linalg.norm(spread, axis=1) == pytest.approx(np.ones(4))


YCB = SHARED / "objects" / "ycb"


@pytest.mark.skipif(not YCB.is_dir(), reason="needs ../shared")
def test_no_contact_lies_on_a_hidden_face_of_the_mustard_bottle() -> None:
    body = load_body(YCB / "mustard_bottle.obj")
    rng = np.random.default_rng(3)
    for _ in range(40):
        towards = rng.normal(size=3) * [1, 1, 0.3]
        towards /= np.linalg.norm(towards)
        start = body.center_of_mass + 0.3 * towards
        tip = Shape("sphere", 0.008, name="tip")
        scene = Scene(jointless(tip), body)
        reach = scene.distance(np.zeros(0), transform(-start), cutoff=1.0).min()
        if reach > 0.25:
            continue
        for _ in range(60):  # advance along the ray by the distance, until it touches
            d = scene.distance(np.zeros(0), transform(-start), cutoff=1.0).min()
            start = start - towards * (d - 1e-5)
            if d < 3e-5:
                break
        found = find_contacts(jointless(tip), np.zeros(0), body, transform(-start))
        for c in found:
            outside = c.position - 1e-3 * c.normal
            assert max(p.depth(outside)[0] for p in body.pieces) < 0


def test_means_of_merged_points_are_merged_too() -> None:
    """Three points 1.6 mm apart in a line: the first two merge, and their mean lies 2.4 mm from the third."""
    up = np.array([0.0, 0, 1])
    row = [Contact(np.array([x, 0, 0]), up, 0.5, "tip", depth) for x, depth in ((0, 1e-5), (1.6e-3, 0), (3.2e-3, 0))]
    assert [c.position[0] for c in _merged(row, 2e-3, 0.17)] == pytest.approx([0.8e-3, 3.2e-3])
    square = [(x, y) for x in (0, 1.7e-3) for y in (0, 1.7e-3)]  # the diagonal is longer than 2 mm, the means are not
    points = [Contact(np.array([x, y, 0]), up, 0.5, "tip", 0.0) for x, y in square]
    (one,) = _merged(points, 2e-3, 0.17)
    np.testing.assert_allclose(one.position, [0.85e-3, 0.85e-3, 0], atol=1e-9)


# --- merging, hiding and what else a small fault would spoil --------------------------------------------


def v_groove(angle: float) -> list[Shape]:
    """Two walls whose normals are `angle` [rad] apart; they meet in a line along y, the free space is above."""
    walls = []
    for side in (1, -1):
        n = np.array([-side * np.sin(angle / 2), 0, np.cos(angle / 2)])
        R = np.column_stack([np.cross([0, 1, 0], n), [0, 1, 0], n])
        walls.append(Shape("box", (0.1, 0.1, 0.02), transform(-0.01 * n, R)))
    return walls


@pytest.mark.parametrize(("degrees", "count"), [(6, 1), (9, 1), (11, 2), (30, 2), (60, 2), (79, 2)])
def test_points_whose_normals_differ_by_more_than_ten_degrees_are_not_merged(degrees: float, count: int) -> None:
    """A ball of 1 mm in a groove: the points are nearer to each other than 2 mm, so the normals alone decide."""
    a, r = np.radians(degrees), 1e-3
    ball = Shape("sphere", r, transform([0, 0, r / np.cos(a / 2)]), name="tip")
    found = contacts_of(jointless(ball), *v_groove(a), friction=0.3)
    assert [c.link for c in found] == ["tip"] * count
    assert {c.friction for c in found} == {0.3}
    sides = (0.0,) if count == 1 else (-1.0, 1.0)
    lean = 0.0 if count == 1 else a / 2  # a mean of both leans neither way
    out = [np.array([-s * np.sin(lean), 0, np.cos(lean)]) for s in sides]
    np.testing.assert_allclose([c.normal for c in found], [-n for n in out], atol=1e-5)
    assert np.linalg.norm([c.position for c in found], axis=1) == pytest.approx(
        np.tan(a / 2) * r if count == 2 else r / np.cos(a / 2) - r * np.cos(a / 2), rel=1e-3
    )


def test_the_deepest_point_leads_a_cluster() -> None:
    """Of three points in a row the middle one goes to the end that is deeper."""
    up = np.array([0.0, 0, 1])
    for deepest_end, expected in ((0, [0.8e-3, 3.2e-3]), (2, [0.0, 2.4e-3])):
        depth = [0.0, 0.0, 0.0]
        depth[deepest_end] = 1e-5
        row = [Contact(np.array([1.6e-3 * k, 0, 0]), up, 0.5, "tip", d) for k, d in enumerate(depth)]
        found = _merged(row, 2e-3, 0.17)
        assert [c.position[0] for c in found] == pytest.approx(expected, abs=1e-9)
        assert [c.depth for c in found] == ([1e-5, 0.0] if deepest_end == 0 else [0.0, 1e-5])
        assert {(c.link, c.friction) for c in found} == {("tip", 0.5)}
        assert deepest(found) is max(found, key=lambda c: c.depth)
    assert deepest(found[::-1]).depth == deepest(found).depth == 1e-5


@pytest.mark.parametrize("covers", ["object", "hand"])
def test_a_face_just_under_another_is_hidden_though_the_gap_is_larger(covers: str) -> None:
    """Of 0.3 mm between two faces a thin sheet on one of them takes 0.02 mm: the contact is midway of the rest."""
    lower = Shape("box", (0.02, 0.02, 0.02), transform([0, 0, -0.01]))
    upper = Shape("box", (0.01, 0.01, 0.02), transform([0, 0, 0.3e-3 + 0.01]))
    at = 0.02e-3 - 0.03e-3 if covers == "object" else 0.3e-3 - 0.02e-3 + 0.03e-3
    sheet = Shape("box", (0.02, 0.02, 0.06e-3), transform([0, 0, at]))
    ends = (0.02e-3, 0.3e-3) if covers == "object" else (0.0, 0.28e-3)
    tip = (upper,) if covers == "object" else (upper, sheet)
    hand = Hand(
        "two", (Link("base", -1, np.eye(4)), Link("tip", 0, np.eye(4), (), tip)), (), NO_MOTION, (), np.zeros(0)
    )
    found = contacts_of(hand, *((lower, sheet) if covers == "object" else (lower,)))
    assert len(found) == 4
    for c in found:
        assert c.position[2] == pytest.approx(sum(ends) / 2, abs=1e-8)
        assert c.depth == pytest.approx(-0.28e-3, abs=1e-8)


def test_a_face_may_be_hidden_by_any_of_the_other_pieces() -> None:
    """The lowest of three tops is inside the second piece and not inside the third, which stands elsewhere."""
    low = Shape("box", (0.02, 0.02, 0.02), transform([0, 0, -0.0102]))
    high = Shape("box", (0.02, 0.02, 0.02), transform([0, 0, -0.01]))
    away = Shape("box", (0.02, 0.02, 0.02), transform([0.1, 0, 0]))
    ball = Shape("sphere", 0.01, transform([0, 0, 0.01]), name="tip")
    for pieces in ((low, high, away), (high, away, low), (away, low, high), (low, away, high)):
        (c,) = contacts_of(jointless(ball), *pieces)
        assert c.depth == pytest.approx(0.0, abs=1e-8)
        assert c.position[2] == pytest.approx(0.0, abs=1e-8)


def test_where_every_nearest_point_is_hidden_the_deepest_counts() -> None:
    """A small ball within two boxes that overlap: out of each it is nearest into the other one."""
    boxes = [Shape("box", (0.05, 0.1, 0.1), transform([x, 0, 0])) for x in (-0.024, 0.024)]  # they share 2 mm
    ball = Shape("sphere", 1e-3, transform([0.2e-3, 0, 0]), name="tip")
    for pieces in (boxes, boxes[::-1]):
        (c,) = contacts_of(jointless(ball), *pieces)
        assert c.depth == pytest.approx(2.2e-3, abs=1e-6)
        np.testing.assert_allclose(c.normal, [1, 0, 0], atol=1e-6)
