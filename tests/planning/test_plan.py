"""The planner: starts, what drops them, which grasps are alike, and that what is kept holds."""

from __future__ import annotations

import json
import pickle
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from handfast import (
    Verdict,
    check,
    close,
    contact_grasp,
    find_contacts,
    load_body,
    load_configuration,
    load_grasp,
    load_hand,
    verify,
)
from handfast.cli.plan import PlanGrasps
from handfast.core.answer import Stop
from handfast.core.errors import InputError
from handfast.geometry.collision import always_meeting
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand.coupling import coupled
from handfast.model.shape import Shape
from handfast.planning.candidates import palm_poses
from handfast.planning.candidates.palm_poses import STANDARD, Sampling, palm_of, sweeps
from handfast.planning.candidates.surface import SurfaceSampler
from handfast.planning.evaluation.attempt import ATTEMPT_REASONS, Attempts, Runner, squeezing
from handfast.planning.plan_grasps import plan
from handfast.planning.question import PlanLimits
from handfast.planning.ranking import difference, most_different
from handfast.planning.results.plan import Plan
from handfast.planning.search import RejectionReason, Tally
from handfast.stability.problem.loads import Loads

HAND = load_hand("barrett-bh8-280")


def ball(radius: float = 0.045, mass: float | None = 0.2) -> Body:
    return Body.of([Shape("sphere", radius)], mass=mass, name="ball")


ONE = Loads.gravity(ball(), "z")
ANGLED = Sampling(aligned=0.0, central=0.0)
SQUARE = Sampling(aligned=1.0, central=0.0, aside=0.0)


@pytest.fixture(scope="module")
def planned() -> Plan:
    return plan(HAND, ball(), count=2, seed=5, jobs=1, attempts=60)


# --- the whole ----------------------------------------------------------------------------------


def test_what_is_kept_holds_touches_and_does_not_overlap(planned: Plan) -> None:
    assert planned.verdict is Verdict.HOLDS
    assert planned.stop is Stop.COMPLETE
    assert len(planned.grasps) == 2
    scene = Scene(HAND, planned.body)
    watched = [p not in always_meeting(scene) for p in scene.self_pairs]
    for g in planned.grasps:
        links, meetings = scene.clearances(g.q, g.pose)
        assert links.min() > -1e-3
        assert meetings[watched].min() > -1e-3
        found = find_contacts(HAND, g.q, planned.body, g.pose)
        assert [c.link for c in found] == [c.link for c in g.grasp.contacts]
        assert len({c.link.split("_")[1] for c in found if c.link != "palm"}) >= 2
        for w in planned.loads.wrenches:
            answer = check(g.grasp, w)
            assert answer.verdict is Verdict.HOLDS
            assert answer.witness is not None
            assert answer.witness.residuals.worst < 1e-9


def test_six_directions_of_gravity_unless_told_otherwise(planned: Plan) -> None:
    assert planned.loads.names == tuple(f"gravity {d}" for d in ("+x", "-x", "+y", "-y", "+z", "-z"))
    np.testing.assert_allclose(np.abs(planned.loads.wrenches[:, :3]).sum(axis=1), 0.2 * 9.81)


def test_every_start_is_accounted_for(planned: Plan) -> None:
    assert planned.tally.passed == 2
    assert set(planned.tally.rejected) <= set(ATTEMPT_REASONS)
    assert planned.tried == planned.found[-1].index + 1
    entry = planned.to_json()
    assert sum(entry["fates"].values()) == entry["tried"] == planned.tried
    assert list(entry["fates"]) == ["kept", *(reason.name.lower() for reason in ATTEMPT_REASONS)]
    assert entry["verdict"] == "holds"


@pytest.mark.slow
def test_the_same_seed_gives_the_same_grasps_on_any_number_of_cores() -> None:
    one, again = (plan(HAND, ball(), loads=ONE, count=2, seed=5, jobs=jobs, attempts=60) for jobs in (1, 2))
    assert [g.index for g in again.grasps] == [g.index for g in one.grasps]
    assert again.tried == one.tried == one.found[1].index + 1
    for a, b in zip(again.grasps, one.grasps, strict=True):
        np.testing.assert_array_equal(a.q, b.q)
        np.testing.assert_array_equal(a.pose, b.pose)
        assert a.grasp.preload == b.grasp.preload
    other = plan(HAND, ball(), loads=ONE, count=1, seed=3, jobs=1, attempts=60)
    assert np.abs(other.grasps[0].pose - one.grasps[0].pose).max() > 1e-3


