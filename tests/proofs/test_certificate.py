"""Certificates come back from files as they were; whatever is wrong with one is said in a line."""

from __future__ import annotations

import base64
import json
import zlib
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from handfast.proofs import certificate, checker
from handfast.proofs.certificate import (
    NODE_ARRAYS,
    ROW_ARRAYS,
    SCHEMA,
    Certificate,
    file_to_dict,
    proof_to_dict,
    read_certificate,
    read_certificate_file,
)
from handfast.proofs.checker import verify
from handfast.proofs.fields import BadFile
from handfast.proofs.question import SMALLEST_PRELOAD
from tests.support import proof_certificates
from tests.support.proof_certificates import SHORT, walls
from tests.support.proof_states import contact, pinch

QUESTION = {
    "grasp": {
        "schema": "handfast/grasp/1",
        "contacts": [contact([-1, 0, 0], [1, 0, 0]), contact([1, 0, 0], [-1, 0, 0])],
    },
    "goal": "check",
    "wrench": [0, 1, 0, 0, 0, 0],
}


def arrays():
    return proof_certificates.arrays(leaves=SHORT)


def proof(**changed):
    return proof_certificates.proof(leaves=SHORT, **changed)


def preload():
    return pinch([0] * 6, goal=SMALLEST_PRELOAD, direction=[0, 0, 1, 0, 0, 0])


def test_round_trip():
    rng = np.random.default_rng(3)
    rows = {name: rng.integers(-(2**31), 2**31, size=6) for name in ROW_ARRAYS}
    c = proof(**rows, left=[-(2**31), 2**31 - 1, 5, 0, -1], references=rng.normal(size=(2, 3)))
    back = read_certificate(json.loads(json.dumps(proof_to_dict(c))), "proof", c.question)
    for name in (*NODE_ARRAYS, "start", *ROW_ARRAYS, "multiplier", "references"):
        assert np.array_equal(getattr(back, name), getattr(c, name)), name
    assert back.multiplier.dtype == c.multiplier.dtype
    short = read_certificate(json.loads(json.dumps(proof_to_dict(c.rounded()))), "proof", c.question)
    assert short.multiplier.dtype == np.float32
    assert np.array_equal(short.multiplier, c.rounded().multiplier)
    assert back.scalar is None
    assert back.question is c.question


def test_files_hold_question_and_proof():
    data = json.loads(json.dumps(file_to_dict(proof_certificates.proof(), QUESTION)))
    assert data["schema"] == SCHEMA == "handfast/certificate/1"
    assert verify(read_certificate_file(data, "")).ok
    with pytest.raises(BadFile, match=r"schema: is 'handfast/certificate/0'; 'handfast/certificate/1' is needed"):
        read_certificate_file(data | {"schema": "handfast/certificate/0"}, "")
    with pytest.raises(BadFile, match=r"question\.wrench: is missing"):
        read_certificate_file(data | {"question": {"grasp": QUESTION["grasp"], "goal": "check"}}, "")


def test_ranges():
    q = preload()
    for scalar in ((0.0, 1.5), (0.25, np.inf), (0.5, 0.5)):
        back = read_certificate(proof_to_dict(Certificate.of_root(q, scalar)), "", q)
        assert back.scalar == scalar
        assert back.claim == q.claim(scalar) != q.claim(None)
    for scalar, why in (
        ([-1.0, 2.0], "c.scalar: is -1 to 2, not a range"),
        ([2.0, 1.0], "c.scalar: is 2 to 1, not a range"),
        (None, "c.scalar: is the range of the goal's scalar"),
        ([1.0], "c.scalar: is no range; two numbers"),
        (1.0, "c.scalar: is no range; two numbers"),
        ([None, 1.0], "scalar: has None where a number is needed"),
        ([0.0, "1"], "scalar: has '1' where a number"),
    ):
        with pytest.raises(BadFile, match=why):
            read_certificate(proof_to_dict(Certificate.of_root(q, (0.0, 1.0))) | {"scalar": scalar}, "c", q)
    given: list[int] = [0, 2]
    assert repr(Certificate.of_root(q, given).scalar) == "(0.0, 2.0)"  # type: ignore[arg-type]
    with pytest.raises(BadFile, match="null for a check"):
        Certificate.of_root(walls(), (0.0, 1.0))


def packed(change):
    """The proof's file with its bytes changed."""
    data = proof_to_dict(proof())
    return data | {"proof": base64.b64encode(change(zlib.decompress(base64.b64decode(data["proof"])))).decode()}


def compressed(change=lambda raw: raw):
    return packed(lambda raw: zlib.compress(change(raw)))


