"""First the squeeze, then the load in steps: paths whose ends are known by hand, and laws that all of them obey."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.grasps import random_case
from handfast import Contact, Grasp, GraspJoint, Mechanism, load_grasp
from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.model.start import Start
from handfast.proofs.kinds import Row
from handfast.proofs.rows import Columns, LeafRows, row_values
from handfast.proofs.states import acting
from handfast.stability.answers.answer import any_state
from handfast.stability.answers.check_query import ask as check
from handfast.stability.answers.load_path import Follower, StepAnswer, start_after
from handfast.stability.problem import judge, scaled_problem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import maximum
from tests.support.jaws_on_paths import FIRST, MOTOR, jaw, padded
from tests.support.problems import moved
from tests.support.slow_cases import slow_after


def pressed(answer: Any) -> tuple[float, float]:
    """[N] by the jaw and by the wall."""
    c = answer.witness.state.c.reshape(2, -1, 3)[:, :, 0].sum(axis=1)
    return float(c[0]), float(c[1])


def stepped(grasp: Grasp, wrench: Any, start: Grasp, wrench_before: Any = (0, 0, 0)) -> StepAnswer:
    """The step from the state of `start` under a load to another load."""
    before = any_state(StepAnswer, scaled_problem.build(start, wrench_before), Settings())
    assert before.witness is not None
    return any_state(
        StepAnswer, scaled_problem.build(grasp.with_start(start_after(before, before.witness)), wrench), Settings()
    )


# --- by hand ------------------------------------------------------------------------------------------


def test_a_jaw_that_gave_way_in_the_squeeze_holds_more() -> None:
    """The load s (-1, 1) pushes the jaw back. As it moved in the squeeze, (8) lets it carry its command 1 alone.

    The wall presses with 1 - s then, and as both contacts rub alike (moments), s / 2 <= mu (1 - s): s = 1/2. Gearing
    that stands where it came to shares the load between both springs: the wall presses with 1 - s / 2, s = 2/3.
    """
    together, after = (maximum(jaw(), [-1, 1, 0], loading=x) for x in ("together", FIRST))
    assert together.lower == pytest.approx(1 / 2, rel=2e-3)
    assert after.lower <= 2 / 3 * (1 + 1e-9) <= after.upper * (1 + 1e-9)
    assert after.gap <= 2e-3
    assert after.verify().ok
    held = check(jaw(), [-0.6, 0.6, 0], loading=FIRST)
    assert held.verdict is Verdict.HOLDS
    assert held.verify().ok
    assert check(jaw(), [-0.6, 0.6, 0]).verdict is Verdict.SLIPS
    assert pressed(held) == pytest.approx((1.3, 0.7))  # 1 +- s / 2
    slips = check(jaw(), [-0.7, 0.7, 0], loading=FIRST)
    assert slips.verdict is Verdict.SLIPS
    assert slips.verify().ok
    assert slips.path.slips_at <= 1


def test_a_straight_step_is_not_asked_again_in_shorter_ones() -> None:
    """Up to s = 1/2 both sides of the jaw stick: states of shorter steps are on the line that one step draws."""
    held = check(jaw(), [-0.3, 0.1, 0], loading=FIRST)
    assert (held.path.by_steps, held.path.resolution) == ({1: 1.0}, 0.0)
    assert held.verify().ok
    last = held.path.steps[-1].witness.state
    for s in (0.25, 0.7):
        there = check(jaw(), [-0.3 * s, 0.1 * s, 0], loading=FIRST).path.steps
        assert there[-1].witness.state.c == pytest.approx((1 - s) * there[0].witness.state.c + s * last.c, abs=1e-9)


def test_a_step_in_which_something_lets_go_is_asked_again() -> None:
    """The wall opens on the way to the whole load, so that the middle of the line is no state."""
    grasp = padded(MOTOR, friction=0.4)
    held = check(grasp, [-1.3, 0, 0], loading=FIRST)
    assert len(held.path.by_steps) > 1
    assert held.path.resolution > 0


def test_where_gearing_is_let_go_the_path_is_the_papers_again() -> None:
    """A backdrivable motor gives its command, whatever it did in the squeeze."""
    after, together = (maximum(jaw(MOTOR), [-1, 1, 0], loading=x) for x in (FIRST, "together"))
    assert after.lower == pytest.approx(0.5, rel=2e-3) == pytest.approx(together.lower, rel=2e-3)


def test_a_path_ends_below_the_papers_maximum_where_the_jaw_may_press_no_more() -> None:
    """No contact may press with more than 1.2 N. Together the jaw carries 1, so that the wall's friction ends it: 1/2.

    On the path the jaw presses with 1 + s / 2: s = 0.4.
    """
    limits = GraspLimits(force_limit=1.2)
    together, after = (maximum(jaw(), [-1, 1, 0], limits=limits, loading=x) for x in ("together", FIRST))
    assert together.lower == pytest.approx(1 / 2, rel=2e-3)
    assert after.lower <= 0.4 * (1 + 1e-9) <= after.upper * (1 + 1e-9)
    assert after.gap <= 4e-3
    assert after.verify().ok


@pytest.mark.parametrize("steps", [1, 8])
def test_commands_and_load_at_once_in_steps_are_the_papers_question(steps: int) -> None:
    """The jaw follows its command through all steps, so that it carries that alone, and the wall the load: 1 - s.

    Steps of commands and load in proportion lead through the multiples of one state. First the squeeze: 1 +- s / 2.
    """
    load, start = 0.4 * np.array([-1.0, 1.0, 0]), None
    for k in range(1, steps + 1):
        share = k / steps
        grasp = jaw().with_preload({"jaw": share})
        grasp = grasp if start is None else grasp.with_start(start)
        step = any_state(StepAnswer, scaled_problem.build(grasp, share * load), Settings())
        assert step.verdict is Verdict.HOLDS
        assert pressed(step) == pytest.approx((share, 0.6 * share), abs=1e-9)
        start = start_after(step, step.witness)
    assert start.gaps == pytest.approx([-1, -0.6])
    beyond = scaled_problem.build(jaw().with_preload({"jaw": 1.3}).with_start(start), 0.54 * 1.3 * load / 0.4)
    assert any_state(StepAnswer, beyond, Settings()).verdict is Verdict.SLIPS  # from 1/2 of the command on
    assert pressed(check(jaw(), load)) == pytest.approx((1.0, 0.6))
    assert pressed(check(jaw(), load, loading=FIRST)) == pytest.approx((1.2, 0.8))


def test_a_path_ends_at_a_hole_below_the_papers_maximum() -> None:
    """Between 11.0 and 13.6 N along +y nothing is resisted, but 18.1 N are: steps that are short enough end there."""
    grasp = load_grasp("barrett-mug")
    assert check(grasp, [0, 12.3, 0]).verdict is Verdict.SLIPS
    assert check(grasp, [0, 18.1, 0]).verdict is Verdict.HOLDS
    answer = maximum(grasp, [0, 1, 0], loading=FIRST)
    assert 10.9 < answer.lower < answer.upper < 11.4
    assert answer.verify().ok
    assert maximum(grasp, [0, 1, 0]).lower > 36


def test_commands_that_balance_nothing_are_no_beginning() -> None:
    """One contact that nothing opposes: the path has no first state, and that is proved."""
    lone = Grasp(jaw().contacts[:1], jaw().joints, preload={"jaw": 1.0})
    for answer in (check(lone, [-1, 0, 0], loading=FIRST), maximum(lone, [-1, 0, 0], loading=FIRST)):
        assert answer.verdict is Verdict.SLIPS
        assert answer.verify().ok
        assert answer.to_json()["steps"] == 0
    assert check(lone, [-2, 0, 0]).verdict is Verdict.HOLDS  # together the load meets the jaw


def test_a_load_without_end() -> None:
    answer = maximum(padded(), [-1, 0, 0], loading=FIRST)
    assert answer.unbounded
    assert answer.verify().ok


# --- stops, tendons, friction of joints ---------------------------------------------------------------


def test_a_jaw_comes_back_to_the_stop_that_it_left() -> None:
    """A backdrivable jaw at its lower stop is pushed back by more than its command: the stop carries the rest.

    It had closed by 2/3 in the squeeze. Under 4 it is back at its stop, which carries 3; under less it carries 1.
    """
    grasp = padded(MOTOR, stop="lower")
    rest = any_state(StepAnswer, scaled_problem.build(grasp, [0, 0, 0]), Settings())
    start = start_after(rest, rest.witness)
    assert start.stops == pytest.approx([2 / 3])
    assert start.gaps == pytest.approx(np.full(6, -1 / 3))
    for load, reaction in ((0.5, 0.0), (4.0, 3.0)):
        answer = check(grasp, [-load, 0, 0], loading=FIRST)
        assert answer.verdict is Verdict.HOLDS
        assert answer.exact
        assert answer.verify().ok
        assert answer.witness.state.reaction == pytest.approx([reaction], abs=1e-9)
    assert np.sum([s.witness.state.q for s in answer.path.steps]) == pytest.approx(0, abs=1e-9)


def test_friction_of_a_joint_opposes_what_moves_from_there() -> None:
    """A backdrivable jaw of 1 rubs with 0.4: closing it squeezed with 0.6, and it is pushed back from 1.4 on."""
    grasp = padded(MOTOR, friction=0.4)
    rest = any_state(StepAnswer, scaled_problem.build(grasp, [0, 0, 0]), Settings())
    assert pressed(rest) == pytest.approx((0.6, 0.6))
    for load, forces in ((1.0, (1.1, 0.1)), (1.3, (1.3, 0.0))):  # it stands: shared by both sides; the wall has opened
        answer = check(grasp, [-load, 0, 0], loading=FIRST)
        assert answer.verdict is Verdict.HOLDS
        assert answer.verify().ok
        assert pressed(answer) == pytest.approx(forces, abs=1e-9)
    slips = check(grasp, [-1.5, 0, 0], loading=FIRST)
    assert slips.verdict is Verdict.SLIPS
    assert slips.verify().ok


def test_a_joint_that_left_its_stop_rubs_both_ways() -> None:
    """The same jaw at its lower stop: friction carries 0.3 of 1.3; of 5 stop and friction carry 4."""
    grasp = padded(MOTOR, friction=0.4, stop="lower")
    for load, reaction in ((1.3, 0.3), (5.0, 4.0)):
        answer = check(grasp, [-load, 0, 0], loading=FIRST)
        assert answer.verdict is Verdict.HOLDS
        assert answer.verify().ok
        assert answer.witness.state.reaction == pytest.approx([reaction], abs=1e-9)
    slips = check(grasp, [-1, 3, 0], loading=FIRST)  # across, beyond what both sides rub with
    assert slips.verdict is Verdict.SLIPS
    assert slips.verify().ok


def test_a_slack_tendon_pulls_from_where_it_was() -> None:
    """A tendon without command: it goes slack as a motor closes the jaw, and pulls where it is pushed back as far."""
    both = Mechanism(("motor", "tendon"), np.array([[1.0], [1.0]]), np.zeros((0, 1)), (False, True), (True, False))
    grasp = padded(both)
    rest = any_state(StepAnswer, scaled_problem.build(grasp, [0, 0, 0]), Settings())
    assert start_after(rest, rest.witness).slack == pytest.approx([0, 2 / 3])
    for load, pull in ((0.5, 0.0), (4.0, 3.0)):
        answer = check(grasp, [-load, 0, 0], loading=FIRST)
        assert answer.verdict is Verdict.HOLDS
        assert answer.exact
        assert answer.verify().ok
        assert answer.witness.state.f[1] == pytest.approx(pull, abs=1e-9)


# --- laws ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["fig9", "barrett-pear", "tendon-fingers"])
def test_a_step_without_load_changes_nothing(name: str) -> None:
    grasp, load = load_grasp(name), np.array([0, 0, 1.0])
    answer = stepped(grasp, load, grasp, load)
    assert answer.verdict is Verdict.HOLDS
    assert answer.witness.largest_motion <= 1e-8 * np.abs(answer.witness.state.c).max()
    assert check(grasp, 0 * load, loading=FIRST).verdict is Verdict.HOLDS


@pytest.mark.parametrize("s", [37.0])
def test_load_commands_and_state_scale_together(s: float) -> None:
    grasp = load_grasp("barrett-pear")
    one, other = (maximum(g, [0, 0, 1], loading=FIRST) for g in (grasp, grasp.with_preload(s * grasp.command)))
    assert other.lower == pytest.approx(s * one.lower, rel=2e-3)
    assert other.upper == pytest.approx(s * one.upper, rel=2e-3)


def test_units_frames_and_order_change_nothing() -> None:
    grasp, load = load_grasp("barrett-pear"), np.array([0, 0, 1.0])
    one = maximum(grasp, load, loading=FIRST)
    R = np.array([[0, -1, 0], [0, 0, 1], [-1, 0, 0.0]])
    at = np.array([0.3, -0.1, 0.2])
    order = np.arange(grasp.m)[::-1]
    contacts = [
        replace(grasp.contacts[i], position=R @ grasp.contacts[i].position + at, normal=R @ grasp.contacts[i].normal)
        for i in order
    ]
    joints = [
        replace(
            j,
            axis=R @ j.axis,
            origin=R @ j.origin + at,
            moves=tuple(int(np.flatnonzero(order == i)[0]) for i in j.moves),
        )
        for j in grasp.joints
    ]
    turned = Grasp(contacts, joints, grasp.mechanism, grasp.command)
    force = R @ load
    other = maximum(turned, np.r_[force, np.cross(at, force)], loading=FIRST)
    assert other.lower == pytest.approx(one.lower, rel=2e-3)
    assert other.upper == pytest.approx(one.upper, rel=2e-3)


@pytest.mark.parametrize("seed", [30, 31])
def test_millimetres_turned_frames_and_another_order_of_a_random_grasp(seed: int) -> None:
    """A path ends at the same load in other units of length and force, in a turned and shifted frame."""
    case, rng = random_case(3, 16 + seed), np.random.default_rng(seed)
    grasp, load = case.grasp, case.direction
    R = Rotation.random(random_state=seed).as_matrix()
    shift, order, length, force = rng.normal(size=3), rng.permutation(grasp.m).tolist(), 1000.0, 0.25
    other = moved(grasp, R, shift, order, length, force)
    f, t = R @ load[:3], R @ load[3:]
    w = force * np.r_[f, length * (t + np.cross(shift, f))]
    one, two = (maximum(g, d, loading=FIRST, settings=Settings(gap=1e-2)) for g, d in ((grasp, load), (other, w)))
    assert one.verdict is two.verdict is Verdict.HOLDS
    assert two.lower == pytest.approx(one.lower, rel=1.1e-2)
    assert two.path.reached == two.lower
    assert two.verify().ok


@pytest.mark.parametrize(
    ("name", "load"), [("barrett-pear", (0, 0, 1.5)), ("fig9", (0, 0, 4.0)), ("barrett-egg", (0, 1.2, 0))]
)
def test_steps_meet_the_equations_and_their_energy(name: str, load: Any) -> None:
    """w . dr + f_c . dt = sum of c_n (c_n + gap) and what friction takes of the step's motion."""
    grasp = load_grasp(name)
    answer = check(grasp, load, loading=FIRST)
    for m, step in zip(answer.path.magnitudes, answer.path.steps, strict=True):
        w = step.witness
        start = w.grasp.start
        assert (start is None) == (m == 0)
        assert judge.residuals(w.grasp, m * scaled_problem.as_wrench(load), w.state).worst <= 1e-9
        c_n, gaps = w.state.c[::3], np.zeros(grasp.m) if start is None else start.gaps
        put_in = w.energy.disturbance + w.energy.preload
        assert put_in == pytest.approx((c_n * (c_n + gaps)).sum() + w.energy.friction.sum(), abs=1e-8)
        assert (w.energy.friction >= -1e-9).all()


