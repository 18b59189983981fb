"""Hand and object behind a grasp as a mujoco model: their collision shapes on the hand's kinematics.

Joints, couplings, gearings, units and stiffness are those of the twin; where they touch is found by the engine, and
each point that it finds is as stiff as a contact of the twin.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.geometry.scene import add_solid
from handfast.model.body import Body
from handfast.model.grasp import Grasp
from handfast.model.hand import Hand
from handfast.model.shape import Shape
from handfast.simulation.stepper import Stepper
from handfast.simulation.twin import Twin, add_jointed, add_object, add_pair, assembled, engine_spec, free_joints

EXACT_TOUCH = 5e-4  # [m] what is so near where the grasp has a contact touches exactly, as the file says
TIE = 1e-6  # [m] a contact that is so little nearer to one pair of surfaces is as near to another
WATCH_DISTANCE = 1.0  # [grasp sizes] parts that are farther apart at first are not watched


@dataclass(frozen=True, eq=False)
class Bodies:
    """What is behind a grasp, in the object's frame.

    Attributes:
        names: of the hand's links, parents: of each its parent's index, -1 for the base.
        joints: per link names of the joints between parent and link.
        shapes: per link, where they are at the beginning.
        pieces: of the object.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    joints: tuple[tuple[str, ...], ...]
    shapes: tuple[tuple[Shape, ...], ...]
    pieces: tuple[Shape, ...]

    @classmethod
    def of(cls, hand: Hand, q: Array, body: Body, pose: Array) -> Bodies:
        """A hand at q (l,) and an object at a pose (4, 4) in the hand's base frame."""
        poses = np.linalg.inv(pose) @ hand.link_poses(q)
        shapes = tuple(tuple(s.placed(T) for s in link.shapes) for link, T in zip(hand.links, poses, strict=True))
        between = tuple(tuple(hand.joint_names[j] for j in link.joints) for link in hand.links)
        return cls(hand.link_names, tuple(link.parent for link in hand.links), between, shapes, tuple(body.pieces))


def bodies_of(grasp: Grasp) -> Bodies:
    """Hand and object as the grasp's provenance has them.

    Raises:
        InputError: a file that is missing or has changed; a contact on a link that the hand does not have, or on
            none; soft fingers.
    """
    from handfast.readers.configuration_file import load_parts

    grasp.refuse_soft_fingers("the simulation of bodies")
    parts = load_parts(grasp)
    strangers = sorted({str(c.link) for c in grasp.contacts} - set(parts.hand.link_names))
    if strangers:
        problem = f"are on '{', '.join(strangers)}', which {parts.hand.name} has not"
        raise InputError(problem, source=grasp.name, field="contacts")
    return Bodies.of(parts.hand, parts.q, parts.body, parts.pose)


def build_bodies(grasp: Grasp, bodies: Bodies, force: float, *, step: float, stiffness: float) -> Twin:
    """The model of hand and object; arguments are those of `build_twin`.

    Raises:
        InputError: nothing of hand and object is near where the grasp has its contacts.
    """
    length, free = grasp.size, free_joints(grasp)
    spec = engine_spec(step)
    spec.option.ccd_tolerance, spec.option.ccd_iterations = 1e-9, 200
    at = {grasp.joints[j].name: k for k, j in enumerate(free)}
    names: list[list[str]] = [[] for _ in free]
    made: list[Any] = []
    for i, (parent, joints) in enumerate(zip(bodies.parents, bodies.joints, strict=True)):
        body = made[parent] if parent >= 0 else spec.worldbody
        for name in joints:
            if name in at:
                names[at[name]] = [f"{name} 0"]
                body = add_jointed(body, f"{name} 0", grasp, free[at[name]])
        made.append(body)
        for n, shape in enumerate(bodies.shapes[i]):
            add_solid(spec, body, f"{bodies.names[i]}/{n}", shape, length=length, contype=0, conaffinity=0, mass=0)
    for j, copies in zip(free, names, strict=True):
        if not copies and not grasp.joints[j].moves:  # no link hangs on it: the length of a tendon, tied to the others
            name = f"{grasp.joints[j].name} 0"
            add_jointed(spec.worldbody, name, grasp, j)
            copies.append(name)
    unmoved = [grasp.joints[j].name for j, copies in zip(free, names, strict=True) if not copies]
    if unmoved:
        raise InputError(f"are not the hand's: {', '.join(unmoved)}", source=grasp.name, field="joints")
    target = add_object(spec, grasp, length)
    for n, piece in enumerate(bodies.pieces):
        add_solid(spec, target, f"object/{n}", piece, length=length, contype=0, conaffinity=0, mass=0)
    pairs = _pairs(spec.compile(), grasp, bodies)
    for first, second, friction, margin in pairs:
        add_pair(spec, f"{first} {second}", (first, second), friction, margin)
    return assembled(spec, grasp, free, names, force, stiffness)


