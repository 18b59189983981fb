"""The handfast/grasp/1 file: nothing is lost, every fault is one line with file and field."""

from __future__ import annotations

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast.core import bundled
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.model.mechanism import Mechanism
from handfast.readers.grasp_file import from_dict, load_grasp, save_grasp, to_dict
from tests.support.problems import bell, nest, pinch

MINIMAL: dict[str, Any] = {
    "schema": "handfast/grasp/1",
    "contacts": [{"position": [0, 0, 0], "normal": [0, 0, 1], "friction": 0.5}],
    "joints": [{"name": "a", "axis": [1, 0, 0], "origin": [0, 0.1, 0], "moves": [0]}],
    "preload": {"a": 0.1},
}


def coupled() -> Grasp:
    g = pinch()
    mechanism = Mechanism(("pull",), np.array([[1.0, 0.5]]), np.array([[-1 / 3, 1.0]]), (True,))
    return Grasp(g.contacts, g.joints, mechanism, {"pull": 0.25}, "coupled")


@pytest.mark.parametrize("grasp", [pinch(), bell(0.0005), nest(), coupled()], ids=lambda g: g.name)
def test_round_trip_is_exact(grasp: Grasp, tmp_path: Path) -> None:
    save_grasp(grasp, tmp_path / "g.json")
    again = load_grasp(tmp_path / "g.json")
    for a, b in ((grasp.G, again.G), (grasp.J, again.J), (grasp.mechanism.R, again.mechanism.R)):
        assert np.array_equal(a, b)
    assert np.array_equal(grasp.mechanism.A, again.mechanism.A)
    assert grasp.mechanism.tendon == again.mechanism.tendon
    assert (grasp.preload, grasp.name) == (again.preload, again.name)
    assert [c.link for c in grasp.contacts] == [c.link for c in again.contacts]


def test_without_a_mechanism_every_joint_is_its_own_actuator() -> None:
    g = from_dict(MINIMAL)
    assert g.mechanism.actuators == ("a",)
    assert g.preload == {"a": 0.1}


def changed(path: str, value: Any) -> dict[str, Any]:
    data = deepcopy(MINIMAL)
    *parts, last = path.split(".")
    target: Any = data
    for part in parts:
        target = target[int(part) if part.isdigit() else part]
    target[int(last) if last.isdigit() else last] = value
    return data


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("colour", 1, "colour: is not a known field; leave it out"),
        ("contacts.0.colour", 1, r"contacts\[0\].colour: is not a known field"),
        ("schema", "handfast/grasp/2", "schema: input should be 'handfast/grasp/1'"),
        ("contacts", [], "contacts: is empty; a grasp needs at least one contact"),
        ("contacts.0.normal", [0, 0, 0], r"contacts\[0\].normal: is zero; a unit vector is needed"),
        ("contacts.0.normal", [0, 0, 3], r"contacts\[0\].normal: has length 3; a unit vector is needed"),
        ("contacts.0.friction", -1, r"contacts\[0\].friction: is -1; a friction coefficient is 0 or more"),
        ("contacts.0.position", [0, 0], r"contacts\[0\].position\[2\]: is missing"),
        ("joints.0.moves", [3], r"joints\[0\].moves: has contact 3, out of range: contacts are 0 to 0"),
        ("joints.0.axis", [0, 0, 0], r"joints\[0\].axis: is zero"),
        ("joints.0.type", "ball", r"joints\[0\].type: input should be 'revolute' or 'prismatic'"),
        ("preload", {"b": 1}, "preload: unknown actuator 'b'; known: a"),
        (
            "mechanism",
            {"actuators": [{"name": "m", "joints": {"b": 1}}]},
            r"mechanism.actuators\[0\].joints: unknown joint 'b'; known: a",
        ),
        (
            "mechanism",
            {"actuators": [], "couplings": [{"z": 1}]},
            r"mechanism.couplings\[0\]: unknown joint 'z'; known: a",
        ),
    ],
)
def test_faults(tmp_path: Path, path: str, value: Any, message: str) -> None:
    file = tmp_path / "g.json"
    file.write_text(json.dumps(changed(path, value)))
    with pytest.raises(InputError, match="g.json: " + message) as caught:
        load_grasp(file)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_grasps(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone: no such file, and no bundled grasp of that name; bundled: .*fig1"):
        load_grasp("gone")
    with pytest.raises(InputError, match=r"gone.json: no such file"):
        load_grasp(tmp_path / "gone.json")
    file = tmp_path / "g.json"
    file.write_text('{"schema": ')
    with pytest.raises(InputError, match=r"g.json: is not valid JSON: .*line 1"):
        load_grasp(file)
    file.write_text(json.dumps(changed("preload", {"a": float("nan")})))
    with pytest.raises(InputError, match=r"g.json: contains NaN; finite numbers are needed"):
        load_grasp(file)
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"g.json: is not a text file"):
        load_grasp(file)
    with pytest.raises(InputError, match="is a folder"):
        load_grasp(tmp_path)


def test_nothing_is_written_over_or_half_written(tmp_path: Path) -> None:
    file = tmp_path / "g.json"
    file.write_text("precious")
    with pytest.raises(InputError, match=r"g.json: exists already; give --force"):
        save_grasp(pinch(), file)
    assert file.read_text() == "precious"
    save_grasp(pinch(), file, force=True)
    assert load_grasp(file).m == 2
    with pytest.raises(InputError, match="cannot be written"):
        save_grasp(pinch(), file / "below.json")
    assert [f.name for f in tmp_path.iterdir()] == ["g.json"]


def test_what_could_not_be_read_again_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"heavy\.json: contains 1e\+60; numbers up to 1e\+50 are possible"):
        save_grasp(pinch().about(mass=1e60), tmp_path / "heavy.json")
    assert not list(tmp_path.iterdir())


def test_every_bundled_grasp_loads() -> None:
    assert {"fig1", "fig7", "fig9", "fig11", "fig9-coupled"} <= set(bundled.names("grasps"))
    for name in bundled.names("grasps"):
        assert load_grasp(name).m >= 3
        assert to_dict(load_grasp(name))["name"] == name


def test_nothing_of_contacts_and_joints_is_lost(tmp_path: Path) -> None:
    """A sliding joint, a depth, a name; without a name the file's."""
    contact = {"position": [1, 2, 3], "normal": [0, 0, 1], "friction": 0.5, "link": "tip", "depth": -2e-4}
    joint = {"name": "a", "type": "prismatic", "axis": [0, 1, 0], "origin": [0, 0.1, 0], "moves": [0]}
    data = {"schema": "handfast/grasp/1", "contacts": [contact], "joints": [joint]}
    again = to_dict(from_dict(data))
    assert again["contacts"] == [contact]
    assert again["joints"] == [joint]
    assert again["name"] == "grasp"
    file = tmp_path / "mine.json"
    file.write_text(json.dumps(data))
    assert load_grasp(file).name == "mine"
    file.write_text(json.dumps(data | {"name": "yours"}))
    assert load_grasp(file).name == "yours"
