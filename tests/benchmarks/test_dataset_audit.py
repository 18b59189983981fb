"""The audit of a published set: its test in MuJoCo on a hand of ours, curves and tables on planted rows."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from benchmarks.audit_summary import roc, summary
from benchmarks.audit_tables import tables
from benchmarks.bench_protocol import GraspBench
from benchmarks.dataset_audit import RESULTS, BundledSet, PublishedSet, balanced, held, passes_bench, without_laws
from handfast import Contact, Grasp, GraspJoint, load_body, load_hand

JAWS = """<mujoco model="jaws"><compiler angle="radian"/>
  <worldbody><body name="palm" pos="0 0 0.05"><geom type="box" size="0.01 0.06 0.005" pos="0 0 0.06"/>
    <body name="left" pos="0 -0.04 0"><joint name="left_slide" type="slide" axis="0 1 0" range="0 0.03"/>
      <geom type="box" size="0.01 0.005 0.01"/></body>
    <body name="right" pos="0 0.04 0"><joint name="right_slide" type="slide" axis="0 -1 0" range="0 0.03"/>
      <geom type="box" size="0.01 0.005 0.01"/></body></body></worldbody>
  <actuator><position name="left_servo" joint="left_slide" kp="300"/>
    <position name="right_servo" joint="right_slide" kp="300"/></actuator></mujoco>"""
OPEN, TOUCHING, SQUEEZED = 0.01, 0.015, 0.035
ROOT = Path(__file__).parents[2]
POSE = [0.0, 0, 0, 1, 0, 0, 0]


@pytest.fixture(scope="module")
def jaws(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A gripper whose pads stand 50 mm above the frame that a file poses, and a cube of 40 mm as one convex piece."""
    folder = tmp_path_factory.mktemp("jaws")
    (folder / "jaws.xml").write_text(JAWS)
    trimesh.creation.box((0.04, 0.04, 0.04)).export(folder / "cube.obj")
    return folder / "jaws.xml", folder / "cube.obj"


def stages(last: float) -> tuple[Any, Any, Any]:
    return tuple(np.array([*POSE, q, q]) for q in (OPEN, TOUCHING, last))  # type: ignore[return-value]


def test_a_squeeze_passes_and_a_touch_does_not(jaws: tuple[Path, Path]) -> None:
    bench = GraspBench(jaws[0], [jaws[1]], 1.0)
    at = np.array([0, 0, 0.05, 1, 0, 0, 0], dtype=float)
    firm, loose = bench.run(stages(SQUEEZED), at), bench.run(stages(TOUCHING), at)
    assert firm.passes
    assert firm.held == (True,) * 6
    assert not loose.passes
    assert not any(loose.held[:2])  # along x only friction holds
    inside = bench.run(stages(SQUEEZED), np.array([0, 0.02, 0.05, 1, 0, 0, 0]))
    assert inside.settled is None  # 15 mm inside a jaw before it begins
    assert not inside.passes


def test_what_is_asked_here_is_the_settled_grasp(jaws: tuple[Path, Path]) -> None:
    outcome = GraspBench(jaws[0], [jaws[1]], 1.0).run(stages(SQUEEZED), np.array([0, 0, 0.05, 1, 0, 0, 0]))
    settled = outcome.settled
    assert settled is not None
    assert set(settled.links) == {"left", "right"}
    assert np.abs(settled.object_pose[:3, 3]).max() < 1e-3  # in the palm's frame, not in that of the file
    made = PublishedSet.__new__(PublishedSet)
    made.hand = load_hand(jaws[0])
    grasp = made.grasp(settled, load_body(jaws[1], mass=0.1), [])
    for c in grasp.contacts:
        assert abs(c.position[1]) == pytest.approx(0.02, abs=1e-3)
        assert c.normal @ c.position < 0  # into the object
    # 300 N/m over the 20 mm that the servos would still go, less what the contacts give way
    assert grasp.preload == pytest.approx({"left_servo": 5.5, "right_servo": 5.5}, abs=0.3)
    along_x = PublishedSet.push(settled, np.array([1.0, 0, 0]))
    assert np.linalg.norm(along_x[:3]) == pytest.approx(1)
    assert held(grasp, along_x[None]) == "holds"
    assert held(grasp, 6 * along_x[None]) == "holds"  # 0.6 times 5.5 N at each of two sides: 6.6 N
    assert held(grasp, 7.5 * along_x[None]) == "slips"
    rubbing = [replace(j, friction=3.0) for j in grasp.joints]  # takes 3 N of each servo's 5.5 N
    rubs = Grasp(grasp.contacts, rubbing, grasp.mechanism, grasp.preload)
    assert held(rubs, 4 * along_x[None]) == "slips"
    assert without_laws(rubs, 4 * along_x[None]) == {"own": "holds", "preload alone": "holds"}


