"""The 3-D view: the geometry and the forces are in the page, nothing is fetched, nothing breaks out of it."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from handfast.core.answer import Stop, Verdict
from handfast.model.grasp import Contact, Grasp
from handfast.pictures import Entry, view3d, write_report
from handfast.pictures.scene import DrawnScene, Mesh, ShownGrasp, ShownLoad, applied, arrows
from handfast.pictures.view3d import packed, scene_json
from handfast.stability.answers.check_query import CheckAnswer
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check
from tests.support.driven_page import drive
from tests.support.problems import bell, nest, pinch

QUICK = Settings(gap=0.02)
EVIL = "tip</script><script>alert(1)</script><!--"


def lattice(n: int, kind: Any, shift: float = 0.0) -> Mesh:
    """A sheet of 2 n^2 triangles, every triangle with corners of its own."""
    x, y = np.meshgrid(np.linspace(-0.1, 0.1, n + 1), np.linspace(-0.1, 0.1, n + 1))
    p = np.column_stack([x.ravel(), y.ravel(), shift + 0.02 * np.sin(40 * x.ravel())])
    a = np.add.outer((n + 1) * np.arange(n), np.arange(n)).ravel()
    faces = np.vstack([np.column_stack([a, a + 1, a + n + 2]), np.column_stack([a, a + n + 2, a + n + 1])])
    return Mesh(p[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3), kind)


def embedded(text: str) -> dict[str, Any]:
    """The scene that a page carries."""
    found = re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)
    assert len(found) == 1
    return json.loads(found[0])


def decoded(solid: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a packed solid."""
    v = np.frombuffer(base64.b64decode(solid["vertices"]), "<f4").reshape(-1, 3)
    return v, np.frombuffer(base64.b64decode(solid["faces"]), "<u4" if solid["wide"] else "<u2").reshape(-1, 3)


@pytest.fixture(scope="module")
def entries() -> list[Entry]:
    """Five loads on the bell's grasp: four hold, one slips."""
    loads = {"up": [0, 2.2, 0, 0, 0, 0], "too much": [0, 2.5, 0, 0, 0, 0], "down": [0, -5, 0, 0, 0, 0]}
    loads |= {"right": [1, 0, 0, 0, 0, 0], "left & <b>": [-1, 0, 0, 0, 0, 0]}
    return [Entry(name, check(bell(), w, settings=QUICK)) for name, w in loads.items()]


@pytest.mark.parametrize(("n", "wide"), [(20, False), (256, True)])
def test_a_packed_solid_is_the_meshes(n: int, wide: bool) -> None:
    meshes = [lattice(n, "hand"), lattice(3, "hand", shift=0.5)]
    solid = packed(meshes)
    assert solid["wide"] is wide
    v, f = decoded(solid)
    assert len(v) == (n + 1) ** 2 + 16  # shared corners are merged
    assert len(f) == sum(len(m.faces) for m in meshes)
    corners = np.vstack([m.vertices[m.faces] for m in meshes])
    np.testing.assert_allclose(v[f], corners, atol=1e-8)


@pytest.mark.slow
def test_the_page_carries_the_solids_and_every_load(entries: list[Entry], tmp_path: Path) -> None:
    meshes = [lattice(10, "object"), lattice(4, "hand", 0.1), lattice(5, "hand", 0.2)]
    write_report(tmp_path / "a.html", bell(), entries, meshes=meshes)
    data = embedded((tmp_path / "a.html").read_text("utf-8"))
    for kind, faces in (("object", 200), ("hand", 82)):
        [solid] = [s["solid"] for s in data["solids"] if s["kind"] == kind]
        v, f = decoded(solid)
        assert len(f) == faces
        points = np.vstack([m.vertices for m in meshes if m.kind == kind])
        np.testing.assert_allclose([v.min(0), v.max(0)], [points.min(0), points.max(0)], atol=1e-7)
    everything = np.vstack([m.vertices for m in meshes])
    assert (np.array(data["box"][0]) <= everything.min(0) + 1e-6).all()
    assert (np.array(data["box"][1]) >= everything.max(0) - 1e-6).all()
    [seen] = data["grasps"]
    assert [load["title"] for load in seen["loads"]] == [e.title for e in entries]
    for load, entry in zip(seen["loads"], entries, strict=True):
        assert load["said"].startswith(entry.answer.verdict.upper())
        witness, forces = entry.answer.witness, [a for a in load["arrows"] if a["kind"] == "forces"]
        [disturbance] = [a["step"] for a in load["arrows"] if a["kind"] == "disturbance"]
        if witness is None:
            assert not forces
            assert load["wrench"] == [0, 2.5, 0, 0, 0, 0]  # the load that slips is still shown
            continue
        steps, most = np.array([a["step"] for a in forces]), np.linalg.norm(witness.forces, axis=1).max()
        scale = 0.85 * bell().size / max(most, np.linalg.norm(witness.wrench[:3]))
        touching = np.linalg.norm(witness.forces, axis=1) > 1e-6 * most
        np.testing.assert_allclose(steps, scale * witness.forces[touching], rtol=1e-5, atol=1e-9)
        np.testing.assert_allclose(steps.sum(axis=0), -np.array(disturbance), atol=1e-5)  # they balance it


