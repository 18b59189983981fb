"""Parts of surfaces of convex solids by hand: their cones and balls, halves, where they are, and which are hidden."""

from __future__ import annotations

import tracemalloc
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.solids import (
    COVER_DISTANCE,
    EIGHTHS,
    EQUAL_NORMAL_ANGLE,
    RIM_PARTS,
    SOLID_TOUCH_DISTANCE,
    ConvexSolid,
    SurfaceParts,
    angle,
    hidden,
)

X, Y, Z = np.eye(3)
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
CUBE = [
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
    [1, 5, 7], [1, 7, 3],
]  # fmt: skip


def read(kind: str, *size: float, **more: Any) -> ConvexSolid:
    return ConvexSolid.read(Fields({"kind": kind, "size": list(size)} | more, "solids[0]"))


def cube(half: Any = 1.0, *others: Sequence[float], middle: Sequence[float] = (0, 0, 0)) -> ConvexSolid:
    """Or a box of three halves; others: vertices that no face has, from the middle."""
    vertices = (np.array([*(half * CORNERS), *others]) + middle).tolist()
    return read("mesh", vertices=vertices, faces=CUBE)


def one(points: Any, normals: Any, radius: float = 0.0, slack: float = 0.0) -> SurfaceParts:
    """A part, of all points or normals the same if one is given."""
    at, along = (np.broadcast_to(np.asarray(a, dtype=float), (1, 3, 3)) for a in (points, normals))
    return SurfaceParts.of(at, along, radius, slack)


def around(half: float) -> Array:
    """(3, 3) unit vectors that are so far from z, a third of a turn apart."""
    turns = 2 * np.pi / 3 * np.arange(3)
    return np.stack([np.sin(half) * np.cos(turns), np.sin(half) * np.sin(turns), np.full(3, np.cos(half))], axis=1)


# --- cones, balls and halves ------------------------------------------------------------------------------


def test_angles_are_those_between_vectors_of_any_length() -> None:
    a = np.array([[2.0, 0, 0]] * 4)
    b = np.array([[0, 3.0, 0], [5, 0, 0], [-1e-3, 0, 0], [4, 4e-9, 0]])
    np.testing.assert_allclose(angle(a, b), [np.pi / 2, 0, np.pi, 1e-9], rtol=1e-15)


def test_a_cone_holds_normals_and_is_all_directions_where_it_is_wide() -> None:
    """Those that add up to nothing have no cone, and wider ones than 1.4 none that is worth anything."""
    cases: list[tuple[Any, float | None]] = [
        (np.eye(3), np.arccos(1 / np.sqrt(3))),
        (Z, 0.0),
        (around(1.39), 1.39),
        (around(1.41), None),
    ]
    cases += [([X, -X, X - X], None), ([Z, Z, X], np.arccos(1 / np.sqrt(5))), ([X, Z, Z], np.arccos(1 / np.sqrt(5)))]
    for normals, half in cases:
        axis, found = one(0 * X, normals).cones()
        assert found[0] == (np.pi if half is None else pytest.approx(half + EQUAL_NORMAL_ANGLE, abs=1e-12))
        if half is not None:
            assert axis[0] == pytest.approx(np.sum(np.broadcast_to(normals, (3, 3)), axis=0) / _length(normals))


def test_each_of_many_parts_has_its_own_cone_and_halves() -> None:
    corners = np.array([[0.0, 0, 0], [4, 0, 0], [0, 1, 0]])
    small, large = one(1e-3 * corners, [Z, X, Z]), one(corners, Z)
    for turn in range(3):
        small = SurfaceParts.of(np.roll(small.points, 1, axis=1), np.roll(small.normals, 1, axis=1))
        large = SurfaceParts.of(np.roll(large.points, 1, axis=1), large.normals)
        both = SurfaceParts.joined([small, large])
        np.testing.assert_allclose(both.cones()[1], [np.arccos(1 / np.sqrt(5)) + 1e-7, 1e-7], atol=1e-12)
        np.testing.assert_allclose(both.balls()[1], [small.balls()[1][0], large.balls()[1][0]], rtol=1e-14)
        found, turned, cut = (some.halves(np.array([0.5, 0, 0])) for some in (both, small, large))
        np.testing.assert_array_equal(found.points, [*cut.points, *turned.points])  # points of the large one are cut
        np.testing.assert_array_equal(found.normals, [*cut.normals, *turned.normals])
        assert {tuple(p) for p in cut.points.reshape(-1, 3)} == {*map(tuple, corners), (2, 0.5, 0)}
        middle = (X + Z) / np.linalg.norm(X + Z)
        assert {tuple(n) for n in turned.normals.reshape(-1, 3)} == {tuple(X), tuple(Z), tuple(middle)}, turn


