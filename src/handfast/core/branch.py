"""Branch and prune over regions of any kind: the queue, the orders and the bookkeeping, no geometry.

Guarantee: if `examine` never drops a solution, then between any two steps every solution in the roots lies
in a final, an unfinished or a pending region, and once nothing is pending in a final or an unfinished one.

A `BranchAndPrune` is an iterator of immutable states. Limits, progress bars and checkpoints live outside of it:

    for state in search:
        if state.nodes >= 1000 or time.monotonic() > end:
            break
    checkpoint = search.save()          # BranchAndPrune.restored(domain, checkpoint) goes on where this one stopped

A loop that is left (break, Ctrl-C, an exception out of `examine`) loses no region; a new loop over the same
search goes on. With one worker or several, a run that is interrupted and resumed takes the same steps as one
that is not; the results of an exhaustive run do not depend on the number of workers at all.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Generic, Literal, NamedTuple, Protocol, TypeVar, overload

from pydantic import Field

from handfast.core.errors import InputError
from handfast.core.files import Strict, validate

R = TypeVar("R")


@dataclass(frozen=True)
class Discarded:
    """The region holds no solution; the evidence is the domain's own. `nodes`: how many this step spent."""

    evidence: Any = None
    nodes: int = 1


@dataclass(frozen=True)
class Final(Generic[R]):
    """The region is an answer, possibly shrunk: whatever it lost holds no solution."""

    region: R
    nodes: int = 1


@dataclass(frozen=True)
class Unfinished(Generic[R]):
    """Neither an answer nor empty, and not worth splitting any more: set aside for the report."""

    region: R
    nodes: int = 1


@dataclass(frozen=True)
class Split(Generic[R]):
    """Regions that together hold every solution of the one examined.

    They may be shrunk, be any number (a step that explores a whole subtree hands over what it left open;
    none at all says that the region is empty), and a single one means that the examination goes on.
    """

    children: Sequence[R]
    evidence: Any = None
    nodes: int = 1


Outcome = Discarded | Final[R] | Unfinished[R] | Split[R]


class Domain(Protocol[R]):
    """What a kind of region has to say for itself. `examine` depends on nothing but the region."""

    def examine(self, region: R) -> Outcome[R]:
        """One step. With several workers it runs on several threads at once (let it release the GIL)."""

    def share(self, region: R) -> float:
        """The part of the roots, in [0, 1], that the region stands for; children have no more than a parent."""

    def encode(self, region: R) -> Any:
        """The region as JSON-able data."""

    def decode(self, data: Any) -> R:
        """What `encode` made, back again, to the last bit; `InputError` for anything else."""


class Order(StrEnum):
    """Which pending region comes next."""

    DEPTH = "depth"  # the first child of the latest one: quick to a first answer, little memory
    BREADTH = "breadth"  # the least deep: all answers at an even resolution


class Prefix(Sequence[R]):
    """The first items of a list that only grows: as immutable as a tuple, without the copy."""

    def __init__(self, items: list[R], length: int) -> None:
        self._items, self._length = items, length

    def __len__(self) -> int:
        return self._length

    @overload
    def __getitem__(self, index: int) -> R: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[R]: ...
    def __getitem__(self, index: int | slice) -> R | Sequence[R]:
        if isinstance(index, slice):
            return [self._items[k] for k in range(*index.indices(self._length))]
        return self._items[range(self._length)[index]]

    def __repr__(self) -> str:
        return f"Prefix({list(self)!r})"


@dataclass(frozen=True)
class BranchState(Generic[R]):
    """Where a search stands after a step.

    Attributes:
        steps: calls of `examine` that counted.
        nodes: what they spent together.
        depth: of the deepest region so far; the roots have 0, a single child is as deep as its parent.
        pending: number of regions that wait or are being examined; 0: the search is complete.
        discarded: share of the roots that was shown to hold no solution.
        finals, unfinished: regions, in the order in which they were found.
        region, outcome: the step itself; None before the first.
    """

    steps: int
    nodes: int
    depth: int
    pending: int
    discarded: float
    finals: Sequence[R]
    unfinished: Sequence[R]
    region: R | None = None
    outcome: Outcome[R] | None = None


