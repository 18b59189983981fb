"""The nine bundled tasks (synthesis paper, Table 2): contacts, regions on the surfaces, a configuration each."""

from __future__ import annotations

import json
import runpy
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handfast.core import bundled
from handfast.core.arrays import Array
from handfast.core.transforms import transform
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.region import Bezier, Cap, Region
from handfast.readers.load_body import load_body
from handfast.synthesis.task import Task
from handfast.synthesis.task_file import load_task
from tests.support.feasible import Feasible, missed
from tests.support.places import FEASIBLE as FEASIBLE_FILE
from tests.support.places import ROOT

TEAPOT = ROOT.parent / "shared" / "reference" / "teapot.txt"
STORED = json.loads(FEASIBLE_FILE.read_text())["tasks"]
LINKS = {  # Table 2: the links that touch; a finger touches with its fingertip unless the table says mid
    "scalpel-upholding": ("index_distal", "thumb_distal"),
    "scalpel-handling": ("middle_distal", "thumb_distal", "palm"),
    "scalpel-incision": ("middle_distal", "index_distal", "thumb_distal", "palm"),
    "teapot-lid-lifting": ("index_distal", "thumb_distal"),
    "teapot-service": ("middle_distal", "index_middle", "thumb_distal"),
    "teapot-transportation": ("palm", "index_distal", "middle_distal", "ring_distal"),
    "guitar-tuning": ("index_distal", "thumb_distal"),
    "guitar-playing": ("index_distal", "middle_distal", "thumb_distal"),
    "guitar-holding": ("palm", "thumb_distal", "index_distal", "middle_distal"),
}
RANGES = {
    "abduction": (-15, 15),
    "proximal": (-4, 75),
    "middle": (4, 75),
    "distal": (4, 75),
    "base": (0, 90),
}  # [degrees]
NEAR, ALIGNED = 5e-4, np.cos(np.radians(15))  # [m] and between normals: what facets may cost


@cache
def task(name: str) -> Task:
    return load_task(name)


@cache
def body(name: str) -> Body:
    return load_body(name)


def test_they_are_the_nine_of_table_2() -> None:
    assert set(bundled.names("tasks")) == set(LINKS)


@pytest.mark.parametrize("name", LINKS)
def test_contacts_limits_and_object(name: str) -> None:
    t = task(name)
    assert tuple(pair.link for pair in t.contact_pairs) == LINKS[name]
    assert (t.name, t.hand.source, t.object) == (name, "schunk-sah", name.split("-")[0])
    assert [(c.ratio, c.offset) for c in t.hand.couplings] == [(1.0, 0.0)] * 4  # distal = middle, of every finger
    for joint in t.hand.joints:
        allowed = np.radians(RANGES[joint.name.split("_")[1]])
        if joint.name in {t.hand.joint_names[j] for j in t.involved}:
            assert [joint.lower, joint.upper] == pytest.approx(allowed, abs=1e-5)
        elif joint.name != "index_distal":  # it follows the middle joint, which moves the contact of the service
            assert joint.lower == joint.upper
            assert allowed[0] - 1e-5 <= joint.lower <= allowed[1] + 1e-5


@pytest.mark.parametrize("name", LINKS)
def test_a_configuration_meets_the_task(name: str) -> None:
    t, found = task(name), Feasible.of(STORED[name])
    assert missed(t, found) < 1e-9
    assert found.slack(t) > 1e-3


@pytest.mark.parametrize("name", LINKS)
def test_the_configuration_is_free_of_collisions(name: str) -> None:
    t, found = task(name), Feasible.of(STORED[name])
    to_object, to_self = Scene(t.hand, body(t.object or "")).clearances(found.q(t), found.pose)
    assert to_object.min() > -3e-4  # facets
    assert to_self.min() > 0


