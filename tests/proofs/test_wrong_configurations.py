"""Proofs of existence that are wrong are refused, each with its own reason."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from handfast.synthesis.task import PoseBounds
from tests.support.planted_proofs import (
    Spot,
    all_joints,
    cone_edges,
    limited,
    odd_case,
    plant,
    pose_of,
    refused,
    reshaped,
    sah,
    sah_case,
    verify_existence,
)

OPEN = r"do not meet the equations \(contact \d is open by"


def test_a_point_that_is_moved() -> None:
    for seed in range(30):
        planted = (odd_case if seed % 2 else sah_case)(seed)
        rng = np.random.default_rng(seed)
        label = rng.choice([name for name in planted.labels if not name.endswith(":t")])  # around a pole t moves little
        wrong = planted.values[label] + 1e-4 * rng.choice([-1, 1])
        report = refused(planted.task, planted.proof(**{label: wrong}), OPEN)
        assert report.gap > 1e-7
        assert report.step > 1


def test_floats_that_are_swapped() -> None:
    planted = sah_case(3)
    v = planted.values
    for a, b in pairwise(["joint:index_proximal", "joint:index_middle", "joint:thumb_base"]):
        refused(planted.task, planted.proof(**{a: v[b], b: v[a]}), OPEN)
    refused(planted.task, planted.proof(**{"contact:0:s": v["contact:0:t"], "contact:0:t": v["contact:0:s"]}), OPEN)


@pytest.mark.parametrize("by", [1e-3, 1e-9, 0.0])
@pytest.mark.parametrize("upper", [False, True])
@pytest.mark.parametrize("name", ["index_proximal", "index_middle", "index_distal", "thumb_base"])
def test_a_limit_that_is_passed_or_reached(name: str, upper: bool, by: float) -> None:
    """index_distal follows index_middle. A free joint may be a dependent coordinate or a frozen one."""
    planted = sah_case(6)
    q = all_joints(planted)[name]
    task = limited(planted.task, name, -2.0, q - by) if upper else limited(planted.task, name, q + by, 2.0)
    report = refused(task, planted.proof(), f"joint {name} comes to .* not strictly inside")
    assert len(report.reasons) == 1
    assert report.slacks[f"joint:{name}"] <= 0
    assert report.step + report.contraction < 1


def test_bounds_that_pass_through_the_box() -> None:
    """The floats are within, the box of radius 1e-7 (3e-9 m) is not; a box a tenth as wide is."""
    planted = sah_case(1, ("cap",))
    R, p = pose_of(planted)
    none = PoseBounds.none()
    position, axes = np.array(none.position), np.array(none.axes)
    position[0, 1] = p[0] + 1e-9
    i, k = np.unravel_index(np.abs(R).argmin(), (3, 3))
    axes[k, i, 1] = R[i, k] + 1e-7
    edge = cone_edges(planted)[0]
    q = all_joints(planted)
    tasks = {
        "joint:index_middle": limited(planted.task, "index_middle", -2.0, q["index_middle"] + 3e-8),
        "joint:index_distal": limited(planted.task, "index_distal", q["index_distal"] - 3e-8, 2.0),
        "position:0": replace(planted.task, pose=PoseBounds(position, none.axes)),
        f"{'xyz'[k]}_axis:{i}": replace(planted.task, pose=PoseBounds(none.position, axes)),
        "contact:0:cone": reshaped(planted.task, 0, hand={"half_angle": edge + 5e-7}),
    }
    for label, task in tasks.items():
        prefer = "joint:index_middle" if label.startswith("joint") else "position:0"
        assert label.split(":")[0] != "joint" or prefer in planted.proof(prefer=prefer).dependent
        report = refused(task, planted.proof(prefer=prefer), "in the box, not strictly inside|may leave the hand's cap")
        assert len(report.reasons) == 1
        assert report.slacks[label] <= 0
        assert report.step + report.contraction < 1
        report = verify_existence(task, planted.proof(1e-8, 3e-10, prefer=prefer))
        assert report.ok, (label, report.reasons)


def test_an_edge_that_passes_through_the_box() -> None:
    planted, label = sah_case(1, ("bicubic",), ("bicubic",)), "contact:1:v"
    near = 1 - 3e-8
    cut = planted.task.contact_pairs[1].hand.restricted((0, 1), (0, planted.values[label] / near))
    task = reshaped(planted.task, 1, hand={"points": cut.points})
    wide, narrow = (planted.proof(r, 3e-9, prefer=label, **{label: near}) for r in (1e-7, 1e-8))
    assert label in wide.dependent
    report = refused(task, wide, f"{label} comes to .* not strictly inside")
    assert len(report.reasons) == 1
    assert report.step + report.contraction < 1
    assert verify_existence(task, narrow).ok


def test_a_limit_of_a_joint_beyond_the_last_contact_that_must_follow() -> None:
    planted = plant(sah(), [Spot("index_middle"), Spot("thumb_distal")], np.random.default_rng(0))
    assert verify_existence(planted.task, planted.proof()).ok
    task = limited(planted.task, "index_distal", 0.0, all_joints(planted)["index_distal"] - 1e-3)
    refused(task, planted.proof(), "joint index_distal comes to .* not strictly inside")


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_a_cone_that_is_too_narrow(seed: int) -> None:
    planted = sah_case(seed, ("cap",))
    for k, edge in enumerate(cone_edges(planted)):
        for by in (1e-2, 1e-9):
            task = reshaped(planted.task, k, hand={"half_angle": edge - by})
            report = refused(task, planted.proof(), f"contact {k} may leave the hand's cap")
            assert len(report.reasons) == 1


def test_an_object_cap_that_is_too_narrow() -> None:
    planted = sah_case(2, object_kinds=("cap",))
    for k in range(3):
        task = reshaped(planted.task, k, object={"half_angle": planted.values[f"contact:{k}:s"]})
        report = refused(task, planted.proof(), f"contact:{k}:s comes to .* not strictly inside")
        assert len(report.reasons) == 1


def test_normals_that_are_equal() -> None:
    for seed in (0, 1, 3):
        planted = sah_case(seed, ("bicubic", "mixed", "bilinear"))
        for k, pair in enumerate(planted.task.contact_pairs):
            task = reshaped(planted.task, k, hand={"flip": not pair.hand.flip})
            report = refused(
                task, planted.proof(), f"contact {k}: the normals are not opposite: their cosine comes to \\[(1|0.9999)"
            )
            assert len(report.reasons) == 1
            task = reshaped(planted.task, k, object={"flip": not pair.object.flip})
            refused(task, planted.proof(), f"contact {k}: the normals are not opposite")


def test_a_sphere_on_the_wrong_side() -> None:
    """A hand cap touches with its centre across the object's surface if either normal is reversed."""
    planted = sah_case(1, ("cap",))
    for side in ("hand", "object"):
        for k, pair in enumerate(planted.task.contact_pairs):
            task = reshaped(planted.task, k, **{side: {"flip": not getattr(pair, side).flip}})
            report = refused(task, planted.proof(), OPEN)
            assert report.gap == pytest.approx(2 * pair.hand.radius)


