"""A table of labels, asked again: the grasps are those of its dataset, every verdict and every bound is proved."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import FaultsOf, InputError
from handfast.core.files import same_json, validate
from handfast.core.schema import InFiles
from handfast.datasets.dataset_rows import DatasetRow, GraspChanges
from handfast.datasets.labels.label_columns import HELD_BY_VALUES, SCHEMA, WRENCHES, wrench_column
from handfast.datasets.labels.label_dataset import PART, grasp_of_row
from handfast.datasets.labels.label_files import format_of, load_labels
from handfast.datasets.labels.labeller import (
    LabelQuestions,
    all_hold,
    axis_wrench,
    center_of,
    described_grasp,
    force_at,
    measured,
)
from handfast.datasets.labels.questions import free_motors, largest_command
from handfast.datasets.open_dataset import open_dataset
from handfast.datasets.scene_source import SceneSource
from handfast.model.grasp import Grasp
from handfast.proofs.answers import VERDICTS
from handfast.proofs.fields import EQUALITY_TOLERANCE, BadFile, number, numbers, same
from handfast.proofs.replay import Replay
from handfast.stability.problem.grasp_limits import AskedWith
from handfast.stability.problem.scaled_problem import unbalanced
from handfast.stability.problem.settings import INF
from handfast.stability.studies.ask_again import (
    CONTRADICTION_GAP,
    FINEST_GAP,
    NO_TIME,
    UPPER_BOUND_ROUNDING,
    Asking,
    BoundsClaim,
    Claim,
    Clock,
    VerdictClaim,
    asked,
    figures_of,
    together,
)
from handfast.stability.studies.questions import torques

SEARCH_COURSE = "open, stop, nodes, seconds: the course of the searches is recorded, and nothing rests on it"
BROKEN_ROWS = "rows that could not be labelled"
UNBOUNDED = "nothing that is known bounds the commands of a path from below"


def about_labels(path: Path) -> dict[str, Any]:
    """What a table of labels is about, from its metadata; `InputError` if nothing says it."""
    if not path.is_file():
        raise InputError("no such file; a table of labels is needed", source=str(path))
    about = format_of(path).about(path)
    if not isinstance(about, dict) or about.get("schema") != SCHEMA:
        beside = f"; {path.name}.about.json has to be beside it" if path.suffix.lower() == ".jsonl" else ""
        raise InputError(f"has no metadata that say what was asked{beside}", source=str(path))
    return about


def replay_labels(path: Path, dataset: str | Path | None, how: Asking, rows: Collection[int] = ()) -> Replay:
    """Every row of a table, or these, asked again.

    Args:
        dataset: of which it is; its SHA-256 is in the table.
        rows: their numbers, from 0; all if there are none.

    Raises:
        InputError: no such files, another dataset, a row that is not there.
    """
    about = about_labels(path)
    if dataset is None:
        raise InputError("is missing: the grasps of a table of labels are in its dataset", field="--dataset")
    recipe = _Recipe.of(about, str(path))
    source = open_dataset(dataset)
    if not same_json(source.identity(), about.get("dataset")):
        raise InputError(f"is not the dataset of {path.name}: its SHA-256 is another", source=str(dataset))
    for k in rows:
        if not 0 <= k < source.count:
            raise InputError(f"is {k}; rows 0 to {source.count - 1} are there", field="--row")
    found: list[tuple[str, list[Replay], list[Claim]]] = []
    broken = 0
    origin = (row for part in source.parts(PART) for row in part.rows)
    count = 0
    for said, row in zip(load_labels(path), origin, strict=False):
        count += 1
        if rows and row.number not in rows:
            continue
        place = f"row {row.number}"
        if said.get("status") != "labelled":
            broken += 1
        else:
            found.append((place, *_claims(said, row, recipe, f"{path}: {place}")))
    if count != source.count:
        raise InputError(f"has {count} rows, its dataset {source.count}", source=str(path))
    told = iter(asked([claim for _, _, claims in found for claim in claims], how))
    parts = []
    for place, faults, claims in found:
        answers = [part for _ in claims for part in next(told)]
        parts.append(together(place, "what it holds, by how much", [*faults, *answers]))
    left = (f"{BROKEN_ROWS}: {broken}",) if broken else ()
    return Replay("labels", parts=tuple(parts), not_replayed=(*left, SEARCH_COURSE))


@dataclass(frozen=True, eq=False)
class _Recipe(InFiles):
    """What was asked of every row, as the metadata have it."""

    questions: LabelQuestions
    changes: GraspChanges
    scene: SceneSource | None

    @classmethod
    def of(cls, about: Mapping[str, Any], source: str) -> _Recipe:
        with FaultsOf(source):
            read = validate(cls, {name: about[name] for name in ("questions", "changes", "scene") if name in about})
        return replace(read, scene=read.scene and read.scene.resolved_from(Path(source).parent))

    @property
    def terms(self) -> AskedWith:
        return AskedWith(gap=self.questions.gap, loading=self.questions.loading)


def _claims(said: Mapping[str, Any], row: DatasetRow, recipe: _Recipe, source: str) -> tuple[list[Replay], list[Claim]]:
    """What a row says that is not so, and what is to be asked again."""
    try:
        grasp, about = grasp_of_row(row, recipe.changes, recipe.scene)
    except InputError as fault:
        return [Replay("status", "the row is a grasp", f"is 'labelled'; in the dataset it is none: {fault}")], []
    due = about | described_grasp(grasp)
    faults = [
        Replay(name, "it is that of the dataset", f"is {said.get(name)}; that of the dataset is {value}")
        for name, value in due.items()
        if not same(said.get(name), value)
    ]
    faults += [
        Replay(name, "it is what the contacts give", f"is {said.get(name)}; measured anew it is {value}")
        for name, value in measured(grasp).items()
        if not same(said.get(name), value)
    ]
    row_of = _Row(said, grasp, recipe)
    try:
        claims = [*row_of.largest(), *row_of.worst(faults)]
        if grasp.mass:
            claims += row_of.under_gravity(faults)
    except BadFile as fault:
        raise InputError(fault.problem, source=source, field=fault.field) from None
    return faults, claims


@dataclass(frozen=True, eq=False)
class _Row:
    """A row that is labelled, with the grasp that it is of."""

    said: Mapping[str, Any]
    grasp: Grasp
    recipe: _Recipe

    @property
    def center(self) -> Array:
        return center_of(self.grasp)

    def number(self, name: str, none: float) -> float:
        value = self.said.get(name)
        return none if value is None else number(value, name, 0.0)

    def bounds(self, name: str, load: Array, *, upper: bool = True) -> BoundsClaim:
        """What two columns say of a load."""
        above = f"{name}_upper"
        high = self.number(above, INF) if upper else INF
        return BoundsClaim(name, self.grasp, load, self.recipe.terms, self.number(name, 0.0), high, upper_place=above)

    def largest(self) -> Iterator[Claim]:
        """Along the axes, both ways."""
        for name in WRENCHES:
            yield self.bounds(wrench_column(name), axis_wrench(name, self.center))

    def worst(self, faults: list[Replay]) -> list[Claim]:
        """In every direction at least the least, in the worst no more."""
        return self._least("worst_force", "worst_direction", self.recipe.questions.directions, 1.0, faults)[0]

    def under_gravity(self, faults: list[Replay]) -> list[Claim]:
        """Verdicts, the factor on the weight, and the commands."""
        assert self.grasp.mass
        weight, pulls = self.grasp.mass * self.recipe.questions.g, self.recipe.questions.gravity
        verdicts = self.said.get("verdicts")
        if not isinstance(verdicts, list) or len(verdicts) != len(pulls) or not set(verdicts) <= set(VERDICTS):
            raise BadFile(f"is no list of {len(pulls)} verdicts", "verdicts")
        word = str(all_hold([Verdict(v) for v in verdicts]))
        if self.said.get("verdict") != word:
            fault = f"is '{self.said.get('verdict')}'; the verdicts say '{word}'"
            faults.append(Replay("verdict", "it is what the verdicts say", fault))
        claims: list[Claim] = []
        for k, (verdict, pull) in enumerate(zip(verdicts, pulls, strict=True)):
            if verdict != Verdict.UNDECIDED:
                load = weight * force_at(pull, self.center)
                claims.append(VerdictClaim(f"verdicts[{k}]", self.grasp, load, self.recipe.terms, verdict))
        least, hardest = self._least("weight_factor", "hardest", pulls, weight, faults)
        claims += least
        if hardest is not None:
            claims.append(self._commands(weight * force_at(hardest, self.center)))
        loads = np.array([weight * force_at(pull, self.center) for pull in pulls])
        return claims + self._held_by(word, loads, faults)

    def _held_by(self, verdict: str, loads: Array, faults: list[Replay]) -> list[Claim]:
        """Which commands hold all loads (n, 6)."""
        said, given = self.said.get("held_by"), self._given("holding_commands")
        due = {str(Verdict.HOLDS): {"these"}, str(Verdict.UNDECIDED): {"undecided"}}
        right = due.get(verdict, {*HELD_BY_VALUES} - {"these"})
        if said not in right:
            fault = f"is '{said}'; with the verdict '{verdict}' it is {' or '.join(sorted(right))}"
            faults.append(Replay("held_by", "it fits the verdict", fault))
            return []
        if (given is not None) != (said in ("these", "others")):
            fault = f"is {'null' if given is None else given.tolist()}, where held_by is '{said}'"
            faults.append(Replay("holding_commands", "there are some if the weight can be held", fault))
            return []
        if said == "these" and not same(given.tolist() if given is not None else None, self.grasp.command.tolist()):
            faults.append(Replay("holding_commands", "they are those of the row", "are others than its preload"))
        if said == "others" and given is not None:
            grasp = self.grasp.with_commands(dict(zip(self.grasp.mechanism.actuators, given.tolist(), strict=True)))
            return [VerdictClaim("holding_commands", grasp, w, self.recipe.terms, "holds") for w in loads]
        if said == "none":
            return [NoCommandsClaim("held_by", self.grasp, loads[0], self.recipe.terms, loads)]
        return []

    def _given(self, name: str) -> Array | None:
        """Commands (a,) of a column."""
        given = self.said.get(name)
        return None if given is None else numbers(given, (self.grasp.mechanism.a,), name)

    def _least(
        self, name: str, where: str, directions: Array, scale: float, faults: list[Replay]
    ) -> tuple[list[Claim], Array | None]:
        """The least over directions (n, 3) of what is resisted, and where that is, if it is one of them."""
        at = numbers(self.said.get(where), (3,), where)
        same_as = np.flatnonzero(np.abs(directions - at).max(axis=1) <= EQUALITY_TOLERANCE)
        if not len(same_as):
            faults.append(Replay(where, "it is one that was asked", f"is {at.tolist()}, none of those that were asked"))
        out: list[Claim] = []
        for k, direction in enumerate(directions):
            load = scale * force_at(direction, self.center)
            out.append(self.bounds(name, load, upper=bool(len(same_as)) and k == same_as[0]))
        return out, directions[same_as[0]] if len(same_as) else None

    def _commands(self, load: Array) -> CommandsClaim:
        lower, upper = self.number("largest_command_lower", 0.0), self.number("largest_command", INF)
        return CommandsClaim("commands", self.grasp, load, self.recipe.terms, self._given("commands"), lower, upper)


@dataclass(frozen=True, eq=False)
class CommandsClaim(Claim):
    """These commands (a,) hold the load, and none whose largest is smaller than `lower` do.

    Attributes:
        upper: the largest of them, inf without.
    """

    commands: Array | None
    lower: float
    upper: float

    def ask(self, clock: Clock) -> tuple[Replay, ...]:
        return tuple(told for told in (self._held(clock), self._least(clock)) if told is not None)

    def _held(self, clock: Clock) -> Replay | None:
        if self.commands is None:
            fault = f"is {self.upper:.9g}, without commands" if self.upper < INF else ""
            return Replay("largest_command", "it is the largest of the commands", fault) if fault else None
        claim, largest = f"commands up to {self.upper:.6g} hold the weight", largest_command(self.grasp, self.commands)
        if abs(largest - self.upper) > EQUALITY_TOLERANCE * largest:
            fault = f"is {self.upper:.9g}; the largest of the commands is {largest:.9g}"
            return Replay("largest_command", claim, fault)
        preload = dict(zip(self.grasp.mechanism.actuators, self.commands.tolist(), strict=True))
        grasp = self.grasp.with_commands(preload)
        told = replace(VerdictClaim("commands", grasp, self.load, self.terms, "holds").ask(clock)[0], claim=claim)
        return (
            replace(told, refused="asked again, the weight slips under them, which is proved") if told.refused else told
        )

    def _least(self, clock: Clock) -> Replay | None:
        if self.lower == 0:
            return None
        place = "largest_command_lower"
        told = Replay(place, f"no commands below {self.lower:.6g} hold the weight")
        if unbalanced(self.grasp, self.load):
            none = self.no_forces()
            return replace(told, refused=none.reason, figures=none.figures)
        if self.terms.along_paths:
            return replace(told, refused=f"is {self.lower:.9g}; {UNBOUNDED}")
        gap = self.gap
        while clock.left > 0:
            answer = torques(self.grasp, self.load, settings=clock.settings(gap))
            proof = answer.verify()
            told = replace(told, figures=figures_of(proof))
            if not proof.ok:
                return replace(told, undecided=f"asked again, its proof is refused: {proof.reason}")
            small = answer.stop is not Stop.COMPLETE and told.figures["motion_cap"] is not None  # motions
            if answer.lower >= self.lower * (1 - UPPER_BOUND_ROUNDING) and not small:
                return told
            if answer.upper < self.lower * (1 - CONTRADICTION_GAP):
                less = f"is {self.lower:.9g}; asked again, commands of {answer.upper:.9g} hold, which is proved"
                return replace(told, refused=less)
            text = f"asked again, no commands below {answer.lower:.9g} hold, and {answer.upper:.9g} do"
            if answer.stop is not Stop.COMPLETE:
                return replace(told, undecided=f"{text}: it is open ({answer.stop})")
            if gap <= FINEST_GAP:
                return replace(told, refused=f"is {self.lower:.9g}; {text}")
            gap = max(gap / 10, FINEST_GAP)
        return replace(told, undecided=NO_TIME)


@dataclass(frozen=True, eq=False)
class NoCommandsClaim(Claim):
    """One of these loads (n, 6) is resisted under no commands at all."""

    loads: Array

    def ask(self, clock: Clock) -> tuple[Replay, ...]:
        told = Replay(self.place, "one of the loads is resisted under no commands")
        if any(unbalanced(self.grasp, load) for load in self.loads):
            load = next(load for load in self.loads if unbalanced(self.grasp, load))
            none = replace(self, load=load).no_forces()
            return (replace(told, refused=none.reason, figures=none.figures),)
        motors, held = free_motors(self.grasp), 0
        if not motors:
            return (told,)  # the verdicts are asked again on their own
        if self.terms.along_paths:
            return (replace(told, refused=f"is 'none'; {UNBOUNDED}"),)
        for load in self.loads:
            if clock.left <= 0:
                return (replace(told, undecided=NO_TIME),)
            answer = torques(self.grasp, load, actuators=motors, settings=clock.settings(self.gap))
            proof = answer.verify()
            if answer.verdict is Verdict.SLIPS and proof.ok:
                return (replace(told, figures=figures_of(proof)),)
            held += answer.verdict is Verdict.HOLDS and proof.ok
        if held == len(self.loads):
            return (replace(told, refused="is 'none'; asked again, each load is resisted under some, which is proved"),)
        return (replace(told, undecided="asked again, it is open"),)
