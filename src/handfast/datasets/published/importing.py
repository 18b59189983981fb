"""From a published grasp to one of ours: placed on a hand model, taken apart from its object, with few contacts.

Files name their object by a code, or by a path on the machine that made them. Such a path is never followed as it
stands: its last parts are looked for below folders that the user gave, or, if it is relative, below those that hold the
file of grasps.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any

from handfast.core import bundled
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.parallel import default_jobs, workers_of
from handfast.datasets.published.mapping_file import HandMapping, PlacedGrasp, placed
from handfast.datasets.published.published_file import Source
from handfast.datasets.published.recorded import BrokenRow, RecordedGrasp
from handfast.datasets.published.separating import Separator, gaps_closed, pushed_on
from handfast.geometry.contact_patch import REDUCTION_TOLERANCE, reduced_contacts
from handfast.geometry.contacts import THRESHOLD, find_contacts, grasp_of, of_body
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.model.hand.hand import Hand
from handfast.model.servo import servo_commands
from handfast.readers.body_file import BodyFile, MeshFile, ShapeFile
from handfast.readers.load_body import load_body
from handfast.readers.mesh_file import MESH_FILES

PIECES = ("coacd/decomposed.obj", "urdf/meshes", "meshes", "mesh/coacd.obj", "mesh/simplified.obj", "")
INNER = ("mesh", "meshes", "urdf", "coacd")  # folders in an object's own
UPWARDS = 8  # folders above the file of grasps
MAX_IMPORT_DEPTH = 0.02  # [m] a grasp deeper than this is none: another hand, frame or scale
KEPT_SCENES = 4  # objects whose scenes are kept


@dataclass(frozen=True)
class FoundObject:
    """An object's mesh files, its convex pieces if there are several.

    Attributes:
        name: of the object, for files.
        meshes: one or more; or a single body file.
    """

    name: str
    meshes: tuple[Path, ...]

    @property
    def states_its_size(self) -> bool:
        """Whether it is a `handfast/body/1` file, which no grasp scales."""
        return self.meshes[0].suffix.lower() not in MESH_FILES

    def body_file(self, meshes: Sequence[str], scale: float, mass: float | None, friction: float | None) -> BodyFile:
        """As a `handfast/body/1` file, with its meshes as the file is to name them and the scale of the grasp."""
        shapes = [ShapeFile(mesh=MeshFile(file=mesh, scale=scale)) for mesh in meshes]
        return BodyFile(schema="handfast/body/1", name=self.name, shapes=shapes, mass=mass, friction=friction)


def find_object(named: str, grasps: Path, roots: Sequence[Path] = ()) -> FoundObject:
    """The object that a file of grasps names.

    Args:
        named: a code, "set+object", or a path, as the file has it.
        grasps: the file.
        roots: folders in which objects are; without them the folders above the file.

    Raises:
        InputError: there is none; the line says what to give.
    """
    parts = [p for p in PurePosixPath(named.replace("+", "/")).parts if p not in ("/", "..", ".")]
    absolute = PurePosixPath(named).is_absolute()
    above = grasps.resolve().parents[:UPWARDS]
    bases = list(roots) or ([] if absolute else [Path.cwd(), *above])
    for base in bases:
        for start in range(len(parts) if roots else min(1, len(parts))):
            for candidate in _candidates(base.joinpath(*parts[start:])):
                meshes = meshes_of(candidate) if candidate not in (base, *base.parents) else ()
                if meshes:
                    return FoundObject(candidate.stem if candidate.suffix in MESH_FILES else candidate.name, meshes)
    where = f"below {', '.join(map(str, roots))}" if roots else "beside the file"
    raise InputError(f"object '{named}' was not found {where}; give --objects FOLDER, or --object OBJECT for all")


def _candidates(path: Path) -> Iterator[Path]:
    """The object's folder comes first: pieces that are convex spare a decomposition."""
    if path.suffix.lower() in (*MESH_FILES, ".urdf", ".xml"):
        if path.parent.name in INNER:
            yield path.parent.parent
        yield path
        yield path.with_suffix("")
    yield path
    for ending in MESH_FILES:
        yield path.with_name(path.name + ending)


def meshes_of(path: Path) -> tuple[Path, ...]:
    """The mesh file at a path, or those of the object in a folder; none if there are none."""
    if path.is_file():
        return (path,) if path.suffix.lower() in MESH_FILES else ()
    if not path.is_dir():
        return ()
    for inner in PIECES:
        place = path / inner
        if place.is_file():
            return (place,)
        if place.is_dir():
            found = tuple(sorted(f for f in place.iterdir() if f.suffix.lower() in MESH_FILES and f.is_file()))
            if found:
                return found
    return ()


