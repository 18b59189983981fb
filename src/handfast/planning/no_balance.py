"""Searches for a proof that no contact forces balance the loads, wherever in their object regions the contacts are.

Branch and prune over the placements alone, two parameters for each contact, whatever the hand does. Each box needs a
twist of the object that refutes it (`handfast.proofs.unbalanced`). Candidates are taken from the middle of the box:
turning about the line through two contacts; and the twist that is farthest from doing no work on any force in the
friction cones at middle and corners, which is the shortest vector in the convex hull of these forces' wrenches and of
the load's. A box without one is halved. A placement at which forces balance every load ends the search: then there is
no such proof.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import permutations
from typing import Any

import numpy as np
from scipy.optimize import nnls

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.libraries import deferred_interrupt
from handfast.core.transforms import cross
from handfast.model.grasp import Contact, Grasp
from handfast.planning.filters.balance import BALANCE_SHARE, circumscribed, imbalance, pyramid_wrenches
from handfast.planning.missing import Missing
from handfast.proofs.contact_force_limits import ForceLimits
from handfast.proofs.few_contacts import Held
from handfast.proofs.fields import BadFile, Fields, Integers
from handfast.proofs.replay import Refused
from handfast.proofs.tasks import read_task
from handfast.proofs.unbalanced import MAX_TREE_ENTRIES, Motions, Placements, UnbalancedTree, halves
from handfast.stability.problem.loads import Loads
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.task import Task

BALANCE_BATCH = 64  # boxes that are examined together
MIN_BOX_SIDE = 1e-7  # of the whole: a box with no longer side is not halved
# placements, drawn at random, of which one at which all loads balance ends the search before it begins
RANDOM_PLACEMENTS = 24
PLACEMENT_ROUNDS, PLACEMENT_STEPS, MAX_PLACEMENT_STEP = 12, 8, 0.3  # of steps from the best of them; share of the whole
TRIED_MIDDLES = 2  # of the boxes of a step that are halved, in whose middles all loads may balance
HEAVY = 20.0  # length of the load's wrench beside those of contact forces: it is the same in the whole box
TIED = 30.0  # weight of the sum of a contact's shares, which is 1, beside a load of length 1
MIN_VECTOR = 1e-7  # a shortest vector below this is none
MIN_DIVISOR = 1e-300
BOX_CORNERS = np.array(
    [[0.5, 0.5], [0, 0], [0, 1], [1, 0], [1, 1]]
)  # of a contact's parameters in a box, the middle first
NO_MOTION = -1


@dataclass(frozen=True)
class BalanceSearched:
    """How far the search for the proof has come.

    Attributes:
        shown: is every box refuted? Then no forces balance the loads.
        boxes: that were examined. pending: those that are left.
        discarded: share of the placements at which no forces balance some load.
        balanced: (2 K) parameters of a placement at which forces seem to balance every load; None if none was met.
        open: (2 K, 2) the largest box that is left; None if none is.
        missing: what is missing there for the twist that was tried last on the box that it is half of; None if there is
            none.
        line_distance: [m] the line through both contacts is at least so far from the centre of mass, if that alone is
            why no forces balance a weight; else None.
        proof: for files, once all is shown; else None.
    """

    shown: bool
    boxes: int
    pending: int
    discarded: float
    balanced: Array | None
    open: Array | None
    missing: Missing | None = None
    line_distance: float | None = None
    proof: Mapping[str, Any] | None = field(default=None, repr=False)

    def to_json(self) -> dict[str, Any]:
        """Without the proof."""
        balanced, left = (None if a is None else a.tolist() for a in (self.balanced, self.open))
        said = {"shown": self.shown, "boxes": self.boxes, "pending": self.pending, "discarded": self.discarded}
        missing = self.missing and self.missing.to_json()
        return said | {"balanced": balanced, "open": left, "missing": missing, "line_distance": self.line_distance}


@dataclass(eq=False, slots=True)
class BoxNode:
    """A box of the tree; entry: as in `UnbalancedTree`; tried: the motion that was tried last on what it is half of."""

    box: Array
    tried: int
    entry: int | None = None
    halves: tuple[BoxNode, ...] = ()


@dataclass(frozen=True, eq=False)
class Corners:
    """Points and normals into the object (N, 5, K, 3) at the middles and corners of N boxes."""

    points: Array
    normals: Array
    size: Array = field(init=False)  # (N,) [m] the largest distance of a contact from the contacts' centroid

    def __post_init__(self) -> None:
        p = self.points[:, 0]
        away = np.linalg.norm(p - p.mean(axis=1, keepdims=True), axis=2).max(axis=1)
        object.__setattr__(self, "size", np.maximum(away, 1e-9))

    @classmethod
    def of(cls, boxes: Array, placements: Placements) -> Corners:
        """Of boxes (N, 2 K, 2)."""
        low, high = np.moveaxis(boxes, 2, 0)
        at = low[:, None] + (high - low)[:, None] * np.tile(BOX_CORNERS, placements.count)
        return cls(*(a.reshape(*at.shape[:2], -1, 3) for a in placements.at(at.reshape(-1, at.shape[2]))))

    @property
    def effect(self) -> Array:
        """(N, 2 K) how much each side of the boxes moves and turns its contact."""
        out = []
        for a in (self.points / self.size[:, None, None, None], self.normals):
            s, t = a[:, 3:] - a[:, 1:3], a[:, [2, 4]] - a[:, [1, 3]]
            out.append(np.stack([np.linalg.norm(d, axis=3).max(axis=1) for d in (s, t)], axis=2))
        return (out[0] + out[1]).reshape(len(self.points), -1)


class NoBalance:
    """The search; `run` goes on where it was left.

    Args:
        loads: each alone has to be balanced. friction: coefficient at every contact. torsion: [m] of soft fingers.
        force_limits: [N] largest normal force at any contact, or (K,) at each; inf for none.
        center: (3,) [m] the object's centre of mass.
        seed: of the placements that are looked at first.
        saved: what `to_json` made, to go on from.

    Raises:
        InputError: `saved` is not of such a task.
    """

    def __init__(
        self,
        task: Task,
        loads: Loads,
        friction: float,
        *,
        center: Array,
        force_limits: ForceLimits | Array | float = np.inf,
        torsion: float = 0.0,
        seed: int = 0,
        saved: Any = None,
    ) -> None:
        self.task, regions = task, read_task(task_to_dict(task)).on_object
        self.names, self.center = loads.names, None
        if len(regions) == 2 and all(loads.weights):
            self.center = np.asarray(center, dtype=float)
        self.placements = Placements.of(regions, loads.wrenches, friction, force_limits, torsion)
        self.wide = circumscribed(soft=torsion > 0)
        self.whole = np.ptp(self.placements.root, axis=1)
        self.motions = Motions(np.zeros((0, len(loads))), np.zeros((0, 2), dtype=np.int64), np.zeros((0, 6)))
        self.hits = np.zeros(len(loads))  # how often each load refuted a box
        self.fewest = Held((), np.zeros(3), loads.wrenches, friction, torsion=torsion).opposed(self.placements.reach)
        self.root = BoxNode(self.placements.root, NO_MOTION)
        self.open = deque([self.root] if self.fewest.most < self.placements.count else [])
        self.boxes, self.discarded = 0, 0.0
        self.balanced: Array | None = None
        self.stuck = False  # is a box too small to be halved?
        self.seed, self.looked = seed, False
        if saved is not None:
            self._restore(saved)

    @property
    def shown(self) -> bool:
        """Is every box refuted?"""
        return not self.open

    @property
    def over(self) -> bool:
        """Is there nothing left to do?"""
        return (
            self.stuck
            or self.balanced is not None
            or not self.open
            or 2 * self.boxes > MAX_TREE_ENTRIES - 4 * BALANCE_BATCH
        )

    @property
    def searched(self) -> BalanceSearched:
        """How far it has come."""
        left = max(self.open, key=lambda node: self._share(node.box), default=None)
        proof, distance = (self.to_json(), self.line_distance) if self.shown else (None, None)
        said = self.shown, self.boxes, len(self.open), 1.0 if self.shown else self.discarded, self.balanced
        where = None if left is None else left.box
        return BalanceSearched(*said, where, self._missing_in(left), distance, proof)

    def _missing_in(self, node: BoxNode | None) -> Missing | None:
        if node is None or node.tried == NO_MOTION:
            return None
        found = self.placements.examined(node.box[None], self.motions[[node.tried]])
        return Missing.of("balance", (), found)

    @cached_property
    def line_distance(self) -> float | None:
        """See `BalanceSearched`; of a search that has shown all."""
        if not self.boxes:
            return None
        by_line = all("line" in motion for motion in self.to_json()["motions"])
        return self.placements.line_distance(self.center) if by_line and self.center is not None else None

    def run(self, boxes: int, end: float = np.inf) -> None:
        """Examine so many more boxes, or until the monotonic clock shows `end`."""
        if not self.looked and self.open:
            self._look()
            self.looked = True
        most = self.boxes + boxes
        while not self.over and self.boxes < most and time.monotonic() < end:
            with deferred_interrupt():
                self._step()

    def _share(self, box: Array) -> float:
        return float(np.prod(np.ptp(box, axis=1) / self.whole))

    # --- placements ---

    def _look(self) -> None:
        """Placements anywhere, the best of them moved about, for one at which all loads balance."""
        random, (low, high) = np.random.default_rng(self.seed), self.placements.root.T
        at = low + (high - low) * random.random((RANDOM_PLACEMENTS, len(low)))
        missing = self._missing(at)
        best, least, length = at[missing.argmin()], missing.min(), MAX_PLACEMENT_STEP
        for _ in range(PLACEMENT_ROUNDS):
            if not least:
                break
            at = np.clip(best + length * (high - low) * random.normal(size=(PLACEMENT_STEPS, len(low))), low, high)
            missing = self._missing(at)
            if missing.min() < least:
                best, least = at[missing.argmin()], missing.min()
            else:
                length /= 2

    def _missing(self, at: Array) -> Array:
        """(N,) how much of the loads forces cannot balance at placements (N, 2 K); notes one where that is nothing."""
        out = np.zeros(len(at))
        mu, torsion = self.placements.friction, self.placements.torsion
        for n, (p, normals) in enumerate(zip(*self.placements.at(at), strict=True)):
            if self.placements.limited.any():
                wrenches = pyramid_wrenches(p, normals, mu, p.mean(axis=0), 1.0, torsion=torsion)
                short = [
                    np.linalg.norm(self._separating(wrenches, w, p.mean(axis=0), 1.0)) for w in self.placements.loads
                ]
                out[n] = sum(x for x in short if x > BALANCE_SHARE)
            else:
                grasp = Grasp([Contact(*there, mu, torsion=torsion) for there in zip(p, normals, strict=True)])
                out[n] = imbalance(grasp, self.placements.loads).sum()
            if not out[n]:
                self.balanced = at[n]
                break
        return out

    # --- one step ---

    def _step(self) -> None:
        """Refute or halve the first boxes that are open."""
        taken = [self.open[k] for k in range(min(BALANCE_BATCH, len(self.open)))]
        boxes = np.array([node.box for node in taken])
        closed, tried, effect = self.examined(boxes, np.array([node.tried for node in taken]))
        left = boxes[closed == NO_MOTION][:TRIED_MIDDLES]
        if len(left):
            self._missing(left.mean(axis=2))
        fine = (np.ptp(boxes, axis=2) <= MIN_BOX_SIDE * self.whole).all(axis=1)
        self.stuck = bool((fine & (closed == NO_MOTION)).any())
        if self.stuck:
            return
        for node, motion, new, k in zip(
            taken, closed.tolist(), tried.tolist(), effect.argmax(axis=1).tolist(), strict=True
        ):
            self.open.popleft()
            if motion == NO_MOTION:
                node.entry, node.halves = k, tuple(BoxNode(half, new) for half in halves(node.box, k))
                self.open.extend(node.halves)
            else:
                node.entry = -1 - motion
                self.discarded += self._share(node.box)
        self.boxes += len(taken)

    def examined(self, boxes: Array, last: Integers) -> tuple[Integers, Integers, Array]:
        """Whatever the hand does: the motion that refutes each of N boxes, and the last that was tried, or NO_MOTION;
        (N, 2 K) what halving a side may bring.
        """
        corners = Corners.of(boxes, self.placements)
        closed, tried, effect = np.full(len(boxes), NO_MOTION), last.copy(), corners.effect
        for candidates in (None, self._lines, self._twists):
            its = np.flatnonzero(closed == NO_MOTION)
            given = candidates(corners, its) if candidates else last
            its, given = its[given != NO_MOTION], given[given != NO_MOTION]
            shown = self.placements.examined(boxes[its], self.motions[given])
            done = shown.refuted
            closed[its[done]], tried[its] = given[done], given
            known = np.isfinite(shown.reach).all(axis=1) & (shown.reach.max(axis=1, initial=0.0) > 0)
            effect[its[known]] = shown.reach[known]
            self.hits += self.motions.weights[given[done]].sum(axis=0)
        return closed, tried, effect

    # --- candidates ---

    def add_motions(self, new: Motions) -> Integers:
        """More motions; returns their numbers."""
        first, self.motions = len(self.motions), self.motions.with_more(new)
        return first + np.arange(len(new))

    def _lines(self, corners: Corners, its: Integers) -> Integers:
        """Turning about the line through two contacts, where that does most work on a load.

        Torsion of soft fingers resists it, without a limit where their forces have none.
        """
        points, normals = corners.points[its, 0], corners.normals[its, 0]  # (N, K, 3)
        best, chosen = np.full(len(its), MIN_VECTOR), np.full((len(its), 2), NO_MOTION)
        weights = np.zeros((len(its), len(self.hits)))
        force, torque = self.placements.loads[:, :3], self.placements.loads[:, 3:]
        most = np.linalg.norm(force, axis=1) * corners.size[its, None] + np.linalg.norm(torque, axis=1)
        for i, j in permutations(range(self.placements.count), 2):
            a, b = points[:, i], points[:, j]
            turn = b - a
            work = np.cross(a, b) @ force.T + turn @ torque.T
            if self.placements.torsion:
                if not self.placements.limited[[i, j]].all():
                    continue
                spun = np.abs(turn[:, None] @ normals[:, [i, j]].swapaxes(1, 2))[:, 0]  # (N, 2)
                work = work - self.placements.torsion * (spun @ self.placements.force_limits[[i, j]])[:, None]
            value = work / np.maximum(np.linalg.norm(turn, axis=1)[:, None] * most, MIN_DIVISOR)
            u = np.cross(turn[:, None], points - a[:, None])
            cones = (normals * u).sum(axis=2) / np.maximum(
                np.linalg.norm(u, axis=2), MIN_DIVISOR
            ) - self.placements.sine
            cones[:, [i, j]] = np.inf
            least = np.minimum(value.max(axis=1), cones.min(axis=1))
            better = least > best
            best[better], chosen[better] = least[better], (i, j)
            weights[better] = np.maximum(value[better], 0.0)
        out, some = np.full(len(its), NO_MOTION), chosen[:, 0] != NO_MOTION
        shares = (weights / np.maximum(weights.max(axis=1, keepdims=True), MIN_DIVISOR)).round(1)
        kinds, which = np.unique(np.hstack([chosen, shares])[some], axis=0, return_inverse=True)
        numbers = self.add_motions(Motions(kinds[:, 2:], kinds[:, :2].astype(np.int64), np.zeros((len(kinds), 6))))
        out[some] = numbers[which.ravel()]
        return out

    def _twists(self, corners: Corners, its: Integers) -> Integers:
        """The constant twist that is farthest from doing no work on forces at the middles and corners."""
        out, order = np.full(len(its), NO_MOTION), np.argsort(-self.hits, kind="stable")
        for n, k in enumerate(its):
            center, size = corners.points[k, 0].mean(axis=0), corners.size[k]
            p, normals = (np.swapaxes(a, 0, 1) for a in (corners.points[k], corners.normals[k]))
            coefficients = self.placements.friction * self.wide, center, size
            contacts = pyramid_wrenches(p, normals, *coefficients, torsion=self.placements.torsion * self.wide)
            for load in order:
                z = self._separating(contacts, self.placements.loads[load], center, size)
                if np.linalg.norm(z) > MIN_VECTOR:
                    twist = np.r_[z[:3] - np.cross(z[3:] / size, center), z[3:] / size]
                    new = Motions(np.eye(len(order))[[load]], np.array([[NO_MOTION] * 2]), twist[None])
                    (out[n],) = self.add_motions(new)
                    break
        return out

    def _separating(self, contacts: Array, load: Array, center: Array, size: float) -> Array:
        """(6,) a twist about a centre, turns times a size, on which a load and contact forces do work; 0 if there is
        none.

        Without a limit of forces the shortest vector in the convex hull of the wrenches (K, M, 6) and of the load; with
        one the shortest sum of the load, and of a vector in the convex hull of 0 and the wrenches of each contact, in
        their cone where forces are not limited.
        """
        own = np.concatenate([load[:3], (load[3:] - cross(center, load[:3])) / size])
        length = max(float(np.linalg.norm(own)), MIN_DIVISOR)
        K, M, _ = contacts.shape
        limited, limits = self.placements.limited, self.placements.force_limits
        if not limited.any():
            units = contacts / np.linalg.norm(contacts[..., :3], axis=-1, keepdims=True)
            vectors = np.vstack([units.reshape(-1, 6), HEAVY * own / length])
            x, _ = nnls(np.vstack([vectors.T, np.ones(len(vectors))]), np.eye(7)[6])
            return np.asarray(vectors.T @ x)
        sizes = np.where(limited, limits, length) / length
        forces, rows, bounded = contacts.reshape(-1, 6).T * np.repeat(sizes, M), np.eye(K)[limited], limited.sum()
        shares = np.hstack([np.kron(rows, np.ones(M)), np.eye(bounded)]) * TIED
        due = np.r_[-own / length, np.full(bounded, TIED)]
        x, _ = nnls(np.vstack([np.hstack([forces, np.zeros((6, bounded))]), shares]), due)
        return np.asarray(forces @ x[: K * M] + own / length)

    # --- files ---

    def to_json(self) -> dict[str, Any]:
        """The tree so far, as `replay_unbalanced` reads it: a proof once no box is open; or how many it takes."""
        if self.fewest.most >= self.placements.count:
            return {"fewest_contacts": self.fewest.contacts}
        stack, used = [self.root], dict[int, int]()
        entries: list[int | None] = []
        while stack:
            node = stack.pop()
            stack += node.halves[::-1]
            entry = node.entry
            entries.append(entry if entry is None or entry >= 0 else -1 - used.setdefault(-1 - entry, len(used)))
        return {"motions": self.motions[list(used)].to_json(self.names), "tree": entries}

    def _restore(self, data: Any) -> None:
        try:
            tree = UnbalancedTree.read(Fields(data), self.names, self.placements.count)
            tree.checked(self.placements)
        except BadFile as bad:
            raise InputError(bad.problem, field=bad.field or None) from None
        except Refused as why:
            raise InputError(str(why), field="tree") from None
        self.motions = tree.motions
        self.open.clear()
        stack = [self.root]
        for entry in tree.entries:
            node = stack.pop()
            node.entry = entry
            if entry is None:
                self.open.append(node)
            elif entry >= 0:
                node.halves = tuple(BoxNode(half, NO_MOTION) for half in halves(node.box, entry))
                stack += node.halves[::-1]
            else:
                self.discarded += self._share(node.box)
        self.boxes = len(tree.entries) - len(self.open)
