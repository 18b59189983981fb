"""Which places of an object a hand may reach, by a sample of hand shapes: a quick look before the exact answer."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from handfast.core.arrays import Array
from handfast.model.hand.coupling import coupled
from handfast.model.hand.hand import Hand
from handfast.model.hand_regions import HandRegion

MAX_CAP_RADIUS = 0.05  # [m] a cap of a larger sphere is taken as a flat disc
PATCH_SLACK = np.radians(25)  # [rad] how far a contact's normal may be from that in the middle of a patch
MIN_ANGLE_SLACK = np.radians(
    15
)  # [rad] least slack of a match, and what two regions may miss facing each other by, beside it
ASSIGNMENT_MATCHES = 4  # matches of each assignment that are kept
SAME_SIDE = 0.3  # cosine of the angle of two normals on one side of an object
NEAREST_SHAPES = 60  # hand shapes whose distances fit best, of each assignment, that are looked at further


@dataclass(frozen=True, eq=False)
class Match:
    """A hand shape and an object pose at which regions are near places.

    Attributes:
        misfit: the larger of the farthest distance left, over what counts as 1, and the largest angle left, over the
            slack of its region; 1 or less looks reachable.
        order: the region of each place, by index.
        q: (l,) configuration.
        pose: (4, 4) of the object in the hand's base frame, as near as can be (Kabsch's method).
    """

    misfit: float
    order: tuple[int, ...]
    q: Array
    pose: Array


@dataclass(frozen=True, eq=False)
class HandShapes:
    """Regions of a hand at s random configurations. Base frame.

    Attributes:
        hand: the hand.
        regions: r of them.
        q: (s, l) the configurations.
        radii: (r,) [m] by which an object's surface stands off the points below: of round tips, else 0.
        slacks: (r,) [rad] how far the contact's normal may be from the axis; wider than that of a flat disc.
        points: (s, r, 3) [m] centres of round tips, else middles of regions.
        axes: (s, r, 3) outward unit normals in their middles.
    """

    hand: Hand
    regions: tuple[HandRegion, ...]
    q: Array
    radii: Array
    slacks: Array
    points: Array
    axes: Array

    @classmethod
    def of(cls, hand: Hand, regions: tuple[HandRegion, ...], count: int, seed: int) -> HandShapes:
        """At `count` configurations, uniform within the limits, couplings kept."""
        q = _configurations(hand, count, np.random.default_rng(seed))
        poses = hand.link_poses(q)
        radii, slacks, points, axes = [], [], [], []
        for r in regions:
            ball = r.region.ball
            radii.append(ball.radius if ball and ball.radius < MAX_CAP_RADIUS else 0.0)
            slacks.append(max(ball.half_angle, MIN_ANGLE_SLACK) if ball else PATCH_SLACK)
            middle, normal = r.middle
            pose = poses[hand.link(r.link)]
            points.append(pose[:, :3, :3] @ (middle - radii[-1] * normal) + pose[:, :3, 3])
            axes.append(pose[:, :3, :3] @ normal)
        return cls(hand, regions, q, np.array(radii), np.array(slacks), np.stack(points, 1), np.stack(axes, 1))

    def opening(self, chosen: tuple[int, ...]) -> float:
        """[m] the widest object that two of some regions were seen to face each other across; 0 if none did."""
        widest = 0.0
        for i, a in enumerate(chosen):
            for b in chosen[i + 1 :]:
                between = self.points[:, b] - self.points[:, a]
                far = np.linalg.norm(between, axis=1)
                along = between / np.maximum(far, 1e-9)[:, None]
                faces = np.einsum("sj,sj->s", self.axes[:, a], along) > np.cos(
                    min(self.slacks[a] + MIN_ANGLE_SLACK, np.pi)
                )
                faces &= np.einsum("sj,sj->s", self.axes[:, b], along) < -np.cos(
                    min(self.slacks[b] + MIN_ANGLE_SLACK, np.pi)
                )
                far = far - self.radii[a] - self.radii[b]
                widest = max(widest, float(far[faces].max(initial=0.0)))
        return widest

    def matches(self, chosen: tuple[int, ...], points: Array, normals: Array, size: float) -> list[Match]:
        """The ways in which some regions come nearest to touching places, each assignment of regions a few times.

        The palm takes only a place that no other one faces the same way as: fingers close around the far side.

        Args:
            chosen: k of the regions, by index.
            points: (k, 3) [m] of the places; `normals`: (k, 3) outward unit normals. Object frame.
            size: [m] the distance that counts as a misfit of 1.
        """
        k = len(points)
        i, j = np.triu_indices(k, 1)
        faces = normals @ normals.T - 2 * np.eye(k)
        behind = faces.max(axis=1) < SAME_SIDE
        found: list[Match] = []
        for order in permutations(chosen):
            own = list(order)
            if any(self.regions[r].role == "palm" and not behind[place] for place, r in enumerate(own)):
                continue
            there = points + self.radii[own, None] * normals
            here = self.points[:, own]
            apart = np.linalg.norm(there[i] - there[j], axis=1)
            off = np.abs(np.linalg.norm(here[:, i] - here[:, j], axis=2) - apart).max(axis=1, initial=0.0)
            near = (
                np.argpartition(off, NEAREST_SHAPES)[:NEAREST_SHAPES]
                if len(off) > NEAREST_SHAPES
                else np.arange(len(off))
            )
            arm = max(float(apart.mean()), size) / 2
            left, angle, poses = _aligned(here[near], self.axes[near][:, own], there, -normals, arm)
            misfit = np.maximum(left / size, (angle / self.slacks[own]).max(axis=1))
            found += [
                Match(float(misfit[n]), order, self.q[near[n]], poses[n])
                for n in np.argsort(misfit)[:ASSIGNMENT_MATCHES]
            ]
        return sorted(found, key=lambda m: m.misfit)


def _configurations(hand: Hand, count: int, random: np.random.Generator) -> Array:
    """(s, l) uniform within the limits, mimic joints after their drivers."""
    lower, upper = np.clip(hand.limits, -np.pi, np.pi).T
    q = lower + (upper - lower) * random.random((count, hand.l))
    return coupled(hand, q)


def _aligned(here: Array, axes: Array, there: Array, inward: Array, arm: float) -> tuple[Array, Array, Array]:
    """Farthest distances (s,) [m] and angles (s, k) [rad] left between points and directions after rigid motions.

    The motions (s, 4, 4) bring `there` to `here`.

    Args:
        here, axes: (s, k, 3) in the hand; `there`, `inward`: (k, 3) on the object.
        arm: [m] the length at which a direction counts as much as a position.
    """
    a = np.concatenate([here, here + arm * axes], axis=1)
    b = np.concatenate([there, there + arm * inward])
    ma, mb = a.mean(axis=1, keepdims=True), b.mean(axis=0)
    U, _, Vt = np.linalg.svd((a - ma).swapaxes(1, 2) @ (b - mb))
    sign = np.ones((len(here), 3))
    sign[:, 2] = np.sign(np.linalg.det(U @ Vt))
    R = (U * sign[:, None, :]) @ Vt
    left = np.linalg.norm(here - ((there - mb) @ R.swapaxes(1, 2) + ma), axis=2).max(axis=1)
    cosine = np.einsum("skj,skj->sk", axes, inward @ R.swapaxes(1, 2))
    poses = np.tile(np.eye(4), (len(here), 1, 1))
    poses[:, :3, :3] = R
    poses[:, :3, 3] = ma[:, 0] - R @ mb
    return left, np.arccos(np.clip(cosine, -1, 1)), poses