@pytest.mark.parametrize("label", ["contact:0:s", "contact:0:t", "contact:1:u", "contact:1:v"])
@pytest.mark.parametrize("share", [0.5, 1.0])
def test_a_parameter_beyond_the_edge(label: str, share: float) -> None:
    """The patch is cut short, so that the same point lies outside of it or on its edge."""
    planted = sah_case(1, ("bicubic",), ("bilinear", "bicubic"))
    k, end = int(label[8]), planted.values[label] * share
    side = "object" if label[-1] in "st" else "hand"
    region = getattr(planted.task.contact_pairs[k], side)
    cut = region.restricted((0, end), (0, 1)) if label[-1] in "su" else region.restricted((0, 1), (0, end))
    task = reshaped(planted.task, k, **{side: {"points": cut.points}})
    report = refused(task, planted.proof(**{label: 1 / share}), f"{label} comes to .* not strictly inside")
    assert len(report.reasons) == 1


def test_a_wrong_coupling() -> None:
    """distal = middle is what the proof was made with; the hand says distal = 90 degrees - middle."""
    planted = sah_case(1)
    hand = planted.task.hand
    other = tuple(replace(c, ratio=-1.0, offset=np.pi / 2) for c in hand.couplings)
    refused(replace(planted.task, hand=replace(hand, couplings=other)), planted.proof(), OPEN)


