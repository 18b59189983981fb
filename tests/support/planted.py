"""Tasks with a known solution: object regions are laid where the hand's regions are at a chosen configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from handfast.core.arrays import Array
from handfast.model.cylinder_side import CylinderSide, RoundSide
from handfast.model.hand.hand import Coupling, Hand, Joint, Link, coupling_rows
from handfast.model.mechanism import Mechanism
from handfast.model.region import Bezier, Cap, Region
from handfast.papers.patch_form import cap_parameters, cylinder_parameters
from handfast.synthesis.task import ContactPair, PoseBounds, Task

X, Y, Z = np.eye(3)
HOME = np.eye(4)


@dataclass(frozen=True, eq=False)
class Planted:
    """A task and one of its solutions: joints q (l,), object pose (4, 4), per contact where on each region.

    A spot is u, v on a patch and the direction from the centre on a cap, in the link's or object's frame.
    """

    task: Task
    q: Array
    pose: Array
    spots: list[tuple[Array, Array]]

    @property
    def parameters(self) -> Array:
        """(b, 4) u, v, s, t of the canonical system."""
        return np.array(
            [
                [x for r, at in zip((t.hand, t.object), spots, strict=True) for x in parameters(r, at)]
                for t, spots in zip(self.task.contact_pairs, self.spots, strict=True)
            ]
        )


def parameters(region: Region, at: Array) -> tuple[float, float]:
    if isinstance(region, Cap):
        return cap_parameters(region, at)
    u, v = float(at[0]), float(at[1])
    return cylinder_parameters(region, u, v) if isinstance(region, CylinderSide) else (u, v)


def chain(*parts: tuple, couplings: Sequence[Coupling] = (), name: str = "chain") -> Hand:
    """A hand from (link name, parent name, pose, joints of that link); the first one is the palm."""
    links, joints, names = [Link("palm", -1, np.eye(4))], [], ["palm"]
    for link, parent, pose, own in parts:
        indices = tuple(len(joints) + k for k in range(len(own)))
        joints += own
        links.append(Link(link, names.index(parent), pose, indices))
        names.append(link)
    tied = {c.joint for c in couplings}
    driven = [j for j in range(len(joints)) if j not in tied]
    mechanism = Mechanism(
        tuple(joints[j].name for j in driven),
        np.eye(len(joints))[driven],
        coupling_rows(tuple(couplings), len(joints)),
        (False,) * len(driven),
    )
    return Hand(name, tuple(links), tuple(joints), mechanism, tuple(couplings), np.zeros(len(joints)))


def joint(name: str, axis: Array, lower: float = -1.0, upper: float = 1.0, **more) -> Joint:
    """A revolute joint through the origin of its link, unless said otherwise."""
    values = {"type": "revolute", "anchor": np.zeros(3)} | more
    return Joint(name, axis=axis, lower=lower, upper=upper, **values)


def pose(position: Array, rotation: Array | None = None) -> Array:
    T = np.eye(4)
    T[:3, 3] = position
    T[:3, :3] = np.eye(3) if rotation is None else rotation
    return T


def turn(rng: np.random.Generator) -> Array:
    """(3, 3) a random rotation."""
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(R))
    return Q * np.sign(np.linalg.det(Q))


def between(a: Array, b: Array) -> Array:
    """(3, 3) a rotation that takes unit vector a to unit vector b."""
    return frame(b) @ frame(a).T


def frame(n: Array) -> Array:
    """(3, 3) a rotation whose third column is n."""
    e = np.cross(n, np.eye(3)[np.abs(n).argmin()])
    e /= np.linalg.norm(e)
    return np.column_stack([e, np.cross(n, e), n])


def bump(rng: np.random.Generator, degree: tuple[int, int] = (2, 2), size: float = 0.02, flip: bool = False) -> Bezier:
    """A gently curved patch of side `size` [m] about the origin."""
    u, v = (np.linspace(-0.5, 0.5, n + 1) for n in degree)
    height = rng.uniform(-0.1, 0.1, (len(u), len(v)))
    points = np.stack([*np.meshgrid(u, v, indexing="ij"), height], axis=2)
    return Bezier(size * points, flip)


def spot(region: Region, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Parameters (2,), or the direction (3,) on a cap, with point (3,) and outward unit normal (3,) there."""
    if isinstance(region, Cap):
        theta, phi = rng.uniform(0, region.half_angle), rng.uniform(0, 2 * np.pi)
        d = region.frame @ [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
        return d, region.point(d), region.sign * d
    u, v = rng.uniform(0, 1, 2)
    n = region.normal(u, v)
    return np.array([u, v]), region.at(u, v), n / np.linalg.norm(n)


def moved(region: Region, T: Array) -> Region:
    """The region after a rigid motion (4, 4)."""
    R = T[:3, :3]
    if isinstance(region, Cap):
        return replace(region, center=R @ region.center + T[:3, 3], axis=R @ region.axis)
    if isinstance(region, RoundSide):
        center = R @ region.center + T[:3, 3]
        return replace(region, center=center, axis=R @ region.axis, x_axis=R @ region.x_axis)
    return Bezier(region.points @ R.T + T[:3, 3], region.flip)


def plant(
    hand: Hand,
    contact_pairs: Sequence[tuple[str, Region, Region]],
    rng: np.random.Generator,
    *,
    q: Array | None = None,
    bounds: PoseBounds | None = None,
    object_pose: Array | None = None,
) -> Planted:
    """The given object regions keep their shape and are moved; joints are drawn from the limits and coupled."""
    if q is None:
        q = np.array([rng.uniform(j.lower, j.upper) for j in hand.joints])
        for c in hand.couplings:
            q[c.joint] = c.offset + (c.ratio * q[c.driver] if c.driver >= 0 else 0.0)
    T = pose(rng.normal(0, 0.1, 3), turn(rng)) if object_pose is None else object_pose
    poses, placed, spots = hand.link_poses(q), [], []
    for link, on_hand, on_object in contact_pairs:
        L = poses[hand.link(link)]
        h, point, normal = spot(on_hand, rng)
        o, landing, up = spot(on_object, rng)
        R = T[:3, :3].T @ L[:3, :3]  # from link to object axes
        target = T[:3, :3].T @ (L[:3, :3] @ point + L[:3, 3] - T[:3, 3])
        twist = between(up, -(R @ normal))
        M = pose(target - twist @ landing, twist)
        placed.append(ContactPair(link, on_hand, moved(on_object, M)))
        spots.append((h, twist @ o if isinstance(on_object, Cap) else o))
    return Planted(Task.of(hand, tuple(placed), pose=bounds), q, T, spots)
