"""Commands that hold a load on its path: least ones that are known by hand, bounds, laws that both obey, forgery."""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.grasps import random_case
from handfast import Grasp, GraspJoint, Mechanism
from handfast.core.answer import SearchLimits, Stop, Verdict
from handfast.core.errors import InputError
from handfast.pictures.sentences import answer_sentence
from handfast.proofs import path_steps
from handfast.proofs.fields import BadFile
from handfast.proofs.path_commands import DRIFT, PathCommands
from handfast.stability.answers import TorquesAnswer
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.bound_problem import BoundProblem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.objective import ANY_STATE
from handfast.stability.problem.settings import Settings
from handfast.stability.search.path_bound import path_bound
from handfast.stability.studies.batch import torques_many
from handfast.stability.studies.questions import check, torques
from tests.support.jaws_on_paths import FIRST, jaw, padded
from tests.support.problems import moved

QUICK = Settings(gap=1e-2, nodes=20)  # a search; those of these paths that find something take fewer


def found(grasp: Grasp, wrench: Any, **options: Any) -> TorquesAnswer:
    """Replayed, and its commands are asked about once more by themselves."""
    answer = torques(grasp, wrench, loading=FIRST, **{"settings": QUICK} | options)
    assert answer.verify().ok
    if answer.preload is not None:
        limits = options.get("limits", GraspLimits())
        again = check(grasp.with_commands(answer.preload), wrench, loading=FIRST, limits=limits)
        assert again.verdict is Verdict.HOLDS
        assert 0 <= answer.lower <= answer.upper
    return answer


@cache
def of_two_jaws(objective: str) -> TorquesAnswer:
    return found(two_jaws(), [0, 0.6, 0], objective=objective)


@cache
def of_one_jaw() -> TorquesAnswer:
    return found(jaw(), [0, 0.6, 0])


def two_jaws() -> Grasp:
    """The jaw against another one that closes from +1; mu = 0.5."""
    other = GraspJoint("other", (-1, 0, 0), (1, 0, 0), (1,), "prismatic")
    return Grasp(jaw().contacts, [jaw().joints[0], other], None, {"jaw": 1.0, "other": 1.0})


def replace_friction(grasp: Grasp, mu: float) -> Grasp:
    """With another coefficient at all contacts."""
    return Grasp([replace(c, friction=mu) for c in grasp.contacts], grasp.joints, grasp.mechanism, grasp.command)


# --- by hand ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("back", "across"), [(0.0, 0.6), (0.6, 0.6), (1.0, 0.2)])
def test_least_commands_of_a_jaw_against_a_wall(back: float, across: float) -> None:
    """On the path both springs share the load a back: jaw and wall press with f +- a / 2, and both rub with half of b.

    So f = b + a / 2 on the path, as b / 2 <= mu (f - a / 2). Together the jaw carries f, the wall f - a: f = b + a.
    What is proved from below is within the millionth by which equations may be missed.
    """
    load = [-back, across, 0]
    answer, together = found(jaw(), load), torques(jaw(), load)
    least = across + back / 2
    assert least * (1 - 20 * DRIFT) <= answer.lower <= least
    assert least <= answer.upper * (1 + 1e-9)
    assert answer.upper <= 1.01 * least
    assert together.lower == pytest.approx(across + back, rel=2e-3)
    assert "none below" in answer_sentence(answer)


def test_the_sum_and_the_largest_of_two_jaws() -> None:
    """Either jaw alone squeezes as well as both: the other one is locked. The least sum is that of one."""
    answer = of_two_jaws("sum")
    assert answer.upper == pytest.approx(0.6, rel=1e-2)
    assert answer.lower == pytest.approx(0.6, rel=1e-4)
    assert answer.sums_commands
    assert "sum of commands" in answer_sentence(answer)


def test_where_nothing_has_to_be_commanded() -> None:
    answer = found(padded(), [-1, 0, 0])
    assert (answer.lower, answer.upper, answer.bound) == (0.0, 0.0, None)
    assert set((answer.preload or {}).values()) == {0.0}
    assert "no command is needed" in answer_sentence(answer)


