"""`handfast contacts`: where a posed hand touches an object, as a grasp file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import UseAppendAction, arg

from handfast.cli import console
from handfast.cli.options import Assignments, Command, Reported, assigned, check_writable
from handfast.cli.scene_options import SceneOptions, load_placed, weight_note
from handfast.core.errors import InputError


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
    output: Annotated[Path | None, arg(metavar="GRASP.json", aliases=["-o"])] = None
    """write the grasp file"""
    json: bool = False
    """print the grasp file on standard output"""

    def run(self) -> int:
        from handfast.cli import tables
        from handfast.geometry.contacts import contact_grasp
        from handfast.pictures import words
        from handfast.readers.grasp_file import file_dict, save_grasp

        check_writable(self.output, self.force, (".json",))
        self.check_report()
        torsion = torsion_named(self.torsion)
        hand, body = self.load_scene()
        placed = load_placed(self.configuration)
        hand, q = placed.applied(hand)
        with console.watch("contacts"):
            grasp = contact_grasp(
                hand,
                q,
                body,
                placed.pose,
                preload=assigned(self.preload, "--preload") if self.preload else placed.preload,
                threshold=self.threshold,
                lock=self.lock,
                mechanism=self.mechanism,
                torsion=torsion,
            )
        grasp = grasp.from_configuration(self.configuration)
        if self.output:
            save_grasp(grasp, self.output, force=self.force)
        if self.report:
            from handfast.pictures import write_report
            from handfast.pictures.scene import scene_meshes

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
