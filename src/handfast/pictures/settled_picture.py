"""Where a grasp ended up, in words and pictures: frames along its path, and the page that shows them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from handfast.core.answer import Verdict
from handfast.pictures.camera import View
from handfast.pictures.drawing import BLUE, GREY, INK, motion_and_load, solids, windowed
from handfast.pictures.scene import Mesh, scene_meshes
from handfast.pictures.words import count, listed, load_text, num
from handfast.simulation.settled import Rest, verdict_of

if TYPE_CHECKING:
    from handfast.core.arrays import Array
    from handfast.simulation.settled import PathPoint, Settled

FRAMES = 5
CARRYING = 0.8  # [grasp sizes] length of the largest contact force
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
    return [*lines, *(f"{note[0].upper()}{note[1:]}." for note in found.notes)]


def draw_settled(found: Settled, frames: int = FRAMES) -> Figure:
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
        _frame(figure.add_axes((n / frames, 0.4, 1 / frames, 0.48)), found, found.path[k], half, middle)
    moved, share = (np.array([getattr(p, name) for p in found.path]) for name in ("moved", "share"))
    ax = motion_and_load(figure, (0.06, 0.11, 0.88, 0.25), (np.arange(float(len(moved))), moved), share, chosen)
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


def _frame(ax: Any, found: Settled, at: PathPoint, half: float, middle: Array) -> None:
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
    from handfast.pictures import Entry, write_report
    from handfast.pictures.scene import source_meshes

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
    notes = [f"{headline(found)[0].upper()}{headline(found)[1:]}.", " ".join(details(found))]
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
