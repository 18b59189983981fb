"""What forged files share with the one they were made from is proved, or asked again, once.

Most of a forged file is as it was. What is worked out here follows from nothing but what it is given: from the same
numbers, the same.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

from handfast.proofs import answers, checker, grasps, ranges
from handfast.stability.answers.answer import Answer
from handfast.stability.studies.ask_again import Claim, Clock


def once(work: Callable[..., Any], what: Callable[..., Any] | None = None) -> Callable[..., Any]:
    """The same function, which keeps what it returned; `what` it depends on, all that it is given by default."""
    kept: dict[bytes, Any] = {}

    @wraps(work)
    def remembered(*given: Any, **named: Any) -> Any:
        key = hashlib.sha256(pickle.dumps(what(*given, **named) if what else (given, named))).digest()
        if key not in kept:
            kept[key] = work(*given, **named)
        return kept[key]

    return remembered


def _question(claim: Claim, query: Callable[..., Answer], load: np.ndarray, clock: Clock, **more: Any) -> Any:
    """What a claim asks again: all but its place, what is said there, and how much time is left."""
    return claim.grasp, claim.terms, claim.gap, query, load, clock.question_timeout, more


PROVED = once(answers.prove)
PROOFS = (  # of witnesses, certificates, arcs, and what motors can do
    (answers, "prove", PROVED),
    (grasps, "prove", PROVED),
    (grasps, "contact_force_limits", once(grasps.contact_force_limits)),
    (checker, "verify", once(checker.verify)),
    (ranges, "replayed", once(ranges.replayed)),
)
ASKED_AGAIN = ((Claim, "settled_by", once(Claim.settled_by, _question)),)