def _length(normals: Any) -> float:
    return float(np.linalg.norm(np.broadcast_to(normals, (3, 3)).sum(axis=0)))


def test_a_ball_holds_the_points_that_a_radius_raises() -> None:
    """Corners sqrt 5 from their middle (1, 1, 0); a radius of 2 raises that, and normals turn it by a chord."""
    corners = [[0, 0, 0], [3, 0, 0], [0, 3, 0]]
    (middle,), (reach,) = one(corners, Z, slack=0.5).balls()
    assert middle.tolist() == [1, 1, 0]
    assert np.sqrt(5) + 0.5 < reach < (np.sqrt(5) + 0.5) * (1 + 2e-12)
    (middle,), (reach,) = one(corners, around(1.0), radius=2.0).balls()
    assert middle == pytest.approx([1, 1, 2])
    assert reach == pytest.approx(np.sqrt(5) + 2 * 2 * np.sin(0.5 * (1.0 + EQUAL_NORMAL_ANGLE)), rel=1e-11)
    (_,), (reach,) = one(corners, around(1.5), radius=2.0).balls()
    assert reach == pytest.approx(np.sqrt(5) + 4)


def test_the_longest_side_is_halved_as_it_is_seen_from_a_centre() -> None:
    """Of points sqrt 17 apart, up to sqrt 5 or sqrt 17 away and 0.5 m raised, or of normals that are 1 apart."""
    corners, normals = np.array([[0.0, 0, 0], [4, 0, 0], [0, 1, 0]]), np.array([Z, [np.sqrt(0.75), 0, 0.5], Z])
    part = SurfaceParts(*(np.array([a]) for a in (corners, normals, 0.5, 0.25, 7)))
    near, far = (part.halves(np.array(center)) for center in ([2.0, 0, 0], [0.0, 0, -1]))
    for halves in (near, far):
        assert (halves.radius.tolist(), halves.slack.tolist(), halves.solid.tolist()) == (
            [0.5] * 2,
            [0.25] * 2,
            [7] * 2,
        )
    middle = np.array([2, 0.5, 0])
    np.testing.assert_array_equal(near.points, [[corners[1], middle, corners[0]], [corners[2], middle, corners[0]]])
    np.testing.assert_array_equal(near.normals, [normals] * 2)
    middle = normals[0] + normals[1]
    middle /= np.linalg.norm(middle)
    np.testing.assert_array_equal(far.points, [corners] * 2)
    np.testing.assert_allclose(far.normals, [[Z, middle, Z], [normals[1], middle, Z]], atol=1e-15)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_which_side_is_halved_is_no_matter_of_size(size: float) -> None:
    """Normals are 1 apart; points too, as seen from a ball's distance: 2 over 1.9 or over 2.1."""
    corners, normals = size * np.array([-X, X, -X]), np.array([Z, [np.sqrt(0.75), 0, 0.5], Z])
    for radius, by_points in ((0.9, True), (1.1, False)):
        halves = one(corners, normals, size * radius).halves(np.zeros(3))
        assert (np.ptp(halves.points[0], axis=0)[0] < 1.5 * size) == by_points
        assert np.array_equal(halves.normals, [normals] * 2) == by_points


# --- solids of files --------------------------------------------------------------------------------------


MESH = {"kind": "mesh", "size": [], "vertices": CORNERS.tolist(), "faces": CUBE}
VERTICES = r"solids\[0\]: has faces that are no whole numbers, or vertices beside a size or a pose$"