def test_no_commands_hold_a_load_that_nothing_balances() -> None:
    """Without friction nothing carries a load across; nor does the jaw where its limits forbid the squeeze it needs."""
    smooth = replace_friction(jaw(), 0.0)
    answer = found(smooth, [0, 0.6, 0])
    assert (answer.verdict, answer.preload, answer.upper) == (Verdict.SLIPS, None, np.inf)
    assert "on any path" in answer_sentence(answer)
    limited = found(jaw(), [0, 0.6, 0], limits=GraspLimits(force_limit=0.5))
    assert limited.verdict is Verdict.SLIPS  # 0.3 of friction on each side needs 0.6
    assert found(jaw(), [0, 0.6, 0], limits=GraspLimits(torque_limits={"jaw": 0.5})).verdict is Verdict.SLIPS


def test_friction_of_the_joint_costs_what_it_is() -> None:
    """A jaw that rubs with 0.4 has to be closed with 0.4 more."""
    answer = found(jaw(friction=0.4), [0, 0.6, 0])
    assert answer.upper == pytest.approx(1.0, rel=1.1e-2)
    assert 0 < answer.lower <= 1.0


def test_uncertain_normals_have_no_bound() -> None:
    answer = found(jaw(), [0, 0.6, 0], limits=GraspLimits(eta=0.02))
    assert answer.lower == 0
    assert answer.upper > 0.6
    assert "no lower bound above 0 is known" in answer_sentence(answer)


# --- laws ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("s", [37.0])
def test_bounds_grow_with_the_load(s: float) -> None:
    one, other = (found(jaw(), k * np.array([-0.6, 0.6, 0])) for k in (1.0, s))
    assert other.lower == pytest.approx(s * one.lower, rel=1e-6)
    assert other.upper == pytest.approx(s * one.upper, rel=2e-2)


@pytest.mark.slow
def test_units_frames_and_order_change_nothing() -> None:
    load, length, force = np.array([-0.6, 0.6, 0, 0, 0, 0]), 1000.0, 0.25
    R, shift = Rotation.random(random_state=3).as_matrix(), np.array([0.3, -0.1, 0.2])
    other = moved(jaw(), R, shift, [1, 0], length, force)
    w = force * np.r_[R @ load[:3], length * np.cross(shift, R @ load[:3])]
    one, two = found(jaw(), load), found(other, w)
    # what torques may miss, `DRIFT` = 1e-5 of the load, is about the origin, and grows with the way there
    assert two.lower == pytest.approx(force * one.lower, rel=1e-3)
    assert two.lower < force * one.lower
    assert two.upper == pytest.approx(force * one.upper, rel=2e-2)


@pytest.mark.parametrize("seed", range(6))
def test_bounds_are_below_what_holds(seed: int) -> None:
    """Of random grasps with their own commands, whatever was found: these hold the load, so the bound is below them."""
    case = random_case(3, 400 + seed)
    grasp, load = case.grasp, case.direction
    commands = grasp.command
    if not commands.any() or check(grasp, 0.2 * load, loading=FIRST).verdict is not Verdict.HOLDS:
        return
    question = BoundProblem(scaled_problem.build(grasp, 0.2 * load), ANY_STATE).question
    of = PathCommands(question, np.sign(commands), False)
    lower, bound, _ = path_bound(of, SearchLimits(60.0))
    assert lower <= np.abs(commands).max()
    assert bound is None or bound.lower(of) == pytest.approx(lower, rel=1e-9)


def test_time_limits() -> None:
    """What was found by then, or nothing; all that is said is proved."""
    answer = torques(two_jaws(), [0, 0.6, 0], loading=FIRST, settings=Settings(timeout=1e-3))
    assert answer.verdict is Verdict.UNDECIDED
    assert answer.stop is Stop.TIME
    assert answer.verify().ok


def test_what_cannot_be_asked_is_refused() -> None:
    with pytest.raises(InputError, match="least commands of many loads cannot be asked with it"):
        torques_many(jaw(), [[0, 0.6, 0]], loading=FIRST)
    motor = Mechanism(("jaw",), np.eye(1), np.zeros((0, 1)), (False,), (True,))
    with pytest.raises(InputError, match="backdrivable"):
        torques(jaw(motor), [0, 0.6, 0], actuators=["jaw"], loading=FIRST)


# --- the replay ---------------------------------------------------------------------------------------


