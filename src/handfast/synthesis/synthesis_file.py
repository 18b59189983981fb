"""The `handfast/synthesis/1` file: a synthesis with its task and its proofs, for `handfast verify` and to go on.

The task is embedded with the hand, so that nothing else is needed to check the proofs. `checksum` is that of
all the rest: a file that was changed after it was written is refused as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from handfast.core.answer import Reach, Stop
from handfast.core.errors import InputError
from handfast.core.files import Strict, read_json, validate
from handfast.proofs.configurations import Existence
from handfast.proofs.replay import Replay
from handfast.synthesis.embedded_task import fingerprint, refuse_broken, task_from_dict
from handfast.synthesis.solution import Solution, existence_from_dict
from handfast.synthesis.synthesis_answer import Searched, Synthesis, replayed
from handfast.synthesis.task import Task

Count = Annotated[int, Field(ge=0)]


class ConfigurationEntry(Strict):
    """`existence` is the proof; the rest follows from it."""

    joints: dict[str, float]
    object_pose: dict[str, list[float]]
    contacts: list[dict[str, Any]]
    slacks: dict[str, float]
    existence: dict[str, Any]


class SynthesisAnswerEntry(Strict):
    """What `handfast synthesize --json` prints."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, populate_by_name=True)

    format: Literal["handfast/answer/1"] = Field(alias="schema")
    query: Literal["synthesize"]
    verdict: Reach
    stop: Stop
    seconds: float
    nodes: Count
    starts: Count
    unproved: Count
    seed: Count
    spread: float | None
    configurations: list[ConfigurationEntry]
    searched: Searched | None


class SynthesisStateEntry(Strict):
    """Where an undecided search stands; `prover` is its own, {} if it did not begin."""

    fingerprint: str
    seed: Count
    block: Count
    prover: dict[str, Any]


class SynthesisFile(Strict):
    """The file as it stands on disk."""

    format: Literal["handfast/synthesis/1"] = Field(alias="schema")
    checksum: str
    task: dict[str, Any]
    answer: SynthesisAnswerEntry
    state: SynthesisStateEntry | None


@dataclass(frozen=True, eq=False)
class SavedSynthesis:
    """A synthesis as it stands in a file, and the parsed file itself."""

    synthesis: Synthesis
    data: dict[str, Any]

    def verify(self) -> Replay:
        """What the file claims, replayed."""
        return replayed(self.data)


def from_dict(data: Any) -> SavedSynthesis:
    """The synthesis in a parsed object; raises `InputError` with field and fault."""
    entry = validate(SynthesisFile, data)
    refuse_broken(data)
    try:
        task = task_from_dict(entry.task)
    except InputError as fault:
        raise fault.within("task") from None
    said = entry.answer
    if (said.verdict is Reach.UNDECIDED) != (entry.state is not None):
        raise InputError(
            f"is {'missing' if entry.state is None else 'there'}; the answer is {said.verdict}", field="state"
        )
    if entry.state is not None and entry.state.fingerprint != fingerprint(entry.task):
        raise InputError("is of another task", field="state.fingerprint")
    proofs = [c.existence for c in said.configurations]
    solutions = tuple(solution_of(task, e, f"answer.configurations[{i}].existence") for i, e in enumerate(proofs))
    synthesis = Synthesis(
        task,
        said.verdict,
        said.stop,
        said.seconds,
        said.starts,
        said.unproved,
        solutions,
        said.searched,
        said.seed,
        entry.state.model_dump() if entry.state else {},
    )
    return SavedSynthesis(synthesis, data)


def solution_of(task: Task, existence: dict[str, Any], field: str) -> Solution:
    """The configuration of a saved proof; `InputError` if it cannot be one of the task, `field` is where it stands."""
    try:
        proof = existence_from_dict(existence)
        _refuse_misfit(task, proof)
        return Solution.of(task, proof)
    except InputError as fault:
        raise fault.within(field) from None


def _refuse_misfit(task: Task, proof: Existence) -> None:
    """What a configuration cannot be computed from."""
    free, b = task.free, len(task.contact_pairs)
    if set(proof.joints) != set(free):
        raise InputError(f"are not the free joints of the task: {', '.join(free) or 'none'}", field="joints")
    if len(proof.contacts) != b:
        raise InputError(f"has {len(proof.contacts)} entries; the task has {b} contacts", field="contacts")
    if not (proof.quaternion**2).sum() > 0:
        raise InputError("is zero", field="quaternion")
    for k, (pair, spot) in enumerate(zip(task.contact_pairs, proof.contacts, strict=True)):
        if (pair.hand.ball is not None) != (spot.hand is None):
            needed = "null, the region is a cap" if pair.hand.ball else "u and v, the region is no cap"
            raise InputError(f"needs {needed}", field=f"contacts[{k}].hand")


def load_synthesis(path: str | Path) -> Synthesis:
    """The synthesis in a file; `InputError` if it is none, or was changed after it was written."""
    return load(path).synthesis


def load(path: str | Path) -> SavedSynthesis:
    """The same with what the file says beside the proofs."""
    data = read_json(path, "synthesis")
    try:
        if not isinstance(data, dict) or data.get("schema") != "handfast/synthesis/1":
            raise InputError("is not 'handfast/synthesis/1', as written by handfast synthesize --save", field="schema")
        return from_dict(data)
    except InputError as fault:
        raise fault.at(str(path)) from None
