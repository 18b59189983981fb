"""Pieces of the kernel of stability that tests ask one by one: compiled once for all of them, as kernels are."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import NamedTuple

from handfast.core.groups import RealMatrix, Reals, Wholes
from handfast.core.machine_code import EntryPoint, Library
from handfast.stability.search import machine
from handfast.stability.search.arrays import KernelQuestion, NodeAtHand, Pool, Refinement, WorkingSet
from tests.support.pieces import asked


class Counted(NamedTuple):
    """What a program changes of a `WorkerState`."""

    hi: Reals  # (P,) upper bounds of the plain base values
    counts: Wholes  # (10,)


class Balance(NamedTuple):
    """The balance of energy at the point of the first node."""

    hi: Reals  # (P,) upper bounds of the plain base values
    data: RealMatrix  # (1, n + 1) as in `Pool`
    row: Reals  # (n,) out: its coefficients
    gradient: Reals  # (8,) out
    rhs: Reals  # (1,) out


class PatchNumbers(NamedTuple):
    """Out: a patch of the directions of sliding."""

    numbers: Reals  # (PATCH_SIZE,)


HERE = Path(__file__).parent
PIECES = f"{__package__}.stability_pieces_compiled"
LIBRARY = Library(
    name="stability-pieces",
    module=__name__,
    entries={
        "solved": EntryPoint(PIECES, (KernelQuestion, Counted, NodeAtHand, WorkingSet, Pool, float)),
        "balanced": EntryPoint(PIECES, (KernelQuestion, Balance)),
        "patched": EntryPoint(PIECES, (int, PatchNumbers)),
        "contact_equations": EntryPoint(PIECES, (int, KernelQuestion, Refinement)),
        "smoothed": EntryPoint(PIECES, (KernelQuestion, Refinement)),
    },
    sources=(
        HERE / "pieces.py",
        HERE / "stability_pieces.py",
        HERE / "stability_pieces_compiled.py",
        *machine.LIBRARY.sources,
    ),
)

ask = partial(asked, LIBRARY)
