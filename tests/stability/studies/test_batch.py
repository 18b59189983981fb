"""Many questions at once are the questions one by one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handfast import Loads, check, check_many, load_grasp, max_many, maximum, torques, torques_many
from handfast.core.answer import Stop
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.model.mechanism import Mechanism
from handfast.proofs import checker
from handfast.stability.answers import MaxAnswer
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.studies import batch
from tests.support.problems import bell, nest, pinch, solved, table
from tests.support.rounding_edges import hand

QUICK = Settings(verify=False)


def tendons(g: Grasp) -> Grasp:
    """Pulled by tendons, which may go slack."""
    names = g.mechanism.actuators
    return Grasp(
        g.contacts,
        g.joints,
        Mechanism(names, np.eye(len(names)), np.zeros((0, len(names))), (True,) * len(names)),
        g.command,
    )


def rubbing(g: Grasp) -> Grasp:
    """All motors are locked but the first, in whose place the joint rubs."""
    drives = g.mechanism
    joints = tuple(replace(joint, friction=0.02) for joint in g.joints)
    return Grasp(g.contacts, joints, Mechanism(drives.actuators[1:], drives.R[1:], drives.A, (False,) * (drives.a - 1)))


def test_a_node_limit_holds_for_every_row() -> None:
    """What the kernel does not finish within the limit is undecided, and says so; without a limit all are decided."""
    g = solved(4, 8).grasp
    W = loads(g, 8, seed=3)
    free, limited = (max_many(g, W, settings=Settings(verify=False, nodes=n)) for n in (np.inf, 3.0))
    assert set(free.stop) == {"complete"}
    assert (free.upper - free.lower <= 2e-3 * free.upper).all()
    stopped = limited.stop == "nodes"
    assert stopped.sum() >= 4
    assert (limited.nodes[stopped] <= 100).all()  # a search finishes the slice that it has begun
    assert (limited.upper[stopped] >= free.lower[stopped]).all()
    assert (limited.lower <= free.upper * (1 + 1e-9)).all()
    assert (limited.verdict[stopped & (limited.lower == 0)] == "undecided").all()


def test_a_maximum_at_its_limit_of_nodes_has_what_was_found_so_far() -> None:
    D = np.vstack([np.eye(6), -np.eye(6)])
    free, limited = (max_many(load_grasp("fig1"), D, settings=Settings(verify=False, nodes=n)) for n in (np.inf, 300.0))
    stopped = limited.stop == "nodes"
    assert stopped.sum() >= 4
    assert (limited.nodes[stopped] <= 700).all()
    assert (limited.upper >= free.lower).all()
    assert (limited.lower <= free.upper).all()
    assert (limited.lower[stopped] > 0).any()
    assert ((limited.verdict == "holds") == (limited.lower > 0)).all()


def loads(g: Grasp, count: int, seed: int = 0) -> np.ndarray:
    """Loads about as large as what the commands make, that the contacts can balance; one is nothing."""
    rng = np.random.default_rng(seed)
    c = rng.normal(size=(count, 3 * g.m))
    W = c @ g.G.T
    W /= np.linalg.norm(W[:, :3], axis=1)[:, None]
    return W * rng.uniform(0.2, 2.0, size=(count, 1))


ASKED: dict[str, tuple[Grasp, dict[str, Any]]] = {
    "pinch": (pinch(), {}),
    "bell": (bell(), {}),
    "random": (solved(3, 4).grasp, {}),
    "normals": (solved(5, 3, eta=0.1).grasp, {"limits": GraspLimits(0.1)}),
    "force limit": (solved(3, 4).grasp, {"limits": GraspLimits(force_limit=3.0)}),
    "torque limit": (bell(), {"limits": GraspLimits(torque_limits={"prox_1": 0.15})}),
    "coupled": (hand(), {}),
    "tendons": (tendons(bell()), {}),
    "fixture": (nest(), {}),
}
CASES = pytest.mark.parametrize(("g", "asked"), list(ASKED.values()), ids=list(ASKED))


@CASES
def test_checks_are_those_one_by_one(g: Grasp, asked: dict[str, Any]) -> None:
    W = loads(g, 12)
    W[5] = 0.0
    found = check_many(g, W, settings=QUICK, **asked)
    assert found.verdict.tolist() == [str(check(g, w, settings=QUICK, **asked).verdict) for w in W]
    held = found.verdict == "holds"
    assert (found.residual[held] <= 1e-9).all()
    assert np.isnan(found.residual[~held]).all()
    assert found.verified[held].all()


@CASES
@pytest.mark.parametrize("loaded", [False, True])
def test_maxima_are_those_one_by_one(g: Grasp, asked: dict[str, Any], loaded: bool) -> None:
    D = loads(g, 5, 1)
    base = 0.1 * loads(g, 1, 2)[0] if loaded else None
    found = max_many(g, D, base=base, settings=QUICK, **asked)
    for i, d in enumerate(D):
        one = maximum(g, d, base=base, settings=QUICK, **asked)
        assert (found.verdict[i], found.unbounded[i]) == (one.verdict, one.unbounded)
        assert found.lower[i] <= one.upper * (1 + 1e-9)
        assert one.lower <= found.upper[i] * (1 + 1e-9)
        if 0 < one.gap < 1.1e-3:
            assert found.upper[i] - found.lower[i] <= 1.1e-3 * found.lower[i]


def test_most_rows_need_no_search_by_themselves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Or the kernel would be of no use."""
    alone: list[int] = []
    by_itself = batch._alone
    monkeypatch.setattr(batch, "_alone", lambda *given: alone.append(given[2]) or by_itself(*given))
    g = solved(3, 4).grasp
    check_many(g, loads(g, 40), settings=QUICK, jobs=1)
    max_many(g, loads(g, 20), settings=QUICK, jobs=1)
    assert len(alone) <= 10


