"""Tables of labels asked again: right ones are proved, changed ones refused, with the row and the column."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import InputError, verify
from handfast.datasets.dataset_rows import GraspChanges
from handfast.datasets.labels.label_dataset import label_dataset
from handfast.datasets.labels.labeller import Labelling
from handfast.datasets.labels.verify_labels import CommandsClaim
from handfast.readers.grasp_file import to_dict
from handfast.stability.problem.grasp_limits import AskedWith
from handfast.stability.studies.ask_again import Clock
from tests.support.labelled import write_lines
from tests.support.problems import pinch

pytestmark = pytest.mark.usefixtures("asked_once", "proved_once")
LITTLE = Labelling(directions=2, gap=1e-2, gravity=((0, -1.0, 0),))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a dataset of one grasp and a row that is none, and its table."""
    folder = tmp_path_factory.mktemp("labels")
    dataset = write_lines(folder / "grasps.jsonl", to_dict(pinch()), {"schema": "handfast/grasp/1"})
    changes = GraspChanges(mass=0.05, center_of_mass=(0.0, 0.0, 0.0))
    label_dataset(dataset, folder / "labels.jsonl", labelling=LITTLE, changes=changes, jobs=1)
    return folder


def changed(made: Path, there: Path, change: Callable[[dict[str, Any]], Any]) -> Path:
    """The table with a change of its first row."""
    first, *rest = (made / "labels.jsonl").read_text().splitlines()
    row = json.loads(first)
    change(row)
    about = (made / "labels.jsonl.about.json").read_text()
    (there / "labels.jsonl.about.json").write_text(about)
    return write_lines(there / "labels.jsonl", row, *rest)


def asked(table: Path, made: Path, **limits: Any) -> Any:
    return verify(table, replay=True, dataset=made / "grasps.jsonl", jobs=1, **limits)


def test_a_table_is_proved(made: Path) -> None:
    done = asked(made / "labels.jsonl", made)
    assert done.ok, done.reason
    assert [part.name for part in done.parts] == ["row 0"]
    assert "rows that could not be labelled: 1" in done.not_replayed
    assert asked(made / "labels.jsonl", made, rows=[1]).parts == ()


@pytest.mark.slow
def test_what_was_changed_is_refused(made: Path, tmp_path: Path) -> None:
    """All at once. The weight is 0.49 N; 1 N is held across, 1.29 N in the worse of the two directions."""
    forged = {
        "max_plus_fy": 1.2, "max_plus_fy_upper": 1.3, "max_minus_fy": 0.2, "max_minus_fy_upper": 0.3,
        "max_plus_tx": 1.0, "max_plus_tx_upper": None, "verdicts": ["slips"], "verdict": "slips",
        "weight_factor": 3.0, "weight_factor_upper": 3.1, "worst_force": 3.0, "worst_force_upper": 3.1,
        "largest_command_lower": 0.2,
    }  # fmt: skip
    done = asked(changed(made, tmp_path, lambda row: row.update(forged)), made)
    faults = [f"{part.name}: {part.refused}" for part in done.parts[0].parts if part.refused]
    whys = [
        r"max_plus_fy: is 1\.2; asked again, nothing above 1\.0\d* is resisted, which is proved",
        r"max_plus_tx: is 1; asked again, no forces at the contacts balance it",
        r"max_minus_fy_upper: is 0\.3; asked again, (0\.99|1)\d* is resisted, which is proved",
        r"worst_force: is 3; asked again, nothing above 1\.\d* is resisted, which is proved",
        r"verdicts\[0\]: is 'slips'; asked again, it holds, which is proved",
        r"weight_factor: is 3; asked again, nothing above 2\.\d* is resisted, which is proved",
        r"largest_command_lower: is 0\.2; asked again, commands of 0\.04\d* hold, which is proved",
        r"held_by: is 'these'; with the verdict 'slips' it is none or others or undecided",
    ]
    for why in whys:
        assert any(re.match(why, fault) for fault in faults), (why, faults)
    assert {fault.split(":")[0] for fault in faults} == {why.split(":")[0].replace("\\", "") for why in whys}


@pytest.mark.parametrize(
    ("forged", "why"),
    [
        ({"verdicts": ["slips"]}, "verdict: is 'holds'; the verdicts say 'slips'"),
        ({"worst_direction": [0.0, 1.0, 0.0]}, "worst_direction: is .*, none of those that were asked"),
        ({"preload": [0.3, 0.1]}, "preload: is .*; that of the dataset is"),
        ({"mass": 0.01}, "mass: is 0.01; that of the dataset is 0.05"),
        ({"isotropy": 0.9}, "isotropy: is 0.9; measured anew it is"),
        ({"row": 1}, "row: is 1; that of the dataset is 0"),
    ],
)
def test_what_contradicts_itself_or_the_dataset_is_refused(
    forged: dict[str, Any], why: str, made: Path, tmp_path: Path
) -> None:
    done = asked(changed(made, tmp_path, lambda row: row.update(forged)), made, timeout=1e-9)
    assert re.match(f"row 0: {why}", done.fault), done.fault


