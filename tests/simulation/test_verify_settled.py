"""A settled grasp asked again: the verdicts before and after, and how much is resisted; the path proves nothing."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest

from handfast.proofs.fields import BadFile
from handfast.readers.grasp_file import to_dict
from handfast.simulation.settled import COURSE_NOT_REPLAYED, replay_settled
from handfast.stability.studies.ask_again import NO_TIME, Asking
from tests.support.problems import pinch

pytestmark = pytest.mark.usefixtures("asked_once")
ALONE = Asking(jobs=1)


def settled(**changed: Any) -> dict[str, Any]:
    """1.5 N along y slips from a pinch of 1 N; one of 2 N holds it, and up to 2 N."""
    data = {
        "schema": "handfast/settled/1", "rest": "settles", "grasp": "pinch", "wrench": [0, 1.5, 0, 0, 0, 0],
        "before": "slips", "onset": 0.7, "onset_of": "load", "moved": 0.01, "turned": 0.0, "confirmed": True,
        "after": "holds", "last_wrench": [0, 1.5, 0, 0, 0, 0], "most": [1.333, 1.334], "simulated": None, "notes": [],
        "seconds": 1.0, "joints": [], "path": [], "first": to_dict(pinch()), "last": to_dict(pinch(torque=0.2)),
    }  # fmt: skip
    return json.loads(json.dumps(data | changed))


def test_it_is_proved_but_for_its_path() -> None:
    done = replay_settled(settled(), ALONE)
    assert done.ok, done.reason
    assert [(part.name, part.claim) for part in done.parts] == [
        ("first", "what is said of the first grasp under its load: 1 claim"),
        ("last", "what is said of the last grasp under its load: 3 claims"),
    ]
    assert COURSE_NOT_REPLAYED in done.not_replayed


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"before": "holds"}, "first: before: is 'holds'; asked again, it slips, which is proved"),
        (
            {"after": "slips", "confirmed": False, "rest": "rests"},
            "last: after: is 'slips'; asked again, it holds, which is proved",
        ),
        ({"after": "slips"}, "rest: is 'settles'; before is 'slips', after is 'slips'"),
        ({"confirmed": False}, "confirmed: is false; after is 'holds'"),
        ({"rest": "leaves"}, "rest: is 'leaves'"),
        ({"most": [1.4, 1.5]}, r"last: most\[0\]: is 1\.4; asked again, nothing above 1\.33"),
        ({"most": [1.0, 1.1]}, r"last: most\[1\]: is 1\.1; asked again, 1\.33\d* is resisted, which is proved"),
        ({"last_wrench": [0, 2.5, 0, 0, 0, 0], "most": None}, "last: after: is 'holds'; asked again, it slips"),
        ({"last_wrench": [0, 1, 0, 1, 0, 0], "most": None}, "last: after: is 'holds'; asked again, it slips"),
        ({"last": to_dict(pinch())}, "last: after: is 'holds'; asked again, it slips"),
    ],
)
@pytest.mark.slow
def test_what_was_changed_is_refused(changed: dict[str, Any], why: str) -> None:
    done = replay_settled(settled(**changed), ALONE)
    assert re.match(why, done.fault), done.fault


@pytest.mark.slow
def test_what_no_forces_balance_slips() -> None:
    """A torque about the line through both contacts: nothing there can give one."""
    about = {"before": "slips", "wrench": [0, 0, 0, 1, 0, 0]}
    assert replay_settled(settled(**about), ALONE).part("first").ok  # type: ignore[union-attr]
    fault = replay_settled(settled(**about | {"before": "holds"}), ALONE).fault
    assert fault == "first: before: is 'holds'; asked again, it slips, which is proved"


def test_without_time_it_is_undecided() -> None:
    done = replay_settled(settled(), Asking(jobs=1, timeout=1e-9))
    assert (done.fault, done.open) == ("", f"first: not asked: {NO_TIME}")


@pytest.mark.parametrize(
    ("changed", "line"),
    [
        ({"rest": "rolls"}, "rest: is 'rolls'"),
        ({"last": None}, "after: is there with `last`, and only then"),
        ({"last": None, "after": None, "last_wrench": None}, "most: is there with `last`, and only then"),
        ({"most": [1.0]}, "most: is no pair of bounds"),
        ({"colour": "red"}, "colour: is not a known field"),
    ],
)
def test_files_that_are_none(changed: dict[str, Any], line: str) -> None:
    with pytest.raises(BadFile, match=re.escape(line)):
        replay_settled(settled(**changed), ALONE)
