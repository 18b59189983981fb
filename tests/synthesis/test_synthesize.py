"""What is found, what there is not, and what a configuration is."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import handfast
from handfast.core.answer import Reach, Stop
from handfast.core.errors import InputError
from handfast.model.hand import Coupling
from handfast.model.region import Bezier, Cap
from handfast.proofs import files
from handfast.readers.configuration_file import save_configuration
from handfast.synthesis import query
from handfast.synthesis.query import synthesize
from handfast.synthesis.search.starts import Certified, Starts
from handfast.synthesis.solution import Solution, whole
from handfast.synthesis.synthesis_answer import Synthesis
from handfast.synthesis.task import ContactPair, PoseBounds, Task
from tests.support.holds import OPEN, flat_grip, grip, pinch
from tests.support.planted_proofs import odd_case, sah_case


def test_a_block_that_fits_is_gripped(found: Synthesis) -> None:
    """The jaws stand apart by the width of the block but for its tilt."""
    assert (found.verdict, found.stop, len(found.solutions)) == (Reach.FOUND, Stop.COMPLETE, 1)
    (s,) = found.solutions
    assert s.joints["left_slide"] == s.joints["right_slide"]
    # a fingertip's centre is 5 mm behind the plane y = 0 of its finger, both normals of the block are +-y
    apart = 2 * (0.045 - s.joints["left_slide"])
    assert np.hypot(*(s.points[0] - s.points[1])[[0, 2]]) < 0.06
    assert apart >= 0.05 + 2 * 0.005 - 1e-9
    assert found.verify().ok


@pytest.mark.parametrize("width, verdict", [(0.079, Reach.FOUND), (0.081, Reach.NONE), (0.12, Reach.NONE)])
def test_it_is_found_exactly_where_it_exists(width: float, verdict: Reach) -> None:
    answer = synthesize(grip(width), timeout=60)
    assert (answer.verdict, answer.stop) == (verdict, Stop.COMPLETE)
    assert len(answer.solutions) == (verdict is Reach.FOUND)
    if verdict is Reach.NONE:
        assert answer.searched is not None
        assert (answer.searched.discarded, answer.searched.by, answer.state) == (1.0, "contacts 0 and 1", {})


def test_what_is_possible_only_on_a_limit_stays_undecided() -> None:
    """Neither certified nor excluded, however long it takes: boxes about the limit remain."""
    answer = synthesize(grip(OPEN), timeout=None)
    assert (answer.verdict, answer.stop, answer.solutions) == (Reach.UNDECIDED, Stop.RESOLUTION, ())
    assert answer.searched is not None
    assert answer.searched.pending > 0
    assert answer.searched.smallest < 1e-3


def test_a_node_limit_leaves_it_undecided(undecided: Synthesis) -> None:
    assert (undecided.verdict, undecided.stop, undecided.solutions) == (Reach.UNDECIDED, Stop.NODES, ())
    assert undecided.state
    assert undecided.searched is not None
    assert undecided.nodes >= 2000
    assert undecided.searched.pending > 0
    assert undecided.searched.discarded < 1


def test_a_candidate_that_cannot_be_proved_is_not_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The local search says: three candidates in every block, none of them certified."""

    def hopeful(starts: Starts, numbers: Any, many: int) -> tuple[list[Certified], int]:
        starts.unproved += 3
        return [], len(numbers)

    monkeypatch.setattr(Starts, "_find", hopeful)
    answer = synthesize(grip(0.05), timeout=None, nodes=1)
    assert (answer.verdict, answer.stop, answer.solutions) == (Reach.UNDECIDED, Stop.NODES, ())
    assert answer.unproved == 3 * query.FIRST_BLOCKS


def test_solutions_that_are_not_isolated_are_not_found() -> None:
    """Flat on flat on both sides: each side turns the block the same way, so no choice of coordinates is regular."""
    answer = synthesize(flat_grip(0.05), timeout=None, nodes=1)
    assert (answer.verdict, answer.solutions) == (Reach.UNDECIDED, ())