def test_uncertain_normals_and_limits_go_along() -> None:
    grasp = load_grasp("fig9")
    sure, unsure = (maximum(grasp, [0, 1, 0], loading=FIRST, limits=GraspLimits(eta)) for eta in (0.0, 0.02))
    assert unsure.verdict is Verdict.HOLDS
    assert unsure.verify().ok
    assert unsure.lower == pytest.approx(sure.lower, rel=0.05)
    limited = check(jaw(), [-0.6, 0.6, 0], loading=FIRST, limits=GraspLimits(force_limit=1.2))
    assert limited.verdict is Verdict.SLIPS
    assert limited.verify().ok
    assert check(jaw(), [-0.6, 0.6, 0], loading=FIRST, limits=GraspLimits(force_limit=1.31)).verdict is Verdict.HOLDS


def test_soft_fingers_remember_their_turning_only_within_a_step() -> None:
    soft = jaw().with_torsion(0.1)
    answer = maximum(soft, [0, 0, 0, 1, 0, 0], loading=FIRST)
    assert answer.lower == pytest.approx(0.2, rel=2e-3)
    assert answer.verify().ok


def test_what_a_path_does_not_know_is_refused() -> None:
    with pytest.raises(InputError, match="'later'; 'preload-first' or 'together'"):
        check(jaw(), [-1, 0, 0], loading="later")  # type: ignore[call-overload]
    with pytest.raises(InputError, match="needs the maximum dissipation principle"):
        check(jaw(), [-1, 0, 0], loading=FIRST, mdp=False)
    with pytest.raises(InputError, match="cannot be asked with interval"):
        maximum(jaw(), [-1, 0, 0], loading=FIRST, interval=True)
    with pytest.raises(InputError, match="cannot be asked with base"):
        maximum(jaw(), [-1, 0, 0], loading=FIRST, base=[0, 0, -1])
    with pytest.raises(InputError, match="stops: has -1"):
        Start(np.zeros(2), np.array([-1.0]), np.zeros(1))
    with pytest.raises(InputError, match=r"from\.gaps"):
        jaw().with_start(Start(np.zeros(3), np.zeros(1), np.zeros(1)))