@pytest.mark.parametrize("seed", range(4))
def test_radii_that_are_too_small_or_too_large(seed: int) -> None:
    planted = sah_case(seed)
    assert verify_existence(planted.task, planted.proof(1e-10, 1e-11)).ok
    refused(planted.task, planted.proof(1e-17, 1e-18), OPEN)
    refused(planted.task, planted.proof(0.3, 0.01), "the box is too wide")


def test_radii_that_hold_the_step_but_not_what_may_follow() -> None:
    planted = sah_case(3)
    low, high = 1e-9, 1.0
    for _ in range(20):  # up to where the box contracts by a factor of about 0.8
        scale = np.sqrt(low * high)
        contraction = verify_existence(planted.task, planted.proof(scale, 0.03 * scale)).contraction
        low, high = (scale, high) if contraction < 0.8 else (low, scale)
    proof = planted.proof(low, 0.03 * low)
    assert verify_existence(planted.task, proof).ok
    label, radius = next((label, r) for label, r in zip(proof.dependent, proof.radii, strict=True) if label[-1] == "s")
    moved = planted.proof(low, 0.03 * low, **{label: planted.values[label] + 0.5 * radius})
    report = refused(planted.task, moved, "the box is too tight")
    assert report.step < 1
    assert report.contraction < 1


def test_dependent_coordinates_that_determine_nothing() -> None:
    planted = sah_case(2)
    proof = planted.proof()
    of_others = [label for label in planted.labels if "index" in label or "thumb" in label or label[:9] == "contact:0"]
    of_others += [label for label in planted.labels if label.startswith("contact:1") or label[-1] in "uv"]
    chosen = list(dict.fromkeys(of_others))[: len(proof.dependent)]
    assert len(chosen) == len(proof.dependent)
    wrong = replace(proof, dependent=tuple(chosen))
    refused(planted.task, wrong, "Jacobian is singular|contracts by a factor")


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda p: {"dependent": p.dependent[1:], "radii": p.radii[1:]}, "coordinates are dependent; the .* equations"),
        (lambda p: {"dependent": ("joint:tail", *p.dependent[1:])}, "'joint:tail' is no coordinate of this task"),
        (lambda p: {"dependent": ("joint:index_distal", *p.dependent[1:])}, "'joint:index_distal' is no coordinate"),
        (lambda p: {"dependent": ("contact:9:s", *p.dependent[1:])}, "'contact:9:s' is no coordinate"),
        (lambda p: {"dependent": (p.dependent[1], *p.dependent[1:])}, "is dependent twice"),
        (lambda p: {"dependent": (*(f"quaternion:{i}" for i in range(4)), *p.dependent[4:])}, "all of the quaternion"),
        (lambda p: {"radii": [0.0, *p.radii[1:]]}, "the radius of .* is 0; it must be positive"),
        (lambda p: {"radii": [-1e-7, *p.radii[1:]]}, "the radius of .* is -1e-07; it must be positive"),
        (lambda p: {"quaternion": p.quaternion * 1e-4}, "the quaternion is shorter than 0.001"),
        (lambda p: {"joints": {}}, "has no value for joint index_abduction; the free joints are index_abduction, "),
        (lambda p: {"joints": {**p.joints, "index_distal": 1.0}}, "has a value for joint index_distal; the free"),
        (lambda p: {"contacts": p.contacts[1:]}, "has 1 contacts; the task has 2"),
        (lambda p: {"contacts": p.contacts[::-1]}, "contact 0 is on thumb_distal; in the task it is on index_distal"),
        (lambda p: {"contacts": (replace(p.contacts[0], hand=None), p.contacts[1])}, "contact 0: .* needs u and v"),
        (lambda p: {"contacts": (p.contacts[0], replace(p.contacts[1], hand=(0.5, 0.5)))}, "contact 1: .* no u and v"),
    ],
)
def test_a_proof_that_does_not_fit(change, message: str) -> None:
    planted = plant(sah(), [Spot("index_distal", "bicubic"), Spot("thumb_distal", "cap")], np.random.default_rng(0))
    proof = planted.proof()
    assert verify_existence(planted.task, proof).ok
    report = refused(planted.task, replace(proof, **change(proof)), message)
    assert report.contraction == np.inf