@pytest.mark.parametrize(
    ("said", "line"),
    [
        ({"kind": "box"}, r"^solids\[0\].kind: is 'box'; 'mesh' or 'sphere' or "),
        ({"kind": "capsule"}, r"^solids\[0\].size: has 1 numbers; 2 are needed"),
        ({"size": [0.0]}, r"^solids\[0\]: has a size that is not positive, or a pose that is not rigid$"),
        ({"kind": "capsule", "size": [1, -1]}, r"^solids\[0\]: has a size that is not positive"),
        ({"pose": np.diag([1, 1, 1 + 6e-13, 1]).tolist()}, r"^solids\[0\]: has .* a pose that is not rigid$"),
        ({"pose": np.diag([1, 1, 1 - 6e-13, 1]).tolist()}, r"^solids\[0\]: has .* a pose that is not rigid$"),
        ({"pose": np.diag([1, 1, -1, 1]).tolist()}, r"^solids\[0\]: has .* a pose that is not rigid$"),
        (MESH | {"faces": [[0, 1, 2.5]]}, rf"^{VERTICES}"),
        (MESH | {"pose": np.diag([-1, -1, 1, 1]).tolist()}, rf"^{VERTICES}"),
        ({"vertices": [[0, 0, 0]]}, rf"^{VERTICES}"),
        ({"kind": "mesh", "size": []}, r"^solids\[0\]: has no faces, or one with a vertex that is not there$"),
        ({"more": 1}, r"^solids\[0\].more: is not a known field"),
    ],
)
def test_what_is_no_solid_is_named(said: dict[str, Any], line: str) -> None:
    with pytest.raises(BadFile, match=line):
        ConvexSolid.read(Fields({"kind": "sphere", "size": [1.0]} | said, "solids[0]"))


@pytest.mark.parametrize("face", [[0, 1, 8], [-1, 0, 1], [0, -1, 8]])
def test_faces_have_vertices_that_are_there(face: list[int]) -> None:
    for faces in ([face], [face, [0, 1, 2]], [[0, 1, 2], face]):
        with pytest.raises(BadFile, match=r"^solids\[0\]: has no faces, or one with a vertex that is not there$"):
            read("mesh", vertices=CORNERS.tolist(), faces=faces)
    assert read("mesh", vertices=CORNERS.tolist(), faces=[[0, 1, 7]]).faces.tolist() == [[0, 1, 7]]


def test_a_pose_that_is_left_out_is_none() -> None:
    assert read("sphere", 2.0).pose.tolist() == np.eye(4).tolist()
    assert read("sphere", 2.0, pose=np.diag([1, 1, 1 + 4e-13, 1]).tolist()).size == (2.0,)


# --- where surfaces are -----------------------------------------------------------------------------------


def test_parts_of_a_cube() -> None:
    """12 triangles of its faces; 12 edges with the normals on both sides; 3 parts at each of 8 corners."""
    parts = cube().parts()
    assert parts is not None
    assert len(parts) == 12 + 12 + 24
    faces, edges, corners = parts[:12], parts[12:24], parts[24:]
    assert (np.abs(faces.points - faces.normals * (faces.points * faces.normals).sum(axis=2)[..., None]) <= 1).all()
    np.testing.assert_array_equal((faces.points * faces.normals).sum(axis=2), np.ones((12, 3)))
    np.testing.assert_array_equal(np.ptp(faces.normals, axis=1), np.zeros((12, 3)))
    assert sorted(edges.points.sum(axis=1).tolist()) == sorted(
        (2 * edges.points[:, 0] + edges.points[:, 1]).tolist()
    )  # from its start to its end and back
    np.testing.assert_array_equal(np.linalg.norm(edges.points[:, 1] - edges.points[:, 0], axis=1), np.full(12, 2.0))
    across = edges.normals[:, 0] + edges.normals[:, 1]
    np.testing.assert_array_equal(edges.points[:, :2].mean(axis=1), across)
    np.testing.assert_array_equal(edges.normals[:, 0], edges.normals[:, 2])
    np.testing.assert_array_equal(np.ptp(corners.points, axis=1), np.zeros((24, 3)))
    middle, left, right = np.moveaxis(corners.normals, 1, 0)
    assert (np.sign(middle) == corners.points[:, 0]).all()  # from three faces, one or two triangles of each
    np.testing.assert_allclose(np.linalg.norm(middle, axis=1), 1.0, rtol=1e-15)
    assert (((left + right) * corners.points[:, 0]).sum(axis=1) == 2).all()
    each = np.unique(np.hstack([corners.points[:, 0], np.abs(left + right)]), axis=0)
    assert len(each) == 24  # each corner between each two of its faces
    assert not np.stack([parts.radius, parts.slack, parts.solid]).any()


