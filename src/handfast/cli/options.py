"""The options that commands share, and how their values are read."""

from __future__ import annotations

import json
import os
import re
from abc import abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Protocol, TypeVar, get_type_hints

from tyro.conf import Positional, UseAppendAction, arg
from tyro.constructors import PrimitiveConstructorSpec

from handfast.cli import console
from handfast.core import bundled
from handfast.core.errors import FaultsOf, InputError
from handfast.core.files import SCHEMA_KINDS
from handfast.readers.registry import MESHES, ending

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from handfast.core.answer import Stop, Verdict
    from handfast.model.grasp import Grasp
    from handfast.model.hand.hand import Hand
    from handfast.pictures import Entry
    from handfast.stability.problem.grasp_limits import GraspLimits
    from handfast.stability.problem.settings import Settings
    from handfast.synthesis.task import Task

Numbers = tuple[float, ...]
Pairs = tuple[tuple[str, float], ...]
T = TypeVar("T")
HAND_FILE_LIMITS = "", float("inf")  # the word `hand` among torque limits: what the hand's file states


def _wrench(words: list[str]) -> Numbers:
    """Six numbers, or three for a force alone."""
    numbers = tuple(_number(w) for w in words)
    if len(numbers) not in (3, 6):
        count = len(numbers)
        raise ValueError(f"has {count} numbers; six are needed, FX FY FZ TX TY TZ, or three for a force alone")
    return (*numbers, 0.0, 0.0, 0.0)[:6]


def _pairs(words: list[str]) -> Pairs:
    """NAME=VALUE, any number of them."""
    out = []
    for word in words:
        name, equals, value = word.rpartition("=")
        if not (equals and name):
            raise ValueError(f"'{word}' is not NAME=VALUE")
        out.append((name, _number(value)))
    return tuple(out)


def _limits(words: list[str]) -> Pairs:
    """NAME=VALUE, any number of them, and the word hand."""
    return tuple(pair for word in words for pair in ((HAND_FILE_LIMITS,) if word == "hand" else _pairs([word])))


def is_number(word: str) -> bool:
    """Can it be read as a number?"""
    try:
        float(word)
    except ValueError:
        return False
    return True


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        hint = "; numbers have spaces between them" if "," in word else ""
        raise ValueError(f"'{word}' is not a number{hint}") from None


def _several(metavar: str, read: Any) -> PrimitiveConstructorSpec[Any]:
    return PrimitiveConstructorSpec(
        nargs="*",
        metavar=metavar,
        instance_from_str=read,
        is_instance=lambda x: isinstance(x, tuple),
        str_from_instance=lambda x: [str(v) for v in x],
    )


def _triple(words: list[str]) -> Numbers:
    """Three numbers."""
    if words == ["all"]:
        raise ValueError("is 'all', and one direction is needed here, X Y Z; handfast hold asks about all at once")
    numbers = tuple(_number(w) for w in words)
    if len(words) != 3:
        raise ValueError(f"has {len(words)} numbers; three are needed, X Y Z")
    return numbers


ALL_OPTIONS = ("all",)


def _gravity(words: list[str]) -> tuple[Any, ...]:
    """Three numbers, or the word all."""
    if words == ["all"]:
        return ALL_OPTIONS
    if len(words) != 3:
        raise ValueError(f"is '{' '.join(words)}'; three numbers are needed, X Y Z, or the word all")
    return _triple(words)


Wrench = Annotated[Numbers, _several("FX FY FZ TX TY TZ", _wrench)]
Triple = Annotated[Numbers, _several("X Y Z", _triple)]
Gravity = Annotated[tuple[Any, ...], _several("X Y Z | all", _gravity)]
Assignments = UseAppendAction[tuple[Annotated[Pairs, _several("NAME=VALUE", _pairs)], ...]]
TorqueLimits = UseAppendAction[tuple[Annotated[Pairs, _several("NAME=VALUE | hand", _limits)], ...]]
GraspName = Annotated[Positional[str], arg(metavar="GRASP")]


def assigned(groups: Sequence[Sequence[tuple[str, float]]], field: str) -> dict[str, float]:
    """All NAME=VALUE of a repeatable option; a name given twice is an error."""
    out: dict[str, float] = {}
    for name, value in (pair for group in groups for pair in group):
        if name in out:
            raise InputError(f"'{name}' is given twice", field=field)
        out[name] = value
    return out


