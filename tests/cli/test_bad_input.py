"""Files that no honest program writes: one line says what is wrong, whatever they hold."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import load_body, load_configuration, load_grasp, load_hand, load_task
from handfast.core import bundled
from handfast.core.errors import InputError
from handfast.core.files import parse_json
from handfast.core.transforms import MAX_COORDINATE, transform
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.model.shape import MIN_SOLID_SIZE, Shape
from handfast.proofs.constants import MAX_GRASP_SIZE
from handfast.proofs.strict_json import MAX_INTEGER_DIGITS, MAX_JSON_DEPTH
from handfast.readers.grasp_file import from_dict
from handfast.readers.region_file import load_hand_regions
from handfast.saved import verify
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.loads import load_loads
from handfast.stability.problem.objective import GOALS, SMALLEST_LARGEST_COMMAND, SMALLEST_SUM_OF_COMMANDS
from handfast.stability.search import rows
from handfast.stability.search.reduced import reduce

LOADERS = {
    "grasp": load_grasp,
    "configuration": load_configuration,
    "body": load_body,
    "task": load_task,
    "hand-regions": load_hand_regions,
    "loads": load_loads,
    "result": verify,
}


def written(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


# --- JSON ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", LOADERS)
@pytest.mark.parametrize(
    "text, fault",
    [
        ("[" * 100_000 + "]" * 100_000, "nested too deeply; at most 50"),
        ('{"a":' * 100_000, "nested too deeply; at most 50"),
        ('{"schema": ' + "9" * 5000 + "}", "a number of 5000 digits; at most 50"),
        ('{"schema": 1e999}', "contains 1e999; numbers up to 1e"),
        ('{"schema": -2e50}', r"contains -2e50; numbers up to 1e\+50"),
        ('{"schema": -Infinity}', "contains -Infinity; finite numbers"),
        ('{"schema": "a", "schema": "b"}', "has 'schema' 2 times in one object"),
        ('{"schema": "\\ud800"}', "half a character"),
    ],
)
def test_what_no_json_file_may_hold(tmp_path: Path, kind: str, text: str, fault: str) -> None:
    path = written(tmp_path / "bad.json", text)
    with pytest.raises(InputError, match=fault) as raised:
        LOADERS[kind](path)
    assert "\n" not in str(raised.value)
    assert str(raised.value).startswith(str(path))


def test_what_json_files_may_just_hold() -> None:
    assert parse_json("[" * MAX_JSON_DEPTH + "]" * MAX_JSON_DEPTH)
    assert parse_json("9" * MAX_INTEGER_DIGITS) == 10**MAX_INTEGER_DIGITS - 1
    assert parse_json('"\\ud83d\\ude00"') == "\U0001f600"
    with pytest.raises(InputError, match="nested too deeply"):
        parse_json("[" * (MAX_JSON_DEPTH + 1) + "]" * (MAX_JSON_DEPTH + 1))
    with pytest.raises(InputError, match="nested too deeply"):
        parse_json('{"a": [1, ' + "[" * (MAX_JSON_DEPTH - 1) + "]" * (MAX_JSON_DEPTH - 1) + "]}")
    with pytest.raises(InputError, match=f"a number of {MAX_INTEGER_DIGITS + 1} digits"):
        parse_json("9" * (MAX_INTEGER_DIGITS + 1))


def test_a_path_that_no_file_can_have() -> None:
    with pytest.raises(InputError, match="is no name of a file"):
        load_loads("a\0b.json")


@pytest.mark.parametrize("name", ["a" * 5000, "a" * 300 + ".json", "\0", "x\0.json", "\ud800", "**", "[a-"])
def test_names_that_no_file_can_have(tmp_path: Path, name: str) -> None:
    for load in (*LOADERS.values(), load_hand):
        with pytest.raises(InputError):
            load(name)
    for kind, bundled_name, keys in (
        ("tasks", "scalpel-upholding", ["hand", "object"]),
        ("hand_regions", "schunk-sah", ["hand"]),
        ("objects", "flask", ["mesh"]),
    ):
        for key in keys:
            data = changed(bundled.read(kind, bundled_name), (key,), name)
            with pytest.raises(InputError):
                LOADS[kind](written(tmp_path / "bad.json", json.dumps(data)))


def changed(data: Any, at: tuple[Any, ...], value: object) -> Any:
    out = json.loads(json.dumps(data))
    inner = out
    for key in at[:-1]:
        inner = inner[key]
    assert at[-1] in inner or isinstance(inner, list)
    inner[at[-1]] = value
    return out


NUMBERS = [  # kind, bundled name, where a number stands
    ("grasps", "fig1", ("contacts", 0, "friction")),
    ("grasps", "fig1", ("contacts", 1, "position", 2)),
    ("grasps", "fig1", ("joints", 0, "moves", 0)),
    ("grasps", "fig1", ("preload", "finger_1_prox")),
    ("configurations", "fig1", ("object_pose", "position", 0)),
    ("configurations", "fig1", ("joints", "finger_1_prox")),
    ("objects", "block", ("mass",)),
    ("objects", "block", ("shapes", 0, "box", "size", 0)),
    ("tasks", "scalpel-upholding", ("contacts", 0, "hand", "region", "cap", "radius")),
    ("hand_regions", "schunk-sah", ("regions", "thumb_tip", "region", "cap", "radius")),
]
LOADS = {"grasps": load_grasp, "configurations": load_configuration, "objects": load_body, "tasks": load_task}
LOADS["hand_regions"] = load_hand_regions


@pytest.mark.parametrize("kind, name, at", NUMBERS)
@pytest.mark.parametrize("value", ["0.5", True, None, [1]])
def test_only_numbers_are_numbers(tmp_path: Path, kind: str, name: str, at: tuple[Any, ...], value: object) -> None:
    data = bundled.read(kind, name)
    LOADS[kind](written(tmp_path / "good.json", json.dumps(data)))
    bad = written(tmp_path / "bad.json", json.dumps(changed(data, at, value)))
    if at == ("mass",) and value is None:  # may be unknown
        return
    with pytest.raises(InputError, match=r"should be a valid (number|integer)"):
        LOADS[kind](bad)


def test_whole_numbers_are_numbers_and_numbers_are_no_truth() -> None:
    data = bundled.read("grasps", "fig1")
    assert from_dict(changed(data, ("contacts", 0, "friction"), 1)).contacts[0].friction == 1.0
    with pytest.raises(InputError, match=r"actuators\[0\].tendon: input should be a valid boolean"):
        from_dict(changed(data, ("mechanism", "actuators", 0), {"name": "a", "joints": {}, "tendon": 1}))
    with pytest.raises(InputError, match=r"moves\[0\]: input should be a valid integer"):
        from_dict(changed(data, ("joints", 0, "moves", 0), 0.0))


# --- sizes --------------------------------------------------------------------------------------

CONTACT = {"position": [0, 0, 1], "normal": [0, 0, -1], "friction": 0.5}


def test_ten_thousand_contacts_are_refused_with_the_limit() -> None:
    with pytest.raises(InputError, match=f"^contacts: has 10000 entries; at most {MAX_GRASP_SIZE} are possible$"):
        from_dict({"schema": "handfast/grasp/1", "contacts": 10_000 * [CONTACT]})
    many = MAX_GRASP_SIZE // 3 + 1
    with pytest.raises(InputError, match=f"has {many} contacts, 0 joints and 0 actuators, too many to search.* 249 at"):
        from_dict({"schema": "handfast/grasp/1", "contacts": many * [CONTACT]})


def of_size(m: int, l: int, a: int) -> Grasp:
    rng = np.random.default_rng([m, l, a])
    points = rng.normal(size=(m, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    contacts = [Contact(p, -p, 0.5) for p in points]
    joints = [GraspJoint(f"j{j}", np.eye(3)[j % 3], rng.normal(size=3), (int(rng.integers(m)),)) for j in range(l)]
    names = tuple(f"a{i}" for i in range(a))
    mechanism = Mechanism(names, rng.normal(size=(a, l)), np.zeros((0, l)), (False,) * a)
    return Grasp(contacts, joints, mechanism, dict.fromkeys(names, 0.1))


@pytest.mark.parametrize("sizes", [(83, 0, 0), (1, 82, 82), (1, 246, 0), (1, 2, 122), (40, 43, 43)])
def test_the_largest_grasp_is_one_that_the_search_can_name_by_a_byte(sizes: tuple[int, int, int]) -> None:
    """Of unknowns and of bounded values, with every limit there is."""
    grasp, byte = of_size(*sizes), 1 << (rows.KIND_SHIFT - rows.INDEX)
    assert byte == 256
    limits = GraspLimits(0.0, dict.fromkeys(grasp.mechanism.actuators, 1.0), 10.0)
    for goal in GOALS:
        torques = goal in (SMALLEST_LARGEST_COMMAND, SMALLEST_SUM_OF_COMMANDS)
        driven = np.ones(sizes[2], dtype=bool) if torques else None
        p = scaled_problem.build(grasp, np.zeros(6), grasp.G[:, 0], driven=driven, limits=limits)
        r = reduce(p, goal)
        assert len(r.cost) <= byte
        assert len(r.lo) <= byte
    m, l, a = sizes
    with pytest.raises(InputError, match="too many to search"):
        of_size(m + 1, l, a)


def test_names_that_would_break_the_line() -> None:
    data = bundled.read("grasps", "fig1")
    with pytest.raises(InputError, match=r"unknown actuator 'a\\nb\\x1b\[31mc'; known: finger_1") as raised:
        from_dict(changed(data, ("preload",), {"a\nb\x1b[31mc": 1.0}))
    assert str(raised.value).isprintable()


def test_couplings_and_gears_of_nothing() -> None:
    data = bundled.read("grasps", "fig1-coupled")
    for row in ({}, {"finger_1_prox": 0.0}, {"finger_1_prox": 1e-200}):
        with pytest.raises(InputError, match=r"mechanism\.couplings\[0\]: ties no joint"):
            from_dict(changed(data, ("mechanism", "couplings", 0), row))
        with pytest.raises(InputError, match="moves no joint"):
            from_dict(changed(data, ("mechanism", "actuators", 0, "joints"), row))


# --- meshes -------------------------------------------------------------------------------------

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 0 3 2
3 1 2 3
"""
STL = b"\0" * 80 + struct.pack("<I", 1) + struct.pack("<12fH", *[0.0] * 3, *[0.0] * 3, 1, 0, 0, 0, 1, 0, 0)