@pytest.mark.parametrize("half", [0.05, 1.0, 20.0])
def test_a_vertex_above_a_face_makes_a_mesh_none_but_for_rounding(half: float) -> None:
    """A hundred thousandth of its length."""
    for share, is_one in ((0.9, True), (1.1, False)):
        for halves in (np.array([1, 1, 1]), np.array([1, 0.25, 0.5]), np.array([0.25, 1, 1])):
            above = cube(half * halves, (0, 0, half * (halves[2] + share * 1e-5 * 2)), middle=(3 * half, 0, 0))
            assert (above.parts() is not None) == is_one


def test_a_mesh_that_is_open_or_has_an_edge_twice_has_no_parts() -> None:
    whole = cube()
    for faces in (CUBE[1:], [*CUBE, CUBE[0]], [*CUBE[:-1], CUBE[0]]):
        assert read("mesh", vertices=whole.vertices.tolist(), faces=faces).parts() is None


def test_parts_of_round_solids() -> None:
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = np.stack([Y, Z, X], axis=1), (1, 2, 3)  # its z axis is x
    ball = read("sphere", 0.5, pose=place.tolist()).parts()
    assert ball is not None
    np.testing.assert_array_equal(ball.points, np.broadcast_to([1, 2, 3], (8, 3, 3)))
    assert {tuple(np.sign(n.sum(axis=0))) for n in ball.normals} == {tuple(c) for c in CORNERS}
    assert ball.radius.tolist() == [0.5] * 8
    pill = read("capsule", 0.5, 4.0, pose=place.tolist()).parts()
    assert pill is not None
    side, tops = pill[:4], pill[4:]
    assert (len(tops), pill.radius.tolist()) == (8, [0.5] * 12)
    for k in range(4):
        assert sorted(side.points[k, :, 0].tolist()) == [-1, 3, 3]
    assert not side.normals[:, :, 0].round(12).any()
    assert angle(side.normals[:, 0], side.normals[:, 1]) == pytest.approx(np.full(4, np.pi / 2), abs=1e-12)
    np.testing.assert_allclose(np.abs(side.normals.sum(axis=0)).max(), 0.0, atol=1e-12)
    ends = np.where(tops.normals[:, 2, 0] > 0, 3.0, -1.0)
    np.testing.assert_array_equal(
        tops.points, np.stack([ends, ends * 0 + 2, ends * 0 + 3], axis=1)[:, None].repeat(3, 1)
    )


def test_parts_of_a_cylinder_are_its_side_lids_and_rims() -> None:
    """Lids reach out to where tangents of the rim meet, 1 over the cosine of half a part."""
    parts = read("cylinder", 2.0, 6.0).parts()
    assert parts is not None
    assert len(parts) == 4 + 2 * 3 * RIM_PARTS
    assert (parts.radius.tolist(), parts.slack.any()) == ([2.0] * 4 + [0.0] * 6 * RIM_PARTS, False)
    out = 2.0 / np.cos(np.pi / RIM_PARTS)
    for k, z in ((0, 3.0), (1, -3.0)):
        lid, rest, rim = (parts[4 + (3 * k + j) * RIM_PARTS :][:RIM_PARTS] for j in range(3))
        for some, reach in ((lid, [0, 2, out]), (rest, [0, out, 2]), (rim, [2, out, 2])):
            np.testing.assert_array_equal(some.points[:, :, 2], np.full((RIM_PARTS, 3), z))
            np.testing.assert_allclose(np.hypot(*some.points[:, :, :2].T).T, np.tile(reach, (RIM_PARTS, 1)), atol=1e-12)
        for flat in (lid, rest):
            np.testing.assert_array_equal(flat.normals, np.broadcast_to(np.sign(z) * Z, (RIM_PARTS, 3, 3)))
        np.testing.assert_allclose(rim.normals[:, :2], rim.points[:, [0, 2]] * [0.5, 0.5, 0], atol=1e-12)
        np.testing.assert_array_equal(rim.normals[:, 2], np.tile(np.sign(z) * Z, (RIM_PARTS, 1)))
        area = np.linalg.norm(np.cross(lid.points[:, 1], lid.points[:, 2]) * [0, 0, 1], axis=1).sum()
        area += np.linalg.norm(np.cross(rest.points[:, 1], rest.points[:, 2]) * [0, 0, 1], axis=1).sum()
        assert area / 2 == pytest.approx(RIM_PARTS * 4 * np.tan(np.pi / RIM_PARTS))  # of a polygon about the circle


