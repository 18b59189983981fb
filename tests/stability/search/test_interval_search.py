"""Which magnitudes below the largest are resisted: answers, maps, pictures and words."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.grasps import random_case
from handfast import verify
from handfast.cli import main
from handfast.cli.maps import map_csv
from handfast.core.answer import Stop, Verdict
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.pictures import sentences, words
from handfast.pictures.map_picture import draw_map
from handfast.readers.grasp_file import load_grasp, save_grasp
from handfast.stability.answers import MaxAnswer
from handfast.stability.answers.check_query import ask as check
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.objective import LARGEST_MAGNITUDE
from handfast.stability.problem.settings import Settings
from handfast.stability.problem.witness import VALID
from handfast.stability.search import interval_search
from handfast.stability.search.interval_search import _Magnitudes, resisted
from handfast.stability.search.proof import Outcome
from handfast.stability.studies.maps import MapAnswer
from handfast.stability.studies.questions import force_map, maximum
from tests.support.interruptions import interrupt
from tests.support.problems import moved, pinch, table

# --- answers ----------------------------------------------------------------------------------------

Y6 = np.array([0, 1.0, 0, 0, 0, 0])
GAP = 1e-3


def test_a_pinch_resists_everything_below_its_maximum() -> None:
    answer = maximum(pinch(), Y6, interval=True)
    assert answer.interval.holds_from_zero_to == answer.lower
    assert answer.interval.upper == answer.upper
    assert answer.interval.holes == answer.interval.unproved == ()
    said = answer.to_json()
    assert said["holds_from_zero_to"] == answer.lower
    assert said["holds_from_zero_upper"] == answer.upper
    assert said["holes"] == said["unproved"] == []
    assert said["resolution"] == GAP


def test_not_asked_is_null() -> None:
    said = maximum(pinch(), Y6).to_json()
    assert said["holds_from_zero_to"] is None
    assert not {"holes", "unproved", "resolution", "holds_from_zero_upper"} & said.keys()


@pytest.mark.slow
def test_states_of_ranges_are_those_of_little_motion() -> None:
    """What the search finds of fig1 turns by 1e8 N/m beside 1 N. So do states where modes change, no others."""
    answer = maximum(load_grasp("fig1"), [0, 1, 0, 0, 0, 0], interval=True, settings=Settings(gap=1e-2))
    assert answer.interval is not None
    assert answer.interval.holds_from_zero_to == answer.lower
    little = [arc for arc in answer.interval.arcs if max(np.abs(x.r).max() for x in arc.controls) < 100]
    assert sum(arc.last - arc.first for arc in little) > (1 - 1e-6) * answer.lower


def test_above_a_base_load() -> None:
    """A box of 10 N on a table, friction 0.4: pushed sideways it stays up to 4 N."""
    answer = maximum(table(), [1, 0, 0, 0, 0, 0], base=[0, 0, -10, 0, 0, 0], interval=True)
    assert answer.interval.holds_from_zero_to == pytest.approx(4.0, rel=1e-3)
    assert answer.interval.holes == answer.interval.unproved == ()
    assert answer.verify().ok


def test_unbounded_maxima_are_shown_to_their_end() -> None:
    answer = maximum(pinch(), [1, 0, 0, 0, 0, 0], interval=True)
    assert answer.unbounded
    assert answer.interval.holds_from_zero_to == answer.lower
    assert answer.to_json()["holds_from_zero_upper"] is None
    assert answer.verify().ok


def test_without_commands_magnitudes_make_no_difference() -> None:
    answer = maximum(pinch().with_preload(None), [1, 0, 0, 0, 0, 0], interval=True)
    assert answer.unbounded
    assert answer.interval.holds_from_zero_to == answer.lower
    assert answer.interval.arcs == answer.interval.slips == ()
    assert answer.verify().ok


def test_limits_without_commands_are_one_ray() -> None:
    """Nothing but the load and a limit: multiples of one state."""
    answer = maximum(table(), [0, 0, -1.0, 0, 0, 0], limits=GraspLimits(force_limit=5.0), interval=True)
    assert answer.interval.holds_from_zero_to == answer.lower > 0
    (ray,) = answer.interval.arcs
    assert not any(getattr(ray.controls[0], name).any() for name in ("r", "q", "c", "f"))
    assert answer.verify().ok


@pytest.mark.slow
def test_a_hole_is_a_hole(holed: tuple[Grasp, np.ndarray, MaxAnswer]) -> None:
    grasp, direction, answer = holed
    i = answer.interval
    ((first, last),) = i.holes
    assert i.unproved == ()
    assert i.upper == first
    assert 0 < i.holds_from_zero_to < first < last < answer.lower
    for s in (1.001 * first, (first + last) / 2, 0.999 * last):
        assert check(grasp, s * direction).verdict is Verdict.SLIPS
    for s in (0.5 * i.holds_from_zero_to, 0.999 * i.holds_from_zero_to, 0.999 * answer.lower):
        assert check(grasp, s * direction).verdict is Verdict.HOLDS


def test_a_holes_ends_are_as_sharp_as_asked(holed: tuple[Grasp, np.ndarray, MaxAnswer]) -> None:
    """Beside a hole something is resisted within the resolution: no end one sample late, no coarser precision."""
    _, _, answer = holed
    ((first, last),) = answer.interval.holes
    before = max(a.last for a in answer.interval.arcs if a.last <= first)
    after = min(a.first for a in answer.interval.arcs if a.first >= last)
    assert 0 < first - before <= GAP * first
    assert 0 < after - last <= GAP * after
    assert before == answer.interval.holds_from_zero_to


def test_a_finer_gap_gives_sharper_ends(holed: tuple[Grasp, np.ndarray, MaxAnswer]) -> None:
    grasp, direction, coarse = holed
    fine = maximum(grasp, direction, interval=True, settings=Settings(gap=GAP / 10)).interval
    ((first, last),) = fine.holes
    ((outer, end),) = coarse.interval.holes
    assert fine.resolution == GAP / 10
    assert first - fine.holds_from_zero_to <= GAP / 10 * first
    assert outer * (1 - GAP) <= first <= outer * (1 + GAP / 10)  # certified, and as sharp as asked
    assert end <= last * (1 + 1e-9) <= end * (1 + GAP)


@pytest.mark.parametrize("cap", [None, 5.0])
def test_a_hole_is_proved_for_motions_of_any_size(cap: float | None, monkeypatch: pytest.MonkeyPatch) -> None:
    p = scaled_problem.build(pinch(), np.zeros(6), Y6)
    search = _Magnitudes(p, LARGEST_MAGNITUDE, Settings(), lambda w: w.state)
    proof = SimpleNamespace(cap=cap, certificate="of the hole")
    monkeypatch.setattr(search, "_search", lambda *asked: SimpleNamespace(bound=np.inf, proof=proof))
    search._slip(0.25, 0.5)
    assert search.slips == (["of the hole"] if cap is None else [])


def test_magnitudes_count_as_none_by_what_a_checker_takes_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """1 N of friction is 1/10^4 of what it is sought to."""
    search = _Magnitudes(
        scaled_problem.build(pinch(), np.zeros(6), Y6), LARGEST_MAGNITUDE, Settings(), lambda w: w.state
    )
    monkeypatch.setattr(interval_search, "known", lambda *said: said)
    assert search.known(1.0, 2.0)[-1] == pytest.approx(0.1)  # 1000 times 1 N at the tips, over 10^4


def test_a_hole_that_begins_at_nothing() -> None:
    """It resists no small magnitudes, and larger ones: the preload alone slips."""
    case = random_case(3, 504)
    answer = maximum(case.grasp, case.direction, interval=True)
    i = answer.interval
    ((first, last),) = i.holes
    assert (i.holds_from_zero_to, i.upper, first) == (0.0, 0.0, 0.0)
    assert check(case.grasp, np.zeros(6)).verdict is Verdict.SLIPS
    assert check(case.grasp, 0.5 * last * case.direction).verdict is Verdict.SLIPS
    assert check(case.grasp, 0.999 * answer.lower * case.direction).verdict is Verdict.HOLDS
    assert answer.verify().ok


@pytest.mark.parametrize(("push", "weight"), [(2.0, 0.0), (2.0, 0.5), (3.0, 1.0)])
def test_a_hole_by_hand(push: float, weight: float) -> None:
    """A box on a table, and a motor below it that pushes it up: it stays if it is pressed on by the rest of the push.

    Contacts only push, and the motor's gearing carries more than its command, never less: with the weight, s has to
    be as large as the push at least. Any more is resisted.
    """
    contacts = [*table().contacts, Contact(np.zeros(3), np.array([0, 0, 1.0]), 0.4)]
    lift = GraspJoint("lift", np.array([0, 0, 1.0]), np.zeros(3), (4,), "prismatic")
    grasp = Grasp(contacts, [lift], preload={"lift": push}, name="lifted")
    answer = maximum(grasp, [0, 0, -1.0, 0, 0, 0], base=[0, 0, -weight, 0, 0, 0], interval=True)
    i, end = answer.interval, push - weight
    assert answer.unbounded
    assert (i.holds_from_zero_to, i.upper, i.unproved) == (0.0, 0.0, ())
    ((first, last),) = i.holes
    assert first == 0.0
    assert end - GAP * push <= last < end
    assert min(a.first for a in i.arcs) == pytest.approx(end, abs=GAP * push)
    assert max(a.last for a in i.arcs) == answer.lower
    assert answer.verify().ok


def test_what_a_time_limit_leaves_is_said(holed: tuple[Grasp, np.ndarray, MaxAnswer]) -> None:
    answer = holed[2]
    settings = Settings(timeout=1e-6)
    left = resisted(*answer.posed, answer.lower, answer.upper, answer.witness.state, settings)
    assert left.unproved == ((0.0, answer.lower),)
    assert (left.holds_from_zero_to, left.holes) == (0.0, ())


@pytest.mark.parametrize("searches", [1, 5])
def test_ctrl_c_leaves_an_answer(
    searches: int, holed: tuple[Grasp, np.ndarray, MaxAnswer], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The maximum stays, and what was shown until then; of the rest nothing is said."""
    grasp, direction, whole = holed
    search, begun = _Magnitudes._search, []

    def pressed(*of: Any) -> Outcome:
        begun.append(of)
        if len(begun) == searches:
            interrupt(monkeypatch, "handfast.stability.search.search.Search._run")
        return search(*of)

    monkeypatch.setattr(_Magnitudes, "_search", pressed)
    answer = maximum(grasp, direction, interval=True)
    assert len(begun) == searches
    assert (answer.verdict, answer.stop) == (Verdict.HOLDS, Stop.INTERRUPTED)
    assert (answer.lower, answer.upper) == (whole.lower, whole.upper)
    i = answer.interval
    assert i.unproved
    if searches == 1:
        assert (i.unproved, i.holds_from_zero_to, i.arcs, i.slips) == (((0.0, answer.lower),), 0.0, (), ())
    parts = sorted(
        [(a.first, a.last) for a in i.arcs] + [c.question.magnitudes(c.scalar) for c in i.slips] + list(i.unproved)
    )
    assert (parts[0][0], max(last for _, last in parts)) == (0.0, pytest.approx(answer.lower, rel=1e-12))
    assert all(first - last <= GAP * max(first, 1.0) for (_, last), (first, _) in pairwise(parts))
    assert answer.verify().ok


