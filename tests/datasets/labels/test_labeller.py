"""A label says what the questions answer, one by one, and what follows by hand."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.grasps import random_case
from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.datasets.labels.label_columns import (
    COLUMN_NAMES,
    LABEL_COLUMNS,
    MEASURES,
    WRENCHES,
    complete,
    wrench_column,
)
from handfast.datasets.labels.labeller import LABEL_DIRECTIONS, Labelling, label, spread
from handfast.datasets.labels.questions import LargestLoad, LeastCommands, Questions
from handfast.measures.catalogue import CATALOGUE
from handfast.measures.measuring import measure
from handfast.model.grasp import Grasp
from handfast.readers.grasp_file import from_dict
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check, maximum, torques
from tests.support.labelled import MASS, fixture, heavy
from tests.support.problems import pinch

WEIGHT = MASS * 9.81


@pytest.fixture(scope="module")
def grasp() -> Grasp:
    """Random, of three contacts, that some weights make slip."""
    return random_case(3, 16).grasp.about(mass=MASS, center_of_mass=(0.01, 0, -0.02))


def at_center(force: np.ndarray) -> np.ndarray:
    return np.r_[force, np.cross([0.01, 0, -0.02], force)]


def test_columns_are_what_the_questions_answer(grasp: Grasp) -> None:
    said = complete(label(grasp, Labelling(directions=6)) | {"row": 0})
    assert said["contacts"] == 3
    assert said["center"] == [0.01, 0, -0.02]
    for name in WRENCHES[::5]:
        axis = (1 if name[0] == "+" else -1) * np.eye(3)["xyz".index(name[2])]
        wrench = at_center(axis) if name[1] == "f" else np.r_[np.zeros(3), axis]
        best = maximum(grasp, wrench)
        low, high = said[wrench_column(name)], said[f"{wrench_column(name)}_upper"]
        assert low <= best.upper * (1 + 1e-9)
        assert best.lower <= (np.inf if high is None else high) * (1 + 1e-9)
    verdicts = [check(grasp, WEIGHT * at_center(np.array(d))).verdict for d in LABEL_DIRECTIONS]
    assert said["verdicts"] == [str(v) for v in verdicts]
    assert said["verdict"] == ("slips" if Verdict.SLIPS in verdicts else "holds")
    least = min(said[wrench_column(f"{s}f{a}")] for s in "+-" for a in "xyz")
    assert said["weight_factor"] == pytest.approx(least / WEIGHT)
    best = torques(grasp, WEIGHT * at_center(np.array(said["hardest"])))
    assert said["largest_command"] == pytest.approx(best.upper, rel=2e-3)
    assert said["largest_command_lower"] <= best.upper


def test_measures_are_those_of_the_command(grasp: Grasp) -> None:
    said, measured = label(grasp, Labelling(directions=1)), measure(grasp, passive=False)
    units = {m.key: m.unit for m in CATALOGUE}
    for column in MEASURES:
        assert said[column.name] == measured[column.name]
        assert column.unit == units[column.name]
    assert said["force_closure"] in (0, 1)
    assert said["force_closure"] is not True
    alone = label(from_dict(fixture()), Labelling(directions=1))  # nothing presses down
    assert (alone["force_closure"], alone["epsilon_l1"]) == (0, 0.0)


def test_the_worst_direction_is_that_of_all_maxima(grasp: Grasp) -> None:
    """The shortcut by checks against every maximum."""
    said = label(grasp, Labelling(directions=9))
    best = [maximum(grasp, at_center(d)) for d in spread(9)]
    assert said["worst_force"] == pytest.approx(min(b.lower for b in best), rel=3e-3)
    assert said["worst_force"] <= min(b.upper for b in best) * (1 + 1e-9)
    worst = int(np.argmin([b.upper for b in best]))
    assert np.allclose(said["worst_direction"], spread(9)[worst])


def test_a_table_by_hand() -> None:
    """It presses up only: any weight downwards, none upwards, and sideways none without a weight."""
    said = label(from_dict(fixture()), Labelling(directions=1, gravity=((0, 0, -2.0), (0, 0, 1.0))))
    assert said["verdicts"] == ["holds", "slips"]
    assert said["verdict"] == "slips"
    assert said["max_minus_fz_upper"] is None
    assert said["max_minus_fz"] > 1e3
    assert said["max_plus_fz"] == said["max_plus_fz_upper"] == said["max_plus_fx"] == 0
    assert said["weight_factor"] == 0
    assert said["hardest"] == [0, 0, 1]
    assert said["commands"] is None
    assert label(from_dict(fixture()), Labelling(directions=1, gravity=((0, 0, -1.0),)))["verdict"] == "holds"


def test_what_no_forces_can_balance_is_not_resisted() -> None:
    """Two contacts on one line cannot hold a torque about it; a question alone would be refused."""
    pair = fixture() | {"contacts": fixture()["contacts"][:1] + fixture()["contacts"][3:]}
    pair["contacts"][1] |= {"normal": [0, 0, -1], "position": [-0.03, -0.03, 0.05]}
    said = label(from_dict(pair), Labelling(directions=1))
    assert said["max_plus_tz"] == said["max_plus_tz_upper"] == 0
    assert said["stop"] == "complete"


def test_without_a_mass_nothing_is_said_of_the_weight() -> None:
    said = label(from_dict({k: v for k, v in heavy().items() if k != "mass"}), Labelling(directions=1, nodes=300))
    assert "verdict" not in said
    assert said["max_plus_fy"] == pytest.approx(2.222, abs=5e-3)  # by hand, see `planar`


def test_a_limit_of_nodes_leaves_questions_open_and_says_so(grasp: Grasp) -> None:
    said = label(grasp, Labelling(directions=2, nodes=1))
    assert said["open"] > 0
    assert said["stop"] == "nodes"


def test_a_weight_that_is_held_is_a_bound_where_the_search_found_less(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(self: Questions, directions: list[np.ndarray]) -> list[LargestLoad]:
        return [LargestLoad(0.0, np.inf, False) for _ in directions]

    monkeypatch.setattr(Questions, "largest", nothing)
    said = label(from_dict(fixture()), Labelling(directions=1, gravity=((0, 0, -1.0),)))
    assert (said["verdict"], said["weight_factor"], said["weight_factor_upper"]) == ("holds", 1.0, None)


def test_the_time_of_a_grasp_has_an_end() -> None:
    heavy_one = random_case(6, 4).grasp.about(mass=MASS, center_of_mass=(0.01, 0, -0.02))  # takes thousands of nodes
    said = label(heavy_one, Labelling(directions=2, timeout=1e-4))
    assert said["stop"] == "time"
    assert said["status"] == "labelled"


def test_directions_are_spread_evenly() -> None:
    found = spread(32)
    assert np.allclose(np.linalg.norm(found, axis=1), 1)
    nearest = np.sort(found @ found.T, axis=1)[:, -2]
    assert np.degrees(np.arccos(nearest)).min() > 20  # 32 caps of equal size have a radius of 20 degrees
    assert np.abs(found.mean(axis=0)).max() < 0.02


def test_columns_are_named_once_and_all_there() -> None:
    assert len(set(COLUMN_NAMES)) == len(LABEL_COLUMNS)
    with pytest.raises(KeyError, match="colour"):
        complete({"colour": 1})


@pytest.mark.parametrize(
    ("asked", "fault"),
    [
        ({"gravity": ((0, 0, 0),)}, "gravity: is zero"),
        ({"gravity": ()}, "gravity: is empty"),
        ({"directions": 0}, "directions: is 0; at least 1"),
        ({"timeout": float("inf")}, "timeout: is inf"),
        ({"gap": 0.0}, "gap: is 0; a positive"),
    ],
)
def test_odd_questions_are_refused(asked: dict, fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        Labelling(**asked)


def held(grasp: Grasp) -> dict[str, object]:
    """What is said of the commands under gravity both ways across the fingers of `pinch`: 0.49 N, 0.049 N m."""
    about = grasp.about(mass=0.05, center_of_mass=(0, 0, 0))
    return label(about, Labelling(directions=1, gravity=((0, -1.0, 0), (0, 1.0, 0))))


def test_what_slips_with_these_commands_may_be_held_by_others() -> None:
    said = held(pinch().with_preload(None))
    assert (said["verdict"], said["held_by"]) == ("slips", "others")
    assert np.max(said["holding_commands"]) >= 0.049  # the other finger may be locked
    assert said["largest_command"] == pytest.approx(0.049, rel=2e-3)
    again = held(pinch().with_preload(np.array(said["holding_commands"])))
    assert (again["verdict"], again["held_by"]) == ("holds", "these")
    assert again["holding_commands"] == said["holding_commands"]


def test_what_no_commands_hold() -> None:
    fixed = label(from_dict(fixture()), Labelling(directions=1))
    assert (fixed["verdict"], fixed["held_by"], fixed["holding_commands"]) == ("slips", "none", None)
    smooth = held(pinch(mu=0.0))  # contacts without friction carry nothing across
    assert (smooth["held_by"], smooth["largest_command"], smooth["largest_command_lower"]) == ("none", None, None)


def test_commands_that_hold_are_never_below_the_largest_that_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the search for the smallest ends early those of the row take their place; an open end is empty."""
    far = LeastCommands(np.array([0.5, 0.5]), 0.0)
    monkeypatch.setattr(Questions, "commands", lambda self, wrench, rough: far)
    said = held(pinch(torque=0.1))
    assert (said["commands"], said["largest_command"], said["largest_command_lower"]) == ([0.1, 0.1], 0.1, None)
    near = LeastCommands(None, 0.0)  # none were found for the hardest direction, but one preload for all
    monkeypatch.setattr(Questions, "commands", lambda self, wrench, rough: near)
    weak = held(pinch(torque=0.01))
    assert weak["held_by"] == "others"
    assert weak["commands"] == weak["holding_commands"]
    assert weak["largest_command"] == np.max(weak["holding_commands"])
    assert weak["largest_command_lower"] is None


