"""One door for checking answers: what a file, a folder or an answer claims is replayed by `handfast.proofs`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from handfast.core.errors import InputError
from handfast.core.files import read_json
from handfast.proofs.fields import BadFile
from handfast.proofs.replay import Replay


class Verifiable(Protocol):
    """Any answer."""

    def verify(self) -> Replay: ...


def verify(what: str | Path | Verifiable) -> Replay:
    """Is everything that an answer claims proved? Replayed without any search and without any solver.

    What is geometry, contacts and joints of a hand at a configuration, is measured anew, and said apart.

    Args:
        what: a file that `--save` wrote, the folder of a plan; or an answer of any kind.

    Raises:
        InputError: the file cannot be read, or is none that can be verified.
    """
    if not isinstance(what, str | Path):
        return what.verify()
    from handfast.proofs import files

    try:
        proved = files.verify_path(what)
    except BadFile as fault:
        raise InputError(fault.problem, source=str(what), field=fault.field or None) from None
    geometry = _measured(Path(what))
    return replace(proved, parts=(*proved.parts, geometry)) if geometry else proved


def _measured(path: Path) -> Replay | None:
    """What of a file is geometry and was measured anew; None if nothing is."""
    try:
        if path.is_dir():
            from handfast.planning.results.verify_plan import measured_plan

            return measured_plan(path)
        data = stated(path)
        if data.get("schema") == "handfast/grasps/1":
            from handfast.planning.results import grasps_file, verify_grasps

            return verify_grasps.measured(grasps_file.from_dict(data))
        if data.get("schema") == "handfast/synthesis/1":
            from handfast.synthesis import synthesis_file

            synthesis_file.from_dict(data)  # its checksum, and that it fits its task
    except InputError as fault:
        raise fault.at(str(path)) from None
    return None


def stated(path: str | Path) -> Any:
    """The parsed JSON of what `verify` was given: of a folder its `plan.json`. `InputError` if it cannot be read."""
    path = Path(path)
    return read_json(path / "plan.json" if path.is_dir() else path, "result")
