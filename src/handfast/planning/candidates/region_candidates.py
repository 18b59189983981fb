"""Which places go together: sets of hand regions for a kind of grasp, and sets of places where their forces balance."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Literal, get_args

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.core.errors import InputError
from handfast.model.body import Body
from handfast.model.hand_regions import HandRegion, HandRegions
from handfast.planning.candidates.hand_shapes import HandShapes, Match
from handfast.planning.candidates.surface import ERROR, Place, find_places
from handfast.planning.filters.balance import squeeze_imbalance, squeeze_margin
from handfast.planning.filters.non_contacting import placed, postures
from handfast.planning.filters.quick_look import QuickLook
from handfast.planning.search import RejectionReason, Tally

Kind = Literal["pinch", "tripod", "power"]
GRASP_KINDS: tuple[Kind, ...] = get_args(Kind)

DRAWN_SHAPES = 3000  # hand shapes that are drawn
PLACES = 60  # spread over the object
PATCH_SHARES = 1.2, 0.15  # half a patch's side, as a share of a fingertip's size and of the object's, whichever is less
MAX_MISFITS = {"pinch": 2.0, "tripod": 2.0, "power": 4.0}  # misfit beyond which a set of places is out of reach
CHECKED_MATCHES = 8  # matches of a set of places at which it is seen what the hand cuts into
SHALLOW_CUT = 3e-3  # [m] a cut up to this may vanish when the contacts are brought about
CUT_WEIGHT, UNFIT = 30.0, 0.1  # [1/m, -] how much less promising cuts and misfits make a candidate
OPENING_SLACK = 0.01  # [m] added to the widest opening that was seen
FINGERS_AROUND = 2  # in a power grasp, beside the palm


@dataclass(frozen=True, eq=False)
class RegionCandidate:
    """Regions of the hand and the places that they are to touch, in the same order.

    Attributes:
        regions, places: k of each.
        margin: of the balance of forces, see `handfast.planning.filters.balance.squeeze_margin`.
        off_centre: [m] from the centre of mass to the middle of the places.
        score: the margin, less the share of the object's half size by which it is off centre.
        misfit: of the hand shape that comes nearest, see `handfast.planning.candidates.hand_shapes.Match`.
        pose: (4, 4) of the object in the hand's base frame there.
        cut: [m] how deep links that are not to touch are in the object, or links in each other, there.
    """

    regions: tuple[HandRegion, ...]
    places: tuple[Place, ...]
    margin: float
    off_centre: float
    score: float
    misfit: float
    pose: Array
    cut: float


def find_candidates(
    look: QuickLook,
    regions: HandRegions,
    body: Body,
    kind: Kind,
    friction: float,
    *,
    seed: int = 0,
    short: int = 80,
    spread: int = PLACES,
) -> tuple[list[RegionCandidate], Tally]:
    """Candidates with balanced forces that look reachable, most promising first; and what was rejected on the way.

    Args:
        look: at the hand and the object.
        friction: coefficient.
        seed: of everything that is drawn.
        short: sets of places that are looked at closely.
        spread: points of the surface about which places are sought, beside those opposite to them.

    Raises:
        InputError: an unknown kind, a friction that is not positive, regions that do not make a grasp of the kind.
    """
    if kind not in GRASP_KINDS:
        raise InputError(f"is '{kind}'; known: {', '.join(GRASP_KINDS)}", field="kind")
    if not friction > 0:
        raise InputError(f"is {friction:g}; forces on places need a positive coefficient", field="friction")
    hand = look.scene.hand
    regions.refuse_strangers(hand)
    sets = region_sets(regions, kind)
    own = tuple(dict.fromkeys(r for chosen in sets for r in chosen))
    shapes = HandShapes.of(hand, own, DRAWN_SHAPES, seed)
    wholes = [tuple(own.index(r) for r in chosen) for chosen in sets]
    size = float(np.ptp(body.vertices, axis=0).max())
    radius = min(PATCH_SHARES[0] * float(np.median([r.region.extent for r in own])), PATCH_SHARES[1] * size)
    places, unfit = find_places(body, radius, count=spread, seed=seed)
    opening = max(shapes.opening(chosen) for chosen in wholes) + OPENING_SLACK
    tally = Tally()
    tally.add(RejectionReason.NO_PATCH, unfit, f"no patch within {1e3 * ERROR:g} mm of the surface")
    reach = Reachable(opening, radius, short, seed)
    chosen_places = balanced_sets(body, places, len(sets[0]), friction, reach, tally)
    found: list[RegionCandidate] = []
    far: list[float] = []
    for row, steady in chosen_places:
        where = tuple(places[i] for i in row)
        points, normals = np.array([p.point for p in where]), np.array([p.normal for p in where])
        matches = [m for c in wholes for m in shapes.matches(c, points, normals, radius)]
        best = min(matches, key=lambda m: m.misfit, default=None)
        if best is None or best.misfit > MAX_MISFITS[kind]:
            far.append(best.misfit if best else np.inf)
            continue
        near = sorted((m for m in matches if m.misfit <= MAX_MISFITS[kind]), key=lambda m: m.misfit)[:CHECKED_MATCHES]
        cuts = [_cut(look, [own[r].link for r in match.order], match) for match in near]
        clearest = int(np.argmin([max(cut, SHALLOW_CUT) + 1e-3 * m.misfit for cut, m in zip(cuts, near, strict=True)]))
        best, cut = near[clearest], cuts[clearest]
        off = float(np.linalg.norm(points.mean(axis=0) - body.center_of_mass))
        score = steady - off / (size / 2)
        chosen = tuple(own[i] for i in best.order)
        found.append(RegionCandidate(chosen, where, steady, off, score, best.misfit, best.pose, cut))
    if far:
        example = (
            f"the best of {DRAWN_SHAPES} hand shapes misfits by {min(far):.1f}; up to {MAX_MISFITS[kind]:g} is tried"
        )
        tally.add(RejectionReason.OUT_OF_REACH, len(far), example)
    return sorted(
        found, key=lambda c: c.score - CUT_WEIGHT * max(c.cut, SHALLOW_CUT) - UNFIT * c.misfit, reverse=True
    ), tally


def _cut(look: QuickLook, links: list[str], match: Match) -> float:
    """[m] how deep the hand is in the object or itself at a match, but for links that are to touch: they move yet."""
    hand = look.scene.hand
    away = (placed(hand, match.q, values) for values in postures(hand, links))
    return max(0.0, -max(look.clearance(q, match.pose, but=links) for q in away))


def region_sets(regions: HandRegions, kind: Kind) -> list[tuple[HandRegion, ...]]:
    """The sets of hand regions that make a grasp of a kind, all of one length.

    A pinch has the tips of two fingers, a tripod those of three. A power grasp has the palm, if there is one,
    and of two fingers (three without a palm) either the tips or the outermost pads; other fingers may close later.

    Raises:
        InputError: too few of them.
    """
    tips = regions.of("tip")
    needed = {"pinch": 2, "tripod": 3, "power": 2}[kind]
    if len({r.finger for r in tips}) < needed:
        names = ", ".join(r.name for r in tips) or "none"
        raise InputError(f"a {kind} needs the tips of {needed} fingers; there are: {names}", field="regions")
    if kind != "power":
        return [c for c in combinations(tips, needed) if len({r.finger for r in c}) == needed]
    palm = regions.of("palm")[:1]
    pads = tuple({r.finger: r for r in reversed(regions.of("pad"))}.values())
    sets = []
    for group in (tips, pads):
        count = min(FINGERS_AROUND + (not palm), len({r.finger for r in tips}))
        sets += [palm + c for c in combinations(group, count) if len({r.finger for r in c}) == count]
    if len(sets[0]) < 3:
        raise InputError("a power grasp needs three regions or more: a palm, pads or more tips", field="regions")
    return sets


# --- sets of places ----------------------------------------------------------------------------------

MAX_PLACE_SETS = 150_000  # sets of four and more places that are looked at


@dataclass(frozen=True)
class Reachable:
    """Which sets are looked for.

    Attributes:
        opening: [m] no two places of a set are further apart.
        radius: [m] sets are alike whose places are all within this of each other's.
        count: largest number of sets.
        seed: of what is drawn.
    """

    opening: float
    radius: float
    count: int
    seed: int


def balanced_sets(
    body: Body, places: tuple[Place, ...], k: int, friction: float, reach: Reachable, tally: Tally
) -> list[tuple[Indices, float]]:
    """Different sets of k places at which forces balance and that the hand opens wide enough for, with margins.

    Args:
        tally: counts what is rejected.
    """
    if len(places) < k:
        tally.add(RejectionReason.TOO_FEW_PLACES, 1, f"{len(places)} places on the surface; {k} are needed")
        return []
    points, inward = np.array([p.point for p in places]), -np.array([p.normal for p in places])
    rows = _sets(points, inward, k, reach.seed)
    rest = squeeze_imbalance(points[rows], inward[rows])
    steady = rest < friction
    if (~steady).any():
        least = rest[~steady].min()
        about = f"the best one is out of balance by {least:.2f} of the pushing force" if np.isfinite(least) else ""
        tally.add(RejectionReason.NO_SQUEEZE, int((~steady).sum()), about)
    rows, rest = rows[steady], rest[steady]
    pairs = np.triu_indices(k, 1)
    width = np.linalg.norm(points[rows[:, pairs[0]]] - points[rows[:, pairs[1]]], axis=2).max(axis=1, initial=0.0)
    wide = width > reach.opening
    if wide.any():
        figures = f"{1e3 * width[wide].min():.0f} mm and more; the hand opens to about {1e3 * reach.opening:.0f} mm"
        tally.add(RejectionReason.TOO_WIDE, int(wide.sum()), figures)
    rows, rest = rows[~wide], rest[~wide]
    size = float(np.ptp(body.vertices, axis=0).max())
    off = np.linalg.norm(points[rows].mean(axis=1) - body.center_of_mass, axis=1)
    small = np.array([p.size[1] for p in places])[rows].min(axis=1, initial=np.inf) / reach.radius
    order = np.argsort(rest / friction + off / (size / 2) - 0.3 * small, kind="stable")
    kept: list[tuple[Indices, float]] = []
    alike = unsteady = 0
    for row in rows[order]:
        if any(_alike(points[row], points[other], reach.radius) for other, _ in kept):
            alike += 1
            continue
        m = squeeze_margin(points[row], inward[row], friction)
        if m <= 0:
            unsteady += 1
            continue
        kept.append((row, m))
        if len(kept) == reach.count:
            break
    tally.add(RejectionReason.OUTSIDE_CONES, unsteady)
    tally.add(RejectionReason.ALIKE, alike, f"all places within {1e3 * reach.radius:.0f} mm of a better one's")
    left = len(rows) - len(kept) - alike - unsteady
    tally.add(RejectionReason.BEHIND, left, f"{reach.count} are looked at closely")
    return kept


def _sets(points: Array, inward: Array, k: int, seed: int) -> Indices:
    """(m, k) sets of places, ascending: all pairs or triples, or a sample of larger ones grown from good triples."""
    n = len(points)
    if k <= 3:
        return np.array(list(combinations(range(n), k)), dtype=int).reshape(-1, k)
    triples = np.array(list(combinations(range(n), 3)), dtype=int)
    rest = squeeze_imbalance(points[triples], inward[triples])
    triples = triples[np.argsort(rest, kind="stable")[: MAX_PLACE_SETS // 50]]
    random = np.random.default_rng([seed, k])
    grown = np.repeat(triples, 50, axis=0)
    for _ in range(k - 3):
        grown = np.column_stack([grown, random.integers(n, size=len(grown))])
    grown = np.sort(grown, axis=1)
    return np.unique(grown[(np.diff(grown, axis=1) > 0).all(axis=1)], axis=0)


def _alike(a: Array, b: Array, radius: float) -> bool:
    """Whether every place of one set is within a radius of one of the other."""
    apart = np.linalg.norm(a[:, None] - b[None], axis=2)
    return bool(max(apart.min(axis=0).max(), apart.min(axis=1).max()) < radius)
