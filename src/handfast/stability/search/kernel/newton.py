"""From an approximate solution to an exact one, compiled: fix what each contact does, then Newton on (1)-(8).

An approximate point says which contacts are open, stick or slide and which actuators move. With these modes
fixed, what is left of the model over the reduced unknowns z (the linear equations are gone) is a small
system; minimum-norm Newton steps solve it to rounding. Where the result violates an inequality, that
contact, actuator or bound changes its mode, in two ways tried in turn: to the border between two modes (the
inequality becomes an equality, right where a maximum sits on a border), or across it (a sticking contact
slides, right where everything is fixed). `stability/model` judges the result, never this file.
"""

from __future__ import annotations

import numpy as np

from handfast.stability.search.arrays import EXACT, LANE, POINTS, QUESTION, ROW, WORK
from handfast.stability.search.kernel.compiled import inner, larger, length, quick, views
from handfast.stability.search.kernel.values import values

CONVERGED = 1e-13  # scaled residual at which Newton stops
GOOD = 1e-10  # scaled residual that is accepted when it cannot be lowered further: motions of 1e4 round to 1e-11
ITERATIONS = 12  # Newton steps and their halvings
HALVINGS = 3
REPAIRS = 5  # changes of modes before giving up
STILL = 1e-9  # sliding less than this has no direction yet
SLACK = 1e-10  # an inequality may be missed by this much; the judge allows 1e-9
RANK = 1e-11  # a gradient whose independent part is shorter than this, relatively, adds nothing

# what a contact does
OPEN = 0  # c = 0, d^_n >= 0
GRAZE = 1  # c = 0, d^_n = 0
STICK = 2  # c_n = -d^_n, d_t = 0, inside the cone
EDGE = 3  # sticks on the border of the cone
SLIDE = 4  # c_n = -d^_n, friction against the motion
LOOSE = 5  # closed, any friction in the cone: the model without the dissipation principle
RIM = 6  # the same, on the border of the cone
# what an actuator does
HELD = 0  # commanded, t = 0, f >= f_c
TURNS = 1  # commanded, f = f_c, t >= 0
BALANCED = 2  # t = 0 and f = f_c
DRIVEN = 3  # its command is what is sought: t >= 0, f >= 0 is the command
HALTED = 4  # the same with t = 0, f free
RELEASED = 5  # the same with f = 0


@quick
def least_step(J, g, E, q, step, size, unit):  # type: ignore[no-untyped-def]
    """The shortest step with J step = -g, by pivoted Gram-Schmidt on the rows of J (E, n), which is overwritten.

    Rows that depend on others to working precision are left out.
    """
    n = J.shape[1]
    for j in range(n):
        step[j] = 0.0
    for e in range(E):
        total = 0.0
        for j in range(n):
            total += J[e, j] * J[e, j]
        size[e] = total
        q[e] = total
    for _ in range(min(E, n)):
        pick = -1
        best = RANK * RANK
        for e in range(E):
            if size[e] > 0.0 and q[e] / size[e] > best:
                pick = e
                best = q[e] / size[e]
        if pick < 0:
            return
        scale = 0.0
        for j in range(n):
            scale += J[pick, j] * J[pick, j]
        scale = 1.0 / np.sqrt(scale)
        y = -g[pick] * scale
        for j in range(n):
            unit[j] = J[pick, j] * scale
            step[j] += y * unit[j]
        size[pick] = 0.0
        for e in range(E):
            if size[e] == 0.0:
                continue
            along = 0.0
            for j in range(n):
                along += unit[j] * J[e, j]
            g[e] += along * y
            left = 0.0
            for j in range(n):
                J[e, j] -= along * unit[j]
                left += J[e, j] * J[e, j]
            q[e] = left


