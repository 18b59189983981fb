"""`handfast demo`: the main job on bundled data, in under a minute."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from rich.console import Console
from rich.text import Text
from tyro.conf import arg

from handfast.cli import console
from handfast.cli.load_options import load_placed
from handfast.cli.maps import save_map
from handfast.cli.options import Command, check_folder, check_writable
from handfast.geometry.contacts import contact_grasp
from handfast.model.grasp import Grasp
from handfast.pictures import Entry, sentences, words, write_report
from handfast.pictures.scene import Mesh, scene_meshes
from handfast.readers.grasp_file import save_grasp
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check, force_map, maximum, torques

DEMO_HAND, CONFIGURATION = "barrett-bh8-280", "fig1"
SMALL_LOAD, LARGE_LOAD = 2.2, 2.5  # [N] the paper's two disturbances in y, one on each side of the limit
DEMO_DIRECTIONS = 72  # of the map
DIRECTION_TIMEOUT = 3.0  # [s] for a direction of the map; it is drawn as not decided if that was too short
DEMO_FILES = ("report.html", "map.png", "grasp.json")


@dataclass(kw_only=True)
class Demo(Command):
    """The main job on bundled data: hand, object and configuration to verdicts, torques, map and report."""

    output: Annotated[Path, arg(metavar="FOLDER", aliases=["-o"])] = Path("handfast-demo")
    """folder for report.html, map.png and grasp.json"""
    force: bool = False
    """write over files that exist"""

    def run(self) -> int:
        check_folder(self.output)
        for name in DEMO_FILES:
            check_writable(self.output / name, self.force, (Path(name).suffix,))
        out, settings, y = console.out(), Settings(), np.eye(6)[1]
        with console.watch("demo"):
            grasp, meshes = build()
        _say(out, "Grasp", f"{grasp.name}: {words.grasp_text(grasp)}; preload {words.preload_text(grasp)}")
        entries: list[Entry] = []
        for force in (SMALL_LOAD, LARGE_LOAD):
            with console.watch("check") as watch:
                checked = check(grasp, force * y, settings=settings, on_progress=watch.step)
            load = words.load_text(force * y)
            entries.append(Entry(f"Does it resist {load}?", checked))
            _say(out, "Check", f"{checked.verdict.upper()}  {sentences.check_sentence(checked, load)}")
        with console.watch("max") as watch:
            largest = maximum(grasp, y, settings=settings, on_progress=watch.step)
        entries.append(Entry("How much force along +y does it resist?", largest, direction=list(y)))
        _say(out, "Max", sentences.max_sentence(largest, y))
        half = 0.5 * largest.lower * y if largest.lower > 0 else SMALL_LOAD * y
        load = words.load_text(half)
        with console.watch("torques") as watch:
            best = torques(grasp, half, settings=settings, on_progress=watch.step)
        entries.append(Entry(f"Which commands resist {load}?", best))
        _say(out, "Torques", sentences.torques_sentence(best, load))
        limited = replace(settings, timeout=DIRECTION_TIMEOUT)
        with console.watch("map") as watch:
            drawn = force_map(grasp, "xy", steps=DEMO_DIRECTIONS, settings=limited, on_progress=watch.item)
        entries.append(Entry(f"Which of {DEMO_DIRECTIONS} directions of force in the xy plane does it resist?", drawn))
        named = zip(("locked", "preloaded"), drawn.curves, strict=False)
        _say(out, "Map", "; ".join(f"{name}: {_resisted(sentences.curve_states(c))}" for name, c in named))

        save_grasp(grasp, self.output / "grasp.json", force=self.force)
        save_map(drawn, self.output / "map.png", force=self.force)
        write_report(self.output / "report.html", grasp, entries, settings=settings, meshes=meshes, force=self.force)
        _say(out, "Report", f"open {self.output / 'report.html'} in a browser")
        _say(out, "Next", f"handfast map {self.output / 'grasp.json'} --plane xy --eta 2.5 -o map.svg")
        # a direction of the map that was left open is part of the picture, not a failed demo
        return max(console.status(e.answer.verdict, e.answer.stop) for e in entries if e.answer is not drawn)


def build() -> tuple[Grasp, list[Mesh]]:
    """The demo's grasp from the bundled hand, object and configuration, and its solids.

    One motor per joint, as in the paper: joints without a command, the distal ones, are locked.
    """
    placed = load_placed(CONFIGURATION)
    hand, q = placed.applied(load_hand(placed.hand or DEMO_HAND))
    body = load_body(placed.object or CONFIGURATION)
    grasp = contact_grasp(hand, q, body, placed.pose, preload=placed.preload, mechanism="direct", name=CONFIGURATION)
    grasp = grasp.from_configuration(CONFIGURATION)
    return grasp, scene_meshes(hand, q, body, placed.pose)


def _resisted(states: list[str]) -> str:
    some = [s for s in states if s in ("unbounded", "resisted")]
    endless = states.count("unbounded")
    return f"{len(some)} of {len(states)} directions resisted, {endless} of them at any force"


def _say(out: Console, what: str, text: str) -> None:
    out.print(Text.assemble((f"{what:<9}", "bold"), text), soft_wrap=True)