def test_what_slips_is_replayed_unless_that_is_switched_off() -> None:
    W = [[0, 0.9, 0, 0, 0, 0], [0, 1.1, 0, 0, 0, 0]]  # pinch holds 1 N
    assert check_many(pinch(), W).verified.tolist() == [True, True]
    assert check_many(pinch(), W, settings=QUICK).verified.tolist() == [True, False]
    assert not max_many(pinch(), W).verified.any()  # the bound stands on a search
    assert max_many(pinch(), W, answers=True).verified.all()
    down = max_many(nest(), [[0, 0, 1, 0, 0, 0]], jobs=1)
    assert (down.verdict[0], down.upper[0], down.verified[0]) == ("slips", 0.0, True)


@pytest.mark.parametrize("g", [hand(), solved(3, 4).grasp, solved(4, 8).grasp, rubbing(solved(4, 8).grasp)])
def test_what_slips_at_every_magnitude_is_told_together(g: Grasp, monkeypatch: pytest.MonkeyPatch) -> None:
    """However small it is; a search by itself says the same of each."""
    g = g.with_friction(0.05)
    D = np.vstack([np.eye(6), -np.eye(6)])
    one_by_one = [maximum(g, d, settings=QUICK) for d in D]
    assert any(m.verdict == "slips" for m in one_by_one)
    alone: list[int] = []
    by_itself = batch._alone
    monkeypatch.setattr(batch, "_alone", lambda *given: alone.append(given[2]) or by_itself(*given))
    found = max_many(g, D, settings=QUICK, jobs=1)
    for i, one in enumerate(one_by_one):
        assert (found.verdict[i], found.unbounded[i]) == (one.verdict, one.unbounded)
        assert (found.upper[i] == 0) == (one.upper == 0)
    slips = [i for i, one in enumerate(one_by_one) if one.verdict == "slips"]
    assert not found.verified[slips].any()
    assert len(set(alone) & set(slips)) <= 1