def test_limits_hold_of_joints_that_only_follow() -> None:
    """A follower that moves no contact keeps its limits, and with them its driver's range."""
    hand = pinch().hand
    driver, follower = hand.joint("index_proximal"), hand.joint("ring_proximal")
    tied = replace(hand, couplings=(*hand.couplings, Coupling(follower, driver, 1.0)))
    joints = list(tied.joints)
    joints[follower] = replace(joints[follower], lower=0.3, upper=0.5)
    task = replace(pinch(), hand=replace(tied, joints=tuple(joints)))
    answer = synthesize(task, count=20)
    assert len(answer.solutions) == 20
    for s in answer.solutions:
        assert 0.3 < s.joints["index_proximal"] < 0.5
        assert s.joints["ring_proximal"] == s.joints["index_proximal"]
    assert answer.verify().ok


def test_one_contact_alone() -> None:
    task = grip(0.05)
    answer = synthesize(replace(task, contact_pairs=task.contact_pairs[:1]))
    assert answer.verdict is Reach.FOUND
    assert answer.verify().ok


# --- what a configuration is ----------------------------------------------------------------------


def test_points_coincide_and_normals_oppose(pinched: Synthesis) -> None:
    """Seen from the hand: on the cap's sphere, the outward normal pointing into the object, within the cone."""
    (s,) = pinched.solutions
    links = s.task.hand.link_poses(s.q)
    for pair, point, normal in zip(s.task.contact_pairs, s.points, s.normals, strict=True):
        T = links[s.task.hand.link(pair.link)]
        centre = T[:3, :3] @ pair.hand.center + T[:3, 3]
        assert np.allclose(point, centre + pair.hand.radius * normal, atol=1e-9)
        assert np.linalg.norm(normal) == pytest.approx(1, abs=1e-12)
        assert np.arccos(normal @ T[:3, :3] @ pair.hand.axis) < pair.hand.half_angle
        inside = np.linalg.inv(s.pose) @ [*(point + 1e-3 * normal), 1]
        assert np.abs(inside[1]) < 0.015  # a millimetre further along the normal is within the block


def test_hand_patch_and_object_cap() -> None:
    """The other way round: a flat finger on a ball. All of the ball's points are as far from its centre."""
    task = grip(0.05)
    ball = Cap((0, 0, 0), 0.02, (0, 1, 0), 3.0)
    pad = Bezier(np.array([[[u, 0, v] for v in (0.03, 0.06)] for u in (-0.01, 0.01)]))
    answer = synthesize(replace(task, contact_pairs=(ContactPair("left_finger", pad, ball),)))
    (s,) = answer.solutions
    assert answer.verify().ok
    assert np.linalg.norm(s.points[0] - s.pose[:3, 3]) == pytest.approx(0.02, abs=1e-12)
    assert s.normals[0] == pytest.approx([0, -1, 0], abs=1e-9)
    assert {"contact:0:s", "contact:0:u", "contact:0:v"} <= set(s.slacks)
    assert s.points[0][1] == pytest.approx(0.04 - s.joints["left_slide"], abs=1e-9)


def test_region_points_and_normals() -> None:
    hollow = Cap((1, 0, 0), 2.0, (0, 0, 1), 1.0, flip=True)
    assert (hollow.at(0.0, 0.3), hollow.outward(0.0, 0.3)) == (pytest.approx([1, 0, 2]), pytest.approx([0, 0, -1]))
    flat = Bezier([[[0, 0, 0], [0, 1, 0]], [[2, 0, 0], [2, 1, 0]]])
    assert (flat.at(0.5, 0.25), flat.outward(0.5, 0.25)) == (pytest.approx([1, 0.25, 0]), pytest.approx([0, 0, 1]))


def test_slacks_are_those_that_the_checker_finds(pinched: Synthesis) -> None:
    (s,) = pinched.solutions
    checked = {label: x for label, x in s.verify().figures.items() if ":" in label}
    assert set(s.slacks) == set(checked)
    for label, slack in s.slacks.items():
        if label.endswith(":cone"):  # there a cosine
            cap = s.task.contact_pairs[int(label.split(":")[1])].hand
            slack = np.cos(cap.half_angle - slack) - np.cos(cap.half_angle)
        assert slack == pytest.approx(checked[label], abs=2e-6), label
    assert min(s.slacks.values()) > 0


