"""Contact regions of any hand, guessed from its collision shapes: a heuristic.

A fingertip is the last part with a shape at the end of a chain of joints; it is taken to touch with the side that
goes ahead when the last closing joint of the chain closes. The same side of the parts further in makes the pads, and
the palm's region is on the face that is nearest to where the tips meet. A hand whose closing senses are guessed wrong,
or that touches with its nails, needs a file of its own.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from handfast.core import bundled
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import normal_frame
from handfast.geometry.region_fit import fit
from handfast.model.hand.anatomy import Anatomy, above
from handfast.model.hand.hand import Hand
from handfast.model.hand_regions import HandRegion, HandRegions, Role
from handfast.model.region import Cap, Region
from handfast.model.shape import Faces, Shape
from handfast.readers.region_file import load_hand_regions

FORWARD = 0.25  # a tip also touches with its end: share of the outward direction in its facing one
FACING_COSINE = np.cos(np.radians(50))  # of the angle between a facing triangle's normal and the facing direction
HALF_ANGLE = np.radians(60)  # of a cap on a sphere
# [m, rad] how much a flat pad is rounded at least: flat on flat has no proof
CROWN, CROWN_ANGLE = 2e-4, np.radians(2.5)
SPHERE_TOLERANCE = 3e-4  # [m] a part this near to a sphere is taken as one
MAX_SPHERE_RADIUS = 0.05  # [m] radius of the largest sphere that counts as one
FACING_CELLS = 8  # cells along a facing part when its triangles are cut
COVERED_DEPTH = 1e-5  # [m] inside another shape of the link
NEARLY_CLOSED = 0.75  # of the closing ranges, where the tips are near the grasp centre
MIN_FACE_WIDTH = 4e-3  # [m] a face narrower than twice this makes no region


@dataclass(frozen=True, eq=False)
class _FacingPart:
    """A link with shapes, and which side of it faces the object (unit, link frame)."""

    link: int
    finger: str
    role: Role
    facing: Array
    outward: Array


def guess_regions(hand: Hand) -> HandRegions:
    """Tips, pads and palm of any hand: see the module's text; each region says how far it is from the shapes.

    Raises:
        InputError: no link at the end of a chain of joints has collision shapes.
    """
    q, anatomy = _nearly_closed(hand), Anatomy.of(hand)
    tips = _tips(anatomy)
    if not tips:
        raise InputError("has no fingertip with collision shapes", source=hand.source or hand.name, field="hand")
    parts = [p for tip, finger in tips.items() for p in _finger(hand, q, tip, finger)]
    poses = hand.link_poses(q)
    meet = np.mean([poses[t][:3, :3] @ _middle(hand, t) + poses[t][:3, 3] for t in tips], axis=0)
    made: dict[bytes, tuple[Region, float] | None] = {}
    regions = [r for p in parts if (r := _region(hand, p, made))]
    palm = _palm(anatomy, q, meet)
    named = {r.name: r for r in ([*regions, palm] if palm else regions)}
    source = hand.source or hand.name
    return HandRegions(os.path.normpath(source) if os.path.isfile(source) else source, tuple(named.values()))


# --- which links, and which side ----------------------------------------------------------------------


def _nearly_closed(hand: Hand) -> Array:
    """(l,) closing joints most of the way to their limits, the others in the middle of their ranges."""
    lower, upper = hand.limits.T
    share = 0.5 + (NEARLY_CLOSED - 0.5) * hand.closing
    return np.clip(np.where(np.isfinite(lower + upper), lower + share * (upper - lower), 0.0), lower, upper)


def _tips(anatomy: Anatomy) -> dict[int, str]:
    """The fingertips by index, and their fingers' names: what the names of a finger's links begin with."""
    tips, names, hand = anatomy.tips, [], anatomy.hand
    for i in tips:
        chain = [hand.links[k].name for k in (i, *above(hand, i)) if anatomy.finger(k) >= 0]
        names.append(_shared(chain))
    if len(set(names)) < len(names) or not all(names):
        names = [f"finger_{k + 1}" for k in range(len(tips))]
    return dict(zip(tips, names, strict=True))


def _shared(names: list[str]) -> str:
    """What all of some names begin with, a single one as it is."""
    count = 0
    while len({name[: count + 1] for name in names}) == 1 and count < min(map(len, names)):
        count += 1
    return names[0][:count] if len(names) == 1 else names[0][:count].rstrip("_-. ")


def _finger(hand: Hand, q: Array, tip: int, finger: str) -> list[_FacingPart]:
    """The tip and the parts further in that a closing joint moves."""
    parts: list[_FacingPart] = []
    for i in (tip, *above(hand, tip)):
        if hand.links[i].shapes and any(hand.closing[j] for j in hand.moved_by(i)):
            facing, outward = _facing(hand, q, i)
            if parts:
                parts.append(_FacingPart(i, finger, "pad", facing, outward))
            else:
                ahead = facing + FORWARD * outward
                parts.append(_FacingPart(i, finger, "tip", ahead / np.linalg.norm(ahead), outward))
    return parts


def _facing(hand: Hand, q: Array, link: int) -> tuple[Array, Array]:
    """Unit vectors, link frame: where the middle of a link goes when its last closing joint closes, and from that
    joint's axis outwards to it (for a slide: away from the base)."""
    j = [k for k in hand.moved_by(link) if hand.closing[k]][-1]
    pose = hand.link_poses(q)[link]
    axes, origins = hand.joint_axes(q)
    middle = pose[:3, :3] @ _middle(hand, link) + pose[:3, 3]
    speed = hand.closing[j] * hand.jacobian(link, middle, q)[:, j]
    arm = middle - (origins[j] if hand.joints[j].type == "revolute" else 0)
    if np.linalg.norm(speed) < 1e-9:  # a link on its own axis
        facing = normal_frame(hand.closing[j] * axes[j])[:, 1]
    else:
        facing = speed / np.linalg.norm(speed)
    arm = arm - (arm @ facing) * facing - (arm @ axes[j]) * axes[j] * (hand.joints[j].type == "revolute")
    outward = arm / max(float(np.linalg.norm(arm)), 1e-12)
    return pose[:3, :3].T @ facing, pose[:3, :3].T @ outward


