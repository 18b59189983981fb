"""Arrays: the types of their annotations, read-only copies of what came from outside, products of many at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handfast.core.errors import InputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
_FLOAT = np.dtype(float)


def frozen(a: object, shape: tuple[int, ...], field: str) -> Array:
    """A read-only float copy of `a` in the given shape; `InputError` on NaN, what is not real, or a wrong shape."""
    try:
        if getattr(a, "dtype", None) is not _FLOAT and np.iscomplexobj(a):  # type: ignore[arg-type]
            raise TypeError
        out = np.array(a, dtype=float)
    except (TypeError, ValueError):
        raise InputError("must be numbers", field=field) from None
    if out.shape != shape:
        if out.size == 0 and 0 in shape:
            out = out.reshape(shape)
        else:
            raise InputError(f"has shape {out.shape}, needs {shape}", field=field)
    if not np.isfinite(out).all():
        raise InputError("contains NaN or infinity; finite numbers are needed", field=field)
    out.flags.writeable = False
    return out


def transposed(M: Array) -> Array:
    """(..., n, r) of (..., r, n)."""
    return M.swapaxes(-1, -2)


def times(M: Array, x: Array) -> Array:
    """(..., r) M x of vectors x (..., n): one matrix (r, n) for all of them, or (k, r, n), one for each of (k, n)."""
    out: Array = x @ M.T if M.ndim == 2 else (M @ x[..., None])[..., 0]
    return out


def transposed_times(M: Array, x: Array) -> Array:
    """(..., n) M^T x of vectors x (..., r), see `times`."""
    out: Array = x @ M if M.ndim == 2 else (x[..., None, :] @ M)[..., 0, :]
    return out
