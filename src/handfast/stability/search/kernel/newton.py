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

from handfast.core.compiled import inner, larger, length, quick
from handfast.stability.search.arrays import ANY
from handfast.stability.search.kernel.values import values

NEWTON_TOLERANCE = 1e-13  # scaled residual at which Newton stops
GOOD = 1e-10  # scaled residual that is accepted when it cannot be lowered further: motions of 1e4 round to 1e-11
NEWTON_STEPS = 12  # Newton steps and their halvings
STEP_HALVINGS = 3
REPAIRS = 5  # changes of modes before giving up
MIN_SLIDE = 1e-9  # sliding less than this has no direction yet
INEQUALITY_SLACK = 1e-10  # an inequality may be missed by this much; the judge allows 1e-9
MIN_GRADIENT_SHARE = 1e-11  # a gradient whose independent part is shorter than this, relatively, adds nothing

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
DRIVEN = 3  # its command is what is sought: t >= 0, f is the command, `question.least` or more
HALTED = 4  # the same with t = 0, f free
RELEASED = 5  # its command is the least: t >= 0


@quick
def least_step(room, count):
    """The shortest step that makes the first `count` residuals zero, by pivoted Gram-Schmidt on their gradients.

    Jacobian and residuals are overwritten. Rows that depend on others to working precision are left out.
    """
    jacobian, residuals, step, unit = room.jacobian, room.residuals, room.step, room.unit
    n = step.shape[0]
    for j in range(n):
        step[j] = 0.0
    for e in range(count):
        total = 0.0
        for j in range(n):
            total += jacobian[e, j] * jacobian[e, j]
        room.sizes[e] = total
        room.rest[e] = total
    for _ in range(min(count, n)):
        pick = -1
        best = MIN_GRADIENT_SHARE * MIN_GRADIENT_SHARE
        for e in range(count):
            if room.sizes[e] > 0.0 and room.rest[e] / room.sizes[e] > best:
                pick = e
                best = room.rest[e] / room.sizes[e]
        if pick < 0:
            return
        scale = 0.0
        for j in range(n):
            scale += jacobian[pick, j] * jacobian[pick, j]
        scale = 1.0 / np.sqrt(scale)
        y = -residuals[pick] * scale
        for j in range(n):
            unit[j] = jacobian[pick, j] * scale
            step[j] += y * unit[j]
        room.sizes[pick] = 0.0
        for e in range(count):
            if room.sizes[e] == 0.0:
                continue
            along = 0.0
            for j in range(n):
                along += unit[j] * jacobian[e, j]
            residuals[e] += along * y
            left = 0.0
            for j in range(n):
                jacobian[e, j] -= along * unit[j]
                left += jacobian[e, j] * jacobian[e, j]
            room.rest[e] = left


@inner
def equations(question, hi, hold, room):
    """Residuals and their gradients over z at the forces and motions of `room`; returns how many the modes ask for."""
    m = question.m
    a = question.a
    n = room.z.shape[0]
    e = 0
    for part in range(m + a + room.side.shape[0]):
        for b in range(5):
            for k in range(8):
                room.gradients[b, k] = 0.0
        width = 1
        soft = -1
        if part < m:
            force = 3 * part  # the first of the values that its equations combine
            motion = 3 * part
            width = 3
            soft = question.soft[part]
            count = contact(part, question, e, room) if soft < 0 else soft_finger(part, question, e, room)
        elif part < m + a:
            force = 3 * m + 2 * (part - m)
            motion = 2 * m + part
            count = actuator(part - m, question, e, room)
        else:
            force = 3 * m + 2 * a + (part - m - a)
            motion = 2 * m + part
            count = limit(part - m - a, question, hi, hold, e, room)
        for b in range(count):
            for j in range(n):
                room.jacobian[e + b, j] = 0.0
            for k in range(width):
                x = room.gradients[b, k]
                if x != 0.0:
                    for j in range(n):
                        room.jacobian[e + b, j] += x * question.C[force + k, j]
                x = room.gradients[b, 3 + k]
                if x != 0.0:
                    for j in range(n):
                        room.jacobian[e + b, j] += x * question.D[motion + k, j]
            if soft >= 0:
                x = room.gradients[b, 6]
                y = room.gradients[b, 7]
                for j in range(n):
                    room.jacobian[e + b, j] += x * question.C[question.twist + soft, j]
                    room.jacobian[e + b, j] += y * question.D[question.turning + soft, j]
        e += count
    return e


