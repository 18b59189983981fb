"""The claims of a `handfast/synthesis/1` file: that configurations exist, or that none does.

    FOUND      each configuration is one, and what is said of it follows from its proof
    NONE       the contacts that the answer names exclude each other, or all of them at every pose of the object
    UNDECIDED  nothing

How the search went (starts, boxes, seconds, seed) is no claim and only has to be consistent. Nor is it claimed here
that the numbers of the task are those of the hand that it names.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from handfast.proofs.configurations import examined, farther, read_existence, solution
from handfast.proofs.constants import RADIAN_LENGTH
from handfast.proofs.contact_equations import ContactEquations, Values
from handfast.proofs.fields import Array, BadFile, Fields, numbers, same
from handfast.proofs.impossibility import impossible
from handfast.proofs.intervals import MACHINE_EPSILON
from handfast.proofs.pose_by_pose import impossible_at_every_pose
from handfast.proofs.replay import SEARCH_STOPS, Refused, Replay
from handfast.proofs.tasks import TaskData, read_task

VERDICTS = "found", "none", "undecided"
SYNTHESIS_COURSE = "the course of the search: starts, boxes and seconds"
NAMES_CLAIM = "that the task's numbers are those of the hand and of the object that it names"
SEARCHED = re.compile(r"contacts? (\d{1,9}(?:, \d{1,9})*)(?: and (\d{1,9}|the object's position))?")
AT_EVERY_POSE = "all contacts, pose by pose"
SCHEMA = "handfast/synthesis/1"


def replay(data: Any) -> Replay:
    """What the file claims, replayed; `BadFile` if it is none, `checksum` and `state` read past."""
    f = Fields(data)
    f.text("schema", among=[SCHEMA])
    f.take("checksum", None)
    task, answer, state = read_task(f.take("task")), f.object("answer"), f.take("state")
    f.done()
    return replay_answer(task, answer, state is not None)


def replay_answer(task: TaskData, f: Fields, resumable: bool) -> Replay:
    """What an answer of `synthesize` claims of a task; is there a state to go on from?"""
    f.text("schema", among=["handfast/answer/1"])
    f.text("query", among=["synthesize"])
    verdict, stop = f.text("verdict", among=VERDICTS), f.text("stop", among=SEARCH_STOPS)
    f.number("seconds", least=0.0)
    nodes = f.whole("nodes")
    for name in ("starts", "unproved", "seed"):
        f.whole(name)
    said, spread = list(f.objects("configurations")), f.number("spread") if f.has("spread") else None
    searched = _Searched(f.object("searched")) if f.has("searched") else None
    f.done()
    fault = _contradiction(verdict, stop, len(said), searched, nodes, resumable)
    missing = [SYNTHESIS_COURSE, NAMES_CLAIM]
    if fault:
        return Replay("synthesis", "", fault, not_replayed=tuple(missing))
    if verdict == "found":
        parts = _configurations(task, said, spread)
    elif verdict == "none":
        parts = (_none(task, searched),)
        missing[:0] = [parts[0].reason] if parts[0].reason else []
    else:
        parts = ()
        if searched:
            share = f"{100 * searched.discarded:.4g} % of the space"
            missing.insert(0, f"{share} holds no configuration: the boxes that were discarded are not kept")
    return Replay("synthesis", "", "", parts=parts, not_replayed=tuple(missing))


class _Searched:
    """What is said of the search for a contradiction; `BadFile` where it contradicts itself."""

    def __init__(self, f: Fields) -> None:
        self.by, self.nodes = f.text("by"), f.whole("nodes")
        self.discarded, self.pending = f.number("discarded", least=0.0), f.whole("pending")
        f.whole("depth")
        smallest, largest = f.number("smallest", least=0.0), f.number("largest", least=0.0)
        if not (self.discarded <= 1 and smallest <= largest):
            raise BadFile("has a share beyond 1, or a smallest box larger than the largest", f.place)
        f.done()

    def contacts(self, count: int) -> tuple[tuple[int, ...], bool] | None:
        """Those of `count` contacts that `by` names, and whether the object's position is among them; None if none."""
        named = SEARCHED.fullmatch(self.by)
        if not named:
            return None
        which = [int(n) for n in re.findall(r"\d+", self.by)]
        fits = which == sorted(set(which)) and which[-1] < count
        return (tuple(which), named[2] is not None and not named[2].isdigit()) if fits else None


def _contradiction(verdict: str, stop: str, found: int, searched: _Searched | None, nodes: int, resumable: bool) -> str:
    """Which keys of an answer contradict each other; '' if none."""
    if verdict == "found" and not found:
        return "FOUND without a configuration"
    if verdict != "found" and found:
        return f"{verdict.upper()} with a configuration"
    if (verdict == "undecided") != resumable:
        return f"{verdict.upper()} {'with' if resumable else 'without'} a state to go on from"
    if nodes != (searched.nodes if searched else 0):
        return f"nodes is {nodes}, of the search {searched.nodes if searched else 0}"
    if verdict == "none":
        whole = searched is not None and searched.discarded == 1 and not searched.pending
        return "" if whole and stop == "complete" else "NONE of a search that discarded less than all or did not end"
    if searched and searched.discarded == 1:
        return f"{verdict.upper()} of a search that discarded all"
    return "UNDECIDED of a search that is complete" if verdict == "undecided" and stop == "complete" else ""


