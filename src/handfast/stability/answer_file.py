"""Reading what `handfast verify` is given: result files and certificates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from handfast.core.errors import InputError
from handfast.core.files import read_json
from handfast.stability import queries, saved_answer
from handfast.stability.certify import certificate_file
from handfast.stability.certify.certificate import Certificate
from handfast.stability.query import SavedAnswer
from handfast.stability.verification import Verified, verified_certificate

RESULTS = ("handfast/result/1", "handfast/result/2")
CERTIFICATES = ("handfast/certificate/1", "handfast/certificate/2")


def from_dict(data: Any) -> SavedAnswer[Any] | Certificate:
    """What the parsed JSON of a result or a certificate holds; `InputError` if it is neither."""
    schema = data.get("schema") if isinstance(data, dict) else None
    if schema in CERTIFICATES:
        return certificate_file.from_dict(data)
    if schema in RESULTS:
        return saved_answer.from_dict(data, queries.known())
    needed = f"{RESULTS[-1]} or {CERTIFICATES[-1]} is needed"
    raise InputError(f"is missing; {needed}" if schema is None else f"is '{schema}'; {needed}", field="schema")


def load(path: str | Path) -> SavedAnswer[Any] | Certificate:
    """What a result file or a certificate file holds; `InputError` if it is neither."""
    data = read_json(path, "result")
    try:
        return from_dict(data)
    except InputError as fault:
        raise fault.at(str(path)) from None


def verify(what: str | Path | SavedAnswer[Any] | Certificate) -> Verified:
    """Is everything that a file claims proved? Replayed without the engine and without any solver.

    Raises:
        InputError: the file cannot be read, or is neither.
    """
    found = load(what) if isinstance(what, str | Path) else what
    return verified_certificate(found) if isinstance(found, Certificate) else found.verify()
