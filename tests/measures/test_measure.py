"""The table of all measures, in Python and on the command line."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import handfast
from handfast import InputError, Settings, load_grasp, measure
from handfast.measures.catalogue import CATALOGUE, MEASURE_KEYS, RIGID_JOINTS, PassiveMaxima, passive_maxima
from handfast.measures.measuring import measure_columns
from handfast.model.grasp import Grasp
from handfast.pictures.measures_picture import draw_measures
from tests.support.program import ask, complains, run
from tests.support.round_grasps import pair, three

QUICK = ("epsilon_l1", "isotropy", "dfc")
FEW = Settings(gap=1e-2, nodes=200, verify=False)


def test_passive_maxima_of_a_pinch():
    """Two fingers that press with 1 N and mu 0.5: friction of 1 N across, nothing about the line between them.

    A torque across is friction of 0.5 N at both ends of the line: in units of the radius as much. Along the line the
    gearings hold any force.
    """
    grasp = pair(0.5, fingers=True, radius=0.03).with_preload({"finger_0": 1.0, "finger_1": 1.0})
    found = passive_maxima(grasp, settings=FEW)
    expected = np.array([np.inf, np.inf, 1, 1, 1, 1, 0, 0, 1, 1, 1, 1])
    np.testing.assert_allclose(found.lower, expected, rtol=1e-2)
    np.testing.assert_allclose(found.upper, expected, rtol=1.1e-2)
    assert found.worst == (0.0, 0.0)
    assert found.worst_direction == "torque +x"


def test_all_measures_of_a_bundled_grasp():
    pytest.importorskip("clarabel")
    found = measure(load_grasp("barrett-can"), edges=4, passive=False)
    assert [v.measure.key for v in found.values] == [k for k in MEASURE_KEYS if k != "passive_worst"]
    assert all(v.value is not None for v in found.values)
    assert found["force_closure"] is True
    assert 0 < found["epsilon_l1"] < found["epsilon_linf"] <= found.chosen.min() == found["largest_wrench"]
    assert found["controllable_dimension"] + found["passive_dimension"] == found["internal_dimension"]
    assert found["pcr"] <= found["pgr"] * (1 + 1e-9)
    assert found.passive is None
    with pytest.raises(InputError, match="unknown measure 'epsilon'"):
        found["epsilon"]


@pytest.mark.parametrize(
    ("lower", "upper", "note"),
    [
        ((1.0, 3.0), (1.01, 3.0), "first"),
        ((3.0, 2.0), (3.0, 2.5), "second, at most 2.5"),
        ((1.0, 3.0), (np.inf, np.inf), "first, or more"),
        ((np.inf, np.inf), (np.inf, np.inf), "any wrench is resisted"),
    ],
)
def test_what_is_said_beside_a_passive_maximum(lower, upper, note, monkeypatch):
    """Both bounds where they are 2 % apart."""
    known = PassiveMaxima(("first", "second"), np.array(lower), np.array(upper))
    monkeypatch.setattr("handfast.measures.catalogue.passive_maxima", lambda *args, **options: known)
    (value,) = measure(pair(0.5), only=["passive_worst"]).values
    assert value.note == note


def test_what_is_said_beside_a_measure_that_leaves_the_laws_of_joints_out():
    bare = three(0.4, fingers=True)
    rubs = Grasp(bare.contacts, [replace(j, friction=0.1) for j in bare.joints])
    keys = ["epsilon_l1", next(m.key for m in CATALOGUE if m.assumes == RIGID_JOINTS)]
    left_out = "friction, springs and stops of its joints are left out"
    assert [v.note for v in measure(rubs, only=keys).values] == ["", left_out]
    assert [v.note for v in measure(bare, only=keys).values] == ["", ""]


def test_all_that_a_file_of_measures_has():
    grasp = pair(0.5, fingers=True, radius=0.03).with_preload({"finger_0": 1.0, "finger_1": 1.0})
    found = measure(grasp, only=["dfc", "passive_worst"], force_limit=2.0, edges=6, settings=FEW)
    data = found.to_json()
    assert data["preload"] == {"finger_0": 1.0, "finger_1": 1.0}
    assert {k: data[k] for k in ("schema", "grasp", "edges", "force_limit")} == {
        "schema": "handfast/measures/1",
        "grasp": "round",
        "edges": 6,
        "force_limit": 2.0,
    }
    assert data["scale"] == data["energy_scale"] == {"about": found.scale.about.tolist(), "length": found.scale.length}
    (dfc,) = (m for m in CATALOGUE if m.key == "dfc")
    about = {"name": dfc.name, "unit": dfc.unit, "better": dfc.better, "hand": dfc.assumes, "source": dfc.source}
    assert data["measures"]["dfc"] == about | {"value": found["dfc"], "note": ""}
    assert found.scale.length == pytest.approx(0.03)
    rows = data["passive"]
    assert rows[0] == {"direction": "force +x", "lower": None, "upper": None}  # any force along the line
    assert rows[6] == {"direction": "torque +x", "lower": 0.0, "upper": 0.0}
    assert len(rows) == 12
    assert set(data) == {
        "schema", "grasp", "preload", "scale", "energy_scale", "edges", "force_limit", "measures", "passive",
    }  # fmt: skip


def test_columns_are_flat():
    row = measure_columns(three(0.4, fingers=True).with_preload(dict.fromkeys(["finger_0"], 0.0)), only=QUICK)
    assert list(row) == list(QUICK)
    assert all(isinstance(v, float) for v in row.values())


def test_columns_with_the_passive_maximum():
    grasp = pair(0.5, fingers=True).with_preload({"finger_0": 1.0, "finger_1": 1.0})
    row = measure_columns(grasp, only=["passive_worst"], settings=FEW)
    assert row["passive_worst"] == 0.0
    assert row["passive_worst_upper"] >= 0.0


def test_choices_reach_the_measures():
    """A longer length shrinks torques; a limit of forces scales what has one; energies keep their own scale."""
    grasp = three(0.4, radius=0.05)
    usual, long = measure(grasp, only=QUICK), measure(grasp, only=QUICK, length=0.5)
    assert usual.scale.length == pytest.approx(0.05)
    assert long["epsilon_l1"] < usual["epsilon_l1"]
    assert long.energy_scale.length == 0.5
    assert measure(grasp, only=["epsilon_linf"], force_limit=3.0)["epsilon_linf"] == pytest.approx(
        3 * measure(grasp, only=["epsilon_linf"])["epsilon_linf"]
    )


def test_the_frame_of_the_object_does_not_matter():
    """Turning and moving the object's frame changes nothing but the pyramids' edges, which lean with the tangents."""
    pytest.importorskip("clarabel")
    from benchmarks.laws import Change

    grasp = load_grasp("barrett-can")
    R = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    change = Change(R=R * np.linalg.det(R), p=np.array([0.1, -0.2, 0.3]))
    other = change.grasp(grasp).about(center_of_mass=change.point(grasp.center_of_mass))
    keys = ("isotropy", "smallest_singular_value", "dfc", "pcr", "controllable_dimension")
    one, two = measure(grasp, only=keys), measure(other, only=keys)
    for key in keys:
        assert two[key] == pytest.approx(one[key], rel=1e-6), key


def test_without_clarabel(monkeypatch):
    monkeypatch.setitem(sys.modules, "clarabel", None)
    found = measure(three(0.4), only=["largest_wrench", "pcr", "isotropy"])
    notes = {v.measure.key: v.note for v in found.values}
    assert found["largest_wrench"] is None
    assert found["isotropy"] is not None
    assert notes["pcr"] == "needs clarabel: pip install 'handfast[measures]'"
    assert found.chosen is None
    draw_measures(found)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"edges": 2}, "edges: is 2; 3 to 64"),
        ({"length": -1.0}, "length: is -1"),
        ({"force_limit": float("nan")}, "force_limit: is nan"),
        ({"only": ["eps"]}, "unknown measure 'eps'"),
        ({"about": [0, 1]}, "about"),
    ],
)
def test_bad_options(options, words):
    with pytest.raises(InputError, match=words):
        measure(pair(0.4), **options)


def test_catalogue():
    """Keys and names are used once, and each measure says where it is from and what it takes the hand to be."""
    assert len(set(MEASURE_KEYS)) == len(CATALOGUE) == len({m.name for m in CATALOGUE})
    assert all(m.source and m.assumes for m in CATALOGUE)
    assert handfast.measure is measure


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    saved, drawn = tmp_path / "m.csv", tmp_path / "m.png"
    asked = ["measures", "barrett-can", "--no-passive", "--edges", "4"]
    status, out, _ = run(capsys, *asked, "-o", str(saved))
    assert status == 0
    assert "epsilon, L1" in out
    assert "Ferrari, Canny 1992" in out
    head, row = saved.read_text().splitlines()
    values = dict(zip(head.split(","), row.split(","), strict=True))
    assert float(values["epsilon_l1"]) == measure(load_grasp("barrett-can"), edges=4, only=["epsilon_l1"])["epsilon_l1"]
    assert run(capsys, *asked, "-o", str(drawn))[0] == 0
    assert drawn.read_bytes().startswith(b"\x89PNG")
    complains(capsys, [*asked, "-o", str(saved)], ["exists already; give --force"])


def test_command_json(capsys: pytest.CaptureFixture[str]) -> None:
    data = ask(capsys, "measures", "fig11", "--no-passive", "--edges", "4", "--torque-limit", "finger_1_prox=0.1")
    assert data["schema"] == "handfast/measures/1"
    entry = data["measures"]["epsilon_l1"]
    assert entry["unit"] == "N"
    assert entry["value"] > 0
    assert data["scale"]["length"] > 0


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--length", "0"], "--length: is 0; a length above 0 [m] is needed"),
        (["--edges", "2"], "--edges: is 2; 3 to 64 edges of a friction cone are possible"),
        (["--torque-limit", "thumb=1"], "--torque-limit: unknown actuator 'thumb'"),
        (["-o", "m.txt"], "m.txt: a name that ends in"),
    ],
)
def test_bad_command(words: list[str], complaint: str, capsys: pytest.CaptureFixture[str]) -> None:
    complains(capsys, ["measures", "fig11", "--no-passive", *words], [complaint])
