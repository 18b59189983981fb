"""Second-order cone programs, by clarabel."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handfast.core.arrays import Array


class NotMeasured(Exception):
    """A measure is not to be had here: what computes it is not installed, or the grasp is too large for it.

    Its text is one line that says why and what would help.
    """


TIGHT = 1e-9


@dataclass
class ConicProgram:
    """Minimise half x^T P x + cost @ x with linear rows and second-order cones, over x of `n` numbers."""

    n: int
    _parts: dict[str, list[tuple[Array, Array]]] = field(
        default_factory=lambda: {"equal": [], "most": [], "cone": []}, init=False
    )

    def equal(self, rows: Array, right: Array) -> None:
        """rows @ x = right."""
        self._parts["equal"].append((rows, right))

    def at_most(self, rows: Array, right: Array) -> None:
        """rows @ x <= right."""
        self._parts["most"].append((rows, right))

    def in_cone(self, rows: Array, offset: Array | None = None) -> None:
        """rows @ x + offset is in the second-order cone: its first number is at least the length of the rest."""
        self._parts["cone"].append((-rows, np.zeros(len(rows)) if offset is None else offset))

    def solve(self, cost: Array, quadratic: Array | None = None) -> Array | None:
        """(n,) the solution; None if nothing meets all rows and cones.

        Raises:
            NotMeasured: clarabel is not installed, or gives up.
        """
        clarabel = solver()
        from scipy.sparse import csc_matrix

        parts = [(kind, *part) for kind, some in self._parts.items() for part in some]
        kinds = {"equal": clarabel.ZeroConeT, "most": clarabel.NonnegativeConeT, "cone": clarabel.SecondOrderConeT}
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TIGHT
        P = csc_matrix((self.n, self.n)) if quadratic is None else csc_matrix(np.triu(quadratic))
        rows = csc_matrix(np.vstack([rows for _, rows, _ in parts]))
        right = np.concatenate([right for _, _, right in parts])
        cones = [kinds[kind](len(b)) for kind, _, b in parts]
        found = clarabel.DefaultSolver(P, cost, rows, right, cones, settings).solve()
        status = str(found.status)
        if status in ("Solved", "AlmostSolved"):
            return np.array(found.x)
        if status in ("PrimalInfeasible", "AlmostPrimalInfeasible"):
            return None
        raise NotMeasured(f"the solver of its program gave up ({status})")


def solver() -> Any:
    """The module clarabel; `NotMeasured` if it is not installed."""
    try:
        import clarabel
    except ImportError:
        raise NotMeasured("needs clarabel: pip install 'handfast[measures]'") from None
    return clarabel
