"""Tables of a hand's postures: the same labels as of the grasp files that they make, whatever they are packed in."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.core.files import validate
from handfast.core.schema import written
from handfast.core.transforms import matrix_quaternion
from handfast.datasets.dataset_rows import GraspChanges, PosedRow
from handfast.datasets.labels import label_dataset as run_module
from handfast.datasets.labels.label_dataset import label_dataset
from handfast.datasets.labels.label_files import load_labels
from handfast.datasets.labels.labeller import Labelling
from handfast.datasets.labels.verify_labels import about_labels
from handfast.datasets.open_dataset import open_dataset
from handfast.datasets.scene_source import SceneSource
from handfast.geometry.contacts import contact_grasp
from handfast.readers.configuration_file import load_configuration
from tests.support.published import tiny

LITTLE = Labelling(directions=1, gravity=((0, 0, -1.0),), nodes=300)


@pytest.fixture(scope="module")
def scene() -> SceneSource:
    return SceneSource.of("barrett-bh8-280", "can")


@pytest.fixture(scope="module")
def arrays(scene: SceneSource) -> dict[str, Any]:
    """A bundled grasp, and what is wrong with three others like it."""
    placed = load_configuration("barrett-can")
    hand, q = placed.applied(scene.scene().hand)
    joints = np.tile(q, (5, 1))
    position, quaternion = np.tile(placed.pose[:3, 3], (5, 1)), np.tile(matrix_quaternion(placed.pose[:3, :3]), (5, 1))
    joints[1, 2] = np.nan
    joints[2, 0] = 99.0
    position[3] += 1.0
    quaternion[4] *= 2.0
    command = [(placed.preload or {}).get(name, 0.0) for name in hand.mechanism.actuators]
    out = {"joints": joints, "object_position": position, "object_quaternion": quaternion}
    return out | {"preload": np.tile(command, (5, 1)), "mass": np.full(5, 0.2), "friction": np.full(5, 0.6)}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The grasps that labels are asked of; what the questions answer is tested elsewhere."""
    seen: list[Any] = []

    def label(grasp: Any, labelling: Labelling) -> dict[str, Any]:
        seen.append(grasp)
        few: dict[str, Any] = {"contacts": grasp.m, "mass": grasp.mass, "preload": grasp.command.tolist()}
        few |= {"open": 0, "stop": "complete", "nodes": 0, "seconds": 0.0, "status": "labelled"}
        return few | {"contact_frictions": grasp.mu.tolist(), "contact_positions": grasp.positions.tolist()}

    monkeypatch.setattr(run_module, "label", label)
    return seen


def test_rows_become_the_grasps_of_their_postures(
    tmp_path: Path, arrays: dict[str, Any], scene: SceneSource, asked: list[Any]
) -> None:
    np.savez_compressed(tmp_path / "a.npz", **arrays, name=[f"grasp {k}" for k in range(5)])
    label_dataset(tmp_path / "a.npz", tmp_path / "b.jsonl", labelling=LITTLE, scene=scene, jobs=1)
    found = list(load_labels(tmp_path / "b.jsonl"))
    placed = load_configuration("barrett-can")
    hand, q = placed.applied(scene.scene().hand)
    grasp = contact_grasp(hand, q, scene.scene().body, placed.pose, scene=scene.scene())
    assert found[0]["contact_positions"] == pytest.approx(np.array(grasp.positions.tolist()))
    assert set(found[0]["contact_frictions"]) == {0.6}
    assert found[0]["mass"] == 0.2
    assert sum(found[0]["preload"]) == pytest.approx(sum((placed.preload or {}).values()))
    assert found[0]["joints"] == pytest.approx(q)
    assert found[0]["object_position"] == pytest.approx(placed.pose[:3, 3])
    assert [r["name"] for r in found] == [f"grasp {k}" for k in range(5)]
    reasons = [None, "NaN or infinite", "finger_1_spread: is 99", "no link is within", "object_pose.quaternion"]
    assert [r["reason"] is None or part in r["reason"] for r, part in zip(found, reasons, strict=True)] == [True] * 5
    assert [r["status"] for r in found] == ["labelled", *["broken"] * 4]


