"""The panel's own pictures: the verdict, the margin as a bar, the map as a small plot. HTML and SVG.

Their colours that are not of an answer are those of `dressed_page`, light or dark.
"""

from __future__ import annotations

from html import escape

import numpy as np

from handfast.pictures import words
from handfast.pictures.live.shown_state import CURVE, GREY, RGB, Shown
from handfast.pictures.live.view_state import LOAD_ARROW, Stage, ViewState

BAR = 1.5  # shares of the largest load that the bar is long
PLOT_PIXELS = 230  # pixels of the plot
LINES = 90  # pixels that sentences take at least, or sliders would jump under the mouse
SMALL_TEXT = 'font-size="11" style="fill:var(--soft)"'
WHERE = "position:absolute;top:0;bottom:0"


def css(color: RGB) -> str:
    """#rrggbb."""
    return "#" + "".join(f"{x:02x}" for x in color)


def verdict_html(shown: Shown) -> str:
    """Headline, bar and sentences."""
    color = css(shown.color)
    said = "".join(f'<div style="margin-top:2px">{escape(text)}</div>' for text in shown.sentences)
    return (
        f'<div style="padding:4px 14px 8px;font-size:13px;line-height:1.35">'
        f'<div style="font-size:25px;font-weight:700;letter-spacing:.04em;color:{color}">{escape(shown.headline)}</div>'
        f'{bar_html(shown)}<div style="min-height:{LINES}px">{said}</div></div>'
    )


def bar_html(shown: Shown) -> str:
    """The load as a share of the largest in its direction, with a mark at 1."""
    share = shown.share
    if share is None:
        width, text = 0.0, "load / largest: …"
    elif np.isinf(share):
        width, text = 1.0, "load / largest: the largest is 0"
    else:
        width = min(share / BAR, 1.0)
        text = (
            f"load / largest: {words.num(100 * share, 3)} %"
            if share > 0
            else "load / largest: no bound in this direction"
        )
    mark = 100 / BAR
    return (
        '<div style="position:relative;height:16px;margin:4px 0 3px;border-radius:4px;background:var(--track);'
        f'overflow:hidden"><div style="{WHERE};left:0;width:{100 * width:.1f}%;background:{css(shown.color)}"></div>'
        f'<div style="{WHERE};left:{mark:.1f}%;width:2px;background:var(--mark)"></div></div>'
        f'<div style="color:var(--soft)">{escape(text)}</div>'
    )


def map_svg(state: ViewState, stage: Stage, shown: Shown) -> str:
    """The map seen along its normal, with the load in it; '' without a map."""
    axes = state.map_axes
    if axes is None or shown.map is None:
        return ""
    middle, rim = PLOT_PIXELS / 2, PLOT_PIXELS / 2 - 20
    scale = rim / (LOAD_ARROW * stage.size)
    right, up = _screen_axes(axes, state, stage)

    def xy(points: np.ndarray) -> np.ndarray:
        d = points - shown.map.at  # type: ignore[union-attr]
        return np.column_stack([middle + scale * (d @ right), middle - scale * (d @ up)])

    flat = xy(shown.map.outline)
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in flat)
    fill, edge = ("--known", css(CURVE)) if not shown.map.grey else ("--late", css(GREY))
    parts = [
        f'<circle cx="{middle}" cy="{middle}" r="{rim}" fill="none" style="stroke:var(--rim)"/>',
        f'<polygon points="{line}" style="fill:var({fill})" stroke="{edge}" stroke-width="1.6" '
        'stroke-linejoin="round"/>',
    ]
    if len(shown.load):
        tip = xy(shown.load[-1:, 1])[0]
        color = css(shown.color)
        parts.append(
            f'<line x1="{middle}" y1="{middle}" x2="{tip[0]:.1f}" y2="{tip[1]:.1f}" stroke="{color}" stroke-width="3"/>'
            f'<circle cx="{tip[0]:.1f}" cy="{tip[1]:.1f}" r="5" fill="{color}"/>'
        )
    unit = "N·m" if state.is_torque else "N"
    reach = stage.torque_reach if state.is_torque else stage.force_reach
    note = f"{words.num(reach, 3)} {unit}" + (" and more" if bool(shown.map.cut.any()) else "")
    parts.append(
        f'<text x="{PLOT_PIXELS}" y="{PLOT_PIXELS - 2}" text-anchor="end" {SMALL_TEXT}>rim: {escape(note)}</text>'
    )
    for axis, name in zip(np.eye(3), "xyz", strict=True):
        d = np.array([axis @ right, axis @ up])
        if np.linalg.norm(d) > 0.35:
            x, y = middle + (rim + 8) * d[0], middle - (rim + 8) * d[1]
            parts.append(f'<text x="{x:.0f}" y="{y + 4:.0f}" text-anchor="middle" {SMALL_TEXT}>{name}</text>')
    return (
        f'<div class="map" style="padding:0 14px"><svg width="{PLOT_PIXELS}" height="{PLOT_PIXELS}" '
        f'viewBox="0 0 {PLOT_PIXELS} {PLOT_PIXELS}" '
        f'style="display:block;margin:auto">{"".join(parts)}</svg></div>'
    )


def _screen_axes(axes: np.ndarray, state: ViewState, stage: Stage) -> tuple[np.ndarray, np.ndarray]:
    """Right and up of the plot: up as near to the page's as the plane allows."""
    normal = np.cross(axes[0], axes[1])
    if normal @ (stage.eye - stage.target) < 0:  # seen from the side of the first look
        normal = -normal
    up = stage.up - (stage.up @ normal) * normal
    if np.linalg.norm(up) < 0.2:
        up = axes[1]
    up = up / np.linalg.norm(up)
    return np.cross(up, normal), up