def test_parts_of_an_ellipsoid_have_corners_on_it_and_the_slack_that_it_is_above_them() -> None:
    size = np.array([1.0, 2.0, 3.0])
    parts = read("ellipsoid", *size).parts()
    assert parts is not None
    assert len(parts) == 8 * 4**5
    own = parts.points / size
    np.testing.assert_allclose(np.linalg.norm(own, axis=2), 1.0, rtol=1e-12)
    np.testing.assert_allclose(
        parts.normals, own / size / np.linalg.norm(own / size, axis=2, keepdims=True), atol=1e-12
    )
    deep = 1 - np.linalg.norm(own.mean(axis=1), axis=1).min()  # of the largest triangle in a ball of 1 m
    np.testing.assert_allclose(parts.slack, 2 * deep * 3, rtol=1e-12)
    solid_angle = np.abs(np.linalg.det(own)).sum() / 2
    assert solid_angle == pytest.approx(4 * np.pi, rel=2e-3)


def test_how_far_solids_reach() -> None:
    """From (1, 2, 3) to the farthest corner of a cube of 4 m, and at most to the end of a capsule about (1, 0, 3)."""
    center = np.array([1.0, 2.0, 3.0])
    far = cube(2.0)
    assert far.reach(center) == pytest.approx(np.sqrt(9 + 16 + 25), rel=1e-11)
    assert far.reach(center) > np.sqrt(50)
    assert [a.tolist() for a in far.box] == [[-2] * 3, [2] * 3]
    place = np.eye(4)
    place[:3, 3] = 1, 0, 3
    pill = read("capsule", 0.5, 4.0, pose=place.tolist())
    assert pill.reach(center) == pytest.approx(2 + 4.5, rel=1e-11)
    assert [a.tolist() for a in pill.box] == [[0.5, -0.5, 0.5], [1.5, 0.5, 5.5]]
    np.testing.assert_allclose(pill.farthest(np.array([[0, 0.6, -0.8]])), [[1, 0.3, 3 - 2 - 0.4]], rtol=1e-14)


@pytest.mark.parametrize(
    ("solid", "points", "depths"),
    [
        (cube(), [[0, 0, 0], [0.5, -0.75, 0], [0, 0, 1.5]], [1, 0.25, -0.5]),
        (read("sphere", 2.0), [[0, 0, 0], [0.6, 0, 0.8], [0, 0, 2.5]], [2, 1, -0.5]),
        (read("capsule", 2.0, 6.0), [[0, 0, 1], [0, 0, -4], [0, 1, 3.5], [0, 0, 5.5]], [2, 1, 2 - np.sqrt(1.25), -0.5]),
        (read("cylinder", 2.0, 6.0), [[0, 0, 0], [0.6, 0.8, 1], [0, 1, -2.75], [0, 0, 3.5]], [2, 1, 0.25, -0.5]),
        (read("ellipsoid", 1.0, 2.0, 4.0), [[0, 0, 0], [0, 1, 0], [0, 0, -3], [2, 0, 0]], [1, 0.5, 0.25, -1]),
    ],
)
def test_depths_by_hand(solid: ConvexSolid, points: Any, depths: Any) -> None:
    np.testing.assert_allclose(solid.depth(np.array(points)), depths, rtol=1e-14)
    np.testing.assert_allclose(solid.depth(np.array([points] * 2)), [depths] * 2, rtol=1e-14)
    if solid.kind != "mesh":
        turned = ConvexSolid(solid.kind, solid.size, POSE, solid.vertices, solid.faces)
        np.testing.assert_allclose(turned.depth(np.array(points) @ TURN.T + [3, 1, 2]), depths, atol=1e-14)


def test_a_mesh_of_many_faces_takes_no_more_memory() -> None:
    """4,000 points below 6,000 faces are 192 MB of depths at once."""
    many = read("mesh", vertices=cube().vertices.tolist(), faces=CUBE * 500)
    points = np.linspace(-1, 1, 4000)[:, None] * X
    tracemalloc.start()
    found = many.depth(points)
    assert tracemalloc.get_traced_memory()[1] < 120e6
    tracemalloc.stop()
    np.testing.assert_allclose(found, 1 - np.abs(points[:, 0]), atol=1e-15)


TURN = np.stack([Y, Z, X], axis=1)
POSE = np.eye(4)
POSE[:3, :3], POSE[:3, 3] = TURN, (3, 1, 2)