def test_a_check_beyond_its_limit_of_nodes_is_not_begun_again(monkeypatch: pytest.MonkeyPatch) -> None:
    g = solved(4, 8).grasp
    W = 2 * loads(g, 20, seed=3)
    limited = check_many(g, W, settings=Settings(verify=False, nodes=3.0), jobs=1)
    stopped = limited.stop == "nodes"
    assert stopped.any()
    assert (limited.verdict[stopped] == "undecided").all()
    assert not limited.verified[stopped].any()
    monkeypatch.setattr(batch, "_alone", lambda *given: pytest.fail("asked again"))
    check_many(g, W[stopped], settings=Settings(verify=False, nodes=3.0), jobs=1)


def test_shapes_of_several_grasps() -> None:
    grasps = [pinch(), pinch(0.3), bell()]
    W = np.array([[0, 0.8, 0, 0, 0, 0], [0, 0.5, 0, 0, 0, 0]])
    same = check_many(grasps, W)
    assert same.shape == (3, 2)
    assert same.verdict.tolist() == [["holds", "holds"], ["slips", "holds"], ["holds", "holds"]]
    own = check_many(grasps, np.stack([W, W[::-1], W]))
    assert own.verdict[1].tolist() == ["holds", "slips"]
    assert check_many(pinch(), Loads.wrench(W[0]) + Loads.wrench(W[1], "less")).verdict.tolist() == ["holds", "holds"]
    forces = max_many(grasps, W[:, :3], base=np.stack([0 * W, 0 * W, 0.1 * W]))
    assert forces.wrenches.shape == (3, 2, 6)
    np.testing.assert_allclose(forces.lower[0], [1 / 0.8, 1 / 0.5], rtol=2e-3)
    table_ = own.to_frame()
    assert table_["grasp"].tolist() == [0, 0, 1, 1, 2, 2]
    assert table_["fy"].tolist() == [0.8, 0.5, 0.5, 0.8, 0.8, 0.5]
    assert "attained" not in table_


MIXED = [solved(seed, 4).grasp for seed in (1, 8)] + [bell(), pinch(), hand(), tendons(bell()), nest()]


@pytest.mark.parametrize("ask", [check_many, max_many])
@pytest.mark.parametrize("limits", [GraspLimits(), GraspLimits(0.1), GraspLimits(force_limit=3.0)])
@pytest.mark.slow
def test_a_question_of_each_of_many_grasps_is_answered_as_by_itself(ask: Any, limits: GraspLimits) -> None:
    """To the last bit whichever other grasps there are; and as the query for one says."""
    W = np.array([loads(g, 2, seed=4) for g in MIXED])
    together = ask(MIXED, W, settings=QUICK, limits=limits, jobs=1)
    for k, g in enumerate(MIXED):
        by_itself = ask(g, W[k], settings=QUICK, limits=limits, jobs=1)
        for name in ("verdict", "lower", "upper", "unbounded", "residual", "nodes", "stop", "error"):
            np.testing.assert_array_equal(
                getattr(together, name)[k], getattr(by_itself, name), err_msg=f"{g.name} {name}"
            )
        for i, w in enumerate(W[k]):
            one = (check if ask is check_many else maximum)(g, w, settings=QUICK, limits=limits)
            assert together.verdict[k, i] == one.verdict
            if isinstance(one, MaxAnswer):
                assert together.unbounded[k, i] == one.unbounded
                assert together.lower[k, i] <= one.upper * (1 + 1e-9)
                assert one.lower <= together.upper[k, i] * (1 + 1e-9)


def test_most_grasps_need_no_search_by_themselves(monkeypatch: pytest.MonkeyPatch) -> None:
    alone: list[int] = []
    by_itself = batch._alone
    monkeypatch.setattr(batch, "_alone", lambda *given: alone.append(given[2]) or by_itself(*given))
    grasps = [g for seed in range(20) if (g := solved(seed, 4).grasp).command.any()]
    max_many(grasps, np.array([loads(g, 1, seed=4) for g in grasps]), settings=QUICK, jobs=1)
    assert len(alone) <= 2
    assert len(grasps) >= 12