def torque_limits(groups: Sequence[Pairs], hand: Callable[[], Hand], actuators: Sequence[str] = ()) -> dict[str, float]:
    """Torque limits by actuator: what is given by name, and for the word `hand` of the others what its file states.

    Args:
        hand: reads it, if it is asked for. actuators: those that count; all of the hand's unless given.

    Raises:
        InputError: a name is given twice; a hand that states nothing of its motors.
    """
    option = "--torque-limit"
    named = assigned([[pair for pair in group if pair != HAND_FILE_LIMITS] for group in groups], option)
    if not asks_hand(groups):
        return named
    found = hand()
    known = actuators or found.mechanism.actuators
    stated = {name: most for name, most in found.strengths.items() if name in known}
    if not stated:
        raise InputError("states no strength of its motors; give NAME=VALUE", source=found.name, field=option)
    return stated | named


def asks_hand(groups: Sequence[Pairs]) -> bool:
    """Is the word `hand` among torque limits?"""
    return any(pair == HAND_FILE_LIMITS for group in groups for pair in group)


def closing_senses(groups: Sequence[Pairs]) -> dict[str, int]:
    """Senses of joints that `--closing` gives."""
    senses = assigned(groups, "--closing")
    for name, sense in senses.items():
        if sense not in (-1, 0, 1):
            raise InputError(f"is {sense:g}; -1, 0 or 1 is needed", field=f"--closing {name}")
    return {name: int(sense) for name, sense in senses.items()}


HAND_PATTERN = re.compile(
    r"(menagerie|table1):.*|[a-z0-9_]+_description(:\w+)?|.*\.(urdf|xml|mjcf)(#.*)?", re.IGNORECASE
)


def refuse_hand(name: str) -> None:
    """`InputError` for a hand, or another file of ours, where a grasp is needed."""
    if HAND_PATTERN.fullmatch(name) or (name in bundled.names("hands") and name not in bundled.names("grasps")):
        right = f"handfast plan {name} OBJECT finds grasps of it, handfast contacts makes one of a configuration"
        raise InputError(f"is a hand, and a grasp is needed; {right}", source=name)
    if ending(Path(name)) in (".sdf", *MESHES) or (
        name in bundled.names("objects") and name not in bundled.names("grasps")
    ):
        raise InputError(
            f"is an object, and a grasp is needed; handfast plan HAND {name} finds grasps of it", source=name
        )
    if Path(name).is_dir():
        several = f"handfast label {name} -o LABELS.jsonl or handfast hold {name} ask about all that are in it"
        raise InputError(f"is a folder, and one grasp file is needed; {several}", source=name)
    schema = _schema(name)
    if schema in SCHEMA_KINDS and schema != "handfast/grasp/1":
        raise InputError(f"is {SCHEMA_KINDS[schema]}, and a grasp is needed", source=name)


def _schema(name: str) -> str:
    """What a JSON file says it is; "" if it says nothing or cannot be read, which is told when it is read in full."""
    if name.lower().endswith(".json") and Path(name).is_file():
        with suppress(OSError, ValueError, AttributeError, RecursionError):
            return str(json.loads(Path(name).read_text("utf-8")).get("schema"))
    return ""


class Written(Protocol):
    """An answer that can be written as numbers."""

    def to_json(self) -> dict[str, Any]: ...


class Answered(Written, Protocol):
    """An answer that ends with a verdict, and can be saved if it has `save`."""

    @property
    def verdict(self) -> Verdict: ...
    @property
    def stop(self) -> Stop: ...


@dataclass(frozen=True)
class EndsIn:
    """Of an option that names a file to be written: how the name may end."""

    endings: tuple[str, ...]


class Command:
    """A subcommand: its fields are its arguments."""

    one_of: ClassVar[tuple[str, ...]] = ()
    """options of which one is needed, with their values"""

    @classmethod
    def needed(cls) -> str:
        """The options of `one_of` as a complaint lists them."""
        return ", or ".join(cls.one_of)

    def refuse_files(self) -> None:
        """`InputError` for a file that could not be written, before the work that would fill it."""
        for name, hint in get_type_hints(type(self), include_extras=True).items():
            for about in getattr(hint, "__metadata__", ()):
                if isinstance(about, EndsIn):
                    check_writable(getattr(self, name), getattr(self, "force", False), about.endings)

    def made(self, kind: type[T], **others: Any) -> T:
        """Options of the API, of a kind: by their names, `others` where these are not what the command line says."""
        same = {f.name: getattr(self, f.name) for f in fields(kind) if hasattr(self, f.name)}  # type: ignore[arg-type]
        return kind(**same | others)

    @abstractmethod
    def run(self) -> int:
        """Do it; returns the exit status."""


