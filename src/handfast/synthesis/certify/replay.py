"""Replays a saved synthesis: every proof of existence in the independent checker, then what the file says beside it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from handfast.core.answer import Reach
from handfast.core.files import same_json
from handfast.synthesis import result_file
from handfast.synthesis.answers import Replayed, Synthesis
from handfast.synthesis.result_file import Saved


def verify(what: str | Path | Saved | Synthesis) -> Replayed:
    """Is every configuration proved, and is everything said of it what the proof says?

    Neither the local search nor the prover is needed. NONE is refused: it rests on the search itself.

    Raises:
        InputError: the file cannot be read, is none, or was changed after it was written.
    """
    if isinstance(what, Synthesis):
        return what.verify()
    saved = what if isinstance(what, Saved) else result_file.load(what)
    done = saved.synthesis.verify()
    return done if done.reason else replace(done, reason=_contradiction(saved))


def _contradiction(saved: Saved) -> str:
    """What the file says that does not follow from its proofs; '' if nothing."""
    answer = saved.synthesis
    for i, (solution, said) in enumerate(zip(answer.solutions, saved.said, strict=True)):
        for key, value in solution.to_json().items():
            if not same_json(value, said[key]):
                return f"configuration {i}: {key} are not those of its proof"
    if answer.verdict is Reach.FOUND and not same_json(answer.spread, saved.spread):
        return f"spread is {saved.spread}, of these configurations {answer.spread}"
    return ""