MESHES = {
    "encoding": ("a.obj", b"\xff\xfe\x00v 0 0 0\nf 1 1 1\n", "cannot be read as a mesh|has no triangles"),
    "index": ("a.obj", TETRAHEDRON + "f 1 2 9\n", "cannot be read as a mesh|corner that is none"),
    "ply index": ("a.ply", PLY.replace("3 1 2 3", "3 1 2 30"), "a triangle with a corner that is none of its 4"),
    "ply negative": ("a.ply", PLY.replace("3 1 2 3", "3 1 2 -3"), "a triangle with a corner that is none of its 4"),
    "plane": ("a.obj", "v 0 0\nv 1 0\nv 0 1\nv 1 1\nf 1 2 3\nf 2 3 4\n", "cannot be read as a mesh|of 2 coordinates"),
    "no face": ("a.obj", "v 0 0 0\nv 1 0 0\n", "has no triangles"),
    "ply no face": ("a.ply", PLY.replace("face 4", "face 0").split("3 0 2")[0], "no triangles|cannot be read as a m"),
    "flat": ("a.stl", STL, "is flat"),
    "cut short": ("a.stl", STL[:100], "has no triangles"),
    "huge": ("a.obj", TETRAHEDRON.replace("0 0 1", "0 0 1e200"), r"has a vertex at 1e\+200 m; at most 1e\+06 m"),
    "too huge": ("a.obj", TETRAHEDRON.replace("0 0 1", "0 0 1e999"), "NaN or infinite"),
    "tiny": ("a.obj", TETRAHEDRON.replace("1\n", "1e-12\n").replace("1 0", "0 0"), "is smaller than 1e-09 m|is flat"),
    "empty": ("a.ply", "", "cannot be read as a mesh"),
}


