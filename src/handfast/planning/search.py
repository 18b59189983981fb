"""Searches of numbered units of work: what becomes of candidates, what is kept, who is told, when it is hopeless.

Candidates pass, or are rejected for a reason; a tally counts them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, Generic, TypeVar

from handfast.core.answer import Verdict
from handfast.model.hand.hand import Hand

Found = TypeVar("Found")
State = TypeVar("State")
Pair = tuple[str, str]  # names of two links, or of a link and the object
Overlap = tuple[Pair, float]  # and the depth [m]
OverlapEntry = tuple[str, str, int, float]


# --- what becomes of candidates ---


class RejectionReason(StrEnum):
    """Why a candidate is rejected: names stand in files, values in tables."""

    # of a closing hand
    PAST = "passed the object by"
    INSIDE = "started with the hand in the object"
    FOLDED = "started with the hand in itself"
    BLOCKED = "collides with support or obstacles, there or on a straight way in or out"
    MISSES = "would miss, as a few steps of closing show (heuristic)"
    FEW = "touches with fewer than two fingers or a finger and the palm"
    MANY = "touches at more points than allowed"
    PENETRATES = "penetrates by more than 1 mm"
    STRONG = "needs larger commands than allowed"
    SIMULATED = "lets go in the dynamics engine"
    # of a certified configuration
    OBJECT = "penetrates the object"
    ITSELF = "the hand meets itself"
    CURVED = "curves into the object at a contact"
    # of either
    UNBALANCED = "no contact forces balance a load (shown)"
    SLIPS = "no preload resists a load (shown)"
    UNDECIDED = "no preload was found"
    ALIKE = "alike"
    # of regions to touch
    NO_PATCH = "no fit"
    TOO_FEW_PLACES = "too few places"
    NO_SQUEEZE = "forces do not balance"
    TOO_WIDE = "wider than the hand opens"
    OUTSIDE_CONES = "forces leave the friction cones"
    BEHIND = "behind the best"
    OUT_OF_REACH = "out of reach of the hand shapes drawn"
    NOT_TRIED = "not tried"
    CERTIFIED_BEHIND = "certified, but behind the best"
    UNREACHABLE = "not reachable: NONE"
    UNREACHED = "not reachable: UNDECIDED"


def of_verdict(verdict: Verdict) -> RejectionReason | None:
    """Why a grasp is rejected whose loads were answered so; None if it holds them."""
    return {Verdict.SLIPS: RejectionReason.SLIPS, Verdict.UNDECIDED: RejectionReason.UNDECIDED}.get(verdict)


@dataclass
class Rejected:
    """How many candidates were rejected for a reason, and one of them with figures; '' if there is nothing to say.

    Attributes:
        overlaps: what was in what, by name, how often, and the deepest [m].
    """

    count: int
    example: str = ""
    overlaps: dict[Pair, tuple[int, float]] = field(default_factory=dict)

    def overlapped(self, pair: Pair, count: int, depth: float) -> None:
        """One more overlap."""
        before, deepest = self.overlaps.get(pair, (0, 0.0))
        self.overlaps[pair] = before + count, max(deepest, depth)


@dataclass
class Tally:
    """How many candidates passed, and how many were rejected for which reason, in the order in which these came up."""

    passed: int = 0
    rejected: dict[RejectionReason, Rejected] = field(default_factory=dict)

    def add(
        self, reason: RejectionReason | None, count: int = 1, example: str = "", overlap: Overlap | None = None
    ) -> None:
        """Count candidates; without a reason they passed. The first example of a reason stays, of overlaps all."""
        if reason is None:
            self.passed += count
        elif count:
            some = self.rejected.setdefault(reason, Rejected(0, example))
            some.count += count
            if overlap:
                some.overlapped(overlap[0], count, overlap[1])

    def add_all(self, other: Tally) -> None:
        """Count all that another one counted."""
        self.passed += other.passed
        for reason, some in other.rejected.items():
            self.add(reason, some.count, some.example)
            for pair, (count, depth) in some.overlaps.items():
                self.rejected[reason].overlapped(pair, count, depth)

    def recount(self, reason: RejectionReason) -> None:
        """One of those that passed is rejected after all."""
        self.passed -= 1
        self.add(reason)

    def copy(self) -> Tally:
        """One that goes on by itself."""
        return Tally(self.passed, {r: replace(some, overlaps=dict(some.overlaps)) for r, some in self.rejected.items()})

    def __getitem__(self, reason: RejectionReason) -> int:
        """How many were rejected for a reason."""
        return self.rejected[reason].count if reason in self.rejected else 0

    @property
    def total(self) -> int:
        """All candidates."""
        return self.passed + sum(some.count for some in self.rejected.values())

    def to_json(self, passed: str, reasons: Sequence[RejectionReason]) -> dict[str, int]:
        """Counts by lower-case names, first of those that passed, then of every reason there may be."""
        return {passed: self.passed} | {reason.name.lower(): self[reason] for reason in reasons}

    @classmethod
    def from_json(cls, data: dict[str, int], passed: str, reasons: Sequence[RejectionReason]) -> Tally:
        """What `to_json` wrote; names that are missing count nothing."""
        tally = cls(data.get(passed, 0))
        for reason in reasons:
            tally.add(reason, data.get(reason.name.lower(), 0))
        return tally

    def overlaps_json(self) -> dict[str, list[OverlapEntry]]:
        """What was in what, by lower-case reason: the two names, how often, and the deepest [m]."""
        return {
            reason.name.lower(): [(*pair, count, depth) for pair, (count, depth) in some.overlaps.items()]
            for reason, some in self.rejected.items()
            if some.overlaps
        }

    def take_overlaps(self, data: dict[str, list[OverlapEntry]]) -> None:
        """What `overlaps_json` wrote, of reasons that are counted already."""
        for reason, some in self.rejected.items():
            for a, b, count, depth in data.get(reason.name.lower(), []):
                some.overlapped((a, b), count, depth)

    def examples(self) -> list[dict[str, Any]]:
        """Reasons in words, counts and examples."""
        return [{"reason": str(r), "count": some.count, "example": some.example} for r, some in self.rejected.items()]


# --- when to give up ---------------------------------------------------------------------------------

GIVE_UP = 1000  # starts of which none came through the filters
ALL_ALIKE = 0.3  # of these are enough where one reason rejected all of them
COMMON = 0.3  # of the starts: a reason that rejects so many is worth advice
USUAL_OVERLAPS = 0.5  # of the overlaps: a pair that makes so many may overlap in the model alone

FILTERED = (
    RejectionReason.PAST,
    RejectionReason.INSIDE,
    RejectionReason.FOLDED,
    RejectionReason.MISSES,
    RejectionReason.FEW,
    RejectionReason.MANY,
    RejectionReason.PENETRATES,
    RejectionReason.UNBALANCED,
    RejectionReason.BLOCKED,
)

AIM = "see whether --approach (the palm's face) and --closing (the joints' senses) were guessed right"
ADVICE: Mapping[RejectionReason, str] = {
    RejectionReason.PAST: f"The hand goes past the object: {AIM}.",
    RejectionReason.INSIDE: "Pushed up to the object, the hand is in it: it may be too large, or hollow.",
    RejectionReason.FOLDED: "The hand starts in itself, with many pairs of its links: see whether their shapes, each a "
    "convex hull, are much wider than they.",
    RejectionReason.PENETRATES: "Once closed, the hand is in the object or in itself: see whether its shapes, each a "
    "convex hull, are much wider than its links.",
    RejectionReason.BLOCKED: "The hand does not get to the object in a straight line: a shorter one (--travel) may do, "
    "or fewer obstacles; a flat object on a support leaves little room below.",
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
        if pairs and overlaps[a, b][0] > USUAL_OVERLAPS * tally[reason]:
            number, depth = overlaps[a, b]
            out.append(
                f"{a} and {b} overlap in {number} of {tally.total} starts, by up to {1e3 * depth:.1f} mm: "
                f"if the real links do not, --ignore-pair {a} {b} leaves them out."
            )
        elif reason in ADVICE:
            out.append(ADVICE[reason])
    return out


# --- the search ---


@dataclass(frozen=True, eq=False)
class UnitResult(Generic[Found]):
    """What a unit of work came to. Units are numbered; what one comes to depends on its number and the seed alone.

    Attributes:
        tally: what became of its candidates.
        found: those that passed.
    """

    tally: Tally
    found: tuple[Found, ...]


class Gathering(Generic[Found]):
    """What units found, as long as it differs from what was found before.

    Args:
        most: how many are kept.
        alike: whether two of them are.
        tally, kept: of a search that is gone on with.
        value: what is better takes the place of the worst of those like it, or of all; None keeps the first.
    """

    def __init__(
        self,
        most: int,
        alike: Callable[[Found, Found], bool],
        tally: Tally | None = None,
        kept: Iterable[Found] = (),
        value: Callable[[Found], float] | None = None,
    ) -> None:
        self.most, self.alike, self.value = most, alike, value
        self.tally, self.kept = tally.copy() if tally else Tally(), list(kept)
        self.beyond = False  # were some that differ not kept, as there were enough?

    @property
    def enough(self) -> bool:
        return len(self.kept) >= self.most

    def take(self, unit: UnitResult[Found]) -> bool:
        """Count a unit's candidates and keep what differs; was anything kept?"""
        new = False
        self.tally.add_all(unit.tally)
        for one in unit.found:
            rivals = [other for other in self.kept if self.alike(one, other)]
            if rivals:
                self.tally.recount(RejectionReason.ALIKE)
            elif self.enough:
                self.beyond, rivals = True, self.kept
            if not rivals or self._better(one, rivals):
                self.kept.append(one)
                new = True
        return new

    def _better(self, one: Found, rivals: list[Found]) -> bool:
        """Take the worst of the rivals out if this is better."""
        if self.value is None:
            return False
        worst = min(rivals, key=self.value)
        if self.value(one) <= self.value(worst):
            return False
        self.kept = [other for other in self.kept if other is not worst]
        return True


class Journal(Generic[State]):
    """Hears how far a search has come. This one keeps nothing; `handfast.planning.results.folder` has one that does.

    Args:
        on_progress: called after each unit of work with the answer so far.

    Attributes:
        source: the file that says how far an earlier search has come.
    """

    source = ""

    def __init__(self, on_progress: Callable[[State], None] | None = None) -> None:
        self.on_progress = on_progress

    def earlier(self, question: Any) -> Any:
        """What to go on from; None to begin.

        Raises:
            InputError: what was kept is broken, or of another question.
        """
        return None

    def note(self, state: State, *, new: bool) -> None:
        """The search goes on; `new`: something was found."""
        if self.on_progress:
            self.on_progress(state)

    def close(self, state: State) -> None:
        """The search has ended."""