@pytest.mark.parametrize("seed", range(702, 705))
@pytest.mark.slow
def test_laws_over_fresh_grasps(seed: int) -> None:
    """What is shown is so: everything up to the bound holds, holes slip, and together they leave nothing unsaid."""
    case = random_case(3 + seed % 2, seed)
    answer = maximum(case.grasp, case.direction, interval=True)
    assert answer.verdict is not Verdict.UNDECIDED
    if answer.verdict is Verdict.SLIPS:
        assert answer.interval is None
        return
    i = answer.interval
    assert answer.verify().ok
    rng = np.random.default_rng(seed)
    for share in (0.999, *rng.uniform(0, 1, 4)):
        assert (
            i.holds_from_zero_to == 0
            or check(case.grasp, share * i.holds_from_zero_to * case.direction).verdict is Verdict.HOLDS
        )
    for first, last in i.holes:
        for s in rng.uniform(first, last, 3):
            assert check(case.grasp, s * case.direction).verdict is Verdict.SLIPS
    parts = sorted(
        [(a.first, a.last) for a in i.arcs] + [c.question.magnitudes(c.scalar) for c in i.slips] + list(i.unproved)
    )
    assert parts[0][0] == 0.0
    assert max(last for _, last in parts) == pytest.approx(answer.lower, rel=1e-12)
    for (_, last), (first, _) in pairwise(parts):
        assert first - last <= GAP * max(first, 1.0)


