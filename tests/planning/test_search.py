"""What the three planners share: counts of candidates, those that differ, and the folder that keeps them."""

from __future__ import annotations

from pathlib import Path

import pytest

from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.planning.results.folder import SearchFolder
from handfast.planning.search import Gathering, Journal, RejectionReason, Tally, UnitResult, of_verdict

REASONS = RejectionReason.SLIPS, RejectionReason.PENETRATES, RejectionReason.ALIKE


def near(a: float, b: float) -> bool:
    return abs(a - b) < 1


def unit(*found: float, slipped: int = 0) -> UnitResult[float]:
    tally = Tally(len(found))
    tally.add(RejectionReason.SLIPS, slipped)
    return UnitResult(tally, found)


def test_candidates_are_counted_by_reason_in_the_order_in_which_reasons_come_up() -> None:
    tally = Tally()
    tally.add(None, 3)
    tally.add(RejectionReason.PENETRATES, 2, "by 5 mm")
    tally.add(RejectionReason.SLIPS)
    tally.add(RejectionReason.PENETRATES, 1, "by 7 mm")
    tally.add(RejectionReason.STRONG, 0)
    assert (tally.passed, tally.total) == (3, 7)
    assert [tally[r] for r in REASONS] == [1, 3, 0]
    assert [(e["count"], e["example"]) for e in tally.examples()] == [(3, "by 5 mm"), (1, "")]
    assert tally.to_json("kept", REASONS) == {"kept": 3, "slips": 1, "penetrates": 3, "alike": 0}
    again = Tally.from_json(tally.to_json("kept", REASONS), "kept", REASONS)
    assert [again[r] for r in RejectionReason] == [tally[r] for r in RejectionReason]
    assert again.passed == 3
    other = tally.copy()
    other.recount(RejectionReason.ALIKE)
    assert (other.passed, other[RejectionReason.ALIKE], other.total) == (2, 1, 7)
    assert tally[RejectionReason.ALIKE] == 0


def test_a_verdict_is_a_reason_or_none() -> None:
    assert of_verdict(Verdict.HOLDS) is None
    assert of_verdict(Verdict.SLIPS) is RejectionReason.SLIPS
    assert of_verdict(Verdict.UNDECIDED) is RejectionReason.UNDECIDED


def test_names_of_reasons_are_those_of_the_files() -> None:
    assert len({r.value for r in RejectionReason}) == len(RejectionReason)


def test_what_differs_is_kept_until_there_is_enough() -> None:
    gathered = Gathering(2, near)
    assert gathered.take(unit(0.0, 0.5, slipped=2))
    assert not gathered.take(unit(0.9))
    assert not gathered.enough
    assert gathered.take(unit(3.0, 6.0))
    assert (gathered.kept, gathered.enough, gathered.beyond) == ([0.0, 3.0], True, True)
    tally = gathered.tally
    assert (tally.passed, tally[RejectionReason.ALIKE], tally[RejectionReason.SLIPS]) == (3, 2, 2)


def test_what_is_better_takes_the_place_of_the_worst() -> None:
    gathered = Gathering(2, near, value=lambda x: -x)
    assert gathered.take(unit(5.0, 3.0))
    assert not gathered.take(unit(9.0))
    assert gathered.take(unit(0.0))
    assert gathered.kept == [3.0, 0.0]
    assert gathered.take(unit(2.5))  # like 3
    assert not gathered.take(unit(0.5))  # like 0
    assert (gathered.kept, gathered.beyond) == ([0.0, 2.5], True)
    assert gathered.tally[RejectionReason.ALIKE] == 2


def test_a_search_goes_on_with_what_it_had() -> None:
    before = Tally(1)
    gathered = Gathering(2, near, before, [0.0])
    gathered.take(unit(0.1, 5.0))
    assert gathered.kept == [0.0, 5.0]
    assert (before.passed, gathered.tally.total) == (1, 3)


class Kept(SearchFolder[int]):
    holds = "numbers"
    files = ("number-[0-9]*.txt",)

    def write(self, state: int) -> None:
        (self.path / f"number-{state}.txt").write_text(str(state))


def test_a_folder_is_written_at_once_for_what_is_new_and_now_and_then_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard: list[int] = []
    clock = iter([10.0, 10.0, 11.0, 11.5, 13.0, 13.0, 13.0])
    monkeypatch.setattr("handfast.planning.results.folder.time.monotonic", lambda: next(clock))
    folder = Kept(tmp_path, on_progress=heard.append)
    for state, new in ((1, False), (2, False), (3, True), (4, False)):
        folder.note(state, new=new)
    folder.close(5)
    assert heard == [1, 2, 3, 4]
    assert sorted(f.name[7:8] for f in tmp_path.iterdir()) == ["1", "3", "5"]


@pytest.mark.parametrize(
    ("resume", "force", "match"),
    [
        (False, False, "holds numbers already; give --resume to go on, or --force to write over it"),
        (True, True, "give either --resume or --force"),
    ],
)
def test_a_folder_that_was_begun_is_not_filled_anew(tmp_path: Path, resume: bool, force: bool, match: str) -> None:
    Kept.refuse(tmp_path, resume=resume, force=force and not resume)
    (tmp_path / "number-1.txt").write_text("1")
    for yes in ({"resume": True, "force": False}, {"resume": False, "force": True}):
        Kept.refuse(tmp_path, **yes)
    with pytest.raises(InputError, match=match):
        Kept.refuse(tmp_path, resume=resume, force=force)


def test_a_folder_is_needed_to_go_on_from(tmp_path: Path) -> None:
    Kept.refuse(None, resume=False, force=False)
    with pytest.raises(InputError, match="--resume: needs the folder to go on from"):
        Kept.refuse(None, resume=True, force=False)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file; a folder is needed"):
        Kept.refuse(tmp_path / "file", resume=False, force=False)


def test_a_journal_without_a_folder_keeps_nothing() -> None:
    heard: list[int] = []
    journal: Journal[int] = Journal(heard.append)
    assert journal.earlier("any question") is None
    journal.note(1, new=True)
    journal.close(2)
    assert heard == [1]
    Journal().note(1, new=True)
