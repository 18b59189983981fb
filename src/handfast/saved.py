"""One door for checking answers: what a file or an answer claims is replayed by the half that it belongs to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from handfast.core.errors import InputError
from handfast.core.files import read_json

if TYPE_CHECKING:
    from handfast.planning.results.grasps_file import SavedGrasps
    from handfast.planning.results.verify_grasps import ReplayedGrasps
    from handfast.stability.answers import Answer
    from handfast.stability.certify.certificate import Certificate
    from handfast.stability.query import SavedAnswer
    from handfast.stability.verification import Verified
    from handfast.synthesis.synthesis_answer import ReplayedSynthesis, Synthesis
    from handfast.synthesis.synthesis_file import SavedSynthesis

SCHEMAS = (
    "handfast/result/1",
    "handfast/result/2",
    "handfast/certificate/1",
    "handfast/certificate/2",
    "handfast/synthesis/1",
    "handfast/grasps/2",
)


def verify(
    what: str | Path | Answer | SavedAnswer[Any] | Certificate | Synthesis | SavedSynthesis | SavedGrasps,
) -> Verified | ReplayedSynthesis | ReplayedGrasps:
    """Is everything that an answer claims proved? Replayed without any search and without any solver.

    Args:
        what: a file of one of the `SCHEMAS`, or what it holds; an answer of either half, or a certificate.

    Raises:
        InputError: the file cannot be read, or is none of these.
    """
    from handfast.planning.results import verify_grasps as grasps
    from handfast.planning.results.grasps_file import SavedGrasps
    from handfast.stability.certify.certificate import Certificate
    from handfast.stability.verification import verified_certificate

    loaded = load(what) if isinstance(what, str | Path) else what
    if isinstance(loaded, SavedGrasps):
        return grasps.verify(loaded)
    return verified_certificate(loaded) if isinstance(loaded, Certificate) else loaded.verify()


def load(path: str | Path) -> Any:
    """What a file holds, by its schema; `InputError` if it is none that can be verified."""
    data = read_json(path, "result")
    schema = data.get("schema") if isinstance(data, dict) else None
    try:
        if schema == "handfast/synthesis/1":
            from handfast.synthesis import synthesis_file

            return synthesis_file.from_dict(data)
        if schema in ("handfast/grasps/1", "handfast/grasps/2"):
            from handfast.planning.results import grasps_file

            return grasps_file.from_dict(data)
        if schema not in SCHEMAS:
            needed = f"{', '.join(SCHEMAS[:-1])} or {SCHEMAS[-1]} is needed"
            raise InputError(f"is missing; {needed}" if schema is None else f"is '{schema}'; {needed}", field="schema")
        from handfast.stability import answer_file

        return answer_file.from_dict(data)
    except InputError as fault:
        raise fault.at(str(path)) from None