def test_what_is_wrong_is_seen() -> None:
    """The checks above refuse planted faults: a shift, a turn, a joint, a side, a bound."""
    t, found = task("scalpel-incision"), Feasible.of(STORED["scalpel-incision"])
    shifted = replace(found, pose=transform([1e-8, 0, 0]) @ found.pose)
    assert missed(t, shifted) > 9e-9
    turned = replace(found, pose=found.pose @ transform([0, 0, 0], Rotation.from_rotvec([1e-7, 0, 0]).as_matrix()))
    assert missed(t, turned) > 1e-9
    loose = found.joints | {"thumb_distal": found.joints["thumb_distal"] + 1e-6}
    assert missed(t, replace(found, joints=loose)) > 5e-7
    first = t.contact_pairs[0]
    assert isinstance(first.object, Bezier)
    inside = replace(first, object=Bezier(first.object.points, not first.object.flip))
    assert missed(replace(t, contact_pairs=(inside, *t.contact_pairs[1:])), found) > 0.01
    assert isinstance(first.hand, Cap)
    narrow = replace(first, hand=replace(first.hand, half_angle=0.05))
    assert replace(found, joints=found.joints).slack(replace(t, contact_pairs=(narrow, *t.contact_pairs[1:]))) < 0
    beyond = replace(found, parameters=[[1.1, 0.5], *found.parameters[1:]])
    assert beyond.slack(t) < 0
    assert replace(found, joints=found.joints | {"thumb_base": 1.6}).slack(t) < 0
    assert replace(found, joints=found.joints | {"ring_proximal": 0.6}).slack(t) == -np.inf


# --- regions on surfaces -----------------------------------------------------------------------------


def samples(region: Bezier, count: int = 5) -> tuple[Array, Array]:
    """Points (n, 3) [m] and unit normals (n, 3) over a patch."""
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count)))
    n = region.normal(u, v)
    return region.at(u, v), n / np.linalg.norm(n, axis=1, keepdims=True)


def off_surface(region: Bezier, solid: Body) -> tuple[float, float]:
    """How far a patch is from the surface of a union of pieces [m], and the worst cosine of its normal to it."""
    from trimesh.triangles import closest_point

    corners = solid.vertices[solid.faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)
    far, least = 0.0, 1.0
    for point, normal in zip(*samples(region), strict=True):
        near = ((low < point + 0.01) & (high > point - 0.01)).all(axis=1)
        nearest = closest_point(corners[near], np.tile(point, (near.sum(), 1)))
        gap = np.linalg.norm(nearest - point, axis=1)
        deep = max(float(p.depth(point[None])[0]) for p in solid.pieces)
        far = max(far, float(gap.min(initial=np.inf)), deep)
        touching = n[near][gap < max(NEAR, gap.min(initial=np.inf) + 1e-9)]
        least = min(least, float((touching @ normal).max(initial=-1.0)))
    return far, least


@pytest.mark.parametrize("name", LINKS)
def test_object_regions_lie_on_the_object(name: str) -> None:
    for pair in task(name).contact_pairs:
        assert isinstance(pair.object, Bezier)
        far, least = off_surface(pair.object, body(task(name).object or ""))
        assert far < NEAR
        assert least > ALIGNED


def test_a_region_off_the_surface_is_seen() -> None:
    region, teapot = task("teapot-service").contact_pairs[0].object, body("teapot")
    assert isinstance(region, Bezier)
    outwards = samples(region)[1].mean(axis=0)
    for shift in (-0.001, 0.001):
        assert off_surface(Bezier(region.points + shift * outwards, region.flip), teapot)[0] > NEAR
    assert off_surface(Bezier(region.points, not region.flip), teapot)[1] < ALIGNED
    middle = region.points.mean(axis=(0, 1))
    turn = Rotation.from_rotvec([0, 0, 0.5]).as_matrix()
    assert off_surface(Bezier((region.points - middle) @ turn.T + middle, region.flip), teapot)[1] < ALIGNED


@pytest.mark.parametrize("name", LINKS)
def test_hand_regions_lie_on_the_hand(name: str) -> None:
    """On the fingertip's ball, on the middle phalanx, on the palm's front or on the ball at the index root."""
    t = task(name)
    for pair in t.contact_pairs:
        link = t.hand.links[t.hand.link(pair.link)]
        if isinstance(pair.hand, Cap):
            where = np.eye(4)
            if pair.link == "palm":  # the ball turns about its centre with the finger
                link = t.hand.links[t.hand.link("index_proximal")]
                rest = np.array([(j.lower + j.upper) / 2 for j in t.hand.joints])
                where = t.hand.link_poses(rest)[t.hand.link("index_proximal")]
            balls = [
                (where[:3, :3] @ s.pose[:3, 3] + where[:3, 3], s.size[0]) for s in link.shapes if s.kind == "sphere"
            ]
            assert any(np.allclose(pair.hand.center, c, atol=1e-9) and pair.hand.radius == r for c, r in balls)
        else:
            points, normals = samples(pair.hand)
            for shape in link.shapes:
                if shape.kind in ("box", "cylinder"):
                    assert np.abs(shape.depth(points)).max() < 1e-4
                    assert (shape.depth(points + 1e-3 * normals) < -8e-4).all() or shape.kind == "box"
                    assert (shape.depth(points - 1e-3 * normals) > 8e-4).all()
        assert 4e-4 < area(pair.hand) < 7e-4  # about 40 % of the fingertip


