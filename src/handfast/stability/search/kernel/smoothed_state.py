"""A state to begin Newton's method from where any will do, compiled: equilibrium under smooth laws, made ever sharper.

With the motions u as the only unknowns, every force is a function of them: (4) becomes
c_n = (sqrt(d_n^2 + 4 s^2) - d_n) / 2, (6) and (7) c_t = -mu c_n d_t / sqrt(|d_t|^2 + e^2), and (8) f - f_c the same of
t as c_n of d_n, but stiffer. What is left of (1) and (2) is that no virtual motion does work. At a large e friction is
viscous, and Newton's method arrives from rest; with e halved again and again it is followed to where contacts as good
as stick or slide. That is no proof of anything: `newton.refine` makes an exact state of it, or none.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import larger, quick
from handfast.stability.search.arrays import ANY
from handfast.stability.search.kernel.values import blend

FIRST_SMOOTHING, SHARP = 10.0, 1e-5  # (scaled) where e begins, and about where it ends
SMOOTHING_RATIO, HALVING_END, FIFTH = 0.5, 0.01, 0.2  # e is halved down to NEAR, then a fifth of the last
SMOOTH = 0.1  # s over e
HELD_STIFFNESS = 1e3  # of actuators that do not turn
SMOOTHED_STEPS, SMOOTHED_HALVINGS = 8, 5  # at each e
MET, WORK_SHARE = 1e-10, 1e-2  # work that is none, at the end, and as a share of e before
LOST_MOTION = 1e7  # motions beyond are lost


@quick
def smoothed_state(question, scalar, room):
    """Let `room.start` be nearly a state under the load at this scalar (0 where none is sought).

    False if the way to it was lost, or there is no such way: the balance of energy has the work of the load.
    """
    P = question.lo.shape[0]
    nu = question.DT.shape[0]
    if P == 0 or question.lo[P - 1] != -np.inf or question.sin > 0.0 or question.capped:
        return False
    if question.twist < question.F:  # soft fingers: their third component is not among these laws
        return False
    if room.z.shape[0] > room.jacobian.shape[0] or not question.dissipation:
        return False
    for k in range(nu):
        room.z[k] = 0.0
    e = FIRST_SMOOTHING
    last = e
    while e > SHARP:
        if not sharpened(question, scalar, room, e):
            return False
        last = e
        e *= SMOOTHING_RATIO if e > HALVING_END else FIFTH
    missing(question, scalar, room.z, last, room)
    for k in range(nu):
        room.start[k] = room.z[k]
    return nearest(question, scalar, room)


@quick
def nearest(question, scalar, room):
    """The unknown forces nearest to the forces of `room`, by least squares, into the rest of `room.start`."""
    nu = question.DT.shape[0]
    nv = question.CT.shape[0]
    top = 3 * question.m + 2 * question.a
    C = question.C
    H = room.jacobian
    for k in range(nv):
        room.step[k] = 0.0
        for j in range(nv):
            H[k, j] = 0.0
        H[k, k] = 1e-12
    for i in range(top + (1 if question.objective != ANY else 0)):
        if top > i >= 3 * question.m and (i - 3 * question.m) % 2 == 1:
            continue  # efforts of actuators whose command is sought
        missed = (scalar if i == top else room.c[i]) - question.off[i]
        for k in range(nv):
            x = C[i, nu + k]
            room.step[k] += x * missed
            for j in range(nv):
                H[k, j] += x * C[i, nu + j]
    if not eliminate(H, room.step, nv):
        return False
    for k in range(nv):
        room.start[nu + k] = room.step[k]
    return True


@quick
def sharpened(question, scalar, room, e):
    """Newton's method at this e from the motions in `room.z`; False if they are lost."""
    nu = question.DT.shape[0]
    enough = MET if e * FIFTH <= SHARP else WORK_SHARE * e
    before = missing(question, scalar, room.z, e, room)
    for _ in range(SMOOTHED_STEPS):
        if before <= enough:
            return True
        after = before
        for whole in range(2):
            missing(question, scalar, room.z, e, room)
            slopes(question, room, e, whole == 0)
            if not eliminate(room.jacobian, room.step, nu):
                continue
            for k in range(nu):
                room.unit[k] = room.step[k]
            share = 1.0
            for _ in range(SMOOTHED_HALVINGS):
                for k in range(nu):
                    room.trial[k] = room.z[k] + share * room.unit[k]
                after = missing(question, scalar, room.trial, e, room)
                if after < before * (1.0 - 0.1 * share):
                    break
                share *= 0.5
            if after < before:
                break
        before = after
        most = 0.0
        for k in range(nu):
            room.z[k] = room.trial[k]
            most = larger(most, abs(room.z[k]))
        if not most < LOST_MOTION:
            return False
    return True


