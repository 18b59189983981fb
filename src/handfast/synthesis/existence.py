"""Proofs of existence beside tasks: read from files, and checked by `proofs/` on the numbers that a file would hold."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from handfast.core.errors import InputError
from handfast.proofs.configurations import Existence, check_configuration, read_existence
from handfast.proofs.contact_equations import ContactEquations
from handfast.proofs.fields import BadFile
from handfast.proofs.replay import Refused, Replay
from handfast.proofs.tasks import read_task
from handfast.synthesis.embedded import task_to_dict
from handfast.synthesis.task import Task


def verify_existence(task: Task, proof: Existence) -> Replay:
    """Does an exact configuration of the task exist in the box of the proof? See `check_configuration`."""
    try:
        return check_configuration(_equations_of(task), proof)
    except Refused as fault:
        return Replay("configuration", refused=str(fault))


def misplaced(task: Task, joints: Mapping[str, float], proof: Existence) -> str:
    """Which of all joints of the hand is not where it is proved, or breaks a limit or a coupling; '' if none."""
    return _equations_of(task).task.misplaced(joints, proof.joints)


def existence_from_dict(data: Any) -> Existence:
    """The proof in a parsed object; raises `InputError` with field and fault."""
    try:
        return read_existence(data)
    except BadFile as fault:
        raise InputError(fault.problem, field=fault.field or None) from None


@lru_cache(maxsize=16)
def _equations_of(task: Task) -> ContactEquations:
    return ContactEquations.of(read_task(task_to_dict(task)))