def test_rows_of_certificates_hold_at_the_states_of_a_step() -> None:
    """Where nothing slides the balance of energy is an equality at its own reference; so are gaps of what presses."""
    answer = check(jaw(), [-0.6, 0.6, 0], loading=FIRST)
    step = answer.path.steps[-1]
    q, x = step.question, step.witness.state
    at, m = Columns.of(q), q.grasp.m
    kinds = np.array([Row.ENERGY, *[Row.GAP_UP] * m, *[Row.GAP_DOWN] * m])
    index = np.array([0, *range(m), *range(m)])
    none, normal = np.zeros(len(kinds), dtype=np.int64), x.c[::3]
    rows = LeafRows(kinds, index, none, none, none, np.append(normal, 0.0)[None])
    value, right = row_values(q, None, rows)
    point = np.zeros(value.shape[1])
    for part, numbers in ((at.r, x.r), (at.q, x.q), (at.c, x.c), (at.f, x.f)):
        point[part] = numbers
    point[at.n : at.n + 3 * m] = q.grasp.rows[0][: 3 * m] @ np.concatenate([x.r, x.q])
    assert value @ point == pytest.approx(right, abs=1e-8)
    assert np.abs(q.grasp.gaps).min() > 0.1


# --- the replay ---------------------------------------------------------------------------------------