def _middle(hand: Hand, link: int) -> Array:
    """(3,) [m] centre of volume of a link's shapes, link frame."""
    shapes = hand.links[link].shapes
    volumes = np.array([s.volume for s in shapes])
    return volumes @ np.array([s.centroid for s in shapes]) / volumes.sum()


# --- the region on that side ---------------------------------------------------------------------------


def _region(hand: Hand, part: _FacingPart, known: dict[bytes, tuple[Region, float] | None]) -> HandRegion | None:
    """The region of a part, on the shape that shows most of itself on the facing side; None if there is none.

    `known` holds those of parts met before: the fingers of a hand are often alike.
    """
    link = hand.links[part.link]
    numbers = [np.concatenate([s.size, s.pose.ravel(), s.vertices.ravel()]).round(6) for s in link.shapes]
    directions = [part.facing.round(6), part.outward.round(6)]
    key = part.role.encode() + (np.concatenate([*numbers, *directions]) + 0.0).tobytes()  # + 0.0: there is no -0.0
    if key not in known:
        seen = [_seen(link.shapes, k, part) for k in range(len(link.shapes))]
        known[key] = _of_shape(link.shapes[int(np.argmax(seen))], part) if max(seen) > 0 else None
    made = known[key]
    if made is None:
        return None
    name = f"{part.finger}_tip" if part.role == "tip" else f"{link.name}_{part.role}"
    return HandRegion(name, link.name, made[0], part.finger, part.role, made[1])


def _seen(shapes: tuple[Shape, ...], k: int, part: _FacingPart) -> float:
    """[m^2] how much of a shape's surface faces forwards, is in no other shape, and at a tip is near its end."""
    vertices, faces = _cut(*shapes[k].triangles())
    middles, normals, area = _measured(vertices, faces)
    shown = normals @ part.facing > FACING_COSINE
    for i, other in enumerate(shapes):
        if i != k:
            shown &= other.depth(middles) < COVERED_DEPTH
    if part.role == "tip":
        every = np.vstack([s.triangles()[0] for s in shapes])
        along, across = every @ part.outward, np.cross(part.outward, part.facing)
        shown &= middles @ part.outward > along.max() - np.ptp(every @ across)
    return float(area[shown].sum())


