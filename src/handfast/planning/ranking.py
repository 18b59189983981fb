"""Which grasps are better; which are alike, and which differ most."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from handfast.core.arrays import Array
from handfast.planning.evaluation.attempt import PlannedGrasp

RANKING_SENSES = {"command": -1, "friction_margin": 1, "clearance": 1, "from_limits": 1, "manipulability": 1}


def rank(terms: Sequence[Mapping[str, float]]) -> list[float]:
    """A score for each of some grasps by its terms: the mean rank share over them, 1 best, equal ones alike.

    Every term counts the same, in ranks rather than amounts, so that no unit has to be weighed against
    another: the largest command (smaller is better), the friction margin, the clearance, the distance to the
    joint limits and the manipulability (larger is better).
    """
    if len(terms) < 2:
        return [1.0] * len(terms)
    shares = []
    for name, sense in RANKING_SENSES.items():
        x = sense * np.array([t[name] for t in terms])
        worse = (x[None] < x[:, None]).sum(axis=1)
        better = (x[None] > x[:, None]).sum(axis=1)
        shares.append((worse + (len(x) - 1 - worse - better) / 2) / (len(x) - 1))
    return np.mean(shares, axis=0).tolist()


def best_first(grasps: Sequence[PlannedGrasp]) -> list[PlannedGrasp]:
    """Planned grasps by their quality: robust ones before fragile ones, then by the larger margin, to 1 %, then by the
    smaller largest command. Those whose quality was not measured come last."""

    def place(g: PlannedGrasp) -> tuple[bool, bool, float, float]:
        if g.quality is None:
            return True, True, 0.0, g.answer.upper
        return False, g.quality.fragile, -round(g.quality.margin, 2), g.answer.upper

    return sorted(grasps, key=place)


# --- alike or different ------------------------------------------------------------------------------

SHIFT = 0.010  # [m] of the palm
PALM_TURN = np.radians(15)  # [rad] of the palm
BEND = 0.15  # [rad] of a joint; of a prismatic one 0.015 m
SLIDE_LENGTH = 0.1  # [m] of a prismatic joint counts like 1 rad
CONTACT_SHIFT = 0.010  # [m] between a contact and the nearest of the other grasp


def difference(a: PlannedGrasp, b: PlannedGrasp, prismatic: Array | None = None) -> float:
    """How far two grasps of a hand on an object differ; alike below 1.

    The largest of four: the palm's shift over 10 mm, its turn over 15 degrees, the largest joint difference over
    0.15 rad (0.015 m of a prismatic joint), and the largest distance from a contact to the nearest contact of the
    other grasp over 10 mm (Hausdorff). So two grasps are alike if palm, joints and contacts are all near.

    Args:
        prismatic: (l,) which joints are.
    """
    one, other = np.linalg.inv(a.pose), np.linalg.inv(b.pose)  # the palm in the object's frame
    shift = float(np.linalg.norm(one[:3, 3] - other[:3, 3]))
    cosine = (np.trace(one[:3, :3].T @ other[:3, :3]) - 1) / 2
    bend = np.abs(a.q - b.q) / (1.0 if prismatic is None else np.where(prismatic, SLIDE_LENGTH, 1.0))
    p, s = (g.grasp.positions for g in (a, b))
    apart = np.linalg.norm(p[:, None] - s[None], axis=2)
    points = float(max(apart.min(axis=0).max(), apart.min(axis=1).max()))
    turn = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return max(shift / SHIFT, turn / PALM_TURN, float(bend.max(initial=0.0)) / BEND, points / CONTACT_SHIFT)


def most_different(grasps: Sequence[PlannedGrasp], count: int, prismatic: Array | None = None) -> list[PlannedGrasp]:
    """`count` grasps far from each other: the first, then always the one farthest from those chosen. In that order."""
    left = list(grasps)
    chosen = left[:1]
    nearest = np.array([difference(g, chosen[0], prismatic) for g in left]) if left else np.zeros(0)
    while len(chosen) < min(count, len(left)):
        chosen.append(left[int(nearest.argmax())])
        nearest = np.minimum(nearest, [difference(g, chosen[-1], prismatic) for g in left])
    return chosen
