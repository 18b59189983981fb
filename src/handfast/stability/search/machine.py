"""The kernel's machine code: what of it Python may call, and what it is made of."""

from __future__ import annotations

from pathlib import Path

from handfast.core.machine_code import EntryPoint, Library
from handfast.proofs import kinds
from handfast.stability.search.arrays import (
    Kept,
    KernelQuestion,
    NodeAtHand,
    Pool,
    QuestionRows,
    Refinement,
    WorkerState,
    WorkingSet,
)

HERE = Path(__file__).parent
_KERNEL = f"{__package__}.kernel"
_WORKSPACE = (Kept, NodeAtHand, WorkingSet, Refinement)

LIBRARY = Library(
    name="stability",
    module=__name__,
    entries={
        "run": EntryPoint(f"{_KERNEL}.tree", (KernelQuestion, WorkerState, Pool, *_WORKSPACE, float, float, int, bool)),
        "refined": EntryPoint(f"{_KERNEL}.newton", (KernelQuestion, WorkerState, Refinement, float, bool)),
        "ask_rows": EntryPoint(
            f"{_KERNEL}.batch_loop",
            (KernelQuestion, WorkerState, Pool, *_WORKSPACE, QuestionRows, float, float, float, int, float),
        ),
    },
    sources=(
        HERE / "machine.py",
        HERE / "rows.py",
        Path(kinds.__file__),
        HERE / "arrays.py",
        *sorted((HERE / "kernel").glob("*.py")),
    ),
)
