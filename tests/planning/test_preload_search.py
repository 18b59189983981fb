"""A preload that is looked for with a part of the contacts holds with all of them, or is not told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from handfast.core.answer import Verdict
from handfast.model.body import Body
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape
from handfast.planning.evaluation import preload_search
from handfast.planning.evaluation.preload_search import PART_CONTACTS, PART_TOLERANCE, PreloadSearch, spanning
from handfast.planning.filters.balance import imbalance
from handfast.planning.question import PlanLimits
from handfast.stability.problem.loads import Loads
from handfast.stability.studies.hold import HoldAnswer

BODY = Body.of([Shape("box", [0.06] * 3)], mass=0.1, friction=0.5)
TURNED = np.radians([-3, 3])
SIZE = np.hypot(0.03, 0.01)  # [m] of the pads: from the middle of the contacts to each


def jaws(turned: Sequence[float]) -> list[Contact]:
    """Two pads, each with facets of an upright cylinder that are turned by some angles, two contacts on a facet."""
    return [
        Contact(
            np.array([0.03 * side * np.cos(t), -0.03 * np.sin(t), z]),
            np.array([-side * np.cos(t), np.sin(t), 0]),
            0.5,
            "jaw" if side > 0 else "palm",
        )
        for side in (-1, 1)
        for t in turned
        for z in (-0.01, 0.01)
    ]


def clamped(contacts: Sequence[Contact]) -> Grasp:
    """One of the pads slides towards the other."""
    moved = tuple(i for i, c in enumerate(contacts) if c.link == "jaw")
    slide = GraspJoint("slide", np.array([-1.0, 0, 0]), np.array([0.05, 0, 0]), moved, "prismatic")
    return Grasp(contacts, [slide], Mechanism.direct(["slide"]))


def search(**limits: float) -> PreloadSearch:
    return PreloadSearch(BODY, Loads.gravity(BODY), PlanLimits(**limits))  # type: ignore[arg-type]


@pytest.mark.parametrize(("most", "holds"), [(100.0, True), (0.1, False)])
def test_an_actuator_that_moves_no_contact_may_have_a_limit(most: float, holds: bool) -> None:
    """The hand has it, the grasp does not; each pad presses with 0.98 N or more to carry 0.1 kg at friction 0.5."""
    grasp, limits = clamped(jaws([0.0])), PlanLimits(torque_limits={"slide": most, "thumb": 1e-3})
    answer, _ = PreloadSearch(BODY, Loads.gravity(BODY), limits).run(grasp, 4, clamped, ("slide",))
    assert (answer.verdict is Verdict.HOLDS) == holds
    assert answer.limits == limits.of_grasp(grasp)
    assert answer.limits.torque_limits == {"slide": most}


def test_of_many_contacts_a_part_is_asked_and_all_of_them_hold() -> None:
    grasp = clamped(jaws(TURNED))
    assert grasp.m > PART_CONTACTS
    answer, how = search().run(grasp, 24, clamped, ("slide",))
    assert answer.verdict is Verdict.HOLDS
    assert (how.touching, how.searched) == (24, 4)
    assert 0 < how.error <= PART_TOLERANCE
    assert answer.grasp is not None
    assert answer.grasp.m == grasp.m
    assert all(a.witness is not None and a.witness.grasp.m == grasp.m for a in answer.checks)
    assert answer.verify().ok


def test_few_contacts_are_asked_as_they_are() -> None:
    grasp = clamped(jaws([0.0]))
    answer, how = search().run(grasp, 4, clamped, ("slide",))
    assert answer.verdict is Verdict.HOLDS
    assert (how.searched, how.error) == (4, 0.0)
    assert answer.lower <= 0.981 <= answer.upper <= 1.001 * 0.981  # 2 mu N holds the weight


@pytest.mark.parametrize(
    ("of_part", "command"),
    [
        (Verdict.SLIPS, 0.5),
        (Verdict.UNDECIDED, 0.5),
        (Verdict.HOLDS, 0.5),  # half of what all contacts need
        (Verdict.HOLDS, 5.0),  # they hold with it, but it is more than is allowed
    ],
)
def test_where_a_part_gives_nothing_all_are_asked(
    of_part: Verdict, command: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    grasp, asked = clamped(jaws(TURNED)), []
    known = search().found(clamped(jaws([0.0])), ("slide",))
    weak = replace(known, verdict=of_part, preload={"slide": command}, upper=command)

    def found(_: PreloadSearch, g: Grasp, actuators: tuple[str, ...]) -> HoldAnswer:
        asked.append(g.m)
        return weak if len(asked) == 1 else known

    monkeypatch.setattr(PreloadSearch, "found", found)
    answer, how = search(command_limit=2.0).run(grasp, 8, clamped, ("slide",))
    assert asked == [4, 8]
    assert (how.searched, how.error) == (8, 0.0)
    assert answer is known


def test_a_preload_is_raised_within_limits_until_all_contacts_hold() -> None:
    grasp = clamped(jaws([0.0]))
    known = search().found(grasp, ("slide",))

    def of_part(command: float, **limits: float) -> Verdict:
        part = replace(known, preload={"slide": command}, upper=command)
        answer = search(**limits).of_all(grasp, part)
        if answer.verdict is Verdict.HOLDS:
            assert answer.preload is not None
            assert answer.preload["slide"] >= 0.981
            assert answer.verify().ok
        else:
            assert answer.preload is None
            assert not answer.checks
        return answer.verdict

    assert of_part(1.0) is Verdict.HOLDS
    assert of_part(0.8) is Verdict.HOLDS
    assert of_part(0.8, command_limit=0.9) is Verdict.UNDECIDED
    assert of_part(0.5) is Verdict.UNDECIDED


@pytest.mark.parametrize(
    ("command", "strength"),
    [
        ({"slide": 13.0}, 0.1),  # a force as it is
        ({"turn": 13.0 * SIZE}, 0.1),  # a torque as a force at the grasp's size
        ({"pull": 13.0}, 0.1),  # of a tendon, whatever it turns
        ({"slide": 13.0, "turn": 26.0 * SIZE, "pull": 39.0}, 0.3),
        ({"slide": -52.0}, 0.4),
        ({}, 0.0),
    ],
)
def test_the_strength_of_commands(command: dict[str, float], strength: float) -> None:
    """Allowed are 10 times the largest load: 10 N and a torque of 3 N at the grasp's size, 130 N in all."""
    joints = [
        GraspJoint("slide", np.array([-1.0, 0, 0]), np.array([0.05, 0, 0]), (4, 5), "prismatic"),
        GraspJoint("turn", np.array([0, 1.0, 0]), np.array([0.03, 0, -0.1]), (6, 7)),
    ]
    R = np.array([[1.0, 0], [0, 1], [0, 2]])
    mechanism = Mechanism(("slide", "turn", "pull"), R, np.zeros((0, 2)), (False, False, True))
    grasp = Grasp(jaws(TURNED), joints, mechanism, command)
    assert grasp.size == pytest.approx(SIZE)
    wrenches = np.array([[6.0, 0, 0, 0, 0, 0], [0, 0, -10, 3 * SIZE, 0, 0]])
    asked = PreloadSearch(BODY, Loads(("push", "tip"), wrenches), PlanLimits())
    assert asked.strength(grasp) == pytest.approx(strength)
    limited = PreloadSearch(BODY, Loads(("push", "tip"), wrenches), PlanLimits(command_limit=26.0))
    assert limited.strength(grasp) == pytest.approx(max(map(abs, command.values()), default=0.0) / 26.0)