@inner
def contact(i, question, e, room):
    """Residuals from e on, and gradients over base values, of a contact; returns how many."""
    residuals, gradients = room.residuals, room.gradients
    cos = question.cos
    sin = question.sin
    mu = question.mu[i]
    first = 3 * i
    cn = room.c[first]
    c1 = room.c[first + 1]
    c2 = room.c[first + 2]
    dn = room.d[first]
    d1 = room.d[first + 1]
    d2 = room.d[first + 2]
    mode = room.modes[i]
    speed = length(d1, d2)
    force = length(c1, c2)
    u1 = d1 / larger(speed, 1e-300)
    u2 = d2 / larger(speed, 1e-300)
    gap = cos * dn + sin * speed
    count = 3
    if mode <= GRAZE:
        for b in range(3):
            residuals[e + b] = room.c[first + b]
            gradients[b, b] = 1.0
    elif mode <= EDGE:
        residuals[e] = cn + cos * dn
        residuals[e + 1] = d1
        residuals[e + 2] = d2
        gradients[0, 0] = gradients[1, 4] = gradients[2, 5] = 1.0
        gradients[0, 3] = cos
    else:
        residuals[e] = cn + gap
        gradients[0, 0] = 1.0
        gradients[0, 3] = cos
        gradients[0, 4] = sin * u1
        gradients[0, 5] = sin * u2
        count = 1
    if mode == SLIDE:
        count = 3
        w = mu * cn
        x1 = u1
        x2 = u2
        if speed <= MIN_SLIDE and force > 0.0:  # not yet sliding: friction keeps its direction
            x1 = -c1 / force
            x2 = -c2 / force
        else:  # (7) divided by |d_t|
            gradients[1, 4] = w * u2 * u2 / larger(speed, 1e-300)
            gradients[1, 5] = gradients[2, 4] = -w * u1 * u2 / larger(speed, 1e-300)
            gradients[2, 5] = w * u1 * u1 / larger(speed, 1e-300)
        residuals[e + 1] = c1 + w * x1
        residuals[e + 2] = c2 + w * x2
        gradients[1, 0] = mu * x1
        gradients[2, 0] = mu * x2
        gradients[1, 1] = gradients[2, 2] = 1.0
    elif mode == GRAZE:
        residuals[e + 3] = gap
        gradients[3, 3] = cos
        gradients[3, 4] = sin * u1
        gradients[3, 5] = sin * u2
        count = 4
    elif mode in (EDGE, RIM):
        residuals[e + count] = force - mu * cn
        gradients[count, 0] = -mu
        gradients[count, 1] = c1 / larger(force, 1e-300)
        gradients[count, 2] = c2 / larger(force, 1e-300)
        count += 1
    return count