def _none(task: TaskData, searched: _Searched | None) -> Replay:
    """Whether the contacts that were searched are shown here to exclude each other."""
    ask = "NONE rests on the search itself, ask it again"
    by = searched.by if searched else ""
    named = searched.contacts(len(task.links)) if searched else None
    if named is None and by != AT_EVERY_POSE:
        return Replay("none", "", f"{ask}: '{by}' names no contacts of the task")
    try:
        done = impossible(task, named[0], origin=named[1]) if named else impossible_at_every_pose(task)
    except Refused as why:
        return Replay("none", "", f"{ask}: {why}")
    figures, boxes = {"boxes": done.boxes}, "1 box" if done.boxes == 1 else f"{done.boxes} boxes"
    axes = done.axes or (not named and bool((np.abs(task.axes) < 1).any()))
    bounded = ", where axes of the object are bounded" if axes else ""
    claim = f"{by} exclude each other{bounded}, by {boxes} of the checker's own"
    share = f"{100 * done.discarded:.3g} % of the space in {boxes}"
    fault = "" if done.shown else f"{ask}: of {by} the checker by itself could discard {share}"
    return Replay("none", claim, fault, figures)


# --- configurations ---------------------------------------------------------------------------------


def _configurations(task: TaskData, said: Sequence[Fields], spread: float | None) -> tuple[Replay, ...]:
    """Each of them, and how far they are apart."""
    parts, places = [], []
    try:
        equations = ContactEquations.of(task)
    except Refused as why:
        return (Replay("task", "", str(why)),)
    for i, f in enumerate(said):
        proof = read_existence(f.take("existence"), f.at("existence"))
        done, at, slacks = examined(equations, proof, f"configuration {i}")
        beside = {name: f.take(name) for name in ("joints", "object_pose", "contacts", "slacks")}
        f.done()
        if at is not None and done.ok:
            follows = _following(task, at, slacks, proof.position, proof.quaternion)
            moved = {
                task.hand.joints[j]: q for j, q in zip(equations.sides.drive.joints, at.joints.mid[0], strict=True)
            }
            fault = farther(equations, solution(equations, proof, at), at)
            fault = fault or _difference(task, follows, moved, beside)
            done = Replay(done.name, done.claim, fault, done.figures)
            places.append(_features(task, moved, at))
        parts.append(done)
    if all(part.ok for part in parts):
        gaps = [float(np.linalg.norm(a - b)) for a, b in combinations(places, 2)]
        due = min(gaps) if gaps else None
        fault = "" if same(spread, due) else f"is {spread}, of these configurations {due}"
        parts.append(Replay("spread", "", fault))
    return tuple(parts)


def _following(
    task: TaskData, at: Values, slacks: dict[str, float], position: Array, quaternion: Array
) -> dict[str, Any]:
    """What is said of a configuration beside its proof and its joints, as it follows from the floats."""
    point, normal, axis = at.point[0].mid, -at.normal[0].mid, at.axis[0].mid
    for k, hand in enumerate(task.on_hand):
        slacks.pop(f"contact:{k}:normals", None)
        if f"contact:{k}:cone" in slacks:
            out = hand.sign * normal[k]
            angle = np.arctan2(np.linalg.norm(np.cross(axis[k], out)), axis[k] @ out)
            slacks[f"contact:{k}:cone"] = hand.half_angle - float(angle)
    links = [task.hand.links[link].name for link in task.links]
    return {
        "object_pose": {"position": position.tolist(), "quaternion": quaternion / np.linalg.norm(quaternion)},
        "contacts": [
            {"link": link, "point": p, "normal": n}
            for link, p, n in zip(links, point.tolist(), normal.tolist(), strict=True)
        ],
        "slacks": slacks,
    }


def _difference(task: TaskData, due: dict[str, Any], moved: Mapping[str, float], said: Mapping[str, Any]) -> str:
    """What of a configuration is not what follows from its proof; '' if all is."""
    misplaced = task.misplaced(Fields({"joints": said["joints"]}).named("joints"), moved)
    if misplaced:
        return f"joints are not those of its proof: {misplaced}"
    pose, turned = said["object_pose"], due["object_pose"]["quaternion"]
    if isinstance(pose, Mapping) and "quaternion" in pose:
        q = numbers(pose["quaternion"], (4,), "object_pose.quaternion")
        due["object_pose"]["quaternion"] = (turned if q @ turned >= 0 else -turned).tolist()
    lengths = {"position", "point", *(f"position:{i}" for i in range(3))}
    lengths |= {f"joint:{name}" for name, turns in zip(task.hand.joints, task.hand.revolute, strict=True) if not turns}
    one, other = (_in_sizes(x, lengths, task.size) for x in (due, {name: said[name] for name in due}))
    wrong = [name for name in due if not same(one[name], other[name], 16 * MACHINE_EPSILON)]
    return f"{wrong[0]} are not those of its proof" if wrong else ""


def _in_sizes(x: Any, lengths: Collection[str], size: float, name: str = "") -> Any:
    """Parsed JSON with the numbers of some names over a size."""
    if isinstance(x, Mapping):
        return {key: _in_sizes(value, lengths, size, key) for key, value in x.items()}
    if isinstance(x, list):
        return [_in_sizes(value, lengths, size, name) for value in x]
    return x / max(size, 1e-300) if name in lengths and isinstance(x, float) else x


def _features(task: TaskData, moved: Mapping[str, float], at: Values) -> Array:
    """What the distance of two configurations is that of: free joints, position, orientation, points on the object."""
    free = [moved[task.hand.joints[j]] / (1.0 if task.hand.revolute[j] else RADIAN_LENGTH) for j in task.free]
    R, p = at.rotation.mid[0], at.position.mid[0]
    spots = (at.point.mid[0] - p) @ R / RADIAN_LENGTH
    return np.concatenate([free, p / RADIAN_LENGTH, R.ravel() / np.sqrt(2), spots.ravel()])
