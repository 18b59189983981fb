"""Proofs of existence: planted right ones are accepted, and the equations enclose exact values."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.proofs.fields import BadFile
from handfast.proofs.intervals import Interval
from handfast.synthesis.solution import existence_from_dict
from handfast.synthesis.task import PoseBounds
from tests.support.contact_equations import contact_equations, surface_at
from tests.support.planted_proofs import (
    PlantedProof,
    all_joints,
    cone_edges,
    equations_of,
    limited,
    odd_case,
    pose_of,
    reshaped,
    sah_case,
    verify_existence,
)


@pytest.mark.parametrize("block", range(4))
@pytest.mark.parametrize("case", [odd_case, sah_case])
def test_planted_right_ones_are_accepted(case, block: int) -> None:
    for seed in range(14 * block, 14 * (block + 1)):
        planted = case(seed)
        report = verify_existence(planted.task, planted.proof())
        assert report.ok, (seed, report.reasons)
        assert report.reasons == ()
        assert report.gap < 1e-12
        assert report.step + report.contraction < 1
        assert min(report.slacks.values()) > 0


def test_bounds_that_leave_room_are_met() -> None:
    """A pose within bounds, and a joint limit and a cone as near as they may come."""
    planted = sah_case(3, ("cap",), ("bicubic",))
    R, p = pose_of(planted)
    near = PoseBounds(np.column_stack([p - 1e-7, p + 1e-7]), np.clip(np.stack([R.T - 1e-5, R.T + 1e-5], -1), -1.0, 1.0))
    report = verify_existence(replace(planted.task, pose=near), planted.proof())
    assert report.ok, report.reasons
    assert 0 < report.slacks["position:0"] < 1e-7
    assert 0 < report.slacks["x_axis:2"] < 1e-5
    for label in ("joint:index_distal", "joint:thumb_base"):
        name = label.removeprefix("joint:")
        narrow = limited(planted.task, name, -3.0, all_joints(planted)[name] + 1e-6)
        report = verify_existence(narrow, planted.proof())
        assert report.ok, report.reasons
        assert 0 < report.slacks[label] < 1e-6
    for k, edge in enumerate(cone_edges(planted)):
        report = verify_existence(reshaped(planted.task, k, hand={"half_angle": edge + 1e-5}), planted.proof())
        assert report.ok, report.reasons
        assert 0 < report.slacks[f"contact:{k}:cone"] < 1e-4


def test_no_bounds_are_no_bounds() -> None:
    planted = sah_case(2)
    position = np.array([[-np.inf, np.inf], [-np.inf, 9.0], [-9.0, np.inf]])
    axes = np.tile([-1.0, 1.0], (3, 3, 1))
    R, _ = pose_of(planted)
    axes[2, 1] = [R[1, 2] - 0.01, 1.0]
    report = verify_existence(replace(planted.task, pose=PoseBounds(position, axes)), planted.proof())
    assert report.ok, report.reasons
    assert [name for name in report.slacks if "axis" in name or "position" in name] == [
        "position:1",
        "position:2",
        "z_axis:1",
    ]
    assert 0.009 < report.slacks["z_axis:1"] < 0.01


def test_a_cap_may_be_passed_at_its_pole() -> None:
    """s on both sides of 0: the points of an object cap about its axis."""
    planted = sah_case(1, ("cap",), ("cap",))
    cap, values = planted.task.contact_pairs[0].object, planted.values
    pole, _, _ = surface_at(cap, *(np.array([values[f"contact:0:{x}"]]) for x in "st"))
    turned = replace(cap, axis=pole[0] - cap.center)
    spun = replace(planted.task.contact_pairs[0], object=turned)
    again = PlantedProof(
        replace(planted.task, contact_pairs=(spun, planted.task.contact_pairs[1])), values | {"contact:0:s": 0.0}
    )
    proof = again.proof(prefer="contact:0:s")
    assert "contact:0:s" in proof.dependent
    report = verify_existence(again.task, proof)
    assert report.ok, report.reasons


# --- the enclosure ----------------------------------------------------------------------------------


def balls(x: object) -> Array:
    """Floats as exact balls, in an object array."""
    arb = pytest.importorskip("flint").arb
    x = np.asarray(x, dtype=float)
    return np.array([arb(v) for v in x.ravel().tolist()], dtype=object).reshape(x.shape)


def encloses(x: Interval, exact: Array) -> bool:
    """Is every ball certainly within its interval?"""
    ends = zip(balls(x.lo).ravel(), exact.ravel(), balls(x.hi).ravel(), strict=True)
    return x.shape == exact.shape and all(lo <= v and v <= hi for lo, v, hi in ends)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("case", [odd_case, sah_case])
def test_equations_and_derivatives_enclose_exact_ones(case, seed: int) -> None:
    """At the floats, and at random points of a box as wide as the proofs' and of one much wider."""
    flint = pytest.importorskip("flint")
    planted, rng = case(seed), np.random.default_rng(seed)
    middle = np.array(list(planted.values.values()))
    equations = equations_of(planted.task)
    assert list(equations.column) == planted.labels
    n, (h, most) = len(middle), (2.0**-200, 2.0**-60)
    for radius in (1e-7, 1e-3):
        box = Interval.around(middle, radius)
        both = Interval.between(np.stack([middle, box.lo]), np.stack([middle, box.hi]))
        at = equations.at(both)
        with flint.ctx.workprec(700):
            x = balls(np.stack([middle, middle + radius * rng.uniform(-0.99, 0.99, n)]))
            F = contact_equations(planted.task, planted.labels, x)
            assert encloses(at.F.value, F)
            width = at.F.value.hi - at.F.value.lo
            assert width[0].max() < 1e-12
            least = 2 * radius * np.abs(at.F.slope.mid[:, 0]).sum(axis=0)  # the width of the linear part
            assert (width[1] < 50 * least).all()
            for point in (0, 1):
                up, down = (
                    contact_equations(planted.task, planted.labels, x[point] + s * h * balls(np.eye(n)))
                    for s in (1, -1)
                )
                slopes = (up - down) / (2 * h)
                J = at.F.slope[:, point]
                ends = np.nextafter(J.lo - most, -np.inf), np.nextafter(J.hi + most, np.inf)
                wide = Interval.between(*ends)  # the differences are right to 2^-390 or so
                assert encloses(wide, slopes)
                assert (J.hi - J.lo).max() < (1e-11 if point == 0 else 1e3 * radius)