def pinch(command: float) -> Grasp:
    """Three contacts at either side, so that turns about the line between the sides are held too."""
    places = [(s, y, z) for s in (-1, 1) for y, z in ((-0.01, -0.01), (0.01, -0.01), (0, 0.01))]
    contacts = [Contact([s * 0.02, y, z], [-s, 0, 0], 0.5) for s, y, z in places]
    return Grasp(contacts, [GraspJoint("jaw", [-1, 0, 0], [0, 0, 0], (3, 4, 5), "prismatic")], None, {"jaw": command})


def test_the_test_at_contact_level() -> None:
    across = np.array([[0, 1.0, 0, 0, 0, 0]])
    assert passes_bench(pinch(2.0), across) == (True, ["holds"])
    assert passes_bench(pinch(0.5), across) == (False, ["slips"])


def test_what_some_forces_balance() -> None:
    """Four normals like those of a tetrahedron's faces balance a force from anywhere; two of them do not."""
    tilted = np.array([[1, 0, 1], [-1, 0, 1], [0, 1, -1], [0, -1, -1]]) / np.sqrt(2)
    cage = Grasp([Contact(-0.02 * n, n, 0.3) for n in tilted])
    assert balanced(cage)
    assert not balanced(Grasp(cage.contacts[:2]))


def test_a_bundled_grasp_is_made_again_from_its_seed() -> None:
    own = BundledSet("")
    assert {r["hand"] for r in own.rows} == {"barrett"}
    row = next(r for r in own.rows if r["object"] == "ball")
    grasp = own.grasp(row)
    assert grasp.preload
    assert grasp.mass == pytest.approx(row["mass"], rel=1e-3)


def test_areas_under_the_curve() -> None:
    passed = np.array([True, True, False, False])
    for good, area in (([4, 3, 2, 1], 1.0), ([1, 2, 3, 4], 0.0), ([1, 1, 1, 1], 0.5), ([3, 1, 2, -np.inf], 0.75)):
        false, true, found = roc(np.array(good, dtype=float), passed)
        assert found == pytest.approx(area)
        assert (false[0], true[0], false[-1], true[-1]) == (0, 0, 1, 1)


def test_the_tables_count_what_is_open_by_itself() -> None:
    def row(passed: bool | None, here: str, margin: float) -> dict[str, Any]:
        return {
            "name": "x",
            "passes": {"own": passed},
            "here": {"own": here, "preload alone": "holds"},
            "without laws": {"own": "slips", "preload alone": "holds"},
            "measures": {"margin": margin, "tdg": 1 / (1 + margin)},
        }

    rows = [row(True, "holds", 2.0), row(True, "slips", 0.4), row(False, "slips", 0.2), row(None, "undecided", 1.0)]
    found = summary([*rows, {"name": "left out", "passes": {"own": None}, "reason": "touches nothing"}])
    assert (found["grasps"], found["asked"], found["test decided"]) == (5, 4, 3)
    assert found["there, here"] == {"passes, holds": 1, "passes, slips": 1, "fails, slips": 1, "open, undecided": 1}
    assert found["without laws"] == {"own": 0, "preload alone": 4}
    assert found["area"]["margin"][0] == 1.0
    assert found["area"]["tdg"][0] == 1.0  # less of it is better
    assert found["area"]["dfc"][0] == 0.5  # not measured: all alike


def test_the_page_has_the_tables_that_the_command_writes() -> None:
    page = (ROOT / "docs" / "dataset-audit.md").read_text("utf-8")

    for name, table in tables(json.loads(RESULTS.read_text("utf-8"))).items():
        assert table in page, f"docs/dataset-audit.md: {name}; run python -m benchmarks.dataset_audit tables"
