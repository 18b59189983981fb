"""Result files of version 1, whose certificates have caps on motions, are read."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from handfast.core.errors import InputError
from handfast.stability.answer_file import verify
from tests.support.saved_answers import caps_times, drop_leaf, first_text, negate_largest, put, times, trivial


def test_the_first_version_is_read(tmp_path: Path) -> None:
    path = tmp_path / "r.json"
    path.write_text(first_text())
    done = verify(path)
    assert done.ok, done.reason
    assert done.certificate.motion == pytest.approx(1.1e4)
    assert done.certificate.claim == "the disturbance is not resisted, up to virtual motions of 11000 N"


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (caps_times(1e-6), "certificate: it covers motions up to 0.011 N only; this question's begin to matter at"),
        (trivial, "certificate: it covers motions up to 1e-09 N only; this question's begin to matter at"),
        (lambda d: d["certificate"].pop("cap_r"), "certificate.cap_r: is missing"),
        (lambda d: [d["certificate"].pop("cap_r"), d["certificate"].pop("cap_q")], "certificate.cap_.: is missing"),
        (put("certificate", "cap_q", 0, to=1.0), "certificate: it covers motions up to"),
        (put("answer", "motion_cap", to=times(2)), "answer: motion_cap is not what the rest of the file shows"),
        (put("answer", "motion_cap", to=None), "answer: motion_cap is not what the rest of the file shows"),
        (put("answer", "verified", to=True), "answer: verified is nothing that it can say"),
        (put("schema", to="handfast/result/2"), "certificate: it has caps on motions; an answer of this version"),
        (negate_largest, "certificate: leaf"),
        (drop_leaf, "certificate: node"),
    ],
)
def test_faults_of_the_first_version(change: Any, reason: str, tmp_path: Path) -> None:
    data = json.loads(first_text())
    change(data)
    path = tmp_path / "r.json"
    path.write_text(json.dumps(data))
    try:
        said = verify(path).reason
    except InputError as fault:
        said = str(fault)
    assert re.search(reason, said), said
