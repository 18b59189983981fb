"""A still picture of a hand: its fingers, regions and joint axes from two sides."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from handfast.core.arrays import Array
from handfast.pictures.camera import View
from handfast.pictures.depth_buffer import DENSE, Facets, region_facets, side_by_side
from handfast.pictures.drawing import GREEN, GREY, INK, SOLID
from handfast.pictures.hand_facts import ShownHand
from handfast.pictures.hand_scene import PALM, hand_sides, link_meshes, tint, triangle_share
from handfast.pictures.scene import coarse

OF_HAND, OF_OBJECT = 8_000, 6_000  # triangles in a still picture
WIDTH, FOOT = 9.0, 0.75  # [inches] of the figure, and of the key below the panels
ROOM = 0.015  # [m] around what is seen
AXIS = 0.06  # half length of a joint axis, in the width of a panel


def draw_hand(shown: ShownHand, dense: int = DENSE) -> Figure:
    """The hand at its configuration from the side to which it closes, and from behind; with the object, if any.

    Links have the colour of their finger, regions are darker. Axes of joints that close are green.

    Args:
        dense: pixels in an inch, at which a figure of 9 inches is meant to be saved.
    """
    panel = _solids(shown)
    at_an_angle, _, behind, *_ = hand_sides(shown)
    seen = [(panel, view, _window(panel, view)) for view in (at_an_angle, behind)]
    figure, axes, wide = side_by_side(seen, (WIDTH, FOOT), (1.4, 0.6), dense)
    for ax, view in axes:
        _axes(ax, shown, view, AXIS * wide)
    key = _key(shown)
    figure.legend(handles=key, loc="lower center", ncols=min(len(key), 6), frameon=False, fontsize=9)
    return figure


def _solids(shown: ShownHand) -> list[Facets]:
    """Links, regions and the object, base frame."""
    facts, hand = shown.facts, shown.facts.hand
    poses, share = hand.link_poses(shown.q), triangle_share(facts, OF_HAND)
    found = []
    for i, (link, pose) in enumerate(zip(hand.links, poses, strict=True)):
        color = np.array(to_rgb(tint(facts, facts.finger[i])[0]))
        for mesh in link_meshes(link, share)[0]:
            vertices = mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
            found.append(Facets(vertices[mesh.faces], color, True))
    for r in facts.regions or ():
        found.append(region_facets(r.region, poses[hand.link(r.link)], tint(facts, r.finger)[1]))
    if shown.body is not None:
        vertices, faces, _ = coarse(shown.body.vertices, shown.body.faces, OF_OBJECT)
        placed = vertices @ shown.pose[:3, :3].T + shown.pose[:3, 3]
        found.append(Facets(placed[faces], SOLID["object"], True))
    return found


def _window(panel: list[Facets], view: View) -> tuple[Array, Array]:
    """Corners (2,) of what is seen, with room around it."""
    corners = [f.corners.reshape(-1, 3) for f in panel] or [np.zeros((1, 3))]
    flat = np.vstack(corners) @ view.matrix[:2].T
    room = max(ROOM, 0.08 * float(np.ptp(flat, axis=0).max()))
    return flat.min(axis=0) - room, flat.max(axis=0) + room


def _axes(ax: Any, shown: ShownHand, view: View, half: float) -> None:
    """The joints' axes, over everything else."""
    hand = shown.facts.hand
    for axis, origin, closing in zip(*hand.joint_axes(shown.q), hand.closing, strict=True):
        ends = np.array([origin - half * axis, origin + half * axis]) @ view.matrix[:2].T
        ax.plot(*ends.T, color=GREEN if closing else GREY, lw=1.1, alpha=0.85, zorder=7)


def _key(shown: ShownHand) -> list[Any]:
    facts = shown.facts
    entries: list[Any] = [Patch(fc=tint(facts, f)[0], label=f) for f in facts.fingers]
    entries.append(Patch(fc=PALM[0], label="palm"))
    if facts.regions is not None:
        entries.append(Patch(fc=INK, label="regions: darker"))
    if shown.body is not None:
        entries.append(Patch(fc=tuple(SOLID["object"]), label="object"))
    entries.append(Line2D([], [], color=GREEN, lw=1.1, label="axis of a joint that closes"))
    if not np.all(facts.hand.closing):
        entries.append(Line2D([], [], color=GREY, lw=1.1, label="other joint"))
    return entries
