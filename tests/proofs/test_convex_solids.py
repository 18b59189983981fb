"""Depths in convex solids as a file holds them: never more than there is, whatever triangles a file gives a mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from handfast.core.transforms import quaternion_matrix, transform
from handfast.model.shape import Shape
from handfast.proofs.convex_solids import SolidData, SolidsData, solid_to_dict
from handfast.proofs.discarded_boxes import inside
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.replay import Refused


def read(shape: Shape) -> SolidData:
    return SolidData.read(Fields(solid_to_dict(shape.kind, shape.size, shape.pose, shape.vertices)))


@pytest.mark.parametrize("kind", ["box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh"])
def test_depths_are_those_of_the_shape(kind: str) -> None:
    rng = np.random.default_rng(3)
    pose = transform(rng.normal(size=3), quaternion_matrix(rng.normal(size=4)))
    n = {"box": 3, "sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "mesh": 0}[kind]
    mesh = Shape.hull(rng.normal(size=(30, 3)), pose)
    shape = mesh if kind == "mesh" else Shape(kind, rng.uniform(0.5, 2, size=n), pose)  # type: ignore[arg-type]
    solid = read(shape).with_faces(shape.faces) if kind == "mesh" else read(shape)
    points = shape.centroid + rng.normal(size=(300, 3)) * 0.4
    due = shape.depth(points)
    assert (due > 0).sum() > 20
    assert np.allclose(inside(solid, points)[due > 0], due[due > 0], atol=1e-9)
    assert (inside(solid, points) <= due + 1e-12)[due > 0].all()
    assert (inside(solid, points)[due < 0] < 0).all()


def test_a_mesh_needs_a_closed_surface() -> None:
    shape = Shape.hull(np.random.default_rng(4).normal(size=(20, 3)))
    assert inside(read(shape), shape.centroid[None])[0] == -np.inf
    with pytest.raises(Refused, match="closed"):
        read(shape).with_faces(shape.faces[1:])
    with pytest.raises(Refused, match="closed"):
        read(shape).with_faces(np.vstack([shape.faces[:1, ::-1], shape.faces[1:]]))
    with pytest.raises(Refused, match="no mesh"):
        read(Shape("sphere", (1.0,))).with_faces(shape.faces)
    for out in (-1, len(shape.vertices)):  # no vertex; the others are
        with pytest.raises(Refused):
            read(shape).with_faces(np.where(shape.faces == shape.faces[0, 0], out, shape.faces))
    turned = read(shape).with_faces(shape.faces[:, ::-1])  # inside out: closed, and no point is on its inner side
    assert inside(turned, shape.centroid[None])[0] < 0


@pytest.mark.parametrize(
    "pairs, line",
    [
        ([("palm", "tip", 0.0), ("tip", "palm", 1.0)], "is there twice"),
        ([("palm", "tip", 0.0), ("palm", "tip", 0.0)], "is there twice"),
        ([("tip", "tip", 0.0)], "is a link with itself"),
    ],
)
def test_how_deep_two_links_may_be_in_each_other_is_said_once(pairs: list[tuple[str, str, float]], line: str) -> None:
    said = {"links": [], "object": [], "depth": 0.0}
    each = [dict(zip(("first", "second", "depth"), pair, strict=True)) for pair in pairs]
    known = SolidsData.read(
        Fields({**said, "pairs": [{"first": "palm", "second": "tip", "depth": 0.5}]}), ["palm", "tip"]
    )
    assert known.depth_allowed(1, 0) == 0.5
    with pytest.raises(BadFile, match=line):
        SolidsData.read(Fields({**said, "pairs": each}), ["palm", "tip"])


SPHERE = {"kind": "sphere", "size": [0.01], "pose": np.eye(4).tolist()}
QUESTION: dict[str, Any] = {
    "links": [{"link": "tip", "solids": [SPHERE]}],
    "object": [SPHERE],
    "depth": 0.001,
    "pairs": [{"first": "palm", "second": "tip", "depth": 0.5}],
}


@pytest.mark.parametrize(
    ("changed", "line"),
    [
        ({"kind": "cone"}, r"^object\[0\].kind: is 'cone'; 'box' or 'sphere' or "),
        ({"size": [0.0]}, r"^object\[0\].size: has a size that is not above 0$"),
        ({"kind": "box", "size": [1.0, 0.0, 1.0]}, r"^object\[0\].size: has a size that is not above 0$"),
        ({"size": [0.01, 0.01]}, r"^object\[0\].size: has 2 numbers; 1 are needed"),
        ({"pose": (1.001 * np.eye(4)).tolist()}, r"^object\[0\].pose: is no rotation$"),
        ({"pose": np.diag([1.0, 1, -1, 1]).tolist()}, r"^object\[0\].pose: is no rotation$"),
        ({"pose": np.diag([1.0, 1, 1 + 2e-9, 1]).tolist()}, r"^object\[0\].pose: is no rotation$"),
        ({"vertices": []}, r"^object\[0\].vertices: is not a known field"),
    ],
)
def test_what_is_no_solid_is_named(changed: dict[str, Any], line: str) -> None:
    with pytest.raises(BadFile, match=line):
        SolidsData.read(Fields(QUESTION | {"object": [SPHERE | changed]}), ["palm", "tip"])


PAIR = QUESTION["pairs"][0]


@pytest.mark.parametrize(
    ("changed", "line"),
    [
        ({"links": QUESTION["links"] * 2}, r"^links\[1\]: is there twice$"),
        ({"links": [{"link": "thumb", "solids": []}]}, r"^links\[0\].link: is 'thumb'; 'palm' or 'tip' is needed$"),
        ({"links": [{"link": "tip", "solids": [], "more": 1}]}, r"^links\[0\].more: is not a known field"),
        ({"depth": -1e-9}, "^depth: is -1e-09; 0 or more is needed$"),
        ({"pairs": [PAIR | {"second": "palm"}]}, r"^pairs\[0\]: is a link with itself$"),
        ({"pairs": [PAIR, PAIR | {"first": "tip", "second": "palm"}]}, r"^pairs\[1\]: is there twice$"),
        ({"pairs": [PAIR | {"depth": -1e-9}]}, r"^pairs\[0\].depth: is -1e-09; 0 or more is needed$"),
        ({"pairs": [PAIR | {"more": 1}]}, r"^pairs\[0\].more: is not a known field"),
        ({"more": 1}, "^more: is not a known field"),
    ],
)
def test_what_is_wrong_with_the_solids_of_a_question_is_named(changed: dict[str, Any], line: str) -> None:
    with pytest.raises(BadFile, match=line):
        SolidsData.read(Fields(QUESTION | changed), ["palm", "tip"])


def test_a_link_without_solids_has_none_and_no_depth_in_the_object() -> None:
    data = SolidsData.read(Fields(QUESTION), ["palm", "tip"])
    assert data.of(0) == ()
    assert [[solid.kind for solid in data.of(body)] for body in (1, -1)] == [["sphere"], ["sphere"]]
    assert data.allowed == {(1, -1): 0.001, (0, 1): 0.5}
    assert [data.may_not_meet(*pair) for pair in ((1, -1), (0, -1), (0, 1), (1, 0))] == [True, False, True, True]
    assert data.of(1)[0].vertices.shape == (0, 3)