@dataclass(kw_only=True)
class GraspOptions:
    """A grasp and what may be changed about it."""

    grasp: GraspName
    """a handfast/grasp/1 file or the name of a bundled grasp"""
    preload: Assignments = ()
    """actuator commands [N m, or N if prismatic or tendon] instead of the file's; others are locked"""
    no_preload: bool = False
    """lock every actuator"""
    friction: Annotated[float | None, arg(metavar="MU")] = None
    """friction coefficient at every contact, instead of the file's"""
    torsion: Annotated[float | None, arg(metavar="M")] = None
    """torsional friction at every contact [m], instead of the file's; 0 is a point contact"""

    def load(self) -> Grasp:
        """The grasp as asked for."""
        from handfast.readers.grasp_file import load_grasp

        refuse_hand(self.grasp)
        return self.changed(load_grasp(self.grasp), self.grasp)

    def torque_limits(self) -> dict[str, float]:
        """Those of `--torque-limit`, where there is that option."""
        from handfast.readers.configuration_file import load_hand_of

        groups: Sequence[Pairs] = getattr(self, "torque_limit", ())
        actuators = self.load().mechanism.actuators if asks_hand(groups) else ()
        return torque_limits(groups, lambda: load_hand_of(self.load()), actuators)

    def changed(self, grasp: Grasp, source: str) -> Grasp:
        """A grasp with what is asked for in place of what its file says."""
        if self.preload and self.no_preload:
            raise InputError("give either --preload or --no-preload")
        if self.preload:
            with FaultsOf(source):
                grasp = grasp.with_preload(assigned(self.preload, "--preload"))
        if self.no_preload:
            grasp = grasp.with_preload(None)
        grasp = grasp if self.friction is None else grasp.with_friction(self.friction)
        return grasp if self.torsion is None else grasp.with_torsion(self.torsion)


@dataclass(kw_only=True)
class WorkOptions:
    """Who does the work."""

    jobs: Annotated[int, arg(metavar="N")] = 0
    """processes; 0 for one a core"""
    scheduler: Annotated[str, arg(metavar="ADDRESS")] = ""
    """a Dask scheduler, whose workers do the work: tcp://HOST:PORT, or its scheduler file (.json)"""

    def workers(self) -> dict[str, Any]:
        """`jobs` and `scheduler` as functions take them."""
        if self.jobs < 0:
            raise InputError(f"is {self.jobs}; 0 or more is needed", field="--jobs")
        if self.jobs and self.scheduler:
            raise InputError("is of this machine; a --scheduler has workers of its own", field="--jobs")
        return {"jobs": self.jobs or None, "scheduler": self.scheduler or None}


@dataclass(kw_only=True)
class JsonOptions:
    """An answer in words or for programs."""

    json: bool = False
    """print one JSON object instead of a table"""
    force: bool = False
    """write over files that exist"""


@dataclass(kw_only=True)
class Reported(JsonOptions):
    """A page about the answer."""

    report: Annotated[Path | None, arg(metavar="FILE.html"), EndsIn((".html", ".htm"))] = None
    """write a self-contained page with pictures and numbers"""

    def write_page(
        self, grasp: Grasp, entries: Sequence[Entry] = (), *, notes: Sequence[str] = (), **shown: Any
    ) -> None:
        """The page, if it is asked for, with hand and object if the grasp file knows them; see `write_report`."""
        from handfast.pictures import write_report
        from handfast.pictures.scene import source_meshes

        if self.report:
            meshes, missing = source_meshes(grasp)
            write_report(
                self.report, grasp, entries, meshes=meshes, notes=[*notes, *missing], force=self.force, **shown
            )


