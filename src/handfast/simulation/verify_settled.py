"""What a settled file says of its two grasps, asked again. Its path is a computation in steps, and proves nothing."""

from __future__ import annotations

from typing import Any

import numpy as np

from handfast.core.answer import Verdict
from handfast.proofs.answers import VERDICTS
from handfast.proofs.fields import BadFile, Fields, numbers
from handfast.proofs.files import SETTLED
from handfast.proofs.replay import Replay
from handfast.simulation.settled import Rest
from handfast.stability.ask_again import Asking, BoundsClaim, Claim, VerdictClaim, asked, together
from handfast.stability.many import Options
from handfast.stability.settings import INF
from handfast.stability.verify_maps import grasp_of

OF_PATH = "path, moved, turned, onset: a computation in steps; nor that the last grasp is where they end"
SIMULATED = "simulated, notes, seconds: recorded, and nothing rests on it"
COURSE = "onset", "onset_of", "moved", "turned", "simulated", "notes", "seconds", "joints", "path", "grasp"


def replay_settled(data: Any, how: Asking) -> Replay:
    """What `check` and `maximum` said of the grasps, asked again. Raises `BadFile` and `InputError`."""
    f = Fields(data)
    f.text("schema", among=[SETTLED])
    rest = Rest(f.text("rest", among=[str(r) for r in Rest]))
    first, wrench = grasp_of(f, "first"), f.numbers("wrench", (6,))
    before, confirmed = f.text("before", among=VERDICTS), f.flag("confirmed")
    has_last = f.has("last")
    for name in ("after", "last_wrench"):
        if f.has(name) != has_last:
            raise BadFile("is there with `last`, and only then", name)
    last = grasp_of(f, "last") if has_last else None
    after = f.text("after", among=VERDICTS) if has_last else None
    last_wrench = f.numbers("last_wrench", (6,)) if has_last else np.zeros(6)
    most = f.take("most", None)
    for name in (*COURSE, "last", "after", "last_wrench"):
        f.take(name, None)
    f.done()

    options = Options()
    claims: dict[str, list[Claim]] = {"first": [], "last": []}
    if before != Verdict.UNDECIDED:
        claims["first"].append(VerdictClaim("before", first, wrench, options, before))
    if last is not None and after is not None:
        if after != Verdict.UNDECIDED:
            claims["last"].append(VerdictClaim("after", last, last_wrench, options, after))
        if most is not None:
            claims["last"].append(_most(most, BoundsClaim("most[0]", last, last_wrench, options, 0.0, INF)))
    faults = _contradictions(rest, before, after, confirmed)
    if most is not None and last is None:
        raise BadFile("is there with `last`, and only then", "most")
    done = asked([c for of in claims.values() for c in of], how)
    parts, begin = [], 0
    for name, of in claims.items():
        told = [part for parts_of in done[begin : begin + len(of)] for part in parts_of]
        begin += len(of)
        if of:
            parts.append(together(name, f"what is said of the {name} grasp under its load", told))
    return Replay("settle", parts=(*faults, *parts), not_replayed=(OF_PATH, SIMULATED))


def _most(most: Any, claim: BoundsClaim) -> BoundsClaim:
    """How much of the load the last grasp resists: two numbers, the second null for none."""
    if not isinstance(most, list) or len(most) != 2:
        raise BadFile("is no pair of bounds", "most")
    lower = float(numbers([most[0]], (1,), "most[0]")[0])
    upper = INF if most[1] is None else float(numbers([most[1]], (1,), "most[1]")[0])
    return BoundsClaim(claim.place, claim.grasp, claim.load, claim.options, lower, upper, False, "most[1]")


def _contradictions(rest: Rest, before: str, after: str | None, confirmed: bool) -> list[Replay]:
    """What of the answer contradicts itself."""
    out = []
    claim = "it is what the verdicts say"
    due = {Rest.HOLDS: before == Verdict.HOLDS, Rest.SETTLES: after == Verdict.HOLDS}
    due |= {Rest.RESTS: after != Verdict.HOLDS, Rest.LEAVES: after is None, Rest.UNDECIDED: after is None}
    if not due[rest]:
        out.append(Replay("rest", claim, f"is '{rest}'; before is '{before}', after is '{after}'"))
    if confirmed != (after == Verdict.HOLDS):
        out.append(Replay("confirmed", claim, f"is {str(confirmed).lower()}; after is '{after}'"))
    return out
