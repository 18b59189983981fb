"""The equilibrium that moves least, from any equilibrium of the same question: the state that answers show.

What a search finds may move farther than it has to: an object that turns freely about a line, a finger that swings far
from what it does not touch. In the modes of what it found there mostly is no other state; where there is, a small
program finds the least. Then the search is asked whether other modes have states within smaller bounds of the motions
at the contacts. What comes out is judged by the equations alone. That nothing moves less is the word of the search, not
proved.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from handfast.core.errors import InputError
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.objective import ANY_STATE
from handfast.stability.problem.witness import Witness
from handfast.stability.search.reduced import Reduced, padded, reduce
from handfast.stability.search.same_modes import ALIKE_MOTION, least_in_same_modes
from handfast.stability.search.search import Search

# of the least motion so far, in which a search looks for another; 0.75 is surely less in length
MOTION_SHARES = 0.75, 0.9
# times the largest force: a motion that is far; so many times as far is the next bound
FAR_MOTION, MOTION_CAP_GROWTH = 4.0, 16.0
NODE_LIMIT = 200
MOST_BOUNDS = 255  # that a search tells apart
_GOLDEN = (1 + 5**0.5) / 2
# (6, 3) the six axes of an icosahedron: bounds along them are nearly a ball, however contact frames are turned
ICOSAHEDRON_AXES = np.array(
    [(0, 1, _GOLDEN), (0, -1, _GOLDEN), (1, _GOLDEN, 0), (-1, _GOLDEN, 0), (_GOLDEN, 0, 1), (_GOLDEN, 0, -1)]
)
ICOSAHEDRON_AXES /= np.hypot(1, _GOLDEN)


def least_motion(found: Witness, limits: GraspLimits | None = None) -> Witness:
    """The witness of the same question whose `largest_motion` is as small as is found; never larger than before.

    Args:
        found: an exact equilibrium; returned as it is if nothing better is found.
        limits: of the question; none of forces by default.
    """
    if not found.valid or found.largest_motion == 0:
        return found
    try:
        p = scaled_problem.build(found.grasp, found.wrench, limits=limits or GraspLimits(found.eta), mdp=found.mdp)
    except InputError:  # a load of a maximum is a sum, and rounding may take it out of what contacts can balance
        return found
    r = reduce(p, ANY_STATE)
    best = least_in_same_modes(r, found)
    if len(r.lo) + 2 * p.sizes[0] * len(ICOSAHEDRON_AXES) > MOST_BOUNDS:
        return best
    while True:
        better = (w for bound in _bounds(best) if (w := _moving_less(r, best, bound)) is not None)
        other = next(better, None)
        if other is None:
            return best
        best = other


def _bounds(best: Witness) -> Iterator[float]:
    """[N] of motions, within which a search looks for less than the best: from that of its forces on, if it is far."""
    farthest = MOTION_SHARES[0] * best.largest_motion
    bound = FAR_MOTION * float(best.state.c[::3].max())
    while 0 < bound < farthest:
        yield bound
        bound *= MOTION_CAP_GROWTH
    yield from (share * best.largest_motion for share in MOTION_SHARES)


def _moving_less(r: Reduced, best: Witness, bound: float) -> Witness | None:
    """An equilibrium that moves less than the best, at each contact at most by a bound [N] along each of
    `ICOSAHEDRON_AXES`."""
    p, bound = r.p, bound / r.p.force
    motions = np.vstack([np.hstack([p.G.T, np.zeros(p.J.shape)]), np.hstack([p.G.T, -p.J])]) @ r.M
    rows = np.einsum("ak,ikn->ian", ICOSAHEDRON_AXES, motions.reshape(-1, 3, motions.shape[1])).reshape(
        -1, motions.shape[1]
    )
    at = 3 * len(p.mu) + len(r.active)  # behind what the model moves, before the balance of energy
    D = np.insert(r.D, at, np.hstack([rows, np.zeros((len(rows), r.D.shape[1] - rows.shape[1]))]), axis=0)
    where = len(r.lo) - (len(r.D) - at)
    narrowed = replace(
        r,
        D=D,
        DT=padded(D[:, : rows.shape[1]].T),
        before=padded(np.insert(r.before[: len(r.D)], at, np.zeros(len(rows)))),
        lo=np.insert(r.lo, where, np.full(len(rows), -bound)),
        hi=np.insert(r.hi, where, np.full(len(rows), bound)),
        names=(*r.names[:where], *(("motion", i) for i in range(len(rows))), *r.names[where:]),
    )
    s = Search(narrowed, gap=1e-3, gap_absolute=0.0, node_limit=NODE_LIMIT, workers=1)
    for _ in s:
        pass
    if s.z is None:
        return None
    other = replace(best, state=p.unscale(r.point(s.z)))
    other = least_in_same_modes(r, other) if other.valid else best
    return other if other.largest_motion < (1 - ALIKE_MOTION) * best.largest_motion else None
