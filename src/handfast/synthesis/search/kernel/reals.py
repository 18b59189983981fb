"""The operations of `balls.py` on plain numbers, compiled: what `kinematics.py` is made of where nothing is proved."""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner


@inner
def exact(x):
    return x


@inner
def rounded(x):
    return x


@inner
def add(a, b):
    return a + b


@inner
def sub(a, b):
    return a - b


@inner
def mul(a, b):
    return a * b


scale = mul


@inner
def div(a, b):
    return a / b


@inner
def root(a):
    return np.sqrt(a)


@inner
def sine(a):
    return np.sin(a)


@inner
def cosine(a):
    return np.cos(a)


@inner
def get(a, i):
    """Number i of an array (n,)."""
    return a[i]


@inner
def put(a, i, x):
    a[i] = x


@inner
def moved(base, row, column):
    """base + row . column, of a row (3,) and a column (3,) of a rigid motion."""
    return base + (row[0] * column[0] + row[1] * column[1] + row[2] * column[2])


@inner
def dot(a, b):
    """Of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def cross(a, b, out):
    """Of two vectors (3,) into `out`."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = a[j] * b[k] - a[k] * b[j]