def test_a_path_goes_on_from_numbers_near_the_state_that_is_proved() -> None:
    """As near as the forces are, however far it moves."""
    step = check(jaw(), [-0.6, 0.6, 0], loading=FIRST).path.steps[-1]
    assert step.certain
    p, x = step._problem(step.witness), step.witness.state
    assert step._within(p, x) == 1e-6 * acting(p, x)


@pytest.mark.parametrize(("share", "said"), slow_after(1, [(0.9, "holds"), (1.5, "slips")]))
@pytest.mark.slow
def test_a_state_whose_motion_is_free_is_proved_where_it_stands(share: float, said: str) -> None:
    """The exact state that is found first moves by 1 N else: so the one that was met is proved, to 1e-9."""
    answer = check(load_grasp("tendon-block"), [0, share * 15.5555, 0], loading=FIRST)
    assert answer.verdict == said
    assert answer.exact is False
    assert answer.verify().ok


def test_a_jaw_at_both_stops_is_answered() -> None:
    """A joint at both stops, four contacts in a plane of which two have no friction: no division by zero."""
    contacts = [
        Contact(
            (-0.028164775154036415, 0.010331768508952033, 0.0), (0.9388258384678806, -0.34439228363173446, -0.0), 0.0
        ),
        Contact(
            (0.020540667393467826, -0.021865063069447743, 0.0), (-0.6846889131155942, 0.7288354356482581, -0.0), 0.8
        ),
        Contact(
            (0.029549115864368185, 0.0051816745974775785, 0.0), (-0.9849705288122729, -0.17272248658258596, -0.0), 0.0
        ),
        Contact(
            (0.02962829090416503, 0.004707905914328763, 0.0),
            (-0.987609696805501, -0.1569301971442921, -0.0),
            0.5,
            torsion=0.003,
        ),
    ]
    joint = GraspJoint(
        "j0",
        (0.4969091022943088, -0.5536992342779243, -0.6682054339924995),
        (0.04857844005089825, -0.01696360187388343, -0.04058905703525184),
        (2, 3),
        torque=0.05,
        stop="both",
    )
    grasp = Grasp(contacts, [joint], preload={"j0": 0.21094001287360153})
    load = [
        0.0003391576269927774,
        0.002651051005381965,
        0.0027185737382279668,
        6.679877965856176e-05,
        -2.8820790427379265e-05,
        -2.2820650187379714e-05,
    ]
    assert check(grasp, load, loading=FIRST).verdict in (Verdict.HOLDS, Verdict.SLIPS, Verdict.UNDECIDED)


