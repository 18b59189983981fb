"""The page of a hand: to be turned, with a slider for each joint, and all that is known and guessed about it."""

from __future__ import annotations

from html import escape
from pathlib import Path

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import refuse_existing, write_bytes, write_text
from handfast.model.body import Body
from handfast.model.hand.hand import Hand
from handfast.model.hand_regions import HandRegions
from handfast.pictures import hand_rows, page_parts
from handfast.pictures.depth_buffer import PIXELS_PER_INCH
from handfast.pictures.drawing import data_uri, picture
from handfast.pictures.hand_facts import HandFacts, ShownHand, facts_of, shown_hand
from handfast.pictures.hand_picture import PALM_COLORS, draw_hand, hand_scene, tint
from handfast.pictures.page_parts import table
from handfast.pictures.view3d import PART_COLORS
from handfast.pictures.words import tendon_rows

# one script, in this order
HAND_SCRIPTS = "shapes3d.js", "kinematics3d.js", "stage3d.js", "controls3d.js", "hand3d.js"
HAND_SWITCHES = {  # name: (label, on at first)
    "hand": ("links", True),
    "regions": ("regions", True),
    "joints": ("joint axes", True),
    "palm": ("palm's approach", True),
    "names": ("joint names", False),
    "tags": ("region names", False),
    "perspective": ("perspective", True),
}
PICTURE_ENDINGS, PAGES = (".png", ".svg"), (".html", ".htm")
STILL_DPI = 80  # pixels in an inch of the still picture in a page, which few will see
MAX_TABLE_ROWS = 40  # rows of a table that is not folded away


def report_hand(
    path: str | Path,
    hand: Hand,
    body: Body | None = None,
    *,
    q: Array | None = None,
    pose: Array | None = None,
    regions: HandRegions | None = None,
    force: bool = False,
) -> None:
    """Write what a hand is as a self-contained page (`.html`) or a still picture (`.png`, `.svg`).

    The page works offline. It shows the hand in three dimensions with a slider for each joint; joints that follow
    others do so there too. Shown are joints with limits, closing senses and actuators, couplings, frames of links,
    the palm, fingers and regions, pairs of links that are not checked against each other, and masses where the
    hand's file states them. Only collision shapes are drawn; large meshes with fewer triangles, which the page says.

    Args:
        hand: any hand.
        body: an object to show with it.
        q: (l,) configuration to begin with [rad, m]; zero, clipped to the limits, by default.
        pose: (4, 4) of the object in the hand's base frame; by default its centre of mass is where the half-closed
            fingertips meet.
        regions: the hand's; by default bundled or guessed ones.

    Raises:
        InputError: another ending, a file that exists while `force` is not set, or cannot be written; a
            configuration of another length, a pose that is not rigid, regions of links that the hand does not have.
    """
    write_hand(path, shown_hand(facts_of(hand, regions), body, q=q, pose=pose), force=force)


def write_hand(path: str | Path, shown: ShownHand, *, force: bool = False) -> None:
    """The same of a hand that was looked at already. Raises `InputError` as `report_hand` does of files."""
    ending = Path(path).suffix.lower()
    if ending not in PICTURE_ENDINGS + PAGES:
        raise InputError(f"a name that ends in {', '.join(PAGES + PICTURE_ENDINGS)} is needed", source=str(path))
    refuse_existing(path, force=force)
    if ending in PICTURE_ENDINGS:
        write_bytes(path, picture(draw_hand(shown), ending[1:], dpi=PIXELS_PER_INCH), force=force)
    else:
        write_text(path, hand_page(shown), force=force)


def hand_page(shown: ShownHand) -> str:
    """The whole page as HTML."""
    facts = shown.facts
    data, notes = hand_scene(shown)
    still = data_uri(draw_hand(shown, STILL_DPI), dpi=STILL_DPI)
    sliders = f'<div class="sliders">{_sliders(facts)}</div>'
    instead = "Here the hand can be turned and its joints moved"
    below = (
        f"<figcaption>{_caption(shown)}</figcaption>{_frames(facts)}"
        '<details class="file"><summary>these joints as a configuration file</summary>'
        '<pre class="configuration"></pre></details>'
    )
    controls = page_parts.select("side", "", [v["title"] for v in data["sides"]])
    controls += page_parts.switches(HAND_SWITCHES, thing=shown.body is not None)
    parts = [
        f'<h1>{escape(facts.hand.name)}</h1><p class="facts">{escape(hand_rows.counts(facts))}</p>',
        *(f'<p class="why">{escape(text)}</p>' for text in facts.missing),
        page_parts.view3d(data, HAND_SCRIPTS, (controls, sliders, instead, below)),
        f'<figure class="still"><img alt="The hand from two sides" src="{still}"></figure>',
        *(f'<p class="note">{escape(note)}</p>' for note in notes),
        *_sections(shown),
    ]
    return page_parts.page(facts.hand.name, ["page.css", "hand.css"], parts)