@inner
def equations(m, a, cos, sin, C, D, mu, lo, hi, hold, touch, motor, side, c, d, G, J, g):  # type: ignore[no-untyped-def]
    """Residuals into g, gradients over z into the rows of J; returns how many equations the modes ask for.

    G (4, 6): room for the gradients of one part's equations over its base values.
    """
    n = J.shape[1]
    parts = m + a + side.shape[0]
    e = 0
    for part in range(parts):
        for b in range(4):
            for k in range(6):
                G[b, k] = 0.0
        count = 0
        first = 3 * part
        width = 3
        if part < m:
            cn = c[first]
            c1 = c[first + 1]
            c2 = c[first + 2]
            dn = d[first]
            d1 = d[first + 1]
            d2 = d[first + 2]
            mode = touch[part]
            speed = length(d1, d2)
            force = length(c1, c2)
            u1 = d1 / larger(speed, 1e-300)
            u2 = d2 / larger(speed, 1e-300)
            gap = cos * dn + sin * speed
            count = 3
            if mode <= GRAZE:
                for b in range(3):
                    g[e + b] = c[first + b]
                    G[b, b] = 1.0
            elif mode <= EDGE:
                g[e] = cn + cos * dn
                g[e + 1] = d1
                g[e + 2] = d2
                G[0, 0] = G[1, 4] = G[2, 5] = 1.0
                G[0, 3] = cos
            else:
                g[e] = cn + gap
                G[0, 0] = 1.0
                G[0, 3] = cos
                G[0, 4] = sin * u1
                G[0, 5] = sin * u2
                count = 1
            if mode == SLIDE:
                count = 3
                w = mu[part] * cn
                x1 = u1
                x2 = u2
                if speed <= STILL and force > 0.0:  # not yet sliding: friction keeps its direction
                    x1 = -c1 / force
                    x2 = -c2 / force
                else:  # (7) divided by |d_t|
                    G[1, 4] = w * u2 * u2 / larger(speed, 1e-300)
                    G[1, 5] = G[2, 4] = -w * u1 * u2 / larger(speed, 1e-300)
                    G[2, 5] = w * u1 * u1 / larger(speed, 1e-300)
                g[e + 1] = c1 + w * x1
                g[e + 2] = c2 + w * x2
                G[1, 0] = mu[part] * x1
                G[2, 0] = mu[part] * x2
                G[1, 1] = G[2, 2] = 1.0
            elif mode == GRAZE:
                g[e + 3] = gap
                G[3, 3] = cos
                G[3, 4] = sin * u1
                G[3, 5] = sin * u2
                count = 4
            elif mode in (EDGE, RIM):
                g[e + count] = force - mu[part] * cn
                G[count, 0] = -mu[part]
                G[count, 1] = c1 / larger(force, 1e-300)
                G[count, 2] = c2 / larger(force, 1e-300)
                count += 1
        elif part < m + a:
            first = 3 * m + 2 * (part - m)
            width = 1
            mode = motor[part - m]
            if mode in (HELD, BALANCED, HALTED):
                g[e] = d[2 * m + part]
                G[0, 3] = 1.0
                count = 1
            if mode in (TURNS, BALANCED, RELEASED):
                g[e + count] = c[first]
                G[count, 0] = 1.0
                count += 1
        else:
            k = part - m - a
            first = 3 * m + 2 * a + k
            width = 1
            if side[k] != 0 or (k == 0 and hold):
                G[0, 0] = 1.0
                g[e] = c[first] - (hi[k] if side[k] > 0 else lo[k])
                count = 1
        for b in range(count):
            for j in range(n):
                J[e + b, j] = 0.0
            for k in range(width):
                x = G[b, k]
                if x != 0.0:
                    for j in range(n):
                        J[e + b, j] += x * C[first + k, j]
                x = G[b, 3 + k]
                if x != 0.0:
                    at = first + k if part < m else 2 * m + part
                    for j in range(n):
                        J[e + b, j] += x * D[at, j]
        e += count
    return e


@inner
def read(m, a, mdp, driven, c, d, tol, touch, motor):  # type: ignore[no-untyped-def]
    """The modes that a point shows; motions and forces below `tol` count as none."""
    for i in range(m):
        k = 3 * i
        if c[k] <= tol:
            touch[i] = OPEN
        elif not mdp:
            touch[i] = LOOSE
        else:
            touch[i] = SLIDE if length(d[k + 1], d[k + 2]) > tol else STICK
    for j in range(a):
        turns = d[3 * m + j] > tol
        if driven[j]:
            motor[j] = DRIVEN if turns else HALTED
        else:
            motor[j] = TURNS if turns else HELD