def area(region: Region) -> float:
    """[m^2], of a patch by quadrature."""
    if isinstance(region, Cap):
        return float(2 * np.pi * region.radius**2 * (1 - np.cos(region.half_angle)))
    x, w = np.polynomial.legendre.leggauss(8)
    u, v = np.meshgrid((x + 1) / 2, (x + 1) / 2)
    return float(np.linalg.norm(region.normal(u, v), axis=-1) @ w @ w / 4)


# --- the objects -----------------------------------------------------------------------------------


def test_sizes_of_the_objects() -> None:
    length = {name: 1e3 * np.ptp(body(name).vertices, axis=0) for name in ("scalpel", "teapot", "guitar")}
    assert length["scalpel"] == pytest.approx([160, 10, 5])
    assert length["teapot"][2] == pytest.approx(4 * 45.5, rel=1e-3)  # twice the radius of the body
    assert length["teapot"][1] == pytest.approx(3.15 * 45.5, rel=1e-3)
    assert 900 < length["guitar"][0] < 1000
    for file in bundled.folder("objects").iterdir():
        assert file.stat().st_size < 300_000
    for name in length:
        b = body(name)
        assert b.mass is not None
        assert 0.03 < b.mass < 2
        assert b.friction == 0.5


def test_the_handle_of_the_teapot_is_hollow() -> None:
    through = np.array([[-0.105, y, z] for y in (-0.015, 0.0, 0.012) for z in (-0.01, 0.0, 0.01)])
    assert all((p.depth(through) < 0).all() for p in body("teapot").pieces)
    bar = np.array([[-0.13, 0.0, 0.0], [-0.105, 0.02, 0.0], [-0.105, -0.032, 0.0]])
    assert (np.max([p.depth(bar) for p in body("teapot").pieces], axis=0) > 1e-3).all()


@pytest.fixture
def makers(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    yield lambda name: runpy.run_path(str(ROOT / "docs" / f"{name}.py"))
    sys.modules.pop("make_objects", None)


def test_files_are_those_that_the_scripts_make(makers: Any, tmp_path: Path) -> None:
    def vertices(file: Path) -> Array:
        return np.array(
            [line.split()[1:] for line in file.read_text().splitlines() if line.startswith("v ")], dtype=float
        )

    objects, tasks = makers("make_objects"), makers("make_tasks")
    for name in objects["OBJECTS_MADE"]:
        objects["write"](tmp_path, name)
        bundle = bundled.folder("objects")
        assert json.loads((tmp_path / f"{name}.json").read_text()) == json.loads((bundle / f"{name}.json").read_text())
        assert np.abs(vertices(tmp_path / f"{name}.obj") - vertices(bundle / f"{name}.obj")).max() < 2e-6
    for name, made in tasks["MADE"].items():
        assert json.loads(tasks["dumped"](made())) == bundled.read("tasks", name)


@pytest.mark.skipif(not TEAPOT.is_file(), reason="the shared table is not here")
def test_the_teapot_is_newells(makers: Any) -> None:
    """Every control point of the retyped table is one of the original, in the same patch."""
    lines = [line.split() for line in TEAPOT.read_text().splitlines() if not line.startswith("#")]
    points = np.array(lines[34:], dtype=float)
    x, y, z = points.T
    placed = 45.5 * np.column_stack([x, z - 1.65, -y])
    original = [placed[np.array(line[1:], dtype=int)] for line in lines[1:33]]
    objects = makers("make_objects")
    mine = [objects["quarter"](part, k) for part in objects["PROFILES"] for k in range(4)]
    mine += [objects["half_tube"](part, side) for part in objects["TUBES"] for side in (1.0, -1.0)]
    assert len(mine) == len(original) == 32
    for patch in mine:
        cloud = sorted_rows(patch)
        assert min(np.abs(cloud - sorted_rows(p)).max() for p in original) < 1e-9


def sorted_rows(points: Array) -> Array:
    rows = points.reshape(-1, 3).round(9) + 0.0
    return rows[np.lexsort(rows.T)]
