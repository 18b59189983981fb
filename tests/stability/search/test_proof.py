"""Rays of a search's certificate: each leaf is asked with the ray that it ends with."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.grasps import random_case
from handfast.proofs import checker
from handfast.proofs.certificate import Certificate
from handfast.proofs.kinds import Row
from handfast.stability.search.certificate_polish import rays_of, with_rays
from handfast.stability.search.proof import Proof
from handfast.stability.studies.questions import maximum


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[list[int] | None]:
    """Which leaves the checker was asked about; None is all."""
    out: list[list[int] | None] = []
    usual = checker.verify

    def verify(c: Certificate, *limits: float, among: np.ndarray | None = None, **more: bool) -> checker.Checked:
        out.append(None if among is None else among.tolist())
        return usual(c, *limits, among=among, **more)

    monkeypatch.setattr(checker, "verify", verify)
    return out


@pytest.fixture(scope="module")
def proof() -> Proof:
    case = random_case(3, 3)
    answer = maximum(case.grasp, case.direction)
    assert answer.proof is not None
    assert answer.proof.cap is None
    assert len(answer.proof.certificate.leaves) > 3
    return Proof(answer.proof.reduced, answer.proof.pool, answer.proof.cut)


def spoiled(c: Certificate, leaf: int) -> Certificate:
    y = c.multiplier.astype(float)
    y[c.start[leaf] : c.start[leaf + 1]] = 0.0
    return replace(c, multiplier=y)


def test_rays_that_do_are_asked_once(proof: Proof, asked: list[list[int] | None]) -> None:
    found, ok, unproved = proof.checked(np.inf, {})
    assert (ok, unproved.tolist(), asked) == (True, [], [None])
    assert found.certificate.multiplier.dtype == np.float32


def test_one_that_rounding_spoils_gets_another(
    proof: Proof, asked: list[list[int] | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = Certificate.rounded
    monkeypatch.setattr(Certificate, "rounded", lambda c: spoiled(usual(c), 2))
    known: dict = {}
    found, ok, _ = proof.checked(np.inf, known)
    assert ok
    assert asked == [None, [2], None]
    whole = checker.verify(found.certificate)
    assert (whole.ok, whole.cap) == (True, found.cap)
    assert set(known) == set(proof._named(proof.certificate))
    asked.clear()
    assert proof.checked(np.inf, known)[1]
    assert asked == [[], None]  # in the next round none is asked but by the whole
    monkeypatch.setattr("handfast.stability.search.proof.repaired", lambda *_: {})
    found, ok, _ = proof.checked(np.inf, {})  # or it is taken as it was found
    own = slice(*found.certificate.start[2:4])
    assert ok
    assert (found.certificate.multiplier[own] == proof.certificate.multiplier[own]).all()


def test_caps_are_those_of_all_leaves_together(
    proof: Proof, asked: list[list[int] | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Leaves 0 and 3 are proved up to 9 N, leaf 2 only with another ray."""
    usual, rounded = checker.verify, Certificate.rounded

    def verify(c: Certificate, *limits: float, among: np.ndarray | None = None) -> checker.Checked:
        told = usual(c, *limits, among=among)
        capped = {0, 3} & {*(range(told.leaves) if among is None else among.tolist())}
        return replace(told, capped=tuple(sorted(capped)), cap=9.0 if capped and told.ok else None)

    monkeypatch.setattr(Certificate, "rounded", lambda c: spoiled(rounded(c), 2))
    monkeypatch.setattr(checker, "verify", verify)
    found, ok, _ = proof.checked(np.inf, {})
    assert (ok, found.cap) == (True, 9.0)
    assert asked == [None, [2], None]


def test_what_is_known_of_a_leaf_does_not_stand_for_the_whole(proof: Proof, asked: list[list[int] | None]) -> None:
    rays = rays_of(proof.certificate)
    known = {proof._named(proof.certificate)[1]: (*rays[1][:4], np.zeros(len(rays[1][4])))}
    _, ok, unproved = proof.checked(np.inf, known)
    assert not ok
    assert unproved.tolist() == [proof.certificate.leaves[1]]
    assert asked[-1] is None
    assert 1 not in asked[0]


def test_a_leaf_without_any_ray_is_found_again(proof: Proof, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rows that hold in its case have one, which the linear program in the middle of all finds."""
    broken = Proof(proof.reduced, proof.pool, proof.cut)
    broken.__dict__["certificate"] = spoiled(proof.certificate, 1)
    found, ok, _ = broken.checked(np.inf, {})
    assert ok
    assert checker.verify(found.certificate).ok
    monkeypatch.setattr("handfast.stability.search.proof.repaired", lambda *_: {})
    known: dict = {}
    _, ok, unproved = broken.checked(np.inf, known)
    assert not ok
    assert len(known) == len(proof.certificate.leaves) - 1
    assert unproved.tolist() == [proof.certificate.leaves[1]]


def test_no_time_shows_nothing(proof: Proof) -> None:
    known: dict = {}
    _, ok, unproved = proof.checked(-np.inf, known)
    assert (ok, unproved.tolist(), known) == (False, [], {})


def test_rays_come_back_as_they_were(proof: Proof) -> None:
    for c, bits in ((proof.certificate, np.float64), (proof.certificate.rounded(), np.float32)):
        again = with_rays(c, rays_of(c))
        assert again.multiplier.dtype == bits
        for name in ("start", "kind", "index", "a", "b", "multiplier"):
            assert np.array_equal(getattr(again, name), getattr(c, name)), name


def test_names_of_leaves_tell_what_is_claimed(proof: Proof) -> None:
    c = proof.certificate
    names = proof._named(c)
    assert names == proof._named(c)
    assert len(c.references)  # normal forces about which the balance of energy is linear, in some of the leaves
    for other in (replace(c, scalar=(c.scalar[0], 2 * c.scalar[1])), replace(c, references=c.references + 1)):
        named = proof._named(other)
        cited = [bool((c.kind[first:last] == Row.ENERGY).any()) for first, last in pairwise(c.start.tolist())]
        assert [a != b for a, b in zip(names, named, strict=True)] == (
            cited if other.scalar == c.scalar else [True] * len(names)
        )
    assert sum(a != b for a, b in zip(names, proof._named(spoiled(c, 0)), strict=True)) == 1