@inner
def repair(m, a, cos, sin, mdp, mu, lo, hi, objective, c, d, slack, across, touch, motor, side):  # type: ignore[no-untyped-def]
    """Change modes where an inequality is violated; True if any was."""
    changed = False
    for i in range(m):
        k = 3 * i
        speed = length(d[k + 1], d[k + 2])
        gap = cos * d[k] + sin * speed
        excess = length(c[k + 1], c[k + 2]) - mu[i] * c[k]
        mode = touch[i]
        new = mode
        if mode == OPEN and gap < -slack:
            closed = (SLIDE if speed > STILL else STICK) if mdp else LOOSE
            new = closed if across else GRAZE
        elif mode > GRAZE and c[k] < -slack:
            new = OPEN
        elif mode == STICK and excess > slack:
            new = SLIDE if across else EDGE
        elif mode == LOOSE and excess > slack:
            new = RIM
        if new != mode:
            touch[i] = new
            changed = True
    for j in range(a):
        t = d[3 * m + j]
        e = c[3 * m + 2 * j]
        mode = motor[j]
        new = mode
        if mode == TURNS and t < -slack:
            new = HELD if across else BALANCED
        elif mode == HELD and e < -slack:
            new = TURNS if across else BALANCED
        elif mode == DRIVEN and t < -slack:
            new = HALTED
        elif mode == DRIVEN and e < -slack:
            new = RELEASED
        if new != mode:
            motor[j] = new
            changed = True
    for k in range(objective, side.shape[0]):  # limits of forces
        x = c[3 * m + 2 * a + k]
        new = 1 if x > hi[k] + slack else (-1 if x < lo[k] - slack else 0)
        if new != 0 and side[k] == 0:
            side[k] = new
            changed = True
    return changed


@inner
def polish(  # type: ignore[no-untyped-def]
    m, a, cos, sin, mdp, objective, C, D, CT, DT, off, mu, lo, hi, driven, hold, tol, start,
    z, c, d, touch, motor, side, G, J, g, q, size, step, trial, unit, first,
):  # fmt: skip
    """An exact solution near `start` into z (n,) and its base values into c and d; False if none was found.

    hold: keep the objective at its lower bound. tol: below which motions and forces of the start are none.
    """
    n = z.shape[0]
    for attempt in range(2):
        for j in range(n):
            z[j] = start[j]
        values(CT, DT, off, z, c, d)
        read(m, a, mdp, driven, c, d, tol, touch, motor)
        for k in range(side.shape[0]):
            side[k] = 0
        for j in range(n if attempt == 1 else 0):
            z[j] = first[j]
        for repairs in range(REPAIRS):
            error = np.inf
            halvings = 0
            for j in range(n):
                trial[j] = z[j]
            for _ in range(ITERATIONS):
                values(CT, DT, off, trial, c, d)
                E = equations(m, a, cos, sin, C, D, mu, lo, hi, hold, touch, motor, side, c, d, G, J, g)
                worst = 0.0
                force = 1.0
                for e in range(E):
                    worst = larger(worst, abs(g[e]))
                for i in range(m):
                    force = larger(force, abs(c[3 * i]))
                if worst < error:
                    error = worst
                    halvings = 0
                    for j in range(n):
                        z[j] = trial[j]
                    if error <= CONVERGED * force:
                        break
                    least_step(J, g, E, q, step, size, unit)
                else:
                    halvings += 1
                    if halvings == HALVINGS or error <= GOOD * force:
                        break
                    for j in range(n):
                        step[j] *= 0.5
                for j in range(n):
                    trial[j] = z[j] + step[j]
            if not error <= GOOD * force:
                if repairs == 0:
                    return False
                break
            for j in range(n if repairs == 0 else 0):
                first[j] = z[j]  # where the other way begins, too
            values(CT, DT, off, z, c, d)
            slack = SLACK * force
            across = attempt == 1
            if not repair(m, a, cos, sin, mdp, mu, lo, hi, objective, c, d, slack, across, touch, motor, side):
                return True
    return False


def polished(m, a, cos, sin, mdp, objective, hold, tol, question, lane, points, work):  # type: ignore[no-untyped-def]
    """`polish` from a given point: an exact solution near `start` into z; was one found?"""
    C, D, CT, DT, off, mu, lo, _, _, driven = views(question, QUESTION)
    hi = views(lane, LANE)[0]
    start, z = views(points, POINTS)
    enter_row, _, _, delta, _ = views(work, WORK)[ROW:EXACT]
    modes, motors, side, _, c, d, G, J, g, q, size, _, step, trial = views(work, WORK)[EXACT:]
    return polish(
        m, a, cos, sin, mdp, objective, C, D, CT, DT, off, mu, lo, hi, driven, hold != 0, tol, start,
        z, c, d, modes, motors, side, G, J, g, q, size, step, trial, enter_row, delta,
    )  # fmt: skip
