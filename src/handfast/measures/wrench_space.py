"""Sets of wrenches that contacts can answer: grasp wrench spaces, force closure, singular values of the grasp map.

Wrench spaces are those of Ferrari and Canny, *Planning optimal grasps* (ICRA 1992), with their radius and volume.

A wrench space holds every wrench that contact forces inside the friction cones (here pyramids) can have together:
if their normal parts sum to 1 N at most (L1), the convex hull of all edges; if each is 1 N at most (L infinity),
the Minkowski sum over the contacts. Its epsilon is the radius of the largest ball about the origin inside of it: the
smallest wrench that cannot be balanced. Nothing of the hand is known to it.
"""

from __future__ import annotations

from math import factorial
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.measures.conic_program import NotMeasured

SINGULAR_SHARE = 1e-9  # singular values below this share of the largest are none
MIN_CLOSURE_MARGIN = 1e-7  # a margin of force closure below is rounding
HULL_TOLERANCE = 1e-6  # relative distance of the origin from a hull that rounding does not make
MOST_SUMS = 1000  # corners whose hull is built for the volume of a Minkowski sum
MOST_ROUNDS, FACET_BATCH = 100, 24  # of growing, facets that grow in one round
HULL_GAP = 1e-8  # relative distance of the two bounds at which growing ends


def _hull(points: Array) -> Any:
    """The convex hull of (n, 6) points, None if they are flat."""
    from scipy.spatial import ConvexHull, QhullError

    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if len(points) < 7 or spread[-1] <= SINGULAR_SHARE * spread[0]:
        return None
    try:
        return ConvexHull(points)
    except QhullError:  # many points of one facet, as symmetric grasps have: moved by rounding they are no trouble
        return ConvexHull(points, qhull_options="QJ")


def _radius(hull: Any) -> float:
    """Of the largest ball about the origin inside a hull; 0 if the origin is outside."""
    return 0.0 if hull is None else max(0.0, float(-hull.equations[:, -1].max()))


class L1Space:
    """The L1 wrench space of (m, edges, 6) edge wrenches, for 1 N in all: the hull of these edges.

    A hull in six dimensions takes milliseconds, all that is asked of it next to nothing. So it is made once: of the
    wrenches as they are given, of whatever they are in another scale, and with the origin.
    """

    def __init__(self, wrenches: Array) -> None:
        self.points = wrenches.reshape(-1, 6)
        self._hull = _hull(self.points)

    @property
    def epsilon(self) -> float:
        """[N] the radius of the largest ball about the origin inside."""
        return _radius(self._hull)

    @property
    def volume(self) -> float:
        """[N^6] of the hull of the edges and of the origin, for no force at all is always possible.

        An origin outside adds the simplices between it and the facets that it sees.
        """
        if self._hull is None:
            whole = _hull(np.vstack([self.points, np.zeros((1, 6))]))
            return 0.0 if whole is None else float(whole.volume)
        seen = self._hull.simplices[self._hull.equations[:, -1] > 0]
        return float(self._hull.volume + np.abs(np.linalg.det(self.points[seen])).sum() / factorial(6))

    @property
    def closure_margin(self) -> float | None:
        """The margin of `force_closure`, where facets tell it; None where the hull is flat.

        With coefficients x = d + y, y >= 0, of n edges w_i that sum to n, forces balance where the hull has the point
        sum y_i w_i / (n - n d) = -d / (1 - d) mean(w): as far as a ray from the origin goes within the hull.
        """
        if self._hull is None:
            return None
        inside = -self._hull.equations[:, -1]
        if inside.min() < 0:
            return None if inside.min() > -HULL_TOLERANCE * float(np.abs(self.points).max()) else 0.0
        towards = -self._hull.equations[:, :-1] @ self.points.mean(axis=0)
        ahead = towards > 0
        t = float((inside[ahead] / towards[ahead]).min(initial=np.inf))
        return t / (1 + t) if t < np.inf else 1.0

    def epsilon_in(self, turned: Array) -> float:
        """[N] epsilon where each wrench w is `turned` w, a regular (6, 6): facets stay facets, n . w becomes
        (turned^-T n) . (turned w)."""
        if self._hull is None:
            return 0.0
        normals, offsets = self._hull.equations[:, :-1], self._hull.equations[:, -1]
        sizes = np.linalg.norm(normals @ np.linalg.inv(turned), axis=1)
        return max(0.0, float((-offsets / sizes).min()))


def _support(wrenches: Array, directions: Array) -> Array:
    """(k, 6) the points of the L infinity space that are farthest along (k, 6) directions."""
    along = np.einsum("med,kd->kme", wrenches, directions)
    best = along.argmax(axis=2)
    points = wrenches[np.arange(len(wrenches)), best]  # (k, m, 6)
    pushes = np.take_along_axis(along, best[:, :, None], axis=2) > 0
    return (points * pushes).sum(axis=1)


