"""What an MJCF model says beside bodies and joints: couplings, loops, motors, pairs that do not collide, joint laws.

The laws of joints and tendons are dry friction, springs and stops.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import FaultsOf, InputError
from handfast.core.transforms import quaternion_matrix, transform
from handfast.model.hand.hand import Coupling, Joint, direct_mechanism
from handfast.model.hand.joint_law import NO_STOPS, JointLaw, PassiveTendon
from handfast.model.hand.loop import Loop
from handfast.model.mechanism import Mechanism

LOG = logging.getLogger("handfast")
ARM = 0.05  # [m] between the three pins that stand for a weld


@dataclass(frozen=True, eq=False)
class ModelPart:
    """The bodies and joints of a compiled model that make the hand, the base first.

    Attributes:
        m: the `mujoco.MjModel`.
        bodies, joints: their numbers in the model, in the order of the hand's links and joints.
        whole: whether that is all of the model.
    """

    m: Any
    bodies: tuple[int, ...]
    joints: tuple[int, ...]
    whole: bool

    @cached_property
    def row(self) -> dict[int, int]:
        """Index of the link of each body; the world's is the base, if that stands in its frame."""
        found = {b: i for i, b in enumerate(self.bodies)}
        return {0: 0, **found} if self.whole else found

    @cached_property
    def column(self) -> dict[int, int]:
        """Index of the hand's joint of each joint."""
        return {j: i for i, j in enumerate(self.joints)}

    def link_name(self, body: int) -> str:
        """Name of a body's link."""
        return self.m.body(body).name or f"body_{body}"

    def concerns(self, field: str, known: dict[int, int], numbers: Sequence[int]) -> bool:
        """Whether what acts on some bodies or joints does so in this part; `InputError` if in it and outside."""
        inside = [n in known for n in numbers]
        if any(inside) and not all(inside):
            raise InputError("ties what is read to what is left out; choose another root", field=field)
        return all(inside)


def ties(part: ModelPart) -> tuple[tuple[Coupling, ...], tuple[Loop, ...]]:
    """The couplings and loops that the model's active equalities make."""
    import mujoco

    m, kinds = part.m, mujoco.mjtEq
    couplings: list[Coupling] = []
    loops: list[Loop] = []
    for e in range(m.neq):
        if not m.eq_active0[e]:
            continue
        field, kind = f"equality {m.eq(e).name or e}", kinds(m.eq_type[e])
        if kind in (kinds.mjEQ_JOINT, kinds.mjEQ_TENDON):
            coefficients = _joint_equality(m, e) if kind == kinds.mjEQ_JOINT else _tendon_equality(m, e, field)
            if part.concerns(field, part.column, list(coefficients)):
                couplings.append(_coupling(part, e, field, coefficients))
        elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            loops += _pins(part, e, field, kind == kinds.mjEQ_WELD)
        else:
            word = kind.name.removeprefix("mjEQ_").lower()
            right = "joint, tendon, connect and weld are understood"
            raise InputError(f"is of type {word}; {right}", field=field)
    return tuple(couplings), tuple(loops)


def _joint_equality(m: Any, e: int) -> dict[int, float]:
    """What a joint equality makes zero, but for a constant: the coefficient of each joint's displacement."""
    joint, driver = int(m.eq_obj1id[e]), int(m.eq_obj2id[e])
    return {joint: 1.0} if driver < 0 else {joint: 1.0, driver: -float(m.eq_data[e, 1])}


def _fixed_tendon(m: Any, t: int) -> dict[int, float] | None:
    """By how much a fixed tendon grows longer per joint; None for a spatial one."""
    import mujoco

    out: dict[int, float] = {}
    for w in range(m.tendon_adr[t], m.tendon_adr[t] + m.tendon_num[t]):
        if m.wrap_type[w] != mujoco.mjtWrap.mjWRAP_JOINT:
            return None
        out[int(m.wrap_objid[w])] = out.get(int(m.wrap_objid[w]), 0.0) + float(m.wrap_prm[w])
    return out