@dataclass(frozen=True)
class Treatment:
    """What is done to a published grasp.

    Attributes:
        contacts: whether contacts are wanted at all; without them no object is needed.
        separate: take hand and object apart.
        close_gaps: close fingers that do not touch towards the squeeze.
        threshold: [m] surfaces nearer than this touch.
        tolerance: of the reduction of contacts, see `reduced_contacts`.
    """

    contacts: bool = True
    separate: bool = True
    close_gaps: bool = True
    threshold: float = THRESHOLD
    tolerance: float = REDUCTION_TOLERANCE


@dataclass(frozen=True, eq=False)
class ImportedGrasp:
    """What became of a row.

    Attributes:
        source: the row.
        reason: why it was left out; "" if it was not.
        configuration: hand and object after the treatment.
        grasp: with its contacts; None without.
        object: the object's files; scale: metres per unit of them.
        said: what was done: lengths in metres, angles in radians, by name.
        squeeze, pregrasp: joint values by name, where the file has them.
    """

    source: Source
    reason: str = ""
    configuration: Configuration | None = None
    grasp: Grasp | None = None
    object: FoundObject | None = None
    scale: float = 1.0
    said: dict[str, Any] = field(default_factory=dict)
    squeeze: dict[str, float] | None = None
    pregrasp: dict[str, float] | None = None

    def to_json(self) -> dict[str, Any]:
        """The row of `import.json` and of tables of JSON lines."""
        row = self.source.row
        about: dict[str, Any] = {"file": self.source.file, "index": row.index, "layout": self.source.layout}
        if isinstance(row, RecordedGrasp):
            about |= {"object": row.object, "scale": self.scale}
            about |= {k: v for k, v in (("hand", row.hand), ("score", row.score)) if v not in ("", None)}
        if self.reason:
            return about | {"reason": self.reason}
        targets = {"squeeze": self.squeeze, "pregrasp": self.pregrasp}
        return about | self.said | {k: v for k, v in targets.items() if v is not None}


