"""What forged files share with the one they were made from is proved, or asked again, once.

Most of a forged file is as it was. What is worked out here follows from nothing but what it is given: from the same
numbers, the same.
"""

from __future__ import annotations

import dataclasses
import hashlib
import pickle
import time
from collections.abc import Callable, Iterator
from functools import wraps
from typing import Any

import numpy as np

from handfast.proofs import answers, checker, existence, grasps, path_steps, ranges
from handfast.proofs.certificate import Certificate
from handfast.stability.answers import answer
from handfast.stability.answers.answer import Answer
from handfast.stability.studies.ask_again import Claim, Clock


def once(
    work: Callable[..., Any], what: Callable[..., Any] | None = None, done: Callable[[Any], bool] = lambda _: True
) -> Callable[..., Any]:
    """The same function, which keeps what it returned, if that is `done`.

    what: it depends on, all that it is given by default.
    """
    kept: dict[bytes, Any] = {}

    @wraps(work)
    def remembered(*given: Any, **named: Any) -> Any:
        key = hashlib.sha256(pickle.dumps(what(*given, **named) if what else (given, named))).digest()
        if key in kept:
            return kept[key]
        found = work(*given, **named)
        if done(found):
            kept[key] = found
        return found

    return remembered


def _question(claim: Claim, query: Callable[..., Answer], load: np.ndarray, clock: Clock, **more: Any) -> Any:
    """What a claim asks again: all but its place, what is said there, and how much time is left."""
    return claim.grasp, claim.terms, claim.gap, query, load, clock.question_timeout, more


def _checked(certificate: Certificate, until: float = np.inf, **how: Any) -> Any:
    """What the checker says of a certificate depends on, if there is time enough."""
    late = time.monotonic() >= until
    return late, list(parts(certificate)), sorted((name, x) for name, x in how.items() if x is not None)


def parts(given: Any) -> Iterator[Any]:
    """What something is made of, without what is worked out of it and kept beside."""
    if dataclasses.is_dataclass(given):
        for field in dataclasses.fields(given):
            yield from parts(getattr(given, field.name))
    elif isinstance(given, np.ndarray):
        yield given.shape, given.dtype.str, given.tobytes()
    else:
        yield given


PROVED = once(existence.prove, lambda *given, **named: [*map(list, map(parts, given)), named])
STATES = [(place, "prove", PROVED) for place in (answer, answers, existence, grasps, path_steps)]
VERIFIED = once(checker.verify, _checked, lambda found: found.reason != checker.NO_TIME)
STATES_AND_CERTIFICATES = (*STATES, (checker, "verify", VERIFIED))
PROOFS = (
    *STATES_AND_CERTIFICATES,
    (grasps, "contact_force_limits", once(grasps.contact_force_limits)),
    (ranges, "replayed", once(ranges.replayed)),
)
ASKED_AGAIN = ((Claim, "settled_by", once(Claim.settled_by, _question)),)
