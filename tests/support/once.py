"""What forged files share with the one they were made from is proved, or asked again, once.

Most of a forged file is as it was. What is worked out here follows from nothing but what it is given: from the same
numbers, the same.
"""

from __future__ import annotations

import dataclasses
import hashlib
import pickle
from collections.abc import Callable, Iterator
from functools import wraps
from typing import Any

import numpy as np

from handfast.proofs import answers, checker, existence, grasps, path_steps, ranges
from handfast.stability.answers import answer
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


def _parts(given: Any) -> Iterator[Any]:
    """What something is made of, without what is worked out of it and kept beside."""
    if dataclasses.is_dataclass(given):
        for field in dataclasses.fields(given):
            yield from _parts(getattr(given, field.name))
    elif isinstance(given, np.ndarray):
        yield given.shape, given.dtype.str, given.tobytes()
    else:
        yield given


PROVED = once(existence.prove, lambda *given, **named: [*map(list, map(_parts, given)), named])
STATES = [(place, "prove", PROVED) for place in (answer, answers, existence, grasps, path_steps)]
PROOFS = (  # of witnesses, certificates, arcs, and what motors can do
    *STATES,
    (grasps, "contact_force_limits", once(grasps.contact_force_limits)),
    (checker, "verify", once(checker.verify)),
    (ranges, "replayed", once(ranges.replayed)),
)
ASKED_AGAIN = ((Claim, "settled_by", once(Claim.settled_by, _question)),)
