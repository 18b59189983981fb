"""Arrays that take long to compute, kept in the user's folder under the digest of what they were computed from.

The folder has at most `MAX_KEPT_FILES` files. Nothing is found, or kept, where others could have put a file
(`trusted.py`).
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from handfast.core.arrays import Array
from handfast.core.trusted import exposed, user_cache

MAX_KEPT_FILES = 300
SEAL = 32  # bytes at the end of a file: the SHA-256 of those before. An archive that is damaged may lack a part


def digest(what: str, *arrays: np.ndarray) -> str:
    """The name of what is computed from arrays by a method that `what` describes, its version included."""
    out = hashlib.sha256(what.encode())
    for a in arrays:
        out.update(f"{a.dtype.str}{a.shape}".encode() + np.ascontiguousarray(a).tobytes())
    return out.hexdigest()


def recalled(name: str) -> list[Array] | None:
    """The arrays kept under a name; None if there are none, or the file is damaged."""
    with suppress(OSError):
        path = _folder() / f"{name}.npz"
        if exposed(path) is None:
            data = path.read_bytes()
            data, seal = data[:-SEAL], data[-SEAL:]
            if hashlib.sha256(data).digest() == seal:
                with np.load(io.BytesIO(data), allow_pickle=False) as held:
                    return [held[f"arr_{i}"] for i in range(len(held.files))]
    return None


def keep(name: str, arrays: Sequence[Array]) -> None:
    """Keep arrays under a name, whoever else keeps them; beyond `MAX_KEPT_FILES` files those that are oldest go."""
    folder, data = _folder(), io.BytesIO()
    np.savez_compressed(data, *arrays)
    with suppress(OSError):  # not ours to write to
        folder.mkdir(mode=0o755, parents=True, exist_ok=True)
        if exposed(folder) is None:
            draft = folder / f"{name}.{os.getpid()}"
            draft.write_bytes(data.getvalue() + hashlib.sha256(data.getvalue()).digest())
            draft.replace(folder / f"{name}.npz")
            for old in sorted(folder.iterdir(), key=os.path.getmtime)[
                :-MAX_KEPT_FILES
            ]:  # drafts that were left over, too
                old.unlink(missing_ok=True)


def _folder() -> Path:
    return user_cache() / "pieces"
