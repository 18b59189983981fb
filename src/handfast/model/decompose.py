"""Convex pieces of a solid that is not convex, by CoACD, in a process of its own.

On a surface that cuts itself CoACD may come to no end, or end the process that it runs in.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.interrupts import deferred_interrupt
from handfast.core.parallel import end_with
from handfast.model.shape import Faces

PATIENCE = 300.0  # [s] solids of a hundred thousand triangles take a minute


def decompose(vertices: Array, faces: Faces) -> list[Array]:
    """Vertices of convex pieces that together approximate a solid, with a fixed seed.

    Raises:
        InputError: it takes longer than `PATIENCE`, or cannot be done.
    """
    with tempfile.TemporaryDirectory() as made:
        np.savez(Path(made) / "solid.npz", vertices=vertices, faces=faces)
        command = [sys.executable, "-P", "-m", "handfast.model.decompose", made, str(os.getpid())]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        try:
            done = subprocess.run(command, env=environment, capture_output=True, timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            raise InputError(f"has no convex pieces after {PATIENCE:g} s; does its surface cut itself?") from None
        if done.returncode:
            raise InputError(
                "cannot be taken apart into convex pieces; is its surface closed, and does not cut itself?"
            )
        with np.load(Path(made) / "pieces.npz") as pieces:
            return [pieces[name] for name in pieces.files]


def _work(folder: Path) -> None:
    with deferred_interrupt():
        import coacd  # slow to import

    coacd.set_log_level("off")
    with np.load(folder / "solid.npz") as solid:
        mesh = coacd.Mesh(solid["vertices"], solid["faces"])
    parts = coacd.run_coacd(mesh, threshold=0.05, seed=0)
    np.savez(folder / "pieces.npz", *(np.asarray(v, dtype=float) for v, _ in parts))


if __name__ == "__main__":
    end_with(int(sys.argv[2]))
    _work(Path(sys.argv[1]))
