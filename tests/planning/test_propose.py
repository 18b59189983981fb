"""Regions chosen automatically: places, balance, hand shapes, proposals, the command."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handfast import Reach, load_hand, load_task, synthesize, verify
from handfast.cli.propose import Propose
from handfast.core.errors import InputError
from handfast.geometry.guess_regions import regions_of
from handfast.geometry.region_fit import fit_grid
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand_regions import HandRegions
from handfast.model.shape import Shape
from handfast.planning.candidates.hand_shapes import HandShapes, _aligned
from handfast.planning.candidates.region_candidates import RegionCandidate, find_candidates, region_sets
from handfast.planning.candidates.surface import find_places
from handfast.planning.filters.non_contacting import placed, postures
from handfast.planning.filters.quick_look import QuickLook
from handfast.planning.propose_tasks import Proposals, propose
from handfast.planning.search import RejectionReason, Tally
from handfast.readers.load_body import load_body

BARRETT = load_hand("barrett-bh8-280")


def box(*size: float, friction: float = 0.5) -> Body:
    return Body.of([Shape("box", size)], friction=friction)


def ball(radius: float, friction: float = 0.5) -> Body:
    return Body.of([Shape("sphere", radius)], friction=friction)


def cone(friction: float) -> Body:
    """Half its opening angle is 35 degrees."""
    around = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    rim = 0.03 * np.column_stack([np.cos(around), np.sin(around), np.zeros(48)])
    return Body.of([Shape.hull(np.vstack([rim, [[0, 0, 0.03 / np.tan(np.radians(35))]]]))], friction=friction)


def pinches(body: Body, **options: float) -> tuple[list[RegionCandidate], Tally]:
    look = QuickLook(Scene(BARRETT, body))
    return find_candidates(
        look, regions_of(BARRETT), body, "pinch", options.get("friction", body.friction), short=12, spread=24
    )


# --- places ------------------------------------------------------------------------------------------


def test_places_on_a_box_are_flat_and_within_a_face() -> None:
    half = np.array([0.05, 0.02, 0.03])
    places, unfit = find_places(box(*(2 * half)), 0.01, count=30)
    assert len(places) + unfit == 60
    assert len(places) > 50
    for p in places:
        k = int(np.abs(p.normal).argmax())
        assert np.abs(p.normal[k]) == pytest.approx(1)
        assert p.error < 1e-9
        points = p.patch.points.reshape(-1, 3)
        assert points[:, k] == pytest.approx(np.sign(p.normal[k]) * half[k], abs=1e-9)
        assert (np.abs(points) <= half + 1e-9).all()
        n = p.patch.normal(0.5, 0.5)
        assert n @ p.normal == pytest.approx(np.linalg.norm(n))


def test_places_on_a_ball_are_within_the_error() -> None:
    body = ball(0.04)
    inside = np.linalg.norm(body.vertices[body.faces].mean(axis=1), axis=1).min()  # the mesh is faceted
    places, _ = find_places(body, 0.01, count=20)
    assert len(places) > 20
    for p in places:
        u, v = np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 12))
        far = np.linalg.norm(p.patch.at(u, v), axis=2)
        assert far.max() < 0.04 + p.error
        assert far.min() > inside - p.error
        assert p.normal @ p.point > 0.95 * np.linalg.norm(p.point)


def test_no_place_where_two_solids_meet() -> None:
    """Neither on the seam of two boxes side by side nor inside a box about one of them."""
    halves = [Shape("box", (0.03, 0.03, 0.03), transform(x)) for x in (-0.015, 0.015)]
    for body in (Body.of(halves), Body.of([Shape("box", (0.06, 0.04, 0.04)), *halves])):
        places, _ = find_places(body, 0.008, count=16)
        outer = np.ptp(body.vertices, axis=0) / 2
        assert places
        for p in places:
            assert np.isclose(np.abs(p.point), outer, atol=1e-9).any(), p.point


def transform(x: float) -> np.ndarray:
    T = np.eye(4)
    T[0, 3] = x
    return T


def test_bad_numbers_for_places() -> None:
    with pytest.raises(InputError, match="radius: is 0; a positive number"):
        find_places(box(0.1, 0.1, 0.1), 0.0)
    with pytest.raises(InputError, match="count: is 0; a number from 1 on is needed"):
        find_places(box(0.1, 0.1, 0.1), 0.01, count=0)


def test_grid_fit() -> None:
    x, y = np.meshgrid(np.linspace(-0.01, 0.01, 13), np.linspace(-0.01, 0.01, 13), indexing="ij")
    cubic = np.stack([x, y, 40 * x**3 - 3 * x * y], axis=-1)
    assert fit_grid(cubic).error_max < 5e-4
    assert fit_grid(cubic[:, ::-1]).patch.normal(0.5, 0.5)[2] < 0
    dome = np.stack([x, y, np.sqrt(0.03**2 - x**2 - y**2)], axis=-1)
    fine, coarse = fit_grid(dome), fit_grid(dome, (1, 1))
    u, v = np.meshgrid(np.linspace(0, 1, 33), np.linspace(0, 1, 33))
    for fitted in (fine, coarse):
        assert np.abs(np.linalg.norm(fitted.patch.at(u, v), axis=2) - 0.03).max() <= fitted.error_max + 1e-5
    assert fine.error_max < 5e-5 < 1e-3 < coarse.error_max
    assert fine.coverage == pytest.approx(1, abs=0.01)
    with pytest.raises(InputError, match="more points a side than the degree"):
        fit_grid(dome[:3])
    with pytest.raises(InputError, match="points: cannot be fitted: the patch is degenerate"):
        fit_grid(0 * dome)


# --- hand shapes -------------------------------------------------------------------------------------


def test_many_poses_are_those_of_the_hand() -> None:
    random = np.random.default_rng(1)
    q = random.random((4, BARRETT.l))
    poses = BARRETT.link_poses(q)
    for s in range(4):
        np.testing.assert_allclose(poses[:, s], BARRETT.link_poses(q[s]), atol=1e-12)


@pytest.mark.parametrize("k", [2, 3, 4])
def test_a_planted_pose_is_found(k: int) -> None:
    random = np.random.default_rng(k)
    there, inward = random.normal(size=(k, 3)), random.normal(size=(k, 3))
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    R, t = Rotation.random(rng=k).as_matrix(), random.normal(size=3)
    left, angle, poses = _aligned((there @ R.T + t)[None], (inward @ R.T)[None], there, inward, 1.0)
    assert left[0] < 1e-9
    assert angle.max() < 1e-6
    np.testing.assert_allclose(poses[0][:3, :3], R, atol=1e-9)
    np.testing.assert_allclose(poses[0][:3, 3], t, atol=1e-9)


def test_opening_of_jaws_is_known() -> None:
    hand = load_hand("parallel-gripper")
    shapes = HandShapes.of(hand, regions_of(hand).of("tip"), 400, 0)
    assert shapes.opening((0, 1)) == pytest.approx(0.08, abs=2e-3)  # 40 mm either side of the middle


def test_fingers_that_take_no_part_follow_their_couplings() -> None:
    hand = load_hand("schunk-sah")
    wide, folded = postures(hand, ["thumb_distal", "index_distal"])
    assert set(wide) == set(folded) == {f"{f}_{part}" for f in ("ring", "middle") for part in ("proximal", "middle")}
    q = placed(hand, np.zeros(hand.l), folded)
    assert q[hand.joint("ring_distal")] == q[hand.joint("ring_middle")] == folded["ring_middle"]
    assert q[hand.joint("index_distal")] == 0
    assert postures(BARRETT, ["finger_1_dist", "finger_2_dist", "finger_3_dist"]) == [{}]


# --- candidates --------------------------------------------------------------------------------------


def test_pinches_of_a_box_oppose() -> None:
    found, _ = pinches(box(0.12, 0.04, 0.08))
    assert found
    for c in found:
        a, b = c.places
        assert a.normal @ b.normal == pytest.approx(-1)
        line = (b.point - a.point) / np.linalg.norm(b.point - a.point)
        assert -line @ a.normal > np.cos(np.arctan(0.5))
        assert 0 < c.margin <= 1
        assert {r.role for r in c.regions} == {"tip"}
    assert any(abs(c.places[0].normal[1]) > 0.9 for c in found)


def test_pinches_of_a_ball_are_antipodal() -> None:
    found, _ = pinches(ball(0.03, friction=0.3))
    assert found
    for c in found:
        a, b = (p.point / np.linalg.norm(p.point) for p in c.places)
        assert np.degrees(np.arccos(-a @ b)) <= 2 * np.degrees(np.arctan(0.3)) + 10  # facets turn the normals


def test_no_pinch_of_a_slippery_cone() -> None:
    found, tally = pinches(cone(friction=0.15))
    assert found == []
    assert tally[RejectionReason.NO_SQUEEZE] > 0
    found, _ = pinches(cone(friction=1.5))
    assert found


def test_too_wide_for_the_hand() -> None:
    found, tally = pinches(box(0.6, 0.6, 0.6))
    assert found == []
    wide = tally.rejected[RejectionReason.TOO_WIDE]
    assert wide.count > 0
    assert "the hand opens to about" in wide.example


def test_sets_of_regions() -> None:
    hand = regions_of(load_hand("schunk-sah"))
    assert len(region_sets(hand, "pinch")) == 6
    assert len(region_sets(hand, "tripod")) == 4
    assert all(s[0].role == "palm" and len(s) == 3 for s in region_sets(hand, "power"))
    one = HandRegions("schunk-sah", hand.of("tip")[:1])
    with pytest.raises(InputError, match="a pinch needs the tips of 2 fingers; there are: ring_tip"):
        region_sets(one, "pinch")


# --- proposals ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def found() -> Proposals:
    return propose(BARRETT, None, load_body("slab"), "pinch", count=2, object="slab")


def test_a_proposal_is_certified_and_its_file_gives_it_again(tmp_path: Path, found: Proposals) -> None:
    assert len(found.proposals) == 2
    assert found.tried >= 2
    for p in found.proposals:
        assert p.answer.verdict is Reach.FOUND
        assert verify(p.answer).ok
        assert p.clear
        assert p.error < 5e-4
    assert [p.clear for p in found.proposals] == sorted((p.clear for p in found.proposals), reverse=True)
    assert len({p.task.name for p in found.proposals}) == 2
    files = found.save(tmp_path)
    task = load_task(files[0])
    assert (task.hand.name, task.object) == ("barrett-bh8-280", "slab")
    again = synthesize(task, timeout=10)
    np.testing.assert_allclose(again.solutions[0].q, found.proposals[0].answer.solutions[0].q, atol=1e-6)
    with pytest.raises(InputError, match="exists already; give --force"):
        found.save(tmp_path)
    data = found.to_json()
    assert data["schema"] == "handfast/proposals/1"
    assert [p["name"] for p in data["proposals"]] == [f.stem for f in files]


@pytest.mark.slow
def test_regions_that_no_forces_balance_are_not_tried() -> None:
    """A centre of mass beside the object is on no line through two points of it."""
    body = replace(load_body("slab"), center_of_mass=np.array([0.0, 0.0, 0.5]))
    none = propose(BARRETT, None, body, "pinch", count=1)
    assert (none.proposals, none.tried) == ((), 0)
    assert none.tally[RejectionReason.UNBALANCED] > 0
    assert propose(BARRETT, None, body, "pinch", count=1, unbalanced=True).tried > 0
    assert propose(BARRETT, None, replace(body, mass=None), "pinch", count=1).tried > 0


def test_bad_requests() -> None:
    slab = box(0.1, 0.05, 0.05)
    with pytest.raises(InputError, match="kind: is 'hook'; known: pinch, tripod, power"):
        propose(BARRETT, None, slab, "hook")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="count: is 0; a positive number is needed"):
        propose(BARRETT, None, slab, count=0)
    with pytest.raises(InputError, match="seed: is -1; a number from 0 on is needed"):
        propose(BARRETT, None, slab, seed=-1)
    with pytest.raises(InputError, match="timeout: is 0; a positive number is needed"):
        propose(BARRETT, None, slab, timeout=0)
    with pytest.raises(InputError, match="friction: is 0; forces on places need a positive coefficient"):
        propose(BARRETT, None, box(0.1, 0.05, 0.05, friction=0.0))
    with pytest.raises(InputError, match=r"regions\.ring_tip\.link: unknown link 'ring_distal'; known: palm"):
        propose(BARRETT, regions_of(load_hand("schunk-sah")), slab)


def test_the_command(
    tmp_path: Path, found: Proposals, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as m:
        m.setattr("handfast.planning.propose_tasks.propose", lambda *_, **__: found)
        ask = Propose(hand="barrett-bh8-280", object="slab", count=2, output=tmp_path / "out", json=True)
        assert ask.run() == 0
    said = json.loads(capsys.readouterr().out)
    assert said["proposals"][0]["verdict"] == "found"
    assert Path(said["files"][0]).is_file()
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file; a folder is needed"):
        Propose(hand="barrett-bh8-280", object="slab", output=tmp_path / "file").run()
    cube = {"schema": "handfast/body/1", "shapes": [{"box": {"size": [0.3, 0.3, 0.3]}}]}
    (tmp_path / "cube.json").write_text(json.dumps(cube))
    assert Propose(hand="parallel-gripper", object=str(tmp_path / "cube.json"), count=1).run() == 3
    said = capsys.readouterr().out
    assert "0 of 0 candidates certified and kept" in said
    assert "wider than the hand opens" in said
