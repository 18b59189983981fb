"""What is said of a largest magnitude."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from handfast.pictures.sentences import max_sentence
from handfast.stability.studies.questions import maximum
from tests.support.problems import nest, pinch


def told(grasp, *direction: float) -> str:
    d = np.array([*direction, 0, 0, 0], dtype=float)
    return max_sentence(maximum(grasp, d), d)


def test_of_any_size_is_said_as_far_as_was_looked() -> None:
    """Beside a preload up to 10^4 times its force of 1 N; without anything else what holds at one size does at all."""
    assert told(pinch(), 2, 0, 0).endswith("of any size is resisted, as far as was looked: up to 1e+04 N.")
    assert told(nest(), 0, 0, -1).endswith("of any size is resisted.")


def test_a_cap_is_that_of_each_time_of_the_direction() -> None:
    d = np.array([0, 0, 1.0, 0, 0, 0])
    slips = maximum(nest(), d)
    assert slips.proof is not None
    capped = replace(slips, proof=replace(slips.proof, cap=5.0))
    assert max_sentence(slips, d).endswith("is resisted, however small.")
    each = "is resisted, however small, with virtual motions up to 5 N for each time of the direction."
    assert max_sentence(capped, d).endswith(each)
