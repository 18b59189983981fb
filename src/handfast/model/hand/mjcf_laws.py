"""What an MJCF model says about joints and tendons besides their motors: dry friction, springs and stops."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from handfast.core.errors import InputError
from handfast.model.hand.joint_law import FREE, JointLaw, PassiveTendon
from handfast.model.hand.mjcf_ties import ModelPart

LOG = logging.getLogger("handfast")


def joint_law(m: Any, j: int) -> JointLaw:
    """Of a hinge or slide: frictionloss, stiffness about springref, and the range if it is limited."""
    rest = float(m.qpos_spring[m.jnt_qposadr[j]])
    stiffness = float(m.jnt_stiffness[j]) if _linear(m, "jnt", j) else 0.0
    stops = _ends(m.jnt_range[j]) if m.jnt_limited[j] else FREE
    with_spring = (stiffness, (rest, rest)) if stiffness else (0.0, (0.0, 0.0))
    try:
        return JointLaw(float(m.dof_frictionloss[m.jnt_dofadr[j]]), *with_spring, stops)
    except InputError as fault:
        raise fault.within(f"joint {m.joint(j).name or j}") from None


def passive_tendons(part: ModelPart) -> tuple[PassiveTendon, ...]:
    """The fixed tendons that have friction, a spring or a range of their own.

    Raises:
        InputError: one that runs over joints of the part that is read and over others.
    """
    m, found = part.m, []
    for t in _with_laws(part):
        name = m.tendon(t).name or str(t)
        if not _fixed(m, t):
            continue
        wraps = range(m.tendon_adr[t], m.tendon_adr[t] + m.tendon_num[t])
        runs = [(int(m.wrap_objid[w]), float(m.wrap_prm[w])) for w in wraps if m.wrap_prm[w]]
        if not runs or not part.concerns(f"tendon {name}", part.column, [j for j, _ in runs]):
            continue
        row = np.zeros(len(part.joints))
        for j, factor in runs:
            row[part.column[j]] += factor
        stiffness = float(m.tendon_stiffness[t]) if _linear(m, "tendon", t) else 0.0
        spring = (stiffness, _ends(m.tendon_lengthspring[t])) if stiffness else (0.0, (0.0, 0.0))
        stops = _ends(m.tendon_range[t]) if m.tendon_limited[t] else FREE
        try:
            law = JointLaw(float(m.tendon_frictionloss[t]), *spring, stops)
        except InputError as fault:
            raise fault.within(f"tendon {name}") from None
        if law.any and row.any():
            found.append(PassiveTendon(name, row, law))
    return tuple(found)


def say_what_is_left_out(part: ModelPart, source: str) -> None:
    """Warn of springs that are not linear, and of spatial tendons that do more than follow."""
    m = part.m
    odd = [f"the spring of joint {m.joint(j).name or j}" for j in part.joints if not _linear(m, "jnt", j)]
    for t in _with_laws(part):
        name = m.tendon(t).name or t
        if not _fixed(m, t):
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


def _fixed(m: Any, t: int) -> bool:
    import mujoco

    kinds = m.wrap_type[m.tendon_adr[t] : m.tendon_adr[t] + m.tendon_num[t]]
    return bool((kinds == mujoco.mjtWrap.mjWRAP_JOINT).all())


def _linear(m: Any, kind: str, i: int) -> bool:
    """Whether a spring is proportional and does not yield; older versions of mujoco know no other."""
    odd = [getattr(m, f"{kind}_{name}", None) for name in ("stiffnesspoly", "springyield")]
    return not any(np.any(values[i]) for values in odd if values is not None)


def _ends(of: Any) -> tuple[float, float]:
    low, high = of
    return float(low), float(high)
