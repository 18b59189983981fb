"""What a map says about a weight, where bounds and weight are exactly equal."""

from __future__ import annotations

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.pictures import sentences
from handfast.stability.studies.maps import Curve


def curve(*bounds: tuple[float, float], unbounded: tuple[int, ...] = ()) -> Curve:
    lower, upper = np.array(bounds).T
    every = np.isin(np.arange(len(bounds)), unbounded)
    return Curve(lower, upper, every, (Verdict.HOLDS,) * len(bounds), (Stop.COMPLETE,) * len(bounds))


def test_a_weight_that_is_just_resisted_is_enough() -> None:
    """At least the weight is resisted: equal is enough. None is: the bound is below it, equal leaves it open."""
    weight = 2.5
    below, above = np.nextafter(weight, 0), np.nextafter(weight, 9)
    bounds = curve((weight, weight), (weight, 9), (above, 9), (below, weight), (below, 9), (below, below), (0, weight))
    states = ["enough", "enough", "enough", "open", "open", "weak", "open"]
    assert sentences.weight_states(bounds, weight) == states
    assert sentences.weight_sentence(bounds, weight) == (
        "A weight of 2.5 N: 3 of 7 directions resist as much, 1 less, 3 not decided."
    )


def test_what_was_not_reached_is_open_and_what_has_no_bound_is_enough() -> None:
    assert sentences.weight_states(curve((np.nan, np.nan), (0, np.inf), unbounded=(1,)), 1.0) == ["open", "enough"]
