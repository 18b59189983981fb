"""Clearances worked out by hand, penetration that a contact must not hide, and directions that take links apart."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handfast.core.errors import InputError
from handfast.core.transforms import quaternion_matrix, transform
from handfast.geometry.collision import Collisions, Requested, SeparationVector, always_meeting, samples
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand import Hand, Joint, Link
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.synthesis.task_file import load_task
from tests.support.feasible import Feasible
from tests.support.places import FEASIBLE as FEASIBLE_FILE
from tests.support.places import SHARED

FEASIBLE = json.loads(FEASIBLE_FILE.read_text("utf-8"))["tasks"]
NO_MOTION = Mechanism((), np.zeros((0, 0)), np.zeros((0, 0)), ())
HERE = np.eye(4)
FLOOR = Shape("box", (0.2, 0.2, 0.1), transform([0, 0, -0.05]))  # its upper face is z = 0


def fixture(*shapes: Shape, **links: tuple[Shape, ...]) -> Hand:
    """A hand without joints: a link "tip" of these shapes, and others by name."""
    parts = [Link("base", -1, HERE), Link("tip", 0, HERE, (), shapes)]
    parts += [Link(name, 0, HERE, (), solids) for name, solids in links.items()]
    return Hand("fixture", tuple(parts), (), NO_MOTION, (), np.zeros(0))


def over(hand: Hand, *pieces: Shape, **options: float) -> Collisions:
    return Collisions(Scene(hand, Body.of(pieces or [FLOOR])), **options)


def turned(angle: float) -> np.ndarray:
    """Rotation about y that raises +x."""
    return np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])


def asked(x: float, y: float, z: float, down: float = -1.0, link: str = "tip") -> Requested:
    return Requested(link, np.array([x, y, z]), np.array([0, 0, down]))


NONE = np.zeros(0)
SLOPE = 0.1


def tilted(depth: float) -> Shape:
    """A finger 8 mm wide whose lower edge lies along y at x = 0, `depth` under the floor, rising with x."""
    R = turned(np.arctan(SLOPE))
    middle = np.array([0, 0, -depth]) + R @ [0.02, 0, 0.005]
    return Shape("box", (0.04, 0.008, 0.01), transform(middle, R))


# --- at a contact and beside it ---------------------------------------------------------------------


def test_a_fingertip_that_just_touches_is_free() -> None:
    check = over(fixture(Shape("sphere", 0.01, transform([0, 0, 0.01]))))
    found = check.clearances(NONE, HERE, [asked(0, 0, 0)])
    assert found.free(depth=0, at_contacts=1e-6)
    np.testing.assert_allclose(found.at_contacts, 0, atol=1e-7)
    assert found.least_to_object == found.cutoff
    assert check.separations(NONE, HERE, [asked(0, 0, 0)], margin=5e-3) == []


@pytest.mark.parametrize("depth", [-3e-3, 2e-4, 2e-3])
def test_the_depth_at_a_contact_is_not_held_against_the_rest(depth: float) -> None:
    ball = Shape("sphere", 0.004, transform([0, 0, 0.004 - depth]))
    found = over(fixture(ball)).clearances(NONE, HERE, [asked(0, 0, 0)])
    np.testing.assert_allclose(found.at_contacts, -depth, atol=1e-7)
    assert found.least_to_object == found.cutoff
    assert found.free(at_contacts=2.1e-3)
    assert found.free() == (depth < 1e-3)
    without = over(fixture(ball)).clearances(NONE, HERE)
    assert without.least_to_object == pytest.approx(-depth, abs=1e-7)


def test_a_contact_does_not_hide_what_is_pressed_in_beside_it() -> None:
    check = over(fixture(tilted(2e-3)))
    found = check.clearances(NONE, HERE, [asked(0, 0, -1e-3)])
    assert found.at_contacts[0] == pytest.approx(-2e-3, abs=1e-6)
    # beside the disc the corner at y = 4 mm is 2 mm - SLOPE * 3 mm deep; samples are 5/3 mm apart
    assert -1.72e-3 <= found.least_to_object <= -1.72e-3 + SLOPE * 3e-3
    (push,) = check.separations(NONE, HERE, [asked(0, 0, -1e-3)])
    assert push.distance == found.least_to_object
    # off the floor if a corner of the finger is found, along the finger's face if a point of the floor is
    assert np.cos(np.arctan(SLOPE)) - 1e-6 <= push.direction[2] <= 1 + 1e-9
    np.testing.assert_allclose(push.point_a - push.point_b, push.distance * push.direction, atol=1e-8)


@pytest.mark.parametrize("height", [-0.06, 0.0, 0.06])
@pytest.mark.parametrize("pressed", ["hand", "object"])
def test_only_what_overlaps_is_looked_through_wherever_it_is(pressed: str, height: float) -> None:
    """A blade of 1 mm whose lower edge is 2 mm deep at the contact and rises by 1 in 10, with the floor at a height.

    Beside the disc it is 1.5 mm deep, at the next sample a third of a radius on. No point of the floor is deeper in the
    blade than half of its width.
    """
    R = turned(np.arctan(SLOPE))
    blade = Shape("box", (0.04, 0.001, 0.01), transform(np.array([0, 0, height - 2e-3]) + R @ [0.02, 0, 0.005], R))
    floor = Shape("box", (0.2, 0.2, 0.1), transform([0, 0, height - 0.05]))
    mine, its = (blade, floor) if pressed == "hand" else (floor, blade)
    down = -1.0 if pressed == "hand" else 1.0
    found = over(fixture(mine), its).clearances(NONE, HERE, [asked(0, 0, height - 1e-3, down=down)])
    assert found.at_contacts[0] == pytest.approx(-2e-3, abs=1e-6)
    assert -1.51e-3 <= found.least_to_object <= -1.5e-3 + SLOPE * 2e-3


def test_a_disc_that_holds_the_whole_overlap_leaves_nothing() -> None:
    check = over(fixture(tilted(2e-3)), radius=0.025)
    found = check.clearances(NONE, HERE, [asked(0, 0, -1e-3)])
    assert found.at_contacts[0] == pytest.approx(-2e-3, abs=1e-6)
    assert found.least_to_object == found.cutoff
    assert check.separations(NONE, HERE, [asked(0, 0, -1e-3)]) == []


def test_the_object_pressed_into_a_flat_hand_is_seen_as_well() -> None:
    """The same wedge with the parts changed over: no corner of the hand is anywhere near."""
    check = over(fixture(FLOOR), tilted(2e-3))
    found = check.clearances(NONE, HERE, [asked(0, 0, -1e-3, down=1)])
    assert -1.72e-3 <= found.least_to_object <= -1.72e-3 + SLOPE * 3e-3
    (push,) = check.separations(NONE, HERE, [asked(0, 0, -1e-3, down=1)])
    assert np.cos(np.arctan(SLOPE)) - 1e-6 <= -push.direction[2] <= 1 + 1e-9


@pytest.mark.parametrize(
    "wrong",
    [asked(0.03, 0, 0), asked(0, 0, -1e-3, down=1), asked(0, 0, -1e-3, link="other")],
    ids=["elsewhere", "from the other side", "another link"],
)
def test_only_a_contact_of_the_link_at_the_place_from_its_side_exempts(wrong: Requested) -> None:
    hand = fixture(tilted(2e-3), other=(Shape("sphere", 0.01, transform([0, 0, 0.2])),))
    found = over(hand).clearances(NONE, HERE, [wrong])
    assert found.least_to_object == pytest.approx(-2e-3, abs=1e-6)
    assert found.nearest_link == "tip"
    assert found.reasons()[0] == "tip is 2 mm inside the object"


def test_another_solid_of_the_touching_link_is_judged() -> None:
    ball = Shape("sphere", 0.01, transform([0, 0, 0.01]))
    knob = Shape("sphere", 0.005, transform([0.03, 0, 0.001]))
    found = over(fixture(ball, knob)).clearances(NONE, HERE, [asked(0, 0, 0)])
    assert found.at_contacts[0] == pytest.approx(0, abs=1e-7)
    assert found.least_to_object == pytest.approx(-4e-3, abs=1e-7)


def test_a_contact_on_a_face_is_measured_where_it_is() -> None:
    """Two faces meet: the pair's nearest point is at one corner, the contact at another."""
    plate = Shape("box", (0.1, 0.1, 0.01), transform([0, 0, 0.005 - 3e-4]))
    corners = [asked(x, y, 0) for x in (-0.04, 0.04) for y in (-0.04, 0.04)]
    found = over(fixture(plate)).clearances(NONE, HERE, corners)
    np.testing.assert_allclose(found.at_contacts, -3e-4, atol=1e-7)
    assert found.least_to_object == pytest.approx(-3e-4, abs=1e-7)


