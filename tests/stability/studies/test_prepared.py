"""A prepared grasp says what a check says, under loads and preloads that change."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.grasps import random_case
from handfast import InputError, Loads, check, force_map, hold, max_many, maximum, prepare, torques
from handfast.model.grasp import Grasp
from handfast.proofs import checker
from handfast.proofs.existence import prove
from handfast.stability.answers import answer as answer_module
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.studies import prepared as prepared_module
from tests.support.jaws_on_paths import jaw
from tests.support.problems import bell, pinch, solved

QUICK = Settings(verify=False)


@pytest.mark.parametrize(
    ("g", "asked"),
    [
        (bell(), {}),
        (bell(), {"limits": GraspLimits(force_limit=2.0)}),
        (solved(5, 3, eta=0.1).grasp, {"limits": GraspLimits(0.1)}),
    ],
)
def test_loads_that_change_are_answered_as_by_check(g: Grasp, asked: dict[str, Any]) -> None:
    prepared = prepare(g, settings=QUICK, **asked)
    first = maximum(g, g.G @ np.tile([1.0, 0.3, 0.1], g.m), settings=QUICK, **asked).lower
    for k in range(20):
        w = min(first, 3.0) * (0.1 + 0.1 * k) * (g.G @ np.tile([1.0, 0.3, 0.1], g.m))
        if k == 10:
            prepared.preload({name: 1.3 * f for name, f in g.preload.items()})
        found = prepared.check(w)
        assert found.verdict is check(prepared.grasp, w, settings=QUICK, **asked).verdict
        assert (found.found is not None) == (found.verdict == "holds")
        if found.found:
            assert found.witness is not None
            assert found.witness.valid
            np.testing.assert_allclose(found.witness.wrench, w, rtol=4e-16)  # the scale of a search rounds
            assert found.certain


def test_what_is_near_takes_no_search() -> None:
    """The first load is a search's, as one that is asked alone; what is prepared is so for the second."""
    prepared = prepare(bell())
    for _ in range(2):
        assert prepared.check([0, 0.5, 0.1]).verdict == "holds"
    for k in range(5):
        answer = prepared.check([0, 0.5 + 0.02 * k, 0.1])
        assert (answer.verdict, answer.nodes) == ("holds", 0)


def _told(answer: Any) -> dict[str, Any]:
    """All that is kept of an answer but its time."""
    out: dict[str, Any] = answer.to_file()
    out["answer"] = {name: x for name, x in out["answer"].items() if name not in ("seconds", "nodes")}
    return out


def test_a_preload_that_is_assigned_is_refused() -> None:
    prepared = prepare(pinch())
    with pytest.raises(AttributeError, match=r"call prepared.preload\({...}\)"):
        prepared.preload = {}  # type: ignore[assignment, method-assign]


@pytest.mark.parametrize("loading", ["together", pytest.param("preload-first", marks=pytest.mark.slow)])
def test_a_question_has_one_answer_to_the_last_bit(loading: Any) -> None:
    """Asked alone or of a prepared grasp: what holds, slips, is the largest, the least commands, the preload, a map."""
    g, holds, slips = pinch(), [0, 0.5, 0.1], [0, 3.0, 0]
    if loading == "preload-first":
        g, holds, slips = jaw(), [-0.6, 0.6, 0], [-3.0, 9.0, 0]
    settings, limits = Settings(jobs=1), GraspLimits(force_limit=2.0)
    asked: dict[str, Any] = {"settings": settings, "limits": limits, "loading": loading}
    for w in (holds, slips):
        assert _told(check(g, w, **asked)) == _told(prepare(g, **asked).check(w))
    assert loading != "together" or check(g, holds, **asked).exact
    assert _told(maximum(g, holds, **asked)) == _told(prepare(g, **asked).maximum(holds))
    some = Loads.wrench(holds, "up")
    assert hold(g, some, **asked).preload == prepare(g, **asked).hold(some).preload
    if loading == "together":
        some += Loads.wrench([0, 0, 0.4], "side")
        assert hold(g, some, **asked).preload == prepare(g, **asked).hold(some).preload
        drawn = force_map(g, "xy", steps=4, **asked), prepare(g, **asked).map("xy", steps=4)
        np.testing.assert_array_equal(*(np.r_[m.passive.upper, m.preloaded.upper] for m in drawn))
        assert drawn[0].passive.upper[0] == pytest.approx(2.0, rel=2e-3)  # the limit of forces
        assert _told(torques(g, holds, **asked)) == _told(prepare(g, **asked).torques(holds))
        assert _told(check(g, holds, mdp=False, **asked)) == _told(prepare(g, **asked).check(holds, mdp=False))


