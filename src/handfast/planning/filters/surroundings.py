"""What stands around an object: a support, obstacles; and whether a hand comes in and goes out in a straight line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import normal_frame, transform
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand.hand import Hand, Link
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape

WAY_LENGTH = 0.1  # [m] of the approach, and of the retreat
PLANE_SIDE = 2.0  # [m] side of the box that stands for a plane
THICK = 0.5  # [m] of that box
OBSTACLE_CLEARANCE = 1e-3  # [m] a hand that is nearer to an obstacle is in it
TOUCH_DEPTH = 1e-4  # [m] how deep solids may be that touch from the start: the object its support, a finger the object
MIN_WAY_STEP = 1e-3  # [m] least step along a way; else as far as the nearest solid is away, so that none is passed
OBSTACLE_CUTOFF = 0.05  # [m] distances beyond this are not computed
CLOSING_STEPS = 10  # steps of closing that are looked at


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What stands around the object, and how far the hand travels in and out. Object frame.

    Attributes:
        up: (3,) away from a plane that the object stands on; None without one.
        obstacles: solids that nothing may touch.
        travel: [m] of the straight approach, and of the retreat.

    Raises:
        InputError: a direction that is zero, a way that is not positive.
    """

    up: Sequence[float] | Array | None = None
    obstacles: Sequence[Shape] = field(default=(), repr=False)
    travel: float = WAY_LENGTH

    def __post_init__(self) -> None:
        if self.up is not None and not np.linalg.norm(np.asarray(self.up, dtype=float)) > 0:
            raise InputError("is zero; a direction is needed", field="up")
        if not self.travel > 0:
            raise InputError(f"is {self.travel:g} m; a positive number is needed", field="travel")

    def solids(self, body: Body) -> list[Shape]:
        """All of them, the plane as a wide box below the object's lowest point."""
        if self.up is None:
            return list(self.obstacles)
        up = np.asarray(self.up, dtype=float) / np.linalg.norm(self.up)
        corners = np.vstack([piece.triangles()[0] for piece in body.pieces])
        frame = normal_frame(up)
        middle = body.center_of_mass
        top = middle + (float((corners @ up).min()) - middle @ up) * up
        return [*self.obstacles, Shape("box", (THICK, PLANE_SIDE, PLANE_SIDE), transform(top - THICK / 2 * up, frame))]

    @property
    def numbers(self) -> list[object]:
        """What tells two of them apart."""
        shapes = [[s.kind, list(s.size), s.pose.tolist(), s.vertices.tolist()] for s in self.obstacles]
        return [None if self.up is None else np.asarray(self.up, dtype=float).tolist(), shapes, self.travel]


@dataclass(frozen=True)
class Way:
    """How a hand gets to its grasp and away with the object.

    Attributes:
        joints: name -> value [rad, m] with which it comes.
        approach: (3,) unit, in which the hand moves, hand's base frame.
        retreat: (3,) unit, in which hand and object move, object frame.
        distance: [m] of either, straight.
    """

    joints: dict[str, float]
    approach: tuple[float, float, float]
    retreat: tuple[float, float, float]
    distance: float


class WayFinder:
    """Looks whether hand and object collide with what is around, at the grasp and on the way.

    Steps are as long as what is nearest is away, so that no surface is passed; the closing between is looked at in some
    steps, joints in proportion.

    Raises:
        InputError: an obstacle is in the object, so that no hand could take it away.
    """

    def __init__(self, scene: Scene, around: Surroundings) -> None:
        self.scene, self.around = scene, around
        solids = around.solids(scene.body)
        self._hand = self._object = None
        if solids:
            others = Body.of(solids, name="surroundings")
            self._hand = Scene(scene.hand, others, scene.ignored)
            self._object = Scene(_as_hand(scene.body), others)
            deep = -float(self._object.distance(np.zeros(0), np.eye(4), OBSTACLE_CUTOFF).min())
            if deep > TOUCH_DEPTH:
                problem = f"is in the object, {1e3 * deep:.3g} mm deep; both files have the object's frame"
                raise InputError(problem, field="obstacle")

    def clearance(self, q: Array, pose: Array) -> float:
        """[m] of the hand at q (l,) from what is around an object at a pose (4, 4) in its base frame, up to
        `OBSTACLE_CUTOFF`."""
        return float(self._hand.distance(q, pose, OBSTACLE_CUTOFF).min()) if self._hand else OBSTACLE_CUTOFF

    def way(self, opened: Array, closed: Array, pose: Array, approach: Array) -> Way | None:
        """The way in and out of a grasp; None if something collides.

        Args:
            opened, closed: (l,) the joints with which the hand comes, and those of the grasp.
            pose: (4, 4) of the object in the hand's base frame, at the grasp.
            approach: (3,) unit, in which the hand moves, its base frame.
        """
        hand, R = self.scene.hand, pose[:3, :3]
        away = np.asarray(self.around.up if self.around.up is not None else -(R.T @ approach), dtype=float)
        retreat = away / np.linalg.norm(away)
        shares = np.linspace(0.0, 1.0, CLOSING_STEPS)
        closing = (self.clearance(opened + share * (closed - opened), pose) for share in shares)
        if (
            min(closing) < OBSTACLE_CLEARANCE
            or not self._comes(opened, pose, approach)
            or not self._leaves(closed, pose, retreat)
        ):
            return None
        joints = dict(zip(hand.joint_names, opened.tolist(), strict=True))
        return Way(joints, tuple(approach.tolist()), tuple(retreat.tolist()), self.around.travel)

    def _comes(self, q: Array, pose: Array, approach: Array) -> bool:
        """The open hand, against the object and what is around it."""

        def room(at: float) -> float:
            there = pose.copy()
            there[:3, 3] += at * approach
            to_object = float(self.scene.distance(q, there, OBSTACLE_CUTOFF).min())
            return min(to_object + TOUCH_DEPTH, self.clearance(q, there) - OBSTACLE_CLEARANCE)

        return self._free(room)

    def _leaves(self, q: Array, pose: Array, retreat: Array) -> bool:
        """Hand and object together, against what is around them."""

        def room(at: float) -> float:
            around = transform(-at * retreat)  # what is around, as hand and object see it
            of_object = (
                self._object.distance(np.zeros(0), around, OBSTACLE_CUTOFF).min() if self._object else OBSTACLE_CUTOFF
            )
            return min(float(of_object) + TOUCH_DEPTH, self.clearance(q, pose @ around) - OBSTACLE_CLEARANCE)

        return self._free(room)

    def _free(self, room: Callable[[float], float]) -> bool:
        """Whether there is room [m] all the way."""
        at = 0.0
        while at <= self.around.travel:
            free = room(at)
            if free < 0:
                return False
            at += max(MIN_WAY_STEP, free)
        return True


def _as_hand(body: Body) -> Hand:
    """An object as a hand of one link, for distances between two objects."""
    link = Link(body.name or "object", -1, np.eye(4), shapes=tuple(body.pieces))
    none = np.zeros((0, 0))
    return Hand(body.name or "object", (link,), (), Mechanism((), none, none, ()), (), np.zeros(0))
