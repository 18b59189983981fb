"""Where a grasp came from: paths and checksums through files, folders that move, and files that change."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import pytest

from handfast import Grasp, InputError, load_body, load_configuration, load_grasp, load_hand, save_grasp
from handfast.core import bundled
from handfast.geometry.contacts import contact_grasp
from handfast.model.provenance import Provenance, SourceFile
from handfast.pictures.scene import source_meshes
from handfast.readers.grasp_file import file_dict, from_dict, to_dict
from tests.support.problems import pinch

CLOSED = {
    "schema": "handfast/configuration/1",
    "joints": {"left_slide": 0.02},
    "object_pose": {"position": [0, 0, 0.095]},
    "preload": {"grip": 10.0},
}


@pytest.fixture
def held(tmp_path: Path) -> Path:
    """A folder with an object, a configuration and the grasp that the bundled gripper has there, all in files."""
    folder = tmp_path / "made"
    folder.mkdir()
    body = {"shapes": [{"box": {"size": [0.04, 0.04, 0.1]}, "pose": {"position": [0, 0, 0.01]}}], "mass": 0.2}
    (folder / "block.json").write_text(json.dumps(body))
    shutil.copy(bundled.resolve("hands", "parallel-gripper"), folder / "gripper.xml")
    (folder / "closed.json").write_text(json.dumps(CLOSED))
    hand, block = load_hand(folder / "gripper.xml"), load_body(folder / "block.json")
    placed = load_configuration(folder / "closed.json")
    hand, q = placed.applied(hand)
    grasp = contact_grasp(hand, q, block, placed.pose, preload=placed.preload, threshold=1e-3)
    save_grasp(grasp.from_configuration(folder / "closed.json"), folder / "grasp.json")
    return folder


def test_a_file_keeps_object_and_sources(held: Path) -> None:
    said = json.loads((held / "grasp.json").read_text())
    assert said["mass"] == 0.2
    assert said["center_of_mass"] == pytest.approx([0, 0, 0.01])
    assert {k: v["path"] for k, v in said["provenance"].items()} == {
        "hand": "gripper.xml",
        "object": "block.json",
        "configuration": "closed.json",
    }
    for part in said["provenance"].values():
        assert part["sha256"] == hashlib.sha256((held / part["path"]).read_bytes()).hexdigest()
    grasp = load_grasp(held / "grasp.json")
    assert file_dict(grasp, held) == said
    assert grasp.provenance is not None
    assert grasp.provenance.faults() == []
    assert grasp.gravity_wrench([0, 0, -2]) == pytest.approx([0, 0, -0.2 * 9.81, 0, 0, 0])


def test_a_folder_moves_and_its_report_still_shows_hand_and_object(held: Path, tmp_path: Path) -> None:
    there = held.rename(tmp_path / "elsewhere")
    meshes, notes = source_meshes(load_grasp(there / "grasp.json"))
    assert notes == []
    assert {m.kind for m in meshes} == {"object", "hand"}


def test_grasps_move_without_their_hand(held: Path, tmp_path: Path) -> None:
    """What is above the folder is found by its path; what is beside it as the configuration names it; no other file."""
    grasp = load_grasp(held / "grasp.json")
    planned = tmp_path / "planned"
    for folder in (planned, tmp_path / "a" / "b"):
        folder.mkdir(parents=True)
    placed = planned / "placed.json"
    placed.write_text(json.dumps(CLOSED))
    save_grasp(grasp.from_configuration(placed), planned / "grasp.json")
    said = json.loads((planned / "grasp.json").read_text())["provenance"]
    assert said["hand"]["path"] == "../made/gripper.xml"

    def hand(grasps: Path) -> str | None:
        came = load_grasp(grasps / "grasp.json").provenance
        assert came is not None
        assert came.hand is not None
        return None if came.hand.fault("hand") else came.hand.path

    below = shutil.copytree(planned, tmp_path / "a" / "b" / "planned")
    assert hand(below) == str(held / "gripper.xml")
    (tmp_path / "a" / "made").mkdir()  # nearer, and another
    (tmp_path / "a" / "made" / "gripper.xml").write_text("another")
    assert hand(below) == str(held / "gripper.xml")
    away = held.rename(tmp_path / "a" / "away")
    assert hand(below) is None
    for named in (str(away / "gripper.xml"), "../../away/gripper.xml"):
        (below / "placed.json").write_text(json.dumps(CLOSED | {"hand": named}))
        assert hand(below) == str(away / "gripper.xml")
    (away / "gripper.xml").write_text("another")
    assert hand(below) is None


@pytest.mark.parametrize(
    "kind, name", [("hand", "gripper.xml"), ("object", "block.json"), ("configuration", "closed.json")]
)
def test_what_changed_or_is_gone_is_said_and_not_shown(held: Path, kind: str, name: str) -> None:
    file = held / name
    file.write_text(file.read_text() + "\n")
    meshes, notes = source_meshes(load_grasp(held / "grasp.json"))
    assert meshes == []
    assert f"the {kind}'s file {file} has changed" in notes[0]
    file.unlink()
    assert f"the {kind}'s file {file} is not there" in source_meshes(load_grasp(held / "grasp.json"))[1][0]


def test_contacts_and_scales_that_were_changed_are_said_and_not_shown(held: Path) -> None:
    data = json.loads((held / "grasp.json").read_text())
    moved = json.loads(json.dumps(data))
    moved["contacts"][0]["position"][2] += 0.2
    (held / "moved.json").write_text(json.dumps(moved))
    meshes, notes = source_meshes(load_grasp(held / "moved.json"))
    assert not meshes
    assert "contact 0 is at least" in notes[0]
    assert "mm off the surface of the object" in notes[0]
    swapped = json.loads(json.dumps(data))
    for contact in swapped["contacts"]:
        contact["link"] = "right_finger" if contact["link"] == "left_finger" else "left_finger"
    (held / "swapped.json").write_text(json.dumps(swapped))
    assert "_finger: contacts, scale or configuration are not" in source_meshes(load_grasp(held / "swapped.json"))[1][0]


def test_a_folder_of_pieces_is_known_by_its_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import trimesh

    monkeypatch.chdir(tmp_path)
    Path("pieces").mkdir()
    trimesh.creation.box((1, 1, 1)).export("pieces/a.stl")
    source = SourceFile.of("pieces", "object")
    assert source is not None
    assert (source.path, len(source.sha256 or ""), source.fault("object")) == (str(tmp_path / "pieces"), 64, "")
    assert SourceFile.of("pieces", "hand") == SourceFile("pieces", None)
    Path("pieces/a.stl").rename("pieces/b.stl")
    assert "has changed" in source.fault("object")


def test_a_grasp_of_numbers_says_that_it_knows_no_sources() -> None:
    meshes, notes = source_meshes(pinch())
    assert (meshes, len(notes)) == ([], 1)
    assert "does not say which hand and object and configuration" in notes[0]
    unnamed = SourceFile("menagerie:hand", None)
    assert "came from no file" in unnamed.fault("hand")


def test_proofs_hold_what_the_equations_know_and_nothing_else(held: Path) -> None:
    grasp = load_grasp(held / "grasp.json")
    assert to_dict(grasp) == to_dict(from_dict(to_dict(grasp)))
    assert {"mass", "center_of_mass", "provenance"}.isdisjoint(to_dict(grasp))
    for changed in (grasp.with_friction(0.9), grasp.with_preload(None)):
        assert (changed.mass, changed.provenance) == (grasp.mass, grasp.provenance)


def test_a_file_of_before_is_read_and_knows_no_mass() -> None:
    old = from_dict(to_dict(pinch()))
    assert (old.mass, old.center_of_mass, old.provenance) == (None, None, None)
    with pytest.raises(InputError, match="mass: is unknown"):
        old.gravity_wrench([0, 0, -1])
    with pytest.raises(InputError, match="center_of_mass: is unknown"):
        old.about(mass=1.0).gravity_wrench([0, 0, -1])
    assert to_dict(old) == file_dict(old)


@pytest.mark.parametrize(
    "more, says",
    [
        ({"mass": -1.0}, "mass: input should be greater than or equal to 0"),
        ({"center_of_mass": [0, 0]}, "center_of_mass"),
        ({"provenance": {"hand": {"path": "h.xml", "sha256": "12"}}}, "provenance.hand.sha256"),
        ({"provenance": {"object": {"path": ""}}}, "provenance.object.path"),
        ({"provenance": {"object": {"path": "o.obj", "scale": 0}}}, "provenance.object.scale"),
        ({"provenance": {"arm": {"path": "a.xml"}}}, "provenance.arm: is not a known field"),
    ],
)
def test_bad_fields_are_named(more: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says):
        from_dict(to_dict(pinch()) | more)


def test_a_mass_that_is_no_number_is_refused_in_python_too() -> None:
    with pytest.raises(InputError, match="mass: is nan"):
        Grasp(pinch().contacts, mass=float("nan"))


def test_a_hand_that_is_part_of_a_robot_is_found_in_its_file(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text("<mujoco/>")
    hand = SourceFile.of(tmp_path / "arm.xml#hand", "hand")
    assert hand is not None
    assert (hand.path, hand.fault("hand")) == (f"{tmp_path / 'arm.xml'}#hand", "")
    there = Provenance(hand=hand).relative_to(tmp_path / "deeper")
    assert there.hand is not None
    assert there.hand.path == "../arm.xml#hand"
    assert there.resolved_from(tmp_path / "deeper") == Provenance(hand=hand)


def test_the_scale_of_a_mesh_is_kept() -> None:
    came = Provenance(object=SourceFile("o.obj", "0" * 64, 0.001))
    said = file_dict(pinch().about(provenance=came))
    assert said["provenance"]["object"]["scale"] == 0.001
    assert from_dict(said, folder=".").provenance == Provenance(
        object=SourceFile(str(Path("o.obj").absolute()), "0" * 64, 0.001)
    )


@pytest.mark.parametrize("name", bundled.names("grasps"))
def test_bundled_grasps_know_their_object_and_their_sources(name: str) -> None:
    grasp = load_grasp(name)
    assert grasp.provenance is not None
    if grasp.provenance.hand is None:  # fingers of no hand in particular
        assert grasp.provenance.object is not None
        assert not grasp.provenance.object.fault("object")
    else:
        assert grasp.provenance.faults() == []
    body = load_body(grasp.provenance.object.path)  # type: ignore[union-attr]
    assert grasp.mass == body.mass
    assert grasp.center_of_mass == pytest.approx(body.center_of_mass)
