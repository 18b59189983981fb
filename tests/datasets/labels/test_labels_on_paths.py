"""Labels of loads that come after the commands: verdicts, commands and maxima are those of paths, proved again so."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import InputError, verify
from handfast.core.answer import Verdict
from handfast.datasets.labels import verify_labels
from handfast.datasets.labels.label_dataset import label_dataset
from handfast.datasets.labels.labeller import Labelling, label
from handfast.datasets.labels.questions import LargestLoad, Questions
from handfast.readers.grasp_file import to_dict
from handfast.stability.studies.questions import check
from tests.support.jaws_on_paths import FIRST, jaw
from tests.support.labelled import write_lines

pytestmark = pytest.mark.usefixtures("asked_once", "proved_once")
BACK = (-1.0, 1.0, 0.0)  # pushes the jaw back and across: together 1/2 of its command times this, on the path 2/3
LITTLE = Labelling(directions=1, gap=1e-2, gravity=(BACK,), loading=FIRST)
LIGHT, HEAVY = 0.85, 1.2  # [N] up to 0.707 is held together, up to 0.943 on the path


def weighing(newton: float) -> dict[str, Any]:
    return to_dict(jaw()) | {"mass": newton / 9.81, "center_of_mass": [0, 0, 0]}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a dataset of both weights, and its table.

    It is the same jaw, so that the same directions have the same ends: they are asked about once.
    """
    folder, ask, known = tmp_path_factory.mktemp("paths"), Questions.largest, {}

    def once(self: Questions, directions: list[np.ndarray]) -> list[LargestLoad]:
        key = np.array(directions).tobytes()
        if key not in known:
            known[key] = ask(self, directions)
        return known[key]

    dataset = write_lines(folder / "grasps.jsonl", weighing(LIGHT), weighing(HEAVY))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Questions, "largest", once)
        label_dataset(dataset, folder / "labels.jsonl", labelling=LITTLE, jobs=1)
    return folder


def rows(made: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (made / "labels.jsonl").read_text().splitlines()]


@pytest.mark.slow
def test_a_row_is_what_the_verbs_say_of_paths(made: Path) -> None:
    """By hand 2/3 times (-1, 1, 0) is reached, 0.943 N; across both sides rub with 1/2 each."""
    light, heavy = rows(made)
    assert (heavy["verdict"], heavy["held_by"]) == ("slips", "others")
    assert json.loads((made / "labels.jsonl.about.json").read_text())["questions"]["loading"] == FIRST
    assert (light["verdict"], light["verdicts"], light["held_by"]) == ("holds", ["holds"], "these")
    assert light["weight_factor"] == pytest.approx(2 / 3 * np.sqrt(2) / LIGHT, rel=1e-2)
    assert (
        light["weight_factor"] <= 2 / 3 * np.sqrt(2) / LIGHT * (1 + 1e-9) <= light["weight_factor_upper"] * (1 + 2e-9)
    )
    assert light["max_plus_fy"] == pytest.approx(1.0, rel=1e-2)
    assert light["max_plus_fx_upper"] is None
    assert (light["max_plus_tx"], light["max_plus_tx_upper"]) == (0, 0)
    assert (light["commands"], light["largest_command"], light["largest_command_lower"]) == ([1.0], 1.0, None)
    assert heavy["weight_factor"] == pytest.approx(light["weight_factor"] * LIGHT / HEAVY, rel=1e-6)
    w = np.r_[LIGHT * np.array(BACK) / np.sqrt(2), 0, 0, 0]
    assert check(jaw(), w, loading=FIRST).verdict is Verdict.HOLDS
    assert check(jaw(), w).verdict is Verdict.SLIPS


def ends_unasked(self: Questions, directions: list[np.ndarray]) -> list[LargestLoad]:
    """In place of what takes most of the time, where nothing is said of it."""
    return [LargestLoad(0.0, np.inf, False) for _ in directions]


def test_other_commands_hold_on_the_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """1.2 N ask for 1.2 / 0.943 = 1.273 N on the path, and for 1.697 N together. That less would not do is not said."""
    monkeypatch.setattr(Questions, "largest", ends_unasked)
    heavy = label(jaw().about(mass=HEAVY / 9.81, center_of_mass=(0, 0, 0)), LITTLE)
    assert (heavy["verdict"], heavy["held_by"]) == ("slips", "others")
    assert heavy["holding_commands"] == [pytest.approx(1.273, rel=1e-2)]
    assert heavy["holding_commands"][0] > 1.2727
    assert heavy["largest_command"] == heavy["holding_commands"][0]
    assert heavy["largest_command_lower"] is None


@pytest.mark.slow
def test_all_of_a_row_is_asked_again_on_paths(made: Path) -> None:
    done = verify(made / "labels.jsonl", replay=True, dataset=made / "grasps.jsonl", rows=[1], jobs=1)
    assert done.ok, done.reason