def _tendon_equality(m: Any, e: int, field: str) -> dict[int, float]:
    """The same of an equality of tendons."""
    out: dict[int, float] = {}
    for tendon, factor in ((int(m.eq_obj1id[e]), 1.0), (int(m.eq_obj2id[e]), -float(m.eq_data[e, 1]))):
        runs = _fixed_tendon(m, tendon) if tendon >= 0 else {}
        if runs is None:
            raise InputError("ties a spatial tendon; a fixed one is needed", field=field)
        for j, coefficient in runs.items():
            out[j] = out.get(j, 0.0) + factor * coefficient
    out = {j: c for j, c in out.items() if c}
    if len(out) not in (1, 2):
        raise InputError(f"ties {len(out)} joints; one or two are understood", field=field)
    return out


def _coupling(part: ModelPart, e: int, field: str, coefficients: dict[int, float]) -> Coupling:
    """Of the joint that is named last, unless a motor of its own moves it and not the other."""
    import mujoco

    m = part.m
    a = m.eq_data[e, :5].tolist()
    if any(a[2:]):
        raise InputError(f"has polycoef {a}; it must be linear", field=field)
    order = list(coefficients)
    if m.eq_type[e] == mujoco.mjtEq.mjEQ_TENDON:  # no joint of a tendon is the one that follows
        kinds = mujoco.mjtTrn
        own = [t in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT) for t in m.actuator_trntype]
        motors = {int(j) for j, yes in zip(m.actuator_trnid[:, 0], own, strict=True) if yes}
        order.sort(key=lambda j: j in motors, reverse=True)
        order.reverse()
    # mujoco counts displacements from the reference pose
    ref = {j: float(m.qpos0[m.jnt_qposadr[j]]) for j in order}
    joint, c = order[0], coefficients[order[0]]
    if len(order) == 1 or not coefficients[order[1]]:
        return Coupling(part.column[joint], -1, 0.0, ref[joint] + a[0] / c)
    driver = order[1]
    ratio = -coefficients[driver] / c
    return Coupling(part.column[joint], part.column[driver], ratio, ref[joint] + a[0] / c - ratio * ref[driver])


def _pins(part: ModelPart, e: int, field: str, weld: bool) -> list[Loop]:
    """One pin of a connect equality, three of a weld."""
    import mujoco

    m, data, name = part.m, part.m.eq_data[e], part.m.eq(e).name
    ends = [int(m.eq_obj1id[e]), int(m.eq_obj2id[e])]
    if m.eq_objtype[e] == mujoco.mjtObj.mjOBJ_SITE:  # two sites coincide
        bodies = [int(m.site_bodyid[s]) for s in ends]
        frames = [transform(m.site_pos[s], quaternion_matrix(m.site_quat[s])) for s in ends]
    elif weld:  # the anchor in the second body, that in the first, and how the second is turned in the first
        bodies, frames = ends, [transform(data[3:6], quaternion_matrix(data[6:10])), transform(data[:3])]
    else:
        bodies, frames = ends, [transform(data[:3]), transform(data[3:6])]
    if not part.concerns(field, part.row, bodies):
        return []
    name = name or " and ".join(part.link_name(b) for b in bodies)
    offsets = [np.zeros(3), *(ARM * np.eye(3)[:2] if weld else ())]
    return [
        Loop(name, part.row[bodies[0]], part.row[bodies[1]], *(T[:3, :3] @ x + T[:3, 3] for T in frames))
        for x in offsets
    ]


def non_colliding(part: ModelPart) -> frozenset[tuple[str, str]]:
    """Pairs of links that an exclude names, or no two geoms of which may touch by contype and conaffinity.

    Not those of which the file lists two geoms as a contact pair. Where all this leaves no pair of moving links, a
    simulator was to save time, and links are checked against each other as if contype and conaffinity said nothing:
    a hand does not pass through itself.
    """
    m = part.m
    listed = {
        frozenset((int(m.geom_bodyid[a]), int(m.geom_bodyid[b])))
        for a, b in zip(m.pair_geom1, m.pair_geom2, strict=True)
    }
    excluded = {frozenset((s >> 16, s & 0xFFFF)) for s in m.exclude_signature.tolist()}
    solid: dict[int, set[tuple[int, int]]] = {}
    for b in part.bodies:
        bits = {(int(m.geom_contype[g]), int(m.geom_conaffinity[g])) for g in np.flatnonzero(m.geom_bodyid == b)}
        if b and bits - {(0, 0)}:
            solid[b] = bits - {(0, 0)}
    parents = {frozenset((int(m.body_parentid[b]), b)) for b in solid}  # those are never checked
    every = {frozenset(pair) for pair in combinations(solid, 2)} - parents
    apart = {pair for pair in every - listed if not _meet(*(solid[b] for b in pair))}
    still = m.body_weldid[part.bodies[0]]
    between = {pair for pair in every if all(m.body_weldid[b] != still for b in pair)}
    off = between and not between - apart
    kept = (excluded - listed) | (set() if off else apart)
    pairs = [sorted(pair) for pair in kept if pair.issubset(part.bodies) and len(pair) == 2]
    return frozenset((part.link_name(a), part.link_name(b)) for a, b in pairs)


