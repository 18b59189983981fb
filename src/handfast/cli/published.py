"""`handfast import` and `export`: grasps that others have published in, ours in the layouts of others out."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.console import table
from handfast.cli.load_options import JointLawOptions
from handfast.cli.options import Command, JsonOptions, WorkOptions
from handfast.core import bundled
from handfast.core.errors import InputError
from handfast.datasets.published.exporting import FORMAT_ENDINGS, export, exported_from
from handfast.datasets.published.import_folder import IMPORT_TABLE_ENDINGS, refuse_target, write_folder, write_table
from handfast.datasets.published.importing import ImportedGrasp, Importer, Treatment, imported, meshes_of
from handfast.datasets.published.mapping_file import HandMapping, load_mapping, mapping_for
from handfast.datasets.published.mujoco_scene import export_scenes
from handfast.datasets.published.published_file import Source, published_files, sources
from handfast.model.hand import Hand
from handfast.pictures import words
from handfast.proofs.strict_json import MAX_JSON_NUMBER
from handfast.readers.load_hand import load_hand


@dataclass(kw_only=True)
class ImportGrasps(JointLawOptions, WorkOptions, JsonOptions, Command):
    """Published grasps as configurations and grasp files: DexGraspNet, BODex, DexGraspBench, Dexonomy, GraspQP, \
MultiDex, mj_grasp_sim, GraspGen, isaac_grasp.

    Each is placed on your hand model, moved by as little as takes hand and object apart, closed onto the object
    towards the squeeze of the file, and its contacts are reduced to a few that span the same wrenches. What was done
    is said for each; a row that is broken is recorded with its reason while the rest goes on."""

    files: Annotated[Positional[tuple[Path, ...]], arg(metavar="FILE...")]
    """.npy, .npz, .pt, .pth, .json or .yaml, or folders of all but .json; nothing in a pickle is ever run"""
    hand: Annotated[str, arg(metavar="HAND")] = ""
    """the hand model that the grasps are of: a URDF or MJCF file, or the name of a bundled hand"""
    output: Annotated[Path | None, arg(metavar="FOLDER|TABLE", aliases=["-o"])] = None
    """a folder of configurations, grasps and objects, or one table that ends in .csv, .jsonl or .parquet"""
    layout: Annotated[str | None, arg(metavar="NAME")] = None
    """the files' layout, in place of what their keys say"""
    mapping: Annotated[str | None, arg(metavar="FILE")] = None
    """a handfast/mapping/1 file or the name of a bundled one: which joint is which, and the hand's frame"""
    objects: Annotated[tuple[Path, ...], arg(metavar="FOLDER")] = ()
    """folders in which the objects' meshes are; by default those above each file"""
    object: Annotated[str | None, arg(metavar="OBJECT")] = None
    """one mesh, folder of convex pieces, body file or bundled object for all grasps, in place of what the files name"""
    scale: Annotated[float, arg(metavar="M")] = 1.0
    """metres per unit of the objects' meshes, beside the scale that a file has"""
    contacts: bool = True
    """leave out contacts, and all that needs the object"""
    separate: bool = True
    """leave hand and object as deep in each other as they are"""
    close_gaps: bool = True
    """leave fingers that do not touch where they are"""
    threshold: Annotated[float, arg(metavar="M")] = 5e-4
    """surfaces nearer than this touch [m]"""
    tolerance: Annotated[float, arg(metavar="E")] = 0.05
    """relative error of the wrenches that contacts may be reduced by; 0 keeps all contacts"""
    mass: Annotated[float | None, arg(metavar="KG")] = None
    """mass of the objects [kg]"""
    friction: Annotated[float | None, arg(metavar="MU")] = None
    """friction coefficient between hand and object; 0.5 unless given"""
    gain: Annotated[float | None, arg(metavar="KP")] = None
    """of servos that pull towards the files' squeeze [N m/rad or N/m]: their forces become the preload"""
    count: Annotated[int | None, arg(metavar="N")] = None
    """the first N grasps only"""

    def run(self) -> int:
        if not self.files:
            raise InputError("missing: FILE..., files of published grasps, or folders of them", source="import")
        if self.output is None:
            raise InputError("missing: -o FOLDER, or a table that ends in .csv, .jsonl or .parquet", source="import")
        if not self.hand:
            raise InputError("missing: --hand HAND, the model of the hand that the grasps are of", source="import")
        self._check()
        workers = self.workers()
        refuse_target(self.output, self.force)
        hand = self.lawful(load_hand(self.hand))
        found = list(sources(published_files(self.files), self.layout, self.count))
        if not found:
            raise InputError("no grasps", source=", ".join(map(str, self.files)))
        name, mapping = self._mapping(hand, found)
        given: dict[str, Any] = {"treatment": self.made(Treatment), "hand_name": self.hand, "roots": self.objects}
        importer = self.made(Importer, hand=hand, mapping=mapping, **given)
        rows: list[ImportedGrasp] = []
        with console.watch("import") as watch:
            for row in imported(importer, found, **workers):
                rows.append(row)
                watch.item(len(rows), len(found))
        about: dict[str, Any] = {"hand": self.hand, "mapping": name, "mass": self.mass}
        good = any(not r.reason for r in rows)
        if good and self.output.suffix.lower() in IMPORT_TABLE_ENDINGS:
            write_table(self.output, rows, force=self.force)
        elif good:
            write_folder(self.output, rows, about, self.friction)
        if self.json:
            console.print_json({"schema": "handfast/import/1", **about, "rows": [r.to_json() for r in rows]})
        else:
            self._show(rows, name)
        return console.ANSWERED if good else console.BAD_INPUT

    def _check(self) -> None:
        for field, value in (
            *(("--threshold", self.threshold), ("--scale", self.scale), ("--gain", self.gain)),
            *(("--mass", self.mass), ("--count", self.count)),
        ):
            if value is not None and not 0 < value <= MAX_JSON_NUMBER:
                raise InputError(f"is {value:g}; a number above 0, at most {MAX_JSON_NUMBER:g}, is needed", field=field)
        if not 0 <= self.tolerance < 1:
            raise InputError(f"is {self.tolerance:g}; a number from 0 to below 1 is needed", field="--tolerance")
        if self.friction is not None and not 0 <= self.friction <= MAX_JSON_NUMBER:
            right = f"a friction coefficient is 0 or more, at most {MAX_JSON_NUMBER:g}"
            raise InputError(f"is {self.friction:g}; {right}", field="--friction")
        if self.object is not None:
            self._check_object(Path(bundled.resolve("objects", self.object)))
        for folder in self.objects:
            if not folder.is_dir():
                raise InputError("is no folder; the objects' meshes are needed", source=str(folder))

    def _check_object(self, path: Path) -> None:
        if path.is_dir() and not meshes_of(path):
            raise InputError("is a folder without meshes; convex pieces are needed", source=self.object)
        if not path.exists():
            raise InputError(
                "no such file; a mesh, a folder of convex pieces or a body file is needed", source=self.object
            )

    def _mapping(self, hand: Hand, found: list[Source]) -> tuple[str, HandMapping]:
        if self.mapping:
            return self.mapping, load_mapping(self.mapping, hand)
        layouts = sorted({s.layout for s in found if s.layout})
        if not layouts:  # not one of several files could be read
            raise InputError(
                f"none of {len(self.files)} files can be read; the first: {getattr(found[0].row, 'reason', '')}"
            )
        if len(layouts) > 1:
            raise InputError(f"the files are of several layouts ({', '.join(layouts)}); import one layout at a time")
        return mapping_for(layouts[0], hand)

    def _show(self, rows: list[ImportedGrasp], mapping: str) -> None:
        out = console.out()
        good = [r for r in rows if not r.reason]
        layouts = ", ".join(sorted({r.source.layout for r in rows if r.source.layout}))
        out.print(f"{len(good)} of {len(rows)} grasps imported ({layouts}, mapping {mapping})", style="bold")
        done = []
        for name, text, factor, unit in SAID:
            values = sorted(float(r.said[name]) * factor for r in good if name in r.said)
            if values:
                done.append((text, f"{values[len(values) // 2]:.3g}{unit}", f"{values[-1]:.3g}{unit}"))
        if done:
            out.print(table(["what was done", "median", "most"], done))
        reasons = Counter(r.reason for r in rows if r.reason)
        if reasons:
            most = [(str(count), reason) for reason, count in reasons.most_common(8)]
            if len(reasons) > 8:
                others = sum(count for _, count in reasons.most_common()[8:])
                most.append((str(others), f"{len(reasons) - 8} other reasons"))
            grid = table(["grasps", "left out because"], most)
            grid.columns[1].no_wrap = False  # a reason says at its end what would be right
            out.print(grid)
        out.print(f"Written: {self.output}" if good else "Nothing was written.", soft_wrap=True)
        told = self._without_commands(good)
        if told:
            out.print(told, soft_wrap=True)

    def _without_commands(self, good: list[ImportedGrasp]) -> str:
        """What to do about grasps whose motors are all locked; "" if there are none."""
        locked = [r for r in good if r.grasp is not None and not any(r.grasp.preload.values())]
        if not locked:
            return ""
        squeezed = sum(r.squeeze is not None for r in locked)
        text = (
            f"{len(locked)} of {len(good)} grasps come without commands: their motors are locked and press on nothing."
        )
        if self.gain is None and squeezed:
            text += f" The files say a squeeze of {squeezed}: --gain KP commands what servos that pull towards it do."
        table = self.output is not None and self.output.suffix.lower() in IMPORT_TABLE_ENDINGS
        label = "`handfast label`" if table else f"`handfast label {self.output} -o labels.jsonl --mass KG`"
        return f"{text} {label} says which of them hold as they are, and finds commands for the others."