def test_another_loading_is_another_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Questions, "largest", ends_unasked)
    dataset, table = write_lines(tmp_path / "grasps.jsonl", weighing(LIGHT)), tmp_path / "labels.jsonl"
    label_dataset(dataset, table, labelling=LITTLE, jobs=1)
    label_dataset(dataset, table, labelling=LITTLE, jobs=1, resume=True)
    with pytest.raises(InputError, match="is of another dataset or of other questions"):
        label_dataset(dataset, table, labelling=replace(LITTLE, loading="together"), jobs=1, resume=True)


def test_tables_without_paths_say_nothing_of_them() -> None:
    from handfast.core.schema import written

    assert "loading" not in written(Labelling().questions)
    with pytest.raises(InputError, match="'later'; 'preload-first' or 'together'"):
        Labelling(loading="later")  # type: ignore[arg-type]


def faults(
    made: Path, there: Path, change: Callable[[dict[str, Any]], Any], row: int, loading: str | None = FIRST
) -> str:
    """What is refused of a row after a change, its twelve maxima and its worst direction left out."""
    all_rows, about = rows(made), json.loads((made / "labels.jsonl.about.json").read_text())
    change(all_rows[row])
    if loading is None:
        del about["questions"]["loading"]
    (there / "labels.jsonl.about.json").write_text(json.dumps(about))
    table = write_lines(there / "labels.jsonl", *all_rows)
    done = verify(table, replay=True, dataset=made / "grasps.jsonl", rows=[row], jobs=1)
    return "; ".join(f"{part.name}: {part.refused}" for part in done.parts[0].parts if part.refused)


@pytest.mark.slow
def test_what_was_changed_is_refused(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verify_labels._Row, "largest", lambda self: ())
    monkeypatch.setattr(verify_labels._Row, "worst", lambda self, faults: [])
    assert faults(made, tmp_path, lambda row: None, 0) == ""
    together = faults(made, tmp_path, lambda row: None, 0, loading=None)
    assert "verdicts[0]: is 'holds'; asked again, it slips, which is proved" in together
    assert "weight_factor: is 1.10" in together
    less = faults(made, tmp_path, lambda row: row.update(largest_command_lower=0.5), 0)
    assert less == "largest_command_lower: is 0.5; nothing that is known bounds the commands of a path from below"
    none = faults(made, tmp_path, lambda row: row.update(held_by="none", holding_commands=None), 1)
    assert none == "held_by: is 'none'; nothing that is known bounds the commands of a path from below"
    weak = faults(made, tmp_path, lambda row: row.update(holding_commands=[1.2]), 1)
    assert "holding_commands: is 'holds'; asked again, it slips, which is proved" in weak
    more = faults(made, tmp_path, lambda row: row.update(weight_factor=1.2, weight_factor_upper=1.21), 0)
    assert "weight_factor: is 1.2; asked again, nothing above 1.1" in more


@pytest.mark.slow
def test_what_nothing_balances_no_commands_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    """A weight off the line through both contacts turns the object about it."""
    ask = Questions.largest
    monkeypatch.setattr(
        Questions, "largest", lambda self, of: (ask if len(of) == 1 else ends_unasked)(self, of)
    )  # of the weight, not of axes
    off = jaw().about(mass=0.05, center_of_mass=(0, 0, 0.1))
    said = label(off, Labelling(directions=1, gap=1e-1, gravity=((0, 1.0, 0),), loading=FIRST))
    assert (said["verdict"], said["held_by"], said["weight_factor"]) == ("slips", "none", 0)
    assert (said["commands"], said["largest_command_lower"]) == (None, None)


def test_what_slips_on_its_path_is_not_said_to_slip_under_all_commands() -> None:
    questions = Questions(jaw(), LITTLE.settings(2), 60.0, 1e5, FIRST)
    loads = [np.array([-3.0, 9, 0, 0, 0, 0]), np.array([0, 0, 0, 1.0, 0, 0])]
    assert questions.resisted_by_none(loads, (0,)) == (None, {})  # together none do: gearing is pushed back
    assert questions.resisted_by_none(loads, (0, 1)) == (1, {})
    found = questions.commands(loads[0])
    assert (found.commands, found.lower) == (None, 0.0)


def test_a_path_to_the_weight_may_come_farther_than_the_one_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """The verdict is that of the path to the weight; no more is said to be reached than the other bound allows."""
    short = LargestLoad(0.99 * LIGHT, 0.995 * LIGHT, False)
    monkeypatch.setattr(Questions, "largest", lambda self, directions: [short for _ in directions])
    said = label(jaw().about(mass=LIGHT / 9.81, center_of_mass=(0, 0, 0)), LITTLE)
    assert said["verdict"] == "holds"
    assert said["weight_factor"] == said["weight_factor_upper"] == pytest.approx(0.995)


def test_on_paths_each_direction_has_its_own_end(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def ends(self: Questions, directions: list[np.ndarray]) -> list[LargestLoad]:
        asked.append(len(directions))
        return [LargestLoad(1.0 + d[2], 1.0 + d[2], False) for d in directions]

    monkeypatch.setattr(Questions, "largest", ends)
    said = label(jaw(), Labelling(directions=8, loading=FIRST))
    assert sum(asked) == 12 + 8
    assert said["worst_force"] == pytest.approx(1 - 7 / 8)  # z of the lowest of 8 directions
