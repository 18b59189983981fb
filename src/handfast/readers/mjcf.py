"""MJCF in, Hand out: mujoco compiles the file, and the compiled model is read."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from handfast.core.errors import FaultsOf, InputError, unknown_name
from handfast.core.libraries import quiet
from handfast.core.limited import limited
from handfast.core.transforms import quaternion_matrix, transform
from handfast.model.hand.hand import Hand, Joint, Link, coupling_rows, guess_closing, refuse_large
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape
from handfast.readers.mjcf_mechanism import (
    ModelPart,
    joint_law,
    mechanism,
    non_colliding,
    passive_tendons,
    say_what_is_left_out,
    strengths,
    ties,
)

UNNAMED = "MuJoCo Model"  # what mujoco calls a model whose file gives no name
MIN_RADIAN_RANGE = 0.11  # [rad] 2 pi degrees: a full turn in radians, taken for degrees
LOG = logging.getLogger("handfast")
UNMOVED = 1e-12  # of the pose of a body that stands in the world's frame


def read_mjcf(root: Element, path: Path, base: str | None = None) -> Hand:
    """A hand from an MJCF file: see `hand_of_model`. It is compiled within the limits of `limited`.

    Raises:
        InputError: what mujoco says about an unreadable file, more memory or time than it may take, and as
            `hand_of_model`.
    """
    import mujoco  # noqa: F401, slow to import: once, here, and not in each process that compiles

    hand = hand_of_model(limited(_compiled, root, path), base, name=path.stem, source=str(path))
    if not any(compiler.get("angle") for compiler in root.iter("compiler")):
        _doubt_degrees(hand, path)
    return hand


def _compiled(root: Element, path: Path) -> Any:
    """The `mujoco.MjModel` of a file."""
    import mujoco

    try:
        return _made(lambda: mujoco.MjModel.from_xml_path(str(path)))
    except InputError as fault:
        raise InputError(fault.problem, field=_user_of_file(root, fault.problem)) from None
    except RuntimeError:  # an exception of its own that it does not know, as where there is no more memory
        raise InputError("is not compiled by mujoco, which gives no reason; it may take too much memory") from None


def _made(compiled: Callable[[], Any]) -> Any:
    """An `mujoco.MjModel`; `InputError` with what mujoco says if there is none."""
    import mujoco

    try:
        with quiet():
            return compiled()
    except (ValueError, mujoco.FatalError) as fault:
        raise InputError(" ".join(str(fault).split()).removeprefix("Error: ")) from None


def _doubt_degrees(hand: Hand, path: Path) -> None:
    """Warn where a file that does not say so may mean radians, as parts do that belong into a larger model.

    mujoco takes degrees for granted: a joint of 0 to 1.2 rad then turns a fiftieth of that.
    """
    turning = [j for j in hand.joints if j.type == "revolute" and np.isfinite([j.lower, j.upper]).all()]
    widest = max((j.upper - j.lower for j in turning), default=MIN_RADIAN_RANGE)
    if widest < MIN_RADIAN_RANGE:
        LOG.warning(
            '%s: no joint turns more than %.2g degrees; if its limits are radians, it needs <compiler angle="radian"/>',
            path,
            np.degrees(widest),
        )


def hand_of_spec(spec: Any, base: str | None = None) -> Hand:
    """A hand from an `mujoco.MjSpec`, compiled as it is; as `hand_of_model`."""
    with FaultsOf("MjSpec"):
        m = _made(spec.compile)
    return hand_of_model(m, base)


def hand_of_model(m: Any, base: str | None = None, *, name: str = "hand", source: str = "") -> Hand:
    """A hand from a compiled `mujoco.MjModel`.

    A single body below the world that stands in the world's own frame is the base; with several, if that body
    moves, or if it has a pose of its own in the world, the world is the base, so that every pose is kept. Geoms that
    can collide become shapes, meshes as their convex hulls; geoms of a fixed world (floors) are left out. Active
    equalities become couplings (joint, or fixed tendons of two joints, linear) and loops (connect, weld). Actuators
    on joints and fixed tendons become the rows of R, scaled by their gear; a tendon whose force can have one sign
    only can only pull. frictionloss is dry friction, stiffness with springref a spring, a limited range stops, of
    joints and of fixed tendons alike; what of these is not understood is named in a warning. Damping and armature
    have no part at rest. Geoms with condim 4 or 6 are soft fingers with the torsional coefficient of their friction,
    for `find_contacts` to use; that of rolling is left out. Without actuators every joint that follows from no other is
    its own actuator. Pairs of links that an exclude names, or whose contype and conaffinity never meet, are not checked
    against each other.

    Args:
        base: name of a body: only what hangs on it is read, in its frame, without its own joints.
        name: for a model without a name.
        source: for the record.

    Raises:
        InputError: ball or free joints, equalities or transmissions that are not understood or lead out of the part
            that is read, loops that cannot be closed, planes and height fields, an unknown base.
    """
    part = _part(m, base)
    refuse_large(len(part.bodies), len(part.joints), int(m.body_geomnum[list(part.bodies)].sum()))
    joints = tuple(_joint(m, j) for j in part.joints)
    say_what_is_left_out(part, source or name)
    links = []
    for b in part.bodies:
        first = b == part.bodies[0]
        pose = np.eye(4) if first else transform(m.body_pos[b], quaternion_matrix(m.body_quat[b]))
        found = [] if b == 0 else _shapes(m, b)
        shapes, torsion = tuple(shape for shape, _ in found), tuple(soft for _, soft in found)
        own = tuple(part.column[j] for j in part.joints if m.jnt_bodyid[j] == b)
        parent = -1 if first else part.row[int(m.body_parentid[b])]
        links.append(Link(part.link_name(b), parent, pose, own, shapes, torsion if any(torsion) else ()))
    couplings, loops = ties(part)
    A = coupling_rows(couplings, len(joints))
    drives = mechanism(part, joints, couplings, A)
    given = m.names[: m.names.find(b"\0")].decode()
    hand = Hand(
        name if given in ("", UNNAMED) else given,
        tuple(links),
        joints,
        drives,
        couplings,
        guess_closing(joints, couplings),
        source=source,
        non_colliding=non_colliding(part),
        loops=loops,
        tendons=passive_tendons(part),
        strengths=strengths(part, drives),
    )
    if loops and m.nu == 0:
        follow = {joints[j].name for j in hand.dependent}
        rows = [i for i, n in enumerate(drives.actuators) if n not in follow]
        names = tuple(drives.actuators[i] for i in rows)
        hand = replace(hand, mechanism=Mechanism(names, drives.R[rows], A, (False,) * len(rows)))
    return _closing_by_motors(hand) if loops else hand


def _part(m: Any, base: str | None) -> ModelPart:
    """What is read of a model: all of it, or what hangs on one body."""
    if base is None:
        top = [b for b in range(1, m.nbody) if m.body_parentid[b] == 0]
        if not top:
            raise InputError("has no bodies; a hand is needed")
        own = np.abs([*m.body_pos[top[0]], *m.body_quat[top[0], 1:]]).max() > UNMOVED
        world = len(top) > 1 or own or m.body_jntnum[top[0]] > 0
        return ModelPart(m, tuple(range(0 if world else 1, m.nbody)), tuple(range(m.njnt)), whole=True)
    names = [m.body(b).name for b in range(m.nbody)]
    if base not in names:
        raise unknown_name("link", base, [n for n in names if n], field="root")
    below = [names.index(base)]
    for b in range(below[0] + 1, m.nbody):
        if m.body_parentid[b] in below:
            below.append(b)
    return ModelPart(m, tuple(below), tuple(j for j in range(m.njnt) if m.jnt_bodyid[j] in below[1:]), whole=False)


def _closing_by_motors(hand: Hand) -> Hand:
    """Closing senses where loops decide: joints that follow go where the motors' joints take them.

    Idle joints do not close by themselves.
    """
    closing = np.array(hand.closing)
    closing[list(hand.idle)] = 0
    for j, row in zip(hand.dependent, hand.loop_rows(hand.assembled, refuse=False), strict=True):
        others = row.copy()
        others[j] = 0.0
        closing[j] = np.sign(-(others @ closing).round(9))
    named = {n: int(s) for n, s in zip(hand.joint_names, closing, strict=True)}
    return hand.with_closing(named)


def _user_of_file(root: Element, message: str) -> str | None:
    """The link whose mesh file a message of mujoco's names, for a file that is missing."""
    for mesh in root.iter("mesh"):
        file = mesh.get("file", "")
        name = mesh.get("name", Path(file).stem)
        if file and file in message:
            for body in root.iter("body"):
                if any(geom.get("mesh") == name for geom in body.findall("geom")):
                    return f"link {body.get('name', '?')}"
    return None


