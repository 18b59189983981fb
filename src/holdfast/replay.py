"""One door for checking answers: what a file or an answer claims is replayed by the half that it belongs to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from holdfast.errors import InputError
from holdfast.files import read_json

if TYPE_CHECKING:
    from holdfast.planning.tasks.grasps_file import SavedGrasps
    from holdfast.planning.tasks.replay import ReplayedGrasps
    from holdfast.stability.answers import Answer
    from holdfast.stability.certificate import Certificate
    from holdfast.stability.replay import Verified
    from holdfast.stability.result_file import Result
    from holdfast.synthesis.answers import Replayed, Synthesis
    from holdfast.synthesis.result_file import Saved

SCHEMAS = (
    "holdfast/result/1",
    "holdfast/result/2",
    "holdfast/certificate/1",
    "holdfast/certificate/2",
    "holdfast/synthesis/1",
    "holdfast/grasps/2",
)


def verify(
    what: str | Path | Answer | Result | Certificate | Synthesis | Saved | SavedGrasps,
) -> Verified | Replayed | ReplayedGrasps:
    """Is everything that an answer claims proved? Replayed without any search and without any solver.

    Args:
        what: a file of one of the `SCHEMAS`, or what it holds; an answer of either half, or a certificate.

    Raises:
        InputError: the file cannot be read, or is none of these.
    """
    from holdfast.planning.tasks import replay as grasps
    from holdfast.planning.tasks.grasps_file import SavedGrasps
    from holdfast.stability import replay as stability
    from holdfast.synthesis import replay as synthesis
    from holdfast.synthesis.answers import Synthesis
    from holdfast.synthesis.result_file import Saved

    loaded = load(what) if isinstance(what, str | Path) else what
    if isinstance(loaded, SavedGrasps):
        return grasps.verify(loaded)
    return synthesis.verify(loaded) if isinstance(loaded, Synthesis | Saved) else stability.verify(loaded)


def load(path: str | Path) -> Any:
    """What a file holds, by its schema; `InputError` if it is none that can be verified."""
    data = read_json(path, "result")
    schema = data.get("schema") if isinstance(data, dict) else None
    try:
        if schema == "holdfast/synthesis/1":
            from holdfast.synthesis import result_file

            return result_file.from_dict(data)
        if schema in ("holdfast/grasps/1", "holdfast/grasps/2"):
            from holdfast.planning.tasks import grasps_file

            return grasps_file.from_dict(data)
        if schema not in SCHEMAS:
            needed = f"{', '.join(SCHEMAS[:-1])} or {SCHEMAS[-1]} is needed"
            raise InputError(f"is missing; {needed}" if schema is None else f"is '{schema}'; {needed}", field="schema")
        from holdfast.stability import replay

        return replay.from_dict(data)
    except InputError as fault:
        raise fault.at(str(path)) from None
