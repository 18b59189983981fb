"""Bodies: mesh pieces, the JSON file, mass and centre of mass, refusals."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.core.transforms import transform
from handfast.model.body import Body
from handfast.model.mesh_pieces import _shared_edges, open_edges, solid_of
from handfast.model.shape import Shape, volume_and_centroid
from handfast.readers.body_file import save_body_copy
from handfast.readers.load_body import load_body
from handfast.readers.mesh_file import read_mesh
from tests.support.places import SHARED

YCB = SHARED / "objects" / "ycb"
PIECES = {"banana": 6, "cracker_box": 1, "hammer": 9, "master_chef_can": 1, "mustard_bottle": 4}
QUADS = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def obj(path: Path, *boxes: tuple[list[float], list[float]], faces: int = 6) -> Path:
    """An OBJ file of boxes (lower corner, upper corner); `faces` < 6 leaves them open."""
    lines = []
    for n, (low, high) in enumerate(boxes):
        lines.append(f"o box{n}")
        corners = [[(low, high)[(k >> (2 - i)) & 1][i] for i in range(3)] for k in range(8)]
        lines += ["v " + " ".join(map(str, c)) for c in corners]
        lines += ["f " + " ".join(str(8 * n + i + 1) for i in q) for q in QUADS[:faces]]
    path.write_text("\n".join(lines) + "\n")
    return path


def ell(path: Path) -> Path:
    """A solid L: a 3 x 3 square less a 2 x 2 corner, 1 high, as one mesh."""
    outline = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
    lines = [f"v {x} {y} {z}" for z in (0, 1) for x, y in outline]
    top = [(0, 1, 2, 3), (0, 3, 4, 5)]
    lines += ["f " + " ".join(str(7 + i) for i in f) for f in top]
    lines += ["f " + " ".join(str(1 + i) for i in reversed(f)) for f in top]
    lines += [f"f {i + 1} {(i + 1) % 6 + 1} {(i + 1) % 6 + 7} {i + 7}" for i in range(6)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_box_is_one_piece_with_its_centre_of_mass(tmp_path: Path) -> None:
    body = load_body(obj(tmp_path / "b.obj", ([0, 0, 0], [20, 40, 60])), mass=0.5, scale=0.001)
    assert len(body.pieces) == 1
    assert body.pieces[0].volume == pytest.approx(0.02 * 0.04 * 0.06)
    np.testing.assert_allclose(body.center_of_mass, [0.01, 0.02, 0.03], atol=1e-12)
    assert body.name == "b"
    assert body.friction == 0.5
    np.testing.assert_allclose(np.ptp(body.vertices, axis=0), [0.02, 0.04, 0.06])


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No test finds pieces that another one, or the user, has kept."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "cache"))


def test_weight_acts_at_the_centre_of_mass(tmp_path: Path) -> None:
    body = load_body(obj(tmp_path / "b.obj", ([0, 0, 0], [2, 4, 6])), mass=2.0)
    w = body.gravity_wrench([0, 0, -3], g=10)
    np.testing.assert_allclose(w, [0, 0, -20, -40, 20, 0])  # (1, 2, 3) x (0, 0, -20)
    with pytest.raises(InputError, match=r"b: mass: is unknown; give the object a mass"):
        load_body(tmp_path / "b.obj").gravity_wrench([0, 0, -1])
    with pytest.raises(InputError, match=r"direction: is zero"):
        body.gravity_wrench([0, 0, 0])


def test_convex_parts_stay_as_they_are(tmp_path: Path) -> None:
    parts = ([0, 0, 0], [1, 1, 1]), ([1, 0, 0], [4, 1, 1])  # they share four corners
    body = load_body(obj(tmp_path / "b.obj", *parts))
    assert sorted(p.volume for p in body.pieces) == pytest.approx([1, 3])
    np.testing.assert_allclose(body.center_of_mass, [2, 0.5, 0.5])


def test_an_inner_surface_makes_a_hollow_solid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def decompose(vertices: np.ndarray, faces: np.ndarray) -> list[np.ndarray]:
        seen.append((len(vertices), len(faces)))
        return [vertices]

    monkeypatch.setattr("handfast.model.mesh_pieces.decompose", decompose)
    inside_out = ([2, 2, 2], [1, 1, 1])  # corners exchanged: three mirrors turn the winding round
    load_body(obj(tmp_path / "b.obj", ([0, 0, 0], [3, 3, 3]), inside_out))
    assert seen == [(16, 24)]  # both surfaces together, not one solid in another


def test_open_convex_part_is_its_hull(tmp_path: Path) -> None:
    body = load_body(obj(tmp_path / "b.obj", ([0, 0, 0], [1, 1, 1]), faces=5))
    assert [p.volume for p in body.pieces] == pytest.approx([1])


def ell_mesh(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of the solid L, 3 cm wide."""
    ((vertices, faces),) = read_mesh(ell(path / "ell.obj"))
    return vertices / 100, faces