@pytest.mark.parametrize("field", ["position", "quaternion", "radii", "contacts"])
@pytest.mark.parametrize("size", [1e155, 1e300])
def test_numbers_that_overflow_prove_nothing(field: str, size: float) -> None:
    proof = sah_case(2).proof()
    value = getattr(proof, field) * size if field != "contacts" else proof.contacts
    if field == "contacts":
        value = tuple(replace(c, object=(size, size)) for c in proof.contacts)
    report = verify_existence(sah_case(2).task, replace(proof, **{field: value}))
    assert not report.ok
    assert not report.step + report.contraction < 1


def test_another_task() -> None:
    """The same hand, links and kinds of regions, in other places; then another hand."""
    first, second = (sah_case(seed, ("cap",), ("bicubic",)) for seed in (2, 7))
    refused(second.task, first.proof(), OPEN)
    refused(odd_case(2).task, first.proof(), "has no value for joint")


def test_pose_bounds_that_are_passed_or_reached() -> None:
    planted = sah_case(1)
    R, p = pose_of(planted)
    none = PoseBounds.none()
    for i in range(3):
        for bound in ([p[i], 9.0], [-9.0, p[i]], [p[i] + 1e-3, 9.0]):
            position = np.array(none.position)
            position[i] = bound
            task = replace(planted.task, pose=PoseBounds(position, none.axes))
            report = refused(task, planted.proof(), rf"pose.position\[{i}\] comes to .* not strictly inside")
            assert len(report.reasons) == 1
    for k, i in np.ndindex(3, 3):
        for bound in ([R[i, k] + 1e-3, 1.0], [-1.0, R[i, k] - 1e-3], [R[i, k], 1.0]):
            axes = np.array(none.axes)
            axes[k, i] = bound
            task = replace(planted.task, pose=PoseBounds(none.position, axes))
            refused(task, planted.proof(), rf"pose.{'xyz'[k]}_axis\[{i}\] comes to .* not strictly inside")


def test_pose_bounds_without_an_inside() -> None:
    planted = sah_case(1)
    _, p = pose_of(planted)
    position, axes = np.array(PoseBounds.none().position), np.array(PoseBounds.none().axes)
    position[1] = p[1]
    task = replace(planted.task, pose=PoseBounds(position, axes))
    refused(task, planted.proof(), r"pose.position\[1\] is bounded to .* alone; nothing lies strictly inside")
    axes[2, 0] = 0.0
    task = replace(planted.task, pose=PoseBounds(PoseBounds.none().position, axes))
    refused(task, planted.proof(), r"pose.z_axis\[0\] is bounded to 0 alone; nothing lies strictly inside")


def test_joints_that_their_limits_fix() -> None:
    """The value is exact, the joint no coordinate; what follows it must agree, and must not be free."""
    at = {"index_abduction": 0.05, "index_middle": 0.7, "index_distal": 0.7}
    hand = sah()
    for name, value in at.items():
        hand = replace(
            hand, joints=tuple(replace(j, lower=value, upper=value) if j.name == name else j for j in hand.joints)
        )
    spots = [Spot("index_distal"), Spot("thumb_distal"), Spot("palm")]
    planted = plant(hand, spots, np.random.default_rng(5))
    assert planted.task.free[0] == "index_proximal"
    report = verify_existence(planted.task, planted.proof())
    assert report.ok, report.reasons
    assert "joint:index_middle" not in report.slacks
    refused(limited(planted.task, "index_distal", 0.8, 0.8), planted.proof(), "fixed at 0.8 by its limits, at 0.7 by")
    refused(limited(planted.task, "index_distal", 0.7, 0.8), planted.proof(), "joint index_distal comes to")
    refused(limited(planted.task, "index_abduction", 0.06, 0.06), planted.proof(), OPEN)
    free = limited(planted.task, "index_middle", 0.0, 1.0)
    proof = planted.proof()
    proof = replace(proof, joints={**proof.joints, "index_middle": 0.7})
    refused(free, proof, "joint index_distal is fixed by its limits, but follows index_middle, which is free")


def test_hands_in_which_nothing_can_be_proved() -> None:
    planted = sah_case(0)
    hand = planted.task.hand
    links = list(hand.links)
    crooked = np.array(links[9].pose)
    crooked[:3, 0] *= 1 + 1e-9
    links[9] = replace(links[9], pose=crooked)
    bent = replace(planted.task, hand=replace(hand, links=tuple(links)))
    refused(bent, planted.proof(), "link index_knuckle does not stand at a rotation, but .*e-10 off one")
