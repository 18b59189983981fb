"""`handfast show`: what a hand is, and what is guessed about it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.options import Command, check_writable
from handfast.core.errors import InputError

if TYPE_CHECKING:
    from handfast.pictures.hand_facts import ShownHand

MANY = 30  # pairs of links that are listed


@dataclass(kw_only=True)
class Show(Command):
    """Show a hand: joints, senses, couplings, the guessed palm, fingers and regions; as a page to be turned with -o.

    Look at a new hand before you plan with it: what is guessed wrong can be stated.
    """

    hand: Annotated[Positional[str], arg(metavar="HAND")]
    """a URDF or MJCF file or the name of a bundled hand"""
    object: Annotated[Positional[str | None], arg(metavar="OBJECT")] = None
    """an object to show in the hand: a mesh or handfast/body/1 file or the name of a bundled object"""
    configuration: Annotated[str | None, arg(metavar="FILE")] = None
    """a handfast/configuration/1 file with joints, closing senses and the object's pose, or a bundled name"""
    regions: Annotated[str | None, arg(metavar="FILE.json")] = None
    """the hand's regions, a handfast/hand-regions/1 file; bundled, or guessed from the hand's shapes, if absent"""
    scale: Annotated[float, arg(metavar="M")] = 1.0
    """metres per unit of a mesh file"""
    output: Annotated[Path | None, arg(metavar="FILE", aliases=["-o"])] = None
    """a self-contained page with a slider for each joint (.html), or a still picture (.png, .svg)"""
    json: bool = False
    """print one JSON object instead of a table"""
    force: bool = False
    """write over files that exist"""

    def run(self) -> int:
        from handfast.cli.scene_options import load_object, load_placed
        from handfast.readers.load_hand import load_hand
        from handfast.readers.region_file import load_hand_regions

        check_writable(self.output, self.force, (".html", ".htm", ".png", ".svg"))
        hand, q, pose = load_hand(self.hand), None, None
        if self.configuration:
            placed = load_placed(self.configuration)
            hand, q = placed.applied(hand)
            pose = placed.pose
        body = None
        if self.object:
            body = load_object(self.object, scale=self.scale)
        elif self.scale != 1:
            raise InputError("is for the meshes of an object; give one, or leave it out", field="--scale")
        regions = load_hand_regions(self.regions, hand) if self.regions else None

        from handfast.pictures.hand_facts import facts_of, shown_hand, to_json

        shown = shown_hand(facts_of(hand, regions), body, q=q, pose=pose)
        if self.output:
            from handfast.pictures.hand_page import write_hand

            write_hand(self.output, shown, force=self.force)
        if self.json:
            console.print_json(to_json(shown))
            return console.ANSWERED
        self._say(shown)
        if self.output:
            console.out().print(f"Written: {self.output}", soft_wrap=True)
        else:
            self._tables(shown)
        return console.ANSWERED

    def _say(self, shown: ShownHand) -> None:
        from handfast.pictures import hand_rows

        out = console.out()
        out.print(f"{shown.facts.hand.name}: {hand_rows.counts(shown.facts)}", style="bold")
        for text in shown.facts.missing:
            out.print(text, soft_wrap=True)

    def _tables(self, shown: ShownHand) -> None:
        from handfast.cli.console import table
        from handfast.pictures import hand_rows
        from handfast.pictures.words import USUAL

        out, facts = console.out(), shown.facts
        grid = table("", "")
        grid.show_header = False
        for row in hand_rows.overview(facts) + hand_rows.object_facts(shown):
            grid.add_row(*row)
        out.print(grid)
        rows = hand_rows.joint_rows(facts)
        laws = any(row[4] != USUAL for row in rows)
        heads = ["joint", "limits", *(["besides its motor"] if laws else []), "closes", "driven by", "part of"]
        senses = table(*heads, "shown at")
        values = [hand_rows.value_text(facts.hand, j, float(v)) for j, v in enumerate(shown.q)]
        for (name, _, limits, _, law, *others), value in zip(rows, values, strict=True):
            senses.add_row(name, limits, *([law] if laws else []), *others, value)
        if shown.q.size:
            out.print(senses)
        if facts.regions is not None:
            grid = table("region", "finger", "role", "link", "off the shapes")
            for name, finger, role, link, _, error in hand_rows.region_rows(facts):
                grid.add_row(name, finger, role, link, error)
            out.print(grid)
        count = len(facts.overlapping) + len(facts.excluded)
        if count:
            grid = table("link", "and", "not checked because")
            for pair in hand_rows.pair_rows(facts)[: min(count, MANY)]:
                grid.add_row(*pair)
            out.print(grid)
            if count > MANY:
                out.print(f"and {count - MANY} more pairs: --json, or -o FILE.html")
