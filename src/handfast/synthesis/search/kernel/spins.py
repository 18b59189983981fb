"""Spins of the object about the line between two contacts, compiled: is there one that suits every direction?"""

from __future__ import annotations

import numpy as np

from handfast.synthesis.search.kernel.compiled import inner
from handfast.synthesis.search.kernel.narrowing import PAD, angle
from handfast.synthesis.search.kernel.taylor import norm


@inner
def azimuth(v, e1, e2):  # type: ignore[no-untyped-def]
    """Angle of v about an axis with e1, e2 across it."""
    return np.arctan2(v[0] * e2[0] + v[1] * e2[1] + v[2] * e2[2], v[0] * e1[0] + v[1] * e1[1] + v[2] * e1[2])


@inner
def across(d, e1, e2):  # type: ignore[no-untyped-def]
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
def between(a, b):  # type: ignore[no-untyped-def]
    """Distance of two angles on the circle."""
    off = (a - b) / (2 * np.pi)
    return abs(off - np.floor(off + 0.5)) * 2 * np.pi


@inner
def arc(theta, phi, slack):  # type: ignore[no-untyped-def]
    """Half width of the spins about a line that bring two directions within `slack`; -1: none, 4: all.

    theta, phi: their angles from the line.
    """
    if slack < abs(theta - phi) - PAD:
        return -1.0
    both = min(theta + phi, 2 * np.pi - theta - phi)
    if slack >= both - 1e-7:
        return 4.0
    c = (np.cos(slack) - np.cos(theta) * np.cos(phi)) / (np.sin(theta) * np.sin(phi))
    # near the ends the cosine's inverse magnifies rounding
    return np.arccos(min(1.0, max(-1.0, c - 1e-9))) + 1e-9


@inner
def spins(d, e, stray, V, swing, slack, arcs):  # type: ignore[no-untyped-def]
    """Is there a spin of the object about the line between two contacts that suits every direction?

    A turn R with R e' = d' for a line e' near e and d' near d differs from one with R e = d by at most both
    angles; so with slacks wider by these, `stray`, and by what each direction strays, `swing` (., 4), the
    middles tell. Out, arcs (., 5) for each direction: angles from the line on the hand and on the object,
    middle of its spins, half their width at the middle of the box and in the whole box.
    """
    many = slack.shape[0]
    e1, e2, f1, f2 = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    across(d, e1, e2)
    across(e, f1, f2)
    for c in range(many):
        v, o = V[c, 1], V[c, 3]
        arcs[c, 0], arcs[c, 1] = angle(d, v), angle(e, o)
        wide = slack[c] + stray + swing[c, 1] + swing[c, 3]
        arcs[c, 4] = arc(arcs[c, 0], arcs[c, 1], wide)
        if arcs[c, 4] < 0:
            return False
        arcs[c, 3] = arc(arcs[c, 0], arcs[c, 1], slack[c])
        arcs[c, 2] = azimuth(v, e1, e2) - azimuth(o, f1, f2)
    # if the arcs have a spin in common, then also the begin of one of them
    bounded = False
    for i in range(many):
        if arcs[i, 4] >= np.pi:
            continue
        bounded = True
        begin = arcs[i, 2] - arcs[i, 4]
        fine = True
        for j in range(many):
            if arcs[j, 4] < np.pi and between(begin, arcs[j, 2]) > arcs[j, 4] + PAD:
                fine = False
                break
        if fine:
            return True
    return not bounded