@pytest.mark.parametrize(
    ("commands", "lower", "upper", "why"),
    [
        ([0.06, 0.06], 0.048, 0.06, ""),
        ([0.04, 0.04], 0.0, 0.04, "asked again, the weight slips under them, which is proved"),
        ([0.06, 0.06], 0.0, 0.05, "is 0.05; the largest of the commands is 0.06"),
        ([0.06, 0.06], 0.052, 0.06, "is 0.052; asked again, commands of 0.05"),
        (None, 0.06, np.inf, "is 0.06; asked again, commands of 0.05"),
        (None, 0.0, 0.05, "is 0.05, without commands"),
    ],
)
def test_commands(commands: list[float] | None, lower: float, upper: float, why: str) -> None:
    """0.5 N across: 0.05 N m at arms of 0.1 m and a friction of 0.5."""
    load, given = np.array([0, 0.5, 0, 0, 0, 0]), None if commands is None else np.array(commands)
    claim = CommandsClaim("commands", pinch(), load, AskedWith(), given, lower, upper)
    faults = [told.refused for told in claim.ask(Clock(np.inf, np.inf, 1)) if not told.ok]
    assert [fault[: len(why)] for fault in faults] == ([why] if why else [])


def test_without_time_it_is_undecided(made: Path) -> None:
    done = asked(made / "labels.jsonl", made, timeout=1e-9)
    assert (done.fault, done.open) == ("", "row 0: not asked: no time was left to ask again")


def test_what_it_needs(made: Path, tmp_path: Path) -> None:
    table = made / "labels.jsonl"
    with pytest.raises(InputError, match="which keeps no proofs; ask again: handfast verify FILE --replay --dataset"):
        verify(table)
    with pytest.raises(InputError, match="--dataset: is missing"):
        verify(table, replay=True)
    other = write_lines(tmp_path / "other.jsonl", to_dict(pinch(0.4)))
    with pytest.raises(InputError, match=r"other\.jsonl: is not the dataset of labels\.jsonl"):
        verify(table, replay=True, dataset=other)
    with pytest.raises(InputError, match="--row: is 2; rows 0 to 1 are there"):
        asked(table, made, rows=[2])
    bare = write_lines(tmp_path / "bare.jsonl", {})
    with pytest.raises(InputError, match=r"has no metadata .*; bare\.jsonl\.about\.json has to be beside it"):
        asked(bare, made)
    short = changed(made, tmp_path, lambda row: None)
    short.write_text(short.read_text().splitlines()[0] + "\n")
    with pytest.raises(InputError, match=r"labels\.jsonl: has 1 rows, its dataset 2"):
        asked(short, made)


@pytest.fixture(scope="module")
def weak(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """As `made`, of a grasp without commands and of one without friction."""
    folder = tmp_path_factory.mktemp("weak")
    dataset = write_lines(folder / "grasps.jsonl", to_dict(pinch().with_preload(None)), to_dict(pinch(0.0)))
    changes = GraspChanges(mass=0.05, center_of_mass=(0.0, 0.0, 0.0))
    label_dataset(dataset, folder / "labels.jsonl", labelling=LITTLE, changes=changes, jobs=1)
    return folder


def test_which_commands_hold_is_proved(weak: Path) -> None:
    rows = [json.loads(line) for line in (weak / "labels.jsonl").read_text().splitlines()]
    assert [row["held_by"] for row in rows] == ["others", "none"]
    done = asked(weak / "labels.jsonl", weak)
    assert done.ok, done.reason


@pytest.mark.parametrize(
    ("forged", "why"),
    [
        (
            {"held_by": "none", "holding_commands": None},
            "held_by: is 'none'; asked again, each load is resisted under some",
        ),
        ({"held_by": "these"}, "held_by: is 'these'; with the verdict 'slips' it is none or others or undecided"),
        ({"holding_commands": None}, "holding_commands: is null, where held_by is 'others'"),
        ({"holding_commands": [0.01, 0.01]}, "holding_commands: is 'holds'; asked again, it slips, which is proved"),
    ],
)
def test_false_words_about_other_commands_are_refused(
    forged: dict[str, Any], why: str, weak: Path, tmp_path: Path
) -> None:
    done = asked(changed(weak, tmp_path, lambda row: row.update(forged)), weak)
    faults = [f"{part.name}: {part.refused}" for part in done.parts[0].parts if part.refused]
    assert any(fault.startswith(why) for fault in faults), faults
