"""The tables of the paper on contact regions: hands by structure, nine tasks and their systems, the Schunk hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from handfast.core.answer import Reach, uninterrupted
from handfast.model.hand.structures import TABLE_1
from handfast.papers.canonical_equations import canonical
from handfast.papers.exhibit import TextTable
from handfast.readers.load_hand import load_hand
from handfast.synthesis.query import synthesize
from handfast.synthesis.task_file import load_task

if TYPE_CHECKING:
    from handfast.papers.exhibit import MakingOptions


@dataclass(frozen=True)
class PrintedTask:
    """A column of Table 2: n_v, n_e and d of (26), and seconds to one configuration on 64 cores, sigma = 0.1."""

    n_v: int
    n_e: int
    d: int
    seconds: int


PRINTED_TASKS = {
    "scalpel-upholding": PrintedTask(219, 209, 17, 106),
    "scalpel-handling": PrintedTask(243, 235, 19, 255),
    "scalpel-incision": PrintedTask(331, 324, 18, 418),
    "teapot-lid-lifting": PrintedTask(219, 209, 17, 114),
    "teapot-service": PrintedTask(288, 278, 19, 262),
    "teapot-transportation": PrintedTask(312, 305, 17, 375),
    "guitar-tuning": PrintedTask(219, 209, 17, 68),
    "guitar-playing": PrintedTask(307, 298, 19, 229),
    "guitar-holding": PrintedTask(331, 324, 18, 664),
}
# of the authors' own search
PRINTED_BOXES = {"scalpel-upholding": 2003, "scalpel-handling": 3211, "teapot-service": 1739}


def table1(_: MakingOptions) -> TextTable:
    """Eleven hands: degrees of freedom and the structure of each finger, and what `handfast show` calls them."""
    fingers = ("little", "ring", "middle", "index", "thumb")
    rows = [
        (d.title, str(d.dof), *(d.fingers.get(f, "–") for f in fingers), f"table1:{name}")
        for name, d in TABLE_1.items()
    ]
    note = "Joints in parentheses move as one. Dimensions are nominal: the paper gives none."
    return TextTable(("hand", "DOF", *fingers, "here"), tuple(rows), (note,))


def table2(options: MakingOptions) -> TextTable:
    """Nine tasks: the size of the canonical system beside the paper's, the time to a proved configuration."""
    rows = []
    synthesize(load_task("scalpel-upholding"), timeout=options.timeout)  # loads machine code
    for name, printed in PRINTED_TASKS.items():
        task = load_task(name)
        system = canonical(task, unit=0.001)
        answer = uninterrupted(synthesize(task, timeout=options.timeout))
        took = f"{1e3 * answer.seconds:.0f}" if answer.verdict is Reach.FOUND else str(answer.verdict)
        sizes = f"{system.n_v}, {system.n_e}, {system.d}", f"{printed.n_v}, {printed.n_e}, {printed.d}"
        rows.append((name, str(len(task.contact_pairs)), *sizes, took, str(printed.seconds)))
    heads = ("task", "contacts", "n_v, n_e, d", "paper", "time [ms]", "paper, 64 cores [s]")
    note = "Tasks are rebuilt after the paper's words: the authors' own regions are not published for all of them."
    return TextTable(heads, tuple(rows), (note,))


def table3(_: MakingOptions) -> TextTable:
    """Joints of the Schunk hand: where they are on the link before them [mm], their axes there, their limits."""
    hand = load_hand("schunk-sah")
    rows = []
    for link in hand.links:
        for j in link.joints:
            joint = hand.joints[j]
            at = link.pose[:3, :3] @ joint.anchor + link.pose[:3, 3]
            axis = link.pose[:3, :3] @ joint.axis
            low, high = np.degrees([joint.lower, joint.upper])
            where = ", ".join(f"{1e3 * x:.4g}" for x in at + 0.0)
            along = ", ".join(f"{x:.3g}" for x in np.round(axis, 9) + 0.0)
            rows.append((joint.name, f"({where})", f"({along})", f"{low:.0f}° to {high:.0f}°"))
    heads = ("joint", "point p [mm]", "axis u", "range")
    note = "Frames are those of the bundled file; a universal joint is two rows, whose link between has no solid."
    return TextTable(heads, tuple(rows), (note,))


TABLES: dict[str, Callable[[MakingOptions], TextTable]] = {
    "regions-table1": table1,
    "regions-table2": table2,
    "regions-table3": table3,
}
