"""Equations (1) to (8) of the stability paper, with the signs of its virtual work; `judge.py` asks them of answers.

Source: Haas-Heger and Ciocarlie, "Accurate Energetic Constraints for Passive Grasp Stability
Analysis", 2020, section III; (17) is in section VI. Nothing here knows how a solution was found.

Conventions: c_i = (c_n, c_t1, c_t2) is the force of the hand **on the object** [N], in the contact
frame whose n points into the object. Motions are virtual: the contact springs have unit stiffness,
so a motion is measured by the force it causes (d in N, r in N and N/m, q in N/m per joint unit).

Errata applied: (2) is tau = +J^T c (printed with the other sign); (17) unloads the contact.

Beyond the paper a joint may have dry friction, a stop and a given torque, and a motor may be backdrivable: the laws of
joints, see `joint_balance`, `reaction_range` and docs/joint-laws.md. A contact may be a soft finger, which carries a
torque about its normal, the torsion: (5) to (7) are then about three components, c_t and torsion over `Grasp.levers`,
which is a force too, and the motions that belong to them, see `friction` and docs/soft-fingers.md.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from handfast.core.arrays import Array, Indices, Mask, frozen, times, transposed_times
from handfast.model.grasp import Grasp
from handfast.proofs.states import State
from handfast.stability.problem.grasp_rows import AnyGrasp

NO_ARM = 1e-14  # relative: an arm that rounding makes


def state_of(
    r: ArrayLike,
    q: ArrayLike,
    c: ArrayLike,
    f: ArrayLike,
    coupling: ArrayLike,
    reaction: ArrayLike | None = None,
    torsion: ArrayLike | None = None,
) -> State:
    """A candidate solution of the model, of arrays that cannot be written to.

    Args:
        r: (6,) virtual object motion, translation then rotation, object frame.
        q: (l,) virtual joint motion.
        c: (3m,) contact forces (n, t1, t2 each) [N].
        f: (a,) actuator forces [N m or N].
        coupling: (k,) multipliers lambda of the rigid couplings A q = 0.
        reaction: (l,) rho, what the joints themselves carry by dry friction and at stops [N m or N]; 0 unless given.
        torsion: (m,) torques about the normals [N m], of the hand on the object; 0 unless given, as of point contacts.
    """
    reaction = np.zeros(np.shape(q)) if reaction is None else reaction
    torsion = np.zeros(np.size(c) // 3) if torsion is None else torsion
    parts = [np.asarray(x, dtype=float) for x in (r, q, c, f, coupling, reaction, torsion)]
    return State(*(frozen(x, x.shape, name.name) for x, name in zip(parts, fields(State), strict=True)))


def scaled(x: State, s: float) -> State:
    """A state times s: with w and the commands times s it solves the model again (homogeneity)."""
    return state_of(*(s * getattr(x, f.name) for f in fields(x)))


def lengths(x: Array) -> Array:
    """(...) lengths of vectors (..., n); `np.linalg.norm` takes three times as long."""
    out: Array = np.sqrt((x * x).sum(axis=-1))
    return out


@dataclass(frozen=True, eq=False)
class StateRows:
    """k states of one grasp as they were found, see `State`: (k, 6), (k, l), (k, 3m), (k, a), (k, couplings), (k, l).

    Their contacts carry no torsion: soft fingers are asked about one by one.
    """

    r: Array
    q: Array
    c: Array
    f: Array
    coupling: Array
    reaction: Array

    @property
    def torsion(self) -> Array:
        """(k, m) zeros."""
        return np.zeros((len(self.c), self.c.shape[1] // 3))

    def rows(self, which: Mask | Indices) -> StateRows:
        """Some of them."""
        return StateRows(*(getattr(self, f.name)[which] for f in fields(self)))

    def row(self, i: int) -> State:
        """One of them."""
        return state_of(*(getattr(self, f.name)[i] for f in fields(self)))

    def times(self, s: Array) -> StateRows:
        """Each times a number of (k,): with load and commands times these they solve the model again."""
        return StateRows(*(s[:, None] * getattr(self, f.name) for f in fields(self)))


# --- the equations, one function each; of one state, or of many in rows (..., n), of one grasp or of one each -----


def twisting(grasp: AnyGrasp, torsion: Array) -> Array:
    """(s,) [N] torsions (m,) of the soft fingers over their levers, comparable with c_t."""
    out: Array = torsion[..., grasp.soft] / grasp.levers
    return out


def object_balance(grasp: AnyGrasp, c: Array, w: Array, torsion: Array | None = None) -> Array:
    """(6,) G c + w, zero in equilibrium: equation (1), with the torsions (m,) of soft fingers."""
    out: Array = times(grasp.G, c) + w
    if torsion is None or not len(grasp.soft):
        return out
    return out + twisting(grasp, torsion) @ grasp.twist_map.T


def joint_torques(grasp: AnyGrasp, c: Array, torsion: Array | None = None) -> Array:
    """(l,) tau = J^T c: equation (2) with the sign that its own virtual work demands, and torsions (m,)."""
    if torsion is None or not len(grasp.soft):
        return transposed_times(grasp.J, c)
    out: Array = c @ grasp.J + twisting(grasp, torsion) @ grasp.twist_jacobian
    return out


def joint_balance(
    grasp: AnyGrasp,
    c: Array,
    f: Array,
    coupling: Array,
    reaction: Array | None = None,
    torsion: Array | None = None,
) -> Array:
    """(l,) J^T c - R^T f - A^T lambda - given - rho, zero when all of these together carry the joint torques.

    rho: (l,) the joints' reactions, none by default; given: the torques that springs and the like exert whatever moves.
    torsion: (m,) of the contacts.
    """
    mech = grasp.mechanism
    out = joint_torques(grasp, c, torsion) - transposed_times(mech.R, f) - transposed_times(mech.A, coupling)
    if not grasp.has_laws:
        return out
    return out - grasp.given_torques - (0.0 if reaction is None else reaction)


def relative_motion(grasp: AnyGrasp, r: Array, q: Array) -> Array:
    """(3m,) d = G^T r - J q, motion of the object relative to the finger, contact frames: equation (3)."""
    return transposed_times(grasp.G, r) - times(grasp.J, q)


def turning(grasp: AnyGrasp, r: Array, q: Array) -> Array:
    """(s,) turning of the object against each soft finger about the normal, times the lever: (3) for torsion."""
    out: Array = r @ grasp.twist_map - q @ grasp.twist_jacobian.T
    return out


def friction(grasp: AnyGrasp, c: Array, torsion: Array) -> Array:
    """(m, 3) [N] c_t1, c_t2 and torsion over the lever, of each contact; the last is 0 at point contacts."""
    return _with_twist(grasp, c, twisting(grasp, torsion))


def sliding(grasp: AnyGrasp, d: Array, turned: Array) -> Array:
    """(m, 3) d_t1, d_t2 and `turning` (s,) of each contact: what `friction` works against."""
    return _with_twist(grasp, d, turned)


def _with_twist(grasp: AnyGrasp, x: Array, twist: Array) -> Array:
    """(m, 3) tangential components of x (3m,), and those of the soft fingers (s,)."""
    out = np.zeros((*x.shape[:-1], grasp.m, 3))
    out[..., :2] = x.reshape(*x.shape[:-1], grasp.m, 3)[..., 1:]
    out[..., grasp.soft, 2] = twist
    return out


def normal_motion(d: Array, eta: float = 0.0) -> Array:
    """(..., m) d_n of motions (3m,) or (..., m, 3), for eta > 0 [rad] at the worst normal: equation (17).

    d^_n = d_n cos(eta) + |d_t| sin(eta). Printed with a minus, which would load the contact; the worst normal unloads
    it.
    """
    d = d.reshape(-1, 3) if d.ndim == 1 else d
    return d[..., 0] * np.cos(eta) + lengths(d[..., 1:]) * np.sin(eta)


def spring_force(d: Array, eta: float = 0.0, gaps: Array | float = 0.0) -> Array:
    """(m,) c_n = max(0, -d_n), unilateral springs of unit stiffness: equation (4).

    gaps: (m,) [N] d_n from before the step, see `Start`.
    """
    return np.maximum(0.0, -(gaps + normal_motion(d, eta)))


def cone_excess(normal: Array, rubs: Array, mu: Array) -> Array:
    """(m,) |c_t| - mu c_n, not positive inside the friction cone: equation (5).

    normal: (m,) c_n; rubs: (m, 3) `friction`.
    """
    return lengths(rubs) - mu * normal


def dissipation_defect(normal: Array, rubs: Array, slides: Array, mu: Array) -> Array:
    """(m, 3) c_t |d_t| + mu c_n d_t, zero when friction opposes sliding at full strength: (6), (7).

    Also zero where nothing slides, so one expression covers both cases of (7) together with (5).
    normal: (m,) c_n; rubs, slides: (m, 3) `friction` and `sliding`.
    """
    return rubs * lengths(slides)[..., None] + (mu * normal)[..., None] * slides


def actuator_motion(grasp: AnyGrasp, q: Array) -> Array:
    """(a,) t = R q, the actuator displacements that equation (8) speaks of."""
    return times(grasp.mechanism.R, q)


def commanded(grasp: AnyGrasp, command: Array | None = None) -> Mask:
    """(a,) bool: which actuators may move; the rest is locked.

    Those that are commanded, a tendon that may go slack, a motor that can be driven back.
    """
    f_c = grasp.command if command is None else command
    mech = grasp.mechanism
    return (f_c != 0) | np.array(mech.tendon, dtype=bool) | np.array(mech.backdrivable, dtype=bool)


def reaction_range(grasp: AnyGrasp) -> tuple[Array, Array]:
    """(l,) each: lo <= rho <= hi of the joints' reactions, infinite where a stop carries.

    rho = lo where q_j > 0 and hi where q_j < 0: dry friction takes all that it can (maximum dissipation in one
    dimension), and no joint moves into a stop, since nothing equals an infinite reaction. A positive reaction closes.
    Stops that a joint had left before the step are `beyond_stops`.
    """
    friction = grasp.joint_friction
    there = np.ones(grasp.l, dtype=bool) if grasp.start is None else grasp.start.stops == 0
    upper = there & np.array([joint.stop in ("upper", "both") for joint in grasp.joints], dtype=bool)
    lower = there & np.array([joint.stop in ("lower", "both") for joint in grasp.joints], dtype=bool)
    return np.where(upper, -np.inf, -friction), np.where(lower, np.inf, friction)


def beyond_stops(grasp: AnyGrasp, reaction: Array) -> tuple[Array, Array]:
    """(l,) and (..., l): senses of the joints that had left their stop before the step, and what of it stops carry.

    Friction takes F against the step's motion; only where the whole motion comes back to the stop does that carry more.
    """
    side = np.array([{"lower": 1.0, "upper": -1.0}.get(joint.stop, 0.0) for joint in grasp.joints])
    side = side * (0.0 if grasp.start is None else grasp.start.stops > 0)
    return side, side * np.maximum(0.0, side * reaction - grasp.joint_friction)


def reaction_defect(q: Array, reaction: Array, lo: Array, hi: Array) -> Array:
    """(..., l) how far motions and reactions, in the same unit, are from the law of the joints' reactions."""
    outside = np.maximum(lo - reaction, reaction - hi)
    return np.maximum.reduce([outside, np.minimum(q, reaction - lo), np.minimum(-q, hi - reaction)])


