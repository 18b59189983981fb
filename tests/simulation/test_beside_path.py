"""A load's path beside a simulation: the same contact forces load by load, and the same end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast import check, load_grasp, maximum, simulate
from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.simulation.beside_path import beside_path
from handfast.stability.answers.load_path import LoadPath
from handfast.stability.problem.settings import Loading, Settings

FIRST: Loading = "preload-first"
LOAD = np.array([-1.0, 1.0, 0, 0, 0, 0])


@pytest.fixture(scope="module")
def jaw() -> Grasp:
    """A jaw at -1 presses an object against a wall at +1 with 1 N; mu = 0.5: the wall slips at 2/3 of `LOAD`."""
    contacts = [Contact((-1, 0, 0), (1, 0, 0), 0.5), Contact((1, 0, 0), (-1, 0, 0), 0.5)]
    return Grasp(contacts, [GraspJoint("jaw", (1, 0, 0), (-1, 0, 0), (0,), "prismatic")], None, {"jaw": 1.0}, "jaw")


def test_a_jaw_that_keeps_its_squeeze_has_the_forces_of_both_by_hand(jaw: Grasp) -> None:
    """Jaw and wall share a load along x as two springs: 1 + s / 2 and 1 - s / 2, until both rub with all they have."""
    answer = maximum(jaw, LOAD, loading=FIRST, settings=Settings(gap=1e-2))
    found = simulate(jaw, 1.25 * answer.lower * LOAD, closing=1.0, ramp=4.0)
    beside = beside_path(answer, found)
    s = beside.magnitudes
    assert s[0] == 0
    assert s[-1] == beside.reached == answer.lower
    assert beside.largest == pytest.approx(1.25 * answer.lower)
    sticks = s <= 0.6
    by_hand = np.c_[1 + s / 2, 1 - s / 2][sticks]
    assert beside.path[sticks] == pytest.approx(by_hand, abs=1e-6)
    assert beside.simulated[sticks] == pytest.approx(by_hand, abs=0.01)
    assert beside.slips_at == answer.upper


def test_commands_that_grow_slowly_lead_to_the_state_where_a_path_begins() -> None:
    """At once they are a jolt, of which friction at the contacts keeps a part."""
    grasp = load_grasp("barrett-egg")
    answer = check(grasp, [0, 0, 1], loading=FIRST)
    slow, jolted = (beside_path(answer, simulate(grasp, [0, 0, 1], closing=c, ramp=1.0)) for c in (4.0, None))
    assert slow.apart.max() < 0.02
    assert jolted.apart.min() > 0.2
    assert slow.largest == pytest.approx(1.0)


@pytest.mark.slow
def test_both_end_at_the_same_load() -> None:
    grasp = load_grasp("fig1")
    answer = maximum(grasp, [0, 1, 0], loading=FIRST, settings=Settings(gap=1e-2))
    beside = beside_path(answer, simulate(grasp, [0, 1.1 * answer.lower, 0], closing=2.0, ramp=4.0))
    assert beside.ending == "slips"
    assert beside.onset == pytest.approx(answer.lower, rel=0.03)
    assert beside.apart.max() < 0.05
    end, apart = beside.lines()
    assert f"path ends at {answer.lower:.4g} of the load" in end
    assert f"slip at {beside.onset:.4g}" in end
    assert f"{100 * beside.apart.max():.2g} % at most" in apart
    data = beside.to_json()
    assert data["reached"] == answer.lower
    assert len(data["loads"]) == len(beside.magnitudes)


def test_what_cannot_be_compared(jaw: Grasp) -> None:
    load = 0.5 * LOAD
    answer, found = check(jaw, load, loading=FIRST), simulate(jaw, load, ramp=0.5)
    path = answer.path
    assert isinstance(path, LoadPath)
    nowhere = replace(answer, path=replace(path, steps=(), magnitudes=()))
    refused = [
        (check(jaw, load), found, "has no path"),
        (nowhere, found, "does not begin"),
        (answer, replace(found, wrench=np.array([-0.5, 0, 0, 0, 0, 0])), "another load"),
        (answer, replace(found, wrench=-found.wrench), "another load"),
        (answer, replace(found, loading="together"), "loaded 'together'"),
    ]
    for asked, simulated, fault in refused:
        with pytest.raises(InputError, match=fault):
            beside_path(asked, simulated)
    assert beside_path(answer, replace(found, wrench=2 * found.wrench)).largest == pytest.approx(2)


@pytest.mark.parametrize(
    ("closing", "loading", "fault"),
    [
        (0.0, "together", "come first"),
        (-1.0, FIRST, "closing: is -1; 0, at once, or more"),
        (np.nan, FIRST, "0, at once, or more"),
        (1e5, FIRST, "at most"),
        (1.0, "together", "come first"),
    ],
)
def test_bad_times_of_closing(jaw: Grasp, closing: float, loading: Loading, fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        simulate(jaw, LOAD, closing=closing, loading=loading)
