"""How hard a hand can push at its contacts, wherever on its regions these are and however its joints stand.

A virtual motion of some joints, which keeps the couplings, moves the hand's point of a contact by u; n is the normal
out of the hand. Of a normal force f with friction mu the work is f (n.u - mu |u_t|) at least, at a soft finger with
torsion mu_tau whose link turns by omega f (n.u - sqrt(mu^2 |u_t|^2 + mu_tau^2 (omega.n)^2)). It is the work of the
actuators (virtual work), at most the sum of their limits times their own motions. So

    f <= sum of limits times motions / the least of n.u - mu |u_t|

over the region and the joints' ranges, if that is positive, and not negative at any other contact that moves. Tried are
the outermost joints of each finger: their axes stand in the link of the contact, or in one that few joints are between.
A state that holds may miss joint torques by 1e-9 of the load (`tolerance`), and f be larger by that times all motions
of the joints over the same number. How large the load is, is for the question to say.

Nothing limits the force of a contact of the palm; with a joint that may lean on a stop, which carries anything; with a
motor that has no limit, gearing included, however small its command; where the lever arm may vanish, as of a straight
finger that pushes along itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handfast.proofs.chains import JointStep, Pose, frames
from handfast.proofs.fields import Array
from handfast.proofs.intervals import Dual, Interval, cross, dot, sqr, sqrt
from handfast.proofs.motors import Motors
from handfast.proofs.regions import ContactSide
from handfast.proofs.tasks import TaskData

LEVER_BATCH = 256  # boxes that are looked at together
LEVER_BOXES = 4096  # for one lever arm
LEVER_BOUND_RATIO = 0.9  # of the least lever arm that was met: a bound that is good enough
TRIED_JOINTS = 2  # joints of a finger, from the outermost inwards


@dataclass(frozen=True, eq=False)
class ForceLimits:
    """Upper bounds of the normal forces at K contacts.

    Attributes:
        most: (K,) [N]; inf where there is none.
        turned, slid: (K,) by how much more they may be for each N m that a state misses of the torques of revolute
            joints, and each N of the forces of prismatic ones.
    """

    most: Array
    turned: Array
    slid: Array

    @classmethod
    def of(cls, most: Array | float, contacts: int) -> ForceLimits:
        """That nothing is missed of: one for all contacts, or (K,) of each."""
        none = np.zeros(contacts)
        return cls(np.broadcast_to(np.asarray(most, dtype=float), (contacts,)), none, none)

    def up_to(self, most: float) -> ForceLimits:
        """The lower of these and of one for all contacts."""
        less = most <= self.most
        return ForceLimits(
            np.where(less, most, self.most), np.where(less, 0.0, self.turned), np.where(less, 0.0, self.slid)
        )


@np.errstate(all="ignore")  # numbers that overflow end as NaN, which bounds nothing
def contact_force_limits(task: TaskData, motors: Motors, friction: float, torsion: float = 0.0) -> ForceLimits:
    """Of the contacts of a task, by what its motors can do; torsion [m] of soft fingers, 0 for point contacts."""
    out, turned, slid = np.full(len(task.links), np.inf), np.zeros(len(task.links)), np.zeros(len(task.links))
    if not np.isfinite(motors.limits).any():
        return ForceLimits(out, turned, slid)
    anywhere = Interval.between(*task.hand.limits.T)[None]
    for k in range(len(out)):
        for lead in _leads(task, k)[:TRIED_JOINTS]:
            rates = _rates(task, lead)
            for sense in (1.0, -1.0) if rates else ():
                its = {j: sense * rate for j, rate in rates.items()}
                moved = np.zeros(len(task.hand.joints))
                moved[list(its)] = list(its.values())
                work = float(motors.work(Interval.of(moved[None]), anywhere)[0])
                if not np.isfinite(work):
                    continue
                arm = least_arm(task, k, its, friction, torsion)
                others = (i for i in range(len(out)) if i != k and _moved(task, i) & its.keys())
                if arm > 0 and all(least_arm(task, i, its, friction, torsion, enough=0.0) >= 0 for i in others):
                    turns, slides = (np.abs(moved[those]).sum() for those in (task.hand.revolute, ~task.hand.revolute))
                    motions = work, turns, slides
                    most, *missed = (float((Interval.of(x) / Interval.of(arm)).hi) if x else 0.0 for x in motions)
                    if most < out[k]:
                        out[k], (turned[k], slid[k]) = most, missed
    return ForceLimits(out, turned, slid)


def _moved(task: TaskData, contact: int) -> set[int]:
    return {j for i in task.hand.path(task.links[contact]) for j in task.hand.links[i].joints}


def _leads(task: TaskData, contact: int) -> list[int]:
    """The free joints that move a contact, the one that drives its outermost joint first."""
    hand, out = task.hand, list[int]()
    for i in reversed(hand.path(task.links[contact])):
        for j in reversed(hand.links[i].joints):
            path = hand.driving(j)
            lead = path[-1].driver if path else j
            if lead >= 0 and lead not in out:
                out.append(lead)
    return out


def _rates(task: TaskData, lead: int) -> dict[int, float]:
    """How fast the joints move that a free one drives; {} where a coupling follows from another, which would round."""
    out = {lead: 1.0}
    for j in task.hand.couplings:
        path = task.hand.driving(j)
        if path[-1].driver == lead:
            if len(path) > 1:
                return {}
            out[j] = path[0].ratio
    return {j: rate for j, rate in out.items() if rate}


def least_arm(
    task: TaskData,
    contact: int,
    rates: Mapping[int, float],
    friction: float,
    torsion: float = 0.0,
    *,
    enough: float = np.inf,
) -> float:
    """A lower bound of n.u - mu |u_t|, or with torsion as above, over a contact's hand region and the joints' ranges.

    -inf or less than 0 if there is none.

    By branch and bound, until the bound is `LEVER_BOUND_RATIO`, at least `enough`, or `LEVER_BOXES` were looked at.
    """
    arm = LeverArm(task, contact, rates, friction, torsion)
    boxes, bounds, least, seen = arm.root[None], np.full(1, -np.inf), np.inf, 0
    while seen < LEVER_BOXES and bounds.min() < min(LEVER_BOUND_RATIO * least, enough):
        first = np.argsort(bounds, kind="stable")[:LEVER_BATCH]
        middle = arm.over(Interval.of(boxes[first].mean(axis=2)))
        least = min(least, float(middle.hi.min()))
        if least < 0:
            return -np.inf
        side = (np.ptp(boxes[first], axis=2) / arm.width).argmax(axis=1)
        halves = np.repeat(boxes[first], 2, axis=0)
        cut = 0.5 * boxes[first].sum(axis=2)[np.arange(len(first)), side]
        halves[0::2][np.arange(len(first)), side, 1] = cut
        halves[1::2][np.arange(len(first)), side, 0] = cut
        new = arm.over(Interval.between(*np.moveaxis(halves, 2, 0))).lo
        new = np.fmax(np.nan_to_num(new, nan=-np.inf), np.repeat(bounds[first], 2))
        boxes = np.concatenate([np.delete(boxes, first, axis=0), halves])
        bounds = np.concatenate([np.delete(bounds, first), new])
        seen += len(first)
    return float(bounds.min())


class LeverArm:
    """n.u - sqrt(mu^2 |u_t|^2 + mu_tau^2 (omega.n)^2) of a contact, by the two parameters of its hand region and the
    free joints between.
    """

    def __init__(
        self, task: TaskData, contact: int, rates: Mapping[int, float], friction: float, torsion: float = 0.0
    ) -> None:
        self.task, self.rates, self.friction, self.torsion, hand = task, rates, friction, torsion, task.hand
        region = task.on_hand[contact]
        self.side = ContactSide.of([region], np.array([[0, 1]]), still=False)
        outwards = [(i, j) for i in hand.path(task.links[contact]) for j in (-1, *hand.links[i].joints)]
        moved = [n for n, (_, j) in enumerate(outwards) if j in rates]
        self.steps = outwards[moved[0] :][::-1] if moved else []
        passed = [j for _, j in self.steps[:-1] if j >= 0]
        self.paths = {j: hand.driving(j) for j in passed}
        leads = {j: path[-1].driver if path else j for j, path in self.paths.items()}
        self.columns = {lead: 2 + n for n, lead in enumerate(sorted({x for x in leads.values() if x >= 0}))}
        self.root = np.vstack([region.ends, *(hand.limits[lead][None] for lead in self.columns)])
        self.width = np.maximum(np.ptp(self.root, axis=1), 1e-300)

    def over(self, x: Interval) -> Interval:
        """(N,) at parameters (N, n)."""
        hand, N = self.task.hand, x.shape[0]
        at = self.side.at(x[:, :2])
        point, normal = at.point.value[:, 0], at.normal.value[:, 0]
        u, omega = (Interval(np.zeros((N, 3, 2))) for _ in range(2))
        pose = Pose.fixed(Interval.of(np.eye(3)), np.zeros(3), N, 0)
        for n, (i, j) in enumerate(self.steps):  # the frame inwards, as it stands in that of the contact's link
            if j < 0:
                frame, place = (a[0] for a in frames(hand, np.array([i])))
                pose = pose.then(Pose.fixed(frame, place.mid[:, 0], N, 0).inverse)
                continue
            step = JointStep.of(hand, j)
            if rate := self.rates.get(j):
                along, about = (a.value for a in step.seen(pose))
                u = u + (cross(along, point - about) if step.revolute else along) * rate
                omega = omega + along * rate if step.revolute else omega
            if n < len(self.steps) - 1:
                pose = pose.then(step.pose(Dual.constant(self.value(j, x), 0), back=True))
        pushed = dot(normal, u)
        slip = sqr(u - normal * pushed[:, None]).sum()
        if not self.torsion:
            return pushed - sqrt(slip) * self.friction
        spin = sqr(dot(normal, omega) * self.torsion)
        return pushed - sqrt(slip * self.friction * self.friction + spin)

    def value(self, j: int, x: Interval) -> Interval:
        """(N,) of a joint."""
        path = self.paths[j]
        lead = path[-1].driver if path else j
        q = x[:, self.columns[lead]] if lead >= 0 else Interval(np.zeros((x.shape[0], 2)))
        for c in reversed(path):
            q = q * c.ratio + c.offset
        return q
