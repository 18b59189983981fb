"""A certificate: the written proof that no state of the model exists, for anyone to check (`checker.verify`).

It claims: no state of any motion solves (1)-(8) for the question, with the scalar in its range, nor with load and
joint torques that are off by what `tolerance` allows. The proof is a tree of cases. A node is its parent with one part
changed: parts 0 to m-1 are the contacts, m to m+a-1 the actuators. Each leaf lists inequalities that hold in its case
(`rows`), and multipliers >= 0 under which they contradict the equilibrium: Farkas' lemma.

In files the arrays are one text: whole numbers of 32 bits as differences, little-endian, all first bytes first;
multipliers as floating-point numbers of 32 or 64 `bits`, references of 64; all that in a zlib stream, in base64.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handfast.proofs.fields import Array, BadFile, Fields, Integers, numbers
from handfast.proofs.question import LARGEST_GOAL, Question, Range, read_question

SCHEMA = "handfast/certificate/1"
NODE_ARRAYS = ("parent", "part", "state", "left", "right")
ROW_ARRAYS = ("kind", "index", "a", "b")
MAX_PROOF_BYTES = 1 << 28  # bytes of a proof
MAX_CERTIFICATE_NUMBERS = 10**8  # that a certificate stands for: what they take is in proportion
MAX_LEAF_ROWS = 4000  # of one leaf: the time for its matrix grows as their third power
CHECKED_LEAVES = 256  # whose matrices the checker has in memory at a time, as large as a leaf has rows


@dataclass(frozen=True, eq=False)
class Certificate:
    """A claim and its proof; arrays of the tree have one entry per node, node 0 is the root.

    Attributes:
        question: what was asked.
        scalar: no state with the goal's scalar in this range (lo, hi) exists; hi may be infinite. None for a check.
        parent: (N,) the parent of each node, a smaller number; -1 for the root.
        part, state, left, right: (N,) what changed: part, its state, its sector (0, 0 without).
        start: (L+1,) the i-th node that is not split, a leaf, has the rows start[i] to start[i+1].
        kind, index, a, b: (R,) a `rows.Row`, of which contact, actuator, column or reference, and its directions.
        multiplier: (R,) of 32 or 64 bits; see `rounded`.
        references: (K, m+1) normal forces [N] at which the balance of energy has tangents, and the scalar that
            f_c is taken at.

    Raises:
        BadFile: arrays of the wrong shape, a range that is none. Whether the proof is right is for `checker` to say.
    """

    question: Question
    scalar: Range | None
    parent: Integers
    part: Integers
    state: Integers
    left: Integers
    right: Integers
    start: Integers
    kind: Integers
    index: Integers
    a: Integers
    b: Integers
    multiplier: NDArray[np.floating[Any]]
    references: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        put = object.__setattr__
        self._check_scalar()
        sizes = dict.fromkeys(NODE_ARRAYS, np.size(self.parent)) | dict.fromkeys(ROW_ARRAYS, np.size(self.kind))
        for name in (*NODE_ARRAYS, "start", *ROW_ARRAYS):
            put(self, name, _integers(getattr(self, name), sizes.get(name), name))
        s, rows = self.start, len(self.kind)
        if not len(self.parent):
            raise BadFile("is empty; the root at least is needed", "parent")
        if not len(s) or s[0] != 0 or s[-1] != rows or (np.diff(s) < 0).any():
            raise BadFile(f"must rise from 0 to the number of rows, {rows}", "start")
        y = np.array(self.multiplier)
        if y.shape != self.kind.shape:
            raise BadFile(f"has shape {y.shape}; {len(self.kind)} numbers are needed", "multiplier")
        y = y if y.dtype == np.float32 else y.astype(np.float64)
        y.flags.writeable = False
        put(self, "multiplier", y)
        width, references = self.question.grasp.m + 1, np.array(self.references, dtype=np.float64)
        references = references if references.size else np.zeros((0, width))
        if references.shape[1:] != (width,) or not np.isfinite(references).all():
            raise BadFile(f"has shape {references.shape}; {width} finite numbers each are needed", "references")
        references.flags.writeable = False
        put(self, "references", references)

    def _check_scalar(self) -> None:
        if (self.scalar is None) == self.question.has_scalar:
            raise BadFile("is the range of the goal's scalar; null for a check", "scalar")
        if self.scalar is not None:
            lo, hi = (float(x) for x in self.scalar)
            if not (np.isfinite(lo) and lo <= hi) or (lo < 0 and self.question.goal != LARGEST_GOAL):
                raise BadFile(f"is {lo:g} to {hi:g}, not a range that the goal knows", "scalar")
            object.__setattr__(self, "scalar", (lo, hi))

    def rounded(self) -> Certificate:
        """With multipliers over the largest of their leaf, in 32 bits: half as long, and mostly as good."""
        y = np.asarray(self.multiplier, dtype=np.float64)
        most = np.maximum.reduceat(np.append(np.abs(y), 0.0), self.start[:-1]) if len(self.start) > 1 else np.ones(0)
        y = y / np.repeat(np.where(most > 0, most, 1.0), np.diff(self.start))
        return replace(self, multiplier=y.astype(np.float32))

    @classmethod
    def of_root(cls, question: Question, scalar: Range | None) -> Certificate:
        """Without cases and rows: the equilibrium contradicts itself."""
        none, zero, empty = np.zeros(0, np.int64), np.zeros(1, np.int64), np.zeros(0, np.float32)
        start = np.zeros(2, np.int64)
        return cls(question, scalar, zero - 1, zero, zero, zero, zero, start, none, none, none, none, empty)

    @cached_property
    def leaves(self) -> Integers:
        """(L,) the nodes that are not split."""
        split = np.zeros(len(self.parent), dtype=bool)
        split[self.parent[self.parent >= 0]] = True
        return np.flatnonzero(~split)

    @property
    def claim(self) -> str:
        """What it says, in words."""
        return self.question.claim(self.scalar)


def _integers(value: Any, size: int | None, name: str) -> Integers:
    out = np.array(value, dtype=np.int64)
    if out.ndim != 1 or (size is not None and len(out) != size):
        raise BadFile(f"has shape {out.shape}; {'a row of' if size is None else size} numbers are needed", name)
    if ((out < -(2**31)) | (out >= 2**31)).any():
        raise BadFile("has a number beyond 2^31", name)
    out.flags.writeable = False
    return out


# --- files ------------------------------------------------------------------------------------------


def proof_to_dict(c: Certificate) -> dict[str, Any]:
    """The certificate but for its question, as it stands in files."""
    columns = [getattr(c, name) for name in (*NODE_ARRAYS, *ROW_ARRAYS)] + [np.diff(c.start)]
    multipliers = _planes(c.multiplier)
    packed = b"".join([*(_shuffled(x) for x in columns), multipliers, c.references.astype("<f8").tobytes()])
    return {
        "scalar": None if c.scalar is None else [x if np.isfinite(x) else None for x in c.scalar],
        "nodes": len(c.parent),
        "leaves": len(c.start) - 1,
        "rows": len(c.kind),
        "references": len(c.references),
        "bits": 8 * c.multiplier.dtype.itemsize,
        "proof": base64.b64encode(zlib.compress(packed, 6)).decode("ascii"),
    }


def file_to_dict(c: Certificate, question: Mapping[str, Any]) -> dict[str, Any]:
    """The certificate as a `handfast/certificate/1` object, its question as `question.read_question` reads it."""
    return {"schema": SCHEMA, "question": dict(question), **proof_to_dict(c)}


def read_certificate_file(data: Any, place: str = "") -> Certificate:
    """A parsed `handfast/certificate/1` object. Raises `BadFile`: the field, and what is wrong."""
    f = Fields(data, place)
    f.text("schema", among=[SCHEMA])
    question = read_question(f.take("question"), f.at("question"))
    return _read(f, question)


def read_certificate(data: Any, place: str, question: Question) -> Certificate:
    """What `proof_to_dict` wrote, about a question. Raises `BadFile`: the field, and what is wrong."""
    return _read(Fields(data, place), question)


def _read(f: Fields, question: Question) -> Certificate:
    scalar = f.take("scalar", None)
    if scalar is not None:
        if not isinstance(scalar, list) or len(scalar) != 2:
            raise BadFile("is no range; two numbers are needed, the second may be null", f.at("scalar"))
        lo = numbers(scalar[:1], (1,), f.at("scalar"))[0]
        hi = np.inf if scalar[1] is None else numbers(scalar[1:], (1,), f.at("scalar"))[0]
        scalar = float(lo), float(hi)
    N, L, R, K = (f.whole(name) for name in ("nodes", "leaves", "rows", "references"))
    width = question.grasp.m + 1
    bits = f.whole("bits")
    if bits not in (32, 64):
        raise BadFile(f"is {bits}; 32 or 64 is needed", f.at("bits"))
    g = question.grasp
    unpacked = R * (6 + g.l + 3 * g.m) + 3 * N * (g.m + g.a)
    if unpacked > MAX_CERTIFICATE_NUMBERS:
        problem = f"has {N} nodes and {R} rows about {g.m} contacts, {unpacked:.2g} numbers"
        raise BadFile(f"{problem}; at most {MAX_CERTIFICATE_NUMBERS:.2g} are possible", f.at("rows"))
    long = bits // 8
    size = 4 * (len(NODE_ARRAYS) * N + len(ROW_ARRAYS) * R + L) + long * R + 8 * K * width
    packed = _unpacked(f.text("proof"), size, f.at("proof"))
    f.done()
    ends = np.cumsum(
        [0, *[4 * N] * len(NODE_ARRAYS), *[4 * R] * len(ROW_ARRAYS), 4 * L, long * R, 8 * K * width]
    ).tolist()
    *whole, y, x = (packed[i:j] for i, j in pairwise(ends))
    *columns, counts = (_unshuffled(part) for part in whole)
    _refuse_full_leaves(counts, f.at("rows"))
    try:
        return Certificate(
            question=question,
            scalar=scalar,
            **dict(zip((*NODE_ARRAYS, *ROW_ARRAYS), columns, strict=True)),
            start=np.concatenate([[0], np.cumsum(counts)]),
            multiplier=_joined(y, long).view(f"<f{long}")[:, 0].astype(f"f{long}"),
            references=np.frombuffer(x, "<f8").reshape(K, width),
        )
    except BadFile as fault:
        raise BadFile(fault.problem, f.at(fault.field)) from None


def _refuse_full_leaves(rows: Integers, field_: str) -> None:
    """`BadFile` for numbers of rows (L,) of which leaves that are checked together have too many."""
    most = np.sort(np.maximum(rows, 0))[-CHECKED_LEAVES:].astype(np.float64)
    largest, padded = most.max(initial=0.0), float((most**2).sum())
    if largest > MAX_LEAF_ROWS or padded > MAX_CERTIFICATE_NUMBERS:
        problem = f"has leaves of up to {largest:.0f} rows, matrices of {padded:.2g} numbers"
        raise BadFile(f"{problem}; at most {MAX_LEAF_ROWS} and {MAX_CERTIFICATE_NUMBERS:.2g} are possible", field_)


def _unpacked(text: str, size: int, field_: str) -> bytes:
    """The bytes in a text, exactly so many; no more are unpacked."""
    if size > MAX_PROOF_BYTES:
        raise BadFile(
            f"is of {size} bytes by its numbers of nodes and rows; at most {MAX_PROOF_BYTES} are possible", field_
        )
    try:
        stream = zlib.decompressobj()
        out = stream.decompress(base64.b64decode(text, validate=True), size + 1)
    except (binascii.Error, zlib.error, ValueError) as fault:
        raise BadFile(f"is no zlib stream in base64: {fault}", field_) from None
    if len(out) != size or not stream.eof or stream.unused_data:
        raise BadFile(f"is not of the {size} bytes that its numbers of nodes, leaves and rows need", field_)
    return out


def _planes(x: NDArray[Any]) -> bytes:
    """Numbers, little-endian: all first bytes, all second ones and so on."""
    every = np.ascontiguousarray(x.astype(x.dtype.newbyteorder("<"))).view(np.uint8)
    return every.reshape(-1, x.dtype.itemsize).T.tobytes()


def _joined(data: bytes, long: int) -> NDArray[np.uint8]:
    """(n, long) bytes of numbers, from what `_planes` wrote."""
    return np.frombuffer(data, np.uint8).reshape(long, -1).T.copy()


def _shuffled(x: Integers) -> bytes:
    return _planes(np.diff(x, prepend=0).astype(np.uint32))  # differences of numbers of 32 bits, modulo 2^32


def _unshuffled(data: bytes) -> Integers:
    differences = _joined(data, 4).view("<u4")[:, 0]
    return np.cumsum(differences, dtype=np.uint32).astype(np.int32).astype(np.int64)
