"""The `handfast/task/1` file: which regions of a hand are to touch which regions of an object.

{"schema": "handfast/task/1", "hand": "schunk-sah", "object": "mug.obj",
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
from pydantic import Field

from handfast.core import bundled
from handfast.core.errors import InputError
from handfast.core.files import Finite, Strict, read_named, validate, write_text
from handfast.model.hand.hand import Coupling, Hand
from handfast.readers.load_hand import bundled_hands, load_hand
from handfast.readers.mesh_file import MESH_FILES
from handfast.readers.region_file import RegionEntry, region_to_dict
from handfast.synthesis.pose_check import refuse_contradiction
from handfast.synthesis.task import ContactPair, PoseBounds, Task

Interval = tuple[Finite, Finite]
Bounds = tuple[Interval, Interval, Interval]


class HandSide(Strict):
    """`flip` may stand in the region or beside it."""

    link: str
    region: RegionEntry
    flip: bool = False


class ObjectSide(Strict):
    """`flip` may stand in the region or beside it."""

    region: RegionEntry
    flip: bool = False


class TaskContactEntry(Strict):
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

    schema_: Literal["handfast/task/1"] = Field(alias="schema")
    hand: str
    object: str | None = None
    limits: dict[str, Interval] = Field(default_factory=dict)
    couplings: list[CouplingEntry] = Field(default_factory=list)
    pose: PoseEntry = PoseEntry()
    contacts: list[TaskContactEntry]


def load_task(path: str | Path) -> Task:
    """Read a `handfast/task/1` file, or a bundled task by name.

    `hand` and `object` are bundled names or paths relative to the file. The task's name is the file's.

    Raises:
        InputError: one line with file, field, fault and what would be right: a missing file, no JSON, an
            unknown or missing field, an unknown hand, object, link or joint (the known ones are listed),
            a lower limit above the upper one, a joint tied to itself, a region with too few or ragged
            points, a degenerate one, pose bounds that no pose can meet, no contacts.
    """
    return read_named("tasks", path, "task", lambda data, at: from_dict(data, folder=at.parent, name=at.stem))


def from_dict(data: Any, *, folder: str | Path = ".", name: str = "") -> Task:
    """The task in a parsed `handfast/task/1` object; raises `InputError` as `load_task` does.

    Args:
        folder: where relative paths in it start.
        name: of the task.
    """
    entry = validate(TaskFile, data)
    hand = load_hand(_hand_source(entry.hand, Path(folder)))
    pairs = []
    for k, contact in enumerate(entry.contacts):
        at, (h, o) = f"contacts[{k}]", (contact.hand, contact.object)
        hand_region = h.region.region(f"{at}.hand.region", h.flip)
        object_region = o.region.region(f"{at}.object.region", o.flip)
        pairs.append(ContactPair(h.link, hand_region, object_region))
    return Task.of(
        hand,
        tuple(pairs),
        limits=entry.limits,
        couplings=tuple((c.joint, c.equals, c.ratio) for c in entry.couplings),
        pose=entry.pose.bounds(),
        object=_object_source(entry.object, Path(folder)),
        name=name,
    )


def to_dict(task: Task, *, folder: str | Path = ".") -> dict[str, Any]:
    """The task as a `handfast/task/1` object; `from_dict` restores it.

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
        for t in task.contact_pairs
    ]
    return {
        "schema": "handfast/task/1",
        "hand": _relative(source, bundled_hands(), folder),
        "object": None if task.object is None else _relative(task.object, bundled.names("objects"), folder),
        "limits": limits,
        "couplings": _couplings(task.hand, own),
        "pose": pose,
        "contacts": contacts,
    }


def save_task(task: Task, path: str | Path, *, force: bool = False) -> None:
    """Write a `handfast/task/1` file. Raises `InputError` if it exists and `force` is not set."""
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


def _couplings(hand: Hand, own: Hand) -> list[dict[str, Any]]:
    """Those that the hand's file does not bring."""
    new = [c for c in hand.couplings if c not in own.couplings]
    joints = {c.joint for c in hand.couplings}
    odd: list[Coupling] = [c for c in new if c.driver < 0 or c.offset != 0]
    odd += [c for c in own.couplings if c.joint not in joints]
    if odd:
        name = hand.joint_names[odd[0].joint]
        raise InputError(f"the one of {name} has no place in a task file", field="couplings")
    names = hand.joint_names
    return [{"joint": names[c.joint], "equals": names[c.driver], "ratio": c.ratio} for c in new]
