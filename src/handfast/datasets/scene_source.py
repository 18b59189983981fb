"""The hand and the object of a table of postures: named once, read and compiled by each worker when it needs them."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.bundled import relative_path
from handfast.core.errors import InputError
from handfast.core.files import same_json
from handfast.core.schema import InFiles
from handfast.datasets.dataset_rows import GraspChanges, PosedRow
from handfast.geometry.contacts import contact_grasp
from handfast.geometry.scene import Scene
from handfast.model.grasp import Grasp
from handfast.model.provenance import SourceFile
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand

_own = threading.local()  # a scene is not to be shared between threads


@dataclass(frozen=True)
class SceneSource(InFiles):
    """How to come by the scene of a hand and an object, on any machine that sees their files.

    Attributes:
        hand: as `load_hand` takes it; root: of what is read of it.
        object: as `load_body` takes it; scale: metres per unit of its mesh.
        threshold: [m] surfaces nearer than this touch.
        joint_laws: which of the hand's joint laws count, see `Hand.with_laws`.
        backdrivable: motors that give what they are commanded and no more.
        hand_sha256, object_sha256: of the two files, for whoever goes on elsewhere or later.
    """

    hand: str
    object: str
    root: str | None = None
    hand_sha256: str | None = None
    object_sha256: str | None = None
    scale: float = 1.0
    threshold: float = 5e-4
    joint_laws: str = "all"
    backdrivable: tuple[str, ...] = ()

    @classmethod
    def of(cls, hand: str, object: str, **others: Any) -> SceneSource:
        """With absolute paths and checksums; raises `InputError` as the loaders do."""
        bare = cls(_absolute(hand, Path()), _absolute(object, Path()), **others)
        files = {"hand": load_hand(bare.hand, root=bare.root).source, "object": bare.object}
        hand_sum, object_sum = (f.sha256 if (f := SourceFile.of(x, kind)) else None for kind, x in files.items())
        made = replace(bare, hand_sha256=hand_sum, object_sha256=object_sum)
        made.scene()  # what is wrong with the object is said now; forked workers have it ready
        return made

    def scene(self) -> Scene:
        """The compiled scene, of this thread; `InputError` if files are missing or others."""
        if getattr(_own, "source", None) != self:
            hand = load_hand(self.hand, root=self.root)
            body = load_body(self.object, scale=self.scale)
            for kind, source in (("hand", hand.source), ("object", self.object)):
                found, known = SourceFile.of(source, kind), getattr(self, f"{kind}_sha256")
                if known and found and found.sha256 != known:
                    raise InputError(f"is not the file of the {kind} that the labels began with", source=source)
            lawful = hand.with_laws(self.joint_laws).with_backdrivable(self.backdrivable)
            _own.source, _own.scene = self, Scene(lawful, body)
        return _own.scene

    def joints_of(self, row: PosedRow) -> Array:
        """(l,) the configuration of a row; raises `InputError`."""
        hand = self.scene().hand
        return hand.configuration(_named(row.joints, hand.joint_names, "joints"))

    def grasp(self, row: PosedRow, name: str, changes: GraspChanges) -> Grasp:
        """The grasp that the hand has in a row's posture; raises `InputError`."""
        scene, q = self.scene(), self.joints_of(row)
        hand = scene.hand
        pose = _numbers(row.position, 3, "object_position"), _numbers(row.quaternion, 4, "object_quaternion")
        preload: Mapping[str, float] | None = changes.preload
        if preload is None and row.preload is not None:
            preload = _named(row.preload, hand.mechanism.actuators, "preload")
        friction = _number(row.friction, "friction") if changes.friction is None else changes.friction
        grasp = contact_grasp(
            hand, q, scene.body, pose, threshold=self.threshold, friction=friction, scene=scene, name=name
        )
        if preload is not None:  # of motors that move no contact nothing is asked
            kept = {n: f for n, f in preload.items() if n in grasp.mechanism.actuators}
            hand.mechanism.commands(preload, field="preload")  # what nobody knows is refused
            grasp = grasp.with_preload(kept)
        mass = _number(row.mass, "mass") if changes.mass is None else changes.mass
        if mass is not None or changes.center_of_mass is not None:
            grasp = grasp.about(mass=mass, center_of_mass=changes.center_of_mass)
        return grasp

    def relative_to(self, folder: Path) -> SceneSource:
        """With paths as they stand in a file in a folder."""
        return replace(self, hand=_seen_from(folder, self.hand), object=_seen_from(folder, self.object))

    def resolved_from(self, folder: Path) -> SceneSource:
        """With the paths of a file in a folder, absolute."""
        return replace(self, hand=_absolute(self.hand, folder), object=_absolute(self.object, folder))


def same_scene(one: Mapping[str, Any] | None, other: Mapping[str, Any] | None) -> bool:
    """Do two files speak of the same scene? Where a checksum is known the place of the file does not matter."""

    def plain(said: Mapping[str, Any] | None) -> Any:
        return said and {
            k: v for k, v in said.items() if k not in ("hand", "object") or said.get(f"{k}_sha256") is None
        }

    return same_json(plain(one), plain(other))


def _seen_from(folder: Path, name: str) -> str:
    file, mark, part = name.partition("#")
    if not Path(file).is_absolute():
        return name
    return relative_path(file, folder) + mark + part


def _absolute(name: str, folder: Path) -> str:
    """A path that is there as seen from a folder, as an absolute one; what is none stays."""
    file, mark, part = name.partition("#")
    return str((folder / file).resolve()) + mark + part if (folder / file).exists() else name


def _named(values: Array | dict[str, float], names: tuple[str, ...], field: str) -> dict[str, float]:
    """Values by name, from an array in the order of the names."""
    if isinstance(values, dict):
        return values
    return dict(zip(names, _numbers(values, len(names), field).tolist(), strict=True))


def _numbers(values: Any, count: int, field: str) -> Array:
    try:
        found = np.asarray(values, dtype=float).reshape(-1)
    except (TypeError, ValueError):
        raise InputError("holds what are no numbers", field=field) from None
    if len(found) != count:
        raise InputError(f"has {len(found)} numbers, needs {count}", field=field)
    if not np.isfinite(found).all():
        raise InputError("has a number that is missing, NaN or infinite", field=field)
    return found


def _number(value: Any, field: str) -> float | None:
    """A number of a row, None where the row says nothing."""
    if value is None or isinstance(value, float):
        return value
    raise InputError(f"is {str(value)[:30]!r}; a number is needed", field=field)
