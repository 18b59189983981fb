"""What all pages are made of: the page itself, its 3-D view with its program, tables, still pictures."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from importlib import resources
from typing import Any

from matplotlib.figure import Figure

from handfast.pictures.drawing import data_uri

BAD = "\x00"  # in front of a cell: a number that should worry
TURNING = (  # said below a view in three dimensions
    "Drag to turn, with Shift (or two fingers) to shift; click and scroll, or pinch, to zoom; "
    "double-click to begin again."
)
WORDY = 16  # characters; a longer cell is a sentence, and may take several lines
OPACITY = 0.45  # of the object at first; contacts and forces lie inside it


def page(title: str, styles: Sequence[str], parts: Sequence[str]) -> str:
    """A whole page that works offline.

    Args:
        styles: names of files with CSS.
    """
    head = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)} – Handfast</title>\n<style>\n{_browser(styles)}</style></head><body><main>"
    )
    return "\n".join([head, *parts, "</main></body></html>\n"])


def view3d(data: Mapping[str, Any], program: Sequence[str], parts: tuple[str, str, str, str]) -> str:
    """A figure that draws data in three dimensions, or says that it cannot.

    Args:
        program: names of files of one script: each uses the names of those before it.
        parts: controls above the stage; what stands beside it; the sentence instead of it; what follows it.
    """
    controls, beside, instead, below = parts
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")  # no name can end the script
    canvas = '<canvas tabindex="0" aria-label="In three dimensions"></canvas>'
    stage = f'<div class="stage">{canvas}<div class="labels"></div></div>'
    if beside:
        stage = f'<div class="bench">{stage}{beside}</div>'
    return (
        f'<figure class="view3d"><div class="controls">{controls}</div>{stage}<p class="said"></p>'
        f'<p class="fallback">{instead}, in a browser that runs scripts and has WebGL; '
        "the pictures below need neither.</p>"
        f'{below}<script type="application/json">{text}</script>'
        f"<script>(() => {{\n'use strict';\n{_browser(program)}}})();</script></figure>"
    )


def select(name: str, label: str, options: Sequence[str], chosen: int = 0, *, steps: bool = False) -> str:
    """A list to choose from, hidden where there is no choice; `steps`: with buttons for the one before and the next."""
    rows = "".join(
        f'<option value="{i}"{" selected" if i == chosen else ""}>{escape(o)}</option>' for i, o in enumerate(options)
    )
    ways = (("previous", "‹"), ("next", "›")) if steps else ()
    buttons = "".join(
        f'<button type="button" name="{name}-{way}" aria-label="{way} {name}">{sign}</button>' for way, sign in ways
    )
    hidden = " hidden" if len(options) < 2 else ""
    return f'<label{hidden}>{label} <select name="{name}" autocomplete="off">{rows}</select>{buttons}</label>'


def switches(labels: Mapping[str, tuple[str, bool]], *, thing: bool, hidden: Sequence[str] = ()) -> str:
    """How clear the object is, if there is one; a box for each layer but those `hidden`; the way back to the first."""
    gone = "" if thing else " hidden"
    opacity = f'<input type="range" name="opacity" min="0" max="1" step="0.05" value="{OPACITY}" autocomplete="off">'
    boxes = "".join(
        f"<label{' hidden' if name in hidden else ''}>"
        f'<input type="checkbox" name="{name}"{" checked" if on else ""} autocomplete="off">{label}</label>'
        for name, (label, on) in labels.items()
    )
    return f'<label{gone}>object {opacity}</label>{boxes}<button type="button" name="reset">reset view</button>'


def mark(color: str, text: str, kind: str = "") -> str:
    """An entry of a key; `kind` "square" for a surface, else a line."""
    return f'<span class="mark {kind}" style="background:{color}"></span>{escape(text)} '


def table(heads: Sequence[str], rows: Sequence[Sequence[str]], title: str = "") -> str:
    """An HTML table; columns of numbers are set right."""
    if not rows:
        return ""
    right = [
        all(r[k].strip(BAD)[:1] in "0123456789−-–∞?+" for r in rows) and not heads[k].startswith("#")
        for k in range(len(heads))
    ]

    def cell(tag: str, k: int, text: str) -> str:
        wordy = tag == "td" and len(text) > WORDY and not text.startswith("(")
        names = [n for n, on in (("n", right[k]), ("bad", text.startswith(BAD)), ("wordy", wordy)) if on]
        style = f' class="{" ".join(names)}"' if names else ""
        return f"<{tag}{style}>{escape(text.lstrip(BAD).lstrip('#'))}</{tag}>"

    head = "".join(cell("th", k, h) for k, h in enumerate(heads))
    head = f"<thead><tr>{head}</tr></thead>" if any(h.strip("#") for h in heads) else ""
    body = "".join("<tr>" + "".join(cell("td", k, c) for k, c in enumerate(row)) + "</tr>" for row in rows)
    heading = f"<h3>{escape(title)}</h3>" if title else ""
    return f'{heading}<div class="wide"><table>{head}<tbody>{body}</tbody></table></div>'


def still(figure: Figure, caption: str, ending: str = "svg") -> str:
    """A picture with its caption."""
    source = data_uri(figure, ending, dpi=160 if ending == "svg" else 100)
    return (
        f'<figure><img alt="{escape(caption, quote=True)}" src="{source}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def _browser(names: Sequence[str]) -> str:
    """What runs in the browser, files after each other."""
    folder = resources.files("handfast.pictures") / "browser"
    return "\n".join((folder / name).read_text("utf-8") for name in names)
