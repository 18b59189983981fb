"""`verify()` of answers that are made of others: all of their parts are replayed, and planted faults are refused."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handfast import verify
from handfast.core.answer import Verdict
from handfast.stability.hold import HoldAnswer, hold
from handfast.stability.loads import Loads
from handfast.stability.maps import force_map, sweep
from handfast.stability.margin import Margin, rubbed
from handfast.stability.margin_search import margin
from handfast.stability.queries import check, torques
from tests.support.problems import bell, nest, pinch

UP, SIDE = np.array([0, 1.0, 0, 0, 0, 0]), np.array([0.2, 0, 0, 0, 0, 0])
LOADS = Loads(("up", "side"), np.array([UP, SIDE]))


@cache
def held() -> HoldAnswer:
    return hold(pinch(), LOADS)


@cache
def impossible() -> HoldAnswer:
    return hold(nest(), Loads(("pull",), np.array([[0, 0, 1.0, 0, 0, 0]])))


@cache
def leaning() -> Margin:
    found = margin(pinch(), 0.05 * UP)
    assert found is not None
    return found


def test_every_load_of_a_preload_is_replayed() -> None:
    done = verify(held())
    assert done.ok, done.reason
    assert {"up", "side"} <= set(done.parts)
    assert all(
        part.witness and part.witness.residual <= 1e-9 for name, part in done.parts.items() if name in LOADS.names
    )
    assert held().lower > 0
    (bound,) = set(done.parts) - {"up", "side"}
    assert bound.endswith("least commands")
    assert done.parts[bound].certificate is not None
    assert any("suffice" in line for line in done.replayed)
    assert any("hardest" in line for line in done.not_replayed)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"checks": ()}, "HOLDS without a preload and an answer for each load"),
        ({"preload": {"right": 9.0, "left": 9.0}}, "up: the answer is about another preload"),
        ({"loads": Loads(("up", "side"), np.array([2 * UP, SIDE]))}, "up: the answer is about another load"),
        ({"upper": 9.0}, "the largest command is not 9"),
        ({"lower": 1e-6}, "the bound 1e-06 is not that of up"),
        ({"bounding": None}, "nothing is there that shows the bound"),
        ({"verdict": Verdict.SLIPS}, "SLIPS without a load that no preload resists"),
    ],
)
def test_faults_in_a_preload_for_many_loads(change: dict, reason: str) -> None:
    done = replace(held(), **change).verify()
    assert not done.ok
    assert done.reason.startswith(reason)


def test_a_witness_that_is_none_is_found() -> None:
    first, second = held().checks
    assert first.witness is not None
    state = first.witness.state.scaled(1.5)
    wrong = replace(first, witness=replace(first.witness, state=state))
    assert replace(held(), checks=(wrong, second)).verify().reason.startswith("up: witness: the residual is")


def test_a_load_that_nothing_holds_is_replayed() -> None:
    assert impossible().verdict is Verdict.SLIPS
    done = impossible().verify()
    assert done.ok, done.reason
    assert [part.certificate is not None for part in done.parts.values()] == [True]
    other = replace(impossible(), loads=Loads(("pull",), np.array([[0, 0, -1.0, 0, 0, 0]])))
    assert other.verify().reason == "pull: the answer is about another load"
    holds = check(nest(), np.array([0, 0, -1.0, 0, 0, 0]))
    assert "pull: the answer" in replace(impossible(), refuted=("pull", holds)).verify().reason


def test_locked_motors_do_not_show_that_no_commands_hold() -> None:
    """Of two jaws that can squeeze; locked, on one side alone, or within limits that nobody asked for, they drop it."""
    bare = pinch().with_preload(None)
    asked = hold(bare, Loads(("up",), np.array([UP])))
    assert asked.verdict is Verdict.HOLDS
    slips = {"verdict": Verdict.SLIPS, "preload": None, "checks": (), "bounding": None}
    for answer, reason in (
        (check(bare, UP), "all commands that were sought"),
        (torques(bare, UP, force_limit=1e-3), "another load"),
    ):
        assert answer.verdict is Verdict.SLIPS
        forged = replace(asked, **slips, lower=np.inf, upper=np.inf, refuted=("up", answer)).verify()
        assert not forged.ok
        assert reason in forged.reason


def test_a_bound_of_fewer_commands_or_other_limits_is_none() -> None:
    bare = pinch().with_preload(None)
    asked = hold(bare, Loads(("up",), np.array([UP])))
    assert asked.verify().ok
    narrow = replace(asked, actuators=asked.actuators[:1])
    assert narrow.verify().reason == "up: the answer is not about all commands that were sought"
    wary = torques(bare, UP, eta=0.05)
    forged = replace(asked, lower=wary.lower, bounding=("up", wary)).verify()
    assert forged.reason == "up: the answer is about another load"
    crossed = replace(asked, limits={"eta": 0.05}, lower=wary.lower, bounding=("up", wary)).verify()
    assert crossed.reason == "up: the answer is about another load"  # HOLDS without the uncertainty


def test_states_without_the_dissipation_principle_do_not_show_that_a_preload_holds() -> None:
    """With (6) and (7) left out anything within the cones may balance a load."""
    loaded = pinch().with_preload(held().preload)
    loose = check(loaded, UP, mdp=False)
    assert loose.verdict is Verdict.HOLDS
    assert loose.verify().ok
    forged = replace(held(), checks=(loose, held().checks[1])).verify()
    assert forged.reason == "up: the answer is about another load"


def test_a_bound_of_the_sum_of_commands_is_none_of_the_largest() -> None:
    """The least sum is never below the least of the largest command: its bound proves nothing about that."""
    bare = pinch().with_preload(None)
    asked = hold(bare, Loads(("up",), np.array([UP])))
    total = torques(bare, UP, objective="sum")
    assert total.verify().ok
    assert 0 < total.lower <= asked.upper
    forged = replace(asked, lower=total.lower, bounding=("up", total)).verify()
    assert forged.reason == f"the bound {total.lower:.6g} is not that of up"


def test_a_load_beyond_all_forces_is_replayed() -> None:
    flat = bell()
    beyond = HoldAnswer(
        Verdict.SLIPS, held().stop, 0.0, 0, LOADS, None, np.inf, np.inf, refuted=("up", None), grasp=flat
    )
    assert beyond.verify().reason == "up: forces can balance it"


def test_flips_of_a_margin_are_replayed() -> None:
    m = leaning()
    done = verify(m)
    assert done.ok, done.reason
    assert m.less.answer is not None
    assert {"motion", "less friction"} <= set(done.parts)
    assert done.parts["less friction"].certificate is not None
    assert any(line.startswith("holds: ") for line in done.not_replayed)
    wider = replace(m, less=replace(m.less, holds=0.0, slips=0.5 * (m.less.slips or 1.0)))
    assert wider.verify().reason == "less friction: the answer is about another change"
    bare = replace(m, less=replace(m.less, answer=None))
    assert bare.verify().reason == "less friction: without an answer that it slips"
    crossed = replace(m, less=replace(m.less, holds=0.99)).verify()
    assert re.fullmatch(r"less friction: it slips at \S+, and holds up to 0.99", crossed.reason)
    tight = check(rubbed(pinch(), 0.99), 0.05 * UP, force_limit=1e-3)
    assert tight.verdict is Verdict.SLIPS
    forged = replace(m, less=replace(m.less, holds=0.0, slips=0.01, answer=tight))
    assert forged.verify().reason == "less friction: the answer is about another change"
    moved = replace(m, witness=replace(m.witness, state=m.witness.state.scaled(2.0)))
    assert moved.verify().reason.startswith("motion: witness: the residual is")


def test_maps_and_sweeps_say_that_nothing_is_replayed() -> None:
    for answer in (force_map(pinch(), steps=2), sweep(pinch(), "right", [0.1], [UP])):
        done = verify(answer)
        assert not done.ok
        assert done.reason.startswith("maps and sweeps keep no witnesses and certificates")
        assert done.replayed == ()
        assert any(line.startswith("lower, upper") for line in done.not_replayed)
