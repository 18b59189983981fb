"""`handfast show`: what a hand is, and what is guessed about it. `handfast view`: a grasp under your mouse."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.console import table
from handfast.cli.load_options import load_object, load_placed
from handfast.cli.options import Command, EndsIn, JsonOptions
from handfast.core import bundled
from handfast.core.errors import InputError
from handfast.pictures import hand_rows
from handfast.pictures.hand_facts import ShownHand, facts_of, shown_hand, to_json
from handfast.pictures.words import USUAL_JOINT_TEXT, body_text, num, place_text
from handfast.readers.load_body import seen_mesh
from handfast.readers.load_hand import bundled_hands, load_hand
from handfast.readers.region_file import load_hand_regions
from handfast.readers.registry import MESHES, ending

LISTED_PAIRS = 30  # pairs of links that are listed


@dataclass(kw_only=True)
class Show(JsonOptions, Command):
    """Show a hand: joints, senses, couplings, the guessed palm, fingers and regions; as a page to be turned with -o.

    Look at a new hand before you plan with it: what is guessed wrong can be stated. Of an object alone: how large it
    is, whether its mesh is closed and in metres, into how many convex pieces it is taken and how long that takes.
    """

    hand: Annotated[Positional[str], arg(metavar="HAND|OBJECT")]
    """a URDF or MJCF file or the name of a bundled hand; or an object alone"""
    object: Annotated[Positional[str | None], arg(metavar="[OBJECT]")] = None
    """an object to show in the hand: a mesh or handfast/body/1 file or the name of a bundled object"""
    configuration: Annotated[str | None, arg(metavar="FILE")] = None
    """a handfast/configuration/1 file with joints, closing senses and the object's pose, or a bundled name"""
    regions: Annotated[str | None, arg(metavar="FILE.json")] = None
    """the hand's regions, a handfast/hand-regions/1 file; bundled, or guessed from the hand's shapes, if absent"""
    scale: Annotated[float, arg(metavar="M")] = 1.0
    """metres per unit of a mesh file"""
    output: Annotated[Path | None, arg(metavar="FILE", aliases=["-o"]), EndsIn((".html", ".htm", ".png", ".svg"))] = (
        None
    )
    """a self-contained page with a slider for each joint (.html), or a still picture (.png, .svg)"""

    def run(self) -> int:
        if is_object(self.hand):
            return self._object()
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

        shown = shown_hand(facts_of(hand, regions), body, q=q, pose=pose)
        if self.output:
            from handfast.pictures.hand_page import write_hand

            write_hand(self.output, shown, force=self.force)
        if self.json:
            console.print_json(to_json(shown))
            return console.ANSWERED
        self._say(shown)
        if self.output:
            console.say_written(console.out(), self.output)
        else:
            self._tables(shown)
        return console.ANSWERED

    def _object(self) -> int:
        """Of an object alone; what its mesh is like is said before it is taken apart, which may take long or fail."""
        given = {"OBJECT": self.object, "--configuration": self.configuration, "--regions": self.regions}
        for name, value in (given | {"-o": self.output}).items():
            if value is not None:
                raise InputError("is for a hand; an object is shown in one: handfast show HAND OBJECT", field=name)
        begin = time.monotonic()
        mesh, read = seen_mesh(Path(bundled.resolve("objects", self.hand)), self.scale)
        out = console.out()
        if not self.json and mesh:
            grid = table(["", ""], [(name.replace("_", " "), _said(name, value)) for name, value in mesh.items()])
            grid.show_header = False
            out.print(grid)
        body = load_object(self.hand, scale=self.scale, meshes=read)
        about = {
            "name": body.name,
            "pieces": len(body.pieces),
            "seconds": round(time.monotonic() - begin, 3),
            "center_of_mass": body.center_of_mass.tolist(),
            "mass": body.mass,
            "friction": body.friction,
        }
        if self.json:
            console.print_json({"schema": "handfast/object-facts/1", "mesh": mesh or None} | about)
            return console.ANSWERED
        out.print(f"{body.name}: {body_text(body)}", style="bold", soft_wrap=True)
        out.print(f"Centre of mass {place_text(body.center_of_mass)}; read in {about['seconds']:.3g} s.")
        return console.ANSWERED

    def _say(self, shown: ShownHand) -> None:
        out = console.out()
        out.print(f"{shown.facts.hand.name}: {hand_rows.counts(shown.facts)}", style="bold")
        for text in shown.facts.missing:
            out.print(text, soft_wrap=True)

    def _tables(self, shown: ShownHand) -> None:
        out, facts = console.out(), shown.facts
        grid = table(["", ""], hand_rows.overview(facts) + hand_rows.object_facts(shown))
        grid.show_header = False
        out.print(grid)
        rows = hand_rows.joint_rows(facts)
        laws = any(row[4] != USUAL_JOINT_TEXT for row in rows)
        heads = ["joint", "limits", *(["besides its motor"] if laws else []), "closes", "driven by", "part of"]
        values = [hand_rows.value_text(facts.hand, j, float(v)) for j, v in enumerate(shown.q)]
        senses = [
            (name, limits, *([law] if laws else []), *others, value)
            for (name, _, limits, _, law, *others), value in zip(rows, values, strict=True)
        ]
        if senses:
            out.print(table([*heads, "shown at"], senses))
        if facts.regions is not None:
            regions = [(*row[:4], row[5]) for row in hand_rows.region_rows(facts)]
            out.print(table(["region", "finger", "role", "link", "off the shapes"], regions))
        count = len(facts.overlapping) + len(facts.excluded)
        if count:
            pairs = hand_rows.pair_rows(facts)[: min(count, LISTED_PAIRS)]
            out.print(table(["link", "and", "not checked because"], pairs))
            if count > LISTED_PAIRS:
                out.print(f"and {count - LISTED_PAIRS} more pairs: --json, or -o FILE.html")


def is_object(name: str) -> bool:
    """Whether a name is an object's and no hand's, as far as that can be told without reading it."""
    if name in bundled.names("objects"):
        return name not in bundled_hands()
    return ending(Path(name)) in (".json", ".sdf", *MESHES) or os.path.isdir(name)


def _said(name: str, value: Any) -> str:
    """A fact about a mesh in words."""
    if name == "size":
        return " × ".join(f"{num(1e3 * x, 3)}" for x in value) + " mm"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"about {num(value, 2)} s of processor time" if name == "decomposing" else str(value)


@dataclass(kw_only=True)
class ViewGrasps(Command):
    """Look at a grasp, turn and drag its load with the mouse, and see at once whether it holds: a live page.

    Ctrl-C ends it. Needs pip install 'handfast[view]'.
    """

    grasps: Annotated[Positional[str], arg(metavar="GRASP|FOLDER")]
    """a handfast/grasp/1 file, the name of a bundled grasp, or a folder of grasp files to leaf through"""
    port: Annotated[int | None, arg(metavar="N")] = None
    """where the page is served; by default 8080 or the next that is free"""
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """the address to listen at; whoever reaches it can use the page, and the default is this machine alone"""
    browser: bool = True
    """do not open the page in a browser"""

    def run(self) -> int:
        from handfast.pictures.live.open_page import view

        page = view(self.grasps, host=self.host, port=self.port, browser=self.browser)
        with page, suppress(KeyboardInterrupt):  # which may come as soon as it is said
            console.out().print(f"{page.url}  (Ctrl-C ends it)", soft_wrap=True)
            page.wait()
        return console.ANSWERED
