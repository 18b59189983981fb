"""Maps and sweeps asked again: what they say is proved, and what was changed in their files is refused."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handfast import InputError, verify
from handfast.core.answer import Stop
from handfast.proofs.fields import BadFile
from handfast.proofs.question import Range
from handfast.proofs.replay import Replay
from handfast.stability.problem.grasp_limits import AskedWith
from handfast.stability.problem.settings import INF, Settings
from handfast.stability.studies import ask_again, verify_maps
from handfast.stability.studies.ask_again import (
    NO_TIME,
    Asking,
    BoundsClaim,
    Clock,
    IntervalClaim,
    VerdictClaim,
    figures_of,
    together,
)
from handfast.stability.studies.maps import sweep
from handfast.stability.studies.questions import force_map, maximum
from handfast.stability.studies.verify_maps import replay_map, replay_sweep
from tests.support.problems import bell, pinch

ALONE = Asking(jobs=1)
QUICK = Settings(gap=1e-2)
Change = Callable[[dict[str, Any]], Any]


@cache
def map_text() -> str:
    """1 N along y with the preload, nothing without; any force along x."""
    return json.dumps(force_map(pinch(), "xy", steps=4, settings=QUICK, jobs=1).to_json())


@cache
def sweep_text() -> str:
    """Along y: 1 N, then 2 N: the left finger is locked or takes 0.1 N m at least, and friction is 0.5 at both."""
    return json.dumps(sweep(pinch(), "right", [0.05, 0.2], [[0, 1, 0]], settings=QUICK, jobs=1).to_json())


def put(*path: str | int, value: Any) -> Change:
    """Another value at a place of a file."""

    def change(data: dict[str, Any]) -> None:
        for key in path[:-1]:
            data = data[key]  # type: ignore[index]
        data[path[-1]] = value  # type: ignore[index]

    return change


def both(*changes: Change) -> Change:
    return lambda data: [change(data) for change in changes]


def test_a_map_is_proved() -> None:
    done = replay_map(json.loads(map_text()), ALONE)
    assert done.ok, done.reason
    claims = {part.name: part.claim for part in done.parts}
    assert claims == {  # along x any force both ways; along y nothing, or a lower and an upper bound
        "without_preload": "largest forces by direction: 4 claims",
        "with_preload": "largest forces by direction: 6 claims",
    }


CURVE = "with_preload"
WRONG: dict[str, tuple[Change, str]] = {
    "lower up": (
        both(put(CURVE, "lower", 1, value=1.2), put(CURVE, "upper", 1, value=1.3)),
        r"with_preload: lower\[1\]: is 1\.2; asked again, nothing above 1\.0\d* is resisted, which is proved",
    ),
    "upper down": (
        both(put(CURVE, "lower", 1, value=0.5), put(CURVE, "upper", 1, value=0.6)),
        r"with_preload: upper\[1\]: is 0\.6; asked again, (0\.99|1)[\d.]* is resisted, which is proved",
    ),
    "bounds exchanged": (
        put(CURVE, "lower", 1, value=1.2),
        r"with_preload: lower\[1\]: is 1\.2, above its upper bound 1",
    ),
    "verdict": (put(CURVE, "verdicts", 1, value="slips"), r"verdicts\[1\]: is 'slips'; its bounds say 'holds'"),
    "slips": (
        both(
            put(CURVE, "verdicts", 1, value="slips"),
            put(CURVE, "lower", 1, value=0.0),
            put(CURVE, "upper", 1, value=0.0),
            put("verdict", value="slips"),
        ),
        r"with_preload: upper\[1\]: is 0; asked again, (0\.99|1)[\d.]* is resisted, which is proved",
    ),
    "holds": (
        both(
            put("without_preload", "verdicts", 1, value="holds"),
            put("without_preload", "lower", 1, value=0.1),
            put("without_preload", "upper", 1, value=None),
        ),
        r"without_preload: lower\[1\]: is 0\.1; asked again, nothing is resisted, which is proved",
    ),
    "unbounded": (
        both(put(CURVE, "unbounded", 1, value=True), put(CURVE, "upper", 1, value=None)),
        r"with_preload: unbounded\[1\]: is .*, unbounded; asked again, nothing above 1\.\d* is resisted",
    ),
    "farther": (
        put(CURVE, "lower", 0, value=1e9),
        r"with_preload: unbounded\[0\]: is 1e\+09, unbounded; a search goes up to",
    ),
    "bounded without end": (
        put(CURVE, "unbounded", 1, value=True),
        r"unbounded\[1\]: is true, with an upper bound of 1",
    ),
    "direction": (
        put("directions", 1, value=[0.0, 0.0, 1.0]),
        r"directions\[1\]: is \[0\.0, 0\.0, 1\.0\]; of 4 in the xy plane it is \[0\.0, 1\.0, 0\.0\]",
    ),
    "verdict of all": (put("verdict", value="slips"), "verdict: is 'slips'; the bounds say 'holds'"),
    "preload": (put("preload", "left", value=0.3), r"preload\.left: is 0\.3; the question's is 0\.1"),
    "another preload": (
        both(put("preload", "left", value=0.3), put("question", "grasp", "preload", "left", value=0.3)),
        r"with_preload: upper\[1\]: is 1\.0\d*; asked again, [23]\.\d* is resisted, which is proved",
    ),
    "friction": (
        both(*(put("question", "grasp", "contacts", k, "friction", value=0.4) for k in (0, 1))),
        r"with_preload: lower\[1\]: is (0\.99|1)[\d.]*; asked again, nothing above 0\.8\d* is resisted",
    ),
    "eta": (put("question", "eta", value=0.1), r"eta: is 0 degrees; the question's is 5\.72958"),
}


@pytest.mark.usefixtures("asked_once")
@pytest.mark.parametrize("name", WRONG)
@pytest.mark.slow
def test_what_was_changed_in_a_map_is_refused(name: str) -> None:
    change, why = WRONG[name]
    data = json.loads(map_text())
    change(data)
    done = replay_map(data, ALONE)
    assert done.fault, done
    assert re.search(why, done.fault), done.fault


@pytest.mark.usefixtures("asked_once")
def test_weaker_claims_are_proved_too() -> None:
    data = json.loads(map_text())
    both(put(CURVE, "lower", 1, value=0.7), put(CURVE, "upper", 1, value=1.5))(data)
    assert replay_map(data, ALONE).ok


@pytest.mark.usefixtures("asked_once")
@pytest.mark.slow
def test_a_lower_bound_alone_is_held_exactly() -> None:
    data = json.loads(map_text())
    both(put(CURVE, "lower", 1, value=0.95), put(CURVE, "upper", 1, value=None))(data)
    assert replay_map(data, ALONE).ok
    put(CURVE, "lower", 1, value=1.2)(data)
    assert re.search(r"lower\[1\]: is 1\.2; asked again, nothing above 1\.", replay_map(data, ALONE).fault)


def test_without_time_it_is_undecided() -> None:
    done = replay_map(json.loads(map_text()), Asking(jobs=1, timeout=1e-9))
    assert (done.fault, done.open) == ("", f"without_preload: not asked: {NO_TIME}")
    assert done.part("with_preload").replayed == ()  # type: ignore[union-attr]


@pytest.mark.parametrize("method", ["maximum", "check"])
def test_a_proof_that_fails_proves_nothing(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the search says: what the replay refuses leaves the claim open."""
    refused = Replay(method, parts=(Replay("witness", "it holds", "it is none"),))
    asked = getattr(ask_again, method)

    def unproved(*arguments: Any, **others: Any) -> Any:
        answer = asked(*arguments, **others)
        object.__setattr__(answer, "verify", lambda: refused)
        return answer

    monkeypatch.setattr(ask_again, method, unproved)
    load, clock = np.array([0, 1.0, 0, 0, 0, 0]), Clock(INF, INF, 1)
    verdict = VerdictClaim("verdict", pinch(), 0.5 * load, AskedWith(), "holds")
    bounds = BoundsClaim("lower", pinch(), load, AskedWith(), 0.5, 1.5, upper_place="upper")
    told = (verdict if method == "check" else bounds).ask(clock)
    open_ones = [part for part in told if part.open]
    assert "its proof is refused: witness: it is none" in open_ones[0].undecided
    assert not any(part.fault for part in told)


