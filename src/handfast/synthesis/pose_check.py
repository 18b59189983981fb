"""Whether bounds on the axes of a pose leave any rotation at all."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.synthesis.task import PoseBounds

# an equation of the rotation may fail by this much: far more than rounding, far less than a bound
ROTATION_SLACK = 1e-9
POSE_CHECK_BOXES = 1024  # parts of the bounds that are looked at before the question is left to the search
NARROWING_PASSES = 4  # passes over the equations for each part


def refuse_contradiction(pose: PoseBounds) -> None:
    """Raise `InputError` if it is certain that no rotation has its axes within the bounds.

    Interval reasoning on R R^T = R^T R = I and x cross y = z, halving the bounds where they are widest.
    It never refuses bounds that a rotation meets; bounds that it lets pass may still leave none.
    """
    if not _empty(np.clip(pose.axes, -1.0, 1.0)):
        return
    names = [f"{a}_axis" for a in "xyz"]
    for pair in combinations(range(3), 2):
        axes = np.tile([-1.0, 1.0], (3, 3, 1))
        axes[list(pair)] = np.clip(pose.axes[list(pair)], -1.0, 1.0)
        if _empty(axes):
            names = [names[k] for k in pair]
            break
    problem = f"{' and '.join(names)} contradict each other: no rotation has its axes within these bounds; widen one"
    raise InputError(problem, field="pose")


def _empty(axes: Array) -> bool:
    """Whether axes (3, 3, 2), axes[k, i] the bounds of R[i, k], are shown to hold no rotation."""
    boxes, seen = axes[None], 0
    while len(boxes):
        boxes = _contracted(boxes)
        seen += len(boxes)
        if seen > POSE_CHECK_BOXES or (len(boxes) and _met(axes, boxes)):
            return False
        boxes = _halves(boxes)
    return True


def _met(axes: Array, boxes: Array) -> bool:
    """Whether a rotation nearest to the middle of some part (n, 3, 3, 2) is within the whole bounds."""
    U, _, Vt = np.linalg.svd(boxes.mean(axis=3).swapaxes(1, 2))
    U[:, :, 2] *= np.linalg.det(U @ Vt)[:, None]
    Rt = (U @ Vt).swapaxes(1, 2)
    return bool(((Rt >= axes[..., 0] - ROTATION_SLACK) & (Rt <= axes[..., 1] + ROTATION_SLACK)).all(axis=(1, 2)).any())


def _halves(boxes: Array) -> Array:
    """Every box (n, 3, 3, 2) cut in two where it is widest: (2n, 3, 3, 2)."""
    flat = boxes.reshape(len(boxes), 9, 2)
    rows, widest = np.arange(len(flat)), np.argmax(flat[..., 1] - flat[..., 0], axis=1)
    low, high = flat.copy(), flat.copy()
    low[rows, widest, 1] = high[rows, widest, 0] = flat[rows, widest].mean(axis=1)
    return np.concatenate([low, high]).reshape(-1, 3, 3, 2)


def _contracted(boxes: Array) -> Array:
    """The boxes (n, 3, 3, 2) without what the equations of a rotation exclude; empty ones are left out."""
    boxes = boxes.copy()
    for _ in range(NARROWING_PASSES):
        for M in (boxes, boxes.swapaxes(1, 2)):  # a view: the columns, then the rows
            for k in range(3):
                a, b, c = M[:, k], M[:, (k + 1) % 3], M[:, (k + 2) % 3]
                for i in range(3):
                    squares = _square(a)
                    rest = 1 - (squares.sum(axis=1) - squares[:, i])[:, ::-1]
                    most = np.sqrt(np.maximum(rest[:, 1] + ROTATION_SLACK, 0))
                    _meet(a[:, i], np.stack([-most, most], axis=1))
                    j, l = (i + 1) % 3, (i + 2) % 3
                    cross = _product(b[:, j], c[:, l]) - _product(b[:, l], c[:, j])[:, ::-1]
                    _meet(a[:, i], cross + np.array([-ROTATION_SLACK, ROTATION_SLACK]))
                length = _square(a).sum(axis=1)
                dot = _product(a, b).sum(axis=1)
                wrong = (length[:, 0] > 1 + ROTATION_SLACK) | (length[:, 1] < 1 - ROTATION_SLACK)
                wrong |= (dot[:, 0] > ROTATION_SLACK) | (dot[:, 1] < -ROTATION_SLACK)
                a[wrong, 0] = [2.0, -2.0]  # an empty interval stays one
        boxes = boxes[(boxes[..., 0] <= boxes[..., 1] + ROTATION_SLACK).all(axis=(1, 2))]
        if not len(boxes):
            break
    return boxes


def _meet(x: Array, y: Array) -> None:
    """Narrow the intervals x (n, 2) to what they share with y (n, 2)."""
    x[:, 0] = np.maximum(x[:, 0], y[:, 0])
    x[:, 1] = np.minimum(x[:, 1], y[:, 1])


def _square(x: Array) -> Array:
    """(..., 2) the squares of intervals."""
    ends = x**2
    inside = (x[..., 0] <= 0) & (x[..., 1] >= 0)
    return np.stack([np.where(inside, 0.0, ends.min(axis=-1)), ends.max(axis=-1)], axis=-1)


def _product(x: Array, y: Array) -> Array:
    """(..., 2) the products of intervals."""
    ends = np.stack([x[..., i] * y[..., j] for i in (0, 1) for j in (0, 1)], axis=-1)
    return np.stack([ends.min(axis=-1), ends.max(axis=-1)], axis=-1)