@pytest.mark.parametrize(
    ("kind", "size", "points"),
    [
        ("sphere", [2.0], [[0, 1.2, 1.6], [-2, 0, 0], [0, 0, -2]]),
        ("capsule", [2.0, 6.0], [[0, 1.2, 4.6], [-2, 0, 0], [0, 0, -5]]),
        ("cylinder", [2.0, 6.0], [[0, 2, 3], [-2, 0, 0], [0, 0, -3]]),
        (
            "ellipsoid",
            [1.0, 4.0, 3.0],
            [[0, 16 * 0.6 / np.sqrt(2.4**2 * 2), 9 * 0.8 / np.sqrt(2.4**2 * 2)], [-1, 0, 0], [0, 0, -3]],
        ),
    ],
)
def test_the_farthest_points_by_hand(kind: str, size: list[float], points: Any) -> None:
    """Along (0, 0.6, 0.8), -x and -z of the solid's own frame; of semi-axes 4 and 3 they go 2.4 sqrt 2 along it."""
    ways = np.array([[0, 0.6, 0.8], -X, -Z])
    np.testing.assert_allclose(read(kind, *size).farthest(ways), points, atol=1e-14)
    turned = read(kind, *size, pose=POSE.tolist())
    np.testing.assert_allclose(turned.farthest(ways @ TURN.T), np.array(points) @ TURN.T + [3, 1, 2], atol=1e-14)


# --- what is hidden ---------------------------------------------------------------------------------------


def within(part: SurfaceParts) -> bool:
    """Is it, of another solid, hidden by a cube of 40 mm?"""
    (out,) = hidden(SurfaceParts(part.points, part.normals, part.radius, part.slack, part.solid + 1), [cube(0.02)])
    return bool(out)


def test_what_may_be_above_a_part_has_to_be_inside_as_well() -> None:
    """1 mm from a side, 20 mm from the top, to which its normals point: what is 5 mm around it is not all inside."""
    assert within(one([0.019, 0, 0], Z, slack=0.0009))
    assert not within(one([0.019, 0, 0], Z, slack=0.005))


@pytest.mark.parametrize("name", ["radius", "slack"])
@pytest.mark.parametrize("half", [2e-9, 0.02, 3e5])
def test_a_solid_has_to_reach_beyond_what_it_hides(name: str, half: float) -> None:
    """By 2e-5 of its length, 4e-5 halves, beyond a part that is raised to so little below the top, or may be."""
    assert (SOLID_TOUCH_DISTANCE, COVER_DISTANCE) == (1e-5, 2e-5)
    for left, is_hidden in ((6e-5, True), (2e-5, False)):
        part = one([0, 0, 0], Z, **{name: half * (1 - left)})
        (out,) = hidden(replace(part, solid=part.solid + 1), [cube(half)])
        assert out == is_hidden


@pytest.mark.parametrize("half", [2e-9, 0.02, 3e5])
def test_solids_touch_that_are_as_near_as_their_length_allows(half: float) -> None:
    """A push along x, beyond which the cube reaches, 1e-5 of the length above its top or 2e-5: each 2e-5 halves."""
    for above, is_hidden in ((1e-5, True), (3e-5, False)):
        part = one([0, 0, half * (1 + above)], X)
        (out,) = hidden(replace(part, solid=part.solid + 1), [cube(half)])
        assert out == is_hidden


