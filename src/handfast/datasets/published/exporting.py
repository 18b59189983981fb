"""Grasps of ours in the layouts of others: isaac_grasp, GraspGen, DexGraspBench."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import FaultsOf, InputError
from handfast.core.files import read_json, refuse_existing, write_bytes, write_text
from handfast.core.libraries import optional
from handfast.core.transforms import matrix_quaternion
from handfast.datasets.published.import_folder import IMPORT_SUMMARY
from handfast.datasets.published.layouts import AT_ORIGIN
from handfast.datasets.published.mapping_file import HandMapping, root_of, turned
from handfast.model.configuration import Configuration
from handfast.model.hand.hand import Hand
from handfast.readers.configuration_file import load_configuration

FORMAT_ENDINGS = {"isaac_grasp": ".yaml", "graspgen": ".json", "dexgraspbench": ""}


@dataclass(frozen=True, eq=False)
class ExportedGrasp:
    """A configuration, and what an import knew beside it.

    Attributes:
        configuration: as in its file.
        squeeze, pregrasp: joint values by name, where they are known.
        score: a confidence, where it is known.
        object: as the file is to name it; scale: of its mesh.
    """

    configuration: Configuration
    squeeze: dict[str, float] | None = None
    pregrasp: dict[str, float] | None = None
    score: float | None = None
    object: str = ""
    scale: float = 1.0


def exported_from(path: Path) -> list[ExportedGrasp]:
    """The configurations of a folder that `import`, `plan` or `grasp` filled, of `grasps.json`, or of a file.

    Raises:
        InputError: no such file or folder, no configurations in it, a broken one.
    """
    if path.is_dir():
        if (path / IMPORT_SUMMARY).is_file():
            return _imported(path)
        files = sorted({*path.glob("*configuration*.json")}, key=_natural)
        if not files:
            raise InputError(
                "has no configurations; a folder of `import`, `plan` or `grasp` is needed", source=str(path)
            )
        return [_plain(load_configuration(file)) for file in files]
    data = read_json(path, "configuration or grasps")
    if isinstance(data, dict) and str(data.get("schema", "")).startswith("handfast/grasps/"):
        return _searched(path, data)
    return [_plain(load_configuration(path))]


def _natural(path: Path) -> list[Any]:
    """Sorts configuration-2 before configuration-10: texts and numbers in turns."""
    return [int(part) if i % 2 else part for i, part in enumerate(re.split(r"(\d+)", path.name))]


def _plain(configuration: Configuration) -> ExportedGrasp:
    return ExportedGrasp(configuration, object=configuration.object or "")


def _imported(path: Path) -> list[ExportedGrasp]:
    summary = read_json(path / IMPORT_SUMMARY, "import")
    rows = summary.get("rows") if isinstance(summary, dict) else None
    if not isinstance(rows, list):
        raise InputError("has no rows", source=str(path / IMPORT_SUMMARY))
    found = []
    for row in rows:
        name = row.get("configuration_file") if isinstance(row, dict) else None
        if isinstance(name, str) and Path(name).name == name:
            keys = {k: row[k] for k in ("squeeze", "pregrasp", "score", "object", "scale") if row.get(k) is not None}
            found.append(ExportedGrasp(load_configuration(path / name), **keys))
    if not found:
        raise InputError("names no configurations", source=str(path / IMPORT_SUMMARY))
    return found


def _searched(path: Path, data: Any) -> list[ExportedGrasp]:
    from handfast.planning.results import grasps_file

    with FaultsOf(path):
        saved = grasps_file.from_dict(data)
    found = []
    for g in saved.grasps:
        hand = g.solution.task.hand
        named = {"hand": hand.source or hand.name, "object": g.solution.task.object}
        found.append(_plain(Configuration.of(hand, g.q, g.solution.pose, **named)))
    return found


def export(
    grasps: Sequence[ExportedGrasp], hand: Hand, mapping: HandMapping, layout: str, target: Path, *, force: bool = False
) -> list[Path]:
    """Write grasps in a layout; the files that were written.

    isaac_grasp and GraspGen files are about one object: one file, or one an object in a folder. DexGraspBench has a
    file for each grasp, in a folder.

    Args:
        target: a file, or a folder.

    Raises:
        InputError: a layout without an export, joints that the hand has not got, a file that exists, several objects
            and a single file.
    """
    if layout not in FORMAT_ENDINGS:
        raise InputError(f"unknown layout '{layout}'; exports are {', '.join(FORMAT_ENDINGS)}", field="--layout")
    single = target.suffix.lower() == FORMAT_ENDINGS[layout] or (layout == "isaac_grasp" and target.suffix == ".yml")
    if target.suffix.lower() in (".yaml", ".yml", ".json", ".npy") and not single:
        right = f"a folder, or a file that ends in {FORMAT_ENDINGS[layout]}," if FORMAT_ENDINGS[layout] else "a folder"
        raise InputError(f"is no name for {layout}; {right} is needed", source=str(target))
    if layout == "dexgraspbench":
        return _benchmark(grasps, hand, mapping, target, force)
    groups: dict[tuple[str, float], list[ExportedGrasp]] = {}
    for g in grasps:
        groups.setdefault((g.object, g.scale), []).append(g)
    if single and len(groups) > 1:
        raise InputError(f"is one file for {len(groups)} objects; give a folder", source=str(target))
    texts: dict[Path, str] = {}
    for (name, scale), group in groups.items():
        stem = Path(name).stem if Path(name).suffix in (".json", ".obj", ".stl", ".ply", ".off") else Path(name).name
        stem = "".join(c if c.isalnum() or c in "-_." else "-" for c in stem) or "grasps"
        file = target if single else target / f"{stem}{'' if scale == 1 else f'-{scale:g}'}{FORMAT_ENDINGS[layout]}"
        if file in texts:
            raise InputError("would hold two objects of one name; export them one by one", source=str(file))
        texts[file] = _text(group, hand, mapping, layout, name, scale)
    for file in texts:
        refuse_existing(file, force=force)
    for file, text in texts.items():
        write_text(file, text, force=force)
    return list(texts)


def _text(
    group: Sequence[ExportedGrasp], hand: Hand, mapping: HandMapping, layout: str, name: str, scale: float
) -> str:
    at = [_placed(g, hand) for g in group]
    roots = [root_of(hand, mapping, q, g.configuration.pose) for q, g in zip(at, group, strict=True)]
    scores = [g.score for g in group]
    if layout == "graspgen":
        held = [True if s is None else s > 0 for s in scores]
        about = {"file": name, "scale": scale}
        written = {"object": about, "grasps": {"transforms": [r.tolist() for r in roots], "object_in_gripper": held}}
        return json.dumps(written, indent=1) + "\n"
    names = {ours: theirs for theirs, ours in mapping.names.items()}

    def theirs(values: dict[str, float]) -> dict[str, float]:
        return {names.get(n, n): v for n, v in turned(mapping, values).items()}

    entries = {}
    for i, (g, q, root) in enumerate(zip(group, at, roots, strict=True)):
        w, *xyz = matrix_quaternion(root[:3, :3]).tolist()
        entries[f"grasp_{i}"] = {
            "confidence": 1.0 if g.score is None else g.score,
            "position": root[:3, 3].tolist(),
            "orientation": {"w": w, "xyz": xyz},
            "cspace_position": theirs(hand.values(q)),
            **({} if g.pregrasp is None else {"pregrasp_cspace_position": theirs(g.pregrasp)}),
        }
    yaml = optional("yaml", "isaac_grasp is YAML, which needs PyYAML: pip install 'handfast[published]'")
    frames = {"object_frame_link": name, "gripper_frame_link": mapping.link or hand.links[0].name}
    written = {"format": "isaac_grasp", "format_version": 1.0, **frames, "grasps": entries}
    return str(yaml.safe_dump(written, sort_keys=False))


def _benchmark(
    grasps: Sequence[ExportedGrasp], hand: Hand, mapping: HandMapping, target: Path, force: bool
) -> list[Path]:
    order = mapping.joints or list(hand.joint_names)
    index = [hand.joint(name) for name in order]
    sense = np.array([-1.0 if name in mapping.reversed else 1.0 for name in order])
    files = {}
    for k, g in enumerate(grasps):
        q = _placed(g, hand)
        root = root_of(hand, mapping, q, g.configuration.pose)
        at = np.r_[root[:3, 3], matrix_quaternion(root[:3, :3])]
        rows: dict[str, Any] = {"obj_pose": np.array(AT_ORIGIN), "obj_scale": g.scale, "obj_path": g.object}
        rows["grasp_qpos"] = np.r_[at, sense * q[index]]
        for key, values in (("pregrasp_qpos", g.pregrasp), ("squeeze_qpos", g.squeeze)):
            there = q if values is None else hand.configuration(values)
            rows[key] = np.r_[at, sense * there[index]]
        files[target / f"{k}.npy"] = rows
    for file in files:
        refuse_existing(file, force=force)
    for file, data in files.items():
        packed = io.BytesIO()
        np.save(packed, np.array(data, dtype=object), allow_pickle=True)
        write_bytes(file, packed.getvalue(), force=force)
    return list(files)


def _placed(g: ExportedGrasp, hand: Hand) -> Array:
    return hand.configuration(g.configuration.joints)