@pytest.mark.parametrize("name", MESHES)
def test_meshes_that_are_none(tmp_path: Path, name: str) -> None:
    file, data, fault = MESHES[name]
    path = written(tmp_path / file, data)
    with pytest.raises(InputError, match=fault) as raised:
        load_body(path)
    assert str(path) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_meshes_that_are_some(tmp_path: Path) -> None:
    for file, data in (("a.obj", TETRAHEDRON), ("a.ply", PLY)):
        assert load_body(written(tmp_path / file, data)).pieces[0].volume == pytest.approx(1 / 6)


def test_a_scale_that_leaves_nothing(tmp_path: Path) -> None:
    path = written(tmp_path / "a.obj", TETRAHEDRON)
    with pytest.raises(InputError, match="smaller than 1e-09 m; is its scale right"):
        load_body(path, scale=1e-12)
    with pytest.raises(InputError, match="at most 1e"):
        load_body(path, scale=1e200)


@pytest.mark.parametrize("size", [MIN_SOLID_SIZE / 2, 1e-200, 2 * MAX_COORDINATE, 1e200])
def test_solids_of_no_size(size: float) -> None:
    with pytest.raises(InputError, match=r"sphere\.size: is .*; sizes are 1e-09 to 1e"):
        Shape("sphere", size)
    with pytest.raises(InputError, match=r"box\.size"):
        Shape("box", (0.1, 0.1, size))


def test_solids_of_nowhere() -> None:
    assert Shape("sphere", 1.0, transform((MAX_COORDINATE, 0, 0)))
    with pytest.raises(InputError, match="more than 1e"):
        Shape("sphere", 1.0, transform((0, -1e7, 0)))
    with pytest.raises(InputError, match="is not a rigid motion"):
        Shape("sphere", 1.0, 1e200 * np.eye(4))
