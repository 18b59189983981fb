"""Readers are found by what files are called and begin with; a format is added by an entry."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.model.configuration import Configuration
from handfast.model.hand import Hand, Joint, Link
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Mesh, Shape
from handfast.readers import registry
from handfast.readers.configuration_file import load_configuration
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.readers.mesh_file import read_mesh


def read_tetrahedron(_path: Path) -> list[Mesh]:
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    return [(np.vstack([np.zeros((1, 3)), np.eye(3)]), faces)]


def read_nothing(_path: Path) -> list[Mesh]:
    return []


def read_ball(path: Path, scale: float) -> registry.ObjectParts:
    return registry.ObjectParts(path.stem, [Shape("sphere", 0.03)], mass=0.2, without_friction="has no friction")


def read_jaw(root: Element, path: Path, _base: str | None) -> Hand:
    joint = Joint("jaw", "prismatic", np.array([1.0, 0, 0]), np.zeros(3), 0.0, 0.1)
    links = (Link("palm", -1, np.eye(4), (), ()), Link("finger", 0, np.eye(4), (0,), (Shape("sphere", 0.01),)))
    return Hand(root.get("name", ""), links, (joint,), Mechanism.direct(["jaw"]), (), np.ones(1), source=str(path))


def read_place(_path: Path, chosen: tuple[str, ...]) -> Configuration:
    return Configuration(schema="handfast/configuration/1", joints=dict.fromkeys(chosen, 0.5))


def test_a_format_is_added_by_an_entry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    here = __name__
    monkeypatch.setitem(registry.MESHES, ".tet", f"{here}:read_tetrahedron")
    monkeypatch.setitem(registry.MESHES, ".none", f"{here}:read_nothing")
    monkeypatch.setitem(registry.OBJECTS, ".ball", f"{here}:read_ball")
    monkeypatch.setitem(registry.HAND_READERS, "jaws", f"{here}:read_jaw")
    monkeypatch.setitem(registry.CONFIGURATIONS, ".place", f"{here}:read_place")
    files = {ending: tmp_path / f"a.{ending}" for ending in ("tet", "none", "ball", "hand", "place")}
    for file in files.values():
        file.write_text("<jaws name='two'/>")
    assert read_mesh(files["tet"])[0][1].shape == (4, 3)
    assert load_body(files["tet"], scale=0.1).pieces[0].volume == pytest.approx(1e-3 / 6)
    with pytest.raises(InputError, match=r"a\.none: has no triangles$"):
        read_mesh(files["none"])
    assert load_body(files["ball"]).mass == 0.2
    assert load_hand(files["hand"]).name == "two"
    assert load_configuration(f"{files['place']}#left,right").joints == {"left": 0.5, "right": 0.5}


def test_what_a_file_leaves_open_is_said_only_where_nobody_else_says_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setitem(registry.OBJECTS, ".ball", f"{__name__}:read_ball")
    (tmp_path / "a.ball").touch()
    assert load_body(tmp_path / "a.ball", friction=0.8).friction == 0.8
    assert caplog.messages == []
    assert load_body(tmp_path / "a.ball").friction == 0.5
    assert caplog.messages == [f"{tmp_path / 'a.ball'}: has no friction"]


def test_a_hand_is_known_by_its_root_element() -> None:
    assert registry.hand_format(fromstring("<robot><link/></robot>")) == "robot"
    assert registry.hand_format(fromstring("<robot><chain/></robot>")) == "robot/chain"
    assert registry.hand_format(fromstring("<mujoco/>")) == "mujoco"
    assert registry.hand_format(fromstring("<sdf/>")) == ""


def test_a_reader_is_imported_when_its_first_file_is_opened() -> None:
    code = (
        "import sys; from handfast import load_hand, load_body; load_hand('barrett-bh8-280'); load_body('can');"
        "print([m for m in sys.modules if m.startswith('handfast.readers.graspit')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
