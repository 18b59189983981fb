"""Files of arrays as plain data: `.npy`, `.npz`, `.pt` and `.pth`, `.pkl`; nothing that a file names is called.

Memory and time are not limited here; `read_published` does that."""

from __future__ import annotations

import io
import pickletools
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from handfast.core.errors import InputError
from handfast.datasets.published.plain_pickle import (
    STORAGES,
    StorageId,
    checked_shape,
    from_bytes,
    plain_dtype,
    read_pickle,
)

MAX_ARRAY_BYTES = 2**31  # [bytes] of a file, and of what is packed in one
PACKED, SMALL_ARCHIVE = 100, 2**26  # times as much may be in a zip file as it has bytes, beyond [bytes] what is small
# the same of a pickle in it, whose bytes make objects; torch does not pack it at all
MAX_PICKLE_RATIO, SHORT_PICKLE = 20, 2**20
MAX_NPY_HEADER = 10_000  # characters of an .npy header
LEGACY = 0x1950A86A20F9469CFC6C  # with this number the torch files of the time before zip begin


def read_array_file(path: Path) -> Any:
    """Plain data of a file by its first bytes: an array, a dictionary of arrays, or what a pickle holds.

    Raises:
        InputError: no such file, too large, cut short, another format, a name in a pickle that is not admitted.
            One line that names the file.
    """
    try:
        if path.stat().st_size > MAX_ARRAY_BYTES:
            raise InputError(f"is larger than {MAX_ARRAY_BYTES} bytes; split it")
        data = path.read_bytes()
        if data.startswith(npy.MAGIC_PREFIX):
            return read_npy(data)
        if data.startswith(b"PK"):
            return _read_zip(data)
        return _bare_pickle(data)
    except InputError as fault:
        raise fault.at(str(path)) from None
    except OSError as fault:
        raise InputError(f"cannot be read: {fault.strerror}", source=str(path)) from None


def read_npy(data: bytes) -> Any:
    """The array of an `.npy` file; a single object is taken out of its array."""
    stream = io.BytesIO(data)
    try:
        version = npy.read_magic(stream)
        read = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}[version]
        shape, columns, dtype = read(stream, max_header_size=MAX_NPY_HEADER)
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError, MemoryError) as fault:
        raise InputError(f"has a broken npy header ({' '.join(str(fault).split())[:60]})") from None
    checked_shape(shape)
    if dtype.fields is not None or dtype.subdtype is not None:
        raise InputError("has an array of records; plain numbers are needed")
    plain_dtype(dtype.str)
    rest = data[stream.tell() :]
    if dtype.kind != "O":
        return from_bytes(rest, dtype, shape, "F" if columns else "C")
    found = read_pickle(rest)
    if not isinstance(found, np.ndarray) or found.shape != shape:
        raise InputError(f"has a header that says {shape}; its contents are not of that shape")
    return found.item() if not shape else found


def _read_zip(data: bytes) -> Any:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            names = packed.namelist()
            unpacked = sum(packed.getinfo(name).file_size for name in names)
            if unpacked > min(MAX_ARRAY_BYTES, SMALL_ARCHIVE + PACKED * len(data)):
                raise InputError(
                    f"unpacks to {unpacked} bytes; at most {PACKED} times its size, and {MAX_ARRAY_BYTES}, are read"
                )
            pickles = [name for name in names if name.rpartition("/")[2] == "data.pkl"]
            if len(pickles) == 1:
                return _read_torch(packed, pickles[0])
            if names and all(name.endswith(".npy") for name in names):
                return {name.removesuffix(".npy"): read_npy(packed.read(name)) for name in names}
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError, ValueError, KeyError) as fault:
        if isinstance(fault, InputError):
            raise
        raise InputError(f"is no whole zip file ({' '.join(str(fault).split())[:60]})") from None
    except Exception as fault:  # a decompressor's own errors have no common base
        raise InputError(f"cannot be unpacked ({type(fault).__name__})") from None
    raise InputError("is a zip file, but neither of arrays (npz) nor of torch")


def _read_torch(packed: zipfile.ZipFile, pickled: str) -> Any:
    """A zip of torch: `data.pkl`, and beside it one file of raw numbers for each storage."""
    folder = pickled.removesuffix("data.pkl")
    if f"{folder}byteorder" in packed.namelist() and packed.read(f"{folder}byteorder") != b"little":
        raise InputError("holds tensors in big-endian order, which is not understood; save it on another machine")
    seen: dict[str, NDArray[Any]] = {}

    def storage(key: StorageId) -> NDArray[Any]:
        if key.file not in seen:
            try:
                raw = packed.read(f"{folder}data/{key.file}")
            except KeyError:
                raise InputError(f"has no file data/{key.file[:20]}, which one of its tensors needs") from None
            dtype = np.dtype(STORAGES[key.type])
            numbers = from_bytes(raw, dtype, (len(raw) // dtype.itemsize,))
            if key.type == "BFloat16Storage":  # the upper halves of 32 bit numbers
                numbers = (numbers.astype("<u4") << 16).view("<f4")
            seen[key.file] = numbers
        if key.count > len(seen[key.file]):
            raise InputError(f"has a storage of {key.count} numbers in a file of {len(seen[key.file])}")
        return seen[key.file][: key.count]

    program = packed.getinfo(pickled)
    if program.file_size > SHORT_PICKLE + MAX_PICKLE_RATIO * program.compress_size:
        raise InputError(
            f"has a data.pkl that is packed more than {MAX_PICKLE_RATIO} to 1; save it with torch, which packs none"
        )
    return read_pickle(packed.read(pickled), storage)


def _bare_pickle(data: bytes) -> Any:
    try:
        first = next((arg for code, arg, _ in pickletools.genops(data) if code.name.startswith("LONG")), None)
    except ValueError:
        first = None
    if first == LEGACY and data[:2] in (b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05"):
        raise InputError("is a torch file of before version 1.6; load it in torch and save it again")
    return read_pickle(data)