def test_bad_rows_of_some_grasps_leave_the_others_alone() -> None:
    """What is no number, no direction, or nothing that the contacts could balance: as `maximum` says it of one."""
    grasps = [pinch(), pinch(0.3), pinch(0.4), pinch(0.6)]
    D = np.tile([0.0, 1.0, 0, 0, 0, 0], (4, 1, 1))
    good = max_many(grasps, D, settings=QUICK)
    D[0, 0, 1], D[1, 0, 1], D[2, 0] = np.nan, 0.0, [0, 0, 0, 1.0, 0, 0]
    found = max_many(grasps, D, settings=QUICK)
    assert (good.verdict == "holds").all()
    for k in range(3):
        with pytest.raises(InputError) as refused:
            maximum(grasps[k], D[k, 0], settings=QUICK)
        assert found.error[k, 0] == str(refused.value)
        assert found.verdict[k, 0] == ""
    assert (found.lower[3, 0], found.error[3, 0]) == (good.lower[3, 0], "")


def test_a_bad_row_has_its_reason_and_others_go_on() -> None:
    W = np.array([[0, 0.9, 0, 0, 0, 0], [np.nan] * 6, [0, 0, 0, 1, 0, 0], [0, 1.1, 0, 0, 0, 0]])
    found = check_many(pinch(), W, jobs=1)  # no forces of the pinch balance a torque about x
    assert found.verdict.tolist() == ["holds", "", "", "slips"]
    assert "NaN" in found.error[1]
    assert "rank 5" in found.error[2]
    assert found.error[0] == found.error[3] == ""
    found = max_many(pinch(), [[0, 1, 0], [0, 0, 0]])
    assert "is zero" in found.error[1]
    assert np.isnan(found.lower[1])


@pytest.mark.parametrize("wrong", [[[0, 1]], np.zeros((3, 2, 6)), "up", [[[0, 1, 0]]] * 3])
def test_another_shape_is_refused(wrong: Any) -> None:
    with pytest.raises(InputError, match="for all grasps"):
        check_many([pinch(), bell()], wrong)
    with pytest.raises(InputError, match="is empty"):
        check_many([], [[0, 1, 0]])


def test_jobs_do_not_change_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "QUESTION_BLOCK", 8)
    g = solved(3, 4).grasp
    ways = []
    for jobs, fork in ((1, 10**9), (2, 10**9), (2, 0)):
        monkeypatch.setattr(batch, "FORK", fork)
        ways.append(max_many(g, loads(g, 20), jobs=jobs))
    for other in ways[1:]:
        for name in ("verdict", "lower", "upper", "nodes", "residual"):
            np.testing.assert_array_equal(getattr(ways[0], name), getattr(other, name))


def test_ctrl_c_leaves_what_was_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(batch, "QUESTION_BLOCK", 2)
    found = check_many(pinch(), [[0, 0.9, 0]] * 5, jobs=1, on_progress=stop)
    assert found.verdict.tolist() == ["holds", "holds", "", "", ""]
    assert found.error[-1] == batch.INTERRUPTED


def test_whole_answers_on_request() -> None:
    found = max_many(bell(), [[0, 1, 0], [0, 0, 0]], answers=True)
    assert found.answers is not None
    (one, none) = found.answers
    assert none is None
    assert one.witness.valid  # type: ignore[union-attr]
    assert one.verify().ok  # type: ignore[union-attr]
    assert found.to_frame()["attained"].tolist() == [one.attained, False]


def test_least_commands() -> None:
    W = np.array([[0, 0.5, 0], [0, 1.0, 0]])
    found = torques_many(pinch(), W, settings=QUICK, jobs=1)
    each = [torques(pinch(), w, settings=QUICK) for w in W]
    np.testing.assert_allclose(found.upper, [a.upper for a in each], rtol=1e-9)
    np.testing.assert_allclose(found.upper, [0.05, 0.1], rtol=3e-3)