@inner
def soft_finger(i, question, e, room):
    """The same of a soft finger: torsion and turning are a third component of friction and of sliding."""
    residuals, gradients = room.residuals, room.gradients
    mu = question.mu[i]
    first = 3 * i
    cn = room.c[first]
    c1 = room.c[first + 1]
    c2 = room.c[first + 2]
    c3 = room.c[question.twist + question.soft[i]]
    dn = room.d[first]
    d1 = room.d[first + 1]
    d2 = room.d[first + 2]
    d3 = room.d[question.turning + question.soft[i]]
    mode = room.modes[i]
    speed = np.sqrt(d1 * d1 + d2 * d2 + d3 * d3)
    force = np.sqrt(c1 * c1 + c2 * c2 + c3 * c3)
    count = 4
    if mode <= GRAZE:
        residuals[e] = cn
        residuals[e + 1] = c1
        residuals[e + 2] = c2
        residuals[e + 3] = c3
        gradients[0, 0] = gradients[1, 1] = gradients[2, 2] = gradients[3, 6] = 1.0
        if mode == GRAZE:
            residuals[e + 4] = dn
            gradients[4, 3] = 1.0
            count = 5
        return count
    residuals[e] = cn + dn
    gradients[0, 0] = gradients[0, 3] = 1.0
    if mode <= EDGE:
        residuals[e + 1] = d1
        residuals[e + 2] = d2
        residuals[e + 3] = d3
        gradients[1, 4] = gradients[2, 5] = gradients[3, 7] = 1.0
    elif mode == SLIDE:
        w = mu * cn
        inverse = 1.0 / larger(speed, 1e-300)
        x1 = d1 * inverse
        x2 = d2 * inverse
        x3 = d3 * inverse
        if speed <= MIN_SLIDE and force > 0.0:  # not yet sliding: friction keeps its direction
            x1 = -c1 / force
            x2 = -c2 / force
            x3 = -c3 / force
        else:  # (7) divided by the speed
            w *= inverse
            gradients[1, 4] = w * (1.0 - x1 * x1)
            gradients[2, 5] = w * (1.0 - x2 * x2)
            gradients[3, 7] = w * (1.0 - x3 * x3)
            gradients[1, 5] = gradients[2, 4] = -w * x1 * x2
            gradients[1, 7] = gradients[3, 4] = -w * x1 * x3
            gradients[2, 7] = gradients[3, 5] = -w * x2 * x3
        residuals[e + 1] = c1 + mu * cn * x1
        residuals[e + 2] = c2 + mu * cn * x2
        residuals[e + 3] = c3 + mu * cn * x3
        gradients[1, 0] = mu * x1
        gradients[2, 0] = mu * x2
        gradients[3, 0] = mu * x3
        gradients[1, 1] = gradients[2, 2] = gradients[3, 6] = 1.0
    else:
        count = 1
    if mode in (EDGE, RIM):
        residuals[e + count] = force - mu * cn
        inverse = 1.0 / larger(force, 1e-300)
        gradients[count, 0] = -mu
        gradients[count, 1] = c1 * inverse
        gradients[count, 2] = c2 * inverse
        gradients[count, 6] = c3 * inverse
        count += 1
    return count


@inner
def actuator(j, question, e, room):
    """The same of an actuator."""
    mode = room.drives[j]
    count = 0
    if mode in (HELD, BALANCED, HALTED):
        room.residuals[e] = room.d[3 * question.m + j]
        room.gradients[0, 3] = 1.0
        count = 1
    if mode in (TURNS, BALANCED, RELEASED):
        room.residuals[e + count] = room.c[3 * question.m + 2 * j] - (question.least if mode == RELEASED else 0.0)
        room.gradients[count, 0] = 1.0
        count += 1
    return count


@inner
def limit(k, question, hi, hold, e, room):
    """The same of a plain force that is at a bound; hold: so is the first, at its lower one."""
    if room.side[k] == 0 and not (k == 0 and hold):
        return 0
    bound = hi[k] if room.side[k] > 0 else question.lo[k]
    room.residuals[e] = room.c[3 * question.m + 2 * question.a + k] - bound
    room.gradients[0, 0] = 1.0
    return 1


@inner
def read(question, tolerance, room):
    """The modes that the point of `room` shows; motions and forces below the tolerance count as none."""
    m = question.m
    for i in range(m):
        k = 3 * i
        if room.c[k] <= tolerance:
            room.modes[i] = OPEN
        elif not question.dissipation:
            room.modes[i] = LOOSE
        else:
            room.modes[i] = SLIDE if speed_of(i, question, room) > tolerance else STICK
    for j in range(question.a):
        turns = room.d[3 * m + j] > tolerance
        if question.driven[j]:
            room.drives[j] = DRIVEN if turns else HALTED
        else:
            room.drives[j] = TURNS if turns else HELD


@inner
def speed_of(i, question, room):
    """How fast a contact slides, a soft finger's turning included."""
    speed = length(room.d[3 * i + 1], room.d[3 * i + 2])
    if question.soft[i] >= 0:
        speed = length(speed, room.d[question.turning + question.soft[i]])
    return speed


