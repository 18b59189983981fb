"""Files and folders that can be verified, by the schema that they state."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from handfast.proofs import answers, certificate, checker, grasps, holds, synthesis
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.replay import Replay

LONGEST = 50  # digits of a whole number
DEPTH = 50  # of lists and objects in each other
PLAN = "plan.json"
ASK = {  # answers that keep no proof, and what asks for one
    "check": "handfast check GRASP --save",
    "max": "handfast max GRASP --save",
    "torques": "handfast torques GRASP --save",
    "hold": "handfast hold GRASP --save",
    "map": "handfast max GRASP --direction ... --save for each direction",
    "sweep": "handfast max GRASP --preload ... --save for each preload",
    "settle": "handfast check GRASP --save for the grasp where it comes to rest",
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
    if schema == "handfast/answer/1":
        query = data.get("query")
        raise BadFile(f"is an answer without its proof; ask again: {ASK.get(str(query), 'with --save')}", field)
    if not isinstance(schema, str) or schema not in READERS:
        found = "is missing" if schema is None else f"is {schema!r}"
        raise BadFile(f"{found}; {' or '.join(map(repr, READERS))} is needed", field)
    return READERS[schema](data, place)


def _certificate(data: Any, place: str) -> Replay:
    found = certificate.read_certificate_file(data, place)
    done = checker.verify(found)
    claim = found.question.claim(found.scalar)
    claim += "" if done.cap is None else f", up to virtual motions of {done.cap:.6g} N"
    figures = {"motion_cap": done.cap, "leaves": done.leaves, "margin": done.margin}
    return Replay("certificate", parts=(Replay("certificate", claim, done.reason, figures),))


READERS: dict[str, Callable[[Any, str], Replay]] = {
    answers.SCHEMA: lambda data, place: answers.replay(answers.read_answer(data, place)),
    certificate.SCHEMA: _certificate,
    holds.SCHEMA: lambda data, place: holds.replay(holds.read_hold(data, place)),
    synthesis.SCHEMA: lambda data, place: synthesis.replay(data),
    grasps.SCHEMA: grasps.replay_grasps,
}


def verify_path(path: str | Path) -> Replay:
    """The same of a file, or of the folder of a plan: every grasp that `plan.json` names.

    Raises:
        BadFile: nothing is there, it cannot be read, or is not what can be verified.
    """
    path = Path(path)
    if not path.is_dir():
        return verify(read_json(path))
    plan = Fields(read_json(path / PLAN, PLAN), PLAN)
    entries = [*plan.objects("grasps", []), *plan.objects("others", [])]
    if not entries:
        raise BadFile("names no grasps", plan.at("grasps"))
    parts = []
    for entry in entries:
        name = entry.text("hold_file")
        if Path(name).name != name:
            raise BadFile(f"is {name!r}; a file of the folder is needed", entry.at("hold_file"))
        parts.append(Replay(name, parts=(verify(read_json(path / name, name), name),)))
    return Replay("plan", parts=tuple(parts), not_replayed=(OF_PLAN,))


OF_PLAN = "that contacts and joints are those of the hand on the object, clearances, what became of other attempts"


def read_json(path: Path, place: str = "") -> Any:
    """The parsed JSON of a file: no number that is none, no name twice in an object, nothing nested without end.

    Raises:
        BadFile: what is wrong, at this place.
    """
    try:
        data = json.loads(path.read_text("utf-8"), parse_constant=_refused, parse_int=_whole, object_pairs_hook=_object)
    except BadFile as fault:
        raise BadFile(fault.problem, place) from None
    except (ValueError, RecursionError) as fault:
        raise BadFile(f"is not valid JSON: {fault}", place) from None
    except OSError as fault:
        raise BadFile(f"cannot be read: {fault.strerror}", place) from None
    layer, depth = [data] if isinstance(data, dict | list) else [], 0
    while layer:
        depth += 1
        if depth > DEPTH:
            raise BadFile(f"is nested too deeply; at most {DEPTH} lists and objects may be in each other", place)
        layer = [y for x in layer for y in (x.values() if isinstance(x, dict) else x) if isinstance(y, dict | list)]
    return data


def _refused(constant: str) -> Any:
    raise BadFile(f"contains {constant}; finite numbers are needed")


def _whole(digits: str) -> int:
    if len(digits) > LONGEST:
        raise BadFile(f"contains a number of {len(digits)} digits; at most {LONGEST} are possible")
    return int(digits)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    out = dict(pairs)
    if len(out) < len(pairs):
        names = [name for name, _ in pairs]
        raise BadFile(f"has '{next(n for n in names if names.count(n) > 1)}' twice in one object")
    return out
