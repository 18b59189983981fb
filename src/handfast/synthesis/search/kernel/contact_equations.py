"""The equations and inequalities of `synthesis.problem` with their derivatives, compiled, in balls."""

from __future__ import annotations

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.balls import add, cross, div, dot, get, mul, put, scale, sub, times
from handfast.synthesis.search.kernel.kinematics import NORMAL, OF_BALLS
from handfast.synthesis.task_groups import CAP_REGION, POSE, PRISMATIC, QUATERNION

chain, surface = OF_BALLS


@inner
def rotation(x, first, out):
    """Rotation of the unnormalised quaternion x[first:first+4] and its derivatives: out (5, 3, 3, 2)."""
    size = (0.0, 0.0)
    for i in range(4):
        size = add(size, mul(get(x, first + i), get(x, first + i)))
    inverse = div((1.0, 0.0), size)
    w = get(x, first)
    square = mul(w, w)
    for i in range(3):
        square = sub(square, mul(get(x, first + 1 + i), get(x, first + 1 + i)))
    for i in range(3):
        vi = get(x, first + 1 + i)
        for j in range(3):
            vj = get(x, first + 1 + j)
            entry = scale(2.0, mul(vi, vj))
            for d in range(5):
                put(out[d, i], j, (0.0, 0.0))
            put(out[1 + i + 1, i], j, scale(2.0, vj))
            put(out[1 + j + 1, i], j, add(get(out[1 + j + 1, i], j), scale(2.0, vi)))
            if i == j:
                entry = add(entry, square)
                put(out[1, i], j, scale(2.0, w))
                for d in range(3):
                    put(out[2 + d, i], j, sub(get(out[2 + d, i], j), scale(2.0, get(x, first + 1 + d))))
            else:
                l = 3 - i - j
                sign = -2.0 if (i + 1) % 3 == j else 2.0
                vl = get(x, first + 1 + l)
                entry = add(entry, scale(sign, mul(w, vl)))
                put(out[1, i], j, scale(sign, vl))
                put(out[2 + l, i], j, add(get(out[2 + l, i], j), scale(sign, w)))
            put(out[0, i], j, mul(entry, inverse))
            for d in range(4):
                part = scale(2.0, mul(get(x, first + d), get(out[0, i], j)))
                put(out[1 + d, i], j, mul(sub(get(out[1 + d, i], j), part), inverse))


@inner
def turned(rotations, y, out, slope):
    """R y into `out` (3, 2) and its derivatives by the quaternion into `slope` (4, 3, 2)."""
    times(rotations[0], y, out)
    for d in range(4):
        times(rotations[1 + d], y, slope[d])


@inner
def evaluate(x, task, values, work):
    """Equations, inequalities and their derivatives at x (n, 2), a point or a box, into `values`.

    work: `ContactBalls`.
    """
    values.equation_slope[:, :, :] = 0.0
    values.inequality_slope[:, :, :] = 0.0
    rotation(x, task.coordinates.parameter[0] - QUATERNION, work.object_rotation)
    for k in range(task.chains.joints.shape[0]):
        chain(k, x, task.chains, work)
        _bodies(k, x, task.regions, task.coordinates, work)
        _points(k, x, task, values, work)
        if task.regions.hand[k] == CAP_REGION:
            _within_cone(k, task, values, work)
        else:
            _opposed(k, task.chains, task.coordinates, values, work)
            _tangent(k, task.chains, task.coordinates, values, work)
    _axes(task.chains.joints.shape[0], task.coordinates, values, work)


@inner
def _bodies(k, x, regions, coordinates, work):
    """Surfaces of contact k, the points and directions of hand and object that are to agree."""
    first, R = coordinates.parameter[k], work.link_rotation
    on_object, on_hand, y, a = work.object_surface, work.hand_surface, work.object_point, work.hand_direction
    surface(k, k, get(x, first), get(x, first + 1), regions, on_object, work)
    if regions.hand[k] == CAP_REGION:
        for i in range(3):
            put(on_hand[0], i, (regions.center[k, i], 0.0))
            put(on_hand[NORMAL], i, (regions.axis[k, i], 0.0))
            put(y, i, add(get(on_object[0], i), scale(regions.radius[k], get(on_object[NORMAL], i))))
    else:
        surface(regions.hand.shape[0] + k, k, get(x, first + 2), get(x, first + 3), regions, on_hand, work)
        for i in range(3):
            put(y, i, get(on_object[0], i))
    times(R, on_hand[0], work.hand_point)
    for i in range(3):
        put(work.hand_point, i, add(get(work.hand_point, i), get(work.link_position, i)))
    times(R, on_hand[NORMAL], a)
    turned(work.object_rotation, y, work.turned_point, work.turned_point_slope)
    turned(work.object_rotation, on_object[NORMAL], work.turned_vector, work.turned_vector_slope)