@pytest.mark.slow
def test_check_does_not_slip_below_what_max_reaches() -> None:
    """`max` goes on to 1.137 in 4 and in 16 steps, `check` of 2 % less ends after paths of 1 and 4 steps."""
    contacts = [
        Contact((0.03, 0.0, 0.0), (-1.0, -0.0, -0.0), 0.5),
        Contact(
            (-0.014999999999999993, 0.02598076211353316, 0.0), (0.4999999999999998, -0.8660254037844387, -0.0), 0.8
        ),
        Contact(
            (-0.015000000000000013, -0.02598076211353315, 0.0), (0.5000000000000004, 0.8660254037844384, -0.0), 0.5
        ),
    ]
    joint = GraspJoint(
        "j0", (0.31958207418098505, -0.9327633670949061, 0.16679268229737348), (0, 0, 0), (1,), "prismatic"
    )
    tendon = Mechanism(("a0",), np.eye(1), np.zeros((0, 1)), (True,))
    grasp = Grasp(contacts, [joint], tendon, {"a0": 0.1})
    load = np.array(
        [
            0.15439669831353287,
            -0.1306124919751299,
            -0.09709722913308345,
            0.0020823072311786104,
            -0.00019744623864604216,
            -0.0039693004098939385,
        ]
    )
    reached = maximum(grasp, load, loading=FIRST).lower
    assert check(grasp, 0.98 * reached * load, loading=FIRST).verdict is not Verdict.SLIPS