def test_changes_take_the_place_of_what_a_table_says(
    tmp_path: Path, arrays: dict[str, Any], scene: SceneSource, asked: list[Any]
) -> None:
    np.savez(tmp_path / "a.npz", **{key: value[:1] for key, value in arrays.items()})
    changes = GraspChanges(1.5, (0, 0, 0.01), 0.3, {"finger_1_prox": 0.2})
    label_dataset(tmp_path / "a.npz", tmp_path / "b.jsonl", labelling=LITTLE, scene=scene, changes=changes, jobs=1)
    row = next(load_labels(tmp_path / "b.jsonl"))
    assert (row["mass"], set(row["contact_frictions"]), sum(row["preload"])) == (1.5, {0.3}, 0.2)


def test_a_mass_that_is_no_number_is_not_passed_over(
    tmp_path: Path, arrays: dict[str, Any], scene: SceneSource, asked: list[Any]
) -> None:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    table: dict[str, Any] = {key: value[[0, 0, 0]].tolist() for key, value in arrays.items()}

    def label(**changed: Any) -> list[dict[str, Any]]:
        parquet.write_table(arrow.table(table | changed), tmp_path / "a.parquet")
        out = tmp_path / "b.jsonl"
        label_dataset(tmp_path / "a.parquet", out, labelling=LITTLE, scene=scene, jobs=1, force=True)
        return list(load_labels(out))

    assert [r["mass"] for r in label(mass=[Decimal("0.3"), Decimal("0.4"), None])[:2]] == [0.3, 0.4]
    reasons = [r["reason"] for r in label(mass=["0.3", "x", None])]
    assert reasons == ["mass: is '0.3'; a number is needed", "mass: is 'x'; a number is needed", None]
    assert [r["reason"] for r in label(friction=[True] * 3)] == ["friction: is 'True'; a number is needed"] * 3


def test_parquet_of_lists_and_of_single_columns_say_the_same(tmp_path: Path, arrays: dict[str, Any]) -> None:
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    lists = {key: arrow.array(list(value)) for key, value in arrays.items()}
    parquet.write_table(arrow.table(lists), tmp_path / "lists.parquet")
    flat: dict[str, Any] = {f"joints.j{k}": arrays["joints"][:, k] for k in range(arrays["joints"].shape[1])}
    flat |= {f"object_pose.position.{k}": arrays["object_position"][:, k] for k in range(3)}
    flat |= {f"object_pose.quaternion.{k}": arrays["object_quaternion"][:, k] for k in range(4)}
    parquet.write_table(arrow.table(flat), tmp_path / "flat.parquet")
    one, other = (open_dataset(tmp_path / name) for name in ("lists.parquet", "flat.parquet"))
    assert one.count == other.count == 5
    parts = list(one.parts(2, [range(1, 3)]))
    assert [[row.number for row in part.rows] for part in parts] == [[0], [3, 4]]
    for part, same in zip(parts, other.parts(2, [range(1, 3)]), strict=True):
        assert part.first == same.first
        for a, b in zip(part.rows, same.rows, strict=True):
            assert a.number == b.number
            joints, position = b.content.joints.values(), b.content.position  # type: ignore[union-attr]
            assert np.array_equal(a.content.joints, list(joints), equal_nan=True)  # type: ignore[union-attr]
            assert np.array_equal(a.content.position, position)  # type: ignore[union-attr]
            assert (a.content.mass, b.content.mass) == (0.2, None)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"object_position": None}, "object_position: is missing; it holds "),
        ({"mass": np.zeros(3)}, "are of different lengths: .*mass 3"),
        ({"joints": np.zeros((5, 7, 1))}, r"joints: has shape \(5, 7, 1\)"),
        ({"joints": np.array([["x"]] * 5)}, "joints: is an array of <U1; numbers"),
    ],
)
def test_odd_archives_are_one_line(tmp_path: Path, arrays: dict[str, Any], changed: dict[str, Any], fault: str) -> None:
    np.savez(tmp_path / "a.npz", **{k: v for k, v in (arrays | changed).items() if v is not None})
    with pytest.raises(InputError, match=fault):
        open_dataset(tmp_path / "a.npz")


