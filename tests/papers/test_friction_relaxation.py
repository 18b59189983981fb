"""Friction sectors: equations (14), (16), (19) by hand, and that every level contains the next."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.papers.friction_relaxation import Discretisation, Sector, edge_length


def test_edge_lengths_by_hand() -> None:
    """q = 0: l_1 = sec 45 degrees; q = 1: l_1 = sec 45 sec 22.5, l_2 = sec 22.5 degrees."""
    sec = lambda deg: 1 / np.cos(np.radians(deg))  # noqa: E731
    assert edge_length(1, 0) == pytest.approx(sec(45))
    assert edge_length(1, 1) == pytest.approx(sec(45) * sec(22.5))
    assert edge_length(2, 1) == pytest.approx(sec(22.5))
    assert edge_length(11, 9) == 1.0  # past the finest level: nothing left to contain


@pytest.mark.parametrize("q", [0, 1, 5, 9])
def test_counts_and_widths(q: int) -> None:
    full = Discretisation.full(q)
    assert len(full.sectors) == 4 * 2**q
    assert len(full.edges().length) == 4 * 2**q  # the ring closes: as many edges as sectors
    assert all(full.finest(s) for s in full.sectors)
    assert Discretisation.coarse(q).sectors[1] == Sector(0.25, 1)


def random_refinement(seed: int, q: int = 5, steps: int = 12) -> Discretisation:
    rng = np.random.default_rng(seed)
    d = Discretisation.coarse(q)
    for _ in range(steps):
        open_ = [s for s in d.sectors if not d.finest(s)]
        d = d.refined(open_[rng.integers(len(open_))])
    return d


@pytest.mark.parametrize("seed", range(10))
def test_refined_sectors_tile_the_circle(seed: int) -> None:
    d = random_refinement(seed)
    assert d.sectors[0].start == 0.0
    for a, b in zip(d.sectors, d.sectors[1:], strict=False):
        assert a.start + a.width == b.start
    assert d.sectors[-1].start + d.sectors[-1].width == 1.0


@pytest.mark.parametrize("seed", range(10))
def test_edges_are_neighbours_in_order_and_know_their_sector(seed: int) -> None:
    d = random_refinement(seed)
    e = d.edges()
    angles = np.array([np.arctan2(*e.D[::-1, i]) % (2 * np.pi) for i in e.chain]) / (2 * np.pi)
    for k, sector in enumerate(e.sectors):
        step = (angles[k + 1] - angles[k] + 0.5) % 1.0 - 0.5
        if abs(step) < 1e-9:  # between two levels: belongs to the coarser neighbour
            levels = {e.sectors[n].level for n in (k - 1, k + 1) if 0 <= n < len(e.sectors)}
            assert sector.level == min(levels)
        else:
            assert step == pytest.approx(sector.width)
            assert angles[k] == pytest.approx(sector.start)
    assert len({tuple(np.round(col, 12)) for col in e.D.T}) == e.D.shape[1]  # no edge stands twice


@pytest.mark.parametrize("seed", range(10))
def test_the_relaxed_region_contains_the_circle_and_every_refinement(seed: int) -> None:
    """Outer polygon e^T beta <= 1 outside the circle, inner chord f^T beta >= 1 inside, in every sector."""
    coarse = random_refinement(seed, steps=4)
    fine = coarse.refined(next(s for s in coarse.sectors if not coarse.finest(s)))
    for d in (coarse, fine):
        e = d.edges()
        for k, sector in enumerate(e.sectors):
            pair = e.D[:, [e.chain[k], e.chain[k + 1]]]
            if abs(np.linalg.det(pair)) < 1e-12:
                continue
            for t in np.linspace(0, 1, 9):
                angle = 2 * np.pi * (sector.start + t * sector.width)
                beta = np.linalg.solve(pair, [np.cos(angle), np.sin(angle)])
                assert (beta > -1e-12).all()
                assert beta.sum() <= 1 + 1e-12  # (15), outer
                assert e.length[[e.chain[k], e.chain[k + 1]]] @ beta >= 1 - 1e-12  # (15), inner


def test_the_factor_of_19_is_exact_at_mid_sector_and_below_elsewhere() -> None:
    """|d_t| ~ cos(half angle) sum l alpha: the erratum; printed inverted it would overestimate."""
    e = Discretisation.coarse(3).edges()
    pair = e.D[:, [e.chain[0], e.chain[1]]]
    for degrees, exact in ((45.0, True), (10.0, False), (0.0, False)):
        u = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
        alpha = np.linalg.solve(pair, u)
        weights = (e.midpoint * e.length)[[e.chain[0], e.chain[1]]]
        estimate = weights @ alpha
        assert estimate == pytest.approx(1.0) if exact else estimate < 1 - 1e-3
        assert (e.length[[e.chain[0], e.chain[1]]] @ alpha) >= 1 - 1e-12  # (18): never below
