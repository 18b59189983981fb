"""Statics alone: could contact forces within the friction cones balance a load at all?

A necessary condition of (1) to (8), cheap to ask and smooth in the configuration: where forces would have to
leave their cones, it says by how much, which tells a search in which direction to go. It proves nothing: that
forces are possible does not mean that they arise passively.
"""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.model.grasp import Grasp

EDGES = 8  # of the pyramid in each friction cone
BALANCED = 1e-6  # share of a wrench below which it counts as balanced
ROUNDING = 1e-9
CIRCUMSCRIBED = 1 / np.cos(np.pi / EDGES)  # factor on the friction with which the pyramids hold the cones


def imbalance(grasp: Grasp, wrenches: Array, friction: float = 1.0) -> Array:
    """(k,) share of each wrench (k, 6) that no forces within the friction cones balance: 0 none, 1 all of it.

    Torques are divided by the grasp's size. The cones are inscribed pyramids of 8 edges.

    Args:
        friction: factor on every coefficient: what is left with half the friction is a margin.
    """
    from scipy.optimize import nnls

    A, scale = _edges(grasp, friction)
    out = np.empty(len(wrenches))
    for k, w in enumerate(np.asarray(wrenches, dtype=float) * scale):
        size = float(np.linalg.norm(w))
        out[k] = nnls(A, -w / size)[1] if size > 0 else 0.0
    return out


def balances(grasp: Grasp, wrench: Array) -> bool:
    """Whether forces within the friction cones can balance a wrench (6,) at all, whatever the joints do.

    Necessary for every passive resistance. With pyramids around the cones: if nonnegative forces along their edges
    fall short, what is missing separates the wrench from all of them (Farkas), which is checked.
    """
    from scipy.optimize import nnls

    A, scale = _edges(grasp, CIRCUMSCRIBED)
    b = -scale * wrench
    length = float(np.linalg.norm(b))
    if not length:
        return True
    x, missing = nnls(A, b / length)
    if missing < BALANCED:
        return True
    y = b / length - A @ x
    return bool((A.T @ y).max() > ROUNDING * missing)  # True: not separated after all


def _edges(grasp: Grasp, friction: float) -> tuple[Array, Array]:
    """(6, 8 m) unit wrenches of forces along the edges of the pyramids; (6,) the scale that they are in."""
    scale = np.array([1.0] * 3 + [1 / grasp.size] * 3)
    angle = 2 * np.pi * np.arange(EDGES) / EDGES
    rays = np.array([np.ones(EDGES), np.cos(angle), np.sin(angle)])
    scaled = rays[None] * (np.array([0.0, 1.0, 1.0])[:, None] * friction * grasp.mu[:, None, None])
    scaled[:, 0] = 1.0
    G = (scale[:, None] * grasp.G).reshape(6, -1, 3)
    A = np.einsum("wmi,mie->wme", G, scaled).reshape(6, -1)
    return A / np.linalg.norm(A, axis=0), scale


def spare_friction(grasp: Grasp, wrenches: Array) -> float:
    """The share of the friction without which forces could still balance every wrench (k, 6): 0 to 1, 0 if not at all.

    A margin of statics, in steps of 1/64; it says nothing of whether the forces arise passively.
    """
    low, high = 0, 64  # sixty-fourths of the friction: balanced with `high`, not known below
    if imbalance(grasp, wrenches).max() > BALANCED:
        return 0.0
    while high - low > 1:
        middle = (low + high) // 2
        if imbalance(grasp, wrenches, middle / 64).max() > BALANCED:
            low = middle
        else:
            high = middle
    return 1.0 - high / 64
