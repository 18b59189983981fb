"""How a grasp moved: a simulation as a strip of pictures or a film, and where `settle` followed it to, with its words.

Pictures are drawn by us, the same bytes every time. A simulated motion is enlarged where it would not be seen.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.pictures import Entry, write_report
from handfast.pictures.camera import View, views
from handfast.pictures.drawing import AMBER, ARROW_STYLE, BLUE, GREY, INK, MAROON, solids, windowed
from handfast.pictures.scene import Mesh, MovingScene, applied, scene_meshes, source_meshes
from handfast.pictures.words import count, listed, load_text, num, sentence
from handfast.simulation.result import SimulationResult
from handfast.simulation.settled import PathPoint, Rest, Settled, verdict_of

PATH_PICTURES = 5  # along a path
FRAMES, MOMENTS = 30, 6  # of a film, and of a strip
MAX_MOTION_LENGTH = 0.25  # [grasp sizes] to which the largest motion is enlarged
MAX_FORCE_LENGTH = 0.8  # [grasp sizes] length of the largest force
VIEW = View.of(-55.0, 22.0, "")


def headline(found: Settled) -> str:
    """What became of it, in a sentence: 'slips at first, holds after 3 mm'."""
    load = load_text(found.wrench)
    far = f"{num(1e3 * found.moved, 3)} mm"
    turned = f" and {num(float(np.degrees(found.turned)), 2)}°" if found.turned > np.radians(0.5) else ""
    match found.rest:
        case Rest.HOLDS:
            return f"holds {load} as it stands: nothing was followed"
        case Rest.SETTLES if found.onset is None:
            return f"gives way by {far}{turned} under {load}, and holds it there, without a sudden slip on the way"
        case Rest.SETTLES:
            return f"slips under {load} at first, holds it after {far}{turned}"
        case Rest.RESTS if found.last is None:
            return f"comes to rest after {far}{turned}, and touches nothing there"
        case Rest.RESTS:
            said = "does not decide it" if verdict_of(found.after) is Verdict.UNDECIDED else "says that it slips from"
            return f"comes to rest under {load} after {far}{turned}, but check {said} there"
        case Rest.LEAVES:
            return f"leaves under {load}: still moving after {far}{turned}"
        case _:
            return f"still moves after {far}{turned} under {load}; more --steps may tell"


def details(found: Settled) -> list[str]:
    """What there is to know beside the headline, a sentence each."""
    lines = []
    if found.rest is not Rest.HOLDS:
        gives = found.rest is Rest.SETTLES and found.onset is None
        why = ", of contacts that stay where they are; followed, they move with hand and object" if gives else ""
        lines.append(f"As it stands, check says: {verdict_of(found.before)}{why}.")
    if found.gone_on_at is not None:
        lines.append(f"It goes on from where the load's path ends, at {num(100 * found.gone_on_at)} % of the load.")
    if found.onset is not None:
        lines.append(f"On its path it first slipped at {num(100 * found.onset)} % of the {found.onset_of}.")
    if found.last is not None and found.path:
        links = sorted({c.link for c in found.last.contacts})
        lines.append(f"At rest: {count(found.last.m, 'contact')}, of {listed(links)}.")
        if found.most is not None and found.most.unbounded:
            lines.append("There it resists any multiple of this load.")
        elif found.most is not None and found.most.lower > 0:
            lines.append(f"There it resists up to {num(found.most.lower)} times this load.")
        if found.last_wrench is not None:
            lines.append(f"In the object's axes there, the load is {load_text(found.last_wrench)}.")
        if found.simulated:
            lines.append(f"A simulation of the last grasp alone: {found.simulated}.")
    return [*lines, *map(sentence, found.notes)]


def draw_settled(found: Settled, frames: int = PATH_PICTURES) -> Figure:
    """Hand and object along the path, as the hand sees them; below, how far it moved and how much of the load acted.

    Blue: normal forces of contacts. The object's first place is outlined by the points of its first contacts, in grey.
    """
    figure = Figure(figsize=(2.6 * frames, 5.0), dpi=100)
    if not found.path:
        figure.text(0.5, 0.5, headline(found), ha="center", color=INK)
        return figure
    chosen = moments(found, frames)
    half, middle = _window(found)
    for n, k in enumerate(chosen):
        _settled_frame(figure.add_axes((n / frames, 0.4, 1 / frames, 0.48)), found, found.path[k], half, middle)
    moved, share = (np.array([getattr(p, name) for p in found.path]) for name in ("moved", "share"))
    ax = _motion_and_load(figure, (0.06, 0.11, 0.88, 0.25), (np.arange(float(len(moved))), moved), share, chosen)
    ax.set_xlabel("steps", fontsize=8)
    figure.text(0.01, 0.955, f"{found.first.name}: {headline(found)}", fontsize=10, color=INK)
    return figure


def moments(found: Settled, frames: int) -> list[int]:
    """Indices along the path: its start and end, and between them equal parts of the way."""
    moved = np.maximum.accumulate([p.moved for p in found.path])
    ways = np.linspace(0, moved[-1], frames)[1:-1]
    between = [int(np.searchsorted(moved, way)) for way in ways]
    return [0, *between, len(found.path) - 1]


def _window(found: Settled) -> tuple[float, Array]:
    """Half width of the frames [m], and their middle in the plane of the picture."""
    V, first = VIEW.matrix, found.path[0].pose
    p = found.first.positions @ first[:3, :3].T + first[:3, 3]
    vertices = found.scene.body.vertices @ first[:3, :3].T + first[:3, 3]
    seen = np.vstack([p, vertices]) @ V[:2].T
    low, high = seen.min(axis=0), seen.max(axis=0)
    return 0.55 * float((high - low).max()) + 0.3 * found.first.size + found.moved / 2, (low + high) / 2


def _settled_frame(ax: Any, found: Settled, at: PathPoint, half: float, middle: Array) -> None:
    V, scene = VIEW.matrix, found.scene
    R, t = at.pose[:3, :3], at.pose[:3, 3]
    meshes = [Mesh(m.vertices @ R.T + t, m.faces, m.kind) for m in scene_meshes(scene.hand, at.q, scene.body, at.pose)]
    solids(ax, meshes, V)
    first = found.path[0].pose
    p = found.first.positions
    ax.plot(*((p @ first[:3, :3].T + first[:3, 3]) @ V[:2].T).T, "o", ms=6, mfc="none", mec=GREY, zorder=6)
    ax.plot(*((p @ R.T + t) @ V[:2].T).T, ".", ms=3, color=GREY, zorder=6)
    if len(at.positions):
        size = 3 + 9 * np.sqrt(at.forces / at.forces.max())
        for x, s in zip((at.positions @ R.T + t) @ V[:2].T, size, strict=True):
            ax.plot(*x, "o", ms=s, color=BLUE, mec="white", mew=0.6, zorder=8, alpha=0.85)
    windowed(ax, middle, half)
    ax.set_title(f"load {100 * at.share:.0f} %, {num(1e3 * at.moved, 3)} mm", fontsize=8)


def report_settled(path: str | Path, found: Settled, *, force: bool = False) -> None:
    """Write a page: the grasp at rest, or as it stood, with its verdicts, and the path in pictures.

    Raises:
        InputError: the file exists and `force` is not set, or cannot be written.
    """
    load = load_text(found.wrench)
    rests = found.last is not None and bool(found.path)
    grasp = found.last if found.last is not None and rests else found.first
    entries = []
    if rests and found.after is not None:
        entries.append(Entry(f"Does it hold {load} where it came to rest?", found.after))
    if rests and found.most is not None and found.last_wrench is not None:
        entries.append(Entry("How much of this load?", found.most, direction=found.last_wrench.tolist()))
    if not rests and found.before is not None:
        entries.append(Entry(f"Does it hold {load} as it stands?", found.before))
    at = found.path[-1 if rests else 0] if found.path else None
    meshes = source_meshes(grasp)[0]
    if at is not None:
        meshes = scene_meshes(found.scene.hand, at.q, found.scene.body, at.pose)
    notes = [sentence(headline(found)), " ".join(details(found))]
    facts = [
        ("ending", str(found.rest)),
        ("moved", f"{num(1e3 * found.moved, 3)} mm, turned by {num(float(np.degrees(found.turned)), 3)}°"),
        ("steps", str(max(len(found.path) - 1, 0))),
    ]
    gallery = [(draw_settled(found), "The path: blue, what carries; grey, where the first contacts were.")]
    write_report(
        path, grasp, entries, meshes=meshes, notes=notes, facts=facts, gallery=gallery if found.path else (),
        force=force,
    )  # fmt: skip


# --- a simulation ---


def film(result: SimulationResult, scene: MovingScene | None = None, frames: int = FRAMES) -> bytes:
    """An animated GIF."""
    from PIL import Image

    pages = []
    for k in _moments(result, frames):
        figure = Figure(figsize=(4.4, 4.4), dpi=80)
        _frame(figure.add_axes((0, 0, 1, 0.9)), result, k, scene)
        drawn = io.BytesIO()
        figure.savefig(drawn, format="png", dpi=80)
        pages.append(Image.open(drawn).convert("P", palette=Image.Palette.ADAPTIVE, colors=64))
    out = io.BytesIO()
    pages[0].save(out, format="GIF", save_all=True, append_images=pages[1:], duration=120, loop=0)
    return out.getvalue()


def strip(result: SimulationResult, scene: MovingScene | None = None, pictures: int = MOMENTS) -> Figure:
    """Pictures from the beginning to the end in a row; below them motion and load over time."""
    figure = Figure(figsize=(2.4 * pictures, 4.6), dpi=100)
    chosen = _moments(result, pictures)
    for n, k in enumerate(chosen):
        _frame(figure.add_axes((n / pictures, 0.46, 1 / pictures, 0.46)), result, k, scene)
    ax = _motion_and_load(figure, (0.07, 0.11, 0.86, 0.27), (result.time, result.motion), result.load, chosen)
    ax.set_xlabel("time in the simulation [s]", fontsize=8)
    if result.onset is not None:
        at = result.time[int(np.argmax(result.load >= result.onset))]
        ax.axvline(at, color=GREY, lw=0.8, ls="--")
        ax.annotate(" slips", (at, 0.9), xycoords=("data", "axes fraction"), fontsize=8, color=INK)
    return figure


def enlargement(result: SimulationResult) -> float:
    """By how much the object's motion is enlarged: 1 where it is seen as it is."""
    size, most = result.grasp.size, float(result.motion.max())
    if most <= 0 or most > MAX_MOTION_LENGTH * size:
        return 1.0
    ten = float(10.0 ** np.floor(np.log10(MAX_MOTION_LENGTH * size / most)))
    return max(step * ten for step in (1, 2, 5) if step * ten * most <= MAX_MOTION_LENGTH * size)