def linf_epsilon(wrenches: Array) -> float:
    """Epsilon of the L infinity wrench space of (m, edges, 6) edge wrenches [N], for 1 N at each contact.

    The space has too many corners to be built. A polytope inside of it grows instead where its surface is nearest to
    the origin, until the space itself ends there: Zheng, *An efficient algorithm for a grasp quality measure*,
    IEEE T-RO 2013.

    Raises:
        NotMeasured: the bounds do not meet in a number of rounds.
    """
    points = np.vstack([wrenches.reshape(-1, 6), _support(wrenches, np.vstack([np.eye(6), -np.eye(6)]))])
    hull = _hull(points)
    if _radius(hull) <= SINGULAR_SHARE * float(np.abs(points).max()):  # this hull spans the same cone
        return 0.0
    lower, best = 0.0, np.inf
    for _ in range(MOST_ROUNDS):
        distances = -hull.equations[:, -1]
        lower = float(distances.min())
        nearest = np.argsort(distances)[: 20 * FACET_BATCH]
        _, kept = np.unique(np.round(hull.equations[nearest, :-1], 9), axis=0, return_index=True)
        facets = nearest[np.sort(kept)][:FACET_BATCH]
        directions = hull.equations[facets, :-1]
        found = _support(wrenches, directions)
        heights = np.einsum("kd,kd->k", found, directions)
        best = min(best, float(heights.min()))
        if best - lower <= HULL_GAP * best:
            return best
        grown = found[heights > distances[facets] + HULL_GAP * best]
        hull = _hull(np.vstack([hull.points[hull.vertices], grown]))
    raise NotMeasured(f"bounds {lower:.4g} and {best:.4g} of the L infinity wrench space did not meet")


def linf_volume(wrenches: Array) -> float:
    """Volume [N^6] of the L infinity wrench space of (m, edges, 6) edge wrenches, for 1 N at each contact.

    Raises:
        NotMeasured: its (edges + 1)^m corners are too many.
    """
    m, edges, _ = wrenches.shape
    if (edges + 1) ** m > MOST_SUMS:
        raise NotMeasured(f"the sum of {m} cones of {edges} edges has too many corners; take fewer edges")
    points = np.zeros((1, 6))
    for cone in wrenches:
        points = (points[:, None] + np.vstack([np.zeros((1, 6)), cone])[None]).reshape(-1, 6)
    whole = _hull(points)
    return 0.0 if whole is None else float(whole.volume)


def force_closure(wrenches: Array) -> tuple[bool, float]:
    """Can contact forces balance every wrench? The test, and how far inside the cones forces balance each other.

    Some forces strictly inside all friction cones must balance, and the cones' wrenches must span all six
    dimensions (Prattichizzo and Trinkle, *Grasping*, in the Springer Handbook of Robotics, the linear program of
    frictional form closure; there over the cones' faces, here over their edges). The margin is the smallest
    coefficient of an edge, as a share of the mean one: 1 if equal forces at all contacts balance, 0 at the border.

    Args:
        wrenches: (m, edges, 6), see `edge_wrenches`.
    """
    from scipy.optimize import linprog

    columns = wrenches.reshape(-1, 6).T
    n = columns.shape[1]
    # maximise d: columns @ x = 0, x >= d, mean of x = 1; with x = y + d, y >= 0
    total = columns.sum(axis=1)
    rows = np.vstack([np.c_[columns, total], np.r_[np.ones(n), n][None]])
    found = linprog(np.r_[np.zeros(n), -1.0], A_eq=rows, b_eq=np.r_[np.zeros(6), n], bounds=[(0, None)] * (n + 1))
    margin = float(found.x[-1]) if found.status == 0 else 0.0
    sizes = np.linalg.svd(columns, compute_uv=False)
    spans = n >= 6 and bool(sizes[-1] > SINGULAR_SHARE * sizes[0])
    return spans and margin > MIN_CLOSURE_MARGIN, margin


def smallest_singular_value(G: Array) -> float:
    """The smallest singular value of a (6, 3m) grasp map in a scale: 0 if contacts cannot press in some direction.

    Li and Sastry, *Task-oriented optimal grasping by multifingered robot hands* (1988): how far the grasp is from
    one whose map loses rank. Friction cones have no part in it.
    """
    return float(np.linalg.svd(G, compute_uv=False)[5]) if G.shape[1] >= 6 else 0.0


def ellipsoid_volume(G: Array) -> float:
    """sqrt(det(G G^T)), the volume of the ellipsoid of wrenches of unit contact forces up to a constant.

    Li and Sastry (1988), their second measure.
    """
    return float(np.prod(np.linalg.svd(G, compute_uv=False)[:6])) if G.shape[1] >= 6 else 0.0


def isotropy(G: Array) -> float:
    """Smallest over largest singular value: 1 if contact forces count alike in all directions.

    Kim, Oh, Yi and Suh, *Optimal grasping based on non-dimensionalized performance indices* (IROS 2001).
    """
    if G.shape[1] < 6:
        return 0.0
    sizes = np.linalg.svd(G, compute_uv=False)
    return float(sizes[5] / sizes[0])
