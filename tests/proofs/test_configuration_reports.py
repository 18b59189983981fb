"""What the report of the existence checker says: its numbers and its words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast.proofs import configurations
from handfast.proofs.configurations import Bounds, Existence
from handfast.proofs.intervals import Interval
from handfast.synthesis.task import PoseBounds, Task
from tests.support.planted_proofs import (
    PlantedProof,
    Report,
    Spot,
    cone_edges,
    equations_of,
    plant,
    refused,
    reshaped,
    sah,
    sah_case,
    verify_existence,
)


def planted_case() -> PlantedProof:
    """A patch on the index finger, a cap on the thumb."""
    return plant(sah(), [Spot("index_distal", "bicubic"), Spot("thumb_distal", "cap")], np.random.default_rng(0))


def only(task: Task, proof: Existence, message: str) -> Report:
    """Refused for this reason alone, word for word but for numbers."""
    report = refused(task, proof, f"^{message}$")
    assert len(report.reasons) == 1
    return report


@pytest.mark.parametrize("length", [0.002, 0.02, 1.0, 30.0])
def test_a_quaternion_may_have_any_length_but_hardly_any(length: float) -> None:
    planted = planted_case()
    proof = planted.proof()
    scale = np.where([label.startswith("quaternion") for label in proof.dependent], min(1.0, length), 1.0)
    scaled = replace(proof, quaternion=length * proof.quaternion, radii=proof.radii * scale)
    assert verify_existence(planted.task, scaled).ok
    norm = np.linalg.norm(proof.quaternion)
    short = replace(proof, quaternion=0.000999 / norm * proof.quaternion)
    only(planted.task, short, "the quaternion is shorter than 0.001")


def test_the_gap_is_that_of_the_widest_contact() -> None:
    planted = planted_case()
    right = verify_existence(planted.task, planted.proof())
    assert right.gap < 1e-12
    assert right.step < 1
    assert right.contraction < 1
    moved = planted.proof(**{"position:1": planted.values["position:1"] + 2e-4})
    report = only(
        planted.task,
        moved,
        r"the floats do not meet the equations \(contact [01] is open by 0.0002 m\): "
        r"a Newton step moves \S+ by \S+ radii",
    )
    assert report.gap == pytest.approx(2e-4, rel=1e-9)
    assert report.gap >= 2e-4 * (1 - 1e-12)
    assert report.step > 1
    assert report.contraction < 1


def test_a_box_that_is_too_wide_says_how_far_it_contracts() -> None:
    planted = planted_case()
    message = r"the box is too wide, or the equations too nearly singular: \S+ contracts by a factor of \S+ only"
    report = refused(planted.task, planted.proof(0.03, 0.001), f"^{message}$")
    assert 1 <= report.contraction < np.inf


def test_a_box_in_which_nothing_is_finite() -> None:
    planted = planted_case()
    report = refused(
        planted.task,
        planted.proof(1e3, 1e3),
        "^the box is too wide: in it the equations have no finite derivatives$",
    )
    assert (report.contraction, report.step) == (np.inf, np.inf)
    assert report.gap < 1e-12  # at the floats all is well


def test_numbers_that_are_none_are_infinite_in_the_report() -> None:
    planted = planted_case()
    proof = replace(planted.proof(), position=np.array([1e300, 0, 0]))
    report = verify_existence(planted.task, replace(proof, quaternion=1e160 * proof.quaternion))
    assert not report.ok
    for number in (report.gap, report.contraction, report.step):
        assert number == np.inf or number > 1e299
    assert not np.isnan([report.gap, report.contraction, report.step]).any()


def test_coordinates_that_cannot_meet_the_equations() -> None:
    """Of the thumb's three equations only the place on the object is among them: columns of zeros."""
    planted = planted_case()
    proof = planted.proof()
    chosen = [f"joint:index_{part}" for part in ("abduction", "proximal", "middle")]
    chosen += [*(f"contact:0:{name}" for name in "stuv"), "contact:1:s"]
    assert len(chosen) == len(proof.dependent)
    report = refused(
        planted.task,
        replace(proof, dependent=tuple(chosen)),
        "^the dependent coordinates are not determined: their Jacobian is singular$",
    )
    assert (report.contraction, report.step) == (np.inf, np.inf)


def test_the_order_of_the_dependent_coordinates_does_not_matter() -> None:
    planted = sah_case(2)
    proof = planted.proof()
    turned = replace(proof, dependent=(*proof.dependent[1:], proof.dependent[0]), radii=np.roll(proof.radii, -1))
    first, second = (verify_existence(planted.task, p) for p in (proof, turned))
    assert first.ok
    assert second.ok
    assert second.contraction == pytest.approx(first.contraction, rel=1e-3)
    assert second.slacks == pytest.approx(first.slacks, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: {"contacts": (replace(p.contacts[0], hand=None), p.contacts[1])},
         "contact 0: the hand region is no cap, so it needs u and v"),
        (lambda p: {"contacts": (p.contacts[0], replace(p.contacts[1], hand=(0.5, 0.5)))},
         "contact 1: the hand region is a cap, which has no u and v"),
        (lambda p: {"dependent": (p.dependent[1], *p.dependent[1:])}, r"\S+ is dependent twice"),
        (lambda p: {"joints": {**p.joints, "tail": 0.0}}, "has a value for joint tail; the free joints are index_.*"),
    ],
)  # fmt: skip
def test_misfits_in_words(change, message: str) -> None:
    planted = planted_case()
    proof = planted.proof()
    only(planted.task, replace(proof, **change(proof)), message)


