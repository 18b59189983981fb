"""One preload for many loads, and the loads themselves."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.time_limits import PULL, drawn
from handfast import InputError, Settings, Stop, Verdict, check, load_body
from handfast.core.answer import SearchLimits
from handfast.model.body import Body
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.shape import Shape
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.loads import Loads, load_loads
from handfast.stability.studies.hold import HoldOptions, _HoldSearch, moderate
from handfast.stability.studies.questions import hold, maximum, torques
from tests.support.problems import X, Y, Z, bell, nest, pinch

ZERO = np.zeros(3)


def forces(*vectors: np.ndarray) -> Loads:
    return Loads(
        tuple(f"load {k}" for k in range(len(vectors))), np.array([np.concatenate([v, ZERO]) for v in vectors])
    )


# --- hold ---------------------------------------------------------------------------------------


def test_least_preload_of_a_pinch() -> None:
    """Normal forces are T / arm at both tips, friction carries 2 mu T / arm along y and z: T = F arm / (2 mu)."""
    loads = forces(0.5 * Y, -0.4 * Y, 0.3 * Z)
    a = hold(pinch(mu=0.5, arm=0.1), loads)
    assert a.verdict is Verdict.HOLDS
    assert a.upper == pytest.approx(0.05, rel=2e-3)
    assert a.lower == pytest.approx(0.05, rel=2e-3)
    assert a.lower <= a.upper
    assert a.hardest == "load 0"


@pytest.mark.parametrize("load", [1.9, 2.0])
def test_crossed_jaws_end_with_what_is_proved(load: float) -> None:
    """Each jaw moves the object across the other's contacts, whose friction is then used up sideways.

    How much of a load is resisted under a preload of both alike takes a search without an end; a single jaw that
    presses with as much as the load holds it.
    """
    contacts = [Contact(-n, n, 0.5) for n in (X, -X, Y, -Y)]
    joints = [GraspJoint(name, n, ZERO, (k,), "prismatic") for name, n, k in (("x", X, 0), ("y", Y, 2))]
    a = hold(Grasp(contacts, joints, preload={"x": 1.0, "y": 1.0}), forces(-load * Z))
    assert a.verdict is Verdict.HOLDS
    assert a.verify().ok
    assert a.upper <= load * (1 + 1e-4)
    assert a.nodes < 200_000


def test_every_load_is_witnessed_under_the_one_preload() -> None:
    loads = forces(0.5 * Y, -0.4 * Y, 0.3 * Z, 0.2 * X)
    for least in (False, True):
        a = hold(pinch(), loads, least=least)
        assert a.preload is not None
        assert len(a.checks) == len(loads)
        for answer, w in zip(a.checks, loads.wrenches, strict=True):
            assert answer.witness is not None
            assert answer.witness.valid
            np.testing.assert_allclose(answer.witness.wrench, w, atol=1e-12)
            assert answer.witness.grasp.preload == pytest.approx({k: v for k, v in a.preload.items() if v})
            again = check(pinch().with_preload(a.preload), w)
            assert again.verdict is Verdict.HOLDS


def test_nothing_is_commanded_where_nothing_has_to_be() -> None:
    a = hold(pinch(), forces(X, -X))  # locked fingers take what goes along them
    assert (a.verdict, a.preload, a.upper, a.hardest) == (Verdict.HOLDS, {"right": 0.0, "left": 0.0}, 0.0, "")


def test_a_load_that_no_preload_resists_is_named_and_certified() -> None:
    turn = np.concatenate([ZERO, 0.01 * X])  # about the line between the two tips
    a = hold(pinch(), forces(0.1 * Y) + Loads.wrench(turn, "turn"))
    assert (a.verdict, a.preload, a.checks, a.hardest) == (Verdict.SLIPS, None, (), "turn")
    assert a.refuted is not None
    assert a.refuted == ("turn", None)  # G does not even have it


def test_a_load_that_is_too_much_for_friction_is_certified() -> None:
    a = hold(nest(mu=0.3), forces(-Z) + Loads.wrench([0, 0, 1, 0, 0, 0], "up"))
    assert a.refuted is not None
    name, answer = a.refuted
    assert name == "up"
    assert answer is not None
    assert answer.certificate is not None


def test_a_fixture_holds_what_presses_and_not_what_pulls() -> None:
    assert hold(nest(), forces(-Z)).verdict is Verdict.HOLDS
    assert hold(nest(), forces(-Z, Z)).verdict is Verdict.SLIPS


def test_commands_stay_within_their_limit() -> None:
    loads = forces(0.5 * Y)  # needs 0.05
    assert hold(pinch(), loads, command_limit=0.06).upper <= 0.06
    a = hold(pinch(), loads, command_limit=0.04)
    assert a.verdict is Verdict.SLIPS  # shown: the least that `torques` certifies is more
    assert a.refuted is not None
    quick = hold(pinch(), loads, command_limit=0.04, least=False)
    assert quick.verdict is Verdict.SLIPS


def test_the_preload_of_the_grasp_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """What `check` says of it `hold` says too, where no time is left to look for a smaller one."""
    mine, loads = pinch(mu=0.5, arm=0.1, torque=0.08), forces(0.5 * Y, -0.4 * Y, 0.3 * Z)  # 0.05 N m are needed
    assert hold(mine, loads).upper == pytest.approx(0.05, rel=2e-3)  # a smaller one is found
    monkeypatch.setattr(_HoldSearch, "level", lambda search, shape: False)
    a = hold(mine, loads)
    assert (a.verdict, a.preload) == (Verdict.HOLDS, mine.preload)
    assert len(a.checks) == 3
    for weak, options in (
        (mine, {"command_limit": 0.07}),
        (mine, {"actuators": ("left",)}),
        (pinch(mu=0.5, arm=0.1, torque=0.04), {}),
    ):
        assert hold(weak, loads, **options).preload is None
    assert hold(mine, loads, command_limit=0.08).preload == mine.preload


def test_only_the_actuators_asked_for_are_commanded() -> None:
    a = hold(pinch(), forces(0.5 * Y), actuators=["left"])
    assert a.preload == {"left": pytest.approx(0.05, rel=2e-3)}
    with pytest.raises(InputError, match=r"left, right|right, left"):
        hold(pinch(), forces(Y), actuators=["thumb"])


def test_torque_limits_hold_for_the_passive_reaction_too() -> None:
    loads = forces(5 * X)  # a locked right finger carries 5 N at 0.1 m
    assert hold(pinch(), loads).verdict is Verdict.HOLDS
    less = hold(pinch(), loads, limits=GraspLimits(torque_limits={"left": 0.1, "right": 0.1}))
    assert (less.verdict, less.stop, less.hardest) == (Verdict.SLIPS, Stop.COMPLETE, "load 0")
    assert hold(pinch(), loads, limits=GraspLimits(torque_limits={"left": 0.1, "right": 0.6})).verdict is Verdict.HOLDS


@pytest.mark.parametrize("eta", [0.0, 0.1])
@pytest.mark.slow
def test_uncertain_normals_are_asked_about_throughout(eta: float) -> None:
    """1 N along +y is held from the level on at which 0.1 N m hold the maximum: homogeneity.

    With certain normals this is 0.045 N m, see `bell`; where they may be off by 0.1 rad the fingers' lower contacts
    carry some of it, and it is 3 % less.
    """
    a = hold(bell(), forces(Y), limits=GraspLimits(eta=eta), least=False)
    assert a.verdict is Verdict.HOLDS
    assert a.nodes < 10_000  # what is less than 1e-6 above the least level is found among hundreds of thousands
    most = maximum(bell(), [0, 1, 0, 0, 0, 0], limits=GraspLimits(eta=eta))
    assert a.upper == pytest.approx(0.1 / most.lower, rel=1e-4)
    assert a.upper == pytest.approx(0.045 if eta == 0 else 0.0437, rel=1e-3)
    (answer,) = a.checks
    assert answer.question is not None
    assert answer.witness is not None
    assert answer.question.eta == answer.witness.eta == a.limits.eta == eta
    assert a.verify().ok
    assert replace(a, limits=GraspLimits(0.05)).verify().reason == (
        "answer: load 0: the answer is within other limits, or of another law of friction"
    )


def test_a_limit_that_is_hit_is_undecided() -> None:
    a = hold(pinch(), forces(0.5 * Y), timeout=1e-9)
    assert (a.verdict, a.stop, a.preload) == (Verdict.UNDECIDED, Stop.TIME, None)
    nodes = hold(pinch(), forces(0.5 * Y, 0.2 * Z), settings=Settings(nodes=1))
    assert (nodes.verdict, nodes.stop, nodes.preload, nodes.checks) == (Verdict.UNDECIDED, Stop.NODES, None, ())


@given(st.floats(1e-3, 1e3))
@settings(max_examples=10, derandomize=True, deadline=None)
def test_the_preload_scales_with_the_loads(s: float) -> None:
    loads = forces(0.5 * Y, 0.3 * Z)
    many = hold(pinch(), loads.scaled(s))
    assert many.verdict is Verdict.HOLDS
    assert many.lower == pytest.approx(0.05 * s, rel=5e-3)
    assert many.upper == pytest.approx(0.05 * s, rel=5e-3)


def test_moderate_commands() -> None:
    assert moderate(pinch(), forces(2 * Y)) == pytest.approx(10 * 2 * 0.03)  # size: the tips are 30 mm off the middle


# --- loads --------------------------------------------------------------------------------------


def ball(mass: float | None = 2.0) -> Body:
    return Body.of([Shape("sphere", 0.03)], mass=mass, center_of_mass=[0.1, 0.0, 0.0])


def test_gravity_from_all_sides() -> None:
    loads = Loads.gravity(ball())
    assert loads.names == tuple(f"gravity {a}" for a in ("+x", "-x", "+y", "-y", "+z", "-z"))
    np.testing.assert_allclose(loads.wrenches[5], [0, 0, -19.62, 0, 1.962, 0])  # r x f = 0.1 x * -19.62 z
    np.testing.assert_allclose(Loads.gravity(ball(), ["z", np.array([0, 0, 2.0])]).wrenches[:, 2], 19.62)


def test_tipping_turns_gravity_the_other_way() -> None:
    """Tipped by +90 degrees about z, the object's -x points down: a weight that pulled along -y pulls along -x."""
    loads = Loads.tilt(ball(), Z, np.pi / 2, steps=3, down=-Y)
    assert loads.names == ("tipped 0°", "tipped 45°", "tipped 90°")
    np.testing.assert_allclose(loads.wrenches[0, :3], -19.62 * Y, atol=1e-12)
    np.testing.assert_allclose(loads.wrenches[2, :3], -19.62 * X, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(loads.wrenches[:, :3], axis=1), 19.62)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: Loads((), np.zeros((0, 6))), "are empty"),
        (lambda: Loads(("a", "a"), np.ones((2, 6))), "has 'a' twice"),
        (lambda: Loads(("a",), np.full((1, 6), np.nan)), "NaN"),
        (lambda: Loads.gravity(ball(None)), "give the object a mass"),
        (lambda: Loads.gravity(ball(), "down"), r"is 'down'; all, \+x"),
        (lambda: Loads.tilt(ball(), ZERO, 1.0), "is zero; give the axis"),
        (lambda: Loads.tilt(ball(), Z, 1.0, steps=0), "at least 1 orientation"),
        (lambda: forces(X).scaled(-1), "a positive number is needed"),
    ],
)
def test_bad_loads(make: object, match: str) -> None:
    with pytest.raises(InputError, match=match):
        make()  # type: ignore[operator]


