"""Spins of the object about the line between two contacts, compiled: is there one that suits every direction?"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.narrowing import ROW_PADDING, angle
from handfast.synthesis.search.kernel.taylor import HAND_DIRECTION, OBJECT_DIRECTION, norm


@inner
def _azimuth(v, e1, e2):
    """Angle of v about an axis with e1, e2 across it."""
    return np.arctan2(v[0] * e2[0] + v[1] * e2[1] + v[2] * e2[2], v[0] * e1[0] + v[1] * e1[1] + v[2] * e1[2])


@inner
def _across(d, e1, e2):
    """Two unit vectors e1, e2 that make a right-handed frame with d."""
    l = 0
    for i in range(1, 3):
        if abs(d[i]) < abs(d[l]):
            l = i
    size = norm(d)
    along = d[l] / (size * size)
    for i in range(3):
        e1[i] = (1.0 if i == l else 0.0) - along * d[i]
    f = norm(e1)
    for i in range(3):
        e1[i] /= f
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        e2[i] = (d[j] * e1[k] - d[k] * e1[j]) / size


@inner
def between(a, b):
    """Distance of two angles on the circle."""
    off = (a - b) / (2 * np.pi)
    return abs(off - np.floor(off + 0.5)) * 2 * np.pi


@inner
def _arc(theta, phi, tolerance):
    """Half width of the spins about a line that bring two directions within `tolerance`; -1: none, 4: all.

    theta, phi: their angles from the line.
    """
    if tolerance < abs(theta - phi) - ROW_PADDING:
        return -1.0
    both = min(theta + phi, 2 * np.pi - theta - phi)
    if tolerance >= both - 1e-7:
        return 4.0
    c = (np.cos(tolerance) - np.cos(theta) * np.cos(phi)) / (np.sin(theta) * np.sin(phi))
    # near the ends the cosine's inverse magnifies rounding
    return np.arccos(min(1.0, max(-1.0, c - 1e-9))) + 1e-9


@inner
def spins(stray, polynomials, work):
    """Is there a spin of the object about the line between two contacts that suits every direction?

    A turn R with R e' = d' for a line e' near e and d' near d differs from one with R e = d by at most both
    angles; so with tolerances wider by these, `stray`, and by what each direction strays, its swing, the
    middles tell. The lines d and e are in work.line, a `LineWork`. Out, work.arcs for each direction: angles from the
    line on the hand and on the object, middle of its spins, half their width at the middle of the box and in the
    whole box.
    """
    d, e, arcs, swing = work.line[0], work.line[1], work.arcs, polynomials.swing
    tolerance, many = polynomials.tolerance, polynomials.tolerance.shape[0]
    e1, e2, f1, f2 = work.across[0], work.across[1], work.across[2], work.across[3]
    _across(d, e1, e2)
    _across(e, f1, f2)
    for c in range(many):
        v, o = polynomials.value[c, HAND_DIRECTION], polynomials.value[c, OBJECT_DIRECTION]
        arcs[c, 0], arcs[c, 1] = angle(d, v), angle(e, o)
        wide = tolerance[c] + stray + swing[c, HAND_DIRECTION] + swing[c, OBJECT_DIRECTION]
        arcs[c, 4] = _arc(arcs[c, 0], arcs[c, 1], wide)
        if arcs[c, 4] < 0:
            return False
        arcs[c, 3] = _arc(arcs[c, 0], arcs[c, 1], tolerance[c])
        arcs[c, 2] = _azimuth(v, e1, e2) - _azimuth(o, f1, f2)
    return _in_common(arcs)


@inner
def _in_common(arcs):
    """Have all arcs a spin in common? Then also the begin of one of them."""
    many, bounded = arcs.shape[0], False
    for i in range(many):
        if arcs[i, 4] >= np.pi:
            continue
        bounded = True
        begin = arcs[i, 2] - arcs[i, 4]
        fine = True
        for j in range(many):
            if arcs[j, 4] < np.pi and between(begin, arcs[j, 2]) > arcs[j, 4] + ROW_PADDING:
                fine = False
                break
        if fine:
            return True
    return not bounded
