"""Where a contact can be over a box of the object's poses, compiled: Taylor polynomials of degree one.

The rotation is that of an unnormalised quaternion q. On a straight path of them it turns with the velocity
w = 2 Im(q' conj q) / |q|^2; q' has no second derivative, so that w' is along w, and

    |(R y)''| <= |w| (|w|^2 + (2 q.q' / |q|^2)^2)^(1/2) |y| <= (2 |q'| / |q|)^2 |y|.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from handfast.synthesis.search.kernel.compiled import inner
from handfast.synthesis.search.kernel.taylor import ROUNDING, WIDER, element


class Work(NamedTuple):
    """Arrays that the functions below fill: the box about its middle, the contact and the turn over it, rows."""

    x: Any  # (n,) middle
    h: Any  # (n,) half widths
    low: Any  # (n,) ends about the middle, that rows narrow
    high: Any
    V: Any  # (4, 3), (4, n, 3) and (4,): polynomials of `taylor.element`
    D: Any
    E: Any
    work: Any
    R: Any  # (3, 3) and (4, 3): rotation and its velocities
    w: Any
    y: Any  # (3,) the object's point from m, turned
    z: Any  # (3,) its direction, turned
    t: Any
    G: Any  # (7, n) derivatives of rows


@inner
def turning(x, h, at, R, w):  # type: ignore[no-untyped-def]
    """Rotation of the quaternion x[at:at+4] in the middle of a box, into R (3, 3) and w (4, 3).

    w: velocities of the turn, R y moves by w_i x R y for a unit of component i. Returns (largest angle between
    a rotation of the box and the middle one, what the polynomial of degree one leaves out for a unit vector).
    """
    a, b, c, d = x[at], x[at + 1], x[at + 2], x[at + 3]
    f = 2.0 / (a * a + b * b + c * c + d * d)
    R[0, 0], R[0, 1], R[0, 2] = 1 - f * (c * c + d * d), f * (b * c - a * d), f * (b * d + a * c)
    R[1, 0], R[1, 1], R[1, 2] = f * (b * c + a * d), 1 - f * (b * b + d * d), f * (c * d - a * b)
    R[2, 0], R[2, 1], R[2, 2] = f * (b * d - a * c), f * (c * d + a * b), 1 - f * (b * b + c * c)
    w[0, 0], w[0, 1], w[0, 2] = -f * b, -f * c, -f * d
    w[1, 0], w[1, 1], w[1, 2] = f * a, f * d, -f * c
    w[2, 0], w[2, 1], w[2, 2] = -f * d, f * a, f * b
    w[3, 0], w[3, 1], w[3, 2] = f * c, -f * b, f * a
    far, least = 0.0, 0.0
    for i in range(at, at + 4):
        far += h[i] * h[i]
        gap = max(0.0, abs(x[i]) - h[i])
        least += gap * gap
    bend = 2.0 * far / least * WIDER  # half of (2 |q'| / |q|)^2
    return np.sqrt(2.0 * bend) * WIDER, bend + ROUNDING


@inner
def times(R, v, out):  # type: ignore[no-untyped-def]
    for c in range(3):
        out[c] = R[c, 0] * v[0] + R[c, 1] * v[1] + R[c, 2] * v[2]


@inner
def lever(w, y, sign, at, G):  # type: ignore[no-untyped-def]
    """Derivatives of sign R y by the quaternion's components, into columns at to at + 3 of G (., n)."""
    for j in range(4):
        for c in range(3):
            d, e = (c + 1) % 3, (c + 2) % 3
            G[c, at + j] = sign * (w[j, d] * y[e] - w[j, e] * y[d])


@inner
def gaps(k, use, flat, bend, m, S):  # type: ignore[no-untyped-def]
    """Taylor polynomials of contact k about the middle x of a box of half widths h.

    Into G (7, n): derivatives of the gap of the points in rows 0 to 2, of the directions in 3 to 5; into y, z
    (3,): the object's point from m and its direction, turned. Returns (largest turn, remainder of a turn).
    """
    x, h, V, D, E, R, w, y, z, t, G = S.x, S.h, S.V, S.D, S.E, S.R, S.w, S.y, S.z, S.t, S.G
    at = flat.params[0] - 4
    element(k, x, h, flat, bend, V, D, E, S.work)
    theta, curve = turning(x, h, at, R, w)
    for c in range(3):
        t[c] = V[2, c] - m[c]
    times(R, t, y)
    times(R, V[3], z)
    for i in use:
        for c in range(3):
            G[c, i] = D[0, i, c] - R[c, 0] * D[2, i, 0] - R[c, 1] * D[2, i, 1] - R[c, 2] * D[2, i, 2]
            G[3 + c, i] = D[1, i, c] - R[c, 0] * D[3, i, 0] - R[c, 1] * D[3, i, 1] - R[c, 2] * D[3, i, 2]
    lever(w, y, -1.0, at, G)
    lever(w, z, -1.0, at, G[3:])
    for c in range(3):
        G[c, at - 3 + c] = -1.0
    return theta, curve


@inner
def apart(V, z, use, G):  # type: ignore[no-untyped-def]
    """Derivatives of the cosine between the directions into G[3]: of 1 - |a - z|^2 / 2."""
    d0, d1, d2 = V[1, 0] - z[0], V[1, 1] - z[1], V[1, 2] - z[2]
    for i in use:
        G[3, i] = -d0 * G[3, i] - d1 * G[4, i] - d2 * G[5, i]
    return V[1, 0] * z[0] + V[1, 1] * z[1] + V[1, 2] * z[2]