def test_forged_files_are_refused() -> None:
    saved = found(jaw(), [-0.6, 0.6, 0]).to_file()
    other = found(jaw(), [-0.6, 0.7, 0]).to_file()

    def fault(change: Any) -> str:
        data = copy.deepcopy(saved)
        change(data)
        replayed = path_steps.replay(path_steps.read_path(data))
        return replayed.reason or next((p.reason for p in replayed.parts if p.reason), "")

    def leaf(data: Any) -> Any:
        return max(data["bound"]["leaves"], key=lambda x: len(x["rows"]))

    assert not fault(lambda data: None)
    assert "its cases show" in fault(lambda data: data["answer"].update(lower=0.91))
    assert "upper" in fault(lambda data: data["answer"].update(upper=0.8))
    assert "preload" in fault(lambda data: data["answer"]["preload"].update(jaw=0.5))
    assert fault(lambda data: data["question"]["grasp"]["preload"].update(jaw=0.85))
    assert fault(lambda data: data.update(steps=other["steps"]))
    assert "lower bound" in fault(lambda data: data.update(bound=None))
    assert fault(lambda data: data["sought"]["senses"].update(jaw=-1))
    assert "the answer says inf" in fault(lambda data: data["answer"].update(verdict="slips"))
    assert "whole load is not reached" in fault(lambda data: data["steps"].pop())
    assert "has a negative multiplier" in fault(lambda data: leaf(data)["rows"].append([52, -1.0]))
    assert fault(lambda data: [x.update(rows=x["rows"][1:]) for x in data["bound"]["leaves"]])
    assert "leaves" in fault(lambda data: data["bound"]["leaves"].pop())
    assert "both cases" in fault(lambda data: data["bound"]["case"].__setitem__(1, data["bound"]["case"][2]))


def test_a_row_of_another_case_is_refused() -> None:
    """A bound that takes all contacts for closed in every case would be the closed one's."""
    answer = of_one_jaw()
    assert answer.bound is not None
    assert answer.sought is not None
    tree = answer.bound
    whole = replace(tree, parent=(-1,), part=(0,), case=(0,), leaves=(max(tree.leaves, key=lambda x: len(x.rows)),))
    with pytest.raises(BadFile, match="does not hold in its case"):
        whole.lower(answer.sought)


def beside() -> Grasp:
    """The jaw, squeezed with 1 N, and a slider that moves no contact."""
    other = GraspJoint("other", (0, 0, 1), (0, 0, 0), (), "prismatic")
    return Grasp(jaw().contacts, [jaw().joints[0], other], None, {"jaw": 1.0})


def test_what_is_not_sought_is_locked_in_every_file() -> None:
    """With 1 N at the jaw the load is held, with the jaw locked it is not: a file of the one cannot be of the other."""
    load = [0, 0.6, 0]
    assert check(beside(), load, loading=FIRST).verdict is Verdict.HOLDS
    answer = found(beside(), load, actuators=["other"])
    assert answer.verdict is Verdict.SLIPS
    data = answer.to_file()
    assert not path_steps.replay(path_steps.read_path(copy.deepcopy(data))).fault
    data["question"]["grasp"]["preload"]["jaw"] = 1.0
    with pytest.raises(BadFile, match=r"sought.senses: leaves out 'jaw', which is commanded; what is not sought"):
        path_steps.read_path(data)


@pytest.mark.parametrize(("objective", "words"), [("max", "+jaw, +other (max)"), ("sum", "+jaw, +other (sum)")])
def test_the_claim_says_whose_commands_and_what_of_them(objective: str, words: str) -> None:
    saved = path_steps.read_path(of_two_jaws(objective).to_file())
    (claim,) = (part.claim for part in path_steps.replay(saved).parts if part.name == "bound")
    assert claim.startswith(f"no commands of {words} hold the load on a path below ")


@pytest.mark.parametrize("change", [{"case": 0.5}, {"part": 0.5}, {"parent": 0.5}])
def test_a_tree_has_whole_numbers(change: dict[str, float]) -> None:
    data = copy.deepcopy(of_one_jaw().to_file())
    for name, more in change.items():
        data["bound"][name][-1] += more
    with pytest.raises(BadFile, match="has a number that is not whole"):
        path_steps.read_path(data)