def test_an_archive_of_objects_is_not_unpickled(tmp_path: Path, arrays: dict[str, Any]) -> None:
    np.savez(tmp_path / "a.npz", **(arrays | {"mass": np.array([{}] * 5, dtype=object)}))
    with pytest.raises(InputError, match="mass: is an array of object; numbers"):
        open_dataset(tmp_path / "a.npz")


def test_tables_and_grasp_files_want_what_they_need(tmp_path: Path, arrays: dict[str, Any], scene: SceneSource) -> None:
    np.savez(tmp_path / "a.npz", **arrays)
    (tmp_path / "a.jsonl").write_text("{}\n")
    with pytest.raises(InputError, match="is a table of postures; give the hand and the object"):
        label_dataset(tmp_path / "a.npz", tmp_path / "b.jsonl")
    with pytest.raises(InputError, match="has grasps with their contacts"):
        label_dataset(tmp_path / "a.jsonl", tmp_path / "b.jsonl", scene=scene)


def test_a_hand_that_changed_ends_the_run_and_breaks_no_row(
    tmp_path: Path, arrays: dict[str, Any], scene: SceneSource
) -> None:
    """A worker that sees other files must not record every row as broken."""
    np.savez(tmp_path / "a.npz", **arrays)
    other = SceneSource(scene.hand, scene.object, hand_sha256="0" * 64)
    with pytest.raises(InputError, match="is not the file of the hand that the labels began with"):
        label_dataset(tmp_path / "a.npz", tmp_path / "b.jsonl", scene=other, jobs=1)
    assert not (tmp_path / "b.jsonl").exists()


def test_laws_of_joints_count_as_asked(arrays: dict[str, Any]) -> None:
    """Stops that were not asked for are none, motors that may be driven back are; the parts of a run know of both."""
    row = PosedRow(arrays["joints"][0], arrays["object_position"][0], arrays["object_quaternion"][0])
    lawful, back, manifests = [], [], []
    for laws, motors in (("all", ()), ("none", ("finger_1_prox",))):
        scene = SceneSource.of("barrett-bh8-280", "can", joint_laws=laws, backdrivable=motors)
        mechanism = scene.grasp(row, "a", GraspChanges()).mechanism
        lawful.append(any(joint.law.any for joint in scene.scene().hand.joints))
        back.append([name for name, b in zip(mechanism.actuators, mechanism.backdrivable, strict=True) if b])
        manifests.append(written(scene.relative_to(Path())))
    assert (lawful, back) == ([True, False], [[], ["finger_1_prox"]])
    assert manifests[0] != manifests[1]
    with pytest.raises(InputError, match="thumb"):
        SceneSource.of("barrett-bh8-280", "can", backdrivable=("thumb",))


def test_odd_changes_are_refused() -> None:
    with pytest.raises(InputError, match="mass: is 0"):
        GraspChanges(mass=0.0)
    with pytest.raises(InputError, match="friction: is -1"):
        GraspChanges(friction=-1.0)


def test_a_project_can_be_moved(tmp_path: Path) -> None:
    """Hand, object, postures and labels together; the hand stands too far away, which breaks the row."""

    def run(folder: Path, **how: Any) -> Any:
        scene = SceneSource.of(str(folder / "tiny.xml"), str(folder / "objects" / "cube" / "cube.obj"))
        return label_dataset(folder / "a.npz", folder / "b.jsonl", labelling=LITTLE, scene=scene, jobs=1, **how)

    before, after = tmp_path / "before", tmp_path / "after"
    tiny(before)
    row = {"joints": [[0.0, 0.0]], "object_position": [[0.0, 0, 1]], "object_quaternion": [[1.0, 0, 0, 0]]}
    np.savez(before / "a.npz", **{key: np.array(value) for key, value in row.items()})
    assert run(before).broken == 1
    before.rename(after)
    assert (run(after, resume=True).rows, run(after, resume=True).fresh) == (1, 0)
    scene = about_labels(after / "b.jsonl")["scene"]
    assert (scene["hand"], scene["object"]) == ("tiny.xml", "objects/cube/cube.obj")
    assert validate(SceneSource, scene).resolved_from(after).hand == str((after / "tiny.xml").resolve())
    (after / "tiny.xml").write_text((after / "tiny.xml").read_text().replace("0.008", "0.009"))
    with pytest.raises(InputError, match="is of another dataset or of other questions"):
        run(after, resume=True)