def test_small_disturbances_can_be_seen_and_moments_have_two_heads() -> None:
    grasp = bell()
    [small] = arrows(grasp, np.array([0, 1e-3, 0, 0, 0, 0]), None)
    np.testing.assert_allclose(small.step, [0, 0.85 * grasp.size, 0])
    force, moment = arrows(grasp, np.array([0, 1.0, 0, 0, 2.0, 0]), None)
    assert (force.heads, moment.heads) == (1, 2)
    assert np.linalg.norm(moment.step) == pytest.approx(0.6 * grasp.size)
    assert arrows(grasp, None, None) == arrows(grasp, np.zeros(6), None) == []


def test_the_selector_names_every_load_and_begins_with_one_that_holds(entries: list[Entry], tmp_path: Path) -> None:
    write_report(tmp_path / "a.html", bell(), [entries[1], entries[0], entries[4]])
    text = (tmp_path / "a.html").read_text("utf-8")
    options = re.search(r'<select name="load".*?</select>', text)
    assert options is not None
    assert re.findall(r"<option[^>]*>(.*?)</option>", options[0]) == ["too much", "up", "left &amp; &lt;b&gt;"]
    assert re.findall(r'value="(\d)" selected', options[0]) == ["1"]
    write_report(tmp_path / "b.html", bell(), entries[:1])  # with one there is nothing to choose
    assert '<label hidden>load <select name="load"' in (tmp_path / "b.html").read_text("utf-8")


def test_names_cannot_break_out_of_the_page(tmp_path: Path) -> None:
    plain = pinch()
    contacts = [Contact(c.position, c.normal, c.friction, EVIL) for c in plain.contacts]
    grasp = Grasp(contacts, plain.joints, preload=plain.preload, name=EVIL)
    answer = check(grasp, [0, 0.5, 0, 0, 0, 0], settings=QUICK)
    write_report(tmp_path / "a.html", grasp, [Entry(EVIL, answer)], facts=[(EVIL, EVIL)], notes=[EVIL])
    text = (tmp_path / "a.html").read_text("utf-8")
    assert "<script>alert" not in text
    assert "<!--" not in text
    assert text.count("<script") == text.count("</script>") == 2  # the data and the program
    assert embedded(text)["grasps"][0]["contacts"][0]["link"] == EVIL


def test_nothing_is_fetched(entries: list[Entry], tmp_path: Path) -> None:
    write_report(tmp_path / "a.html", bell(), entries[:1], meshes=[lattice(4, "object")])
    text = (tmp_path / "a.html").read_text("utf-8")
    text = re.sub(r'src="data:image/svg\+xml;base64,[^"]*"', "", text)
    for word in ("http:", "https:", "src=", "href=", "import(", "fetch(", "XMLHttpRequest", "eval(", "innerHTML"):
        assert word not in text


def test_without_solids_the_fingers_are_rods() -> None:
    def only(shown: DrawnScene) -> dict[str, Any]:
        [seen] = scene_json(shown)["grasps"]
        return seen

    grasp = bell()
    data = only(DrawnScene.of(grasp))
    assert scene_json(DrawnScene.of(grasp))["solids"] == []
    assert data["loads"] == []
    assert len(data["fingers"]) == grasp.m
    for line, contact in zip(data["fingers"], grasp.contacts, strict=True):
        np.testing.assert_allclose(line[-1], contact.position, atol=1e-7)
    assert only(DrawnScene.of(nest()))["fingers"][0] == [pytest.approx(nest().contacts[0].position.tolist(), abs=1e-7)]
    assert only(DrawnScene.of(grasp, meshes=[lattice(2, "hand")]))["fingers"] == []


