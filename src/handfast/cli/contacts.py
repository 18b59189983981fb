"""`handfast contacts` and `close`: where a posed hand touches an object, and a hand closed on it as a gripper does."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import UseAppendAction, arg

from handfast.cli import console, tables
from handfast.cli.console import table
from handfast.cli.load_options import SceneOptions, load_placed, weight_note
from handfast.cli.options import Assignments, Command, EndsIn, Reported, assigned, closing_senses
from handfast.core.errors import InputError
from handfast.core.schema import written
from handfast.geometry.contacts import contact_grasp
from handfast.geometry.scene import Scene
from handfast.model.configuration import Configuration
from handfast.model.hand import Hand
from handfast.pictures import words, write_report
from handfast.pictures.scene import scene_meshes
from handfast.planning.closing import Closed, close
from handfast.readers.configuration_file import save_configuration
from handfast.readers.grasp_file import file_dict, save_grasp


def torsion_named(text: str) -> float | Literal["hand"]:
    """The option's value; `InputError` unless it is a number of metres or "hand"."""
    if text == "hand":
        return "hand"
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < 1:
        right = "a length from 0 to below 1 m, or hand"
        raise InputError(f"is '{text}'; {right} is needed", field="--torsion")
    return value


@dataclass(kw_only=True)
class Contacts(SceneOptions, Reported, Command):
    """Where a hand at a configuration touches an object: a grasp file."""

    configuration: Annotated[str, arg(metavar="FILE")]
    """a handfast/configuration/1 file or the name of a bundled one"""
    threshold: Annotated[float, arg(metavar="M")] = 5e-4
    """surfaces nearer than this touch [m]"""
    mechanism: Literal["hand", "direct"] = "hand"
    """the hand's own motors and couplings, or one motor per joint"""
    lock: UseAppendAction[tuple[Annotated[str, arg(metavar="JOINT")], ...]] = ()
    """a joint held rigidly"""
    torsion: Annotated[str, arg(metavar="M")] = "0"
    """torsional friction of soft fingers [m], or hand: what its MJCF says (condim 4); point contacts by default"""
    preload: Assignments = ()
    """actuator commands [N m, or N if prismatic or tendon] instead of the configuration's"""
    output: Annotated[Path | None, arg(metavar="GRASP.json", aliases=["-o"]), EndsIn((".json",))] = None
    """write the grasp file"""
    json: bool = False
    """print the grasp file on standard output"""

    def run(self) -> int:
        torsion = torsion_named(self.torsion)
        hand, body = self.load_scene()
        placed = load_placed(self.configuration)
        hand, q = placed.applied(hand)
        with console.watch("contacts"):
            grasp = contact_grasp(
                hand, q, body, placed.pose, threshold=self.threshold, lock=self.lock, mechanism=self.mechanism,
                preload=assigned(self.preload, "--preload") if self.preload else placed.preload, torsion=torsion,
            )  # fmt: skip
        grasp = grasp.from_configuration(self.configuration)
        if self.output:
            save_grasp(grasp, self.output, force=self.force)
        if self.report:
            meshes = scene_meshes(hand, q, body, placed.pose)
            write_report(self.report, grasp, [], meshes=meshes, force=self.force)
        if self.json:
            console.print_json(file_dict(grasp))
            return console.ANSWERED
        out = console.out()
        links = dict.fromkeys(c.link for c in grasp.contacts)
        counts = f"{words.count(grasp.m, 'contact')} on {words.count(len(links), 'link')}"
        out.print(f"{counts}: {', '.join(links)}", style="bold")
        tables.show_grasp(out, grasp)
        out.print(weight_note(body), style="dim")
        console.say_written(out, self.output, self.report)
        if not self.output:
            out.print("Give -o GRASP.json to keep it as a grasp file.", style="dim")
        return console.ANSWERED