def _joint(m: Any, j: int) -> Joint:
    import mujoco

    name = m.joint(j).name or f"joint_{j}"
    kind = mujoco.mjtJoint(m.jnt_type[j])
    if kind not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
        word = "free" if kind == mujoco.mjtJoint.mjJNT_FREE else "ball"
        right = "a hand has hinges and slides on a fixed base (root=LINK reads a part of a scene)"
        raise InputError(f"is a {word} joint; {right}", field=f"joint {name}")
    lower, upper = m.jnt_range[j] if m.jnt_limited[j] else (-2 * np.pi, 2 * np.pi)
    ref = float(m.qpos0[m.jnt_qposadr[j]])
    hinge = kind == mujoco.mjtJoint.mjJNT_HINGE
    axis, anchor, law = m.jnt_axis[j], m.jnt_pos[j], joint_law(m, j)
    return Joint(name, "revolute" if hinge else "prismatic", axis, anchor, float(lower), float(upper), ref, law)


MAX_GEOM_SIZE = 1e50  # [m] twice as much is a number, too, and refused with its own name


def _shapes(m: Any, body: int) -> list[tuple[Shape, float]]:
    """Shapes of the geoms that can collide, and their torsional friction [m]: of condim 4 and 6, else none."""
    import mujoco

    kinds = mujoco.mjtGeom
    shapes: list[Shape] = []
    torsion: list[float] = []
    for g in range(m.body_geomadr[body], m.body_geomadr[body] + m.body_geomnum[body]):
        if not (m.geom_contype[g] or m.geom_conaffinity[g]):
            continue
        torsion.append(float(m.geom_friction[g, 1]) if m.geom_condim[g] >= 4 else 0.0)
        size, kind = np.minimum(m.geom_size[g], MAX_GEOM_SIZE), kinds(m.geom_type[g])
        pose = transform(m.geom_pos[g], quaternion_matrix(m.geom_quat[g]))
        name = m.geom(g).name or f"{m.body(body).name}/{len(shapes)}"
        match kind:
            case kinds.mjGEOM_BOX:
                shapes.append(Shape("box", 2 * size, pose, name=name))
            case kinds.mjGEOM_SPHERE:
                shapes.append(Shape("sphere", size[:1], pose, name=name))
            case kinds.mjGEOM_ELLIPSOID:
                shapes.append(Shape("ellipsoid", size, pose, name=name))
            case kinds.mjGEOM_CAPSULE | kinds.mjGEOM_CYLINDER:
                word = "capsule" if kind == kinds.mjGEOM_CAPSULE else "cylinder"
                shapes.append(Shape(word, (size[0], 2 * size[1]), pose, name=name))  # type: ignore[arg-type]
            case kinds.mjGEOM_MESH:
                mesh = m.geom_dataid[g]
                start = m.mesh_vertadr[mesh]
                shapes.append(Shape.hull(m.mesh_vert[start : start + m.mesh_vertnum[mesh]], pose, name))
            case _:
                word = kind.name.removeprefix("mjGEOM_").lower()
                raise InputError(
                    f"is a {word}; boxes, spheres, capsules, cylinders, ellipsoids and meshes are understood",
                    field=f"geom {name}",
                )
    return list(zip(shapes, torsion, strict=True))