@dataclass
class Importer:
    """A hand, its mapping and what is to be done; objects are found, read and compiled when they are needed.

    Attributes:
        hand: the model; hand_name: as it is to stand in files.
        mapping: what the files leave unsaid.
        treatment: what is done to each.
        roots: folders in which objects are; object: a mesh, a body file or a bundled object for all grasps, in place
            of what files name.
        mass, friction: of the objects; scale: a factor on their meshes, beside the files'.
        gain: of position servos that pull towards the squeeze [N m/rad, N/m]: what they do is the preload of a grasp
            that has one. None locks every actuator.
    """

    hand: Hand
    mapping: HandMapping
    treatment: Treatment = Treatment()
    hand_name: str = ""
    roots: tuple[Path, ...] = ()
    object: str | None = None
    mass: float | None = None
    friction: float | None = None
    scale: float = 1.0
    gain: float | None = None
    _found: dict[tuple[str, str], FoundObject] = field(default_factory=dict)
    _scenes: dict[tuple[tuple[Path, ...], float], Separator] = field(default_factory=dict)

    def of(self, source: Source) -> ImportedGrasp:
        """What becomes of a row; what is wrong with it stands in `reason`."""
        if isinstance(source.row, BrokenRow):
            return ImportedGrasp(source, source.row.reason)
        try:
            return self._of(source, source.row)
        except InputError as fault:
            return ImportedGrasp(source, str(fault))
        except OSError as fault:  # a name that is too long, a folder that may not be read
            return ImportedGrasp(source, f"the object's file cannot be read: {fault.strerror}")

    def _of(self, source: Source, row: RecordedGrasp) -> ImportedGrasp:
        at, scale = placed(self.hand, self.mapping, row), row.scale * self.scale
        targets: dict[str, Any] = {
            name: None if q is None else self.hand.values(q)
            for name, q in (("squeeze", at.squeeze), ("pregrasp", at.pregrasp))
        }
        clipped = {"past_limits": at.clipped} if at.clipped else {}
        if not self.treatment.contacts:
            place = Configuration.of(self.hand, at.q, at.pose, hand=self.hand_name or None, object=row.object or None)
            return ImportedGrasp(source, "", place, scale=scale, said=clipped, **targets)
        found = self._object(row.object, Path(source.file))
        separator = self._separator(found, scale)
        at, said = self._treated(separator, at, grips=row.squeeze is None)
        scene, threshold = separator.scene, self.treatment.threshold
        contacts = find_contacts(self.hand, at.q, scene.body, at.pose, threshold, scene=scene)
        if not contacts:
            raise InputError(f"touches nothing within {threshold * 1e3:g} mm after the treatment")
        few = reduced_contacts(contacts, scene.body, self.treatment.tolerance)
        said |= {"contacts_before": few.before, "contacts": len(few.contacts), "reduction_error": few.error}
        name = f"{Path(source.file).stem} {row.index}"
        grasp = of_body(grasp_of(self.hand, at.q, few.contacts, at.pose, name=name), self.hand, scene.body)
        if self.gain is not None and at.squeeze is not None:
            grasp = grasp.with_preload(self._pulls(grasp, at.q, at.squeeze, self.gain))
        named = {"hand": self.hand_name or None, "preload": grasp.preload or None}
        place = Configuration.of(self.hand, at.q, at.pose, **named)
        return ImportedGrasp(source, "", place, grasp, found, scale, clipped | said, **targets)

    def _pulls(self, grasp: Grasp, q: Array, squeeze: Array, gain: float) -> dict[str, float]:
        """What servos do whose targets are the squeeze; a tendon that would have to push is left locked."""
        m, out = self.hand.mechanism, dict[str, float]()
        for name, row, tendon in zip(m.actuators, m.R, m.tendon, strict=True):
            target = float(row @ squeeze)
            if name in grasp.mechanism.actuators and not (tendon and target < row @ q):
                out |= servo_commands(self.hand, q, {name: target}, gain)
        return {name: force for name, force in out.items() if force}

    def _treated(self, separator: Separator, at: PlacedGrasp, *, grips: bool) -> tuple[PlacedGrasp, dict[str, Any]]:
        """Hand and object taken apart, fingers closed onto the object, and what that was.

        Args:
            grips: the squeeze is the mapping's: a gripper closes until the object is held, wherever it stood.
        """
        said: dict[str, Any] = {}
        scene = separator.scene
        depth = max([0.0, *(-p.distance for p in scene.nearest(at.q, at.pose, 1e-3))])
        if depth > MAX_IMPORT_DEPTH:
            problem = f"is {depth * 1e3:.3g} mm inside its object: is it the right hand, mapping and scale?"
            raise InputError(problem)
        said["penetration_before"] = depth
        if self.treatment.separate:
            done = separator.separated(at.q, at.pose)
            if not done.apart:
                raise InputError(
                    f"cannot be taken apart from its object: {done.after * 1e3:.3g} mm of penetration are left"
                )
            said |= {
                "penetration_after": done.after,
                "object_moved": done.object_moved,
                "object_turned": done.object_turned,
                "joints_moved": done.joints_moved,
                "surface_moved": done.surface_moved,
            }
            at = replace(at, q=done.q, pose=done.pose)
        squeeze = at.squeeze
        if self.treatment.close_gaps and squeeze is not None:
            closed = gaps_closed(scene, at.q, at.pose, squeeze)
            said |= {"gaps_closed": closed.closed, "gaps_left": closed.open}
            at = replace(at, q=closed.q)
            if grips:
                q, pose, said["object_pushed"] = pushed_on(separator, at.q, at.pose, squeeze)
                at = replace(at, q=q, pose=pose)
        return at, said

    def _object(self, named: str, file: Path) -> FoundObject:
        """What a file names, or the object that was given for all."""
        if self.object is not None:
            path = Path(bundled.resolve("objects", self.object))
            return FoundObject(path.name, meshes_of(path)) if path.is_dir() else FoundObject(path.stem, (path,))
        key = (named, str(file.parent))
        if key not in self._found:
            self._found[key] = find_object(named, file, self.roots)
        return self._found[key]

    def _separator(self, found: FoundObject, scale: float) -> Separator:
        key = (found.meshes, scale)
        if key not in self._scenes:
            if len(self._scenes) >= KEPT_SCENES:
                self._scenes.pop(next(iter(self._scenes)))
            self._scenes[key] = Separator(Scene(self.hand, self._body(found, scale)))
        return self._scenes[key]

    def _body(self, found: FoundObject, scale: float) -> Body:
        if found.states_its_size:
            if scale != 1:
                raise InputError(f"states its own size; the grasp's scale {scale:g} needs a mesh", source=self.object)
            return load_body(found.meshes[0], self.mass, self.friction)
        bodies = [load_body(mesh, friction=self.friction, scale=scale) for mesh in found.meshes]
        pieces = [piece for body in bodies for piece in body.pieces]
        center = bodies[0].center_of_mass if len(bodies) == 1 else None
        about: dict[str, Any] = {"mass": self.mass, "friction": bodies[0].friction, "center_of_mass": center}
        return Body.of(pieces, name=found.name, **about)


def imported(
    importer: Importer, found: Sequence[Source], jobs: int | None = 1, scheduler: str | None = None
) -> Iterator[ImportedGrasp]:
    """What becomes of rows, in their order, in `jobs` processes (None: all cores), or by a Dask scheduler's workers."""
    with workers_of(importer, min(jobs or default_jobs(), max(len(found), 1)), scheduler) as workers:
        yield from workers.map(Importer.of, found)