@pytest.mark.parametrize("seed", [None, 1])
def test_a_step_that_rounding_leaves_open_ends_no_path(seed: int | None) -> None:
    """From 1.93 the step to 2.57 is left open; shorter ones lead on. The end was found in some frames alone."""
    case = random_case(4, 70003)
    grasp, load = case.grasp, case.direction
    if seed is not None:
        R = Rotation.random(random_state=seed).as_matrix()
        grasp = moved(grasp, R, np.zeros(3), list(range(grasp.m)), 1.0, 1.0)
        load = np.r_[R @ load[:3], R @ load[3:]]
    end = maximum(grasp, load, loading=FIRST)
    assert 2.56 < end.lower < end.upper < 2.6
    assert end.verify().ok


def test_a_state_of_a_path_is_no_rest() -> None:
    """A witness has the grasp of its last step, which begins where the step before ended."""
    answer = check(jaw().with_preload({"jaw": 1.0}), [0, 0.6, 0], loading=FIRST)
    assert answer.witness is not None
    assert answer.witness.grasp.start is not None
    with pytest.raises(InputError, match=r"begins at rest, and this grasp at a state of a path; .*with_start\(None\)"):
        check(answer.witness.grasp, [0, 0.6, 0], loading=FIRST)
    assert check(answer.witness.grasp.with_start(None), [0, 0.6, 0], loading=FIRST).verdict is Verdict.HOLDS


def test_a_path_without_an_end_goes_on_in_ever_larger_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 1/4, from 1 on of a quarter of the way: 1000 is 4 steps and log(1000) / log(1.25) of these away."""
    follower = Follower.of(scaled_problem.build(jaw(), [0, 0, 1]), Settings(), None)
    monkeypatch.setattr(Follower, "step", lambda *_, **__: SimpleNamespace(verdict=Verdict.HOLDS, stop=None))
    monkeypatch.setattr(Follower, "after", lambda *_: jaw())
    monkeypatch.setattr(Follower, "_path", lambda _, __, magnitudes: magnitudes)
    found: Any = follower.to_end(0.25, 0.25, 1000.0)
    assert found[:6] == [0, 0.25, 0.5, 0.75, 1, 1.25]
    assert np.diff(found[5:-1]) == pytest.approx(0.25 * np.array(found[5:-2]))
    assert found[-1] == 1000
    assert len(found) == 5 + 31
