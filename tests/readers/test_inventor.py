"""Inventor and VRML files: every node that is read, the transforms above them, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.model.shape import Mesh, volume_and_centroid
from handfast.readers.load_body import load_body
from handfast.readers.mesh_file import read_mesh

IV, VRML1, VRML2 = "#Inventor V2.1 ascii\n", "#VRML V1.0 ascii\n", "#VRML V2.0 utf8\n"
CORNERS = "0 0 0, 1 0 0, 0 1 0, 0 0 1"
INDEX = "0, 2, 1, -1, 0, 1, 3, -1, 0, 3, 2, -1, 1, 2, 3, -1"
STATED = f"Coordinate3 {{ point [ {CORNERS} ] }}"
FACES = f"IndexedFaceSet {{ coordIndex [ {INDEX} ] }}"


def read(folder: Path, text: str, name: str = "m.iv") -> list[Mesh]:
    (folder / name).write_text(text)
    return read_mesh(folder / name)


@pytest.mark.parametrize(
    "text",
    [
        IV + f"Separator {{ {STATED} {FACES} }}",
        VRML1
        + f"DEF a Separator {{ Info {{ string \"'b' # no }}\" }} {STATED} Material {{ diffuseColor 1 0 0 }} {FACES} }}",
        IV + f"IndexedFaceSet {{ vertexProperty VertexProperty {{ vertex [ {CORNERS} ] }} coordIndex [ {INDEX} ] }} }}",
        IV + f"{STATED} FaceSet {{ numVertices [ -1 ] }} {FACES} # the end",
        VRML2
        + f"Shape {{ geometry IndexedFaceSet {{ coord Coordinate {{ point [{CORNERS}] }} coordIndex [{INDEX}] }} }}",
        VRML2 + f"Transform {{ children [ Shape {{ appearance Appearance {{ }} geometry IndexedFaceSet {{ solid FALSE "
        f"coord Coordinate {{ point [ {CORNERS} ] }} coordIndex [ {INDEX} ] }} }} ] }} ROUTE a.b TO c.d",
    ],
)
def test_a_tetrahedron_in_every_dialect(tmp_path: Path, text: str) -> None:
    vertices, faces = read(tmp_path, text)[-1]
    assert (len(vertices), len(faces)) == (4, 4)
    assert volume_and_centroid(vertices, faces)[0] == pytest.approx(1 / 6)


def test_a_strip_is_wound_one_way(tmp_path: Path) -> None:
    """Four triangles of a strip, two of them folded over, are the tetrahedron again."""
    strip = f"{STATED} IndexedTriangleStripSet {{ coordIndex [ 0, 2, 1, 3, 0, 2, -1 ] }}"
    (group,) = read(tmp_path, IV + strip)
    assert volume_and_centroid(*group)[0] == pytest.approx(1 / 6)


@pytest.mark.parametrize(
    ("solid", "volume", "size"),
    [
        ("Cube { width 1 height 2 depth 3 }", 6, (1, 2, 3)),
        ("Cube { }", 8, (2, 2, 2)),
        ("Sphere { radius 2 }", 4 / 3 * np.pi * 8, (4, 4, 4)),
        ("Cylinder { radius 1 height 5 }", np.pi * 5, (2, 5, 2)),
        ("Cone { bottomRadius 1 height 3 }", np.pi, (2, 3, 2)),
        ("Separator { Rotation { rotation 0 0 2 1.5707963 } Cube { width 1 height 2 depth 3 } }", 6, (2, 1, 3)),
        ("RotationXYZ { axis X angle 1.5707963 } Cube { width 1 height 2 depth 3 }", 6, (1, 3, 2)),
        ("Scale { scaleFactor 1 2 -3 } Cube { }", 48, (2, 4, 6)),
        ("ShapeHints { vertexOrdering CLOCKWISE } Cube { }", -8, (2, 2, 2)),
    ],
)
def test_solids_and_what_moves_them(tmp_path: Path, solid: str, volume: float, size: tuple[float, ...]) -> None:
    (group,) = read(tmp_path, IV + solid)
    assert volume_and_centroid(*group)[0] == pytest.approx(volume, rel=0.02)
    np.testing.assert_allclose(np.ptp(group[0], axis=0), size, rtol=0.01)


def middle(group: Mesh) -> list[float]:
    return [round(float(x), 6) for x in (group[0].min(0) + group[0].max(0)) / 2]


def test_transforms_act_on_what_follows_up_to_the_end_of_their_separator(tmp_path: Path) -> None:
    text = (
        "Separator { Translation { translation 1 0 0 } Cube { } Group { Scale { scaleFactor 2 2 2 } } "
        "Transform { translation 0 1 0 rotation 0 0 1 3.14159265 center 1 0 0 } Cube { } } Cube { } "
        "MatrixTransform { matrix 1 0 0 0  0 1 0 0  0 0 1 0  7 8 9 1 } Cube { }"
    )
    groups = read(tmp_path, IV + text)
    assert [middle(g) for g in groups] == [[1, 0, 0], [5, 2, 0], [0, 0, 0], [7, 8, 9]]
    nested = (
        "Transform { translation 1 0 0 children [ Transform { scale 2 2 2 children Shape { geometry Box { } } } ] }"
    )
    again = "Transform { translation 3 0 0 children DEF b Shape { geometry Sphere { } } } USE b"
    assert [middle(g) for g in read(tmp_path, VRML2 + nested + again)] == [[1, 0, 0], [3, 0, 0], [0, 0, 0]]


def test_switches_levels_and_files(tmp_path: Path) -> None:
    one, two = "Translation { translation 1 0 0 } Cube { }", "Separator { Translation { translation 2 0 0 } Cube { } }"
    (tmp_path / "part.iv").write_text(IV + one)
    text = f"Switch {{ Cube {{ }} }} Switch {{ whichChild 1 Cube {{ }} {two} }} LOD {{ {two} Cube {{ }} }}"
    assert [middle(g) for g in read(tmp_path, IV + text + ' File { name "part.iv" }')] == [
        [2, 0, 0],
        [2, 0, 0],
        [1, 0, 0],
    ]


def test_an_object_is_read_from_vrml(tmp_path: Path) -> None:
    (tmp_path / "box.wrl").write_text(VRML2 + "Shape { geometry Box { size 20 40 60 } }")
    box = load_body(tmp_path / "box.wrl", scale=0.001)
    assert sum(p.volume for p in box.pieces) == pytest.approx(48e-6)


NESTED = "Group { " * 150 + "}" * 150
DOUBLED = "DEF a0 Group { } " + "".join(f"DEF a{k + 1} Group {{ USE a{k} USE a{k} }} " for k in range(30))


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("#Inventor V2.1 binary\nxx", "m.iv: begins with '#Inventor V2.1 binary'; ASCII Inventor"),
        ("solid cube", "m.iv: begins with 'solid cube'; ASCII Inventor"),
        (IV + "Separator { }", "m.iv: has no triangles$"),
        (IV + "Cube { width 0 }", "Cube.width: is 0; a size is positive and finite$"),
        (IV + "Cube { width x }", "Cube.width: has values that are no numbers$"),
        (IV + "NurbsSurface { }", "has a node NurbsSurface, which is not read; save the mesh as OBJ"),
        (VRML2 + "PROTO P [ ] { }", "defines a prototype, which is not read; save the mesh as OBJ"),
        (IV + FACES, "IndexedFaceSet: has no vertices$"),
        (
            IV + STATED + "IndexedFaceSet { coordIndex [ 0, 1, 9, -1 ] }",
            "IndexedFaceSet: has a corner that is none of its 4",
        ),
        (IV + STATED + "IndexedFaceSet { coordIndex [ 0, 1, 1.5 ] }", "coordIndex: has a number that is no index$"),
        (
            IV + STATED + "FaceSet { numVertices [ 999999999 ] }",
            "FaceSet: has a corner that is none of its 4 vertices$",
        ),
        (IV + "Coordinate3 { point [ 1 2 ] }", "Coordinate3.point: has 2 numbers, no multiple of three$"),
        (IV + "Coordinate3 { point [ 1 2 nan ] }", "Coordinate3.point: has a number that is NaN or infinite$"),
        (IV + "Separator { Cube { }", "has its end|has 'its end'"),
        (IV + "USE a", "uses 'a', which is not defined before$"),
        (IV + "DEF a Group { USE a }", "uses 'a', which is not defined before$"),
        (IV + NESTED, "has nodes more than 64 deep in each other$"),
        (IV + DOUBLED, "has more than 10000 nodes, those that are used again counted again$"),
        (IV + 'File { name "/etc/passwd" }', "refers to the file '/etc/passwd'; a relative path is needed$"),
        (IV + 'File { name "m.iv" }', "refers to files that refer to files, more than 8 deep$"),
        (IV + 'File { name "no.iv" }', r"no.iv: cannot be read \(No such file or directory\)$"),
    ],
)
def test_files_that_are_refused(tmp_path: Path, text: str, match: str) -> None:
    with pytest.raises(InputError, match=match):
        read(tmp_path, text)
