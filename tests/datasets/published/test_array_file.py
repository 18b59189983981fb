"""Files of arrays: npy, npz and torch's zip, whole and broken."""

from __future__ import annotations

import io
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.datasets.published.array_file import LEGACY, read_array_file, read_npy
from tests.support.published import torch_file


def npy(data: Any) -> bytes:
    out = io.BytesIO()
    np.save(out, data, allow_pickle=True)
    return out.getvalue()


def test_npy_as_numpy_reads_it() -> None:
    for data in (np.arange(6.0).reshape(2, 3), np.asfortranarray(np.eye(3)), np.array(["a", "bc"])):
        assert read_npy(npy(data)).tolist() == data.tolist()
    assert read_npy(npy(np.array({"a": 1}, dtype=object))) == {"a": 1}
    rows = read_npy(npy(np.array([{"a": np.float64(2)}, None], dtype=object)))
    assert rows.tolist() == [{"a": 2.0}, None]


@pytest.mark.parametrize(
    "data, old, new, says",
    [
        (np.arange(6.0), b"(6,)", b"(9,)", "array of 9 of 8 bytes with 48 bytes"),
        (np.arange(6.0), b"<f8", b"|V8", "type '.V8'"),
        (np.arange(6.0), b"(6,), }   ", b"(os.abc,)}", "broken npy header"),
        (np.array([1, None], dtype=object), b"(2,)", b"(3,)", "header that says"),
        (np.array([1, None], dtype=object), b"|O", b"<q", "array of 2 of 8 bytes|broken npy header"),
    ],
)
def test_npy_headers_that_lie(data: Any, old: bytes, new: bytes, says: str) -> None:
    told = npy(data)
    assert old in told
    with pytest.raises(InputError, match=says):
        read_npy(told.replace(old, new))


def test_cut_anywhere(tmp_path: Path) -> None:
    file = tmp_path / "x.pt"
    wholes = npy(np.array({"a": np.arange(3)}, dtype=object)), torch_file(file, {"a": np.ones(3)}).read_bytes()
    for whole in wholes:
        for end in range(0, len(whole) - 1, 7):
            file.write_bytes(whole[:end])
            with pytest.raises(InputError, match=r"x\.pt: "):
                read_array_file(file)


def test_torch_without_torch(tmp_path: Path) -> None:
    data = {"q": np.arange(6).reshape(2, 3), "names": ["a", "b"], "nested": [(np.array([0.5]), "set+x")]}
    found = read_array_file(torch_file(tmp_path / "x.pt", data))
    assert found["q"].tolist() == [[0, 1, 2], [3, 4, 5]]
    assert found["nested"][0][0].tolist() == [0.5]
    assert found["names"] == ["a", "b"]


@pytest.mark.parametrize(
    ("kind", "raw", "values"),
    [
        (b"BFloat16Storage", b"\x80\x3f\x20\xc0\x40\x3e", [1.0, -2.5, 0.1875]),  # the upper halves of 4 bytes each
        (b"HalfStorage", b"\x00\x3c\x00\xc1\x00\x32", [1.0, -2.5, 0.1875]),
        (b"DoubleStorage", np.array([1.0, -2.5, 0.1]).tobytes(), [1.0, -2.5, 0.1]),
        (b"ShortStorage", b"\x01\x00\xff\xff\x00\x01", [1, -1, 256]),
    ],
)
def test_numbers_of_torch_storages(kind: bytes, raw: bytes, values: list[float], tmp_path: Path) -> None:
    file = torch_file(tmp_path / "x.pt", [np.arange(3)])
    altered(file, "archive/data.pkl", lambda text: text.replace(b"FloatStorage", kind))
    (found,) = read_array_file(altered(file, "archive/data/0", lambda _: raw))
    assert found.tolist() == values


def altered(path: Path, name: str, change: Any) -> Path:
    """The zip with one of its files changed, or left out."""
    with zipfile.ZipFile(path) as packed:
        files = {n: packed.read(n) for n in packed.namelist()}
    files[name] = change(files[name])
    with zipfile.ZipFile(path, "w") as packed:
        for n, data in files.items():
            if data is not None:
                packed.writestr(n, data)
    return path


@pytest.mark.parametrize(
    "name, change, says",
    [
        ("archive/data/0", lambda raw: None, "has no file data/0"),
        ("archive/data/0", lambda raw: raw[:8], "storage of 6 numbers in a file of 2"),
        ("archive/data.pkl", lambda raw: raw.replace(b"K\x02K\x03\x86", b"K\x09K\x09\x86"), "larger than its contents"),
        ("archive/data.pkl", lambda raw: raw.replace(b"FloatStorage", b"EvilStorage!"), "names torch.EvilStorage!"),
        ("archive/data.pkl", lambda raw: pickle.dumps(print), "names builtins.print"),
        ("archive/byteorder", lambda raw: b"big", "big-endian"),
    ],
)
def test_torch_files_that_lie(name: str, change: Any, says: str, tmp_path: Path) -> None:
    file = torch_file(tmp_path / "x.pt", {"q": np.arange(6).reshape(2, 3)})
    with pytest.raises(InputError, match=says):
        read_array_file(altered(file, name, change))


def packed_file(path: Path, **files: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, data in files.items():
            packed.writestr(name, data)
    return path


def test_a_pickle_that_is_packed_too_well_is_not_unpacked(tmp_path: Path) -> None:
    bomb = packed_file(tmp_path / "x.pt", **{"archive/data.pkl": b"\x80\x02" + b"]" * 19_000_000 + b"."})
    assert bomb.stat().st_size < 20_000
    with pytest.raises(InputError, match=r"x\.pt: has a data\.pkl that is packed more than 20 to 1"):
        read_array_file(bomb)
    names = [f"grasp {k}" for k in range(1000)]
    fair = packed_file(tmp_path / "y.pt", **{"archive/data.pkl": pickle.dumps(names, 2)})
    assert read_array_file(fair) == names  # packed, but no bomb


def test_arrays_that_are_packed_too_well_are_not_unpacked(tmp_path: Path) -> None:
    bomb = packed_file(tmp_path / "x.npz", **{f"{k}.npy": npy(np.zeros(2**22)) for k in range(3)})  # 96 MiB
    with pytest.raises(InputError, match=r"x\.npz: unpacks to \d+ bytes; at most 100 times its size"):
        read_array_file(bomb)
    fair = packed_file(tmp_path / "y.npz", **{"a.npy": npy(np.zeros(2**22))})  # 32 MiB of zeros
    assert read_array_file(fair)["a"].shape == (2**22,)


def test_other_zips_and_legacy_torch(tmp_path: Path) -> None:
    file = tmp_path / "x.npz"
    np.savez_compressed(file, a=np.eye(2), b=np.array([1]))
    assert {k: v.tolist() for k, v in read_array_file(file).items()} == {"a": [[1, 0], [0, 1]], "b": [1]}
    with zipfile.ZipFile(file, "w") as packed:
        packed.writestr("readme.txt", "hello")
    with pytest.raises(InputError, match="neither of arrays"):
        read_array_file(file)
    file.write_bytes(pickle.dumps(LEGACY, 2) + pickle.dumps(1001, 2))
    with pytest.raises(InputError, match=r"torch file of before version 1\.6"):
        read_array_file(file)
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_array_file(tmp_path / "none.npy")