class Node(NamedTuple):
    """A pending region; serial numbers grow in the order in which regions came up."""

    serial: int
    depth: int
    region: Any


class Committed(NamedTuple):
    """All that a step changes beside the three lists: replaced by one assignment, so never half done."""

    state: BranchState[Any]
    flight: tuple[Node, ...]  # taken from the queue, being examined or to be examined next
    serial: int  # of the next new region; anything that bears it or a later one is not official


class SavedBranchAndPrune(Strict):
    """A search as JSON-able data."""

    schema_: Literal["handfast/search/1"] = Field(alias="schema")
    order: Order
    steps: int = Field(ge=0)
    nodes: int = Field(ge=0)
    depth: int = Field(ge=0)
    serial: int = Field(ge=0)
    discarded: float
    flight: list[tuple[int, int, Any]]
    queue: list[tuple[int, int, Any]]
    finals: list[Any]
    unfinished: list[Any]


class BranchAndPrune(Generic[R]):
    """A branch and prune search: iterate over it for its states.

    Args:
        domain: what the regions are.
        roots: where solutions are looked for; they should not overlap.
        order: see `Order`.
        workers: threads; twice as many regions are taken from the queue at a time, and their outcomes are
            taken in that order, so that a run can be repeated.
    """

    def __init__(
        self,
        domain: Domain[R],
        roots: Sequence[R],
        *,
        order: Order = Order.DEPTH,
        workers: int = 1,
    ) -> None:
        if workers < 1:
            raise ValueError(f"workers is {workers}; at least 1 is needed")
        self.domain, self.order, self.workers = domain, order, workers
        self._queue: list[tuple[int, int, Node]] = []
        self._finals: list[R] = []
        self._unfinished: list[R] = []
        state: BranchState[R] = BranchState(
            0, 0, 0, len(roots), 0.0, Prefix(self._finals, 0), Prefix(self._unfinished, 0)
        )
        for node in self._nodes(roots, 0, 0):
            self._push(node)
        self._now = Committed(state, (), len(roots))
        self._loop = object()

    @property
    def state(self) -> BranchState[R]:
        """The state after the latest step."""
        return self._now.state

    @property
    def pending(self) -> list[R]:
        """The regions that wait, those in work first, then as the order has it."""
        self._settle()
        return [node.region for node in (*self._now.flight, *self._waiting())]

    def __iter__(self) -> Generator[BranchState[R], None, None]:
        """Step by step until nothing is pending; only the latest loop over a search may go on."""
        self._settle()
        loop = self._loop = object()
        threads = ThreadPoolExecutor(self.workers) if self.workers > 1 else None
        jobs: deque[Future[Outcome[R]]] = deque()
        try:
            while True:
                while self._queue and len(self._now.flight) < (2 * self.workers if threads else 1):
                    self._now = self._now._replace(flight=(*self._now.flight, self._queue[0][2]))
                    heapq.heappop(self._queue)
                flight = self._now.flight
                if not flight:
                    return
                if threads:
                    jobs.extend(threads.submit(self.domain.examine, n.region) for n in flight[len(jobs) :])
                    outcome = jobs[0].result()
                    jobs.popleft()
                else:
                    outcome = self.domain.examine(flight[0].region)
                self._commit(outcome)
                yield self.state
                if self._loop is not loop:
                    raise RuntimeError("another loop over the same search has begun")
        finally:
            if threads:
                threads.shutdown(wait=True, cancel_futures=True)

    def _commit(self, outcome: Outcome[R]) -> None:
        """Enter a step. Lists first, then the one assignment that makes it count (see `_settle`)."""
        state, flight, serial = self._now
        node, share = flight[0], self.domain.share
        left, found, deepest = 0.0, 0, state.depth
        match outcome:
            case Discarded():
                pass
            case Final(region):
                left = share(region)
                self._finals.append(region)
            case Unfinished(region):
                left = share(region)
                self._unfinished.append(region)
            case Split(children):
                left, found = sum(share(region) for region in children), len(children)
                depth = node.depth + (found > 1)
                deepest = max(deepest, depth) if found else deepest
                for child in self._nodes(children, depth, serial):
                    self._push(child)
            case _:
                raise TypeError(f"examine returned {type(outcome).__name__}, which is no outcome")
        after = BranchState(
            state.steps + 1,
            state.nodes + outcome.nodes,
            deepest,
            state.pending - 1 + found,
            state.discarded + share(node.region) - left,
            Prefix(self._finals, len(self._finals)),
            Prefix(self._unfinished, len(self._unfinished)),
            node.region,
            outcome,
        )
        self._now = Committed(after, flight[1:], serial + found)

    def _settle(self) -> None:
        """Take back what a step did that was broken off (Ctrl-C) before it counted."""
        state, flight, serial = self._now
        taken = {node.serial for node in flight}
        self._queue = [e for e in self._queue if e[2].serial < serial and e[2].serial not in taken]
        heapq.heapify(self._queue)
        del self._finals[len(state.finals) :], self._unfinished[len(state.unfinished) :]

    def _nodes(self, regions: Sequence[R], depth: int, serial: int) -> list[Node]:
        """New nodes; depth first they are numbered backwards, so that the first one is the latest."""
        ordered = list(reversed(regions)) if self.order is Order.DEPTH else regions
        return [Node(serial + k, depth, region) for k, region in enumerate(ordered)]

    def _push(self, node: Node) -> None:
        rank = (0, -node.serial) if self.order is Order.DEPTH else (node.depth, node.serial)
        heapq.heappush(self._queue, (*rank, node))

    def _waiting(self) -> list[Node]:
        return [node for _, _, node in sorted(self._queue, key=lambda entry: entry[:2])]

    def save(self) -> dict[str, Any]:
        """The whole search as JSON-able data, at the latest step; not while another thread iterates."""
        self._settle()
        state, flight, serial = self._now
        encode = self.domain.encode
        return {
            "schema": "handfast/search/1",
            "order": str(self.order),
            "steps": state.steps,
            "nodes": state.nodes,
            "depth": state.depth,
            "serial": serial,
            "discarded": state.discarded,
            "flight": [[n.serial, n.depth, encode(n.region)] for n in flight],
            "queue": [[n.serial, n.depth, encode(n.region)] for n in self._waiting()],
            "finals": [encode(region) for region in state.finals],
            "unfinished": [encode(region) for region in state.unfinished],
        }

    @classmethod
    def restored(cls, domain: Domain[R], data: Any, *, workers: int = 1) -> BranchAndPrune[R]:
        """A saved search, ready to go on.

        Raises:
            InputError: not what `save` returns, naming the field.
        """
        saved = validate(SavedBranchAndPrune, data)
        serials = [serial for serial, _, _ in saved.flight + saved.queue]
        if len(set(serials)) < len(serials) or not all(0 <= serial < saved.serial for serial in serials):
            problem = f"holds a serial number twice or out of 0 to {saved.serial - 1}"
            raise InputError(f"{problem}; each pending region has its own", field="queue")
        search = cls(domain, (), order=saved.order, workers=workers)
        flight, queue = (
            [Node(serial, depth, domain.decode(region)) for serial, depth, region in part]
            for part in (saved.flight, saved.queue)
        )
        search._finals += [domain.decode(region) for region in saved.finals]
        search._unfinished += [domain.decode(region) for region in saved.unfinished]
        state = replace(
            search.state,
            steps=saved.steps,
            nodes=saved.nodes,
            depth=saved.depth,
            pending=len(flight) + len(queue),
            discarded=saved.discarded,
            finals=Prefix(search._finals, len(search._finals)),
            unfinished=Prefix(search._unfinished, len(search._unfinished)),
        )
        for node in queue:
            search._push(node)
        search._now = Committed(state, tuple(flight), saved.serial)
        return search
