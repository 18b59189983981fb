"""When a search has become hopeless, and what is the matter."""

from __future__ import annotations

from collections.abc import Mapping

from handfast.model.hand.hand import Hand
from handfast.planning.rejection import RejectionReason, Tally

GIVE_UP = 1000  # starts of which none came through the filters
ALL_ALIKE = 0.3  # of these are enough where one reason rejected all of them
COMMON = 0.3  # of the starts: a reason that rejects so many is worth advice
USUAL = 0.5  # of the overlaps: a pair that makes so many may overlap in the model alone

FILTERED = (
    RejectionReason.PAST,
    RejectionReason.INSIDE,
    RejectionReason.FOLDED,
    RejectionReason.MISSES,
    RejectionReason.FEW,
    RejectionReason.PENETRATES,
    RejectionReason.UNBALANCED,
)

AIM = "see whether --approach (the palm's face) and --closing (the joints' senses) were guessed right"
ADVICE: Mapping[RejectionReason, str] = {
    RejectionReason.PAST: f"The hand goes past the object: {AIM}.",
    RejectionReason.INSIDE: "Pushed up to the object, the hand is in it: it may be too large, or hollow.",
    RejectionReason.FOLDED: "The hand starts in itself, with many pairs of its links: see whether their shapes, each a "
    "convex hull, are much wider than they.",
    RejectionReason.PENETRATES: "Once closed, the hand is in the object or in itself: see whether its shapes, each a "
    "convex hull, are much wider than its links.",
    RejectionReason.MISSES: f"The fingers do not reach around the object when they close: it may be too small, or "
    f"too large; {AIM}.",
    RejectionReason.FEW: f"Only one finger reaches the object: it may be too large for the hand; {AIM}.",
    RejectionReason.UNBALANCED: "No contact forces carry the load: more friction, fewer directions (--up z) or a "
    "lighter object may help; two point contacts hold no torque about the line between them.",
}


def fruitless(tally: Tally, give_up: int) -> bool:
    """Whether so many starts, all of them rejected before any question about forces was asked, are enough."""
    counts = [tally[reason] for reason in FILTERED]
    if sum(counts) < tally.total:
        return False
    return tally.total >= give_up or max(counts, default=0) == tally.total >= ALL_ALIKE * give_up > 0


def diagnosis(tally: Tally, hand: Hand) -> list[str]:
    """What rejected most of the starts and what may help, a sentence each; [] if nothing stands out."""
    out = []
    for reason in sorted(FILTERED, key=lambda r: -tally[r]):
        if tally[reason] < COMMON * tally.total or not tally[reason]:
            continue
        overlaps = tally.rejected[reason].overlaps
        pairs = [p for p in overlaps if all(name in hand.link_names for name in p)]
        a, b = max(pairs, key=lambda p: overlaps[p][0], default=("", ""))
        if pairs and overlaps[a, b][0] > USUAL * tally[reason]:
            number, depth = overlaps[a, b]
            out.append(
                f"{a} and {b} overlap in {number} of {tally.total} starts, by up to {1e3 * depth:.1f} mm: "
                f"if the real links do not, --ignore-pair {a} {b} leaves them out."
            )
        elif reason in ADVICE:
            out.append(ADVICE[reason])
    return out
