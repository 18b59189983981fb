"""Files and folders that can be verified, by the schema that they state."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
from handfast.proofs.fields import Array, BadFile, Fields
from handfast.proofs.grasp import GraspData, read_grasp
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
    return Replay("certificate", parts=(answers.refuted(found.claim, found, None, None, complete=False),))


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
    """The same of a file, or of the folder of a plan: that every grasp that `plan.json` names holds its loads, and how
    many contacts it takes at least.

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
    best = list(plan.objects("grasps", []))
    entries = [*best, *plan.objects("others", [])]
    if not entries and not plan.has("contacts_file"):
        raise BadFile("names no grasps", plan.at("grasps"))
    asked = plan.object("loads") if entries or plan.has("loads") else Fields({})
    loads = {name: asked.numbers(name, (6,)) for name in asked.names()}
    known: list[GraspData] = []
    parts = [_planned(path, entry, loads, known) for entry in entries]
    verdict, words = plan.take("verdict", None), plan.take("fewest_contacts", None)
    wrong = "HOLDS without a grasp" if verdict == "holds" and not best else ""
    if verdict == "none" and (entries or not plan.has("contacts_file")):
        wrong = "NONE with a grasp, or without a contacts_file"
    if plan.has("contacts_file"):
        name, data = _of_folder(path, plan, "contacts_file", few_contacts.SCHEMA)
        shown, due = verify(data, name), few_contacts.read_claim(data, name)
        parts.append(Replay(name, "", _beside(due, loads, known), parts=(shown,)))
        if verdict == "none" and due.fewest.most < 1:
            wrong = f"NONE, but {due.words}"
        wrong = wrong or ("" if words in (None, due.words) else f"fewest_contacts is not '{due.words}'")
    elif words is not None:
        wrong = wrong or "fewest_contacts is said without a contacts_file"
    return Replay("plan", "", wrong, parts=tuple(parts), not_replayed=(OF_PLAN,))


OF_PLAN = (
    "that contacts and joints are those of the hand on the object, masses, how many times (safety) the loads are those "
    "that were asked for, clearances, margins, scores and what else plan.json measures of grasps, what became of other "
    "attempts, how many contacts are allowed"
)


def _of_folder(folder: Path, f: Fields, key: str, schema: str) -> tuple[str, Any]:
    """The name of a file that a field names, and what is in it."""
    name = f.text(key)
    if Path(name).name != name:
        raise BadFile(f"is {name!r}; a file of the folder is needed", f.at(key))
    data = read_json(folder / name, name)
    Fields(data, name).text("schema", among=[schema])
    return name, data


def _beside(said: few_contacts.ContactsClaim, loads: Mapping[str, Array], grasps: Sequence[GraspData]) -> str:
    """What of a claim how many contacts it takes does not go with the plan's loads and grasps; "" if all does."""
    if loads and {name: w.tolist() for name, w in loads.items()} != said.loads:
        return f"its loads are not those of {PLAN_FILE}"
    few = [g.m for g in grasps if g.m <= said.fewest.most]
    return f"a grasp has {few[0]} contacts, but {said.words}" if few else ""


def _planned(folder: Path, entry: Fields, loads: Mapping[str, Array], known: list[GraspData]) -> Replay:
    """That a grasp of a plan holds the plan's loads, (6,) [N, N m] by name, under the preload in its file.

    known: the plan's grasps before; it becomes one of them.
    """
    name, data = _of_folder(folder, entry, "hold_file", holds.SCHEMA)
    saved, proved = holds.read_hold(data, name), verify(data, name)
    of_file, data = _of_folder(folder, entry, "grasp_file", "handfast/grasp/1")
    grasp, fault = read_grasp(data, of_file), ""
    if saved.said.get("verdict") != "holds":
        fault = f"it does not say that {of_file} holds"
    elif loads.keys() != saved.loads.keys() or any((loads[key] != w).any() for key, w in saved.loads.items()):
        fault = f"its loads are not those of {PLAN_FILE}"
    elif not grasp.same_but_commands(saved.question.grasp):
        fault = f"it is about another grasp than {of_file}"
    elif any((grasp.command != check.question.grasp.command).any() for check in saved.checks.values()):
        fault = f"it is about another preload than that of {of_file}"
    elif wrong := _told_otherwise(folder, entry, data, grasp):
        fault = f"{wrong} is not what {of_file} has"
    elif any(_parts_of(grasp) == _parts_of(other) for other in known):
        fault = f"{of_file} is a grasp that the plan has before"
    known.append(grasp)
    return Replay(name, "", fault, parts=(proved,))


def _parts_of(grasp: GraspData) -> tuple[Any, ...]:
    """Contacts in any order, and commands: what tells grasps of one hand on one object apart."""
    spots = zip(grasp.links, grasp.positions.tolist(), grasp.frames[:, :, 0].tolist(), strict=True)
    return sorted(spots), dict(zip(grasp.actuators, grasp.command.tolist(), strict=True))


def _told_otherwise(folder: Path, entry: Fields, data: Any, grasp: GraspData) -> str:
    """What `plan.json`, or the file of the configuration, tells otherwise than the file (data) of the grasp; ""."""
    preload = data.get("preload", {})
    most = max(preload, key=lambda name: abs(preload[name]), default=None)
    due = {"preload": preload, "contacts": grasp.m, "links": sorted({*grasp.links})}
    due |= {"largest_command": {"actuator": most, "value": preload.get(most, 0.0)}}
    for key, value in due.items():
        said = entry.take(key, value)
        if isinstance(value, Mapping) and isinstance(said, Mapping):
            said = {name: x for name, x in said.items() if name != "unit"}
        if not answers.alike(said, value, 0.0):
            return entry.at(key)
    if entry.has("configuration_file"):
        name, configuration = _of_folder(folder, entry, "configuration_file", "handfast/configuration/1")
        if not answers.alike(configuration.get("preload", preload), preload, 0.0):
            return f"{name}.preload"
    return ""


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