# --- maps ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def holed_map() -> MapAnswer:
    """Forces both ways along an axis, in one of which directions the grasp has a hole: along x once it is turned."""
    grasp = random_case(3, 510).grasp
    turned = moved(grasp, np.eye(3)[[2, 0, 1]], np.zeros(3), list(range(grasp.m)), 1.0, 1.0)
    return force_map(turned, "xz", steps=2, interval=True, jobs=1)


@pytest.mark.slow
def test_a_map_says_what_its_maxima_say(holed_map: MapAnswer) -> None:
    curve = holed_map.preloaded
    said = curve.to_json()
    assert any(said["holes"])
    shown = maximum(holed_map.grasp, [*holed_map.directions[0], 0, 0, 0], interval=True).interval
    assert shown is not None
    assert said["holds_from_zero_to"][0] == pytest.approx(shown.holds_from_zero_to, rel=2 * GAP)
    (mine,), (its,) = said["holes"][0], shown.holes
    assert mine == pytest.approx(its, rel=2 * GAP)


@pytest.mark.slow
def test_holes_are_in_the_table_and_crossed_out_in_the_picture(holed_map: MapAnswer) -> None:
    head, *lines = map_csv(holed_map).splitlines()
    column = head.split(",").index("holes_with_preload")
    holes = [h.holes if h else () for h in holed_map.preloaded.intervals]
    assert [line.split(",")[column] for line in lines] == [" ".join(f"{a!r}:{b!r}" for a, b in h) for h in holes]
    crossed = [p for p in draw_map(holed_map).axes[0].patches if p.get_hatch() == "xxxx"]
    assert len(crossed) == sum(map(len, holes)) + sum(len(h.holes) for h in holed_map.passive.intervals if h)


