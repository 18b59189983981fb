"""Named regions of hands: the file, the bundled ones, those that are guessed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import Bezier, Cap, load_hand
from handfast.core.errors import InputError
from handfast.geometry.guess_regions import guess_regions, regions_of
from handfast.model.hand.hand import Hand
from handfast.model.hand_regions import HandRegion, HandRegions
from handfast.readers.region_file import hand_regions_dict, load_hand_regions, save_hand_regions
from tests.support.places import SHARED

CAP = {"cap": {"center": [0.02, 0, 0], "radius": 0.013, "axis": [0, 0, 1], "half_angle": 1.0}}


def spots(region: HandRegion) -> np.ndarray:
    """(m, 3) points all over a region, link frame."""
    r = region.region
    if isinstance(r, Bezier):
        u, v = np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9))
        return r.at(u, v).reshape(-1, 3)
    tilt, turn = np.meshgrid(np.linspace(0, r.half_angle, 6), np.linspace(0, 2 * np.pi, 9))
    local = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=-1)
    return r.point(local.reshape(-1, 3) @ r.frame.T)


def off_the_shapes(hand: Hand, region: HandRegion) -> float:
    """[m] how far below the shapes' surface, or outside of all, the worst spot of a region is."""
    inside = np.max([s.depth(spots(region)) for s in hand.links[hand.link(region.link)].shapes], axis=0)
    return float(np.abs(inside).max())


@pytest.mark.parametrize("name", ["schunk-sah", "barrett-bh8-280"])
def test_bundled_regions_lie_on_the_hand(name: str) -> None:
    hand = load_hand(name)
    regions = regions_of(hand)
    assert regions.hand == name
    fingers = {r.finger for r in regions.of("tip")}
    assert len(fingers) == len(regions.of("tip")) == {"schunk-sah": 4, "barrett-bh8-280": 3}[name]
    assert {r.finger for r in regions.of("pad")} == fingers
    assert len(regions.of("palm")) == 1
    for region in regions.of("pad", "palm"):
        assert off_the_shapes(hand, region) <= region.error + 1e-5, region.name
    for region in regions.of("tip"):  # spheres of the collision model
        assert any(
            s.kind == "sphere"
            and s.size[0] == region.region.radius
            and np.allclose(s.pose[:3, 3], region.region.center)
            for s in hand.links[hand.link(region.link)].shapes
        )


@pytest.mark.parametrize("name", ["schunk-sah", "barrett-bh8-280"])
def test_the_guess_is_what_is_bundled_for_tips(name: str) -> None:
    hand = load_hand(name)
    guessed = {r.link: r for r in guess_regions(hand).of("tip")}
    for known in regions_of(hand).of("tip"):
        found = guessed[known.link].region
        assert isinstance(found, Cap)
        np.testing.assert_allclose(found.center, known.region.center, atol=1e-7)
        assert found.radius == known.region.radius
        assert found.axis @ known.region.axis > np.cos(np.radians(20))
        assert guessed[known.link].finger == known.finger


def test_guessed_jaws_face_each_other() -> None:
    hand = load_hand("parallel-gripper")
    left, right = guess_regions(hand).of("tip")
    assert left.middle[1] == pytest.approx([0, -1, 0])
    assert right.middle[1] == pytest.approx([0, 1, 0])
    for jaw in (left, right):
        assert off_the_shapes(hand, jaw) <= jaw.error + 1e-9
        assert 0 < jaw.error < 5e-4


@pytest.mark.skipif(not SHARED.is_dir(), reason="needs the hands in ../shared")
def test_guessed_regions_of_a_hand_from_elsewhere(tmp_path: Path) -> None:
    hand = load_hand(SHARED / "hands" / "allegro_hand" / "allegro_hand_right.urdf")
    regions = guess_regions(hand)
    tips = regions.of("tip")
    assert [t.link for t in tips] == ["link_3.0_tip", "link_7.0_tip", "link_11.0_tip", "link_15.0_tip"]
    for tip in tips:
        assert tip.error < 5e-4
        assert tip.middle[1] @ [1, 0, 0] > 0.7  # the palmar side of every link of this hand
        assert off_the_shapes(hand, tip) < 5e-4
    save_hand_regions(regions, tmp_path / "allegro.json")
    assert [r.name for r in load_hand_regions(tmp_path / "allegro.json", hand)] == [r.name for r in regions]


def test_round_trip(tmp_path: Path) -> None:
    regions = load_hand_regions("schunk-sah")
    save_hand_regions(regions, tmp_path / "mine.json")
    again = load_hand_regions(tmp_path / "mine.json")
    assert hand_regions_dict(again) == hand_regions_dict(regions)
    assert again["thumb_tip"].link == "thumb_distal"
    with pytest.raises(InputError, match="exists already; give --force"):
        save_hand_regions(regions, tmp_path / "mine.json")
    with pytest.raises(InputError, match="unknown region 'tail'; known: ring_tip, middle_tip"):
        again["tail"]


def file_with(tmp_path: Path, **changes: Any) -> Path:
    entry = {"link": "thumb_distal", "finger": "thumb", "role": "tip", "region": CAP}
    entry = {k: v for k, v in (entry | changes).items() if v is not None}
    data = {"schema": "handfast/hand-regions/1", "hand": "schunk-sah", "regions": {"thumb_tip": entry}}
    (tmp_path / "regions.json").write_text(json.dumps(data))
    return tmp_path / "regions.json"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"link": "thumb"},
            r"regions\.json: regions\.thumb_tip\.link: unknown link 'thumb'; known: palm, ring_k",
        ),
        ({"region": None}, r"regions\.thumb_tip\.region: is missing"),
        ({"role": "nail"}, r"regions\.thumb_tip\.role: input should be 'tip', 'pad' or 'palm'"),
        ({"colour": "red"}, r"regions\.thumb_tip\.colour: is not a known field; leave it out"),
        ({"region": {}}, r"regions\.thumb_tip\.region: exactly one of bezier, cap, cylinder_side, cone_side is needed"),
        ({"region": {"cap": CAP["cap"] | {"radius": -1.0}}}, r"region\.cap\.radius: is -1; it must be positive"),
        ({"error": -1.0}, r"error: input should be greater than or equal to 0"),
    ],
)
def test_bad_files_get_one_clear_line(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as fault:
        load_hand_regions(file_with(tmp_path, **changes))
    assert "\n" not in str(fault.value)


def test_more_bad_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        load_hand_regions(tmp_path / "none.json")
    with pytest.raises(InputError, match="no bundled hand region of that name; bundled: barrett-bh8-280, schunk-sah"):
        load_hand_regions("gripper-of-mine")
    with pytest.raises(InputError, match="unknown link 'thumb_distal'; known: palm, finger_1_spread"):
        load_hand_regions(file_with(tmp_path), load_hand("barrett-bh8-280"))
    path = file_with(tmp_path)
    path.write_text(path.read_text().replace("hand-regions/1", "task/1"))
    with pytest.raises(InputError, match=r"schema: input should be 'handfast/hand-regions/1'"):
        load_hand_regions(path)
    with pytest.raises(InputError, match="regions: is empty; at least one region is needed"):
        HandRegions("schunk-sah", ())