@quick
def missing(question, scalar, u, e, room):
    """The virtual work per unknown motion at motions u into `room.step`, forces into `room.c`; returns its length."""
    m = question.m
    D = question.D
    nu = question.DT.shape[0]
    for k in range(room.d.shape[0]):
        room.d[k] = question.before[k]
    blend(u, 0, question.DT, room.d)
    s = SMOOTH * e
    for k in range(nu):
        room.step[k] = D[D.shape[0] - 2, k] + scalar * D[D.shape[0] - 1, k]
    for i in range(m):
        d1 = room.d[3 * i + 1]
        d2 = room.d[3 * i + 2]
        cn = pressed(room.d[3 * i], s)
        drag = question.mu[i] * cn / np.sqrt(d1 * d1 + d2 * d2 + e * e)
        room.c[3 * i] = cn
        room.c[3 * i + 1] = -drag * d1
        room.c[3 * i + 2] = -drag * d2
        for k in range(nu):
            room.step[k] += cn * D[3 * i, k] - drag * (d1 * D[3 * i + 1, k] + d2 * D[3 * i + 2, k])
    for j in range(question.a):
        force = HELD_STIFFNESS * pressed(room.d[3 * m + j], s / HELD_STIFFNESS)
        room.c[3 * m + 2 * j] = force
        for k in range(nu):
            room.step[k] += force * D[3 * m + j, k]
    total = 0.0
    for k in range(nu):
        total += room.step[k] * room.step[k]
    return np.sqrt(total)


@quick
def pressed(gap, s):
    """max(0, -gap), smooth over a length s."""
    size = np.sqrt(gap * gap + 4.0 * s * s)
    return 0.5 * (size - gap) if gap <= 0.0 else 2.0 * s * s / (size + gap)


@quick
def slopes(question, room, e, whole):
    """Minus the derivative of the work at the motions and forces of `room` into `room.jacobian`.

    whole: with what friction gains from normal forces, which is not symmetric; without, a step may be shorter but
    leads downwards where friction is given.
    """
    m = question.m
    D = question.D
    nu = question.DT.shape[0]
    s = SMOOTH * e
    H = room.jacobian
    for k in range(nu):
        for j in range(nu):
            H[k, j] = 0.0
        H[k, k] = 1e-9
    for i in range(m):
        d1 = room.d[3 * i + 1]
        d2 = room.d[3 * i + 2]
        speed = np.sqrt(d1 * d1 + d2 * d2 + e * e)
        u1 = d1 / speed
        u2 = d2 / speed
        gap = room.d[3 * i]
        yields = 0.5 * (1.0 - gap / np.sqrt(gap * gap + 4.0 * s * s))
        drag = question.mu[i] * room.c[3 * i] / speed
        gains = question.mu[i] * yields if whole else 0.0
        for k in range(nu):
            x = yields * D[3 * i, k] - gains * (u1 * D[3 * i + 1, k] + u2 * D[3 * i + 2, k])
            x1 = drag * ((1.0 - u1 * u1) * D[3 * i + 1, k] - u1 * u2 * D[3 * i + 2, k])
            x2 = drag * ((1.0 - u2 * u2) * D[3 * i + 2, k] - u1 * u2 * D[3 * i + 1, k])
            for j in range(nu):
                H[k, j] += x * D[3 * i, j] + x1 * D[3 * i + 1, j] + x2 * D[3 * i + 2, j]
    for i in range(question.a):
        t = room.d[3 * m + i]
        yields = HELD_STIFFNESS * 0.5 * (1.0 - t / np.sqrt(t * t + 4.0 * s * s / (HELD_STIFFNESS * HELD_STIFFNESS)))
        for k in range(nu):
            x = yields * D[3 * m + i, k]
            for j in range(nu):
                H[k, j] += x * D[3 * m + i, j]


@quick
def eliminate(A, x, n):
    """Solve A y = x of the first n by elimination, y into x; False if A is singular to working precision."""
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if not abs(A[best, k]) > 1e-14:
            return False
        if best != k:
            for j in range(k, n):
                y = A[best, j]
                A[best, j] = A[k, j]
                A[k, j] = y
            y = x[best]
            x[best] = x[k]
            x[k] = y
        for i in range(k + 1, n):
            f = A[i, k] / A[k, k]
            if f != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= f * A[k, j]
                x[i] -= f * x[k]
    for k in range(n - 1, -1, -1):
        total = x[k]
        for j in range(k + 1, n):
            total -= A[k, j] * x[j]
        x[k] = total / A[k, k]
    return True