@pytest.mark.parametrize("verify", [True, False])
def test_what_a_prepared_grasp_says_is_proved_as_what_a_function_says(
    verify: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """States are proved to exist exactly before it is answered, or when that is asked for."""
    tried = []

    def noted(*args: Any) -> Any:
        tried.append(args)
        return prove(*args)

    monkeypatch.setattr(answer_module, "prove", noted)
    prepared = prepare(bell(), settings=Settings(verify=verify))
    for k in range(4):
        tried.clear()
        answer = prepared.check([0, 0.5 + 0.02 * k, 0.1])
        assert bool(tried) is verify
        assert answer.exact
        assert answer.verify().ok


def test_what_newtons_method_finds_and_nobody_can_prove_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    prepared = prepare(bell())
    for _ in range(2):
        prepared.check([0, 0.5, 0.1])
    monkeypatch.setattr(prepared_module.CheckAnswer, "certain", False)
    answer = prepared.check([0, 0.5, 0.1])
    assert (answer.verdict, answer.found) == ("undecided", None)
    assert answer.nodes > 0


def test_what_slips_has_a_certificate() -> None:
    """A pinch holds 1 N along y, in proportion to its preload."""
    prepared = prepare(pinch(), preload={"right": 0.1, "left": 0.1})
    assert prepared.check([0, 0.95, 0]).verdict == "holds"
    slips = prepared.check([0, 1.05, 0])
    assert slips.verdict == "slips"
    assert slips.witness is None
    assert slips.certificate is not None
    assert checker.verify(slips.certificate).ok
    prepared.preload({"right": 0.12, "left": 0.12})
    assert prepared.check([0, 1.05, 0]).verdict == "holds"
    assert abs(prepared.maximum([0, 1, 0]).lower - 1.2) < 3e-3
    prepared.preload({"right": -0.1, "left": 0.1})  # the other sense is another question, prepared by itself
    assert prepared.check([0, 0.5, 0]).verdict is check(prepared.grasp, [0, 0.5, 0]).verdict


def test_the_certificate_of_a_load_that_slips_is_tried_for_those_near_it() -> None:
    """It is made one about the load that is asked, and checked; what holds is none the less found to hold."""
    prepared = prepare(pinch(), preload={"right": 0.1, "left": 0.1})
    first = prepared.check([0, 1.2, 0])
    assert first.nodes > 0
    second = prepared.check([0, 1.15, 0.02])
    assert (second.verdict, second.stop, second.nodes, second.verified) == ("slips", "complete", 0, True)
    assert second.certificate is not None
    np.testing.assert_array_equal(second.certificate.question.wrench, [0, 1.15, 0.02, 0, 0, 0])
    assert second.verify().ok
    assert prepared.check([0, 2.4, 0]).nodes > 0  # too far from it: searched
    assert prepared.check([0, 2.3, 0]).nodes == 0
    assert prepared.check([0, 0.99, 0]).verdict == "holds"
    assert prepared.check([0, 1.2, 0]).verdict == "slips"
    assert prepared.check([0, 0.99, 0]).verdict == "holds"
    prepared.preload({"right": 0.2, "left": 0.2})
    assert prepared.check([0, 1.2, 0]).verdict == "holds"


def test_bad_loads_are_refused() -> None:
    prepared = prepare(pinch())
    with pytest.raises(InputError, match="has 2 numbers"):
        prepared.check([0, 1])
    with pytest.raises(InputError, match="rank 5"):
        prepared.check([0, 0, 0, 1, 0, 0])
    with pytest.raises(InputError, match="nobody"):
        prepared.preload({"nobody": 1.0})


def test_a_command_beyond_its_limit_is_refused_and_the_old_one_stays() -> None:
    """Whatever was prepared for the same senses: a backdrivable motor has nothing but its command."""
    g = random_case(3, 9_300_000).grasp
    i = int(np.argmax(np.abs(g.command)))
    back = tuple(k == i for k in range(len(g.command)))
    g = Grasp(g.contacts, g.joints, replace(g.mechanism, backdrivable=back), g.command)
    prepared = prepare(g, limits=GraspLimits(torque_limits={g.mechanism.actuators[i]: 2 * abs(g.command[i])}))
    idle = np.flatnonzero(g.command == 0)[0]
    for more in (0.0, 0.01):  # in the same senses, and in others
        command = 3 * g.command
        command[idle] += more
        with pytest.raises(InputError, match="is backdrivable and gives its command"):
            prepared.preload(command)
        np.testing.assert_array_equal(prepared.grasp.command, g.command)
    prepared.preload(1.5 * g.command)
    np.testing.assert_array_equal(prepared.grasp.command, 1.5 * g.command)


def test_a_load_that_no_forces_balance_is_refused_however_small() -> None:
    case = random_case(2, 9_400_001)  # two contacts: no torque about the line through them
    prepared = prepare(case.grasp)
    for size in (1e-3, 1e-8, 1e-9):
        with pytest.raises(InputError, match="cannot be balanced by any forces"):
            prepared.check(size * case.direction)


def test_many_loads_are_answered_as_rows() -> None:
    """What a grasp was prepared for once answers later calls as well, single rows and odd ones included."""
    g = solved(3, 4).grasp
    W = g.G @ np.random.default_rng(5).normal(size=(3 * g.m, 6))
    W, prepared = W.T / np.abs(W).max(), prepare(g, settings=QUICK)
    first, together = prepared.maximum(W[:4]), max_many(g, W, settings=QUICK)
    last = prepared.maximum(W[4:5])
    assert np.array_equal(first.lower, together.lower[:4])
    assert np.array_equal(first.upper, together.upper[:4])
    assert last.lower[0] == pytest.approx(together.lower[4], rel=2e-3)
    assert prepared.check(W).verdict.tolist() == [str(prepared.check(w).verdict) for w in W]
    odd = prepared.check(np.vstack([W[0], np.full(6, np.nan)]))
    assert odd.error[0] == ""
    assert "NaN" in odd.error[1]
    loaded = prepared.maximum(W[:2], base=0.1 * W[2])
    each = [maximum(g, w, base=0.1 * W[2], settings=QUICK).lower for w in W[:2]]
    np.testing.assert_allclose(loaded.lower, each, rtol=2e-3)
    prepared.preload({name: 2 * f for name, f in g.preload.items()})
    np.testing.assert_allclose(prepared.maximum(W[:4]).lower, 2 * first.lower, rtol=2e-3)


def test_every_question_is_that_of_the_grasp() -> None:
    limits = GraspLimits(force_limit=2.0)
    prepared, up = prepare(pinch(), limits=limits, settings=QUICK), [0, 0.5, 0, 0, 0, 0]
    assert prepared.torques(up).upper == torques(pinch(), up, limits=limits, settings=QUICK).upper
    np.testing.assert_allclose(prepared.torques([up, up]).upper, prepared.torques(up).upper)
    held = prepared.hold(Loads.wrench(up))
    assert held.limits == limits
    assert held.preload == hold(pinch(), Loads.wrench(up), limits=limits, settings=QUICK).preload
    drawn, other = prepared.map("yz", steps=4), force_map(pinch(), "yz", steps=4, limits=limits, settings=QUICK)
    assert drawn.terms.limits == limits
    np.testing.assert_array_equal(drawn.preloaded.lower, other.preloaded.lower)
    assert prepared.maximum([0, 1, 0], interval=True).interval is not None
