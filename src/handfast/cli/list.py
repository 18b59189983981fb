"""`handfast list`: what comes with the package."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rich.text import Text

from handfast.cli import console
from handfast.cli.options import Command
from handfast.core import bundled
from handfast.model.hand.structures import TABLE_1
from handfast.readers.load_hand import TABLE_1_PREFIX

HAND_TEXTS = {
    "barrett-bh8-280": "Barrett BH8-280: three fingers, worm-coupled distal joints at 1/3, spread",
    "milling-fixture": "six locators, two straps and a screw around a workpiece",
    "parallel-gripper": "two parallel jaws, one motor",
    "schunk-sah": "Schunk SAH: four fingers of three joints, opposing thumb",
    "step-ground": "no hand: a floor and a step for a body on four feet",
    "tendon-hand": "three fingers of two joints, one tendon each",
}
PAPER_FIGURES = {
    "fig1": "the paper's Fig. 1, two fingers",
    "fig7": "the paper's Fig. 7, visible offset of the contacts",
    "fig9": "the paper's Fig. 9, a flask in three fingers",
    "fig11": "the paper's Fig. 11, three fingers around a plane",
}


@dataclass(kw_only=True)
class List(Command):
    """Grasps, hands, objects, configurations and tasks that come with the package."""

    json: bool = False
    """print one JSON object instead of a table"""

    def run(self) -> int:
        found = {kind: {name: describe(kind, name) for name in bundled.names(kind)} for kind in bundled.BUNDLED_KINDS}
        found["hands"] |= table_1()
        if self.json:
            console.print_json({"schema": "handfast/list/1", **found})
            return console.ANSWERED

        out = console.out()
        uses = {
            "grasps": "handfast check NAME --wrench ...",
            "hands": "handfast contacts HAND OBJECT --configuration NAME",
            "objects": "the same, as OBJECT",
            "configurations": "the same, as NAME",
            "tasks": "handfast synthesize NAME, handfast grasp NAME",
            "hand_regions": "handfast propose HAND OBJECT",
        }
        for kind, entries in found.items():
            out.print(Text.assemble((kind.replace("_", " "), "bold"), "  ", (uses[kind], "dim")))
            if entries:
                console.print_list(out, entries.items())
            else:
                out.print("  none")
        return console.ANSWERED


def table_1() -> dict[str, str]:
    """The hands of the synthesis paper's Table 1, which are built and have no files."""
    return {
        TABLE_1_PREFIX + name: f"{design.title}: {design.dof} motors, nominal dimensions"
        for name, design in TABLE_1.items()
    }


def describe(kind: str, name: str) -> str:
    """One line about a bundled thing, from what its file says."""
    if kind == "hands":
        return HAND_TEXTS.get(name, "")
    data = bundled.read(kind, name)
    known = next((text for stem, text in PAPER_FIGURES.items() if name == stem or name.startswith(stem + "-")), "")
    match kind:
        case "grasps":
            text = _grasp(data)
        case "objects":
            text = _object(data)
        case "tasks":
            text = _task(data)
        case "hand_regions":
            text = ", ".join(data.get("regions", {}))
        case _:
            text = f"{data.get('object') or 'an object'} in {data.get('hand') or 'a hand'}"
    return "; ".join(t for t in (known, text) if t)


def _grasp(data: dict[str, Any]) -> str:
    mu = sorted({c["friction"] for c in data.get("contacts", [])})
    preload = sorted(set(data.get("preload", {}).values()))
    parts = [f"{len(data.get('contacts', []))} contacts", f"{len(data.get('joints', []))} joints"]
    parts += [f"friction {mu[0]:g}"] if len(mu) == 1 else []
    parts.append(f"preload {' and '.join(f'{v:g}' for v in preload)}" if preload else "no preload")
    joints = data.get("joints", [])
    words = {"friction": "joint friction", "stop": "stops", "torque": "springs"}
    parts += [word for name, word in words.items() if any(joint.get(name) for joint in joints)]
    return ", ".join(parts)


def _object(data: dict[str, Any]) -> str:
    solids = [next((k for k in shape if k != "pose"), "solid") for shape in data.get("shapes", [])]
    parts = [" + ".join(dict.fromkeys(solids)) or "mesh"]
    parts += [f"{data['mass']:g} kg"] if data.get("mass") is not None else []
    parts += [f"friction {data['friction']:g}"] if data.get("friction") is not None else []
    return ", ".join(parts)


def _task(data: dict[str, Any]) -> str:
    links = [contact["hand"]["link"] for contact in data.get("contacts", [])]
    return f"{len(links)} contacts on {data.get('object') or 'an object'}: {', '.join(links)}"