def _meet(one: set[tuple[int, int]], other: set[tuple[int, int]]) -> bool:
    """Whether any two geoms of two links may touch, by (contype, conaffinity) of each."""
    return any((t & c2) | (t2 & c) for t, c in one for t2, c2 in other)


def mechanism(part: ModelPart, joints: tuple[Joint, ...], couplings: tuple[Coupling, ...], A: Array) -> Mechanism:
    """The motors on the part's joints; without any in the model, one for each joint that is coupled to no other."""
    m, l = part.m, len(joints)
    names: list[str] = []
    rows: list[Array] = []
    tendon: list[bool] = []
    if m.nu == 0:
        return direct_mechanism([joint.name for joint in joints], couplings)
    for u in range(m.nu):
        name = m.actuator(u).name or f"actuator_{u}"
        if not part.whole and _acts_outside(part, u):
            continue
        whole, on_tendon = _transmission(m, u, name)
        row = whole[list(part.joints)]
        sign = _one_sign(m, u) if on_tendon else 0
        names.append(name)
        rows.append(row * (sign or 1))
        tendon.append(sign != 0)
    return Mechanism(tuple(names), np.array(rows).reshape(-1, l), A, tuple(tendon))


def strengths(part: ModelPart, motors: Mechanism) -> dict[str, float]:
    """The largest force of each motor [N m or N], where the model states one.

    The least of what `forcerange` says, what `ctrlrange` says of a motor whose control is its force, and what
    `actuatorfrcrange` of the joint says of one that acts on it; of a range the farther end, of a tendon's the one to
    which it pulls.
    """
    import mujoco

    m, out = part.m, {}
    for u in range(m.nu):
        name = m.actuator(u).name or f"actuator_{u}"
        if name not in motors.actuators:
            continue
        ends = _force_ranges(m, u)
        kind, target, gear = mujoco.mjtTrn(m.actuator_trntype[u]), int(m.actuator_trnid[u, 0]), m.actuator_gear[u, 0]
        if kind in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT) and m.jnt_actfrclimited[target]:
            ends.append(m.jnt_actfrcrange[target] / gear)
        sign = _one_sign(m, u) if motors.tendon[motors.actuators.index(name)] else 0
        most = [float(max(sign * np.array(r)) if sign else np.abs(r).max()) for r in ends]
        if most and 0 < min(most) < np.inf:
            out[name] = min(most)
    return out


def _force_ranges(m: Any, u: int) -> list[Array]:
    """The (2,) ranges of an actuator's force that it states itself, the ends in any order."""
    ranges = [m.actuator_forcerange[u]] if m.actuator_forcelimited[u] else []
    plain = not m.actuator_biasprm[u].any()  # the control is a force, not a position to hold
    if m.actuator_ctrllimited[u] and plain:
        ranges.append(m.actuator_ctrlrange[u] * m.actuator_gainprm[u, 0])
    return ranges


def _transmission(m: Any, u: int, name: str) -> tuple[Array, bool]:
    """(njnt,) motion of an actuator per motion of each joint of the model, and whether it is a tendon."""
    import mujoco

    row, gear, target = np.zeros(m.njnt), float(m.actuator_gear[u, 0]), int(m.actuator_trnid[u, 0])
    kinds = mujoco.mjtTrn
    kind = kinds(m.actuator_trntype[u])
    if kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
        row[target] = gear
        return row, False
    if kind == kinds.mjTRN_TENDON:
        runs = _fixed_tendon(m, target)
        if runs is None:
            raise InputError("pulls a spatial tendon; a fixed one is needed", field=f"actuator {name}")
        for j, coefficient in runs.items():
            row[j] = gear * coefficient
        return row, True
    word = kind.name.removeprefix("mjTRN_").lower()
    raise InputError(f"acts on a {word}; joints and fixed tendons are understood", field=f"actuator {name}")