def test_a_bound_for_small_motions_counts_only_where_the_search_was_complete() -> None:
    load = np.array([0, 1.0, 0, 0, 0, 0])
    claim = BoundsClaim("lower", pinch(), load, AskedWith(), 0.5, 1.5, upper_place="upper")
    answer = maximum(pinch(), load)
    capped = Replay("max", parts=(Replay("certificate", "it slips", figures={"leaves": 3, "motion_cap": 5.0}),))
    for stop, good in ((Stop.COMPLETE, True), (Stop.NUMERICAL, False)):
        done = claim._judged("upper", Replay("upper", "nothing above"), replace(answer, stop=stop), capped)
        assert done.ok is good
        assert done.figures == {"leaves": 3, "motion_cap": 5.0, "tolerant": False}
    shown = together("curve", "maxima", [Replay("upper", "nothing above", figures=figures_of(capped))])
    assert shown.claim == "maxima: 1 claim, some up to virtual motions of 5 N"


@pytest.mark.parametrize(
    ("to", "holes", "unproved", "said"),
    [
        (0.0, [(0.0, 2.0)], [(5.0, 6.0)], ""),
        (0.0, [(0.001, 1.999)], [(4.9, 6.1)], ""),
        (0.0, [(0.02, 2.0)], [(5.0, 6.0)], r"has no hole at 0 to 2; asked again, nothing there is resisted"),
        (0.0, [(0.0, 1.9)], [(5.0, 6.0)], "has no hole at 0 to 2; "),
        (0.0, [], [(5.0, 6.0)], "has no hole at 0 to 2; "),
        (0.0, [], [(0.0, 2.0), (5.0, 6.0)], ""),  # less is said than is shown
        (0.0, [(0.0, 2.1)], [(5.0, 6.0)], r"has a hole at 0 to 2\.1; asked again, none is proved there"),
        (11.0, [], [(5.0, 6.0)], r"is 11; asked again, nothing at 0 to 2 is resisted"),
        (11.0, [(0.0, 2.0)], [(5.0, 6.0)], r"is 11; asked again, nothing at 0 to 2 is resisted"),
        (0.0, [(0.0, 2.0)], [], "of 5 to 6 nothing is shown, which is not among what is unproved"),
        (0.0, [(0.0, 2.0)], [(5.1, 6.0)], "of 5 to 6 nothing is shown"),
    ],
)
def test_ranges_of_magnitudes_are_held_against_what_is_shown_of_them(
    to: float, holes: list[Range], unproved: list[Range], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A hole from 0 to 2 N, of a largest of 10,000 N: ends may be 10^-3 of the magnitude there off, or of 1 N."""
    shown = SimpleNamespace(
        holds_from_zero_to=0.0, holes=((0.0, 2.0),), unproved=((5.0, 6.0),), resolution=1e-3, interrupted=False
    )
    answer = SimpleNamespace(interval=shown, lower=1e4, upper=np.inf, question="of the answer", stop=Stop.COMPLETE)
    monkeypatch.setattr(IntervalClaim, "settled_by", lambda *_, **__: (answer, Replay("max")))
    monkeypatch.setattr(ask_again, "no_magnitude", lambda q: 1.0 if q == "of the answer" else None)
    claim = IntervalClaim("here", pinch(), np.eye(6)[0], AskedWith(gap=1e-3), to, tuple(holes), tuple(unproved))
    (done,) = claim.ask(Clock(1.0, np.inf, 1))
    assert re.search(said, done.reason) if said else done.ok


@pytest.mark.parametrize("ranges", [[[2.0, 1.0]], [[-1.0, 1.0]], [[1.0]], ["anything"]])
def test_what_is_no_range_of_magnitudes(ranges: Any) -> None:
    for key in ("holes", "unproved"):
        with pytest.raises(BadFile, match=rf"^m\.{key}\[0\]: "):
            verify_maps._ranges(ranges, f"m.{key}[0]")


@pytest.mark.usefixtures("asked_once", "proved_once")
@pytest.mark.slow
def test_an_interval_is_asked_again() -> None:
    """Along y of the bell everything up to the largest is resisted; a hole that is none is refused."""
    data = force_map(bell(), "yz", steps=1, interval=True, settings=Settings(gap=3e-2), jobs=1).to_json()
    done = replay_map(json.loads(json.dumps(data)), ALONE)
    assert done.ok, done.reason
    data["with_preload"]["holes"][0] = [[1.0, 1.5]]
    assert re.search(r"has a hole at 1 to 1\.5; asked again, none is proved there", replay_map(data, ALONE).fault)


def test_a_sweep_is_proved() -> None:
    done = replay_sweep(json.loads(sweep_text()), ALONE)
    assert done.ok, done.reason
    assert done.part("direction 0").claim == "largest magnitudes by command of right: 4 claims"  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (
            put("rows", 0, "preload", value=0.2),
            r"direction 0: rows\[0\]\.upper\[0\]: is 1\.0\d*; asked again, (1\.99|2)",
        ),
        (
            put("rows", 1, "preload", value=0.05),
            r"direction 0: rows\[1\]\.lower\[0\]: is (1\.99|2).*; asked again, nothing above 1\.0",
        ),
        (
            both(put("rows", 1, "lower", 0, value=2.5), put("rows", 1, "upper", 0, value=2.6)),
            r"rows\[1\]\.lower\[0\]: is 2\.5; asked again, nothing above 2\.0",
        ),
        (put("rows", 1, "upper", 0, value=1.0), r"rows\[1\]\.lower\[0\]: is .*, above its upper bound 1"),
        (put("directions", 0, value=[1.0, 0, 0, 0, 0, 0]), r"rows\[0\]\.upper\[0\]: is 1\.0\d*; asked again, \d{3}"),
        (put("verdict", value="undecided"), "verdict: is 'undecided'; the bounds say 'holds'"),
    ],
)
@pytest.mark.usefixtures("asked_once")
def test_what_was_changed_in_a_sweep_is_refused(change: Change, why: str) -> None:
    data = json.loads(sweep_text())
    change(data)
    assert re.search(why, replay_sweep(data, ALONE).fault), replay_sweep(data, ALONE).fault


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda d: d.pop("question"), "question: is missing, so that it cannot be asked again"),
        (put("question", "gap", value=0.0), "question: has an eta beyond 45 degrees, or a gap that is not above 0"),
        (put(CURVE, value=None), "with_preload: is for grasps with a preload"),
        (put(CURVE, "lower", value=[1.0]), "with_preload.lower: is no list of 4"),
        (put(CURVE, "lower", 2, value=-1.0), "with_preload.lower[2]: is -1; 0 or more is needed"),
        (put(CURVE, "verdicts", 0, value="maybe"), "with_preload.verdicts[0]: is 'maybe'"),
        (put(CURVE, "unbounded", 3, value=1), "with_preload.unbounded[3]: is 1; true or false"),
        (put("colour", value="red"), "colour: is not a known field"),
    ],
)
def test_files_that_are_none(change: Change, line: str) -> None:
    data = json.loads(map_text())
    change(data)
    with pytest.raises(BadFile, match=re.escape(line)):
        replay_map(data, ALONE)


def test_a_grasp_that_is_none() -> None:
    data = json.loads(map_text())
    data["question"]["grasp"]["contacts"][0]["friction"] = -1.0
    with pytest.raises(InputError, match=r"question\.grasp\.contacts\[0\]\.friction: is -1"):
        replay_map(data, ALONE)


def test_answers_in_python_are_asked_again_where_that_is_wanted() -> None:
    answer = force_map(pinch(), "xy", steps=1, settings=QUICK, jobs=1)
    assert "replay=True" in verify(answer).reason
    assert verify(answer, replay=True, jobs=1).ok


def test_processes_and_one_alone_agree() -> None:
    data = json.loads(map_text())
    put(CURVE, "upper", 1, value=0.9999)(data)
    assert replay_map(data, Asking(jobs=2)).to_json() == replay_map(data, ALONE).to_json()