def _moments(result: SimulationResult, count: int) -> list[int]:
    """Moments spread over the history; a slip goes fast, so that half of them follow the motion."""
    n = len(result.time)
    half = [round(x) for x in np.linspace(0, n - 1, count - count // 2)]
    travelled = np.maximum.accumulate(result.motion)
    ends = np.linspace(travelled[0], travelled[-1], count // 2 + 2)[1:-1]
    return sorted([*half, *(min(int(np.searchsorted(travelled, x)), n - 1) for x in ends)])


def _frame(ax: Any, result: SimulationResult, k: int, scene: MovingScene | None) -> None:
    """One moment: solids, contacts, their forces and the load."""
    grasp, size = result.grasp, result.grasp.size
    names = [grasp.joints[j].name for j in result.free]
    large = enlargement(result)
    turned = dict(zip(names, large * result.joints[k], strict=True))
    meshes = scene(turned) if scene else []
    view: View = views(grasp, 1)[0] if not meshes else View.of(-55.0, 28.0, "")
    V = view.matrix
    p = grasp.positions
    middle = p.mean(axis=0)
    turn = Rotation.from_rotvec(large * result.turn[k]).as_matrix()
    shift = large * result.shift[k]

    def moved(x: Array) -> Array:
        out: Array = middle + shift + (x - middle) @ turn.T
        return out

    shown = [Mesh(moved(m.vertices), m.faces, m.kind) if m.kind == "object" else m for m in meshes]
    solids(ax, shown, V)
    at = moved(p)
    if not meshes:
        ax.fill(*(at @ V[:2].T).T, fc="#efe6d3", ec="#cdbf9f", lw=0.8, ls="--", zorder=1)
    ax.plot(*(p @ V[:2].T).T, "o", ms=7, mfc="none", mec=GREY, zorder=6)
    ax.plot(*(at @ V[:2].T).T, "o", ms=4.5, color=INK, mec="white", mew=0.6, zorder=8)
    most = max(float(np.linalg.norm(result.forces, axis=2).max()), float(np.linalg.norm(result.wrench[:3])), 1e-300)
    for i, contact in enumerate(grasp.contacts):
        force = turn @ (contact.frame[:, 0] * result.forces[k, i, 0])
        _arrow(ax, at[i] @ V[:2].T, MAX_FORCE_LENGTH * size / most * V[:2] @ force, BLUE)
    origin, w = applied(result.load[k] * result.wrench, middle, 2 * size)
    _arrow(ax, V[:2] @ (origin + shift), MAX_FORCE_LENGTH * size / most * V[:2] @ w[:3], AMBER)
    seen = np.vstack([p, *(m.vertices for m in meshes)]) @ V[:2].T
    low, high = seen.min(axis=0) - 0.6 * size, seen.max(axis=0) + 0.6 * size
    windowed(ax, (low + high) / 2, float((high - low).max()) / 2)
    scale = f", motion × {large:g}" if large != 1 else ""
    ax.set_title(f"load {100 * result.load[k]:.0f} %, {1e3 * result.motion[k]:.2g} mm{scale}", fontsize=8)


def _arrow(ax: Any, at: Array, along: Array, color: str) -> None:
    if np.linalg.norm(along) > 0:
        style = ARROW_STYLE | {"color": color, "lw": 1.6}
        ax.annotate("", at + along, at, arrowprops=style, zorder=7, annotation_clip=False)


def _motion_and_load(
    figure: Figure,
    box: tuple[float, float, float, float],
    motion: tuple[Array, Array],
    load: Array,
    chosen: Sequence[int],
) -> Any:
    """Axes with a motion [mm] and a share of a load over something, and dots at chosen moments.

    Args:
        motion: (n,) what it is drawn over, and (n,) [m]; load: (n,) shares.
    """
    x, moved = motion
    ax = figure.add_axes(box)
    ax.plot(x, 1e3 * moved, color=MAROON, lw=1.4)
    ax.plot(x[list(chosen)], 1e3 * moved[list(chosen)], "o", ms=3.5, color=INK)
    ax.set_ylabel("moved [mm]", color=MAROON, fontsize=8)
    other = ax.twinx()
    other.plot(x, 100 * load, color=AMBER, lw=1.4)
    other.set_ylabel("load [%]", color=AMBER, fontsize=8)
    for axes in (ax, other):
        axes.tick_params(labelsize=7)
    return ax