def _acts_outside(part: ModelPart, u: int) -> bool:
    """Whether an actuator moves nothing of a part of a model."""
    import mujoco

    m, kinds, target = part.m, mujoco.mjtTrn, int(part.m.actuator_trnid[u, 0])
    kind = kinds(m.actuator_trntype[u])
    if kind == kinds.mjTRN_TENDON:
        return not {*(_fixed_tendon(m, target) or ())} & {*part.joints}
    if kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
        return target not in part.joints
    return int(target if kind == kinds.mjTRN_BODY else m.site_bodyid[target]) not in part.bodies


def _one_sign(m: Any, u: int) -> int:
    """+1 or -1 if the actuator's force can have that sign only, else 0."""
    for r in _force_ranges(m, u):
        low, high = min(r), max(r)
        if low >= 0 < high:
            return 1
        if high <= 0 > low:
            return -1
    return 0


def joint_law(m: Any, j: int) -> JointLaw:
    """Of a hinge or slide: frictionloss, stiffness about springref, and the range if it is limited."""
    rest = float(m.qpos_spring[m.jnt_qposadr[j]])
    stiffness = float(m.jnt_stiffness[j]) if _linear(m, "jnt", j) else 0.0
    stops = _ends(m.jnt_range[j]) if m.jnt_limited[j] else NO_STOPS
    with_spring = (stiffness, (rest, rest)) if stiffness else (0.0, (0.0, 0.0))
    with FaultsOf(field=f"joint {m.joint(j).name or j}"):
        return JointLaw(float(m.dof_frictionloss[m.jnt_dofadr[j]]), *with_spring, stops)


def passive_tendons(part: ModelPart) -> tuple[PassiveTendon, ...]:
    """The fixed tendons that have friction, a spring or a range of their own.

    Raises:
        InputError: one that runs over joints of the part that is read and over others.
    """
    m, found = part.m, []
    for t in _with_laws(part):
        name = m.tendon(t).name or str(t)
        runs = {j: c for j, c in (_fixed_tendon(m, t) or {}).items() if c}
        if not runs or not part.concerns(f"tendon {name}", part.column, list(runs)):
            continue
        row = np.zeros(len(part.joints))
        row[[part.column[j] for j in runs]] = list(runs.values())
        stiffness = float(m.tendon_stiffness[t]) if _linear(m, "tendon", t) else 0.0
        spring = (stiffness, _ends(m.tendon_lengthspring[t])) if stiffness else (0.0, (0.0, 0.0))
        stops = _ends(m.tendon_range[t]) if m.tendon_limited[t] else NO_STOPS
        with FaultsOf(field=f"tendon {name}"):
            law = JointLaw(float(m.tendon_frictionloss[t]), *spring, stops)
        if law.any and row.any():
            found.append(PassiveTendon(name, row, law))
    return tuple(found)


def say_what_is_left_out(part: ModelPart, source: str) -> None:
    """Warn of springs that are not linear, and of spatial tendons that do more than follow."""
    m = part.m
    odd = [f"the spring of joint {m.joint(j).name or j}" for j in part.joints if not _linear(m, "jnt", j)]
    for t in _with_laws(part):
        name = m.tendon(t).name or t
        if _fixed_tendon(m, t) is None:
            odd.append(f"friction, spring and range of the spatial tendon {name}")
        elif not _linear(m, "tendon", t):
            odd.append(f"the spring of tendon {name}")
    if odd:
        more = f" and {len(odd) - 4} more" if len(odd) > 4 else ""
        LOG.warning("%s: not read, grasps go without: %s%s", source, ", ".join(odd[:4]), more)


def _with_laws(part: ModelPart) -> list[int]:
    """The tendons with friction, a spring or a range."""
    m = part.m
    has = (m.tendon_frictionloss > 0) | (m.tendon_stiffness > 0) | (m.tendon_limited != 0)
    return [t for t in range(m.ntendon) if has[t] or not _linear(m, "tendon", t)]


def _linear(m: Any, kind: str, i: int) -> bool:
    """Whether a spring is proportional and does not yield; older versions of mujoco know no other."""
    odd = [getattr(m, f"{kind}_{name}", None) for name in ("stiffnesspoly", "springyield")]
    return not any(np.any(values[i]) for values in odd if values is not None)


def _ends(of: Any) -> tuple[float, float]:
    low, high = of
    return float(low), float(high)