UP = np.array([0.0, 0.0, 1.0])


def contact(x: float, y: float, *, z: float = 0.0, normal: object = UP, link: str = "pad") -> Contact:
    n = np.asarray(normal, dtype=float)
    return Contact(np.array([x, y, z]), n / np.linalg.norm(n), 0.5, link)


def test_corners_of_a_face_and_ends_of_a_line_stay() -> None:
    grid = [contact(0.01 * i, 0.01 * j) for i in range(3) for j in range(3)]
    assert spanning(grid) == (grid[0], grid[2], grid[6], grid[8])
    line = [contact(0.01 * i, 0.005 * i) for i in (1, 0, 3, 2)]
    assert spanning(line) == (line[1], line[2])
    assert spanning(line[:1]) == (line[0],)
    assert spanning(()) == ()


@pytest.mark.parametrize(
    "other",
    [
        contact(0.01, 0, link="tip"),
        contact(0.01, 0, z=1e-3),
        contact(0.01, 0, normal=(0.01, 0, 1)),
        Contact(np.array([0.01, 0, 0]), UP, 0.4, "pad"),
    ],
)
def test_only_contacts_of_one_face_stand_for_each_other(other: Contact) -> None:
    ends = [contact(0, 0), contact(0.02, 0)]
    assert spanning([*ends, other]) == (*ends, other)
    assert spanning([*ends, contact(0.01, 0)]) == tuple(ends)


def test_of_many_corners_the_four_that_are_spread_most_stay() -> None:
    around = np.radians([0, 40, 90, 140, 180, 220, 270, 320])
    ring = [contact(0.02 * np.cos(a), 0.01 * np.sin(a)) for a in around]
    few = spanning(ring)
    assert few == (ring[0], ring[2], ring[4], ring[6])
    rng = np.random.default_rng(0)
    loads = rng.standard_normal((30, 6)) * [1, 1, 1, 0.01, 0.01, 0.01]
    whole, spanned = (imbalance(Grasp(c), loads) for c in (ring, few))
    assert (spanned[whole > 0] > 0).all()  # nothing is balanced that the whole face does not balance


def test_no_load_is_lost() -> None:
    rng = np.random.default_rng(3)
    below = [contact(*rng.uniform(-0.02, 0.02, 2)) for _ in range(12)]
    above = [contact(*rng.uniform(-0.02, 0.02, 2), z=0.03, normal=-UP, link="jaw") for _ in range(12)]
    few = spanning([*below, *above])
    assert len(few) < 20
    loads = rng.standard_normal((30, 6)) * [1, 1, 1, 0.01, 0.01, 0.01]
    whole, spanned = (imbalance(Grasp(c), loads) for c in ((*below, *above), few))
    np.testing.assert_array_equal(whole > 0, spanned > 0)
    assert not whole.all()


def test_a_preload_is_not_looked_for_after_the_plan_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """No query is given more than the time that is left of the plan, nor more than the patience with one grasp."""
    given: list[float] = []
    grasp = clamped(jaws(TURNED.tolist()))

    def told(*_: object, timeout: float, **__: object) -> None:
        given.append(timeout)

    monkeypatch.setattr(preload_search, "held", told)
    monkeypatch.setattr(preload_search.time, "monotonic", lambda: 100.0)
    for until in (np.inf, 107.0, 90.0):
        PreloadSearch(BODY, Loads.gravity(BODY), PlanLimits(), until).found(grasp, ())
    assert given == [preload_search.PRELOAD_TIMEOUT, 7.0, preload_search.MIN_PRELOAD_TIME]
