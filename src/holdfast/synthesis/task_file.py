"""The `holdfast/task/1` file: which regions of a hand are to touch which regions of an object.

{"schema": "holdfast/task/1", "hand": "schunk-sah", "object": "mug.obj",
 "limits": {"index_abduction": [-0.2, 0.2]}, "couplings": [{"joint": "a", "equals": "b", "ratio": 1.0}],
 "pose": {"position": [[0, 0.1], [-0.1, 0.1], [0, 0.3]], "z_axis": [[-1, 1], [-1, 1], [0.9, 1]]},
 "contacts": [{"hand": {"link": "index_distal",
                        "region": {"cap": {"center": [0.02, 0, 0], "radius": 0.013, "axis": [0, 0, 1],
                                           "half_angle": 1.0}}},
               "object": {"region": {"bezier": [[[0, 0, 0], [0, 0.1, 0]], [[0.1, 0, 0], [0.1, 0.1, 0]]],
                                     "flip": true}}}]}
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from holdfast import bundled
from holdfast.body_file import Finite, Vector
from holdfast.errors import InputError
from holdfast.files import Strict, read_json, validate, write_text
from holdfast.hand.load import bundled_hands, load_hand
from holdfast.hand.model import Coupling, Hand
from holdfast.region import Bezier, Cap, Region
from holdfast.shape import MESH_FILES
from holdfast.synthesis.pose_check import refuse_contradiction
from holdfast.synthesis.task import PoseBounds, Task, Touch

Interval = tuple[Finite, Finite]
Bounds = tuple[Interval, Interval, Interval]


class CapEntry(Strict):
    """A spherical cap: see `holdfast.region.Cap`."""

    center: Vector
    radius: Finite
    axis: Vector
    half_angle: Finite


class RegionEntry(Strict):
    """Exactly one of a Bezier patch and a cap; `flip` reverses its outward normal."""

    bezier: list[list[Vector]] | None = None
    cap: CapEntry | None = None
    flip: bool = False

    @field_validator("bezier")
    @classmethod
    def _grid(cls, rows: list[list[Vector]] | None) -> list[list[Vector]] | None:
        if rows is None:
            return None
        counts = [len(row) for row in rows]
        if len(set(counts)) > 1:
            raise ValueError(f"has rows of {', '.join(map(str, counts))} points; every row needs the same number")
        if len(counts) < 2 or counts[0] < 2:
            shape = f"{len(counts)} x {counts[0] if counts else 0}"
            raise ValueError(f"has {shape} points; at least 2 x 2 are needed")
        return rows

    @model_validator(mode="after")
    def _one(self) -> RegionEntry:
        if (self.bezier is None) == (self.cap is None):
            raise ValueError("exactly one of bezier, cap is needed")
        return self

    def region(self, field: str, flip: bool) -> Region:
        """The region; `field` is where it stands in the file, `flip` what stands beside it."""
        if flip and self.flip:
            raise InputError("is given twice, in the region and beside it; once is enough", field=f"{field}.flip")
        flip = flip or self.flip
        try:
            if self.cap is None:
                return Bezier(np.array(self.bezier), flip)
            cap = self.cap
            return Cap(np.array(cap.center), cap.radius, np.array(cap.axis), cap.half_angle, flip)
        except InputError as fault:
            raise fault.within(field) from None


class HandSide(Strict):
    """`flip` may stand in the region or beside it."""

    link: str
    region: RegionEntry
    flip: bool = False


class ObjectSide(Strict):
    """`flip` may stand in the region or beside it."""

    region: RegionEntry
    flip: bool = False


class ContactEntry(Strict):
    hand: HandSide
    object: ObjectSide


class CouplingEntry(Strict):
    """q[joint] = ratio * q[equals]."""

    joint: str
    equals: str
    ratio: Finite = 1.0


class PoseEntry(Strict):
    """Bounds on the object's origin [m] and axes in the palm frame; what is absent is free."""

    position: Bounds | None = None
    x_axis: Bounds | None = None
    y_axis: Bounds | None = None
    z_axis: Bounds | None = None

    def bounds(self) -> PoseBounds:
        """The same as arrays; `InputError` if they contradict themselves or each other."""
        free = PoseBounds.none()
        axes = [free.axes[0] if a is None else np.array(a) for a in (self.x_axis, self.y_axis, self.z_axis)]
        pose = PoseBounds(free.position if self.position is None else np.array(self.position), np.array(axes))
        refuse_contradiction(pose)
        return pose


class TaskFile(Strict):
    """The whole file."""

    schema_: Literal["holdfast/task/1"] = Field(alias="schema")
    hand: str
    object: str | None = None
    limits: dict[str, Interval] = Field(default_factory=dict)
    couplings: list[CouplingEntry] = Field(default_factory=list)
    pose: PoseEntry = PoseEntry()
    contacts: list[ContactEntry]


def load_task(path: str | Path) -> Task:
    """Read a `holdfast/task/1` file, or a bundled task by name.

    `hand` and `object` are bundled names or paths relative to the file. The task's name is the file's.

    Raises:
        InputError: one line with file, field, fault and what would be right: a missing file, no JSON, an
            unknown or missing field, an unknown hand, object, link or joint (the known ones are listed),
            a lower limit above the upper one, a joint tied to itself, a region with too few or ragged
            points, a degenerate one, pose bounds that no pose can meet, no contacts.
    """
    file = bundled.resolve("tasks", str(path))
    data = read_json(file, "task")
    try:
        return from_dict(data, folder=Path(file).parent, name=Path(file).stem)
    except InputError as fault:
        raise fault.at(str(path)) from None


