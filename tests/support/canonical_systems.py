"""Canonical systems of tasks with a planted solution, and what a solution of one has to fulfil."""

from __future__ import annotations

import numpy as np

from handfast.model.region import Cap
from handfast.papers.canonical_equations import point
from handfast.papers.canonical_system import Canonical
from handfast.readers.load_hand import load_hand
from tests.support.planted import bump, plant

TIGHT = 1e-12  # rounding, in units of length and of direction

# synthesis paper, Table 2: contacts, n_v, n_e, d; handling prints d = 19, its own formula gives 16


def tip(half_angle: float = np.pi / 3) -> Cap:
    return Cap(np.array([0.02, 0, 0]), 0.013, np.array([0.14, 0, 0.99]), half_angle)


def sah_system(links: str, seed: int = 0, regions=None):
    """A planted task of the SA hand: fingertip caps, a patch on the palm, patches on the object."""
    rng = np.random.default_rng(seed)
    pairs = []
    for link in links.split():
        on_hand = bump(rng, (1, 2)) if link == "palm" else tip()
        pairs.append((link, on_hand, bump(rng, (2, 3))))
    return plant(load_hand("schunk-sah"), regions or pairs, rng)


def at(planted, system: Canonical) -> np.ndarray:
    return point(system, planted.q, planted.pose, planted.parameters)


def jacobian(system: Canonical, q: np.ndarray) -> np.ndarray:
    step = 1e-6
    columns = [(system.residual(q + step * e) - system.residual(q - step * e)) / (2 * step) for e in np.eye(len(q))]
    return np.array(columns).T


def nullity(system: Canonical, q: np.ndarray) -> int:
    singular = np.linalg.svd(jacobian(system, q), compute_uv=False)
    singular = np.concatenate([singular, np.zeros(max(0, len(q) - len(singular)))])
    small, large = singular[singular < 1e-7], singular[singular > 1e-5]
    assert len(small) + len(large) == len(singular), singular[len(large) - 2 :]  # a clear gap between the two
    return len(small)


def check_solution(planted, system: Canonical) -> np.ndarray:
    q = at(planted, system)
    assert np.abs(system.residual(q)).max() < TIGHT
    assert system.outside(q).max() < TIGHT
    x = system.expanded
    lifted = x.lift(q)
    assert np.abs(x.linear(lifted)).max() < TIGHT
    assert np.abs(x.forms(lifted)).max() < TIGHT
    assert np.maximum(x.lower - lifted, lifted - x.upper).max() < TIGHT
    return q