def test_sides_are_rotations() -> None:
    """Rows of every side's matrix: right, up, towards the viewer; right-handed."""
    pulled = ShownLoad("down", "", np.array([1.0, -5.0, 0, 0, 0, 0]), None)
    for loads, second in (((), "at an angle"), ((pulled,), "first load pulls down")):
        sides = view3d.sides(DrawnScene.of(bell(), loads), 0)
        assert [v.title for v in sides[:2]] == ["contacts in view", second]
        assert len({v.title for v in sides}) == len(sides) == 5
        for side in sides:
            np.testing.assert_allclose(side.matrix @ side.matrix.T, np.eye(3), atol=1e-9)
            assert np.linalg.det(side.matrix) == pytest.approx(1)
        if loads:
            assert sides[0].matrix[1] @ [1, -5, 0] < -1  # the load pulls down there too


def test_the_first_side_looks_past_what_hides_the_contacts() -> None:
    grasp = bell()
    wall = lattice(8, "hand")
    wide = Mesh(400 * wall.vertices * grasp.size, wall.faces, "hand")
    for turned in (np.eye(3), np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])):
        for away in (1, -1):  # a wall beside the grasp, on both of its sides in turn
            out = away * turned @ [0, 0, 2 * grasp.size]
            hand = Mesh(wide.vertices @ turned.T + out, wide.faces, "hand")
            assert view3d.sides(DrawnScene.of(grasp, meshes=[hand]), 0)[0].matrix[2] @ out < 0


def two_grasps() -> DrawnScene:
    """A link that stands elsewhere in the second grasp, whose load is another."""
    there = np.array([np.eye(4), np.eye(4)])
    there[1, :3, 3] = 0.3
    answers = [check(bell(), [0, y, 0, 0, 0, 0], settings=QUICK) for y in (1.0, 2.5)]
    loads = [(ShownLoad("pull", a.verdict, np.array([0, 1.0, 0, 0, 0, 0]), a.witness),) for a in answers]
    shown = [
        ShownGrasp(bell(), x, f"{k}", f"the {k}th", T[None]) for k, (x, T) in enumerate(zip(loads, there, strict=True))
    ]
    sheet = lattice(3, "hand")
    return DrawnScene(tuple(shown), (lattice(4, "object"), Mesh(sheet.vertices, sheet.faces, "hand", 0)))


def test_all_grasps_are_in_one_scene() -> None:
    shown = two_grasps()
    data = scene_json(shown)
    assert [(s["kind"], s["frame"]) for s in data["solids"]] == [("object", None), ("hand", 0)]
    first, second = data["grasps"]
    assert np.reshape(second["poses"], (3, 4))[:, 3].tolist() == [0.3] * 3
    np.testing.assert_allclose(shown.meshes_of(1)[1].vertices, shown.meshes_of(0)[1].vertices + 0.3)
    assert np.array(second["box"])[1] == pytest.approx(np.array(data["box"])[1])
    assert (np.array(first["box"])[1] < np.array(data["box"])[1]).all()


@pytest.mark.skipif(shutil.which("node") is None, reason="needs a JavaScript engine")
def test_buttons_step_through_grasps(tmp_path: Path) -> None:
    page = view3d.view(two_grasps())
    steps = """
      const say = () => tell.push([find("[name=grasp]").value, find(".said").textContent]);
      say(); press("grasp-next"); say(); press("grasp-next"); say();
      press("grasp-previous"); say(); press("load-next"); say();
    """
    said = drive(page, steps, tmp_path)
    assert [f"{number}: {text}" for number, text in said] == [
        "0: the 0th holds", "1: the 1th slips", "0: the 0th holds", "1: the 1th slips", "1: the 1th slips"
    ]  # fmt: skip