@dataclass(kw_only=True)
class QueryOptions(GraspOptions, Reported):
    """What every stability question can be asked with."""

    eta: Annotated[float, arg(metavar="DEG")] = 0.0
    """how far the contact normals may be off [degrees], the stability paper's section VI"""
    torque_limit: TorqueLimits = ()
    """largest torque (force) of an actuator and its gearing, passive reaction included; hand: as its file states"""
    force_limit: Annotated[float | None, arg(metavar="N")] = None
    """largest normal force at any contact [N]"""
    gap: Annotated[float, arg(metavar="G")] = 1e-3
    """relative distance of the two bounds at which a number is exact enough"""
    timeout: Annotated[float, arg(metavar="S")] = float("inf")
    """seconds for a question (in a map or sweep: for each direction)"""
    nodes: Annotated[float, arg(metavar="N")] = float("inf")
    """nodes of the search for a question (in a map or sweep: for each direction)"""

    def finish(
        self,
        grasp: Grasp,
        answer: Answered,
        entries: Sequence[Entry],
        show: Callable[[Console], None],
        note: str = "",
        said: Sequence[str] = (),
    ) -> int:
        """Save an answer, write the page about it, print it as JSON or in words; returns the exit status.

        Args:
            entries: of the page.
            show: prints it in words. note: below them. said: above the page's entries.
        """
        if path := getattr(self, "save", None):
            answer.save(path, force=self.force)  # type: ignore[attr-defined]
        self.write_page(grasp, entries, settings=self.settings(), notes=said)
        if self.json:
            console.print_json(answer.to_json())
        else:
            show(console.out())
            if note:
                console.out().print(note, style="dim")
        return console.status(answer.verdict, answer.stop)

    def settings(self) -> Settings:
        from handfast.stability.problem.settings import Settings

        return Settings(gap=self.gap, timeout=self.timeout, nodes=self.nodes)

    @cached_property
    def limits(self) -> GraspLimits:
        """The limits in SI units."""
        import numpy as np

        from handfast.stability.problem.grasp_limits import GraspLimits

        return GraspLimits(float(np.radians(self.eta)), self.torque_limits(), self.force_limit)

    def options(self) -> dict[str, Any]:
        """Keyword arguments that all queries take."""
        return {"limits": self.limits, "settings": self.settings()}


@dataclass(kw_only=True)
class Saved:
    """An answer that can be saved with what backs it."""

    save: Annotated[Path | None, arg(metavar="FILE.json"), EndsIn((".json",))] = None
    """write answer, witness and certificate, for handfast verify"""


@dataclass(kw_only=True)
class FrictionModel:
    """The comparison with the friction of the grasp-force literature."""

    mdp: bool = True
    """leave out the maximum dissipation principle, for comparison: friction may then create energy"""


@dataclass(kw_only=True)
class LoadingOrder:
    """Does the load come with the commands, or after them?"""

    loading: Literal["together", "preload-first"] = "together"
    """commands and load at once, as the paper has it, or first the squeeze and then the load, in proved steps"""


def check_writable(path: Path | None, force: bool, endings: Sequence[str]) -> None:
    """Refuse a file that could not be written before the work that would fill it."""
    if path is None:
        return
    if path.suffix.lower() not in endings:
        raise InputError(f"a name that ends in {' or '.join(endings)} is needed", source=str(path))
    if path.is_dir():
        raise InputError("is a folder", source=str(path))
    if path.exists() and not force:
        raise InputError("exists already; give --force to write over it", source=str(path))
    _refuse_parent(path)


def _refuse_parent(path: Path) -> None:
    """`InputError` where nothing can be written because of a folder above."""
    above = next((p for p in path.absolute().parents if p.exists()), None)
    if above is not None and not above.is_dir():
        raise InputError(f"cannot be written: {above.name} is a file, not a folder", source=str(path))
    if above is not None and not os.access(above, os.W_OK):
        raise InputError(f"cannot be written: the folder {above} is read-only", source=str(path))


def write_as(
    path: Path,
    answer: Written,
    draw: Callable[[], Figure],
    csv: Callable[[], str] | None = None,
    *,
    force: bool = False,
) -> None:
    """Write an answer as the file's ending says: numbers (.json, .csv) or a picture."""
    from handfast.core.files import write_bytes, write_text

    match path.suffix.lower():
        case ".json":
            write_text(path, json.dumps(answer.to_json(), indent=1, allow_nan=False) + "\n", force=force)
        case ".csv" if csv:
            write_text(path, csv(), force=force)
        case ending:
            from handfast.pictures.drawing import picture

            write_bytes(path, picture(draw(), ending.removeprefix(".")), force=force)


def check_folder(path: Path | None) -> None:
    """Refuse a file where a folder is to be filled."""
    if path is not None and path.exists() and not path.is_dir():
        raise InputError("is a file; a folder is needed", source=str(path))
    if path is not None:
        _refuse_parent(path / "file")


def load_solvable(name: str) -> Task:
    """A task by path or name whose limits and couplings leave something; the faults name it."""
    from handfast.model.hand.coupling import driver_ranges
    from handfast.synthesis.task_file import load_task

    if HAND_PATTERN.fullmatch(name):
        right = f"handfast propose {name} OBJECT writes tasks, handfast plan needs none"
        raise InputError(f"is a hand, and a task is needed; {right}", source=name)
    if (schema := _schema(name)) in SCHEMA_KINDS and schema != "handfast/task/1":
        raise InputError(f"is {SCHEMA_KINDS[schema]}, and a task is needed (handfast propose HAND OBJECT)", source=name)
    task = load_task(name)
    with FaultsOf(name):
        driver_ranges(task.hand, task.involved.tolist())
    return task