def test_a_map_that_was_not_asked_says_nothing_of_holes() -> None:
    plain = force_map(random_case(3, 510).grasp, "xz", steps=2, jobs=1)
    assert "holes" not in plain.to_json()["with_preload"]
    assert "holes" not in map_csv(plain)


# --- words --------------------------------------------------------------------------------------------


def test_the_words_of_a_hole(holed: tuple[Grasp, np.ndarray, MaxAnswer]) -> None:
    _, direction, answer = holed
    i, unit = answer.interval, words.magnitude(direction)
    text = sentences.interval_sentence(answer, direction)
    ((first, last),) = i.holes
    assert f"Everything from 0 to {words.num(unit[0] * i.holds_from_zero_to)} {unit[1]} is resisted" in text
    assert f"slips from {words.num(unit[0] * first)} to {words.num(unit[0] * last)} {unit[1]}" in text
    assert "largest" in sentences.max_sentence(answer, direction)


def test_check_does_not_call_too_much_what_is_too_little(
    holed: tuple[Grasp, np.ndarray, MaxAnswer], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    grasp, direction, answer = holed
    save_grasp(grasp, tmp_path / "grasp.json")
    ((first, last),) = answer.interval.holes
    for size, says, not_this in (
        ((first + last) / 2, "More of this disturbance is resisted", "too much"),
        (1.1 * answer.upper, "too much", "More of"),
    ):
        main(["check", str(tmp_path / "grasp.json"), "--wrench", *map(repr, (size * direction).tolist())])
        out = " ".join(capsys.readouterr().out.split())
        assert "SLIPS" in out
        assert says in out
        assert not_this not in out


def test_a_saved_answer_is_proved(holed: tuple[Grasp, np.ndarray, MaxAnswer], tmp_path: Path) -> None:
    answer = holed[2]
    answer.save(tmp_path / "holed.json")
    done = verify(tmp_path / "holed.json")
    assert done.ok, done.reason
    part = done.part("interval")
    assert part is not None
    assert part.figures["arcs"] == len(answer.interval.arcs)
    assert part.figures["slips"] == len(answer.interval.slips) == 1
    assert part.figures["residual"] <= VALID


def test_no_hole_where_the_cap_on_motions_made_one() -> None:
    """fig1 along +z: up to motions of 10^4 it slipped from 1.59 to 2.149; with larger ones it resists all of that."""
    grasp = load_grasp("fig1")
    for magnitude in (1.6, 1.8, 2.1):  # all of them at once: `handfast max fig1 --direction 0 0 1 --interval`
        witness = check(grasp, [0, 0, magnitude, 0, 0, 0]).witness
        assert witness.valid
        assert np.abs(witness.state.r[:3]).max() > 1e3
