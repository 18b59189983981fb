"""Grasps that are a little off: drawn within their bounds, and a pinch whose maximum is known for each of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.simulation_floor import pinch
from handfast.core.answer import Stop
from handfast.core.errors import InputError
from handfast.pictures.sampled_picture import conclusion, draw_sampled
from handfast.readers.grasp_file import load_grasp
from handfast.stability.studies.sampled_maximum import Perturbation, SampledMaximum, sampled_maximum

ACROSS = [0.0, 0, 1]
LOOSE = Perturbation(positions=2e-3, normals=0.1, friction=0.2, command=0.3)


def test_samples_keep_within_their_bounds_and_fill_them() -> None:
    grasp = pinch(0.5)
    drawn = [LOOSE.sample(grasp, 0, i) for i in range(300)]
    off = np.array([np.linalg.norm(g.positions - grasp.positions, axis=1) for g in drawn])
    cos = [c.normal @ own.normal for g in drawn for c, own in zip(g.contacts, grasp.contacts, strict=True)]
    tilt = np.arccos(np.minimum(cos, 1.0))
    mu, command = np.array([g.mu for g in drawn]) / 0.5, np.array([g.command[0] for g in drawn])
    assert 0.95 * 2e-3 < off.max() <= 2e-3
    assert 0.95 * 0.1 < tilt.max() <= 0.1 + 1e-9
    assert 0.8 <= mu.min() < 0.81
    assert 1.19 < mu.max() <= 1.2
    assert 0.7 <= command.min() < 0.71
    assert 1.29 < command.max() <= 1.3
    # uniform in the ball and, by area, in the cone: half are within these
    assert np.median(off) == pytest.approx(2e-3 * 0.5 ** (1 / 3), rel=0.03)
    assert np.median(tilt) == pytest.approx(np.arccos((1 + np.cos(0.1)) / 2), rel=0.05)


def test_a_sample_depends_on_its_seed_and_number_alone() -> None:
    grasp = pinch(0.5)
    one, other = LOOSE.sample(grasp, 3, 7), replace(LOOSE, normals=0.0, command=0.0).sample(grasp, 3, 7)
    assert np.array_equal(one.positions, other.positions)
    assert np.array_equal(one.mu, other.mu)
    assert np.array_equal(other.contacts[0].normal, grasp.contacts[0].normal)
    assert not np.array_equal(one.positions, LOOSE.sample(grasp, 4, 7).positions)
    assert not np.array_equal(one.positions, LOOSE.sample(grasp, 3, 8).positions)


def test_a_pinch_carries_what_its_lesser_friction_and_its_command_say() -> None:
    """Pressed with f on both sides; the forces across are equal, so that it carries 2 f min(mu_1, mu_2)."""
    bounds = Perturbation(friction=0.3, command=0.2)
    found = sampled_maximum(pinch(0.5), ACROSS, bounds, samples=12, seed=1)
    drawn = [bounds.sample(pinch(0.5), 1, i) for i in range(12)]
    expected = np.array([2 * g.command[0] * g.mu.min() for g in drawn])
    assert found.lower == pytest.approx(expected, rel=1e-3)
    assert (found.lower <= expected * (1 + 1e-9)).all()
    assert (found.upper >= expected * (1 - 1e-9)).all()
    assert found.nominal.lower == pytest.approx(1.0, rel=1e-3)
    assert found.below_nominal == pytest.approx((expected < 0.999).mean(), abs=1e-9)
    assert found.quantiles[0.0] == found.lower.min()
    assert found.quantiles[0.5] == np.sort(found.lower)[5]
    assert found.uncertain is None
    assert found.conservative is None
    assert found.unseen == pytest.approx(1 - 0.05 ** (1 / 12))


@pytest.mark.slow
def test_eta_is_no_bound_of_the_papers_first_grasp() -> None:
    """Equation (17) at 2.5 degrees promises what the grasp resists as it stands; grasps that are off resist less."""
    found = sampled_maximum(load_grasp("fig1"), [0, 1, 0], Perturbation(normals=np.radians(2.5)), samples=20)
    assert found.uncertain is not None
    assert found.uncertain.lower == pytest.approx(found.nominal.lower, rel=1e-3)
    assert found.conservative is False
    assert found.quantiles[0.0] < 2.1
    assert found.below_uncertain is not None
    assert found.below_uncertain > 0.3
    said = found.to_json()
    assert said["conservative"] is False
    assert len(said["lower"]) == 20
    assert said["upper"].count(None) == int(np.isinf(found.upper).sum()) > 0
    assert any("eta is no bound" in line for line in conclusion(found))
    assert draw_sampled(found).axes[0].get_xlabel() == "largest force along +y that is resisted [N]"


def test_two_contacts_that_are_off_balance_nothing_beside_the_line_through_them() -> None:
    """Then a force at the origin turns the object about that line, which no forces at its contacts prevent."""
    found = sampled_maximum(pinch(0.5), ACROSS, Perturbation(positions=1e-3), samples=5)
    assert found.nominal.lower > 0.99
    assert found.values.tolist() == [0.0] * 5
    assert found.stop is Stop.COMPLETE
    assert "100 % resist nothing along this direction." in conclusion(found)


def test_what_is_not_decided_is_left_out() -> None:
    whole = sampled_maximum(pinch(0.5), ACROSS, Perturbation(friction=0.3), samples=4)
    part = replace(whole, decided=np.array([True, False, True, False]), stop=Stop.INTERRUPTED)
    assert part.values.tolist() == sorted(whole.lower[[0, 2]].tolist())
    assert conclusion(part)[:2] == [
        "Interrupted: the samples that were asked are shown.",
        "2 samples not decided, left out; more time for each may decide them.",
    ]
    assert "of all grasps within these bounds that can be decided so resist less" in conclusion(part)[-1]
    none: SampledMaximum = replace(whole, decided=np.zeros(4, bool))
    assert (none.quantiles, none.conservative, none.unseen) == ({}, None, 1.0)


@pytest.mark.parametrize(
    ("bounds", "fault"),
    [
        ({}, "bounds: are all 0"),
        ({"positions": -1.0}, "positions: is -1; 0 m or more"),
        ({"normals": 0.8}, "normals: is 0.8; 0 to below 45 degrees"),
        ({"friction": "much"}, "friction: is 'much'; a share from 0 to 1"),
        ({"friction": 1.5}, "friction: is 1.5; a share from 0 to 1"),
        ({"command": 1.0}, "command: is 1; a share from 0 to below 1"),
        ({"command": np.nan}, "command: is nan"),
    ],
)
def test_bad_bounds(bounds: dict[str, float], fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        Perturbation(**bounds)


def test_bounds_that_leave_the_grasp_as_it_is_are_refused() -> None:
    with pytest.raises(InputError, match="four-feet: bounds: of command alone leave this grasp as it is: it has none"):
        sampled_maximum(load_grasp("four-feet"), [0, 0, -1], Perturbation(command=0.1), samples=2)
    with pytest.raises(InputError, match="bounds: of friction alone"):
        sampled_maximum(pinch(0.0), ACROSS, Perturbation(friction=0.1), samples=2)


def test_bad_counts() -> None:
    with pytest.raises(InputError, match="samples: is 0; at least 1"):
        sampled_maximum(pinch(0.5), ACROSS, LOOSE, samples=0)
    with pytest.raises(InputError, match="seed: is -1"):
        sampled_maximum(pinch(0.5), ACROSS, LOOSE, seed=-1)


def test_a_sample_is_below_where_its_own_bound_is() -> None:
    """Of four that are decided 0.9 is surely below 1, and nothing below 0.5; what was not decided does not count."""
    found = sampled_maximum(pinch(0.5), ACROSS, Perturbation(friction=0.1, normals=0.01), samples=1)
    assert found.uncertain is not None
    told = replace(
        found,
        nominal=replace(found.nominal, lower=1.0, upper=2.0),
        uncertain=replace(found.uncertain, lower=0.5, upper=0.95),
        lower=np.array([0.5, 0.45, 0.9, 1.5, 0.2]),
        upper=np.array([0.9, 1.0, 1.1, np.inf, 0.3]),
        decided=np.array([True, True, True, True, False]),
    )
    assert told.below_nominal == 1 / 4
    assert told.below_uncertain == 0
    assert told.conservative is True
    assert told.values.tolist() == [0.45, 0.5, 0.9, 1.5]
    worse = replace(told, uncertain=replace(found.uncertain, lower=0.95, upper=2.0))
    assert worse.below_uncertain == 1 / 4
    assert worse.conservative is False
    none = replace(told, decided=np.zeros(5, dtype=bool))
    assert (none.below_nominal, none.conservative) == (0.0, None)