@inner
def _points(k, x, task, values, work):
    """The three equations of coinciding points."""
    row, first = task.coordinates.row[k], task.coordinates.parameter[k]
    quaternion, position = task.coordinates.parameter[0] - QUATERNION, task.coordinates.parameter[0] - POSE
    slope, tangent, velocity = values.equation_slope, work.tangent, work.velocity
    rolls = task.regions.hand[k] == CAP_REGION
    for i in range(3):
        away = sub(sub(get(work.hand_point, i), get(x, position + i)), get(work.turned_point, i))
        put(values.equation, row + i, away)
        put(slope[row + i], position + i, (-1.0, 0.0))
        for j in range(4):
            put(slope[row + i], quaternion + j, _negative(work.turned_point_slope[j], i))
    for way in range(2):
        for i in range(3):
            put(tangent, i, get(work.object_surface[1 + way], i))
            if rolls:
                grows = scale(task.regions.radius[k], get(work.object_surface[NORMAL + 1 + way], i))
                put(tangent, i, add(get(tangent, i), grows))
        times(work.object_rotation[0], tangent, work.turned_tangent)
        for i in range(3):
            put(slope[row + i], first + way, _negative(work.turned_tangent, i))
    for way in range(0 if rolls else 2):
        times(work.link_rotation, work.hand_surface[1 + way], tangent)
        for i in range(3):
            put(slope[row + i], first + 2 + way, get(tangent, i))
    for step in range(task.chains.joints[k]):
        v, ratio = task.chains.coordinate[k, step], task.chains.ratio[k, step]
        if task.chains.kind[k, step] == PRISMATIC:
            for i in range(3):
                put(velocity, i, get(work.joint_axis[step], i))
        else:
            for i in range(3):
                put(work.moment_arm, i, sub(get(work.hand_point, i), get(work.joint_point[step], i)))
            cross(work.joint_axis[step], work.moment_arm, velocity)
        for i in range(3):
            put(slope[row + i], v, add(get(slope[row + i], v), scale(ratio, get(velocity, i))))


@inner
def _negative(vector, i):
    return -vector[i, 0], vector[i, 1]


@inner
def _within_cone(k, task, values, work):
    """The cosine of the angle between axis and contact, -sign a . R n, must exceed that of the cone."""
    sign, first = task.regions.sign[k], task.coordinates.parameter[k]
    slope, a = values.inequality_slope[k], work.hand_direction
    cosine = scale(-sign, dot(a, work.turned_vector))
    put(values.inequality, k, sub(cosine, (task.regions.cone[k], 0.0)))
    _along(k, slope, -sign, task.chains, task.coordinates, work)
    for way in range(2):
        times(work.object_rotation[0], work.object_surface[NORMAL + 1 + way], work.turned_tangent)
        put(slope, first + way, scale(-sign, dot(a, work.turned_tangent)))


@inner
def _opposed(k, chains, coordinates, values, work):
    """The normals of two patches must oppose: -R_k m . R n is positive."""
    first, slope, a = coordinates.parameter[k], values.inequality_slope[k], work.hand_direction
    put(values.inequality, k, scale(-1.0, dot(a, work.turned_vector)))
    _along(k, slope, -1.0, chains, coordinates, work)
    for way in range(2):
        times(work.object_rotation[0], work.object_surface[NORMAL + 1 + way], work.turned_tangent)
        put(slope, first + way, scale(-1.0, dot(a, work.turned_tangent)))
    for way in range(2):
        times(work.link_rotation, work.hand_surface[NORMAL + 1 + way], work.tangent)
        put(slope, first + 2 + way, scale(-1.0, dot(work.tangent, work.turned_vector)))


@inner
def _tangent(k, chains, coordinates, values, work):
    """The two equations of patches that are tangent: R_k m . R o_s = 0 and R_k m . R o_t = 0."""
    first, a, vector = coordinates.parameter[k], work.hand_direction, work.turned_vector
    for way in range(2):
        row = coordinates.row[k] + 3 + way
        slope = values.equation_slope[row]
        turned(work.object_rotation, work.object_surface[1 + way], vector, work.turned_vector_slope)
        put(values.equation, row, dot(a, vector))
        _along(k, slope, 1.0, chains, coordinates, work)
        for other in range(2):
            times(work.object_rotation[0], work.object_surface[3 + way + other], work.turned_tangent)
            put(slope, first + other, dot(a, work.turned_tangent))
        for other in range(2):
            times(work.link_rotation, work.hand_surface[NORMAL + 1 + other], work.tangent)
            put(slope, first + 2 + other, dot(work.tangent, vector))


@inner
def _along(k, out, sign, chains, coordinates, work):
    """Derivatives by joints and quaternion of sign a . b into `out` (n, 2): the hand's direction, the turned vector."""
    quaternion = coordinates.parameter[0] - QUATERNION
    for step in range(chains.joints[k]):
        if chains.kind[k, step] == PRISMATIC:
            continue
        v = chains.coordinate[k, step]
        cross(work.joint_axis[step], work.hand_direction, work.velocity)
        change = scale(sign * chains.ratio[k, step], dot(work.velocity, work.turned_vector))
        put(out, v, add(get(out, v), change))
    for j in range(4):
        put(out, quaternion + j, scale(sign, dot(work.hand_direction, work.turned_vector_slope[j])))


@inner
def _axes(first, coordinates, values, work):
    """The bounds of the object's axes: below, then above, of R[i, l] at 3l+i; first: row."""
    quaternion, bounds, R = coordinates.parameter[0] - QUATERNION, coordinates.axes, work.object_rotation
    for l in range(3):
        for i in range(3):
            row = first + 2 * (3 * l + i)
            put(values.inequality, row, sub(get(R[0, i], l), (bounds[3 * l + i, 0], 0.0)))
            put(values.inequality, row + 1, sub((bounds[3 * l + i, 1], 0.0), get(R[0, i], l)))
            for j in range(4):
                put(values.inequality_slope[row], quaternion + j, get(R[1 + j, i], l))
                put(values.inequality_slope[row + 1], quaternion + j, _negative(R[1 + j, i], l))