# --- scales: what a residual is measured against ------------------------------------------------


def joint_arms(grasp: AnyGrasp) -> Array:
    """(l,) motion of the contacts per unit joint motion: J's column norms.

    A joint that does nothing but turn soft fingers about their normals has their levers for an arm, one that moves
    nothing, or next to nothing for the grasp's size, its unit.
    """
    arms = np.sqrt((grasp.J * grasp.J).sum(axis=-2))
    least, units = NO_ARM * joint_units(grasp), joint_units(grasp)
    if len(grasp.soft):
        arms = np.where(arms > least, arms, np.sqrt((grasp.twist_jacobian**2).sum(axis=0)))
    return np.where(arms > least, arms, units)


def joint_units(grasp: AnyGrasp) -> Array:
    """(l,) torque or force of a joint that counts as much as a unit of force: the grasp's size if it turns, else 1."""
    size = np.asarray(grasp.size)[..., None]
    return np.where([joint.type == "revolute" for joint in grasp.joints], size, 1.0)


def actuator_arms(grasp: AnyGrasp) -> Array:
    """(a,) motion of the contacts per unit actuator motion, the smallest over the joints it drives."""
    return arms_of_actuators(np.abs(grasp.mechanism.R), joint_arms(grasp))


def arms_of_actuators(R: Array, arms: Array) -> Array:
    """The same of |R| and the joints' arms."""
    if not R.size:
        return np.ones(R.shape[:-1])
    least: Array = np.where(R > 0, arms[..., None, :] / np.where(R > 0, R, 1.0), np.inf).min(axis=-1)
    return least