BAD = {
    "no base64": (lambda: proof_to_dict(proof()) | {"proof": "*"}, "c.proof: is no zlib stream in base64"),
    "no stream": (lambda: packed(lambda raw: raw), "c.proof: is no zlib stream in base64"),
    "cut off": (lambda: packed(lambda raw: zlib.compress(raw)[:-3]), "c.proof: is not of the .* bytes"),
    "a byte short": (lambda: compressed(lambda raw: raw[:-1]), "c.proof: is not of the 256 bytes"),
    "a byte more": (lambda: compressed(lambda raw: raw + b"0"), "c.proof: is not of the 256 bytes"),
    "something after it": (lambda: packed(lambda raw: zlib.compress(raw) + b"0"), "c.proof: is not of the 256 bytes"),
    "a bomb": (lambda: compressed(lambda raw: bytes(10**7)), "c.proof: is not of the 256 bytes"),
    "another count": (lambda: proof_to_dict(proof()) | {"rows": 7}, "c.proof: is not of the 280 bytes"),
    "a huge count": (lambda: proof_to_dict(proof()) | {"rows": 10**12}, "c.rows: has 5 nodes and 1000000000000 rows"),
    "a huge table": (lambda: proof_to_dict(proof()) | {"references": 10**12}, r"c.proof: is of .*; at most 2"),
    "a huge tree": (lambda: proof_to_dict(proof()) | {"nodes": 2 * 10**7}, "c.rows: has 20000000 nodes and 6"),
    "a negative count": (lambda: proof_to_dict(proof()) | {"nodes": -1}, "c.nodes: is -1; a whole number of 0 or more"),
    "half a count": (lambda: proof_to_dict(proof()) | {"leaves": 2.5}, "c.leaves: is 2.5; a whole number"),
    "no text": (lambda: proof_to_dict(proof()) | {"proof": 5}, "c.proof: is 5; a text"),
    "unknown": (lambda: proof_to_dict(proof()) | {"cap": 5}, "c.cap: is not a known field"),
    "missing": (lambda: {k: v for k, v in proof_to_dict(proof()).items() if k != "rows"}, "c.rows: is missing"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_files(name):
    make, why = BAD[name]
    with pytest.raises(BadFile, match=why):
        read_certificate(make(), "c", walls())


def test_how_large_a_proof_may_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 2 contacts, a joint and an actuator: 13 numbers of each of 6 rows, 9 of each of 5 nodes; 256 bytes."""
    q = pinch([0] * 6, joints=[{"name": "a", "axis": [0, 0, 1], "origin": [0, 1, 0], "moves": [0]}])
    data = proof_to_dict(proof(q=q))
    for name, most, why in (
        ("MAX_CERTIFICATE_NUMBERS", 6 * 13 + 5 * 9, "c.rows: has 5 nodes and 6 rows about 2 contacts, 1.2e"),
        ("MAX_PROOF_BYTES", 256, "c.proof: is of 256 bytes"),
    ):
        monkeypatch.setattr(certificate, name, most)
        assert len(read_certificate(data, "c", q).kind) == 6
        monkeypatch.setattr(certificate, name, most - 1)
        with pytest.raises(BadFile, match=why):
            read_certificate(data, "c", q)
        monkeypatch.undo()


def test_how_many_rows_the_leaves_may_have() -> None:
    """Of 256 that are checked together: 1e8 = 256 x 625^2 numbers, and 4000 rows of one."""
    assert certificate.CHECKED_LEAVES == checker.LEAF_BATCH
    few, full = np.full(1000, 3), np.full(256, 625)
    for rows in ([], [4000], [*full, *few[:0]], [*few, 4000, *few], [*full[:-1], *[600] * 300]):
        certificate._refuse_full_leaves(np.array(rows, dtype=np.int64), "rows")
    for rows, why in (
        (
            [3, 4001, 2],
            r"^rows: has leaves of up to 4001 rows, matrices of 1.6e\+07 numbers; at most 4000 and 1e\+08",
        ),
        ([*full[:-1], *few, 626], r"^rows: has leaves of up to 626 rows, matrices of 1e\+08 numbers; at most"),
    ):
        with pytest.raises(BadFile, match=why):
            certificate._refuse_full_leaves(np.array(rows), "rows")


def test_a_small_text_of_one_leaf_that_takes_much_memory() -> None:
    """5000 rows that are all the same: some hundred characters, a matrix of 5000 x 5000."""
    one, none = np.zeros(5000, np.int64), np.zeros(1, np.int64)
    tree = {"parent": none - 1, "part": none, "state": none, "left": none, "right": none}
    rows = dict.fromkeys(("kind", "index", "a", "b"), one)
    c = Certificate(walls(), None, **tree, **rows, start=np.array([0, 5000]), multiplier=one + 1.0)
    data = proof_to_dict(c)
    assert len(data["proof"]) < 1000
    with pytest.raises(BadFile, match=r"^c\.rows: has leaves of up to 5000 rows"):
        read_certificate(data, "c", walls())


def test_a_proof_of_a_check_needs_no_scalar() -> None:
    data = proof_to_dict(Certificate.of_root(walls(), None))
    assert data.pop("scalar") is None
    assert data["bits"] == 32
    assert read_certificate(data, "", walls()).scalar is None


def test_no_more_is_unpacked_than_the_counts_say(monkeypatch):
    asked = []

    class Stream:
        def __init__(self):
            self.stream = zlib._decompressobj() if hasattr(zlib, "_decompressobj") else original()

        def decompress(self, data, most):
            asked.append(most)
            return self.stream.decompress(data, most)

        def __getattr__(self, name):
            return getattr(self.stream, name)

    original = zlib.decompressobj
    monkeypatch.setattr(certificate.zlib, "decompressobj", Stream)
    read_certificate(proof_to_dict(proof()), "", walls())
    assert asked == [257]  # 4 (5 x 5 + 4 x 6 + 3 + 6) and one more


SHAPES = {
    "empty tree": ({name: [] for name in NODE_ARRAYS}, "parent: is empty"),
    "nodes": ({"state": [0]}, "state: has shape .*; 5 numbers are needed"),
    "rows": ({"a": [0]}, "a: has shape .*; 6 numbers are needed"),
    "table": ({"kind": [[5] * 6]}, "kind: has shape"),
    "multipliers": ({"multiplier": [1.0]}, "multiplier: has shape .*; 6 numbers are needed"),
    "beyond": ({"b": [2**31] * 6}, r"b: has a number beyond 2\^31"),
    "far below": ({"left": [-(2**31) - 1] * 5}, r"left: has a number beyond 2\^31"),
    "no start": ({"start": []}, "start: must rise from 0 to the number of rows, 6"),
    "a table of starts": ({"start": [[0, 1, 2, 6]]}, r"start: has shape \(1, 4\); a row of numbers are needed"),
    "late start": ({"start": [1, 2, 3, 6]}, "start: must rise from 0"),
    "early end": ({"start": [0, 1, 2, 5]}, "start: must rise from 0"),
    "falls": ({"start": [0, 2, 1, 6]}, "start: must rise from 0"),
    "references": ({"references": [[1.0, 2.0]]}, "references: has shape .*; 3 finite numbers each"),
    "no reference": ({"references": [[1.0, 2.0, np.nan]]}, "references: has shape"),
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPES)
def test_bad_arrays(name):
    changed, why = SHAPES[name]
    with pytest.raises(BadFile, match=why):
        Certificate(walls(), None, **(arrays() | changed))


def test_multipliers_are_divided_by_the_largest_of_their_leaf():
    many = Certificate(walls(), None, **(arrays() | {"multiplier": [1e60, 3e-60, 4.0, 2.0, 1.0, 0.0]}))
    assert many.multiplier.tolist() == [1e60, 3e-60, 4.0, 2.0, 1.0, 0.0]
    assert many.rounded().multiplier.tolist() == [1, 1, 1, 0.5, 0.25, 0]
    given = np.array([0.5, 2, 4, 2, 1, 0], dtype=np.float32)
    none = Certificate(walls(), None, **(arrays() | {"multiplier": [0.0] * 6})).rounded()
    assert none.multiplier.tolist() == [0.0] * 6
    assert Certificate(walls(), None, **(arrays() | {"multiplier": [1] * 6})).multiplier.dtype == np.float64
    whole = proof(references=[[1, 2, 3]])
    assert whole.references.dtype == np.float64
    empty: dict[str, list[int]] = {name: [] for name in (*ROW_ARRAYS, "multiplier")}
    assert proof(**empty, start=[0]).rounded().multiplier.tolist() == []  # without leaves
    assert Certificate(walls(), None, **(arrays() | {"multiplier": given})).multiplier.tolist() == given.tolist()
    assert many.leaves.tolist() == [1, 3, 4]
    assert many.claim == "the disturbance is not resisted"
    for name in (*NODE_ARRAYS, *ROW_ARRAYS, "start", "multiplier", "references"):
        assert not getattr(many, name).flags.writeable


def test_a_small_text_that_stands_for_very_much():
    data = file_to_dict(proof_certificates.proof(), QUESTION)
    for name in ("rows", "nodes"):
        with pytest.raises(BadFile, match=r"rows: has .* numbers; at most 1e\+08 are possible"):
            read_certificate_file(data | {name: 10**8}, "")


def test_rounded_multipliers_are_shares_of_the_largest_of_their_leaf() -> None:
    c = proof_certificates.proof()
    y = np.arange(1.0, len(c.multiplier) + 1) / 64
    of_leaf = [y[a:b] / y[a:b].max() for a, b in pairwise(c.start)]
    np.testing.assert_allclose(replace(c, multiplier=y).rounded().multiplier, np.concatenate(of_leaf), rtol=1e-7)


def test_multipliers_have_32_or_64_bits() -> None:
    data = proof_to_dict(proof()) | {"bits": 16}
    with pytest.raises(BadFile, match="bits: is 16; 32 or 64 is needed"):
        read_certificate(data, "", proof().question)