def test_a_table_beside_its_weight() -> None:
    """Pushed along x it slips at mu W."""
    pushes = [[1, 0, 0, 0, 0, 0], [-2, 0, 0, 0, 0, 0]]
    found = max_many(table(), pushes, base=[0, 0, -10, 0, 0, 0])
    np.testing.assert_allclose(found.lower, [4.0, 2.0], rtol=2e-3)


def test_where_programs_break_down_states_of_neighbours_help() -> None:
    """Alone, they break down in these directions; from the states of the next ones the search closes."""
    grasp = load_grasp("barrett-can")
    turn = 2 * np.pi * np.arange(90) / 90
    circle = np.column_stack([np.cos(turn), np.sin(turn), *np.zeros((4, 90))])
    found, hard = max_many(grasp, circle, settings=QUICK, jobs=1), [3, 75, 89]
    assert [maximum(grasp, circle[k], settings=QUICK).stop for k in hard] == ["numerical"] * 3
    assert found.stop[hard].tolist() == ["complete"] * 3
    assert (found.upper[hard] <= found.lower[hard] * (1 + 1.1e-3)).all()


def test_intervals_on_request() -> None:
    found = max_many(pinch(), [[0, 1, 0], [0, 0, 1]], interval=True)
    assert found.intervals is not None
    assert [i.holds_from_zero_to for i in found.intervals if i] == pytest.approx([1.0, 1.0], rel=2e-3)
    assert all(i is not None and not i.arcs for i in found.intervals)


def test_ctrl_c_leaves_none_in_processes_either(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(batch, "FORK", 0)
    monkeypatch.setattr(batch, "QUESTION_BLOCK", 8)
    found = max_many(pinch(), [[0, 1, 0]] * 96, jobs=2, on_progress=stop)
    assert found.error[0] == ""
    assert found.error[-1] == batch.INTERRUPTED


def test_ctrl_c_during_a_search_ends_the_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*asked: Any, **options: Any) -> Any:
        return replace(torques(*asked, **options), stop=Stop.INTERRUPTED)

    monkeypatch.setattr(batch, "torques", interrupted)
    monkeypatch.setattr(batch, "QUESTION_BLOCK", 2)
    found = torques_many(pinch(), [[0, 0.5, 0]] * 5, settings=QUICK, jobs=1)
    assert found.stop.tolist() == ["interrupted", "", "", "", ""]
    assert found.error.tolist() == ["", *[batch.INTERRUPTED] * 4]


@pytest.mark.parametrize("length", [1e-6, 1e3])
@pytest.mark.slow
def test_the_length_of_a_direction_is_a_unit(length: float) -> None:
    """However long the direction is given, the force resisted is the same 2.2222 N, and so is its proof."""
    answer = maximum(bell(), length * np.array([0, 1.0, 0, 0, 0, 0]))
    assert answer.lower * length == pytest.approx(0.2 / 0.09, rel=1e-3)
    assert answer.upper * length == pytest.approx(0.2 / 0.09, rel=1.1e-3)
    assert checker.verify(answer.certificate).ok
    np.testing.assert_allclose(answer.witness.wrench[1], answer.lower * length, rtol=3e-9)
    loaded = maximum(table(), [length, 0, 0, 0, 0, 0], base=[0, 0, -10, 0, 0, 0])
    assert loaded.lower * length == pytest.approx(4.0, rel=1e-3)
    assert checker.verify(loaded.certificate).ok
    pressed = maximum(table(), [0, 0, -length, 0, 0, 0], limits=GraspLimits(force_limit=2.0))
    assert pressed.lower * length == pytest.approx(8.0, rel=1e-3)
    found = max_many(bell(), [[0, length, 0, 0, 0, 0], [0, 1e3 * length, 0, 0, 0, 0]], jobs=1)
    assert found.lower[0] == pytest.approx(1e3 * found.lower[1], rel=1e-3)
