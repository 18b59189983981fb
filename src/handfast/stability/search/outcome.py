"""What a search returns: a value achieved, a bound on it, and what backs them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from handfast.core.answer import Stop
from handfast.core.arrays import Array
from handfast.stability.problem.witness import Witness
from handfast.stability.search.proof import Proof


@dataclass(frozen=True, eq=False)
class Outcome:
    """Of a search for a small objective (see `objective.py`), or for any state at all.

    Attributes:
        value: the smallest objective that was witnessed; inf if none was.
        bound: no state has a smaller one; inf if there is no state at all, -inf if nothing was shown.
        witness: the state that achieves `value`.
        stop: why it ended.
        seconds, nodes: wall time, programs solved.
        proof: of `bound`, where there is one; verified: it was replayed and holds.
        point: (n,) the witness in the engine's unknowns, a start for neighbouring questions.
    """

    value: float
    bound: float
    witness: Witness | None
    stop: Stop
    seconds: float
    nodes: int
    proof: Proof | None = None
    point: Array | None = None
    verified: bool = False

    @property
    def cost(self) -> tuple[float, int]:
        """Seconds and nodes, as answers have them."""
        return self.seconds, self.nodes

    @property
    def backed(self) -> bool:
        """Was everything replayed? Witnesses always are."""
        return self.verified or self.proof is None

    def after(self, other: Outcome) -> Outcome:
        """With the cost of another search beside its own."""
        return replace(self, seconds=self.seconds + other.seconds, nodes=self.nodes + other.nodes)