def test_loads_file(tmp_path: Path) -> None:
    file = tmp_path / "loads.json"
    file.write_text(json.dumps({"schema": "handfast/loads/1", "loads": {"cut": [1, 2, 3, 4, 5, 6]}}))
    assert load_loads(file).names == ("cut",)
    np.testing.assert_allclose(load_loads(file).wrenches, [[1, 2, 3, 4, 5, 6]])
    for data, match in (
        ({"schema": "handfast/loads/1", "loads": {"cut": [1, 2]}}, r"loads.json: loads.cut"),
        ({"schema": "handfast/loads/1", "loads": {}}, "at least one is needed"),
        ({"schema": "handfast/loads/1", "weights": {}}, "loads: is missing"),
    ):
        file.write_text(json.dumps(data))
        with pytest.raises(InputError, match=match):
            load_loads(file)


def test_bundled_objects_have_weight() -> None:
    assert Loads.gravity(load_body("teapot"), "-y").wrenches[0, 1] == pytest.approx(-0.9 * 9.81)


# --- bounds that have not met -------------------------------------------------------------------


def half_certified(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on the least commands for a load are certified to half of what is found, as after an early stop."""

    def early(*args: object, **kwargs: object) -> object:
        answer = torques(*args, **kwargs)  # type: ignore[arg-type]
        return replace(answer, lower=answer.lower / 2)

    monkeypatch.setattr("handfast.stability.studies.hold.torques", early)


def test_the_lower_bound_is_what_is_certified_not_what_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    half_certified(monkeypatch)
    a = hold(pinch(mu=0.5, arm=0.1), forces(-0.5 * Y, -0.4 * Y))
    assert a.verdict is Verdict.HOLDS
    assert a.upper == pytest.approx(0.05, rel=2e-3)
    assert a.lower == pytest.approx(0.025, rel=2e-3)


def test_a_limit_between_the_bounds_refutes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    half_certified(monkeypatch)
    between = hold(pinch(), forces(-0.5 * Y), command_limit=0.04)
    assert (between.verdict, between.refuted, between.preload) == (Verdict.UNDECIDED, None, None)
    assert hold(pinch(), forces(-0.5 * Y), command_limit=0.02).verdict is Verdict.SLIPS


def test_of_bounds_that_are_not_verified_none_is_claimed_but_what_slips_is_proved() -> None:
    loads = forces(-0.5 * Y, -0.4 * Y)
    unproved = Settings(verify=False)
    a = hold(pinch(mu=0.5, arm=0.1), loads, bounding=unproved)
    assert a.verdict is Verdict.HOLDS
    assert (a.lower, a.bounding) == (0.0, None)
    assert a.upper == pytest.approx(0.05, rel=2e-3)
    slips = hold(pinch(), forces(-0.5 * Y), command_limit=0.02, bounding=unproved)
    assert slips.verdict is Verdict.SLIPS
    assert slips.verify().ok


def test_a_single_actuator_has_one_shape_of_preload(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def counted(*args: object, **kwargs: object) -> object:
        asked.append(args)
        return maximum(*args, **kwargs)  # type: ignore[arg-type]

    monkeypatch.setattr("handfast.stability.studies.hold.maximum", counted)
    hold(pinch(), forces(-0.5 * Y, -0.4 * Y), actuators=["left"])
    assert len(asked) == 2  # one for each load


def test_loads_with_a_known_preload_are_asked_only_for_the_least(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []

    def counted(grasp: Grasp, wrench: np.ndarray, **options: object) -> object:
        asked.append(float(wrench[1]))
        return torques(grasp, wrench, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("handfast.stability.studies.hold.torques", counted)
    monkeypatch.setattr("handfast.stability.studies.hold._HoldSearch.plain", lambda self: [])
    loads, known = forces(-0.5 * Y, -0.4 * Y), {"load 0": {"left": 0.07, "right": 0.07}}
    a = hold(pinch(), loads, least=False, known=known)
    assert (a.verdict, asked) == (Verdict.HOLDS, [-0.4])
    assert a.upper == pytest.approx(0.05, rel=2e-3)  # the known one at the level that all need
    asked.clear()
    assert hold(pinch(), loads, known=known).lower == pytest.approx(0.05, rel=2e-3)
    assert asked == [-0.5, -0.4]


def test_beside_what_is_given_a_shape_is_tried_at_every_size_that_is_proposed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Joints with friction: what holds at one size need not at another, and levels are a guess there."""
    grasp = pinch()
    rubbing = Grasp(grasp.contacts, [replace(joint, friction=0.01) for joint in grasp.joints], preload=grasp.preload)
    search = _HoldSearch(rubbing, forces(-0.5 * Y), HoldOptions(), SearchLimits(None), None)
    monkeypatch.setattr(search, "checked", lambda shape: (object(),) if shape == {"left": 0.02} else ())
    monkeypatch.setattr(search, "resisted", lambda unit, k: 0.0)
    assert not search.level({"left": 1.0})
    assert search.level({"left": 0.02})
    assert search.best is not None
    assert search.best[0] == {"left": 0.02}


# --- margins ------------------------------------------------------------------------------------


def test_margins_are_how_much_of_each_load_is_resisted() -> None:
    """0.05 N m hold 0.5 N across, see above: just that, 1.25 times 0.4 N, and any force that locked fingers take."""
    a = hold(pinch(mu=0.5, arm=0.1), forces(0.5 * Y, -0.4 * Y, 0.2 * X, ZERO), margins=True)
    assert set(a.margins) == {"load 0", "load 1", "load 2"}  # none of a load of 0
    assert a.margin == pytest.approx(1.0, rel=2e-3)
    assert a.margin >= 1
    assert a.weakest == "load 0"
    assert a.margins["load 1"].lower == pytest.approx(1.25, rel=2e-3)
    assert a.margins["load 1"].lower <= a.margins["load 1"].upper <= 1.002 * a.margins["load 1"].lower
    assert a.margins["load 2"].unbounded
    assert a.verify().ok
    without = hold(pinch(), forces(0.5 * Y))
    assert (without.margin, without.weakest, without.margins) == (None, "", {})


def test_what_slips_has_no_margin() -> None:
    assert hold(nest(), forces(Z), margins=True).margin is None


# --- time and interruptions ---------------------------------------------------------------------


class Clock:
    """Stands still until it is turned; counts the looks at it."""

    def __init__(self, step: float = 0.0) -> None:
        self.now, self.step, self.looks = 100.0, step, []  # type: ignore[var-annotated]

    def __call__(self) -> float:
        self.now += self.step
        self.looks.append(self.now)
        return self.now


def test_queries_have_a_share_of_the_time_that_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each takes all of the time that it is given, and decides nothing: together they take no more than there is."""
    clock = Clock()
    monkeypatch.setattr("handfast.core.answer.time.monotonic", clock)
    given: list[float] = []

    def slow(work: Callable[..., Any]) -> Callable[..., Any]:
        def asked(*args: Any, **options: Any) -> Any:
            seconds = options["settings"].timeout
            answer = work(*args, **options | {"settings": Settings(nodes=1)})
            clock.now += seconds
            given.append(seconds)
            open_ = {"verdict": Verdict.UNDECIDED, "stop": Stop.TIME}
            bounds = {"lower": 0.0} if hasattr(answer, "lower") else {}
            return replace(answer, **open_, **bounds, **({"preload": None} if hasattr(answer, "preload") else {}))

        return asked

    for name, work in (("check", check), ("torques", torques), ("maximum", maximum)):
        monkeypatch.setattr(f"handfast.stability.studies.hold.{name}", slow(work))
    a = hold(pinch().with_preload({}), forces(0.5 * Y, 0.4 * Y, 0.3 * Z), timeout=8.0)
    assert (a.verdict, a.stop, a.preload) == (Verdict.UNDECIDED, Stop.TIME, None)
    assert sum(given) <= 8.0
    assert given[0] == 4.0  # half for the first load with all locked
    assert given[1] == 1.0  # a quarter of the four seconds that are left, for three loads and what follows
    assert a.seconds <= 8.0


def test_time_is_kept_for_margins(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    monkeypatch.setattr("handfast.core.answer.time.monotonic", clock)
    given: list[float] = []

    def counted(*args: Any, **options: Any) -> Any:
        given.append(options["settings"].timeout)
        return maximum(*args, **options)

    def late(*args: Any, **options: Any) -> Any:
        clock.now = 107.0
        return check(*args, **options)

    monkeypatch.setattr("handfast.stability.studies.hold.maximum", counted)
    monkeypatch.setattr("handfast.stability.studies.hold.check", late)
    a = hold(pinch(), forces(X, -X), timeout=8.0, margins=True)  # locked fingers take them
    assert (a.verdict, a.upper, len(a.margins)) == (Verdict.UNDECIDED, np.inf, 0)  # 6 s were over
    clock.now = 100.0
    monkeypatch.setattr("handfast.stability.studies.hold.check", check)
    a = hold(pinch(), forces(X, -X), timeout=8.0, margins=True)
    assert (a.verdict, given) == (Verdict.HOLDS, [4.0, 8.0])  # the clock stands still


@pytest.mark.parametrize("ask", ["check", "torques", "max", "interval", "hold"])
def test_nothing_goes_on_after_the_end(ask: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a clock that moves by a tenth of a second with every look, and with a hand of 22 joints."""
    grasp = drawn(5, 2)
    check(grasp, PULL, settings=Settings(nodes=1))  # loads what is compiled
    clock = Clock(0.1)
    monkeypatch.setattr("time.monotonic", clock)
    settings = Settings(timeout=2.0)
    answer: Any
    match ask:
        case "check":
            answer = check(grasp, PULL, settings=settings)
        case "torques":
            answer = torques(grasp, PULL, settings=settings)
        case "hold":
            answer = hold(grasp, Loads(("pull", "push"), np.array([PULL, -PULL])), timeout=2.0)
        case _:
            answer = maximum(grasp, PULL, interval=ask == "interval", settings=settings)
    after = [now for now in clock.looks if now > 102.0]
    assert answer.stop is Stop.TIME
    assert len(after) <= 12, len(after)


@pytest.mark.parametrize("query", ["check", "torques", "maximum"])
def test_ctrl_c_in_a_query_ends_all(query: str, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    works: dict[str, Callable[..., Any]] = {"check": check, "torques": torques, "maximum": maximum}

    def counted(name: str) -> Callable[..., Any]:
        def work(*args: Any, **options: Any) -> Any:
            asked.append(name)
            answer = works[name](*args, **options)
            return replace(answer, stop=Stop.INTERRUPTED) if name == query else answer

        return work

    for name in works:
        monkeypatch.setattr(f"handfast.stability.studies.hold.{name}", counted(name))
    a = hold(pinch().with_preload({}), forces(0.5 * Y, 0.4 * Y))
    assert (a.verdict, a.stop, a.preload) == (Verdict.UNDECIDED, Stop.INTERRUPTED, None)
    assert asked.count(query) == 1
    assert asked[-1] == query


def test_what_was_found_before_ctrl_c_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*args: Any, **options: Any) -> Any:
        return replace(maximum(*args, **options), stop=Stop.INTERRUPTED)

    monkeypatch.setattr("handfast.stability.studies.hold.maximum", interrupted)
    a = hold(pinch(), forces(X, -X), margins=True)
    assert (a.verdict, a.stop, a.margins) == (Verdict.HOLDS, Stop.INTERRUPTED, {})
