"""Replays a saved synthesis: every proof of existence in the independent checker, then what the file says beside it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from holdfast.answer import Reach
from holdfast.synthesis import result_file
from holdfast.synthesis.answers import Replayed, Synthesis
from holdfast.synthesis.result_file import Saved

SAME = 1e-9  # absolute [rad, m] or relative: two numbers that say the same


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
            if not _same(value, said[key]):
                return f"configuration {i}: {key} are not those of its proof"
    if answer.verdict is Reach.FOUND and not _same(answer.spread, saved.spread):
        return f"spread is {saved.spread}, of these configurations {answer.spread}"
    return ""


def _same(a: Any, b: Any) -> bool:
    """Equal JSON, numbers within rounding."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_same(a[k], b[k]) for k in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float | int) and isinstance(b, float | int):
        return abs(a - b) <= SAME * max(1.0, abs(a))
    return bool(a == b)
