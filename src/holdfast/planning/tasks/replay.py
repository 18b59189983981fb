"""Replays saved grasps: existence, the contacts that follow from it, and every load under the preload.

Nothing of the search is needed: the independent checker for the proofs of existence, the equations of the model for
the witnesses, and the hand's kinematics for what ties the two together.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from holdfast import grasp_file
from holdfast.answer import Checked, Verdict
from holdfast.files import same_json
from holdfast.grasp import Grasp
from holdfast.planning.tasks.grasps_file import SavedGrasp, SavedGrasps
from holdfast.stability import replay as stability
from holdfast.synthesis.answers import Solution

CLOSE = 1e-9  # [m], [-], [rad]: what follows from a proof and what the file says of it


@dataclass(frozen=True)
class ReplayedGrasps(Checked):
    """Grasps that were checked.

    Attributes:
        reasons: for each grasp why it is not proved: one line; '' if it is.
        loads: how many witnesses were replayed. residual: the worst of them.
        seconds: wall time.
        reason: why not all is proved: one line; '' if it is.
    """

    reasons: tuple[str, ...]
    loads: int
    residual: float
    seconds: float
    reason: str

    def to_json(self) -> dict[str, Any]:
        return self._json(
            {
                "grasps": [{"ok": not r, "reason": r} for r in self.reasons],
                "witnesses": self.loads,
                "residual": self.residual,
            }
        )


def verify(saved: SavedGrasps) -> ReplayedGrasps:
    """Does every grasp exist, touch where its contacts are, and hold every load under its preload?"""
    start, residual = time.monotonic(), 0.0
    reasons = []
    for g in saved.grasps:
        reason, worst = _replayed(g, saved)
        reasons.append(reason)
        residual = max(residual, worst)
    wrong = [f"grasp {i + 1}: {r}" for i, r in enumerate(reasons) if r]
    if not wrong and saved.said.get("verdict") != "found":
        wrong = ["the answer has no grasp to prove; NONE and UNDECIDED rest on the search itself"]
    elif not saved.grasps:
        wrong = ["FOUND without a grasp"]
    count = sum(len(g.checks) for g in saved.grasps)
    return ReplayedGrasps(tuple(reasons), count, residual, time.monotonic() - start, wrong[0] if wrong else "")


def _replayed(g: SavedGrasp, saved: SavedGrasps) -> tuple[str, float]:
    """Why a grasp is not proved, '' if it is; the worst residual of its witnesses."""
    report = g.solution.verify()
    if not report.ok:
        return report.reasons[0], 0.0
    wrong = joints_misfit(g.solution, g.joints) or contacts_misfit(g.solution, g.grasp)
    wrong = wrong or moves_misfit(g.solution, g.joints, g.grasp)
    if wrong:
        return wrong, 0.0
    if len(g.checks) != len(saved.loads):
        return f"has {len(g.checks)} checks for {len(saved.loads)} loads", 0.0
    said, worst = grasp_file.to_dict(g.grasp), 0.0
    for name, wrench, check in zip(saved.loads.names, saved.loads.wrenches, g.checks, strict=True):
        done = stability.verify(check)
        if not done.ok:
            return f"{name}: {done.reason}", worst
        if check.answer.query != "check" or check.answer.verdict is not Verdict.HOLDS or done.witness is None:
            return f"{name}: is not shown to be held", worst
        q = check.question
        same = same_json(grasp_file.to_dict(q.grasp), said) and np.allclose(q.wrench, wrench, rtol=CLOSE, atol=0)
        if not (same and q.mdp):
            return f"{name}: the check is of another grasp, preload or load", worst
        worst = max(worst, done.witness.residual)
    return "", worst


def joints_misfit(solution: Solution, joints: dict[str, float]) -> str:
    """Where joint values are not the proof's, or break a limit or a coupling; '' if they fit."""
    hand, proved = solution.task.hand, solution.existence.joints
    for joint in hand.joints:
        value = joints[joint.name]
        if joint.name in proved and abs(value - proved[joint.name]) > CLOSE:
            return f"{joint.name} is not at the value that is proved"
        if not joint.lower - CLOSE <= value <= joint.upper + CLOSE:
            return f"{joint.name} is beyond its limits"
    for c in hand.couplings:
        leader = joints[hand.joints[c.leader].name] if c.leader >= 0 else 0.0
        if abs(joints[hand.joints[c.joint].name] - c.ratio * leader - c.offset) > CLOSE:
            return f"{hand.joints[c.joint].name} does not follow its coupling"
    return ""


def contacts_misfit(solution: Solution, grasp: Grasp) -> str:
    """Where the contacts of a grasp are not those of the configuration; '' if they are."""
    R, p = solution.pose[:3, :3], solution.pose[:3, 3]
    if grasp.m != len(solution.points):
        return f"has {grasp.m} contacts, the task {len(solution.points)}"
    rows = zip(grasp.contacts, solution.points, solution.normals, solution.task.touches, strict=True)
    for k, (c, point, normal, touch) in enumerate(rows):
        off = np.linalg.norm(R @ c.position + p - point), np.linalg.norm(R @ c.normal - normal)
        if max(off) > CLOSE or c.link != touch.link:
            return f"contact {k} is not where the configuration has it"
    return ""


def moves_misfit(solution: Solution, joints: dict[str, float], grasp: Grasp) -> str:
    """Where the joints of a grasp are not the hand's at the configuration; '' if they are."""
    hand = solution.task.hand
    q = np.array([joints[name] for name in hand.joint_names])
    axes, origins = hand.joint_axes(q)
    R, p = solution.pose[:3, :3], solution.pose[:3, 3]
    chains = [set(hand.moved_by(hand.link(c.link))) for c in grasp.contacts]
    names = {j.name for j in grasp.joints}
    for j in sorted(set().union(*chains)):
        if hand.joint_names[j] not in names and hand.joints[j].lower < hand.joints[j].upper:
            return f"{hand.joint_names[j]} moves a contact and is not in the grasp"
    for joint in grasp.joints:
        if joint.name not in hand.joint_names:
            return f"{joint.name} is no joint of the hand"
        j = hand.joint(joint.name)
        axis, arm = R @ joint.axis, R @ joint.origin + p - origins[j]
        straight = hand.joints[j].type == "prismatic"
        off = np.linalg.norm(np.cross(axis, axes[j])), 0.0 if straight else np.linalg.norm(np.cross(arm, axes[j]))
        moved = tuple(i for i, chain in enumerate(chains) if j in chain)
        if max(off) > CLOSE or joint.moves != moved or joint.type != hand.joints[j].type:
            return f"{joint.name} is not where the configuration has it"
    return ""