@pytest.mark.parametrize(("before", "is_hidden"), [(0.9e-5, True), (1.1e-5, False), (5e-4, False)])
def test_how_far_is_measured_from_the_solid_and_not_from_its_planes(before: float, is_hidden: bool) -> None:
    """Before the sharp edge of a blade from (1, 0, 0) to (0, 1, 0) m that is 0.02 m thick at the origin.

    1e-5 m of 1 m is near; at 5e-4 m both planes of the edge are nearer than that, at 7.1e-6 m.
    """
    vertices = [[0, 1, 0], [1, 0, 0], [0, 0, 0.01], [0, 0, -0.01]]
    blade = read("mesh", vertices=vertices, faces=[[1, 0, 2], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    at = np.array([0.5, 0.5, 0.0]) + before * (X + Y) / np.sqrt(2)
    np.testing.assert_allclose(blade.depth(at), -before * np.sqrt(2 / 10002), rtol=1e-6)
    part = one(at, X)
    assert hidden(replace(part, solid=part.solid + 1), [blade]).tolist() == [is_hidden]


@pytest.mark.parametrize(("far", "is_hidden"), [(0.0, True), (1e10, False)])
def test_what_rounding_may_lose_is_not_in_a_solid(far: float, is_hidden: bool) -> None:
    """0.06 mm deep in a cube of 1 m, that is 1e10 m from the origin: places are rounded to 2e-6 m there."""
    part = one([far, 0, 0.5 - 2.0**-14], X)
    (out,) = hidden(replace(part, solid=part.solid + 1), [cube(0.5, middle=(far, 0, 0))])
    assert out == is_hidden


def test_a_solid_has_to_reach_beyond_along_every_normal() -> None:
    """At the middle of the top: it reaches 20 mm farther along x, but not along z."""
    for normals, is_hidden in (([X, X, X], True), ([X, X, Z], False), ([Z, X, X], False), ([X, X, -Z], True)):
        assert within(one([0, 0, 0.02], normals)) == is_hidden


def test_parts_with_normals_of_all_directions_are_not_hidden_nor_those_of_the_same_solid() -> None:
    middle = one(X - X, around(1.39))
    assert hidden(middle, [cube(), read("sphere", 0.02)]).tolist() == [True]
    assert hidden(one(X - X, around(1.41)), [cube(), read("sphere", 0.02)]).tolist() == [False]
    assert hidden(middle, [read("sphere", 0.02)]).tolist() == [False]  # which it is of
    others = SurfaceParts.joined([one([0, 0, 2], Z), middle, one([0, 0, -2], Z)])
    assert hidden(others, [cube(), read("sphere", 0.02)]).tolist() == [False, True, False]


def test_a_round_part_may_rise_over_its_corners() -> None:
    """An eighth of a ball of 4 mm rises sqrt 3 - 1 of that over its corners, which are 3.5 or 2.5 mm deep."""
    for z, is_hidden in ((0.0125, True), (0.0135, False)):
        assert within(one([0, 0, z], EIGHTHS[0], radius=0.004)) == is_hidden


def test_a_flat_cone_has_all_the_normals_of_its_tip() -> None:
    """Each of its edges bends by less than counts, 100 of them by 1.6e-6 about the tip."""
    count, slope = 100, 0.97e-7 * 100 / (2 * np.pi)
    turns = 2 * np.pi * np.arange(count) / count
    ring = np.column_stack([np.cos(turns), np.sin(turns), np.full(count, -np.tan(slope))])
    base, tip = count + 1, count
    vertices = np.vstack([ring, [[0, 0, 0]], [[0, 0, -1]]])
    round_ = [(k, (k + 1) % count) for k in range(count)]
    faces = [[tip, a, b] for a, b in round_] + [[base, b, a] for a, b in round_]
    parts = read("mesh", vertices=vertices.tolist(), faces=faces).parts()
    assert parts is not None
    tips = parts[(parts.points == 0).all(axis=(1, 2))]
    assert len(tips) == count
    middle = tips.normals[:, 0]
    assert np.abs(middle - np.array([0, 0, 1])).max() < 1e-12
    assert np.linalg.norm(tips.normals[:, 1:, :2], axis=2) == pytest.approx(np.full((count, 2), slope), rel=1e-3)
    flat = vertices * [1, 1, 0]
    flat[base] = 0, 0, -1
    parts = read("mesh", vertices=flat.tolist(), faces=faces).parts()
    assert parts is not None
    assert not (parts.points == 0).all(axis=(1, 2)).any()  # but for its faces it has no normals there


def test_normals_of_needles_are_those_of_their_corners() -> None:
    """Two corners that differ in their last digits, 1 mm from the third."""
    rng = np.random.default_rng(3)
    turned = 0
    for _ in range(50):
        a, along = rng.normal(size=(2, 3))
        b = a + 1e-3 * along
        c = b + 3e-16 * rng.normal(size=3)
        solid = read("mesh", vertices=[a.tolist(), b.tolist(), c.tolist()], faces=[[0, 1, 2]])
        (normal,), _ = solid._planes
        exact = [[Fraction(x) for x in v] for v in (a, b, c)]
        one, two = ([x - y for x, y in zip(v, exact[0], strict=True)] for v in exact[1:])
        due = np.array([one[i - 2] * two[i - 1] - one[i - 1] * two[i - 2] for i in range(3)])
        if not any(due):
            assert np.isnan(normal).all()
            continue
        due = (due / max(map(abs, due))).astype(float)
        assert angle(normal, due) < 1e-15
        plain = np.cross(b - a, c - a)
        turned += angle(plain, due) > 1e-6
    assert turned > 3
