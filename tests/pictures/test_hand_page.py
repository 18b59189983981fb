"""The page of a hand: its script poses the links as Python does, its sliders move what they say, nothing is fetched."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.body import Body
from handfast.model.hand import Hand
from handfast.model.hand.coupling import coupled
from handfast.model.hand_regions import HandRegion, HandRegions
from handfast.model.region import Cap
from handfast.model.shape import Shape
from handfast.pictures.hand_facts import facts_of, shown_hand
from handfast.pictures.hand_page import hand_page, report_hand
from handfast.pictures.hand_picture import HAND_TRIANGLES, OBJECT_TRIANGLES, hand_scene
from handfast.planning.candidates.palm_poses import palm_of
from handfast.readers.load_hand import load_hand
from tests.support.driven_page import drive, embedded
from tests.support.four_bar import FourBar
from tests.support.shown_hands import many_jointed, write_wristed

EVIL = "tip</script><script>alert(1)</script><!--"
needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="needs a JavaScript engine")


def pose(rows: list[float]) -> Array:
    return np.vstack([np.reshape(rows, (3, 4)), [0, 0, 0, 1]])


@pytest.fixture(scope="module")
def wristed(tmp_path_factory: pytest.TempPathFactory) -> Hand:
    hand = load_hand(write_wristed(tmp_path_factory.mktemp("hand")))
    return hand.with_closing({"lift": 0, "turn": 0, "l1": 1, "r1": 1})


@pytest.fixture(scope="module")
def page(wristed: Hand) -> str:
    body = Body.of([Shape("sphere", [0.02])], name="ball", mass=0.1)
    return hand_page(shown_hand(facts_of(wristed), body))


@needs_node
def test_the_script_poses_the_links_as_python_does(wristed: Hand, tmp_path: Path) -> None:
    """Slides, hinges off the origin, references, several joints of one link, 24 joints, the bundled hands."""
    rng = np.random.default_rng(0)
    hands = [wristed, many_jointed(), load_hand("barrett-bh8-280"), load_hand("schunk-sah")]
    asked, expected = [], []
    for hand in hands:
        data, _ = hand_scene(shown_hand(facts_of(hand)))
        q = hand.limits[:, 0] + rng.random((3, hand.l)) * np.ptp(hand.limits, axis=1)
        keys = "links", "joints", "loops", "dependent", "opened", "shut"
        asked.append({key: data[key] for key in keys} | {"q": q.tolist()})
        axes = [hand.joint_axes(x) for x in q]
        palm = palm_of(hand)
        expected.append((hand.link_poses(q).swapaxes(0, 1), axes, coupled(hand, q), palm))
    folder = resources.files("handfast.pictures") / "browser"
    program = "\n".join((folder / name).read_text("utf-8") for name in ("shapes3d.js", "kinematics3d.js"))
    ask = (
        f"console.log(JSON.stringify({json.dumps(asked)}.map((h) => h.q.map((q) => ({{ at: standing(h, q), "
        "tied: followed(h, q), ends: [0, 1].map((s) => followed(h, closed(h, q, s))) })))));"
    )
    (tmp_path / "a.js").write_text(program + ask, "utf-8")
    done = subprocess.run(["node", str(tmp_path / "a.js")], capture_output=True, text=True, check=True, timeout=60)
    for hand, answers, (links, axes, tied, palm) in zip(hands, json.loads(done.stdout), expected, strict=True):
        for k, answer in enumerate(answers):
            np.testing.assert_allclose([pose(T) for T in answer["at"][0]], links[k], atol=1e-9)
            for j, T in enumerate(map(pose, answer["at"][1])):
                joint = hand.joints[j]
                np.testing.assert_allclose(T[:3, :3] @ joint.axis, axes[k][0][j], atol=1e-9)
                np.testing.assert_allclose(T[:3, :3] @ joint.anchor + T[:3, 3], axes[k][1][j], atol=1e-9)
            np.testing.assert_allclose(answer["tied"], tied[k], atol=1e-9)
            free = [j for j in range(hand.l) if hand.closing[j] and j not in {c.joint for c in hand.couplings}]
            for end, there in zip(answer["ends"], (palm.opened, palm.closed), strict=True):
                np.testing.assert_allclose(np.array(end)[free], there[free], atol=1e-9)


@needs_node
def test_sliders_move_joints_and_those_that_follow(wristed: Hand, page: str, tmp_path: Path) -> None:
    l1, l2, r1 = (wristed.joint(n) for n in ("l1", "l2", "r1"))
    steps = f"""
      tell.push(configured());
      move("joint-{l1}", 1.0); tell.push(configured(), said({l1}), said({l2}));
      move("joint-{r1}", 0.3); tell.push(configured());
      move("together", 1); tell.push(configured());
      tell.push([...find("[name=joint-{l2}] output").classList.set]);
      move("joint-{l1}", 0); tell.push(find("[name=joint-{l2}]").value);
      press("given"); tell.push(configured(), [...figure.classList.set]);
    """
    first, moved, said, said_2, other, closed, none, follower, given, live = drive(page, steps, tmp_path)
    zero = wristed.values(wristed.configuration())
    assert first == given == pytest.approx(zero, abs=1e-6)
    assert moved == pytest.approx(zero | {"l1": 1.0, "l2": 0.6}, abs=1e-6)
    assert said == "57.3° · 1.000 rad"
    assert said_2 == "34.4° · 0.600 rad"
    assert other == pytest.approx(moved | {"r1": 0.3}, abs=1e-6)
    assert closed == pytest.approx(zero | {"l1": 1.5, "l2": 0.85, "r1": 1.5}, abs=1e-6)
    assert (none, follower, live) == ([], 0.1, ["live"])


@needs_node
def test_what_is_drawn_moves_and_frames_show_on_request(page: str, tmp_path: Path) -> None:
    """As many things are painted as are switched on, and a slider changes where they are."""
    steps = """
      const painted = () => {
        const n = uniforms.length;
        press("reset");
        return uniforms.slice(n).map((M) => M.map((x) => +x.toFixed(6)));
      };
      tell.push(painted()); move("joint-2", 1.0); tell.push(painted());
      tick("frame-1", true); tell.push(painted().length); tick("frames", true); tell.push(painted().length);
      tick("frames", false); tell.push(painted().length); tick("regions", false); tell.push(painted().length);
    """
    before, after, one, every, none, bare = drive(page, steps, tmp_path)
    data = embedded(page)
    assert len(before) == len(after) == none
    changed = sum(a != b for a, b in zip(before, after, strict=True))
    assert 0 < changed < len(before)
    assert one == none + 2 * 3  # three arrows, and again where they are hidden
    assert every == none + 2 * 3 * len(data["links"])
    assert bare == none - len(data["regions"])


def test_the_page_carries_the_hand(wristed: Hand, page: str) -> None:
    data = embedded(page)
    assert [link["name"] for link in data["links"]] == list(wristed.link_names)
    for link, mine in zip(data["links"], wristed.links, strict=True):
        np.testing.assert_allclose(pose(link["pose"]), mine.pose, atol=1e-11)
        v = np.frombuffer(base64.b64decode(link["solid"]["vertices"]), "<f4").reshape(-1, 3)
        points = np.vstack([s.triangles()[0] for s in mine.shapes])
        np.testing.assert_allclose([v.min(0), v.max(0)], [points.min(0), points.max(0)], atol=1e-7)
    assert [j["closing"] for j in data["joints"]] == wristed.closing.tolist()
    follows = {j["name"]: j["follows"] for j in data["joints"] if j["follows"]}
    assert follows == {"l2": {"driver": wristed.joint("l1"), "ratio": 0.5, "offset": pytest.approx(0.1)}}
    assert page.count('type="range" name="joint-') == wristed.l
    assert data["configuration"]["schema"] == "handfast/configuration/1"
    center = palm_of(wristed).center  # where an object stands that nobody placed
    np.testing.assert_allclose(pose(data["object"]["pose"])[:3, 3], center, atol=1e-9)
    for side in data["sides"]:
        R = np.reshape(side["matrix"], (3, 3))
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(R) == pytest.approx(1)


def test_a_slider_that_follows_is_held_unless_a_clutch_lets_go(page: str, wristed: Hand) -> None:
    rigid = hand_page(shown_hand(facts_of(replace(wristed, breakaway=False))))
    for text, held in ((page, False), (rigid, True)):
        slider = re.search(rf'<input type="range" name="joint-{wristed.joint("l2")}"[^>]*>', text)
        assert slider is not None
        assert ("disabled" in slider[0]) is held


def test_nothing_is_fetched_and_no_name_breaks_out(tmp_path: Path) -> None:
    plain = many_jointed(2, 3)
    hand = replace(plain, name=EVIL, links=tuple(replace(k, name=f"{k.name}{EVIL}") for k in plain.links))
    report_hand(tmp_path / "a.html", hand)
    text = (tmp_path / "a.html").read_text("utf-8")
    assert "<script>alert" not in text
    assert "<!--" not in text
    assert text.count("<script") == text.count("</script>") == 2
    text = re.sub(r'src="data:image/png;base64,[^"]*"', "", text)
    for word in ("http:", "https:", "src=", "href=", "import(", "fetch(", "XMLHttpRequest", "eval(", "innerHTML"):
        assert word not in text


@pytest.mark.slow
@needs_node
def test_a_slider_moves_the_loop_that_its_joint_drives(tmp_path: Path) -> None:
    """A four-bar linkage in closed form; where the loop lets nobody pass, its joints stay."""
    bar = FourBar()
    hand = load_hand(bar.write(tmp_path))
    facts = facts_of(hand)
    text = hand_page(shown_hand(facts))
    crank = hand.joint("crank")
    angles = [0.4, -0.9, 1.1, 0.0]
    steps = "".join(f'move("joint-{crank}", {angle}); tell.push(configured());' for angle in angles)
    for angle, found in zip(angles, drive(text, steps, tmp_path), strict=True):
        assert found == pytest.approx(bar.joints(np.pi / 2 + angle), abs=2e-6)
    for j in range(hand.l):
        slider = re.search(rf'<input type="range" name="joint-{j}"[^>]*>', text)
        assert slider is not None
        assert ("disabled" in slider[0]) is (j != crank)
    stuck = FourBar(crank=0.04, coupler=0.03, rocker=0.04, ground=0.05)  # no full turn: the pin opens before 3 rad
    hand = load_hand(stuck.write(tmp_path))
    page = hand_page(shown_hand(replace(facts, hand=hand)))  # of which links overlap nothing is asked
    (found,) = drive(page, f'move("joint-{crank}", 2.9); tell.push(configured());', tmp_path)
    assert found["crank"] < 2.0
    assert found == pytest.approx(stuck.joints(np.pi / 2 + found["crank"]), abs=1e-3)


def test_a_fine_mesh_is_drawn_coarser_and_the_page_says_so() -> None:
    """A sphere of 180 000 triangles: the page stays small, what is drawn stays on it."""
    n = 300
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, n, endpoint=False), np.linspace(0, np.pi, n + 1))
    points = 0.04 * np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], axis=-1).reshape(-1, 3)
    a = np.add.outer(n * np.arange(n), np.arange(n)).ravel()
    b = np.add.outer(n * np.arange(n), np.roll(np.arange(n), -1)).ravel()
    faces = np.vstack([np.column_stack([a, a + n, b]), np.column_stack([b, a + n, b + n])])
    body = Body.of([Shape("sphere", [0.04])], mesh=(points, faces))
    shown = shown_hand(facts_of(load_hand("parallel-gripper")), body)
    data, notes = hand_scene(shown)
    solid: dict[str, Any] = data["object"]["solid"]
    drawn = np.frombuffer(base64.b64decode(solid["faces"]), "<u4" if solid["wide"] else "<u2").reshape(-1, 3)
    at = np.frombuffer(base64.b64decode(solid["vertices"]), "<f4").reshape(-1, 3)
    assert 0.3 * OBJECT_TRIANGLES < len(drawn) <= OBJECT_TRIANGLES
    assert np.abs(np.linalg.norm(at, axis=1) - 0.04).max() < 2e-4
    assert len(json.dumps(data)) < 1_500_000
    (note,) = notes
    assert re.search(r"The object is drawn with fewer triangles: details below 1\.\d mm are lost", note)


@pytest.mark.slow
def test_a_hand_of_fine_meshes_is_drawn_with_coarser_hulls() -> None:
    """24 links of 6000 triangles each."""
    points = np.random.default_rng(0).normal(size=(3000, 3))
    solid = Shape.hull(0.01 * points / np.linalg.norm(points, axis=1, keepdims=True))
    plain = many_jointed()
    hand = replace(plain, links=tuple(replace(k, shapes=(solid,)) for k in plain.links))
    cap = Cap([0, 0, 0], 0.01, [0, 0, 1], 1.0)
    regions = HandRegions("many", (HandRegion("tip", "f0_3", cap, "f0", "tip"),))
    data, (note,) = hand_scene(shown_hand(facts_of(hand, regions)))
    sizes = [len(base64.b64decode(link["solid"]["faces"])) / 6 for link in data["links"]]
    assert 0.4 * HAND_TRIANGLES < sum(sizes) <= HAND_TRIANGLES
    v = np.frombuffer(base64.b64decode(data["links"][3]["solid"]["vertices"]), "<f4").reshape(-1, 3)
    assert np.abs(np.linalg.norm(v, axis=1) - 0.01).max() < 2e-4
    assert note.startswith("The hand's shapes are drawn with fewer triangles")


@pytest.mark.slow
def test_bad_requests(tmp_path: Path, wristed: Hand) -> None:
    with pytest.raises(InputError, match=r"a.pdf: a name that ends in .html, .htm, .png, .svg is needed"):
        report_hand(tmp_path / "a.pdf", wristed)
    with pytest.raises(InputError, match=r"q: has shape \(2,\); 5 finite numbers are needed"):
        report_hand(tmp_path / "a.html", wristed, q=np.zeros(2))
    with pytest.raises(InputError, match="pose: is not a rigid motion"):
        report_hand(tmp_path / "a.html", wristed, pose=2 * np.eye(4))
    assert not any(tmp_path.iterdir())
    (tmp_path / "a.png").write_text("mine")
    with pytest.raises(InputError, match="exists already; give --force"):
        report_hand(tmp_path / "a.png", wristed)
    report_hand(tmp_path / "a.png", wristed, force=True)
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