@pytest.fixture
def told(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch) -> pytest.LogCaptureFixture:
    """Warnings; solids that are not convex are their hulls."""
    monkeypatch.setattr("handfast.model.mesh_pieces.decompose", lambda vertices, faces: [vertices])
    return caplog


def test_what_is_inside_out_is_turned_round(tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    vertices, faces = ell_mesh(tmp_path)
    pieces = solid_of([(vertices, faces[:, ::-1])], "ell.obj").pieces
    assert told.messages == ["ell.obj: is turned inside out; its triangles are taken the other way round"]
    assert pieces[0].volume == pytest.approx(7e-6)  # of the hull
    told.clear()
    solid_of([(vertices, faces)], "ell.obj")
    assert told.messages == []


def test_the_centre_of_mass_of_a_closed_surface_is_its_own(tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    """Whatever its pieces are: of the L's 5 squares (3 x 1 about (1.5, 0.5), 1 x 2 about (0.5, 2)) it is (1.1, 1.1)."""
    file = ell(tmp_path / "ell.obj")
    np.testing.assert_allclose(load_body(file, scale=0.01).center_of_mass, [0.011, 0.011, 0.005], atol=1e-12)
    vertices, faces = ell_mesh(tmp_path)
    of_mesh = Body.from_mesh(SimpleNamespace(vertices=vertices, faces=faces[:, ::-1]))  # inside out  # type: ignore[arg-type]
    np.testing.assert_allclose(of_mesh.center_of_mass, [0.011, 0.011, 0.005], atol=1e-12)
    solid = solid_of(
        [(vertices, faces)], "ell.obj", 2.0, transform([1, 2, 3], np.diag([-1, -1, 1]))
    )  # half a turn about z
    np.testing.assert_allclose(solid.center, [1 - 0.022, 2 - 0.022, 3.01], atol=1e-12)
    assert solid.volume == pytest.approx(4e-5)
    given = load_body(file, scale=0.01, center_of_mass=[0, 0, 0.001])
    np.testing.assert_array_equal(given.center_of_mass, [0, 0, 0.001])


def test_of_several_shapes_each_counts_with_its_volume(tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    """The L, 5 cm^3, and a box of 5 cm^3 at (5, 0, 0) cm; a file that states the centre is believed."""
    ell(tmp_path / "ell.obj")
    box = {"box": {"size": [0.01, 0.05, 0.01]}, "pose": {"position": [0.05, 0, 0]}}
    data = {"schema": "handfast/body/1", "shapes": [{"mesh": {"file": "ell.obj", "scale": 0.01}}, box]}
    (tmp_path / "two.json").write_text(json.dumps(data))
    np.testing.assert_allclose(load_body(tmp_path / "two.json").center_of_mass, [0.0305, 0.0055, 0.0025], atol=1e-12)
    (tmp_path / "two.json").write_text(json.dumps(data | {"center_of_mass": [0, 0, 1]}))
    np.testing.assert_array_equal(load_body(tmp_path / "two.json").center_of_mass, [0, 0, 1])


@pytest.mark.parametrize("turned", [[0], [1, 4, 5, 11], [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]])
def test_triangles_that_are_wound_otherwise_are_turned_round(
    turned: list[int], tmp_path: Path, told: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As CoACD comes to no end with them; what most do counts, then a solid inside out is turned."""
    vertices, faces = ell_mesh(tmp_path)
    seen: list[np.ndarray] = []
    monkeypatch.setattr("handfast.model.mesh_pieces.decompose", lambda v, f: [seen.append(f), v][1:])
    mixed = faces.copy()
    mixed[turned] = mixed[turned][:, ::-1]
    solid_of([(vertices, mixed)], "ell.obj")
    few = min(len(turned), len(faces) - len(turned))
    assert told.messages[0] == f"ell.obj: {few} of 20 triangles are wound otherwise than the others; turned round"
    assert volume_and_centroid(vertices, seen[0])[0] == pytest.approx(5e-6)
    assert {frozenset(map(int, f)) for f in seen[0]} == {frozenset(map(int, f)) for f in faces}
    assert not _shared_edges(seen[0])[2].any()


def test_a_surface_with_one_side_is_refused(tmp_path: Path) -> None:
    """Klein's bottle is closed, and no solid."""
    n = 8
    at = np.arange(n * n).reshape(n, n)
    rows = []
    for i in range(n):
        for j in range(n):
            right = [(i, j), (i, (j + 1) % n)]
            next_row = [((i + 1) % n, (-y) % n if i == n - 1 else y) for _, y in right]
            a, b, c, d = (at[p] for p in (*right, *next_row))
            rows += [(a, b, c), (b, d, c)]
    angle = 2 * np.pi * np.arange(n) / n
    vertices = np.array(
        [[np.cos(u) * (2 + np.cos(v)), np.sin(u) * (2 + np.cos(v)), np.sin(v)] for u in angle for v in angle]
    )
    with pytest.raises(InputError, match="has a surface with one side"):
        solid_of([(0.01 * vertices, np.array(rows))], "bottle.obj")


def top_and_rest(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of the L-shaped top, and all others."""
    top = (vertices[faces][:, :, 2] > 0.009).all(axis=1)
    return faces[top], faces[~top]


def test_holes_are_closed_where_that_is_a_mend_and_else_refused(
    tmp_path: Path, told: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    vertices, faces = ell_mesh(tmp_path)
    seen: list[tuple[np.ndarray, np.ndarray]] = []
    monkeypatch.setattr("handfast.model.mesh_pieces.decompose", lambda v, f: [seen.append((v, f)), v][1:])
    top, rest = top_and_rest(vertices, faces)
    solid_of([(vertices, rest)], "ell.obj")  # one flat hole, of six corners
    assert told.messages == ["ell.obj: is open; 6 triangles close its holes"]
    assert open_edges(rest)
    ((v, f),) = seen
    assert not open_edges(f)
    assert volume_and_centroid(v, f)[0] == pytest.approx(5e-6)
    wall = (vertices[rest][:, :, 0] < 1e-9).all(axis=1)  # beside the top: the hole goes round an edge
    problem = (
        r"^is open: 8 of its edges belong to one triangle alone, the first near \(.*\) m; what is not convex needs"
    )
    with pytest.raises(InputError, match=problem):
        solid_of([(vertices, rest[~wall])], "ell.obj")
    assert len(seen) == 1
    assert len(top) == 4


def test_a_crack_is_closed_whatever_its_shape(tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    vertices, faces = ell_mesh(tmp_path)
    torn = np.vstack([vertices, vertices[faces[0, :1]] + 1e-9])
    faces = faces.copy()
    faces[0, 0] = len(vertices)  # one corner of one triangle is a hair off
    solid_of([(torn, faces)], "ell.obj")
    assert told.messages == ["ell.obj: is open; 4 triangles close its holes"]


def test_sizes_pieces_and_long_work_are_told(
    tmp_path: Path, told: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    load_body(obj(tmp_path / "b.obj", ([0, 0, 0], [20, 40, 60])))
    assert told.messages == ["b.obj: is 60 m long; a mesh in millimetres needs the scale 0.001"]
    told.clear()
    monkeypatch.setattr("handfast.model.mesh_pieces.MAX_PIECES", 1)
    load_body(obj(tmp_path / "b.obj", ([0, 0, 0], [1, 1, 1]), ([2, 0, 0], [3, 1, 1])))
    assert told.messages == ["b.obj: has 2 convex pieces, each of which is compared with each solid of a hand"]
    told.clear()
    monkeypatch.setattr("handfast.model.mesh_pieces.RATE", 2.0)
    solid_of([ell_mesh(tmp_path)], "ell.obj")
    (message,) = told.messages
    assert message.startswith("ell.obj: is not convex; to take 20 triangles apart takes about 12 s of processor time,")


def test_a_solid_is_taken_apart_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []
    monkeypatch.setattr("handfast.model.mesh_pieces.decompose", lambda v, f: [seen.append(len(f)), v, v + 1][1:])
    first = load_body(ell(tmp_path / "ell.obj")).pieces
    again = load_body(tmp_path / "ell.obj").pieces
    assert seen == [20]
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.vertices, b.vertices)
    load_body(tmp_path / "ell.obj", scale=2.0)
    assert seen == [20, 20]  # another surface


def scrambled(path: Path) -> Path:
    """A box whose faces name other corners than they should: closed, and cutting itself all over."""
    corners = [(-1, -2, -3), (-1, -2, 3), (1, 2, -3), (-1, 2, -3), (-1, 2, 3), (1, -2, -3), (1, -2, 3), (1, 2, 3)]
    faces = ["2 4 1", "5 2 1", "1 4 3", "3 5 1", "2 8 4", "6 2 5", "6 8 2", "4 8 3", "7 5 3", "3 8 7", "7 6 5", "8 6 7"]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {f}" for f in faces]
    path.write_text("\n".join(lines))
    return path


def test_a_surface_that_cuts_itself_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("handfast.model.mesh_pieces.COACD_SECONDS", 1)
    told = r"b\.obj: cannot be taken apart into convex pieces; .* \(CoACD (takes more than|is not done after)"
    with pytest.raises(InputError, match=told):
        load_body(scrambled(tmp_path / "b.obj"), scale=0.05)


def test_a_library_that_dies_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.executable", shutil.which("false"))
    with pytest.raises(InputError, match=r"ell\.obj: cannot be taken apart into convex pieces"):
        load_body(ell(tmp_path / "ell.obj"))


def test_a_solid_that_is_not_convex_is_decomposed_the_same_way_twice(tmp_path: Path) -> None:
    first, second = (load_body(ell(tmp_path / "l.obj"), scale=0.01) for _ in range(2))
    assert len(first.pieces) >= 2
    assert sum(p.volume for p in first.pieces) == pytest.approx(5e-6, rel=0.05)
    np.testing.assert_allclose(first.center_of_mass, [0.011, 0.011, 0.005], atol=3e-4)
    corner = np.array([[0.025, 0.025, 0.005]])
    assert all(p.depth(corner)[0] < 0 for p in first.pieces)  # the hollow is hollow
    for a, b in zip(first.pieces, second.pieces, strict=True):
        np.testing.assert_array_equal(a.vertices, b.vertices)


def test_stl_ply_off_hold_the_same_solid(tmp_path: Path) -> None:
    import trimesh

    mesh = trimesh.creation.box((0.1, 0.2, 0.3))
    for kind in ("stl", "ply", "off"):
        mesh.export(tmp_path / f"b.{kind}")
        body = load_body(tmp_path / f"b.{kind}")
        assert [p.volume for p in body.pieces] == pytest.approx([0.006], rel=1e-5)


def test_body_file(tmp_path: Path) -> None:
    obj(tmp_path / "m.obj", ([0, 0, 0], [1, 1, 1]))
    half = np.sqrt(0.5)
    turned = {"position": [0.1, 0, 0], "quaternion": [half, 0, 0, half]}
    data = {
        "schema": "handfast/body/1",
        "name": "thing",
        "mass": 0.4,
        "friction": 0.7,
        "shapes": [
            {"box": {"size": [0.1, 0.2, 0.3]}, "pose": turned},
            {"sphere": {"radius": 0.1}},
            {"capsule": {"radius": 0.1, "length": 0.2}},
            {"cylinder": {"radius": 0.1, "length": 0.2}},
            {"ellipsoid": {"semi_axes": [0.1, 0.2, 0.3]}},
            {"mesh": {"file": "m.obj", "scale": 0.1}},
        ],
    }
    path = tmp_path / "thing.json"
    path.write_text(json.dumps(data))
    body = load_body(path)
    assert [p.kind for p in body.pieces] == ["box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh"]
    assert (body.mass, body.friction, body.name) == (0.4, 0.7, "thing")
    np.testing.assert_allclose(body.pieces[0].triangles()[0].max(axis=0), [0.2, 0.05, 0.15], atol=1e-12)
    assert body.pieces[-1].volume == pytest.approx(1e-3)
    assert load_body(path, mass=1.0, friction=0.1).friction == 0.1
    path.write_text(json.dumps({"schema": "handfast/body/1", "mesh": "m.obj", "center_of_mass": [0, 0, 1]}))
    np.testing.assert_array_equal(load_body(path).center_of_mass, [0, 0, 1])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"shapes": [{"box": {"size": [1, 1, 1]}}], "colour": "red"}, r"b.json: colour: is not a known field"),
        ({"shapes": [{"box": {"size": [1, 1, 0]}}]}, r"shapes\[0\].box.size\[2\]: input should be greater than 0"),
        (
            {"shapes": [{"box": {"size": [1, 1, 1]}, "sphere": {"radius": 1}}]},
            r"shapes\[0\]: exactly one of box",
        ),
        ({"shapes": []}, r"either shapes or a mesh is needed"),
        ({"shapes": [{"sphere": {"radius": 1}}], "mass": -1}, r"mass: input should be greater than or equal"),
        ({"mesh": "gone.obj"}, r"shapes.0: mesh 'gone.obj' was not found"),
        (
            {"shapes": [{"sphere": {"radius": 1}, "pose": {"quaternion": [1, 1, 0, 0]}}]},
            r"shapes\[0\].pose: quaternion has length 1.414; a unit quaternion",
        ),
    ],
)
def test_body_file_refusals(tmp_path: Path, data: dict, message: str) -> None:
    path = tmp_path / "b.json"
    path.write_text(json.dumps({"schema": "handfast/body/1", **data}))
    with pytest.raises(InputError, match=message) as caught:
        load_body(path)
    assert "\n" not in str(caught.value)


def test_refusals(tmp_path: Path) -> None:
    good = obj(tmp_path / "b.obj", ([0, 0, 0], [1, 1, 1]))
    with pytest.raises(InputError, match=r"gone.obj: no such file"):
        load_body(tmp_path / "gone.obj")
    with pytest.raises(InputError, match=r"b.obj: mass: is -1; a mass is 0 or more"):
        load_body(good, mass=-1)
    with pytest.raises(InputError, match=r"b.obj: friction: is -0.1; a friction coefficient is 0 or more"):
        load_body(good, friction=-0.1)
    with pytest.raises(InputError, match=r"b.obj: scale: is 0; metres per unit"):
        load_body(good, scale=0)
    (tmp_path / "points.obj").write_text("v 0 0 0\nv 1 0 0\n")
    with pytest.raises(InputError, match=r"points.obj: .*(no triangles|cannot be read)"):
        load_body(tmp_path / "points.obj")
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n")
    with pytest.raises(InputError, match=r"flat.obj: .*is flat; a solid is needed"):
        load_body(tmp_path / "flat.obj")
    (tmp_path / "nan.obj").write_text(good.read_text().replace("v 0 0 0", "v nan 0 0", 1))
    with pytest.raises(InputError, match=r"nan.obj: has a vertex that is NaN or infinite"):
        load_body(tmp_path / "nan.obj")
    (tmp_path / "x.txt").write_text("hello")
    with pytest.raises(InputError, match=r"x.txt: is not valid JSON"):
        load_body(tmp_path / "x.txt")
    with pytest.raises(InputError, match=r"pieces: has no solids"):
        Body.of([])


def test_shape_volumes_and_depths_agree() -> None:
    rng = np.random.default_rng(0)
    pose = transform([0.1, -0.2, 0.3], np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]))
    for shape in (
        Shape("box", (0.2, 0.3, 0.4), pose),
        Shape("sphere", 0.2, pose),
        Shape("capsule", (0.1, 0.3), pose),
        Shape("cylinder", (0.1, 0.3), pose),
        Shape("ellipsoid", (0.1, 0.2, 0.3), pose),
    ):
        cube = rng.uniform(-0.35, 0.35, (40_000, 3)) + pose[:3, 3]
        share = (shape.depth(cube) > 0).mean() * 0.7**3
        assert share == pytest.approx(shape.volume, rel=0.06)
        drawn = Shape.hull(shape.triangles()[0])
        assert drawn.volume == pytest.approx(shape.volume, rel=0.06)
        np.testing.assert_allclose(drawn.centroid, shape.centroid, atol=1e-6)


@pytest.mark.skipif(not YCB.is_dir(), reason="needs ../shared")
@pytest.mark.parametrize("name", PIECES)
def test_ycb_pieces(name: str) -> None:
    body = load_body(YCB / f"{name}.obj")
    assert len(body.pieces) == PIECES[name]
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    assert (body.center_of_mass > low).all()
    assert (body.center_of_mass < high).all()


# --- body files that say of an object what a command line said ----------------------------------------------


@pytest.mark.parametrize("name", ["flask", "mug"])  # one of a mesh, one of shapes
def test_a_copy_elsewhere_is_the_same_object_with_another_mass(tmp_path: Path, name: str) -> None:
    save_body_copy(name, tmp_path / "deep" / "copy.json", mass=2.0)
    old, new = load_body(name), load_body(tmp_path / "deep" / "copy.json")
    assert (new.mass, new.friction, new.name) == (2.0, old.friction, old.name)
    assert np.allclose(new.vertices, old.vertices)
    assert np.allclose(new.center_of_mass, old.center_of_mass)
    with pytest.raises(InputError, match="exists already"):
        save_body_copy(name, tmp_path / "deep" / "copy.json")


def test_other_kinds_of_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"thing\.sdf: is neither a mesh nor a body file"):
        save_body_copy(tmp_path / "thing.sdf", tmp_path / "copy.json")