def test_least_commands_are_rough_where_no_commands_hold_another_direction(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is said of them is true all the same: 0.049 N m for 0.49 N across the fingers."""
    grasp, asked = pinch(torque=0.01).about(mass=0.05, center_of_mass=(0, 0, 0)), list[float]()

    def counted(*given: object, settings: Settings, **how: object) -> object:
        asked.append(settings.gap)
        return torques(*given, settings=settings, **how)  # type: ignore[arg-type]

    monkeypatch.setattr(Questions, "resisted_by_none", lambda self, loads, order: (1, {}))
    monkeypatch.setattr("handfast.datasets.labels.questions.torques", counted)
    said = label(grasp, Labelling(directions=1, gravity=((0, 1.0, 0), (1.0, 0, 0))))
    assert (said["held_by"], said["hardest"]) == ("none", [0, 1, 0])
    assert asked == [0.1]
    assert said["largest_command_lower"] <= 0.05 * 9.81 / 10 * (1 + 1e-9)
    assert said["largest_command"] * (1 + 1e-9) >= 0.05 * 9.81 / 10
    assert said["largest_command"] <= 1.1 * said["largest_command_lower"] * (1 + 1e-9)


def test_where_no_commands_hold_one_direction_it_is_the_hardest_and_least_commands_are_not_sought(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A force off the line through both contacts turns the object about it; gravity along -z needs a squeeze."""

    def never(*_: object) -> LeastCommands:
        raise AssertionError("least commands of a grasp that no commands hold")

    grasp = pinch().with_preload(None).about(mass=0.05, center_of_mass=(0, 0, 0.01))
    either = Labelling(directions=1, gravity=((0, 0, -1.0), (0, 1.0, 0)))
    monkeypatch.setattr(Questions, "commands", never)
    said = label(grasp, either)
    assert (said["verdicts"], said["held_by"], said["holding_commands"]) == (["slips", "slips"], "none", None)
    assert said["hardest"] == [0, 1, 0]
    assert (said["commands"], said["largest_command"], said["largest_command_lower"]) == (None, None, None)


def test_whether_any_commands_resist_is_said_with_some_that_do() -> None:
    """1.47 N across the fingers take 0.147 N m; no forces at two points turn the object about the line through them."""
    grasp = pinch().about(mass=0.15, center_of_mass=(0, 0, 0))
    questions = Questions(grasp, Labelling().settings(2), 60.0, 1e5)
    loads = [np.array([0, -1.47, 0, 0, 0, 0]), np.array([0, 0, -1.47, 0, 0, 0]), np.array([0, 0, 0, 1.0, 0, 0])]
    lost, known = questions.resisted_by_none(loads, (0, 1, 2))
    assert lost == 2
    assert set(known) == {0, 1}
    assert all(check(grasp.with_preload(known[k]), loads[k]).verdict is Verdict.HOLDS for k in known)
    assert questions.resisted_by_none(loads, (0, 1))[0] is None


def test_commands_that_are_sought_for_all_loads_are_tried_on_the_last_that_slipped_first() -> None:
    grasp = pinch().about(mass=0.05, center_of_mass=(0, 0, 0))
    questions, order = Questions(grasp, Labelling().settings(2), 60.0, 1e5), [0, 1, 2]
    loads = [np.array([0, f, 0, 0, 0, 0]) for f in (-0.1, 0.2, 0.5)]
    assert not questions._all_held(np.array([0.03, 0.03]), loads, order)
    assert order == [2, 0, 1]
    assert questions._all_held(np.array([0.06, 0.06]), loads, order)