# --- the file's form --------------- --------------------------------------------------------------


def test_every_bit_comes_back() -> None:
    planted = sah_case(4)
    proof = planted.proof()
    again = existence_from_dict(json.loads(json.dumps(proof.to_json())))
    assert again.to_json() == proof.to_json()
    assert again.coordinates == proof.coordinates
    assert list(proof.coordinates) == planted.labels
    assert verify_existence(planted.task, again) == verify_existence(planted.task, proof)


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda d: d.pop("radii"), "^radii: is missing$"),
        (lambda d: d.update(note="x"), "^note: is not a known field"),
        (lambda d: d.update(schema="handfast/existence/2"), "^schema: "),
        (lambda d: d.update(quaternion=[1.0, 0.0, 0.0]), "^quaternion: "),
        (lambda d: d["radii"].pop(), r"^radii: has \d+ numbers; \d+ are needed"),
        (
            lambda d: d["joints"].update(index_proximal=float("nan")),
            "^joints.index_proximal: is nan; a finite number is needed",
        ),
        (lambda d: d["contacts"][0].update(object=[0.5]), r"^contacts\[0\].object"),
        (lambda d: d["contacts"][0].pop("hand"), r"^contacts\[0\].hand: is missing$"),
    ],
)
def test_faults_in_files(change, message: str) -> None:
    data = sah_case(1).proof().to_json()
    change(data)
    with pytest.raises(InputError, match=message) as fault:
        existence_from_dict(data)
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize("field", ["joints", "position", "quaternion", "radii"])
def test_only_finite_numbers(field: str) -> None:
    proof = sah_case(0).proof()
    value = dict.fromkeys(proof.joints, np.inf) if field == "joints" else np.full_like(getattr(proof, field), np.nan)
    with pytest.raises(
        BadFile, match=f"^{field}: has (shape .* finite numbers are needed|a number that is not finite)$"
    ):
        replace(proof, **{field: value})
