"""First the squeeze, then the load, asked of many loads: prepared grasps, tables, maps, sweeps, one preload."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import numpy as np
import pytest

from handfast import Contact, Grasp, GraspJoint, Loads, Mechanism, load_grasp, prepare, verify
from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.proofs.fields import BadFile
from handfast.stability.answers import load_path
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.scaled_problem import ScaledProblem
from handfast.stability.problem.settings import Loading, Settings
from handfast.stability.studies.ask_again import Asking
from handfast.stability.studies.batch import check_many, max_many, torques_many
from handfast.stability.studies.hold import HoldAnswer
from handfast.stability.studies.maps import sweep
from handfast.stability.studies.questions import check, force_map, hold, maximum, torques
from handfast.stability.studies.verify_maps import replay_sweep
from tests.support.jaws_on_paths import FIRST, MOTOR, jaw, padded

QUICK = Settings(gap=1e-2)
ALONG = {"loading": FIRST}
LOADS = Loads(("back", "across"), [[-0.6, 0.6, 0, 0, 0, 0], [0, 0.2, 0, 0, 0, 0]])
TENDONS = Mechanism(("motor", "tendon"), np.array([[1.0], [1.0]]), np.zeros((0, 1)), (False, True), (True, False))


def coupled() -> Grasp:
    """Two jaws that one motor closes alike."""
    contacts = [Contact((-1, 0, 0), (1, 0, 0), 0.5), Contact((1, 0, 0), (-1, 0, 0), 0.5)]
    ways = ("left", 1.0), ("right", -1.0)
    joints = [GraspJoint(n, (x, 0, 0), (-x, 0, 0), (k,), "prismatic") for k, (n, x) in enumerate(ways)]
    both = Mechanism(("motor",), np.array([[1.0, 1.0]]), np.array([[1.0, -1.0]]), (False,))
    return Grasp(contacts, joints, both, {"motor": 2.0}, "coupled")


@pytest.mark.parametrize(
    ("grasp", "limits", "load"),
    [
        pytest.param(jaw(), GraspLimits(), 0.6, id="gearing"),
        pytest.param(jaw(MOTOR), GraspLimits(), 0.3, id="backdrivable"),
        pytest.param(coupled(), GraspLimits(), 0.3, id="coupling"),
        pytest.param(padded(TENDONS), GraspLimits(), 0.3, id="tendon"),
        pytest.param(padded(MOTOR, friction=0.4), GraspLimits(), 0.2, id="friction of a joint"),
        pytest.param(padded(MOTOR, stop="lower"), GraspLimits(), 0.3, id="stop"),
        pytest.param(padded(MOTOR, torque=0.2), GraspLimits(), 0.3, id="spring"),
        pytest.param(jaw().with_torsion(0.1), GraspLimits(), 0.3, id="soft finger"),
        pytest.param(padded(), GraspLimits(eta=0.02), 0.3, id="uncertain normals"),
        pytest.param(jaw(), GraspLimits(force_limit=1.31), 0.6, id="limit"),
    ],
)
@pytest.mark.slow
def test_every_law_is_known_to_every_way_of_asking(grasp: Grasp, limits: GraspLimits, load: float) -> None:
    near, far = [-load, load, 0], [-3.0, 9.0, 0]
    found = prepare(grasp, limits=limits, **ALONG).check([near, far])
    assert found.verdict.tolist() == check_many(grasp, [near, far], limits=limits, **ALONG).verdict.tolist()
    assert found.verdict.tolist() == [check(grasp, w, limits=limits, **ALONG).verdict for w in (near, far)]
    assert found.verdict.tolist() == ["holds", "slips"]
    held = hold(grasp, Loads(("near",), [[*near, 0, 0, 0]]), limits=limits, settings=QUICK, least=False, **ALONG)
    assert held.verdict is Verdict.HOLDS
    assert held.verify().ok


@pytest.mark.slow
def test_maxima_of_many_are_those_of_one() -> None:
    W = [[-1, 1, 0], [0, 1, 0]]
    many = max_many(jaw(), W, settings=QUICK, **ALONG)
    for k, direction in enumerate(W):
        alone = maximum(jaw(), direction, settings=QUICK, **ALONG)
        assert (many.lower[k], many.upper[k]) == (alone.lower, alone.upper)


def test_the_state_of_the_commands_is_found_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    searched = load_path.any_state

    def counted(kind: Any, p: ScaledProblem, *others: Any, **more: Any) -> Any:
        asked.append(p.grasp.start is None)
        return searched(kind, p, *others, **more)

    monkeypatch.setattr(load_path, "any_state", counted)
    prepared = prepare(jaw(), **ALONG)
    for load in ([-0.3, 0.1, 0], [-0.1, 0.3, 0], [-0.6, 0.6, 0]):
        assert prepared.check(load).verdict is Verdict.HOLDS
    assert prepared.maximum([-1, 1, 0]).lower == pytest.approx(2 / 3, rel=2e-3)
    assert sum(asked) == 1
    prepared.preload({"jaw": 0.5})  # another state
    assert prepared.check([-0.6, 0.6, 0]).verdict is Verdict.SLIPS
    assert prepared.check([-0.3, 0.3, 0]).verdict is Verdict.HOLDS
    assert sum(asked) == 2


def test_what_cannot_be_asked_is_refused() -> None:
    g, W = jaw(), [[-0.3, 0.1, 0]]
    with pytest.raises(InputError, match="'later'; 'preload-first' or 'together'"):
        check_many(g, W, loading="later")
    with pytest.raises(InputError, match="'later'; 'preload-first' or 'together'"):
        prepare(g, loading="later")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="'later'; 'preload-first' or 'together'"):
        hold(g, LOADS, loading="later")
    with pytest.raises(InputError, match="cannot be asked with base"):
        max_many(g, W, base=[0, 0, -1], **ALONG)
    with pytest.raises(InputError, match="cannot be asked with base"):
        prepare(g, **ALONG).maximum(W, base=[0, 0, -1])
    with pytest.raises(InputError, match="cannot be asked with interval"):
        force_map(g, interval=True, **ALONG)
    with pytest.raises(InputError, match="needs the maximum dissipation principle"):
        check_many(g, W, mdp=False, **ALONG)
    for ask in (torques_many, lambda g, w, loading: prepare(g, loading=loading).torques(w)):
        with pytest.raises(InputError, match="least commands of many loads cannot be asked with it"):
            ask(g, W[:1], loading=FIRST)


def test_nothing_but_the_load() -> None:
    """With the jaw locked and nothing pressed, any force into the wall is resisted, and none along it."""
    g = padded().with_preload(None)
    pressed, across = max_many(g, [[-1, 0, 0], [0, 1, 0]], answers=True, **ALONG).answers or ()
    assert (pressed.unbounded, pressed.verdict) == (True, Verdict.HOLDS)
    assert (across.verdict, across.lower, across.upper) == (Verdict.SLIPS, 0.0, 0.0)
    assert pressed.verify().ok
    assert across.verify().ok
    small = maximum(g, [0, 1, 0], limits=GraspLimits(force_limit=1.0), **ALONG)
    assert (small.verdict, small.lower) == (Verdict.UNDECIDED, 0.0)  # nothing is shown of smaller ones
    assert 0 < small.upper < 0.1
    assert small.verify().ok
    forged = small.to_file()
    forged["answer"] |= {"verdict": "slips", "upper": 0.0}
    assert load_path.path_steps.replay(load_path.path_steps.read_path(forged)).reason


# --- maps and sweeps ----------------------------------------------------------------------------------


@cache
def sweep_text() -> str:
    """Along (-1, 1) the jaw reaches 2/3 of its command; together 1/2."""
    return json.dumps(sweep(jaw(), "jaw", [0.5, 1.0], [[-1, 1, 0]], jobs=1, settings=QUICK, **ALONG).to_json())


def changed(*path: Any, value: Any) -> str:
    """What is wrong with a sweep after another number was put at a place of it; "" if nothing."""
    data = json.loads(sweep_text())
    at = data
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return str(replay_sweep(data, Asking(jobs=1)).fault)


@pytest.mark.slow
def test_a_sweep_has_the_ends_of_paths_and_is_proved_again() -> None:
    data = json.loads(sweep_text())
    assert data["question"]["loading"] == FIRST
    assert [row["lower"][0] for row in data["rows"]] == pytest.approx([1 / 3, 2 / 3], rel=1e-2)
    done = replay_sweep(data, Asking(jobs=1))
    assert done.ok, done.fault
    assert done.parts


@pytest.mark.slow
def test_what_was_changed_in_a_sweep_is_refused() -> None:
    assert "rows[1].lower[0]: is 0.69" in changed(
        "rows", 1, value={"preload": 1.0, "lower": [0.69], "upper": [0.7], "unbounded": [False]}
    )
    assert "rows[1].upper[0]: is 0.65" in changed(
        "rows", 1, value={"preload": 1.0, "lower": [0.64], "upper": [0.65], "unbounded": [False]}
    )
    assert "rows[0].lower[0]" in changed("question", "loading", value=None)  # together 1/4 and 1/2
    with pytest.raises(BadFile, match="'later'"):
        changed("question", "loading", value="later")


@pytest.mark.slow
def test_a_map_is_of_paths() -> None:
    found = force_map(jaw(), "xy", steps=2, jobs=1, settings=QUICK, **ALONG)
    for k, direction in enumerate(found.directions):
        assert found.preloaded is not None
        assert found.preloaded.lower[k] == maximum(jaw(), direction, settings=QUICK, **ALONG).lower
    assert found.to_json()["question"]["loading"] == FIRST
    done = verify(found, replay=True, jobs=1)
    assert done.ok, done.fault
    assert "loading" not in force_map(jaw(), "xy", steps=1, jobs=1).to_json()["question"]


# --- one preload for many loads -----------------------------------------------------------------------


@cache
def held(loading: Loading) -> HoldAnswer:
    return hold(jaw(), LOADS, margins=True, loading=loading)


@pytest.mark.slow
def test_one_preload_holds_loads_on_their_paths() -> None:
    """Together 1.2 N are needed. On the path 0.9 N do: 0.9 (2/3) = 0.6. That less would not do is not claimed."""
    found = held(FIRST)
    assert found.verdict is Verdict.HOLDS
    assert found.preload == {"jaw": pytest.approx(0.9, rel=2e-3)}
    assert (found.lower, found.bounding) == (0.0, None)
    assert found.margins["back"].lower == pytest.approx(1.0, rel=3e-3)
    assert found.to_json()["loading"] == FIRST
    assert found.verify().ok
    assert held("together").lower > 1.19


@pytest.mark.slow
def test_a_preload_that_holds_together_and_not_on_the_path_is_none() -> None:
    """`barrett-mug` resists 18.1 N along +y together, with the commands that it has; its path ends at 11 N."""
    mug = load_grasp("barrett-mug")
    up = Loads(("up",), [[0, 18.1, 0, 0, 0, 0]])
    assert check(mug, up.wrenches[0]).verdict is Verdict.HOLDS
    found = hold(
        mug, up, least=False, command_limit=1.01 * max(map(abs, mug.preload.values())), settings=QUICK, **ALONG
    )
    assert found.verdict is Verdict.UNDECIDED
    more = hold(mug, up, least=False, settings=QUICK, **ALONG)
    assert more.preload is not None
    assert check(mug.with_preload(more.preload), up.wrenches[0], **ALONG).verdict is Verdict.HOLDS


def test_no_preload_for_what_nothing_balances() -> None:
    lone = Grasp(jaw().contacts[:1], jaw().joints, preload={"jaw": 1.0})
    found = hold(lone, Loads(("away",), [[1, 0, 0, 0, 0, 1]]), **ALONG)
    assert (found.verdict, found.refuted) == (Verdict.SLIPS, ("away", None))
    assert found.verify().ok
    open_ = hold(
        lone, Loads(("back",), [[1, 0, 0, 0, 0, 0]]), **ALONG
    )  # slips together, which proves nothing of a path
    assert open_.verdict is Verdict.UNDECIDED
    assert open_.verify().ok


def test_hold_files_of_another_loading_are_refused() -> None:
    from handfast.proofs import holds

    after, together = held(FIRST).to_file(), held("together").to_file()

    def refused(data: Any) -> str:
        return str(holds.replay(holds.read_hold(data)).fault)

    with pytest.raises(BadFile):
        refused(after | {"question": together["question"]})
    with pytest.raises(BadFile):
        refused(together | {"question": after["question"]})
    silent = after | {"answer": {k: v for k, v in after["answer"].items() if k != "loading"}}
    assert "has other keys" in refused(silent)
    bounded = after | {"bounding": together["bounding"]}
    bounded["answer"] = after["answer"] | {"lower": together["answer"]["lower"]}
    assert "on paths" in refused(bounded)
    swapped = after | {"checks": {"back": after["checks"]["across"], "across": after["checks"]["back"]}}
    assert "is about another load" in refused(swapped)
    slips = {"verdict": "slips", "preload": None, "upper": None, "lower": None}
    none = after | {"checks": {}, "margins": {}, "answer": after["answer"] | slips}
    none["refuted"] = {"load": "back", "result": torques(jaw(), LOADS.wrenches[0]).to_file()}
    assert "is not shown of its path" in refused(none)
