"""MJCF in, Hand out: mujoco compiles the file, and the compiled model is read."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.quiet import quiet
from handfast.core.transforms import quaternion_matrix, transform
from handfast.model.hand.hand import Coupling, Hand, Joint, Link, coupling_rows, guess_closing
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape


def read_mjcf(root: Element, path: Path) -> Hand:
    """A hand from an MJCF file.

    A single body below the world is the base, whatever its pose in the world; with several, or if that
    body moves, the world is the base. Geoms that can collide become shapes, meshes as their convex
    hulls; geoms of a fixed world (floors) are left out. Active joint equalities with a linear polynomial
    become couplings. Actuators on joints and fixed tendons become the rows of R, scaled by their gear; a
    tendon whose force can have one sign only can only pull. Without actuators every joint that is
    not the dependent side of a coupling is its own actuator.

    Raises:
        InputError: what mujoco says about an unreadable file, ball or free joints, closed loops,
            equalities or transmissions that are not linear in the joints, planes and height fields.
    """
    import mujoco  # slow to import

    try:
        with quiet():
            m = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, mujoco.FatalError) as fault:
        message = " ".join(str(fault).split()).removeprefix("Error: ")
        raise InputError(message, field=_user_of_file(root, message)) from None

    joints = tuple(_joint(m, j) for j in range(m.njnt))
    top = [b for b in range(1, m.nbody) if m.body_parentid[b] == 0]
    if not top:
        raise InputError("has no bodies; a hand is needed")
    world_is_base = len(top) > 1 or m.body_jntnum[top[0]] > 0
    bodies = list(range(0 if world_is_base else 1, m.nbody))
    links = []
    for b in bodies:
        first = b == bodies[0]
        pose = np.eye(4) if first else transform(m.body_pos[b], quaternion_matrix(m.body_quat[b]))
        shapes = () if b == 0 else tuple(_shapes(m, b))
        own = tuple(int(m.body_jntadr[b]) + k for k in range(m.body_jntnum[b]))
        parent = -1 if first else bodies.index(int(m.body_parentid[b]))
        links.append(Link(m.body(b).name or f"body_{b}", parent, pose, own, shapes))

    couplings = tuple(_coupling(m, e) for e in range(m.neq) if m.eq_active0[e])
    A = coupling_rows(couplings, m.njnt)
    mechanism = _mechanism(m, joints, couplings, A)
    closing = guess_closing(joints, couplings)
    name = m.names[: m.names.find(b"\0")].decode() or path.stem
    return Hand(name, tuple(links), joints, mechanism, couplings, closing, source=str(path))


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
        raise InputError(
            f"is a {word} joint; a hand is a tree of hinges and slides on a fixed base", field=f"joint {name}"
        )
    lower, upper = m.jnt_range[j] if m.jnt_limited[j] else (-2 * np.pi, 2 * np.pi)
    ref = float(m.qpos0[m.jnt_qposadr[j]])
    hinge = kind == mujoco.mjtJoint.mjJNT_HINGE
    axis, anchor = m.jnt_axis[j], m.jnt_pos[j]
    return Joint(name, "revolute" if hinge else "prismatic", axis, anchor, float(lower), float(upper), ref)


LARGEST = 1e50  # [m] twice as much is a number, too, and refused with its own name


def _shapes(m: Any, body: int) -> list[Shape]:
    import mujoco

    kinds = mujoco.mjtGeom
    shapes: list[Shape] = []
    for g in range(m.body_geomadr[body], m.body_geomadr[body] + m.body_geomnum[body]):
        if not (m.geom_contype[g] or m.geom_conaffinity[g]):
            continue
        size, kind = np.minimum(m.geom_size[g], LARGEST), kinds(m.geom_type[g])
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
    return shapes


def _coupling(m: Any, e: int) -> Coupling:
    import mujoco

    name = m.eq(e).name or str(e)
    kind = mujoco.mjtEq(m.eq_type[e])
    if kind != mujoco.mjtEq.mjEQ_JOINT:
        word = kind.name.removeprefix("mjEQ_").lower()
        raise InputError(
            f"is of type {word}; only couplings between two joints are understood", field=f"equality {name}"
        )
    a = m.eq_data[e, :5].tolist()
    if any(a[2:]):
        raise InputError(f"has polycoef {a}; it must be linear", field=f"equality {name}")
    joint, driver = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
    ref = float(m.qpos0[m.jnt_qposadr[joint]])  # mujoco couples displacements from the reference pose
    if driver < 0:
        return Coupling(joint, -1, 0.0, ref + a[0])
    return Coupling(joint, driver, a[1], ref + a[0] - a[1] * float(m.qpos0[m.jnt_qposadr[driver]]))


def _mechanism(m: Any, joints: tuple[Joint, ...], couplings: tuple[Coupling, ...], A: Array) -> Mechanism:
    if m.nu == 0:
        driven = [j for j in range(m.njnt) if j not in {c.joint for c in couplings}]
        R = np.eye(m.njnt)[driven]
        return Mechanism(tuple(joints[j].name for j in driven), R, A, (False,) * len(driven))
    names, rows, tendon = [], np.zeros((m.nu, m.njnt)), []
    for u in range(m.nu):
        names.append(m.actuator(u).name or f"actuator_{u}")
        rows[u], on_tendon = _transmission(m, u, names[-1])
        sign = _one_sign(m, u) if on_tendon else 0
        rows[u] *= sign or 1
        tendon.append(sign != 0)
    return Mechanism(tuple(names), rows, A, tuple(tendon))


def _transmission(m: Any, u: int, name: str) -> tuple[Array, bool]:
    """The row of R of an actuator (motion of the actuator per joint motion), and whether it is a tendon."""
    import mujoco

    row, gear, target = np.zeros(m.njnt), float(m.actuator_gear[u, 0]), int(m.actuator_trnid[u, 0])
    kinds = mujoco.mjtTrn
    kind = kinds(m.actuator_trntype[u])
    if kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
        row[target] = gear
        return row, False
    if kind == kinds.mjTRN_TENDON:
        for w in range(m.tendon_adr[target], m.tendon_adr[target] + m.tendon_num[target]):
            if m.wrap_type[w] != mujoco.mjtWrap.mjWRAP_JOINT:
                raise InputError("pulls a spatial tendon; a fixed one is needed", field=f"actuator {name}")
            row[m.wrap_objid[w]] += gear * m.wrap_prm[w]
        return row, True
    word = kind.name.removeprefix("mjTRN_").lower()
    raise InputError(f"acts on a {word}; joints and fixed tendons are understood", field=f"actuator {name}")


def _one_sign(m: Any, u: int) -> int:
    """+1 or -1 if the actuator's force can have that sign only, else 0."""
    ranges = [m.actuator_forcerange[u]] if m.actuator_forcelimited[u] else []
    plain = not m.actuator_biasprm[u].any()  # the control is a force, not a position to hold
    if m.actuator_ctrllimited[u] and plain:
        ranges.append(m.actuator_ctrlrange[u] * np.sign(m.actuator_gainprm[u, 0]))
    for r in ranges:
        low, high = min(r), max(r)
        if low >= 0 < high:
            return 1
        if high <= 0 > low:
            return -1
    return 0