def test_a_link_without_solids_cannot_touch() -> None:
    found = over(fixture(Shape("sphere", 0.01))).clearances(
        NONE, transform([0, 0, -0.2]), [asked(0, 0, 0, link="base")]
    )
    assert found.at_contacts.tolist() == [found.cutoff]


# --- the whole hand ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sah() -> Collisions:
    return Collisions(Scene(load_hand("schunk-sah"), load_body("jar")), cutoff=0.03)


def placed(hand: Hand, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A random configuration within the limits, and an object pose about the fingers."""
    rng = np.random.default_rng(seed)
    q = hand.limits[:, 0] + rng.random(hand.l) * np.ptp(hand.limits, axis=1)
    return q, transform(rng.uniform([0.02, -0.05, 0.08], [0.12, 0.05, 0.25]), quaternion_matrix(rng.normal(size=4)))


@settings(max_examples=25, derandomize=True, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_without_contacts_it_is_the_scene_s_own_distances(sah: Collisions, seed: int) -> None:
    q, pose = placed(sah.scene.hand, seed)
    found = sah.clearances(q, pose)
    links, between = sah.scene.clearances(q, pose, sah.cutoff)
    np.testing.assert_allclose(found.to_object, links, atol=1e-9)
    np.testing.assert_allclose(found.between, between, atol=1e-9)
    assert found.free() == (links.min() >= -1e-3 and between.min() >= -1e-3)


@settings(max_examples=25, derandomize=True, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_a_push_says_how_the_distance_changes(sah: Collisions, seed: int) -> None:
    hand, h = sah.scene.hand, 1e-5
    q, pose = placed(hand, seed)
    dq = np.random.default_rng(seed).normal(size=hand.l)
    pushes = sah.separations(q, pose, margin=0.03)
    assert [p.distance for p in pushes] == sorted(p.distance for p in pushes)
    before, after = (sah.scene.clearances(q + s * h * dq, pose, 0.1) for s in (-1, 1))
    for push in nearest_of_links(pushes):
        J = hand.jacobian(push.link_a, push.point_a, q)
        side, k = 0, push.link_a
        if push.link_b is not None:
            J = J - hand.jacobian(push.link_b, push.point_b, q)
            side, k = 1, sah.scene.self_pairs.index((push.link_a, push.link_b))
        change = (after[side][k] - before[side][k]) / (2 * h)
        assert push.direction @ J @ dq == pytest.approx(change, abs=2e-3)
        np.testing.assert_allclose(push.point_a - push.point_b, push.distance * push.direction, atol=1e-6)


@settings(max_examples=25, derandomize=True, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_a_contact_only_ever_excuses(sah: Collisions, seed: int) -> None:
    """Asked for at the deepest point of each link: no link is deeper than before, and what is excused is told."""
    q, pose = placed(sah.scene.hand, seed)
    before = sah.clearances(q, pose)
    near = {n.link: n for n in sorted(sah.scene.nearest(q, pose, 0.005), key=lambda n: -n.distance)}
    names = sah.scene.hand.link_names
    requested = [Requested(names[n.link], (n.on_hand + n.on_object) / 2, n.normal) for n in near.values()]
    after = sah.clearances(q, pose, requested)
    assert (after.to_object >= before.to_object - 1e-6).all()
    for n, inside in zip(near.values(), after.at_contacts, strict=True):
        assert inside == pytest.approx(n.distance, abs=1e-9)
    np.testing.assert_allclose(after.between, before.between, atol=1e-12)
    for push in sah.separations(q, pose, requested, margin=0):
        assert push.distance < 0
        np.testing.assert_allclose(np.linalg.norm(push.direction), 1, atol=1e-9)


def nearest_of_links(pushes: list[SeparationVector]) -> list[SeparationVector]:
    """The nearest pair of solids of each pair of links, whose distance is that of the links."""
    first: dict[tuple[int, int | None], SeparationVector] = {}
    for push in pushes:
        first.setdefault((push.link_a, push.link_b), push)
    return list(first.values())


@pytest.mark.parametrize("name", sorted(FEASIBLE))
def test_configurations_that_meet_their_task_are_free(name: str) -> None:
    task, held = load_task(name), Feasible.of(FEASIBLE[name])
    assert task.object is not None
    spots = zip(task.contact_pairs, held.points(task), held.normals(task), strict=True)
    requested = [Requested(t.link, p, n) for t, p, n in spots]
    found = Collisions(Scene(task.hand, load_body(task.object))).clearances(held.q(task), held.pose, requested)
    assert found.reasons(depth=1e-6, at_contacts=1e-6, self_depth=1e-6) == ()
    # the palm's region of the incision lies on the knuckle beside the palm's own box
    modelled = [k for k, t in enumerate(task.contact_pairs) if not (name == "scalpel-incision" and t.link == "palm")]
    assert np.abs(found.at_contacts[modelled]).max() < 1.5e-4


# --- the hand and itself ----------------------------------------------------------------------------


def ball(name: str, parent: int, x: float, joint: int, radius: float = 0.01) -> Link:
    return Link(name, parent, HERE, (joint,), (Shape("sphere", radius, transform([x, 0, 0])),))


def jointed(lower: float, upper: float) -> Hand:
    """Three links in a chain about z, the last always within the first; beside them one that can go there."""
    joints = tuple(Joint(f"j{k}", "revolute", [0, 0, 1], [0, 0, 0], lower, upper) for k in range(3))
    base = Link("base", -1, HERE, (), (Shape("sphere", 0.03),))
    links = (base, ball("inner", 0, 0.05, 0), ball("outer", 1, 0.035, 1), ball("side", 0, 0.05, 2))
    return Hand("nest", links, joints, Mechanism.direct(["j0", "j1", "j2"]), (), np.zeros(3))


def test_links_that_overlap_whatever_the_joints_do_are_left_out_and_named() -> None:
    hand = jointed(-1.5, 1.5)
    scene = Scene(hand, Body.of([FLOOR]))
    assert always_meeting(scene) == ((0, 2),)
    check = Collisions(scene)
    found = check.clearances(np.array([0.0, 0.0, 1.0]), transform([0, 0, -1]))
    assert found.left_out == (("base", "outer"),)
    assert found.free()
    assert ("base", "outer") not in found.pairs
    crossed = check.clearances(np.zeros(3), transform([0, 0, -1]))
    assert crossed.reasons() == ("inner meets side by 20 mm", "outer meets side by 5 mm")
    assert crossed.nearest_pair == ("inner", "side")
    judged = Collisions(scene, left_out=()).clearances(np.array([0.0, 0.0, 1.0]), transform([0, 0, -1]))
    assert judged.reasons() == ("base meets outer by 5 mm",)
    assert {(p.link_a, p.link_b) for p in check.separations(np.zeros(3), transform([0, 0, -1]))} == {(1, 3), (2, 3)}


def test_links_that_a_task_fixes_in_each_other_are_not_excused() -> None:
    scene = Scene(jointed(0.2, 0.2), Body.of([FLOOR]))
    assert always_meeting(scene) == ()
    found = Collisions(scene).clearances(np.full(3, 0.2), transform([0, 0, -1]))
    assert "base meets outer by 5 mm" in found.reasons()


def test_an_overlap_that_some_configuration_avoids_is_judged() -> None:
    hand = jointed(-1.5, 1.5)
    long = replace(hand, links=(*hand.links[:2], ball("outer", 1, 0.042, 1), hand.links[3]))
    assert always_meeting(Scene(long, Body.of([FLOOR]))) == ()


@pytest.mark.parametrize("name", ["schunk-sah", "barrett-bh8-280", "parallel-gripper"])
def test_bundled_hands_overlap_nowhere_by_construction(name: str) -> None:
    assert always_meeting(Scene(load_hand(name), Body.of([FLOOR]))) == ()


@pytest.mark.skipif(not SHARED.is_dir(), reason="needs the hands in ../shared")
@pytest.mark.parametrize("file", ["barrett_hand/bhand_model.urdf", "allegro_hand/allegro_hand_right.urdf"])
def test_real_hands_overlap_nowhere_by_construction(file: str) -> None:
    assert always_meeting(Scene(load_hand(SHARED / "hands" / file), Body.of([FLOOR]))) == ()


# --- words and refusals -----------------------------------------------------------------------------


def test_reasons_come_worst_first_and_each_kind_has_its_own_allowance() -> None:
    hand = fixture(
        Shape("sphere", 0.01, transform([0, 0, 0.0077])),
        other=(Shape("sphere", 0.01, transform([0.05, 0, 0.0064])),),
    )
    found = over(hand).clearances(NONE, HERE, [asked(0, 0, -1e-3)])
    assert found.reasons() == ("other is 3.6 mm inside the object", "tip is 2.3 mm inside the object at contact 0")
    assert found.reasons(depth=3.5e-3)[0] == "tip is 2.3 mm inside the object at contact 0"
    assert found.free(depth=4e-3, at_contacts=3e-3)
    told = found.to_json()
    assert told["nearest_link"] == "other"
    assert told["to_object"] == pytest.approx(-3.6e-3)
    assert json.loads(json.dumps(told)) == told


def test_refusals() -> None:
    check = over(fixture(Shape("sphere", 0.01)))
    with pytest.raises(InputError, match="unknown link 'thumb'; known: base, tip"):
        check.clearances(NONE, HERE, [asked(0, 0, 0, link="thumb")])
    with pytest.raises(InputError, match="object_pose: is not a rigid motion"):
        check.clearances(NONE, 2 * HERE)
    with pytest.raises(InputError, match=r"margin: is 0.05; beyond the cutoff"):
        check.separations(NONE, HERE, margin=0.05)
    with pytest.raises(InputError, match="radius: is 0"):
        over(fixture(Shape("sphere", 0.01)), radius=0.0)
    with pytest.raises(InputError, match="normal: is zero"):
        Requested("tip", np.zeros(3), np.zeros(3))


# --- samples ----------------------------------------------------------------------------------------

SOLIDS = {
    "box": Shape("box", (0.1, 0.02, 0.004)),
    "sphere": Shape("sphere", 0.02),
    "capsule": Shape("capsule", (0.01, 0.05)),
    "cylinder": Shape("cylinder", (0.02, 0.06)),
    "mesh": Shape.hull(np.random.default_rng(1).normal(size=(40, 3)) * [0.05, 0.01, 0.02]),
}


@pytest.mark.parametrize("kind", SOLIDS)
def test_samples_cover_the_surface(kind: str) -> None:
    spacing, rng = 2e-3, np.random.default_rng(0)
    pose = transform(rng.normal(size=3), quaternion_matrix(rng.normal(size=4)))
    solid = SOLIDS[kind].placed(pose)
    points = samples(solid, spacing)
    np.testing.assert_allclose(solid.depth(points), 0, atol=1e-5)
    vertices, faces = solid.triangles()
    weights = rng.dirichlet(np.ones(3), size=len(faces) * 4).reshape(len(faces), 4, 3)
    anywhere = np.einsum("fki,fij->fkj", weights, vertices[faces]).reshape(-1, 3)
    gaps = np.linalg.norm(anywhere[:, None] - points, axis=2).min(axis=1)
    assert gaps.max() < 1.6 * spacing


def test_links_in_each_other_have_an_allowance_of_their_own() -> None:
    """Two balls 3 mm in each other, both 2 mm in the floor: every allowance alone, the others far larger."""
    joints = tuple(Joint(name, "prismatic", [1, 0, 0], [0, 0, 0], -0.1, 0.1) for name in "ab")
    links = (Link("base", -1, HERE), ball("tip", 0, 0.0, 0), ball("other", 0, 0.017, 1))
    hand = Hand("two", links, joints, Mechanism.direct(["a", "b"]), (), np.zeros(2))
    found = over(hand).clearances(np.zeros(2), transform([0, 0, -0.008]), [asked(0, 0, -0.009)])
    assert found.least_between == pytest.approx(-3e-3, abs=1e-6)
    assert found.least_to_object == pytest.approx(-2e-3, abs=1e-6)
    large = {"depth": 0.1, "at_contacts": 0.1, "self_depth": 0.1}
    words = {
        "depth": "other is 2 mm inside the object",
        "at_contacts": "tip is 2 mm inside the object at contact 0",
        "self_depth": "tip meets other by 3 mm",
    }
    deep = {"depth": 2e-3, "at_contacts": 2e-3, "self_depth": 3e-3}
    for name, told in words.items():
        assert found.reasons(**large | {name: deep[name] - 1e-4}) == (told,)
        assert not found.free(**large | {name: deep[name] - 1e-4})
        assert found.free(**large | {name: deep[name] + 1e-4})
