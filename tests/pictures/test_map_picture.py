"""Pictures: what they show, in every format, the same bytes each time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Polygon, Wedge

from handfast.cli.maps import save_map, save_sweep
from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.pictures import sentences
from handfast.pictures.drawing import picture
from handfast.pictures.grasp_picture import draw_grasp, draw_scene
from handfast.pictures.map_picture import ARC_STYLES, draw_map, draw_sweep
from handfast.pictures.scene import scene_meshes
from handfast.stability.problem.grasp_limits import AskedWith, GraspLimits
from handfast.stability.studies.maps import Curve, MapAnswer, SweepAnswer
from handfast.stability.studies.questions import force_map
from tests.support.problems import pinch

ORIGIN = np.zeros(3)


@pytest.fixture
def grasp() -> Grasp:
    """Two fingers that pinch along x, each with a joint."""
    contacts = [Contact(np.array([x, 0, 0.0]), np.array([-np.sign(x), 0, 0]), 0.7, f"tip {x}") for x in (0.05, -0.05)]
    joints = [
        GraspJoint("right", np.array([0, 0, 1.0]), np.array([0.05, -0.1, 0]), (0,)),
        GraspJoint("left", np.array([0, 0, -1.0]), np.array([-0.05, -0.1, 0]), (1,)),
    ]
    return Grasp(contacts, joints, preload={"right": 0.1, "left": 0.1}, name="pinch")


def curve(lower: list[float], upper: list[float] | None = None, unbounded: list[int] = ()) -> Curve:
    """A curve with given bounds; indices in `unbounded` have none."""
    low = np.array(lower, dtype=float)
    high = low.copy() if upper is None else np.array(upper, dtype=float)
    endless = np.isin(np.arange(len(low)), unbounded)
    high[endless] = np.inf
    verdicts = [
        Verdict.SLIPS if h == 0 else Verdict.HOLDS if v > 0 else Verdict.UNDECIDED
        for v, h in zip(low, high, strict=True)
    ]
    return Curve(low, high, endless, tuple(verdicts), (Stop.COMPLETE,) * len(low))


@pytest.fixture
def mapped(grasp: Grasp) -> MapAnswer:
    """Eight directions: the lower half plane holds anything, one direction is open."""
    angle = np.arange(8) * np.pi / 4
    directions = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    passive = curve([0, 0, 0, 0, 0, 1e4, 1e4, 1e4], unbounded=[5, 6, 7])
    preloaded = curve([3, 2, 2, 2, 3, 1e4, 1e4, 1e4], [3, 2, 5, 2, 3, 0, 0, 0], unbounded=[5, 6, 7])
    terms = AskedWith(GraspLimits(eta=np.radians(2.5)))
    return MapAnswer(grasp, "xy", directions, passive, preloaded, 1.0, 10, terms=terms)


@pytest.fixture
def swept(grasp: Grasp) -> SweepAnswer:
    directions = np.array([[0, 0, 1, 0, 0, 0], [0, 0, 0, 2, 0, 0.0]])
    curves = (curve([1, 0.5, 0]), curve([0.1, 0.2, 0.1], [0.1, 0.25, 0.1]))
    return SweepAnswer(grasp, "left", np.array([0, 0.1, 0.2]), directions, curves, 1.0, 10)


def texts(figure: Figure) -> str:
    """Everything that is written in a figure."""
    import matplotlib.text

    return "\n".join(t.get_text() for t in figure.findobj(matplotlib.text.Text))


def test_map_shows_regions_limits_and_facts(mapped: MapAnswer) -> None:
    figure = draw_map(mapped)
    ax = figure.axes[0]
    limit = ax.get_xlim()[1]
    assert ax.get_xlim() == ax.get_ylim() == (-limit, limit)
    assert 3 < limit <= 1.6 * 3
    said = texts(figure)
    for text in ("pinch", "2.5°", "0.1 N·m", "force along x [N]", "force along y [N]", "not decided"):
        assert text in said
    regions = [p.get_xy() for p in ax.patches if isinstance(p, Polygon)]
    assert len(regions) == 3  # preloaded, passive, outline of preloaded
    np.testing.assert_allclose(regions[0][0], [3, 0], atol=1e-12)
    assert np.linalg.norm(regions[1][6]) > np.sqrt(2) * limit  # unbounded: beyond the corners
    wedges = [p for p in ax.patches if isinstance(p, Wedge)]
    assert len(wedges) == 1
    assert (wedges[0].theta1, wedges[0].theta2) == (67.5, 112.5)
    assert (wedges[0].r, wedges[0].width) == (5, 3)


def test_map_limit_is_the_callers_or_one(mapped: MapAnswer) -> None:
    assert draw_map(mapped, limit=7.0).axes[0].get_xlim() == (-7, 7)
    nothing = replace(mapped, passive=curve([0.0] * 8), preloaded=None)
    assert draw_map(nothing).axes[0].get_xlim() == (-1, 1)


def test_what_colour_at_the_edge_says(mapped: MapAnswer) -> None:
    """Half a newton in every direction but one that is cut at 2 N, that diagonal included, or one without a bound."""
    alone = replace(mapped, preloaded=None)
    short, cut, both = [0.5] * 8, [0.5, 3, *[0.5] * 6], [0.5, 3, *[0.5] * 5, 1e4]
    within = [0.5, 2.8, *[0.5] * 6]  # 2.8 N along the diagonal end in the corner
    for lower, said in (
        (short, ""),
        (within, ""),
        (cut, "Colour to the edge: more than fits is resisted"),
        (both, "Colour to the edge: more than fits is resisted, in some directions any force"),
        ([*short[:7], 1e4], "Colour to the edge: any force is resisted"),
    ):
        text = " ".join(
            texts(draw_map(replace(alone, passive=curve(lower, unbounded=[7] * (1e4 in lower))), limit=2.0)).split()
        )
        assert ("Colour to the edge" in text) is bool(said)
        assert said in text
        assert ("any force" in text) is (1e4 in lower)


def test_a_few_long_directions_do_not_shrink_the_map(mapped: MapAnswer) -> None:
    spiky = replace(mapped, preloaded=curve([2, 2, 2, 2, 2, 2, 2, 500]), passive=curve([0.0] * 8))
    assert draw_map(spiky).axes[0].get_xlim()[1] == 8


def test_the_weight_is_a_circle_that_shows_where_it_is_too_much(mapped: MapAnswer) -> None:
    """Weight 2.5 N: the preloaded grasp holds it in five directions, not in two, and one is open (2 to 5 N)."""
    assert sentences.weight_states(mapped.preloaded, 2.5) == ["enough", "weak", "open", "weak", *["enough"] * 4]
    figure = draw_map(mapped, weight=2.5)
    arcs = [p for p in figure.axes[0].patches if isinstance(p, Arc)]
    assert len(arcs) == 8
    assert {(a.width, a.height) for a in arcs} == {(5.0, 5.0)}
    widths = [a.get_linewidth() for a in arcs]
    assert widths == [ARC_STYLES[s][1] for s in sentences.weight_states(mapped.preloaded, 2.5)]
    assert (arcs[1].theta1, arcs[1].theta2) == (22.5, 67.5)
    assert "5 of 8 directions resist as much, 2 less, 1 not decided." in " ".join(texts(figure).split())
    assert figure.axes[0].get_xlim() == draw_map(mapped).axes[0].get_xlim()
    assert draw_map(mapped, weight=20.0).axes[0].get_xlim()[1] == 25  # room for the circle
    alone = replace(mapped, preloaded=None)
    assert "3 of 8 directions resist as much, 5 less." in " ".join(texts(draw_map(alone, weight=1.0)).split())


def test_the_picture_says_where_the_force_acts(mapped: MapAnswer) -> None:
    assert "Forces act" not in texts(draw_map(mapped))
    assert "Forces act at (0, 20, −5) mm" in texts(draw_map(replace(mapped, at=np.array([0, 0.02, -0.005]))))


def test_an_interrupted_map_is_drawn(mapped: MapAnswer) -> None:
    cut = replace(mapped, preloaded=Curve.of([None] * 8))
    assert "not decided" in texts(draw_map(cut))
    assert picture(draw_map(cut))[:4] == b"\x89PNG"


def test_sweep_has_an_axis_per_unit(swept: SweepAnswer) -> None:
    figure = draw_sweep(swept)
    assert len(figure.axes) == 2
    said = texts(figure)
    for text in ("largest force resisted [N]", "largest torque resisted [N·m]", "command of left [N·m]"):
        assert text in said
    force, torque = (ax.lines[0].get_ydata() for ax in figure.axes)
    np.testing.assert_allclose(force, [1, 0.5, 0])
    np.testing.assert_allclose(torque, [0.2, 0.4, 0.2])  # times the direction's own length, 2


def test_sweep_says_where_it_is_unbounded(swept: SweepAnswer) -> None:
    endless = replace(swept, curves=(curve([1e4, 1, 1], unbounded=[0]), swept.curves[1]))
    assert "any size at 1 of 3 commands" in texts(draw_sweep(endless))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_grasp_from_several_sides(grasp: Grasp, count: int) -> None:
    figure = draw_grasp(grasp, count=count)
    assert len(figure.axes) == count
    said = texts(figure)
    assert "right" in said
    assert "friction cone" in said


def test_scene_shows_the_solids(grasp: Grasp) -> None:
    from handfast.model.body import Body
    from handfast.model.shape import Shape
    from handfast.readers.load_hand import load_hand

    hand = load_hand("parallel-gripper")
    body = Body.of([Shape("box", (0.1, 0.04, 0.04))])
    pose = np.eye(4)
    pose[2, 3] = 0.3
    meshes = scene_meshes(hand, hand.configuration({}), body, pose)
    assert {m.kind for m in meshes} == {"hand", "object"}
    np.testing.assert_allclose(np.ptp(meshes[0].vertices, axis=0), [0.1, 0.04, 0.04])
    assert min(m.vertices[:, 2].min() for m in meshes) == pytest.approx(-0.3)  # the palm, in the object's frame
    assert len(draw_scene(meshes, grasp).axes) == 3


@pytest.mark.slow
def test_pictures_are_the_same_every_time(mapped: MapAnswer, swept: SweepAnswer, grasp: Grasp) -> None:
    for draw in (lambda: draw_map(mapped), lambda: draw_sweep(swept), lambda: draw_grasp(grasp)):
        for ending in ("png", "svg"):
            assert picture(draw(), ending) == picture(draw(), ending)


def test_files_of_every_kind(mapped: MapAnswer, swept: SweepAnswer, tmp_path) -> None:
    begins = {".png": b"\x89PNG", ".svg": b"<?xml", ".csv": b"", ".json": b"{"}
    for ending, start in begins.items():
        save_map(mapped, tmp_path / f"map{ending}")
        save_sweep(swept, tmp_path / f"sweep{ending}")
        assert (tmp_path / f"map{ending}").read_bytes().startswith(start)
        assert (tmp_path / f"sweep{ending}").read_bytes().startswith(start)
    with pytest.raises(InputError, match=r"map\.png: exists already"):
        save_map(mapped, tmp_path / "map.png")
    save_map(mapped, tmp_path / "map.png", force=True)
    rows = (tmp_path / "map.csv").read_text().splitlines()
    assert rows[3].split(",")[3:] == ["0.0", "0.0", "false", "slips", "2.0", "5.0", "false", "holds"]
    assert (tmp_path / "sweep.csv").read_text().splitlines()[2] == "0.1,0.5,0.5,false,0.2,0.25,false"


def test_a_map_in_axes_of_ones_own() -> None:
    """Two maps side by side: nothing of the figure but the axes is touched."""
    figure = Figure()
    left, right = figure.subplots(1, 2)
    drawn = force_map(pinch(), "xy", steps=4, jobs=1)
    assert draw_map(drawn, ax=left) is figure
    assert draw_map(drawn, ax=right, limit=5.0) is figure
    assert (len(figure.axes), figure.legends, figure.texts) == (2, [], [])
    assert right.get_xlim() == (-5.0, 5.0)
    assert left.get_xlabel() == "force along x [N]"
    assert draw_map(drawn) is not figure