def _sliders(facts: HandFacts) -> str:
    """A slider for each joint, by finger; one that closes them together; a button back to the beginning."""
    hand = facts.hand
    hidden = "" if facts.palm else " hidden"  # without one, nothing says what an open hand is
    out = [
        f'<label class="joint"{hidden}><span>all that close</span><output>open to closed</output><input type="range" '
        'name="together" min="0" max="1" step="0.01" value="0" autocomplete="off"></label>'
        '<button type="button" name="given">joints as given</button>'
    ]
    carrier = {j: facts.finger[i] for i, link in enumerate(hand.links) for j in link.joints}
    order = dict.fromkeys(["palm", *facts.fingers])
    for finger in order:
        joints = [j for j in range(hand.l) if carrier.get(j, "palm") == finger]
        if joints:
            mark = f'<span class="mark square" style="background:{tint(facts, finger)[0]}"></span>'
            title = "palm and wrist" if finger == "palm" else finger
            out += [f"<h4>{mark}{escape(title)}</h4>", *(_slider(facts, j) for j in joints)]
    return "".join(out)


def _slider(facts: HandFacts, j: int) -> str:
    hand, joint = facts.hand, facts.hand.joints[j]
    follows = hand_rows.follows_text(hand, j)
    held = joint.lower == joint.upper or j in hand.dependent or (follows and not hand.breakaway)
    said = [hand_rows.range_text(hand, j)]
    said += [f"closes {'+' if hand.closing[j] > 0 else '−'}"] if hand.closing[j] else []
    said += [f"follows {follows}"] if follows else []
    return (
        f'<label class="joint"><span>{escape(joint.name)}</span><output></output><input type="range" name="joint-{j}" '
        f'min="{joint.lower!r}" max="{joint.upper!r}" step="any" autocomplete="off"{" disabled" if held else ""}>'
        f"<small>{escape(', '.join(said))}</small></label>"
    )


def _frames(facts: HandFacts) -> str:
    boxes = "".join(
        f'<label><input type="checkbox" name="frame-{i}" autocomplete="off">{escape(link.name)}</label>'
        for i, link in enumerate(facts.hand.links)
    )
    every = '<label><input type="checkbox" name="frames" autocomplete="off"><b>all</b></label>'
    about = "frames of links (x red, y green, z blue)"
    return f'<details class="frames"><summary>{about}</summary><div>{every}{boxes}</div></details>'


def _caption(shown: ShownHand) -> str:
    facts = shown.facts

    marks = [page_parts.mark(tint(facts, f)[0], f, "square") for f in facts.fingers]
    marks += [page_parts.mark(PALM_COLORS[0], "palm", "square")]
    marks += [
        page_parts.mark(PART_COLORS["cone"], "joint that closes, with its sense"),
        page_parts.mark(PART_COLORS["axes"], "other joint"),
    ]
    marks += [page_parts.mark(PART_COLORS["load"], "palm's approach")] if facts.palm else []
    return f"{''.join(marks)}<br>Regions are darker than their finger. {page_parts.TURNING}"


# --- the tables below it ------------------------------------------------------------------------------


def _sections(shown: ShownHand) -> list[str]:
    facts = shown.facts
    heads = ["joint", "#type", "#limits", "#in SI units", "#besides its motor", "#closes", "#driven by", "#part of"]
    joints = table(heads, hand_rows.joint_rows(facts), "Joints")
    actuators = table(
        ["actuator", "#moves", "#kind", "#command in", "#most, in its file"],
        hand_rows.actuator_rows(facts),
        "Actuators",
    )
    heads = ["region", "#finger", "#role", "#link", "#surface", "off the shapes"]
    regions = table(heads, hand_rows.region_rows(facts), "Regions")
    note = (
        "A joint stops at its limits unless said otherwise. It closes towards + or − of its range; the others spread. "
        "Senses, palm and regions that are guessed "
        "follow from limits and shapes alone, and can be stated where they are wrong."
    )
    tendons = table(["tendon", "#length", "#besides its motor"], tendon_rows(facts.hand), "Tendons")
    parts = [
        table(["", "#"], hand_rows.overview(facts)),
        table(["", "#"], hand_rows.object_facts(shown), "The object"),
        f'{joints}<p class="note">{note}</p>{tendons}{actuators}',
        regions,
        _folded("Pairs of links that are not checked", ["#link", "#and", "#because"], hand_rows.pair_rows(facts)),
        _folded("Links", ["#link", "#on", "#joints", "#part of", "#shapes", "mass"], hand_rows.link_rows(facts)),
    ]
    return [f"<section>{part}</section>" for part in parts if part]


def _folded(title: str, heads: list[str], rows: list[list[str]]) -> str:
    if len(rows) <= MAX_TABLE_ROWS:
        return table(heads, rows, title)
    return f"<details><summary>{escape(title)}: {len(rows)}</summary>{table(heads, rows)}</details>"