def test_those_kept_differ(planned: Plan) -> None:
    g = planned.grasps
    assert min(difference(a, b) for i, a in enumerate(g) for b in g[:i]) >= 1


def test_an_object_that_is_too_large_is_not_grasped() -> None:
    body = Body.of([Shape("box", (0.5, 0.5, 0.5))], mass=1.0)
    found = plan(HAND, body, count=1, attempts=4, jobs=1)
    assert found.grasps == ()
    assert found.verdict is Verdict.UNDECIDED
    assert found.stop is Stop.NODES
    assert found.tried == 4


def test_attempts_can_be_sent_to_another_machine(planned: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same attempts there; the time that is left, not the reading of a clock."""
    monkeypatch.setattr(Runner, "measured", lambda _, g, *__: g)  # margins are not asked for
    runner = Runner(planned.asked, time.monotonic() + 50)
    sent = pickle.loads(pickle.dumps(runner))
    assert 40 < sent.until - time.monotonic() <= 50
    number = planned.grasps[0].index
    (one,), (other,) = runner.run(number).found, sent.run(number).found
    assert (one.q == other.q).all()
    assert one.grasp.preload == other.grasp.preload


def test_time_ends_the_search() -> None:
    found = plan(HAND, ball(), count=1000, timeout=0.5, jobs=1)
    assert found.stop is Stop.TIME
    assert found.verdict is Verdict.UNDECIDED


def test_a_command_limit_drops_what_needs_more() -> None:
    found = plan(HAND, ball(), count=1, attempts=5, seed=5, jobs=1, limits=PlanLimits(command_limit=1e-6))
    assert found.tally[RejectionReason.STRONG] > 0
    assert all(g.answer.upper <= 1e-6 for g in found.grasps)


@pytest.mark.slow
def test_torques_of_fingers_that_do_not_touch_may_be_limited() -> None:
    """Grasps do not have the actuators of a finger that is idle."""
    hand, can = load_hand("schunk-sah"), load_body("can")
    found = plan(hand, can, count=1, seed=1, jobs=1, attempts=80, limits=PlanLimits(torque_limits=hand.strengths))
    assert found.grasps
    for own in (g.grasp.mechanism.actuators for g in found.grasps):
        assert set(own) < set(hand.mechanism.actuators)
        assert {n for g in found.grasps for n in g.answer.limits.torque_limits} <= set(own)
    assert found.verify().ok


def test_a_limit_of_an_actuator_that_the_hand_does_not_have_is_refused() -> None:
    with pytest.raises(InputError, match=r"torque limit: unknown actuator 'thumb'; known: finger_1_spread"):
        plan(HAND, ball(), limits=PlanLimits(torque_limits={"thumb": 1.0}))


def test_loads_of_ones_own_need_no_mass() -> None:
    loads = Loads.wrench([0, 0, -1.0, 0, 0, 0])
    found = plan(HAND, ball(mass=None), count=1, attempts=60, seed=5, jobs=1, loads=loads)
    assert found.verdict is Verdict.HOLDS
    assert len(found.grasps[0].answer.checks) == 1


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"count": 0}, "count.*positive"),
        ({"timeout": 0}, "timeout.*positive"),
        ({"attempts": -1}, "attempts.*positive"),
        ({"pool": 0}, "pool: is 0; a positive"),
        ({"seed": -1}, "seed: is -1; a number from 0 on is needed"),
        ({"loads": Loads.wrench([0.0] * 6)}, "loads: are all zero; a force or torque to hold is needed"),
        ({"sampling": Sampling(approach=(0, 0, 0))}, "direction in which the palm"),
        ({"limits": PlanLimits(command_limit=0.0)}, "command_limit.*positive"),
        ({"jobs": -1}, "jobs: is -1; at least 1 is needed"),
    ],
)
def test_bad_input_is_one_clear_line(given: dict[str, object], match: str) -> None:
    with pytest.raises(InputError, match=match):
        plan(HAND, ball(), **{"jobs": 1} | given)  # type: ignore[arg-type]


def test_without_mass_it_says_so() -> None:
    with pytest.raises(InputError, match=r"mass.*unknown"):
        plan(HAND, ball(mass=None))


# --- where a hand grasps ------------------------------------------------------------------------


def test_the_barrett_hand_reaches_forward_between_its_fingers() -> None:
    palm = palm_of(HAND)
    assert palm.axis @ [0, 0, 1] > 0.98
    assert 0.1 < palm.center[2] < 0.25
    assert [HAND.link_names[i] for i in palm.tips] == ["finger_1_dist", "finger_2_dist", "finger_3_dist"]


def test_a_given_approach_is_taken() -> None:
    np.testing.assert_allclose(palm_of(HAND, [2, 0, 0]).axis, [1, 0, 0])


def test_a_hand_that_does_not_close_is_refused() -> None:
    still = replace(HAND, closing=np.zeros(HAND.l))
    with pytest.raises(InputError, match="closing senses"):
        palm_of(still)


def test_coupled_joints_follow_in_every_start() -> None:
    palm, surface = palm_of(HAND), SurfaceSampler(ball())
    lower, upper = HAND.limits.T
    for seed in range(20):
        start = palm_poses.draw(np.random.default_rng(seed), HAND, palm, surface, STANDARD)
        np.testing.assert_array_equal(start.q, coupled(HAND, start.q))
        assert (start.q >= lower).all()
        assert (start.q <= upper).all()
        np.testing.assert_allclose(start.pose[:3, :3] @ start.pose[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(start.pose[:3, :3]) == pytest.approx(1)


def test_a_push_ends_at_the_object_and_the_step_back_frees_it() -> None:
    body = ball()
    scene, palm, surface = Scene(HAND, body), palm_of(HAND), SurfaceSampler(body)
    for seed in range(5):
        start = palm_poses.draw(np.random.default_rng(seed), HAND, palm, surface, STANDARD)
        pose = palm_poses.pushed(scene, start, 0.0)
        assert pose is not None
        assert 0 <= scene.distance(start.q, pose).min() < 2e-4
        back = palm_poses.pushed(scene, start, 0.01)
        assert back is not None
        np.testing.assert_allclose(back[:3, 3] - pose[:3, 3], 0.01 * start.approach, atol=1e-12)


def test_a_hand_that_passes_the_object_is_told() -> None:
    body = ball(0.01)
    start = palm_poses.draw(np.random.default_rng(0), HAND, palm_of(HAND), SurfaceSampler(body), ANGLED)
    aside = np.cross(start.approach, [1.0, 0, 0])
    start.pose[:3, 3] += aside / np.linalg.norm(aside)
    assert palm_poses.pushed(Scene(HAND, body), start, 0.0) is None


def test_a_square_start_closes_across_two_sides() -> None:
    hand, body = load_hand("parallel-gripper"), Body.of([Shape("box", (0.04, 0.05, 0.3))], mass=0.1)
    palm, surface = palm_of(hand), SurfaceSampler(body)
    for seed in range(10):
        start = palm_poses.draw(np.random.default_rng(seed), hand, palm, surface, SQUARE)
        np.testing.assert_allclose(start.approach, palm.axis)
        np.testing.assert_allclose(np.abs(start.pose[:3, :3]).max(axis=0), 1, atol=1e-9)  # axes onto axes


def test_a_look_ahead_sees_what_the_fingers_pass() -> None:
    body = ball()
    scene, palm = Scene(HAND, body), palm_of(HAND)
    pose = np.eye(4)
    pose[:3, 3] = palm.center
    tips = list(palm.tips)
    assert sweeps(scene, palm.anatomy, palm.opened, pose)[tips].all()
    pose[:3, 3] = [0, 0, 1.0]
    assert not sweeps(scene, palm.anatomy, palm.opened, pose).any()


def test_a_gripper_pushes_the_object_to_its_middle() -> None:
    hand = load_hand("parallel-gripper")
    body = Body.of([Shape("box", (0.04, 0.05, 0.06))], mass=0.1)
    runner = Runner(Attempts(hand, body, Loads.gravity(body)))
    pose = np.eye(4)
    pose[:3, 3] = [0, 0.004, 0.1]
    closed, moved = runner._closed(np.zeros(2), pose)
    assert {c.link for c in closed.contacts} == {"left_finger", "right_finger"}
    assert moved[1, 3] == pytest.approx(0, abs=1e-4)
    assert np.abs(moved - pose)[:3, 3].argmax() == 1


def test_surface_points_lie_on_the_surface_with_normals_outwards() -> None:
    for body in (load_body("slab"), load_body("mug")):
        surface, rng = SurfaceSampler(body), np.random.default_rng(1)
        for _ in range(50):
            point, normal = surface.draw(rng)
            assert max(float(p.depth(point[None])[0]) for p in body.pieces) > -2e-3  # curves are faceted
            assert np.linalg.norm(normal) == pytest.approx(1)
            assert normal @ (point - body.center_of_mass) >= 0


# --- what squeezes ------------------------------------------------------------------------------


def test_the_actuator_of_a_coupled_joint_squeezes() -> None:
    hand = load_hand("parallel-gripper")
    body = Body.of([Shape("box", (0.04, 0.05, 0.06))], mass=0.1)
    pose = np.eye(4)
    pose[2, 3] = 0.1
    grasp = contact_grasp(hand, close(hand, np.zeros(2), body, pose).q, body, pose)
    assert squeezing(grasp, {"right_slide"}) == squeezing(grasp, {"left_slide"}) == ("grip",)
    assert squeezing(grasp, set()) == ()


# --- alike --------------------------------------------------------------------------------------


def test_a_grasp_is_like_itself_and_like_one_nearby(planned: Plan) -> None:
    a, b = planned.grasps
    assert difference(a, a) == pytest.approx(0, abs=1e-6)
    assert difference(a, b) == difference(b, a)
    shifted = replace(a, pose=a.pose.copy())
    shifted.pose[:3, 3] += [0.004, 0, 0]
    assert difference(a, shifted) == pytest.approx(0.4)
    bent = replace(a, q=a.q + np.eye(HAND.l)[1] * 0.3)
    assert difference(a, bent) == pytest.approx(2)
    assert difference(a, bent, prismatic=np.arange(HAND.l) == 1) == pytest.approx(20)
    assert most_different([a, shifted, b], 2)[1] is b
    assert [id(g) for g in most_different([a, b], 5)] == [id(a), id(b)]
    assert most_different([], 2) == []


# --- the command --------------------------------------------------------------------------------


def command(tmp_path: Path, **options: object) -> PlanGrasps:
    return PlanGrasps(hand="barrett-bh8-280", object="ball", jobs=1, output=tmp_path / "out", **options)  # type: ignore[arg-type]


@pytest.mark.slow
def test_the_command_writes_files_that_load(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(tmp_path, count=1, seed=5, json=True).run() == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer == json.loads((tmp_path / "out" / "plan.json").read_text("utf-8"))
    assert len(answer["grasps"]) == 1
    for entry in answer["grasps"]:
        grasp = load_grasp(tmp_path / "out" / entry["grasp_file"])
        placed = load_configuration(tmp_path / "out" / entry["configuration_file"])
        hand, q = placed.applied(load_hand(placed.hand or ""))
        body = load_body(placed.object or "")
        found = find_contacts(hand, q, body, placed.pose)
        np.testing.assert_allclose([c.position for c in found], [c.position for c in grasp.contacts], atol=1e-9)
        assert grasp.preload == placed.preload == entry["preload"]
        assert check(grasp, body.gravity_wrench([0, 0, -1])).verdict is Verdict.HOLDS
    with pytest.raises(InputError, match="holds a plan already"):
        command(tmp_path, count=1).run()


def test_what_stands_in_place_of_the_files_is_measured_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mesh in millimetres, another friction than its file's, a hand with dry friction that the plan leaves out."""
    joint = '<joint name="{0}" axis="0 {1} 0" range="-30 60" frictionloss="0.01"/>'
    finger = '<body name="{0}" pos="{1} 0 0.02">{2}<geom type="capsule" fromto="0 0 0 0 0 0.08" size="0.01"/></body>'
    bodies = "".join(
        finger.format(n, x, joint.format(f"{n}_knuckle", s)) for n, x, s in (("a", -0.04, 1), ("b", 0.04, -1))
    )
    motors = "".join(f'<motor name="{n}_motor" joint="{n}_knuckle"/>' for n in "ab")
    text = f'<worldbody><geom type="cylinder" size="0.05 0.01"/>{bodies}</worldbody><actuator>{motors}</actuator>'
    (tmp_path / "hand.xml").write_text(f"<mujoco>{text}</mujoco>")
    trimesh.creation.box((40, 60, 60)).export(tmp_path / "box.obj")
    asked = PlanGrasps(hand=str(tmp_path / "hand.xml"), object=str(tmp_path / "box.obj"), output=tmp_path / "out")
    asked = replace(asked, scale=0.001, friction=0.9, mass=0.1, wrench=((0.0, 0.0, -0.5, 0, 0, 0),), count=1, jobs=1)
    assert asked.run() == 0
    assert verify(tmp_path / "out").ok, verify(tmp_path / "out").reason
    file = tmp_path / "out" / "plan.json"
    said = json.loads(file.read_text())
    assert said["scene"] == {"joint_laws": "stops,springs", "backdrivable": [], "friction": 0.9, "scale": 0.001}
    file.write_text(json.dumps(said | {"scene": said["scene"] | {"joint_laws": "all"}}))
    assert "joints[0].friction is missing" in verify(tmp_path / "out").reason
    file.write_text(json.dumps(said | {"scene": said["scene"] | {"friction": 0.8}}))
    assert "do not touch there so" in verify(tmp_path / "out").reason
    file.write_text(json.dumps(said | {"scene": {"scale": "large"}}))
    with pytest.raises(InputError, match=r"plan\.json: scene\.scale: "):
        verify(tmp_path / "out")


def test_a_margin_that_was_not_asked_is_told_with_its_reason(planned: Plan, capsys: pytest.CaptureFixture[str]) -> None:
    first, *others = planned.grasps
    cut = replace(planned, grasps=(*others, replace(first, quality=None)), stop=Stop.TIME)
    PlanGrasps(hand="barrett-bh8-280", object="ball.json")._show(cut)
    said = capsys.readouterr().out
    assert "not asked" in said
    assert "Not asked of 1 grasp before the time ran out." in said


@pytest.mark.slow
def test_fewer_than_asked_for_is_undecided(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(tmp_path, count=50, attempts=3).run() == 3
    out = capsys.readouterr().out
    assert "of 50 asked for (stopped: nodes)" in out
    assert "what became of the starts" in out


def test_a_mesh_without_mass_is_refused_before_it_is_taken_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "no.stl").write_text("never read")
    for up in ((), ("z",)):
        one = PlanGrasps(hand="barrett-bh8-280", object=str(tmp_path / "no.stl"), up=up)
        with pytest.raises(InputError, match=r"no\.stl: mass: is unknown; give --mass KG"):
            one.run()
    one.mass = 1.0
    with pytest.raises(InputError, match=r"cannot be read as a mesh|has no triangles"):
        one.run()


def test_few_starts_that_time_ended_say_nothing(planned: Plan) -> None:
    missed = Tally()
    missed.add(RejectionReason.MISSES, 9)
    none = replace(planned, grasps=(), tally=missed, stop=Stop.TIME)
    assert none.diagnosis == []
    assert "do not reach" in replace(none, stop=Stop.FRUITLESS).diagnosis[0]
    missed.add(RejectionReason.MISSES)
    assert "do not reach" in none.diagnosis[0]


def test_the_command_refuses_before_it_works(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(InputError, match="is a file; a folder is needed"):
        command(tmp_path).run()
    with pytest.raises(InputError, match="-1, 0 or 1"):
        PlanGrasps(hand="barrett-bh8-280", object="ball", closing=((("finger_1_prox", 2.0),),)).run()
