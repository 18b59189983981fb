"""Files and folders that can be verified, by the schema that they state."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from handfast.proofs import (
    answers,
    certificate,
    few_contacts,
    grasps,
    holds,
    path_steps,
    strict_json,
    synthesis,
)
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.replay import Replay

PLAN_FILE = "plan.json"
REPLAY_COMMAND = "handfast verify FILE --replay"
SETTLED_SCHEMA = "handfast/settled/1"
ASK = {  # answers that keep no proof, and what asks for one
    "check": "handfast check GRASP --save",
    "max": "handfast max GRASP --save",
    "torques": "handfast torques GRASP --save",
    "hold": "handfast hold GRASP --save",
    "map": REPLAY_COMMAND,
    "sweep": REPLAY_COMMAND,
    "synthesize": "handfast synthesize TASK --save",
    "grasp": "handfast grasp TASK -o FOLDER",
    "plan": "handfast verify FOLDER, for the folder that it stands in",
}


def verify(data: Any, place: str = "") -> Replay:
    """Is everything proved that a parsed file claims? Nothing is searched, no solver is asked.

    Raises:
        BadFile: it is none of the `READERS`, or a field of it is wrong.
    """
    schema, field = data.get("schema") if isinstance(data, dict) else None, f"{place}.schema" if place else "schema"
    if schema in ("handfast/answer/1", SETTLED_SCHEMA):
        ask = REPLAY_COMMAND if schema == SETTLED_SCHEMA else ASK.get(str(data.get("query")), "with --save")
        raise BadFile(f"is an answer without its proof; ask again: {ask}", field)
    if not isinstance(schema, str) or schema not in READERS:
        found = "is missing" if schema is None else f"is {schema!r}"
        raise BadFile(f"{found}; {' or '.join(map(repr, READERS))} is needed", field)
    try:
        return READERS[schema](data, place)
    except np.linalg.LinAlgError:
        raise BadFile("has numbers too large or too small beside each other to be judged", place) from None


def _certificate(data: Any, place: str) -> Replay:
    found = certificate.read_certificate_file(data, place)
    return Replay("certificate", parts=(answers.refuted(found.claim, found, 0.0, None, complete=False),))


READERS: dict[str, Callable[[Any, str], Replay]] = {
    answers.SCHEMA: lambda data, place: answers.replay(answers.read_answer(data, place)),
    certificate.SCHEMA: _certificate,
    path_steps.SCHEMA: lambda data, place: path_steps.replay(path_steps.read_path(data, place)),
    holds.SCHEMA: lambda data, place: holds.replay(holds.read_hold(data, place)),
    synthesis.SCHEMA: lambda data, place: synthesis.replay(data),
    grasps.SCHEMA: grasps.replay_grasps,
    few_contacts.SCHEMA: few_contacts.replay,
}


def verify_path(path: str | Path) -> Replay:
    """The same of a file, or of the folder of a plan: every grasp that `plan.json` names, and how many contacts it
    takes at least.

    Raises:
        BadFile: nothing is there, it cannot be read, or is not what can be verified.
    """
    path = Path(path)
    try:
        is_folder = path.is_dir()
    except OSError as fault:  # no name of a file
        raise BadFile(f"cannot be read: {fault.strerror}") from None
    if not is_folder:
        return verify(read_json(path))
    plan = Fields(read_json(path / PLAN_FILE, PLAN_FILE), PLAN_FILE)
    entries = [*plan.objects("grasps", []), *plan.objects("others", [])]
    named = [(entry, "hold_file") for entry in entries]
    named += [(plan, "contacts_file")] if plan.has("contacts_file") else []
    if not named:
        raise BadFile("names no grasps", plan.at("grasps"))
    parts = []
    for entry, key in named:
        name = entry.text(key)
        if Path(name).name != name:
            raise BadFile(f"is {name!r}; a file of the folder is needed", entry.at(key))
        parts.append(Replay(name, parts=(verify(read_json(path / name, name), name),)))
    return Replay("plan", parts=tuple(parts), not_replayed=(OF_PLAN,))


OF_PLAN = "that contacts and joints are those of the hand on the object, clearances, what became of other attempts"


def read_json(path: Path, place: str = "") -> Any:
    """The parsed JSON of a file.

    Raises:
        BadFile: what is wrong, at this place: it cannot be read, and what `strict_json` refuses.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # a pipe, or a device without an end
            raise BadFile("is no file", place)
        return strict_json.parse(path.read_text("utf-8"))
    except BadFile as fault:
        raise BadFile(fault.problem, place) from None
    except ValueError as fault:  # a NUL in the path as well
        raise BadFile(f"is not valid JSON: {fault}", place) from None
    except FileNotFoundError:
        raise BadFile("no such file; one that --save wrote is needed", place) from None
    except OSError as fault:
        raise BadFile(f"cannot be read: {fault.strerror}", place) from None
