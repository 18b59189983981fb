"""Chains of joints and surfaces of regions, compiled: one set of formulas, for balls and for plain numbers.

Sizes of arrays are those of plain numbers; balls are (middle, radius), one dimension more. Points of radius zero give
what a search needs, boxes give enclosures for a proof.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel import balls, reals
from handfast.synthesis.task_groups import CAP_REGION, PRISMATIC, SIDE_REGION

SURFACE_ORDERS = np.array([(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)])  # of the derivatives in a surface's rows
NORMAL = 6  # row of a surface's unit outward normal; then its derivatives by s and t


class Kinematics(NamedTuple):
    """The compiled functions for one kind of numbers."""

    chain: Any
    surface: Any


def _made_of(numbers: ModuleType) -> Kinematics:
    """numbers: the module of their operations, `balls` or `reals`."""
    exact, rounded, get, put = numbers.exact, numbers.rounded, numbers.get, numbers.put
    add, sub, mul, div, scale, root = numbers.add, numbers.sub, numbers.mul, numbers.div, numbers.scale, numbers.root
    sine, cosine, dot, cross, moved = numbers.sine, numbers.cosine, numbers.dot, numbers.cross, numbers.moved

    @inner
    def _follow(rotation, translation, work):
        """Multiply the link's pose by the rigid motion behind a joint, (3, 3) and (3,)."""
        R, p, row, end = work.link_rotation, work.link_position, work.next_rotation, work.next_position
        for i in range(3):
            put(end, i, moved(get(p, i), R[i], translation))
            for j in range(3):
                put(row[i], j, moved(exact(0.0), R[i], rotation[:, j]))
        for i in range(3):
            put(p, i, get(end, i))
            for j in range(3):
                put(R[i], j, get(row[i], j))

    @inner
    def chain(k, x, chains, work):
        """Pose of the link of contact k in the palm frame, the axes of its joints and points on them, into `work`.

        x (n): coordinates; work: `ContactBalls` or `TaylorWork`.
        """
        R, p = work.link_rotation, work.link_position
        for i in range(3):
            for j in range(3):
                put(R[i], j, rounded(chains.rotation[k, 0, i, j]))
            put(p, i, rounded(chains.translation[k, 0, i]))
        for step in range(chains.joints[k]):
            value = add(scale(chains.ratio[k, step], get(x, chains.coordinate[k, step])), exact(chains.offset[k, step]))
            axis, point = work.joint_axis[step], work.joint_point[step]
            for i in range(3):
                put(axis, i, get(R[i], 2))
                put(point, i, get(p, i))
            if chains.kind[k, step] == PRISMATIC:
                for i in range(3):
                    put(p, i, add(get(p, i), mul(value, get(R[i], 2))))
            else:
                s, c = sine(value), cosine(value)
                for i in range(3):
                    a, b = get(R[i], 0), get(R[i], 1)
                    put(R[i], 0, add(mul(c, a), mul(s, b)))
                    put(R[i], 1, sub(mul(c, b), mul(s, a)))
            _follow(chains.rotation[k, step + 1], chains.translation[k, step + 1], work)

    @inner
    def _bernstein(degree, x, out):
        """Bernstein polynomials of a degree at x into `out` (degree+1)."""
        y = sub(exact(1.0), x)
        put(out, 0, exact(1.0))
        for d in range(1, degree + 1):
            put(out, d, mul(x, get(out, d - 1)))
            for i in range(d - 1, 0, -1):
                put(out, i, add(mul(x, get(out, i - 1)), mul(y, get(out, i))))
            put(out, 0, mul(y, get(out, 0)))

    @inner
    def _weights(degree, x, out, lower):
        """Weights of the control points for the value and two derivatives at x: out (3, degree+1); lower: work."""
        _bernstein(degree, x, out[0])
        for order in range(1, 3):
            if degree < order:
                for i in range(degree + 1):
                    put(out[order], i, exact(0.0))
                continue
            _bernstein(degree - order, x, lower)
            # derivative of the polynomial as weights of the control points
            many = float(degree) if order == 1 else float(degree * (degree - 1))
            for i in range(degree + 1):
                m = exact(0.0)
                for j in range(order + 1):
                    if 0 <= i - j <= degree - order:
                        sign = many * (1.0 if (order - j) % 2 == 0 else -1.0)
                        if order == 2 and j == 1:
                            sign *= 2.0
                        m = add(m, scale(sign, get(lower, i - j)))
                put(out[order], i, m)

    @inner
    def _patch(points, M, N, s, t, out, work):
        """A Bezier patch and its derivatives: rows 0 to 5 of `out` are p, p_s, p_t, p_ss, p_st, p_tt.

        points: ((M+1)(N+1), 3), exact.
        """
        _weights(M, s, work.weights[0], work.lower_weights)
        _weights(N, t, work.weights[1], work.lower_weights)
        for o in range(6):
            for c in range(3):
                put(out[o], c, exact(0.0))
        corner = points[0]
        for i in range(M + 1):
            for j in range(N + 1):
                # from a corner: the weights sum to 1 or 0, and boxes far from the origin stay small
                here = points[i * (N + 1) + j]
                a0 = sub(exact(here[0]), exact(corner[0]))
                a1 = sub(exact(here[1]), exact(corner[1]))
                a2 = sub(exact(here[2]), exact(corner[2]))
                for o in range(6):
                    w = mul(
                        get(work.weights[0, SURFACE_ORDERS[o, 0]], i), get(work.weights[1, SURFACE_ORDERS[o, 1]], j)
                    )
                    put(out[o], 0, add(get(out[o], 0), mul(w, a0)))
                    put(out[o], 1, add(get(out[o], 1), mul(w, a1)))
                    put(out[o], 2, add(get(out[o], 2), mul(w, a2)))
        for c in range(3):
            put(out[0], c, add(get(out[0], c), exact(corner[c])))

    @inner
    def _ball(numbers, s, t, sign, out):
        """A cap by polar angle s and azimuth t; rows as in `surface`."""
        ss, cs, st, ct = sine(s), cosine(s), sine(t), cosine(t)
        radius = numbers[12]
        for i in range(3):
            e1, e2, e3 = numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]
            around = add(scale(e1, ct), scale(e2, st))
            turned = sub(scale(e2, ct), scale(e1, st))
            d = add(mul(ss, around), scale(e3, cs))
            ds = sub(mul(cs, around), scale(e3, ss))
            dt = mul(ss, turned)
            put(out[0], i, add(exact(numbers[9 + i]), scale(radius, d)))
            put(out[1], i, scale(radius, ds))
            put(out[2], i, scale(radius, dt))
            put(out[3], i, scale(-radius, d))
            put(out[4], i, scale(radius, mul(cs, turned)))
            put(out[5], i, sub(exact(0.0), scale(radius, mul(ss, around))))
            put(out[NORMAL], i, scale(sign, d))
            put(out[NORMAL + 1], i, scale(sign, ds))
            put(out[NORMAL + 2], i, scale(sign, dt))

    @inner
    def _side(numbers, s, t, sign, out):
        """Part of the side of a cone or cylinder by shares s of its angles, t of its heights; rows as in `surface`."""
        turn, length, growth, outwards, upwards = numbers[14], numbers[15], numbers[16], numbers[17], numbers[18]
        radius = add(exact(numbers[12]), scale(growth, t))
        angle = add(exact(numbers[13]), scale(turn, s))
        sa, ca = sine(angle), cosine(angle)
        for i in range(3):
            e1, e2, axis = numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]
            d = add(scale(e1, ca), scale(e2, sa))
            ds = scale(turn, sub(scale(e2, ca), scale(e1, sa)))
            up = scale(length, scale(axis, t))
            put(out[0], i, add(add(exact(numbers[9 + i]), up), mul(radius, d)))
            put(out[1], i, mul(radius, ds))
            put(out[2], i, add(scale(length, exact(axis)), scale(growth, d)))
            put(out[3], i, mul(scale(-turn, scale(turn, radius)), d))
            put(out[4], i, scale(growth, ds))
            put(out[5], i, exact(0.0))
            put(out[NORMAL], i, scale(sign, add(scale(outwards, d), scale(upwards, exact(axis)))))
            put(out[NORMAL + 1], i, scale(sign, scale(outwards, ds)))
            put(out[NORMAL + 2], i, exact(0.0))

    @inner
    def surface(which, k, s, t, regions, out, work):
        """A region at its parameters, out (9, 3): p, p_s, p_t, p_ss, p_st, p_tt, unit outward normal n, n_s, n_t.

        which: k for the object region of contact k, b + k for its hand region.
        """
        sign = regions.face[which]
        kind = regions.object[k] if which == k else regions.hand[k]
        if kind == CAP_REGION:
            _ball(regions.numbers[which], s, t, sign, out)
            return
        if kind == SIDE_REGION:
            _side(regions.numbers[which], s, t, sign, out)
            return
        _patch(
            regions.points[regions.first[which] :], regions.degree[which, 0], regions.degree[which, 1], s, t, out, work
        )
        normal = out[NORMAL]
        raw, a, b = work.raw_normal[0], work.raw_normal[1], work.raw_normal[2]
        cross(out[1], out[2], raw)
        size = root(dot(raw, raw))
        for i in range(3):
            put(normal, i, scale(sign, div(get(raw, i), size)))
        for way in range(2):
            # derivative of the unit normal: (n' - n (n . n')) / |n|
            cross(out[3 + way], out[2], a)
            cross(out[1], out[4 + way], b)
            for i in range(3):
                put(a, i, scale(sign, add(get(a, i), get(b, i))))
            along = dot(normal, a)
            for i in range(3):
                put(out[NORMAL + 1 + way], i, div(sub(get(a, i), mul(along, get(normal, i))), size))

    return Kinematics(chain, surface)


OF_BALLS, OF_REALS = _made_of(balls), _made_of(reals)
