"""What a map says about a weight, where bounds and weight are exactly equal."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from handfast.core.answer import Stop, Verdict
from handfast.pictures import sentences, words
from handfast.pictures.page_parts import table
from handfast.readers.load_hand import load_hand
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


def test_a_map_counts_what_is_resisted_apart_from_how_much_is_known() -> None:
    """Of four directions one has a gap between its bounds, of one nothing is known, one is exact, one has no bound."""
    passive = curve((1.0, 9.0), (0.0, 9.0), (2.0, 2.0), (3.0, np.inf), unbounded=(3,))
    said = sentences.map_sentence(SimpleNamespace(passive=passive, preloaded=None))  # type: ignore[arg-type]
    assert said == (
        "Without preload, some force is resisted in 3 of 4 directions, 1 not decided; "
        "how much more is resisted in 1 of them was not decided."
    )


@pytest.mark.parametrize(
    ("clearance", "text"),
    [(0.00142, "clearance 1.4 mm"), (-0.00042, "overlaps by 0.4 mm"), (-0.00002, "clearance 0.0 mm")],
)
def test_what_is_below_zero_overlaps(clearance: float, text: str) -> None:
    assert words.clearance_text(clearance) == text


def test_a_table_without_heads_has_no_row_for_them_and_sentences_may_wrap() -> None:
    made = table(["", "#"], [["grasps", "three of three that were asked for"], ["more", "(0.1234, 0.2345, 0.3456)"]])
    assert "<thead>" not in made
    assert made.count('class="wordy"') == 1
    assert "<thead>" in table(["a", "#b"], [["1", "2"]])


def test_a_force_off_the_origin_is_told_in_newtons() -> None:
    """A weight at a centre of mass: a force on a line, whose point next to the origin is named."""
    weight = np.array([0, 0, -2.0, *np.cross([0.003, 0.004, 0.05], [0, 0, -2.0])])
    assert words.magnitude(weight) == (2.0, "N")
    assert words.direction_text(weight) == "force along −z at (3, 4, 0) mm"
    assert words.magnitude([0, 0, 1, 0, 0, 0.1]) == (1.0, "× the direction")


def test_commands_beyond_what_motors_can_are_told() -> None:
    hand = load_hand("barrett-bh8-280")
    commands = {"finger_1_prox": 5.0, "finger_2_prox": -5.1, "finger_3_prox": 6.0}
    assert words.beyond_text(hand, commands) == "; more than the hand's file states of finger_2_prox and finger_3_prox"
    assert words.beyond_text(hand, {"finger_1_prox": 5.0}) == ""
