"""`handfast import` and `handfast export`, as a user runs them."""

from __future__ import annotations

import csv
import json
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from handfast import load_body, load_configuration, load_grasp, load_hand
from handfast.core import bundled
from handfast.core.transforms import quaternion_matrix, transform
from handfast.datasets.published.exporting import exported_from
from handfast.datasets.published.mapping_file import MAPPING_KIND, HandMapping, read_mapping
from handfast.datasets.published.published_file import LAYOUTS, read_published
from handfast.datasets.published.recorded import RecordedGrasp
from handfast.geometry.scene import Scene
from handfast.planning.results import grasps_file
from tests.support.places import ROOT
from tests.support.program import ask, complains, run
from tests.support.published import LEFT, RIGHT, dexgraspnet_row, root, row, samples, saved_npy, tiny


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    tiny(tmp_path)
    return tmp_path


WITH = ["--hand", "tiny.xml", "--mapping", "tiny.json", "--objects", "objects", "--jobs", "1"]


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_layout_becomes_the_same_grasp(name: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = samples(here)[name]
    mapping = "tiny.json"
    if name == "graspgen":  # has no joints: the mapping says them
        about = json.loads(Path(mapping).read_text())
        Path(mapping).write_text(json.dumps(about | {"values": {"left_hinge": LEFT, "right_hinge": RIGHT}}))
    answer = ask(capsys, "import", str(file), *WITH, "--no-separate", "--no-close-gaps", "-o", "out", "--mass", "0.1")
    (said,) = answer["rows"]
    assert said["layout"] == name
    assert "reason" not in said
    placed = load_configuration("out/00000.configuration.json")
    hand = load_hand("tiny.xml")
    _, q = placed.applied(hand)
    assert hand.values(q) == pytest.approx({"left_hinge": LEFT, "right_hinge": RIGHT}, abs=1e-6)
    palm = np.linalg.inv(placed.pose) @ hand.link_poses(q)[hand.link("palm")]
    offset = np.eye(4)
    offset[2, 3] = 0.034
    assert np.allclose(palm, root() @ offset, atol=1e-6)
    assert placed.object is not None
    assert load_body(placed.object).mass == 0.1
    assert {c.link for c in load_grasp("out/00000.grasp.json").contacts} == {"left", "right"}


def test_the_treatment_is_said_and_nothing_penetrates(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = np.array([dexgraspnet_row(), {"scale": 1.0}, dexgraspnet_row(turn=0.5)], dtype=object)
    file = saved_npy(here / "cube.npy", rows)
    answer = ask(capsys, "import", str(file), *WITH, "-o", "out")
    first, broken, last = answer["rows"]
    assert broken == {"file": str(file), "index": 1, "layout": "dexgraspnet", "reason": "qpos: is missing"}
    assert last["configuration_file" if "configuration_file" in last else "index"] == 2
    assert first["penetration_before"] > 1e-3
    assert first["penetration_after"] < 1e-5
    assert first["surface_moved"] > 1e-4
    assert first["contacts"] <= first["contacts_before"]
    assert first["reduction_error"] <= 0.05
    assert json.loads(Path("out/import.json").read_text())["rows"][2]["grasp_file"] == "00001.grasp.json"
    placed = load_configuration("out/00001.configuration.json")
    hand, q = placed.applied(load_hand("tiny.xml"))
    assert placed.object is not None
    assert Scene(hand, load_body(placed.object)).distance(q, placed.pose).min() > -1e-5
    status, out, _ = run(capsys, "import", str(file), *WITH, "-o", "other")
    assert status == 0
    assert "2 of 3 grasps imported (dexgraspnet, mapping tiny.json)" in out
    assert "penetration as published" in out
    assert "qpos: is missing" in out


def test_scales_are_of_the_grasp_and_of_the_command(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = np.array([dexgraspnet_row() | {"scale": 0.5}], dtype=object)
    answer = ask(capsys, "import", str(saved_npy(here / "cube.npy", rows)), *WITH, "--scale", "2.0", "-o", "out")
    assert answer["rows"][0]["scale"] == 1.0
    name = load_configuration("out/00000.configuration.json").object
    assert name is not None
    assert np.ptp(load_body(name).vertices[:, 0]) == pytest.approx(0.04)


def test_tables(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(samples(here)["dexgraspbench"])
    assert run(capsys, "import", file, *WITH, "-o", "t.csv")[0] == 0
    (flat,) = csv.DictReader(Path("t.csv").read_text().splitlines())
    assert float(flat["joints.left_hinge"]) == pytest.approx(float(flat["squeeze.left_hinge"]), abs=0.3)
    assert run(capsys, "import", file, *WITH, "-o", "t.jsonl")[0] == 0
    (entry,) = map(json.loads, Path("t.jsonl").read_text().splitlines())
    assert len(entry["contact_list"]) == entry["contacts"] == len(json.loads(flat["contact_list"]))
    complains(capsys, ["import", file, *WITH, "-o", "t.csv"], ["t.csv: exists already; give --force"])


def test_parquet_asks_for_what_it_needs_before_the_work(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    says = ["t.parquet: needs pandas and pyarrow, which are not installed; a .csv or .jsonl needs neither"]
    complains(capsys, ["import", "none.npy", *WITH, "-o", "t.parquet"], says)


def test_yaml_asks_for_what_it_needs(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (here / "cube.yaml").write_text("format: isaac_grasp\n")
    monkeypatch.setitem(sys.modules, "yaml", None)
    complains(
        capsys, ["import", "cube.yaml", *WITH, "-o", "out"], ["cube.yaml: is YAML, which needs PyYAML: pip install"]
    )


def test_without_contacts_no_object_is_needed(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "objects" / "cube" / "cube.obj").unlink()
    file = str(saved_npy(here / "mug.npy", np.array([dexgraspnet_row()], dtype=object)))
    answer = ask(capsys, "import", file, *WITH, "--no-contacts", "-o", "out")
    assert "reason" not in answer["rows"][0]
    assert not list(Path("out").glob("*.grasp.json"))
    answer = ask(capsys, "import", file, *WITH, "-o", "with", status=2)
    assert "object 'mug' was not found below objects; give --objects FOLDER" in answer["rows"][0]["reason"]


def test_paths_in_files_are_not_followed(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "elsewhere").mkdir()
    data = {"grasp_qpos": row(), "obj_path": str(here / "objects" / "cube")}
    file = str(saved_npy(here / "elsewhere" / "0.npy", data))
    plain = [w for w in WITH if w not in ("--objects", "objects")]
    answer = ask(capsys, "import", file, *plain, "-o", "out", status=2)
    assert "was not found beside the file" in answer["rows"][0]["reason"]
    assert not Path("out").exists()
    assert "reason" not in ask(capsys, "import", file, *WITH, "-o", "out")["rows"][0]
    relative = saved_npy(here / "elsewhere" / "1.npy", data | {"obj_path": "../../objects/cube"})
    assert "reason" not in ask(capsys, "import", str(relative), *plain, "-o", "out2")["rows"][0]


def test_what_is_missing_is_asked_for_in_one_line(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(samples(here)["dexgraspbench"])
    hand = ["--hand", "tiny.xml"]
    complains(capsys, ["import", file, *hand], ["import: missing: -o FOLDER, or a table"])
    complains(capsys, ["import", file, "-o", "out"], ["import: missing: --hand HAND"])
    complains(capsys, ["import", *hand, "-o", "out"], ["import: missing: FILE..."])
    complains(capsys, ["import", "objects", *hand, "-o", "out"], ["objects: has no files of published grasps"])
    says = [
        "tiny.xml: is no hand that a bundled mapping knows (bundled for dexgraspbench: allegro-mjcf",
        "--mapping FILE",
    ]
    complains(capsys, ["import", file, *hand, "-o", "out"], says)
    complains(capsys, ["import", file, *hand, "--mapping", "shadow-mjcf", "-o", "out"], ["unknown link 'rh_palm'"])
    complains(capsys, ["import", file, *WITH, "-o", "out", "--tolerance", "2"], ["--tolerance: is 2; a number from 0"])
    complains(capsys, ["import", file, *WITH, "-o", "out", "--threshold", "0"], ["--threshold: is 0; a number above 0"])
    complains(
        capsys, ["import", file, *WITH, "-o", "out", "--mass", "1e60"], ["--mass: is 1e+60; a number above 0, at"]
    )
    complains(capsys, ["import", file, *WITH, "-o", "out", "--friction", "-1"], ["--friction: is -1; a friction coeff"])
    complains(capsys, ["import", file, *WITH[:-2], "-o", "out", "--jobs", "-1"], ["--jobs: is -1; 0 or more is needed"])
    complains(capsys, ["import", file, *WITH, "-o", "out", "--object", "none"], ["none: no such file, and no bundled"])
    about = json.loads(Path("tiny.json").read_text())
    Path("twice.json").write_text(json.dumps(about | {"joints": ["left_hinge", "left_hinge"]}))
    says = ["twice.json: joints: has 'left_hinge' twice; each number of a file is one joint's"]
    complains(capsys, ["import", file, *hand, "--mapping", "twice.json", "-o", "out"], says)
    (here / "empty").mkdir()
    complains(capsys, ["import", file, *WITH, "-o", "out", "--object", "empty"], ["empty: is a folder without meshes"])
    complains(capsys, ["import", file, *WITH, "-o", "tiny.xml"], ["tiny.xml: is a file; a folder, or a table"])
    complains(capsys, ["import", "none.npy", *WITH, "-o", "out"], ["none.npy: no such file"])
    assert not Path("out").exists()


def test_a_row_whose_object_can_be_no_file_does_not_stop_the_others(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [
        str(saved_npy(here / f"{k}.npy", {"grasp_qpos": row(), "obj_path": name}))
        for k, name in enumerate(["x" * 5000, "cube"])
    ]
    broken, good = ask(capsys, "import", *files, *WITH, "-o", "out")["rows"]
    assert broken["reason"] == "the object's file cannot be read: File name too long"
    assert "reason" not in good


def test_two_names_of_one_joint_are_refused(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = samples(here)["isaac_grasp"]
    Path("names.json").write_text(
        json.dumps(json.loads(Path("tiny.json").read_text()) | {"names": {"L": "left_hinge", "R": "left_hinge"}})
    )
    with_names = [w.replace("tiny.json", "names.json") for w in WITH]
    (said,) = ask(capsys, "import", str(file), *with_names, "-o", "out", status=2)["rows"]
    assert "'left_hinge' has two values of the file" in said["reason"]


def test_reasons_are_told_to_their_end(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(saved_npy(here / "0.npy", {"grasp_qpos": row(), "obj_path": "a-cup-of-some-collection-" * 3}))
    status, out, _ = run(capsys, "import", file, *WITH, "-o", "out")
    assert status == 2
    assert "or --object OBJECT for all" in " ".join(out.split())


def test_one_folder_of_pieces_for_all(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(samples(here)["dexgraspbench"])
    whole = ask(capsys, "import", file, *WITH, "-o", "out")["rows"][0]
    folder = ask(capsys, "import", file, *WITH, "-o", "out2", "--object", "objects/cube")["rows"][0]
    assert folder["contacts"] == whole["contacts"]
    assert load_grasp("out2/00000.grasp.json").contacts[0].position == pytest.approx(
        load_grasp("out/00000.grasp.json").contacts[0].position
    )


@pytest.mark.parametrize(
    "change, says",
    [
        ({"grasp_qpos": row((0.1,))}, "has 1 joint values; the mapping names 2"),
        ({"grasp_qpos": row((0.1, 1.5))}, "left_hinge: is 1.5; the limits are [-0.6, 0.8]: is it the right hand"),
        ({"grasp_qpos": row((0.5, 0.5))}, "mm inside its object: is it the right hand, mapping and scale?"),
        ({"grasp_qpos": row((-0.5, -0.5))}, "touches nothing within 0.5 mm"),
    ],
)
def test_rows_that_cannot_be_placed(
    change: dict[str, object], says: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = str(saved_npy(here / "0.npy", {"obj_path": "cube"} | change))
    assert says in ask(capsys, "import", file, *WITH, "-o", "out", status=2)["rows"][0]["reason"]


@pytest.mark.parametrize("layout, target", [("isaac_grasp", "x.yaml"), ("graspgen", "x.json"), ("dexgraspbench", "x")])
def test_exports_come_back(layout: str, target: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ask(capsys, "import", str(samples(here)["bodex"]), *WITH, "-o", "out", "--no-separate", "--no-close-gaps")
    command = ["export", "out", "--layout", layout, "--mapping", "tiny.json", "-o", target]
    assert run(capsys, *command)[0] == 0
    found, rows = read_published(Path(target) / "0.npy" if layout == "dexgraspbench" else target)
    (grasp,) = rows
    assert found == layout
    assert isinstance(grasp, RecordedGrasp)
    assert np.allclose(grasp.grasp.root, root(), atol=1e-9)
    if layout == "isaac_grasp":
        assert grasp.grasp.joints == pytest.approx({"L": LEFT, "R": RIGHT})
        assert grasp.pregrasp is not None
        assert grasp.pregrasp.joints == pytest.approx({"L": -0.1, "R": -0.1})
    if layout == "dexgraspbench":
        assert np.allclose(grasp.grasp.joints, [RIGHT, LEFT])  # type: ignore[arg-type]
        assert grasp.squeeze is not None
        assert np.allclose(grasp.squeeze.joints, [0.3, 0.3])  # type: ignore[arg-type]
        assert grasp.object == "/far/cube/mesh/cube.obj"
    complains(capsys, command, ["exists already; give --force"])


@pytest.mark.parametrize(
    "layout, target", [("isaac_grasp", "a.json"), ("graspgen", "a.yaml"), ("dexgraspbench", "a.npy")]
)
def test_an_ending_of_another_layout_is_no_folder(
    layout: str, target: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(capsys, "close", "barrett-bh8-280", "slab", "--pose", "fig11", "-o", "closed.json")[0] == 0
    command = ["export", "closed.json", "--layout", layout, "-o", target]
    complains(capsys, command, [f"{target}: is no name for {layout}; a folder"])
    assert not Path(target).exists()


def test_exports_of_what_close_wrote(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    configuration = bundled.resolve("configurations", "barrett-can")
    assert run(capsys, "export", configuration, "--layout", "isaac_grasp", "-o", "can.yaml")[0] == 0
    (grasp,) = read_published("can.yaml")[1]
    assert isinstance(grasp, RecordedGrasp)
    placed = load_configuration(configuration)
    assert np.allclose(np.linalg.inv(grasp.grasp.root), placed.pose)
    complains(capsys, ["export", ".", "--layout", "graspgen", "-o", "x"], [".: has no configurations; a folder of"])
    complains(capsys, ["export", configuration, "-o", "x"], ["export: missing: --layout isaac_grasp, graspgen"])
    complains(capsys, ["export", configuration, "--layout", "bodex", "-o", "x"], ["unknown layout 'bodex'"])
    complains(capsys, ["export", configuration, "--layout", "graspgen"], ["export: missing: -o FOLDER"])


def test_folders_of_configurations_keep_their_order(here: Path) -> None:
    text = Path(bundled.resolve("configurations", "barrett-can")).read_text()
    for name in ("configuration-10", "configuration-2", "configuration-1"):
        Path(f"{name}.json").write_text(json.dumps(json.loads(text) | {"object": name}))
    found = exported_from(here)
    assert [g.object for g in found] == ["configuration-1", "configuration-2", "configuration-10"]


def test_the_grasps_of_a_task(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hand, pose = load_hand("schunk-sah"), transform([0.01, 0.02, 0.03])
    task = SimpleNamespace(hand=hand, object="scalpel")
    grasp = SimpleNamespace(solution=SimpleNamespace(task=task, pose=pose), q=hand.configuration())
    monkeypatch.setattr(grasps_file, "from_dict", lambda data: SimpleNamespace(grasps=[grasp]))
    Path("grasps.json").write_text(json.dumps({"schema": "handfast/grasps/1"}))
    (found,) = exported_from(Path("grasps.json"))
    assert found.object == "scalpel"
    assert found.configuration.hand == "schunk-sah"
    assert np.allclose(found.configuration.pose, pose)


def test_several_files(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = [str(saved_npy(here / f"{k}.npy", {"grasp_qpos": row(), "obj_path": "cube"})) for k in range(3)]
    (here / "bad.npy").write_bytes(b"cos\nsystem\n.")
    rows = ask(capsys, "import", "bad.npy", *good, *WITH, "-o", "out")["rows"]
    assert "names os.system" in rows[0]["reason"]
    assert [r["file"] for r in rows[1:]] == good
    assert len(ask(capsys, "import", *good, *WITH, "-o", "out", "--force", "--count", "2")["rows"]) == 2
    assert len(list(Path("out").glob("0*.json"))) == 4
    Path("some", "deeper").mkdir(parents=True)
    for file in good:
        Path(file).rename(Path("some", "deeper", Path(file).name))
    assert [Path(r["file"]).name for r in ask(capsys, "import", "some", *WITH, "-o", "f")["rows"]] == [
        "0.npy",
        "1.npy",
        "2.npy",
    ]
    for file in good:
        Path("some", "deeper", Path(file).name).rename(file)
    assert run(capsys, "import", *good, *WITH[:-1], "2", "-o", "two")[0] == 0
    one, two = (json.loads(Path(f, "00001.grasp.json").read_text()) for f in ("out", "two"))
    sources = [
        grasp.pop("provenance") for grasp in (one, two)
    ]  # their configurations were not written for the same rows
    assert one == two
    assert [set(s) for s in sources] == [{"hand", "object", "configuration"}] * 2
    plain = [w for w in WITH if w not in ("--mapping", "tiny.json")]
    complains(
        capsys, ["import", "bad.npy", "bad.npy", *plain, "-o", "x"], ["none of 2 files can be read; the first: bad.npy"]
    )
    other = str(samples(here)["mj_grasp_sim"])
    says = ["several layouts (dexgraspbench, mj_grasp_sim); import one layout at a time"]
    complains(capsys, ["import", good[0], other, *plain, "-o", "x"], says)


def test_the_same_hand_in_two_layouts() -> None:
    """Between BODex and DexGraspBench: R = R' Q^T, p = p' - R t, with t and Q of the MJCF's palm."""
    turn, place = (
        {"shadow": [1, 0, 0, 0], "allegro": [0, 1, 0, 1], "leap": [0, 1, 0, 0]},
        {"shadow": 0.034, "leap": 0.1},
    )
    for name, quaternion in turn.items():
        world = transform([0.1, 0.2, 0.3], quaternion_matrix([0.5, 0.5, -0.5, 0.5]) @ quaternion_matrix(quaternion).T)
        world[:3, 3] -= world[:3, :3] @ [0, 0, place.get(name, 0)]
        palm = world @ read_mapping(f"{name}-mjcf").offset.matrix
        other = transform([0.1, 0.2, 0.3], quaternion_matrix([0.5, 0.5, -0.5, 0.5]))
        assert np.allclose(palm, other @ read_mapping(f"{name}-bodex").offset.matrix)


def test_bundled_mappings_are_whole() -> None:
    page = (ROOT / "docs" / "published-grasps.md").read_text("utf-8")
    assert all(f"| `{name}` |" in page for name in HandMapping.model_fields if name != "schema_")
    names = bundled.names(MAPPING_KIND)
    assert {"shadow-mjcf", "allegro-mjcf", "leap-mjcf", "franka-mjcf"} <= set(names)
    for name in names:
        found = read_mapping(name)
        assert f"`{name}`" in page
        assert set(found.layouts) <= set(LAYOUTS)
        for order in (found.joints or [], list(found.names.values())):
            assert len(set(order)) == len(order)


def test_a_folder_can_be_moved(here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the objects that it was made of, and from wherever it is read."""
    file = str(samples(here)["bodex"])
    ask(capsys, "import", file, *WITH, "-o", "out")
    (here / "elsewhere").mkdir()
    Path("out").rename("elsewhere/moved")
    shutil.rmtree("objects")
    monkeypatch.chdir(here / "elsewhere" / "moved" / "objects")
    folder = here / "elsewhere" / "moved"
    placed, came = load_configuration("../00000.configuration.json"), load_grasp("../00000.grasp.json").provenance
    assert placed.object
    assert came
    assert came.object
    assert Path(placed.object).resolve() == Path(came.object.path) == folder / "objects" / "cube-1.json"
    assert load_body(placed.object).name == "cube"
    texts = [f.read_text() for f in folder.rglob("*.json") if f.name != "import.json"]
    assert not any(str(here) in text for text in texts)  # no absolute path


def test_grasps_without_commands_are_told(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(samples(here)["bodex"])
    _, out, _ = run(capsys, "import", file, *WITH, "-o", "locked")
    said = " ".join(out.split())
    assert "1 of 1 grasps come without commands: their motors are locked" in said
    assert "--gain KP" in said
    assert "`handfast label locked -o labels.jsonl --mass KG`" in said
    _, out, _ = run(capsys, "import", file, *WITH, "-o", "pulled", "--gain", "0.5")
    assert "without commands" not in out