@dataclass(kw_only=True)
class Close(SceneOptions, Reported, Command):
    """Close a hand joint by joint until every finger touches the object or reaches a limit."""

    pose: Annotated[str, arg(metavar="FILE")]
    """a handfast/configuration/1 file with the object's pose and the open hand, or a bundled name"""
    closing: Assignments = ()
    """sense in which a joint closes: JOINT=1, JOINT=-1, or JOINT=0 to keep it still"""
    threshold: Annotated[float, arg(metavar="M")] = 5e-4
    """surfaces nearer than this touch [m]"""
    mechanism: Literal["hand", "direct"] = "hand"
    """of the grasp: the hand's own motors and couplings, or one motor per joint"""
    preload: Assignments = ()
    """of the grasp: actuator commands instead of the file's"""
    output: Annotated[Path | None, arg(metavar="CONFIGURATION.json", aliases=["-o"]), EndsIn((".json",))] = None
    """write the closed configuration"""
    grasp: Annotated[Path | None, arg(metavar="GRASP.json"), EndsIn((".json",))] = None
    """write the grasp file"""

    def run(self) -> int:
        hand, body = self.load_scene()  # first: a hand that has to be downloaded is told before anything else
        placed = load_placed(self.pose)
        hand, q0 = placed.applied(hand)
        senses = closing_senses(self.closing)
        hand = hand.with_closing(senses) if senses else hand
        preload = assigned(self.preload, "--preload") if self.preload else placed.preload
        if self.mechanism == "hand":  # the other one has a motor for each joint of the grasp
            hand.mechanism.commands(preload, field="--preload" if self.preload else f"{self.pose}: preload")
        with console.watch("close"):
            scene = Scene(hand, body)
            closed = close(hand, q0, body, placed.pose, threshold=self.threshold, scene=scene)
        named: dict[str, Any] = {"hand": self.hand, "object": self.object, "preload": preload}
        closing = (placed.closing or {}) | senses or None
        result = Configuration.of(hand, closed.q, placed.pose, closing=closing, **named)
        if self.output:
            save_configuration(result, self.output, force=self.force)
        if (
            self.grasp or self.report
        ):  # without contacts, or with a preload of a finger that touches nothing, this says so
            how: dict[str, Any] = {
                "preload": preload,
                "threshold": self.threshold,
                "mechanism": self.mechanism,
                "scene": scene,
            }
            grasp = contact_grasp(hand, closed.q, body, placed.pose, **how)
            if self.output:
                grasp = grasp.from_configuration(self.output)
            if self.grasp:
                save_grasp(grasp, self.grasp, force=self.force)
            if self.report:
                meshes = scene_meshes(hand, closed.q, body, placed.pose)
                write_report(self.report, grasp, [], meshes=meshes, force=self.force)
        if self.json:
            console.print_json(
                {
                    "schema": "handfast/answer/1",
                    "query": "close",
                    "configuration": result.model_dump(by_alias=True, exclude_none=True, mode="json"),
                    "stopped": closed.stopped,
                    "touching": list(closed.touching),
                    "penetration": closed.penetration,
                    "contacts": written(closed.contacts),
                }
            )
            return console.ANSWERED
        self._show(hand, closed)
        if self.grasp:
            console.out().print(weight_note(body), style="dim")
        return console.ANSWERED

    def _show(self, hand: Hand, closed: Closed) -> None:
        out = console.out()
        touching = ", ".join(closed.touching) or "no link"
        out.print(f"{words.count(len(closed.contacts), 'contact')}; touching: {touching}", style="bold")
        units = {joint.name: "rad" if joint.type == "revolute" else "m" for joint in hand.joints}
        stopped = closed.stopped.items()
        rows = [(name, f"{closed.q[hand.joint(name)]:.4f} {units[name]}", why) for name, why in stopped]
        out.print(table(["joint", "stopped at", "because"], rows))
        if closed.contacts:
            tables.show_contacts(out, closed.contacts)
        console.say_written(out, self.output, self.grasp, self.report)
