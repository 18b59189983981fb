"""What is said about a hand: fingers, pairs that are not checked, masses, couplings, and what cannot be guessed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.body import Body
from handfast.model.cylinder_side import CylinderSide
from handfast.model.hand import Hand
from handfast.model.hand.hand import Link
from handfast.model.hand_regions import HandRegion, HandRegions
from handfast.model.region import Cap
from handfast.model.shape import Shape
from handfast.pictures import hand_rows
from handfast.pictures.drawing import MESH_COLORS
from handfast.pictures.hand_facts import HandFacts, facts_of, shown_hand, stated_masses, to_json
from handfast.pictures.hand_picture import draw_hand, tint
from handfast.pictures.scene import coarse
from handfast.readers.load_hand import load_hand
from tests.support.shown_hands import many_jointed, write_wristed


@pytest.fixture(scope="module")
def wristed(tmp_path_factory: pytest.TempPathFactory) -> Hand:
    hand = load_hand(write_wristed(tmp_path_factory.mktemp("hand")))
    return hand.with_closing({"lift": 0, "turn": 0, "l1": 1, "r1": 1})


@pytest.fixture(scope="module")
def facts(wristed: Hand) -> HandFacts:
    return facts_of(wristed)


def pairs(facts: HandFacts, kind: str) -> set[tuple[str, str]]:
    return {facts.named(p) for p in getattr(facts, kind)}


def test_fingers_are_the_links_that_lead_to_one_tip_alone(facts: HandFacts) -> None:
    of = dict(zip(facts.hand.link_names, facts.finger, strict=True))
    assert of["arm"] == of["wrist"] == of["tower"] == "palm"
    assert of["left"] == of["left_tip"] != of["right"] == of["right_tip"]
    assert facts.fingers == (of["left"], of["right"])
    assert tint(facts, of["left"]) != tint(facts, of["right"]) != tint(facts, "palm")


def test_pairs_that_are_not_checked_and_why(facts: HandFacts) -> None:
    assert pairs(facts, "neighbours") == {
        ("arm", "wrist"),
        ("wrist", "left"),
        ("wrist", "right"),
        ("left", "left_tip"),
    } | {
        ("wrist", "tower"),
        ("wrist", "right_tip"),
    }
    assert pairs(facts, "as_one") == {("arm", "tower"), ("right", "right_tip")}
    assert pairs(facts, "excluded") == set()


def test_a_pair_that_always_overlaps_is_named_with_its_depth(wristed: Hand) -> None:
    """A ball of 30 mm on each of two fingers, whose roots are 20 mm apart."""
    ball = Shape("sphere", [0.03])
    apart = np.eye(4)
    apart[0, 3] = 0.02
    links = [
        Link("base", -1, np.eye(4), (), (Shape("box", (0.01, 0.01, 0.01), np.diag([1.0, 1, 1, 1])),)),
        Link("a", 0, np.eye(4), (0,), (ball,)),
        Link("b", 0, apart, (1,), (ball,)),
    ]
    made = many_jointed(1, 2)
    joints = tuple(replace(j, anchor=np.zeros(3), ref=0.0) for j in made.joints)
    hand = replace(made, links=tuple(links), joints=joints, couplings=(), closing=np.ones(2))
    found = facts_of(hand)
    assert pairs(found, "overlapping") == {("a", "b")}
    assert found.depths == pytest.approx((0.04,), abs=1e-6)
    assert hand_rows.pair_rows(found)[0] == ["a", "b", "always overlap, 40.0 mm in mid-range"]
    assert ("always overlap", "a and b") in hand_rows.overview(found)


def test_what_a_scene_leaves_out_for_another_reason_is_the_files(
    monkeypatch: pytest.MonkeyPatch, wristed: Hand
) -> None:
    from handfast.geometry.scene import Scene

    left, right = wristed.link("left"), wristed.link("right")
    whole = Scene._meeting_links
    monkeypatch.setattr(Scene, "_meeting_links", lambda me: [p for p in whole(me) if set(p) != {left, right}])
    found = facts_of(wristed)
    assert pairs(found, "excluded") == {("left", "right")}
    assert ["left", "right", "left out by the hand's file"] in hand_rows.pair_rows(found)


def test_masses_that_the_file_states(tmp_path: Path, facts: HandFacts) -> None:
    """A body's own inertia and the masses of geoms count, what would follow from a density does not."""
    assert facts.masses == {"wrist": 0.25, "left": 0.1, "right": 0.1}
    assert dict(hand_rows.overview(facts))["mass"] == "0.45 kg, without arm, left_tip, right_tip, tower"
    urdf = tmp_path / "a.urdf"
    urdf.write_text(
        '<robot name="a"><link name="p"><inertial><mass value="0.3"/></inertial></link><link name="q"/>'
        '<joint name="j" type="revolute"><parent link="p"/><child link="q"/>'
        '<limit lower="0" upper="1"/></joint></robot>'
    )
    assert stated_masses(load_hand(urdf)) == {"p": 0.3}
    assert stated_masses(load_hand("schunk-sah")) == {}