def link_friction(grasp: Grasp, otherwise: float | None = None) -> Mapping[str | None, float]:
    """The friction of every link: the least of its contacts; `otherwise`, or the mean of all, of one without any."""
    found: dict[str | None, float] = defaultdict(lambda: float(grasp.mu.mean()) if otherwise is None else otherwise)
    for c in grasp.contacts:
        found[c.link] = min(found.get(c.link, np.inf), c.friction)
    return found


def _pairs(model: Any, grasp: Grasp, bodies: Bodies) -> list[tuple[str, str, float, float]]:
    """Parts of hand and object that may touch, with friction, and how far apart they count as touching.

    The pair on whose surfaces a contact of the grasp lies begins to touch just there, whatever gap or overlap of
    rounding the configuration leaves it; all others as they are. (The nearest points of two flat faces may lie anywhere
    on them.)
    """
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    friction = link_friction(grasp)
    found: dict[tuple[str, str], float] = {}
    solids: dict[str, Shape] = {}
    for name, shapes in zip(bodies.names, bodies.shapes, strict=True):
        for n in range(len(shapes)):
            for k in range(len(bodies.pieces)):
                pair = f"{name}/{n}", f"object/{k}"
                solids |= {pair[0]: shapes[n], pair[1]: bodies.pieces[k]}
                ids = (int(model.geom(p).id) for p in pair)
                apart = float(mujoco.mj_geomDistance(model, data, *ids, WATCH_DISTANCE, None))
                if apart < WATCH_DISTANCE:
                    found[pair] = apart
    margins = dict.fromkeys(found, 0.0)
    for i, contact in enumerate(grasp.contacts):
        off = {
            p: max(abs(float(solids[name].depth(contact.position)[0])) for name in p)
            for p in found
            if _link(p[0]) == contact.link
        }
        pair = min(off, key=lambda p: (round(off[p] / TIE), abs(found[p])), default=("", ""))
        gap = grasp.size * found[pair] if off else np.inf
        if abs(gap) > EXACT_TOUCH:
            problem = f"is off by {1e3 * gap:.3g} mm: {contact.link} does not touch the object there"
            raise InputError(problem, source=grasp.name, field=f"contacts[{i}]")
        margins[pair] = gap / grasp.size
    return [(*p, friction[_link(p[0])], margin) for p, margin in margins.items()]


def _link(geom: str) -> str:
    return geom.rpartition("/")[0]


class BodyStepper(Stepper):
    """What the engine's contact points carry belongs to the grasp's nearest contact on the same link.

    What is carried where the grasp has no contact on the link belongs to none: the forces of the others then miss it.
    """

    def __init__(self, twin: Twin, grasp: Grasp, wrench: Array) -> None:
        """`wrench` as in a `Stepper`."""
        self._on: dict[str, list[int]] = {}
        for i, contact in enumerate(grasp.contacts):
            self._on.setdefault(str(contact.link), []).append(i)
        super().__init__(twin, grasp, wrench)

    def _tips(self, contacts: int) -> dict[int, int]:
        return {}

    def contact_of(self, point: Any) -> int | None:
        first = int(point.geom1)
        hand = int(point.geom2) if int(self._model.geom_bodyid[first]) == self._object else first
        own = self._on.get(_link(self._model.geom(hand).name), ())
        if not own:
            return None
        R = self.data.xmat[self._object].reshape(3, 3)
        at = self.data.xipos[self._object] + self._arms @ R.T
        return min(own, key=lambda i: float(np.linalg.norm(at[i] - point.pos)))
