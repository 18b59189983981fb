"""Meshes with fewer triangles, for display: a page with all of a scan's triangles would be slow to open."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.model.shape import Faces

WIDER = 1.25  # from one try to the next


def coarse(vertices: Array, faces: Faces, most: int) -> tuple[Array, Faces, float]:
    """A triangle mesh with at most `most` triangles: vertices that share a cell of a grid become their mean.

    A mesh that has no more is returned as it is.

    Args:
        vertices: (n, 3) [m]; `faces`: (k, 3).

    Returns:
        Vertices, faces, and the side of a cell [m]: details below it are lost. 0 if nothing changed.
    """
    faces = np.asarray(faces)
    if len(faces) <= most:
        return vertices, faces, 0.0
    low = vertices.min(axis=0)
    cell = float(np.ptp(vertices, axis=0).max()) / np.sqrt(most)  # a flat square would have twice as many as asked
    while True:
        _, owner = np.unique(np.floor((vertices - low) / cell).astype(np.int64), axis=0, return_inverse=True)
        owner = owner.reshape(-1)
        kept = owner[faces]
        a, b, c = kept.T
        kept = kept[(a != b) & (b != c) & (c != a)]
        first = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)[1]
        kept = kept[np.sort(first)]
        if len(kept) <= most:
            break
        cell *= WIDER
    count = np.bincount(owner)[:, None]
    middles = np.column_stack([np.bincount(owner, weights=x) for x in vertices.T]) / count
    used, compact = np.unique(kept, return_inverse=True)
    return middles[used], compact.reshape(-1, 3), cell
