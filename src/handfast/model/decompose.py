"""Convex pieces of a solid that is not convex, by CoACD, within limits.

On a surface that cuts itself CoACD may come to no end, or end the process that it runs in.
"""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.interrupts import deferred_interrupt
from handfast.core.limited import limited
from handfast.core.parallel import default_jobs
from handfast.model.shape import Faces

SECONDS, MEMORY = 300, 4 << 30  # [bytes]; solids of a hundred thousand triangles take a minute


def decompose(vertices: Array, faces: Faces) -> list[Array]:
    """Vertices of convex pieces that together approximate a solid, with a fixed seed.

    Raises:
        InputError: it cannot be done within `SECONDS` and `MEMORY`.
    """
    limits = {"memory": MEMORY, "seconds": SECONDS, "threads": default_jobs()}
    try:  # its threads (OpenMP) do not work in a forked process
        return limited(_pieces, vertices, faces, new=True, **limits)
    except InputError as fault:
        problem = "cannot be taken apart into convex pieces; is its surface closed, and does not cut itself?"
        raise InputError(f"{problem} (CoACD {fault.problem})") from None


def _pieces(vertices: Array, faces: Faces) -> list[Array]:
    with deferred_interrupt():
        import coacd  # slow to import

    coacd.set_log_level("off")
    parts = coacd.run_coacd(coacd.Mesh(vertices, faces), threshold=0.05, seed=0)
    return [np.asarray(v, dtype=float) for v, _ in parts]
