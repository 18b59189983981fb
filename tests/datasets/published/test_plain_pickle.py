"""Pickles: plain data of every protocol come back as they were; what names or does anything else is refused."""

from __future__ import annotations

import builtins
import os
import pickle
import random
import sys
from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast.core import limited
from handfast.core.errors import InputError
from handfast.datasets.published import published_file
from handfast.datasets.published.plain_pickle import read_pickle
from handfast.datasets.published.published_file import read_published, sources
from handfast.datasets.published.recorded import BrokenRow, RecordedGrasp
from tests.support.published import dexgraspnet_row, saved_npy


class Calls:
    """Pickled, it asks its reader to call something."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self.function, self.arguments = function, arguments

    def __reduce__(self) -> Any:
        return self.function, self.arguments


def _name(module: str, name: str) -> bytes:
    return f"c{module}\n{name}\n".encode()


FULL = b"(J\x01\x00\x00\x00\x85" + _name("numpy", "dtype") + b"(S'u1'\ntR\x89S'x'\nt"  # the state of an array
PLAIN = {
    "values": [1, -2.5, None, True, "é", b"\x00\xff", 2**70, 1j],
    "containers": ((), (1, [2]), {3}, frozenset("a"), OrderedDict(a=1), bytearray(b"xy")),
    "numbers": np.arange(6.0).reshape(2, 3),
    "columns": np.asfortranarray(np.arange(6).reshape(2, 3)),
    "other": [np.array(["a", "bc"]), np.array([True]), np.arange(3, dtype=">i4"), np.float32(1.5), np.array(2.0)],
    "objects": np.array([{"q": np.arange(3)}, [1, 2]], dtype=object),
}


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_plain_data_of_every_protocol(protocol: int) -> None:
    found = read_pickle(pickle.dumps(PLAIN, protocol) + b"rest")
    assert found["values"] == PLAIN["values"]
    assert found["containers"] == PLAIN["containers"]
    for key in ("numbers", "columns"):
        assert found[key].tolist() == PLAIN[key].tolist()  # type: ignore[attr-defined]
    texts, truths, big, scalar, single = found["other"]
    assert (texts.tolist(), truths.tolist(), big.tolist(), scalar) == (["a", "bc"], [True], [0, 1, 2], 1.5)
    assert single.shape == ()
    assert found["objects"][0]["q"].tolist() == [0, 1, 2]


def called(tmp_path: Path) -> list[tuple[Calls, str]]:
    mark = str(tmp_path / "mark")
    return [
        (Calls(os.system, f"touch {mark}"), "system"),
        (Calls(builtins.eval, f"open({mark!r}, 'w')"), "eval"),
        (Calls(getattr, 1, "real"), "getattr"),
        (Calls(np.load, mark, None, True), "load"),
        (Calls(open, mark, "w"), "open"),
        (Calls(__import__, "os"), "__import__"),
    ]


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_what_calls_something_is_refused_by_name_and_not_run(protocol: int, tmp_path: Path) -> None:
    for thing, name in called(tmp_path):
        with pytest.raises(InputError, match=rf"names \S+\.{name}, which is no plain .* nothing of the file was run"):
            read_pickle(pickle.dumps({"a": [thing]}, protocol))
    assert not (tmp_path / "mark").exists()


@pytest.mark.parametrize(
    "data, says",
    [
        (b"(S'id'\nios\nsystem\n.", "names os.system"),
        (b"(cos\nsystem\nS'id'\no.", "names os.system"),
        (b"\x82\x01.", "no whole pickle .*extension code"),
        (b"cnumpy\nndarray\n(I1000000000\ntR.", "calls numpy.ndarray"),
        (b"\x80\x04\x8c\x05numpy\x8c\x0endarray.tofile\x93.", "names numpy.ndarray.tofile"),
        (b"}(S'a'\nI1\nd}(S'x'\nI1\ndb.", "no whole pickle"),
        (b"cnumpy\ndtype\n(S'V8'\ntR.", "type 'V8'"),
        (b"S'a'\nQ.", "persistent id"),
        (b"", "no whole pickle"),
        (b"(.", "no whole pickle"),
        (b"a.", "no whole pickle"),
        (b"h\x05.", "no whole pickle"),
        (b"}(lNs.", "no whole pickle"),
        (b"cnumpy\nndarray\n)\x81.", "no whole pickle .*NEWOBJ"),  # what an admitted name is can only be called,
        (b"cnumpy\nndarray\n(S'a'\nI1\ndb.", "inner state"),  # not altered
        (b"ctorch\nFloatStorage\nN(S'name'\nI1\nd\x86b.", "inner state"),
        (
            _name("numpy._core.multiarray", "_reconstruct") + b"(tRq\x00" + FULL + b"bh\x00" + FULL + b"b.",
            "filled twice",
        ),
        (b"cbuiltins\nbytearray\n(I99999999999999\ntR.", "contents of a bytearray"),
    ],
)
def test_programs_that_no_plain_data_need(data: bytes, says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_pickle(data)


def test_bytes_and_ordered_dictionaries_as_older_versions_wrote_them() -> None:
    """Texts with their encoding for bytes, a list of pairs for a dictionary."""
    array = b"c__builtin__\nbytearray\n(X\x02\x00\x00\x00\xc3\xa9X\x07\x00\x00\x00latin-1tR."
    assert read_pickle(b"\x80\x02" + array) == b"\xe9"
    ordered = b"\x80\x02ccollections\nOrderedDict\n]"
    assert read_pickle(ordered + b"](K\x01K\x02ea\x85R.") == {1: 2}
    for pair in (b"](K\x01K\x02K\x03ea", b"]K\x01aa", b"X\x02\x00\x00\x00aba", b"K\x01a"):
        with pytest.raises(InputError):
            read_pickle(ordered + pair + b"\x85R.")


def test_shapes_that_lie() -> None:
    told = pickle.dumps(np.arange(4.0), 2)
    for shape in (b"K\x05\x85", b"\x8a\x08" + (2**60).to_bytes(8, "little") + b"\x85", b"J\xff\xff\xff\xff\x85"):
        with pytest.raises(InputError, match="has an array"):
            read_pickle(told.replace(b"K\x04\x85", shape))
    objects = pickle.dumps(np.array([1, None], dtype=object), 2)
    with pytest.raises(InputError, match="array of objects whose shape"):
        read_pickle(objects.replace(b"K\x02\x85", b"K\x09\x85"))


def test_broken_bytes_are_one_kind_of_fault() -> None:
    whole, rng = pickle.dumps(PLAIN, 4), random.Random(0)
    refused = 0
    for _ in range(500):
        data = bytearray(whole)
        for _ in range(rng.randint(1, 4)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        try:
            read_pickle(bytes(data[: rng.choice([len(data), rng.randrange(len(data))])]))
        except InputError:
            refused += 1
    assert refused > 250


def _shared(deep: int) -> bytes:
    """A tuple of a tuple twice, and so on: its hash and its text never end."""
    return b")" + b"2\x86" * deep


def _many_arrays(count: int, size: int, kind: str, contents: bytes) -> bytes:
    """Arrays that all have the same contents."""
    start = _name("numpy", "dtype") + b"(" + b"\x8c" + bytes([len(kind)]) + kind.encode() + b"tRq\x000"
    shape = b"J" + size.to_bytes(4, "little") + b"\x85"
    one = _name("numpy.core.multiarray", "_reconstruct") + b"(tR(" + shape + b"h\x00\x89h\x01tb"
    return b"\x80\x04" + start + contents + b"q\x010(" + one * count + b"l."


def laughs() -> list[Any]:
    """A list of ten lists of ten lists and so on: whoever walks through it has no end."""
    found: list[Any] = []
    for _ in range(60):
        found = [found] * 10
    return found


BOMBS = {
    "a set of a deep tuple": _name("builtins", "set") + b"((" + b")" + b"\x85" * 300_000 + b"ltR.",
    "a set of a shared tuple": _name("builtins", "set") + b"((" + _shared(40) + b"ltR.",
    "a frozen set of a shared tuple": _name("builtins", "frozenset") + b"((" + _shared(40) + b"ltR.",
    "a dictionary of a shared tuple": _name("collections", "OrderedDict") + b"(((" + _shared(40) + b"NlltR.",
    "a name that is a shared tuple": _shared(40) + b"\x8c\x01x\x93.",
    "a type that is a shared tuple": _name("numpy", "dtype") + b"(" + _shared(40) + b"tR.",
    "a complex number of a shared tuple": _name("builtins", "complex") + b"(" + _shared(40) + b"tR.",
    "keys of one hash": b"}("
    + b"".join(b"\x8a\x0c" + ((2**61 - 1) * k).to_bytes(12, "little") + b"N" for k in range(1, 20_000))
    + b"u.",
    "a dictionary's key that is a deep tuple": b"}" + b")" + b"\x85" * 300_000 + b"Ns.",
    "a far place of the memo": b"Nr\xff\xff\xff\x7f.",
    "lists that are shared": pickle.dumps(laughs())[2:],
    "a list of itself": b"]q\x00h\x00a.",
    "lists": b"(" + b"]" * 1_000_000 + b"l.",
    "dictionaries": b"(" + b"}" * 1_000_000 + b"l.",
    "arrays that have the same contents": _many_arrays(
        1100, 2**20, "u1", b"X" + (2**20).to_bytes(4, "little") + b"a" * 2**20
    ),
    "arrays that have the same objects": _many_arrays(200, 2**17, "O", b"(" + b"N" * 2**17 + b"l"),
}


@pytest.fixture
def limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small ones, so that they are met soon."""
    monkeypatch.setattr(published_file, "EXTRA_MEMORY", 2**24)  # [bytes]
    monkeypatch.setattr(published_file, "MEMORY_A_BYTE", 0)
    monkeypatch.setattr(published_file, "CPU_SECONDS", 1)


