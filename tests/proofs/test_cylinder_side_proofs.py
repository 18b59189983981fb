"""Proofs about sides of cylinders: right ones are accepted, wrong ones refused, the formulas are those of others."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from handfast.model.cylinder_side import CylinderSide, RoundSide
from handfast.proofs.intervals import Interval
from tests.support.contact_equations import contact_equations
from tests.support.planted_proofs import (
    PlantedProof,
    Spot,
    equations_of,
    odd_hand,
    plant,
    refused,
    reshaped,
    sah,
    verify_existence,
)

PAIRS = (("side", "side"), ("cap", "side"), ("side", "bicubic"), ("mixed", "side"), ("side", "cap"))
LINKS = ("index_distal", "thumb_distal", "index_proximal", "palm", "ring_middle")


@cache
def case(seed: int) -> PlantedProof:
    """Three of the pairs of kinds, on the SA hand or one with every kind of joint."""
    rng = np.random.default_rng(seed)
    hand, links = (sah(), LINKS) if seed % 2 else (odd_hand(rng), ("a3", "b3", "c2"))
    chosen = [PAIRS[(seed + k) % len(PAIRS)] for k in range(3)]
    return plant(hand, [Spot(links[k], *kinds) for k, kinds in enumerate(chosen)], rng)


@pytest.mark.parametrize("seed", range(10))
def test_planted_right_ones_are_accepted(seed: int) -> None:
    planted = case(seed)
    report = verify_existence(planted.task, planted.proof())
    assert report.ok, report.reasons
    assert report.gap < 1e-12
    for k, pair in enumerate(planted.task.contact_pairs):
        if isinstance(pair.hand, CylinderSide):
            assert 0 < report.slacks[f"contact:{k}:u"] < 0.5


@pytest.mark.parametrize("seed", range(6))
def test_equations_and_derivatives_are_those_of_other_formulas(seed: int) -> None:
    planted = case(seed)
    equations = equations_of(planted.task)
    x = np.array([planted.values[label] for label in equations.column])
    at = equations.at(Interval.of(np.stack([x, x])))
    assert np.abs(at.F.value.mid).max() < 1e-12
    theirs = PlantedProof(planted.task, {label: planted.values[label] for label in equations.column}).jacobian()
    ours = at.F.slope.mid[:, 0].T
    # tangents are of any length, and so are the equations with them
    scale = np.linalg.norm(ours, axis=1) / np.linalg.norm(theirs, axis=1)
    np.testing.assert_allclose(ours, theirs * scale[:, None], atol=1e-6)
    moved = x + 1e-3
    there = contact_equations(planted.task, list(equations.column), moved[None])[0]
    found = equations.at(Interval.of(np.stack([moved, moved]))).F.value.mid[0]
    np.testing.assert_allclose(found[:3], there[:3], atol=1e-12)


def first(seed: int, on: str) -> tuple[PlantedProof, int]:
    """A case, and its first contact with the side of a cylinder or cone on the hand or on the object."""
    planted = case(seed)
    pairs = planted.task.contact_pairs
    return planted, next(k for k, pair in enumerate(pairs) if isinstance(getattr(pair, on), RoundSide))


@pytest.mark.parametrize("on", ["hand", "object"])
@pytest.mark.parametrize("seed", [1, 3])
def test_forged_ones_are_refused(seed: int, on: str) -> None:
    planted, k = first(seed, on)
    side, proof = getattr(planted.task.contact_pairs[k], on), planted.proof()
    u, v = "uv" if on == "hand" else "st"

    def with_other(**numbers: object) -> object:
        return reshaped(planted.task, k, **{on: numbers})

    misses = r"a Newton step moves|contracts by|are not opposite"
    larger = (
        {"radius": side.radius * 1.001} if isinstance(side, CylinderSide) else {"radii": 1.001 * np.array(side.radii)}
    )
    refused(with_other(**larger), proof, misses)
    refused(with_other(center=side.center + 1e-5), proof, misses)
    refused(with_other(flip=not side.flip), proof, misses)
    turned = tuple(angle + 1e-3 for angle in side.angles)
    refused(with_other(angles=turned), proof, misses)
    raised = tuple(height + 1e-5 for height in side.heights)
    refused(with_other(heights=raised), proof, misses)
    for name, ends, width in ((u, side.angles, side.turn), (v, side.heights, side.length)):
        label = f"contact:{k}:{name}"
        share = planted.values[label]
        cut = (ends[0] + (share + 0.01) * width, ends[1])  # begins behind the contact
        values = planted.values | {label: (ends[0] + share * width - cut[0]) / (cut[1] - cut[0])}
        forged = PlantedProof(with_other(**{"angles" if name == u else "heights": cut}), values)
        refused(forged.task, forged.proof(), label)
