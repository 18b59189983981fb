"""`handfast export`: grasps of ours in the layouts of others."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.options import Command
from handfast.core.errors import InputError

SCENE = "mujoco"


@dataclass(kw_only=True)
class ExportGrasps(Command):
    """Grasps of ours in the layouts of others: isaac_grasp, graspgen, dexgraspbench; or as MuJoCo scenes: mujoco.

    A scene closes the hand, squeezes and lifts the object: its keyframes have the times and the servos' targets."""

    source: Annotated[Positional[Path], arg(metavar="FOLDER|FILE")]
    """a folder that import, plan or grasp filled, its grasps.json, or one configuration file; for mujoco a folder or a
    grasp file"""
    layout: Annotated[str | None, arg(metavar="NAME")] = None
    """isaac_grasp, graspgen, dexgraspbench or mujoco"""
    output: Annotated[Path | None, arg(metavar="FOLDER|FILE", aliases=["-o"])] = None
    """a folder; or, for isaac_grasp (.yaml) and graspgen (.json), one file for one object, for mujoco (.xml) for one
    grasp"""
    hand: Annotated[str | None, arg(metavar="HAND")] = None
    """the hand model, in place of what the configurations name"""
    mapping: Annotated[str | None, arg(metavar="FILE")] = None
    """a handfast/mapping/1 file or the name of a bundled one, if the layout poses another frame of the hand or has
    other names or another order of joints"""
    force: bool = False
    """write over files that exist"""

    def run(self) -> int:
        from handfast.datasets.published.exporting import ENDING, export, exported_from
        from handfast.datasets.published.mapping_file import HandMapping, load_mapping
        from handfast.pictures import words
        from handfast.readers.load_hand import load_hand

        if self.layout == SCENE:
            return self._scenes()
        if self.layout not in ENDING:
            given = "missing" if self.layout is None else f"unknown layout '{self.layout}'"
            raise InputError(f"{given}: --layout {', '.join((*ENDING, SCENE))}", source="export")
        if self.output is None:
            raise InputError("missing: -o FOLDER, or a file", source="export")
        grasps = exported_from(self.source)
        named = {g.configuration.hand for g in grasps if g.configuration.hand}
        if not self.hand and len(named) != 1:
            raise InputError("missing: --hand HAND; the configurations name none, or several", source="export")
        hand = load_hand(self.hand or named.pop())
        mapping = load_mapping(self.mapping, hand) if self.mapping else HandMapping(schema="handfast/mapping/1")
        written = export(grasps, hand, mapping, self.layout, self.output, force=self.force)
        many = f"{words.count(len(grasps), 'grasp')} in {words.count(len(written), 'file')}"
        print(f"{many}, layout {self.layout}: {self.output}")
        return console.ANSWERED

    def _scenes(self) -> int:
        from handfast.datasets.published.mujoco_scene import export_scenes
        from handfast.pictures import words

        for option, given in (("--hand", self.hand), ("--mapping", self.mapping)):
            if given:
                raise InputError("is of other layouts; grasp files say their hand", field=option)
        if self.output is None:
            raise InputError("missing: -o FOLDER, or a file that ends in .xml", source="export")
        written = export_scenes(self.source, self.output, force=self.force)
        print(f"{words.count(len(written), 'scene')}, layout {SCENE}: {self.output}")
        return console.ANSWERED