ENDLESS = {
    "a frozen set of a shared tuple",
    "a dictionary of a shared tuple",
    "keys of one hash",
    "lists that are shared",
}
ON_LINUX = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the system keeps no limit of memory")


@ON_LINUX
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in ENDLESS else n for n in BOMBS])
def test_small_files_that_would_take_all_memory_time_or_the_stack(
    name: str, limits: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name in ENDLESS:  # as "a set of a shared tuple" is, which the limit of processor time ends
        monkeypatch.setattr(limited, "CLOCK_FACTOR", 0.1)
    bomb = tmp_path / "bomb.pkl"
    bomb.write_bytes(b"\x80\x04" + BOMBS[name])
    says = "takes more than|is not done after|ends its process|no whole pickle|no known layout|of type a tuple"
    with pytest.raises(InputError, match=rf"bomb\.pkl: .*({says})"):
        read_published(bomb)


@ON_LINUX
def test_a_file_that_ends_its_process_leaves_those_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(published_file, "EXTRA_MEMORY", 2**24)  # [bytes]
    monkeypatch.setattr(published_file, "MEMORY_A_BYTE", 0)
    bomb, fair = tmp_path / "bomb.pkl", saved_npy(tmp_path / "cube.npy", np.array([dexgraspnet_row()], dtype=object))
    # 1.1 GB: what a process has set free before it forks is used again, and does not count
    bomb.write_bytes(b"\x80\x04" + BOMBS["arrays that have the same contents"])
    said, read = (found.row for found in sources([bomb, fair]))
    assert isinstance(read, RecordedGrasp)
    assert isinstance(said, BrokenRow)
    assert "takes more than" in said.reason


def test_what_no_layout_can_use_is_refused_there(tmp_path: Path) -> None:
    file = tmp_path / "a.pkl"
    for data in (
        b"cnumpy\ndtype\n.",
        _name("numpy._core.multiarray", "_reconstruct") + b"(tR.",
        b"(" * 200 + b"]" + b"t" * 200 + b".",
    ):
        file.write_bytes(data)
        with pytest.raises(InputError, match=r"a\.pkl: is of no known layout"):
            read_published(file)


def test_contents_that_are_shared_by_arrays_are_theirs() -> None:
    text = b"X" + (16).to_bytes(4, "little") + b"a" * 16
    assert [a.tolist() for a in read_pickle(_many_arrays(3, 16, "u1", text))] == [[97] * 16] * 3
    few = [0] * 10
    found = read_pickle(pickle.dumps([few] * 10))
    assert found[0] is found[9]  # what is shared stays shared


def test_objects_are_written_row_by_row_in_columns_too() -> None:
    made = np.empty((2, 3), dtype=object, order="F")
    made[:] = [[1, 2, 3], [4, 5, [6]]]
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
        assert read_pickle(pickle.dumps(made, protocol)).tolist() == made.tolist()


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_empty_arrays_and_bytes(protocol: int) -> None:
    found = read_pickle(pickle.dumps([np.zeros((0, 3)), b""], protocol))
    assert found[0].shape == (0, 3)
    assert found[1] == b""