def _of_shape(shape: Shape, part: _FacingPart) -> tuple[Region, float] | None:
    """The facing side of a shape, link frame, and its error [m]."""
    if shape.kind == "sphere":
        return Cap(shape.pose[:3, 3], shape.size[0], part.facing, HALF_ANGLE), 0.0
    if shape.kind == "box":
        return _crowned(shape, part)
    vertices, faces = _cut(*shape.triangles())
    _, normals, _ = _measured(vertices, faces)
    shown = np.flatnonzero(normals @ part.facing > FACING_COSINE)
    if not len(shown):
        return None
    center, radius, error = _sphere(vertices[np.unique(faces[shown])])
    if error < SPHERE_TOLERANCE and radius < MAX_SPHERE_RADIUS:
        return Cap(center, radius, part.facing, HALF_ANGLE * 0.8), error
    try:
        fitted = fit(vertices, faces, shown)
    except InputError:
        return None
    return fitted.patch, fitted.error_max


def _crowned(box: Shape, part: _FacingPart) -> tuple[Region, float] | None:
    """A slightly round disc on the facing side of a box, at a tip as far out as it fits."""
    R, half = box.pose[:3, :3], np.array(box.size) / 2
    towards = R.T @ part.facing
    k = int(np.abs(towards).argmax())
    normal = np.sign(towards[k]) * np.eye(3)[k]
    sides = [i for i in range(3) if i != k]
    rho = float(half[sides].min())
    if rho < MIN_FACE_WIDTH:
        return None
    middle = half * normal
    if part.role == "tip":
        out = (R.T @ part.outward)[sides]
        middle[sides] = np.where(np.abs(out) > 0.3, np.sign(out), 0.0) * (half[sides] - rho)
    crown = max(CROWN, rho * float(np.tan(CROWN_ANGLE / 2)))
    radius = (rho**2 + crown**2) / (2 * crown)
    center = middle + (crown - radius) * normal
    return Cap(R @ center + box.pose[:3, 3], radius, R @ normal, float(np.arcsin(rho / radius))), crown


def _palm(anatomy: Anatomy, q: Array, meet: Array) -> HandRegion | None:
    """A disc on the palm's face that is nearest to where the tips meet; None if that side is not a box or too small."""
    hand, poses = anatomy.hand, anatomy.hand.link_poses(q)
    best: tuple[float, int, Shape, Array] | None = None
    for i in anatomy.palm:
        pose = poses[i]
        spot = pose[:3, :3].T @ (meet - pose[:3, 3])
        for shape in hand.links[i].shapes:
            half = np.array(shape.size) / 2 if shape.kind == "box" else None
            if half is None:
                continue
            local = shape.pose[:3, :3].T @ (spot - shape.pose[:3, 3])
            away = local - np.clip(local, -half, half)
            far = float(np.linalg.norm(away))
            if far > 1e-6 and (best is None or far < best[0]):
                best = far, i, shape, shape.pose[:3, :3] @ away / far
    if best is None:
        return None
    _, i, shape, facing = best
    made = _crowned(shape, _FacingPart(i, "palm", "palm", facing, facing))
    return None if made is None else HandRegion("palm", hand.links[i].name, made[0], "palm", "palm", made[1])


def _cut(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Triangles cut to a fraction of the size of the whole, vertices at one place as one."""
    from trimesh.remesh import subdivide_to_size

    size = float(np.ptp(vertices, axis=0).max()) / FACING_CELLS
    cut, parts = subdivide_to_size(vertices, faces, size, max_iter=12)
    unique, same = np.unique(cut.round(12), axis=0, return_inverse=True)
    return unique, same.reshape(-1)[parts]


def _measured(vertices: Array, faces: Faces) -> tuple[Array, Array, Array]:
    """Middles (k, 3), unit normals (k, 3) and areas (k,) of triangles."""
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    return corners.mean(axis=1), normal / np.maximum(length, 1e-300)[:, None], length / 2


def _sphere(points: Array) -> tuple[Array, float, float]:
    """Centre (3,), radius and largest error [m] of the sphere that is nearest to points, in least squares."""
    A = np.column_stack([2 * points, np.ones(len(points))])
    x = np.linalg.lstsq(A, (points**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(max(x[3] + x[:3] @ x[:3], 0.0)))
    error = np.abs(np.linalg.norm(points - x[:3], axis=1) - radius)
    return x[:3], radius, float(error.max(initial=0.0))


def regions_of(hand: Hand) -> HandRegions:
    """The bundled regions of a bundled hand; for any other hand those that are guessed from its shapes."""
    if hand.source in bundled.names("hand_regions"):
        return load_hand_regions(hand.source, hand)
    return guess_regions(hand)