def from_dict(data: Any, *, folder: str | Path = ".", name: str = "") -> Task:
    """The task in a parsed `holdfast/task/1` object; raises `InputError` as `load_task` does.

    Args:
        folder: where relative paths in it start.
        name: of the task.
    """
    entry = validate(TaskFile, data)
    hand = load_hand(_hand_source(entry.hand, Path(folder)))
    touches = []
    for k, contact in enumerate(entry.contacts):
        at, (h, o) = f"contacts[{k}]", (contact.hand, contact.object)
        hand_region = h.region.region(f"{at}.hand.region", h.flip)
        object_region = o.region.region(f"{at}.object.region", o.flip)
        touches.append(Touch(h.link, hand_region, object_region))
    return Task.of(
        hand,
        tuple(touches),
        limits=entry.limits,
        couplings=tuple((c.joint, c.equals, c.ratio) for c in entry.couplings),
        pose=entry.pose.bounds(),
        object=_object_source(entry.object, Path(folder)),
        name=name,
    )


def to_dict(task: Task, *, folder: str | Path = ".") -> dict[str, Any]:
    """The task as a `holdfast/task/1` object; `from_dict` restores it.

    Only limits and couplings that differ from the hand's own are written. Paths are relative to `folder`.

    Raises:
        InputError: the hand was not loaded from a file, or its joints or couplings can no longer be told
            from that file and a task.
    """
    source = task.hand.source
    if not source:
        raise InputError("was not loaded from a file; a task file names the file of its hand", field="hand")
    own = load_hand(source)
    if own.joint_names != task.hand.joint_names or own.link_names != task.hand.link_names:
        raise InputError(f"has other links or joints than {source}", field="hand")
    limits = {
        joint.name: [joint.lower, joint.upper]
        for joint, old in zip(task.hand.joints, own.joints, strict=True)
        if (joint.lower, joint.upper) != (old.lower, old.upper)
    }
    pose: dict[str, Any] = {}
    if np.isfinite(task.pose.position).all():
        pose["position"] = task.pose.position.tolist()
    elif np.isfinite(task.pose.position).any():
        raise InputError("is bounded on some sides only; a task file bounds all or none", field="pose.position")
    for axis, bounds in zip("xyz", task.pose.axes, strict=True):
        if (bounds > -1).any(where=[True, False]) or (bounds < 1).any(where=[False, True]):
            pose[f"{axis}_axis"] = bounds.tolist()
    contacts = [
        {"hand": {"link": t.link, "region": region_to_dict(t.hand)}, "object": {"region": region_to_dict(t.object)}}
        for t in task.touches
    ]
    return {
        "schema": "holdfast/task/1",
        "hand": _relative(source, bundled_hands(), folder),
        "object": None if task.object is None else _relative(task.object, bundled.names("objects"), folder),
        "limits": limits,
        "couplings": _couplings(task.hand, own),
        "pose": pose,
        "contacts": contacts,
    }


def save_task(task: Task, path: str | Path, *, force: bool = False) -> None:
    """Write a `holdfast/task/1` file. Raises `InputError` if it exists and `force` is not set."""
    write_text(path, json.dumps(to_dict(task, folder=Path(path).parent), indent=1) + "\n", force=force)


def _hand_source(name: str, folder: Path) -> str:
    if name in bundled_hands():
        return name
    if not os.path.isfile(folder / name):
        known = ", ".join(bundled_hands())
        raise InputError(f"'{name}' is no file beside the task and no bundled hand; bundled: {known}", field="hand")
    return str(folder / name)


def _object_source(name: str | None, folder: Path) -> str | None:
    if name is None or name in bundled.names("objects"):
        return name
    if not os.path.isfile(folder / name):
        known = ", ".join(bundled.names("objects"))
        problem = f"'{name}' is no file beside the task and no bundled object; bundled: {known}"
        raise InputError(problem, field="object")
    endings = (*MESH_FILES, ".json")
    if Path(name).suffix.lower() not in endings:
        raise InputError(f"'{name}' is no mesh; known endings: {', '.join(endings)}", field="object")
    return str(folder / name)


def _relative(source: str, names: Any, folder: str | Path) -> str:
    if source in names:
        return source
    try:
        return Path(os.path.relpath(source, folder)).as_posix()
    except ValueError:  # on another drive
        return str(Path(source).absolute())


def region_to_dict(region: Region) -> dict[str, Any]:
    """A region as a task file writes it; `RegionEntry.region` reads it."""
    data: dict[str, Any]
    if isinstance(region, Bezier):
        data = {"bezier": region.points.tolist()}
    else:
        cap = {"center": region.center.tolist(), "radius": float(region.radius)}
        data = {"cap": cap | {"axis": region.axis.tolist(), "half_angle": region.half_angle}}
    return data | ({"flip": True} if region.flip else {})


def _couplings(hand: Hand, own: Hand) -> list[dict[str, Any]]:
    """Those that the hand's file does not bring."""
    new = [c for c in hand.couplings if c not in own.couplings]
    joints = {c.joint for c in hand.couplings}
    odd: list[Coupling] = [c for c in new if c.leader < 0 or c.offset != 0]
    odd += [c for c in own.couplings if c.joint not in joints]
    if odd:
        name = hand.joint_names[odd[0].joint]
        raise InputError(f"the one of {name} has no place in a task file", field="couplings")
    names = hand.joint_names
    return [{"joint": names[c.joint], "equals": names[c.leader], "ratio": c.ratio} for c in new]