@given(st.integers(0, 2**32 - 1))
@hypothesis_settings(derandomize=True, max_examples=50, deadline=None)
def test_a_single_force_is_drawn_on_its_line_of_action(seed: int) -> None:
    rng = np.random.default_rng(seed)
    center, through, near, force = rng.normal(size=(4, 3))
    wrench = np.r_[force, np.cross(through, force)]
    at, about = applied(wrench, near, np.inf)
    np.testing.assert_allclose(np.r_[about[:3], np.cross(at, about[:3])], wrench, atol=1e-12)  # the same wrench
    assert abs((at - near) @ force) < 1e-12 * (1 + np.linalg.norm(near) * np.linalg.norm(force))  # the nearest point
    for other in (np.r_[force, np.cross(through, force) + force], np.r_[0 * force, force], np.r_[force, 0 * force]):
        assert all(
            np.array_equal(a, b) for a, b in zip(applied(other, near, np.inf), (np.zeros(3), other), strict=True)
        )
    assert not applied(wrench, at + 2 * np.cross(force, center) / np.linalg.norm(np.cross(force, center)), 1.0)[0].any()


def test_an_answer_without_anything_to_show_is_listed() -> None:
    nothing = CheckAnswer(Verdict.UNDECIDED, Stop.TIME, 1.0, 0, None, None)
    [seen] = scene_json(DrawnScene.of(bell(), [ShownLoad("?", f"{nothing.verdict}", None, None)]))["grasps"]
    assert seen["loads"] == [{"title": "?", "said": "undecided", "wrench": None, "arrows": []}]


def test_the_view_of_a_hand_and_a_fine_object_is_small() -> None:
    """20 links of 500 triangles, an object of 20 000: a page of 3 MB has two thirds of it for the still pictures."""
    meshes = [lattice(100, "object"), *(lattice(16, "hand", 0.01 * k) for k in range(20))]
    assert sum(len(m.faces) for m in meshes) > 30_000
    assert len(view3d.view(DrawnScene.of(bell(), meshes=meshes))) < 1e6


def test_the_fallback_needs_no_script(entries: list[Entry], tmp_path: Path) -> None:
    write_report(tmp_path / "a.html", bell(), entries[:1])
    text = (tmp_path / "a.html").read_text("utf-8")
    assert '<figure class="view3d">' in text  # the script adds "live" once there is WebGL
    assert "the pictures below need neither" in text
    assert ".view3d:not(.live)" in text
    assert "data:image/svg+xml;base64," in text


@pytest.mark.skipif(shutil.which("node") is None, reason="needs a JavaScript engine")
def test_the_shapes_are_right(tmp_path: Path) -> None:
    """A cube's normals are those of its faces and its edges twelve; an arrow ends where it should."""
    v = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    f = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]])
    f = np.vstack([f, [[0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]])
    folder = resources.files("handfast.pictures") / "browser"
    program = (folder / "shapes3d.js").read_text("utf-8")
    ask = (
        f"const [c, e] = solid({json.dumps(packed([Mesh(v, f, 'object')]))}); const a = [];"
        "arrow(a, [1, 2, 3], [0, 0, -2], 0.05);"
        "console.log(JSON.stringify({ corners: [...c], edges: e, arrow: a }));"
    )
    (tmp_path / "a.js").write_text(program + ask, "utf-8")
    done = subprocess.run(["node", str(tmp_path / "a.js")], capture_output=True, text=True, check=True, timeout=60)
    out = json.loads(done.stdout)
    corners = np.reshape(out["corners"], (12, 3, 6))
    np.testing.assert_allclose(corners[:, :, :3], v[f], atol=1e-7)
    flat = np.cross(v[f][:, 1] - v[f][:, 0], v[f][:, 2] - v[f][:, 0])
    np.testing.assert_allclose(corners[:, :, 3:], np.repeat(flat[:, None], 3, axis=1), atol=1e-7)
    assert len(out["edges"]) == 12
    assert all(np.linalg.norm(np.subtract(a, b)) == pytest.approx(1) for a, b in out["edges"])
    arrow = np.reshape(out["arrow"], (-1, 6))
    assert arrow[:, 2].min() == pytest.approx(1)  # from z = 3, 2 downwards
    assert arrow[:, 2].max() == pytest.approx(3)
    np.testing.assert_allclose(np.linalg.norm(arrow[:, 3:], axis=1), 1, atol=1e-9)
    head = np.linalg.norm(arrow[:, :2] - [1, 2], axis=1)
    assert head.max() == pytest.approx(2.6 * 0.05)
    parts = "\n".join((folder / name).read_text("utf-8") for name in view3d.VIEW_SCRIPTS)
    (tmp_path / "b.js").write_text(f"(() => {{ 'use strict';\n{parts}}});", "utf-8")
    subprocess.run(["node", "--check", str(tmp_path / "b.js")], check=True, timeout=60)