def test_a_task_without_free_joints_says_so() -> None:
    planted = plant(sah(), [Spot("palm", "cap")], np.random.default_rng(1))
    proof = planted.proof()
    assert proof.joints == {}
    assert verify_existence(planted.task, proof).ok
    wrong = replace(proof, joints={"index_middle": 0.0})
    only(planted.task, wrong, "has a value for joint index_middle; the free joints are none")


@pytest.mark.parametrize("slack", [0.0, -1e-300, np.nan])
def test_a_bound_that_is_just_reached_is_not_met(monkeypatch: pytest.MonkeyPatch, slack: float) -> None:
    planted = planted_case()
    assert verify_existence(planted.task, planted.proof()).ok
    both = [{}, {"in:1": 1.0, "joint:a": slack}]
    monkeypatch.setattr(configurations.Bounds, "slacks", lambda *_: both)
    monkeypatch.setattr(configurations.Bounds, "fault", lambda _, label, __: f"{label} is reached")
    report = verify_existence(planted.task, planted.proof())
    assert (report.ok, report.reasons) == (False, ("joint:a is reached",))
    assert report.slacks == pytest.approx(both[1], nan_ok=True)


def test_a_refusal_claims_nothing() -> None:
    planted = planted_case()
    report = verify_existence(planted.task, replace(planted.proof(), contacts=()))
    assert report.reasons == ("has 0 contacts; the task has 2",)
    assert report.replay.figures == {"contraction": np.inf, "step": np.inf, "gap": np.inf}


@pytest.mark.parametrize(
    ("bounds", "rotated", "slack"),
    [
        ((-1.0, -0.9), -1.0, 0.1),  # no component is below -1: that end is no bound, though it is reached
        ((0.9, 1.0), 1.0, 0.1),
        ((-3.0, -0.5), -0.75, 0.25),
        ((0.5, 3.0), 0.75, 0.25),
        ((-0.5, 0.75), 0.5, 0.25),
        ((-0.5, 0.75), -0.5, 0.0),
        ((-1.0, 1.0), 1.0, None),
        ((-3.0, 1.0), 1.0, None),
        ((-1.0, 3.0), -1.0, None),
    ],
)
@pytest.mark.parametrize(("axis", "component"), [(0, 0), (2, 1)])
def test_bounds_of_the_object_s_axes(
    axis: int, component: int, bounds: tuple[float, float], rotated: float, slack: float | None
) -> None:
    axes = np.array(PoseBounds.none().axes)
    axes[axis, component] = bounds
    task = replace(planted_case().task, pose=PoseBounds(PoseBounds.none().position, axes))
    bounds, label = Bounds.of(equations_of(task)), f"{'xyz'[axis]}_axis:{component}"
    assert [name for name in bounds.labels if "axis" in name] == ([] if slack is None else [label])
    if slack is None:
        return
    inside = Interval.of(np.full((1, len(bounds.labels)), rotated))
    (found,) = bounds.slacks(inside)
    assert found[label] == pytest.approx(slack, abs=1e-15)
    assert found[label] <= slack
    assert bounds.fault(label, inside[0]).startswith(f"pose.{label[:6]}[{component}] comes to [{rotated:.9g}, ")


def test_a_whole_sphere_has_no_edge() -> None:
    planted = sah_case(1, ("cap",), ("cap",))
    narrow = verify_existence(planted.task, planted.proof()).slacks
    for k in range(len(planted.task.contact_pairs)):
        whole = reshaped(planted.task, k, hand={"half_angle": np.pi}, object={"half_angle": np.pi})
        report = verify_existence(whole, planted.proof())
        assert report.ok, report.reasons
        assert narrow.keys() - report.slacks.keys() == {f"contact:{k}:cone", f"contact:{k}:s"}


def test_what_is_said_of_cones_and_normals_has_the_right_sign() -> None:
    planted = sah_case(0, ("cap",))
    edge = cone_edges(planted)[0]
    task = reshaped(planted.task, 0, hand={"half_angle": edge / 2})
    report = verify_existence(task, planted.proof())
    (reason,) = report.reasons
    by = float(reason.removeprefix("contact 0 may leave the hand's cap, by a cosine of "))
    assert by == pytest.approx(np.cos(edge / 2) - np.cos(edge), abs=2e-3)
    planted = sah_case(0, ("bicubic",))
    task = reshaped(planted.task, 0, hand={"flip": not planted.task.contact_pairs[0].hand.flip})
    (reason,) = verify_existence(task, planted.proof()).reasons
    low, high = reason.removeprefix("contact 0: the normals are not opposite: their cosine comes to [")[:-12].split(
        ", "
    )
    assert float(low) == pytest.approx(1, abs=1e-4)
    assert float(high) == pytest.approx(1, abs=1e-4)