def test_rows_say_limits_senses_and_what_follows_what(facts: HandFacts) -> None:
    rows = {row[0]: row[1:] for row in hand_rows.joint_rows(facts)}
    assert rows["lift"][:3] == ["prismatic", "−10 mm to 20 mm", "−0.01 to 0.02 m"]
    assert rows["turn"][1:6] == ["−28.6° to 28.6°", "−0.5 to 0.5 rad", "–", "no", "turn"]
    assert rows["l2"][3:6] == ["–", "+", "follows 0.5 × l1 + 0.1"]
    assert hand_rows.counts(facts) == "7 links, 5 joints, 4 actuators, 1 coupling, 2 fingers"
    assert hand_rows.actuator_rows(facts)[0] == ["lift", "lift", "motor", "N", "–"]


def test_json_names_everything(facts: HandFacts) -> None:
    data = to_json(shown_hand(facts))
    joints = {j["name"]: j for j in data["joints"]}
    assert joints["l2"]["follows"] == {"driver": "l1", "ratio": 0.5, "offset": pytest.approx(0.1)}
    assert joints["l2"]["value"] == pytest.approx(0.1)
    assert {link["name"]: link["parent"] for link in data["links"]}["left_tip"] == "left"
    assert data["not_checked"]["as_one"] == [["arm", "tower"], ["right", "right_tip"]]
    assert joints["turn"]["stops"] == [-0.5, 0.5]
    assert joints["turn"]["friction"] == joints["turn"]["stiffness"] == 0
    assert data["guessed"] is True
    assert len(data["fingers"]) == 2


def test_what_cannot_be_guessed_is_said(wristed: Hand) -> None:
    still = facts_of(wristed.with_closing(dict.fromkeys(wristed.joint_names, 0)))
    assert still.palm is None
    assert any("The palm is not guessed" in text and "give closing senses" in text for text in still.missing)
    bare = facts_of(replace(wristed, links=tuple(replace(k, shapes=()) for k in wristed.links)))
    assert bare.regions is None
    assert any("No regions are guessed" in text for text in bare.missing)
    assert set(bare.finger) == {"palm"}
    draw_hand(shown_hand(bare), 20)  # nothing but axes, and no fault


def test_regions_that_are_given_are_taken(wristed: Hand) -> None:
    cap = Cap([0, 0, 0.02], 0.01, [0, 0, 1], 1.0)
    regions = HandRegions("x", (HandRegion("nail", "left_tip", cap, "index", "tip"),))
    found = facts_of(wristed, regions)
    assert found.fingers == ("index",)
    assert hand_rows.region_rows(found) == [["nail", "index", "tip", "left_tip", "cap, radius 10 mm, ±57.3°", "0"]]
    side = CylinderSide([0, 0, 0.02], 0.01, [0, 0, 1], [1, 0, 0], (0, 1), (0, 0.01))
    sides = HandRegions("x", (HandRegion("shaft", "left_tip", side, "index", "pad"),))
    assert hand_rows.region_rows(facts_of(wristed, sides))[0][4] == "cylinder side"
    with pytest.raises(InputError, match=r"regions\.nail\.link: unknown link 'left_tip'"):
        facts_of(load_hand("parallel-gripper"), regions)


def test_a_still_picture_has_every_colour(facts: HandFacts) -> None:
    figure = draw_hand(shown_hand(facts, Body.of([Shape("sphere", [0.01])], name="ball")), 30)
    pixels = np.vstack([np.asarray(ax.images[0].get_array())[..., :3].reshape(-1, 3) for ax in figure.axes])
    for color in (*(to_rgb(c) for f in (*facts.fingers, "palm") for c in tint(facts, f)[:1]), MESH_COLORS["object"]):
        assert seen(pixels, np.array(color)) > 20, color


def seen(pixels: Array, color: Array) -> int:
    """Pixels of a colour, whatever their light."""
    hue = pixels / np.maximum(np.linalg.norm(pixels, axis=1, keepdims=True), 1e-9)
    return int((hue @ (color / np.linalg.norm(color)) > 0.9999).sum())


def test_a_coarse_mesh_is_near_the_fine_one() -> None:
    n = 60
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    vertices = np.column_stack([x.ravel(), y.ravel(), 0.1 * x.ravel()])
    a = np.add.outer((n + 1) * np.arange(n), np.arange(n)).ravel()
    faces = np.vstack([np.column_stack([a, a + 1, a + n + 2]), np.column_stack([a, a + n + 2, a + n + 1])])
    same, _, cell = coarse(vertices, faces, 2 * n * n)
    assert same is vertices
    assert cell == 0
    v, f, cell = coarse(vertices, faces, 500)
    assert 100 < len(f) <= 500
    assert 0 < cell < 0.2
    assert np.abs(v[:, 2] - 0.1 * v[:, 0]).max() < 1e-12  # still in the plane
    corners = v[f]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normal[:, 2] > 0).all()  # and wound as before
    assert np.linalg.norm(normal, axis=1).sum() / 2 == pytest.approx(np.sqrt(1.01), rel=0.25)