SAID = (
    ("penetration_before", "penetration as published", 1e3, " mm"),
    ("object_moved", "object moved", 1e3, " mm"),
    ("object_turned", "object turned", 57.29578, "°"),
    ("object_pushed", "object pushed by the gripper", 1e3, " mm"),
    ("surface_moved", "surface of the hand moved, at most", 1e3, " mm"),
    ("contacts_before", "contacts found", 1, ""),
    ("contacts", "contacts kept", 1, ""),
    ("reduction_error", "relative error of their wrenches", 1, ""),
    ("past_limits", "joint values past their limits", 1, " rad"),
)


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
        if self.layout == SCENE:
            return self._scenes()
        if self.layout not in FORMAT_ENDINGS:
            given = "missing" if self.layout is None else f"unknown layout '{self.layout}'"
            raise InputError(f"{given}: --layout {', '.join((*FORMAT_ENDINGS, SCENE))}", source="export")
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
        for option, given in (("--hand", self.hand), ("--mapping", self.mapping)):
            if given:
                raise InputError("is of other layouts; grasp files say their hand", field=option)
        if self.output is None:
            raise InputError("missing: -o FOLDER, or a file that ends in .xml", source="export")
        if self.output.suffix.lower() in (".yaml", ".yml", ".json"):
            raise InputError(f"is of another layout; {SCENE} needs a folder, or .xml for one", source=str(self.output))
        written = export_scenes(self.source, self.output, force=self.force)
        print(f"{words.count(len(written), 'scene')}, layout {SCENE}: {self.output}")
        return console.ANSWERED