def force_scale(w: Array, c: Array) -> float:
    """[N] the largest force that acts: of the disturbance w (6,), or a contact force of c (3m,); 1 if none does."""
    scale = max(float(np.linalg.norm(w[:3])), float(lengths(c.reshape(-1, 3)).max(initial=0.0)))
    return scale if scale > 0 else 1.0


# --- energy ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Energy:
    """Virtual work of a state [N^2 / unit stiffness]; what goes in must be stored or dissipated.

    Attributes:
        disturbance: w . r.
        preload: f_c . t.
        stored: sum of -c_n d_n, in the contact springs (sum of c_n^2 if eta = 0).
        friction: (m,) -c_t . d_t per contact, with what torsion takes. Negative: friction pushes along the motion,
            energy out of nothing.
        maximum: (m,) mu c_n |d_t| per contact, what the maximum dissipation principle (6) demands.
        given: torque . q of what acts on the joints whatever moves, as springs.
        joints: (l,) -rho q per joint, what its dry friction takes: friction_j |q_j|. Stops do no work.
    """

    disturbance: float
    preload: float
    stored: float
    friction: Array
    maximum: Array
    given: float
    joints: Array

    @property
    def residual(self) -> float:
        """w . r + f_c . t + torque . q - stored - sums of friction, at contacts and in joints.

        Zero in every state that satisfies (1)-(3), (8) and the laws of joints.
        """
        put_in = self.disturbance + self.preload + self.given
        return put_in - self.stored - float(self.friction.sum()) - float(self.joints.sum())

    @property
    def created(self) -> float:
        """Work that friction feeds in rather than dissipates; zero in physics."""
        return float(np.maximum(0.0, -self.friction).sum())


def energy(grasp: Grasp, w: Array, state: State, *, command: Array | None = None) -> Energy:
    """The energy balance of a state, term by term.

    w.r + f_c.t + torque.q = sum c_n^2 + sum mu c_n |d_t| + sum friction_j |q_j|.
    """
    f_c = grasp.command if command is None else command
    d, c = relative_motion(grasp, state.r, state.q).reshape(-1, 3), state.c.reshape(-1, 3)
    rubs = friction(grasp, state.c, state.torsion)
    slides = sliding(grasp, d.reshape(-1), turning(grasp, state.r, state.q))
    return Energy(
        disturbance=float(np.asarray(w) @ state.r),
        preload=float(f_c @ actuator_motion(grasp, state.q)),
        stored=float(-(c[:, 0] * d[:, 0]).sum()),
        friction=-(rubs * slides).sum(axis=1),
        maximum=grasp.mu * c[:, 0] * lengths(slides),
        given=float(grasp.given_torques @ state.q),
        joints=-state.reaction * state.q,
    )