@inner
def repair(question, hi, slack, across, room):
    """Change modes where an inequality is violated; True if any was."""
    m = question.m
    first = 3 * m + 2 * question.a
    changed = False
    for i in range(m):
        new = other_contact(i, question, slack, across, room)
        if new != room.modes[i]:
            room.modes[i] = new
            changed = True
    for j in range(question.a):
        t = room.d[3 * m + j]
        force = room.c[3 * m + 2 * j]
        mode = room.drives[j]
        new = mode
        if mode == TURNS and t < -slack:
            new = HELD if across else BALANCED
        elif mode == HELD and force < -slack:
            new = TURNS if across else BALANCED
        elif mode in (DRIVEN, RELEASED) and t < -slack:
            new = HALTED
        elif mode == DRIVEN and force < question.least - slack:
            new = RELEASED
        if new != mode:
            room.drives[j] = new
            changed = True
    for k in range(0 if question.objective == ANY else 1, room.side.shape[0]):  # limits of forces, not the objective's
        x = room.c[first + k]
        new = 1 if x > hi[k] + slack else (-1 if x < question.lo[k] - slack else 0)
        if new != 0 and room.side[k] == 0:
            room.side[k] = new
            changed = True
    return changed


@inner
def other_contact(i, question, slack, across, room):
    """The mode that a contact should have."""
    c = room.c
    d = room.d
    k = 3 * i
    speed = speed_of(i, question, room)
    gap = question.cos * d[k] + question.sin * speed
    force = length(c[k + 1], c[k + 2])
    if question.soft[i] >= 0:
        force = length(force, c[question.twist + question.soft[i]])
    beyond = force - question.mu[i] * c[k]  # of the cone
    mode = room.modes[i]
    if mode == OPEN and gap < -slack:
        closed = (SLIDE if speed > MIN_SLIDE else STICK) if question.dissipation else LOOSE
        return closed if across else GRAZE
    if mode > GRAZE and c[k] < -slack:
        return OPEN
    if mode == STICK and beyond > slack:
        return SLIDE if across else EDGE
    if mode == LOOSE and beyond > slack:
        return RIM
    return mode


@inner
def solve_modes(question, hi, hold, room):
    """Newton's method in the modes of `room` from its z; returns the residual, and the largest force it compares to."""
    n = room.z.shape[0]
    error = np.inf
    force = 1.0
    halvings = 0
    for j in range(n):
        room.trial[j] = room.z[j]
    for _ in range(NEWTON_STEPS):
        values(question, room.trial, room.c, room.d)
        count = equations(question, hi, hold, room)
        worst = 0.0
        force = 1.0
        for e in range(count):
            worst = larger(worst, abs(room.residuals[e]))
        for i in range(question.m):
            force = larger(force, abs(room.c[3 * i]))
        if worst < error:
            error = worst
            halvings = 0
            for j in range(n):
                room.z[j] = room.trial[j]
            if error <= NEWTON_TOLERANCE * force:
                break
            least_step(room, count)
        else:
            halvings += 1
            if halvings == STEP_HALVINGS or error <= GOOD * force:
                break
            for j in range(n):
                room.step[j] *= 0.5
        for j in range(n):
            room.trial[j] = room.z[j] + room.step[j]
    return error, force


@inner
def refine(question, hi, room, tolerance, hold):
    """An exact solution near `room.start`, its forces and motions into room.z, c and d; False if none was found.

    hi: upper bounds of the plain base values. tolerance: below which motions and forces of the start are none. hold:
    keep the objective at its lower bound.
    """
    n = room.z.shape[0]
    for attempt in range(2):
        for j in range(n):
            room.z[j] = room.start[j]
        values(question, room.z, room.c, room.d)
        read(question, tolerance, room)
        for k in range(room.side.shape[0]):
            room.side[k] = 0
        for j in range(n if attempt == 1 else 0):
            room.z[j] = room.first[j]
        for repairs in range(REPAIRS):
            error, force = solve_modes(question, hi, hold, room)
            if not error <= GOOD * force:
                if repairs == 0:
                    return False
                break
            for j in range(n if repairs == 0 else 0):
                room.first[j] = room.z[j]  # where the other way begins, too
            values(question, room.z, room.c, room.d)
            if not repair(question, hi, INEQUALITY_SLACK * force, attempt == 1, room):
                return True
    return False


@inner
def refined(question, worker, room, tolerance, hold):
    """`refine` for Python: 1 if a solution was found."""
    return 1 if refine(question, worker.hi, room, tolerance, hold) else 0