def test_pose_bounds_are_kept() -> None:
    axes = np.tile([-1.0, 1.0], (3, 3, 1))
    axes[2, 2] = [0.95, 1.0]
    position = np.array([[-0.02, 0.02], [-np.inf, np.inf], [0.09, 0.12]])
    answer = synthesize(grip(0.05, pose=PoseBounds(position, axes)), count=8)
    assert len(answer.solutions) == 8
    for s in answer.solutions:
        assert s.pose[2, 2] > 0.95
        assert abs(s.pose[0, 3]) < 0.02
        assert 0.09 < s.pose[2, 3] < 0.12
        assert {"position:0", "position:2", "z_axis:2"} <= set(s.slacks)
        assert "position:1" not in s.slacks
    assert answer.verify().ok


def test_unused_joints_are_placed_within_their_limits() -> None:
    """Those that move no contact: as near to 0 as they may be, couplings followed."""
    task = pinch(limits={"ring_proximal": (0.2, 0.4), "middle_proximal": (-0.5, -0.1), "ring_middle": (0.3, 1.0)})
    (s,) = synthesize(task).solutions
    values = s.joints
    assert (values["ring_proximal"], values["middle_proximal"]) == (0.2, -0.1)
    assert values["ring_distal"] == values["ring_middle"] == 0.3
    assert values["index_distal"] == values["index_middle"] > 0
    limits = task.hand.limits
    assert ((s.q >= limits[:, 0]) & (s.q <= limits[:, 1])).all()


def test_configuration_can_be_saved_and_applied(pinched: Synthesis, tmp_path: Path) -> None:
    (s,) = pinched.solutions
    path = tmp_path / "c.json"
    save_configuration(s.configuration, path)
    back = handfast.load_configuration(path)
    hand, q = back.applied(handfast.load_hand(back.hand))
    assert np.array_equal(q, s.q)
    assert back.pose == pytest.approx(s.pose, abs=1e-12)
    assert hand.joint_names == s.task.hand.joint_names


# --- bad input ------------------------------------------------------------------------------------


def test_numbers_out_of_range() -> None:
    for arguments, line in (
        ({"count": 0}, "count: is 0; a number from 1 on is needed"),
        ({"seed": -1}, "seed: is -1; a number from 0 on is needed"),
        ({"timeout": 0.0}, "timeout: is 0 s; a positive number is needed"),
        ({"nodes": 0}, "nodes: is 0; a number from 1 on is needed"),
    ):
        with pytest.raises(InputError, match=f"^{re.escape(line)}$"):
            synthesize(grip(0.05), **arguments)


def test_couplings_that_leave_nothing_or_one_value() -> None:
    line = "limits.right_slide: leave nothing for left_slide, to which it is coupled"
    with pytest.raises(InputError, match=line):
        synthesize(grip(0.05, limits={"right_slide": (0.05, 0.06)}))
    line = "limits.right_slide: leave a single value for left_slide, to which it is coupled; widen them, or fix left_sl"
    with pytest.raises(InputError, match=line):
        synthesize(grip(0.05, limits={"right_slide": (0.02, 0.02)}))
    fixed = synthesize(grip(0.05, limits=dict.fromkeys(("left_slide", "right_slide"), (0.012, 0.012))))
    assert fixed.solutions[0].joints == {"left_slide": 0.012, "right_slide": 0.012}
    assert fixed.verify().ok


def test_whole_configuration_of_a_fixed_coupling() -> None:
    hand = replace(grip(0.05).hand, couplings=(Coupling(1, -1, 0.0, 0.013),))
    task: Task = replace(grip(0.05), hand=hand)
    assert whole(task, {"left_slide": 0.02}).tolist() == [0.02, 0.013]


def test_solution_of_another_task_is_refused(found: Synthesis) -> None:
    wrong = Solution.of(grip(0.06), found.solutions[0].existence)
    assert not wrong.verify().ok


@pytest.mark.parametrize(("case", "seed"), [(sah_case, 5037), (odd_case, 5166), (odd_case, 5203)])
def test_what_is_told_is_the_solution_to_1e_9(case: Callable, seed: int) -> None:
    """Searches end 10^-9 beside the solution of these; what is told is a step of Newton's method farther."""
    found = synthesize(case(seed).task, count=2, seed=seed)
    done = files.verify(json.loads(json.dumps(found.to_file())))
    assert done.ok, done.reason
