"""Patches fitted to faces: planted shapes, both directions of the error, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from holdfast.errors import InputError
from holdfast.region import Bezier
from holdfast.region_fit import fit


def sheet(surface, cells: int = 12, part: slice = slice(None)) -> tuple[np.ndarray, np.ndarray]:
    """A grid of triangles over u, v in [0, 1], wound so that p_u x p_v is outwards."""
    u, v = np.meshgrid(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1), indexing="ij")
    corner = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = (k.ravel() for k in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.stack(surface(u, v), axis=2).reshape(-1, 3), faces


def ball(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
    """A piece of a sphere of radius 30 mm."""
    a, b = 0.6 * (u - 0.5), 0.6 * (v - 0.5)
    return 0.03 * np.sin(a), 0.03 * np.cos(a) * np.sin(b), 0.03 * np.cos(a) * np.cos(b)


def plane(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
    return 0.04 * u + 0.01 * v, 0.02 * v, 0.1 + 0 * u


def drum(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
    """A piece of a cylinder of radius 20 mm about x."""
    return 0.05 * u, 0.02 * np.sin(v - 0.5), 0.02 * np.cos(v - 0.5)


def hill(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
    """Itself bicubic."""
    return 0.04 * u, 0.03 * v, 0.01 * u**2 * v + 0.02 * (v**3 - v)


@pytest.mark.parametrize(
    "surface, degree, most", [(plane, (1, 1), 1e-9), (ball, (3, 3), 6e-5), (drum, (1, 3), 6e-5), (hill, (3, 3), 2e-4)]
)
def test_planted_shapes(surface, degree: tuple[int, int], most: float):
    vertices, faces = sheet(surface)
    fitted = fit(vertices, faces, np.arange(len(faces)), degree)
    # the faces are chords: their sagitta is in the error
    assert fitted.error_max < most
    assert 0 <= fitted.error_rms <= fitted.error_max
    assert fitted.patch.degree == degree
    assert fitted.patch.normal(0.5, 0.5) @ np.cross(*np.diff(vertices[faces[0]], axis=0)) > 0
    box = fitted.patch.at(*np.meshgrid(np.linspace(0, 1, 20), np.linspace(0, 1, 20)))
    np.testing.assert_allclose(np.ptp(box.reshape(-1, 3), axis=0), np.ptp(vertices, axis=0), atol=2e-4)


def test_the_winding_says_what_is_outside():
    vertices, faces = sheet(ball)
    hollow = fit(vertices, faces[:, ::-1], np.arange(len(faces)))
    assert hollow.patch.normal(0.5, 0.5)[2] < 0
    assert fit(vertices, faces, np.arange(len(faces))).patch.normal(0.5, 0.5)[2] > 0


def test_the_error_is_the_distance_in_both_directions():
    # a flat patch cannot follow the drum: it misses by about half of its height
    vertices, faces = sheet(drum)
    height = 0.02 * (1 - np.cos(0.5))
    flat = fit(vertices, faces, np.arange(len(faces)), (1, 1))
    assert 0.4 * height < flat.error_max < height
    assert 0.1 * height < flat.error_rms < flat.error_max


def test_a_coarse_selection_has_samples_enough():
    vertices, faces = sheet(plane, cells=1)
    fitted = fit(vertices, faces, [0, 1], (3, 3))
    assert fitted.error_max < 1e-7
    assert isinstance(fitted.patch, Bezier)


def test_only_the_selection_counts():
    vertices, faces = sheet(ball, cells=10)
    middles = vertices[faces].mean(axis=1)
    half = middles[:, 0] > 0
    fitted = fit(vertices, faces, half)
    assert fitted.patch.enclosure()[0, 0] > -1e-4
    assert fit(vertices, faces, np.flatnonzero(half)).error_max == fitted.error_max


def test_vertices_that_are_not_shared_are_merged():
    vertices, faces = sheet(ball, cells=6)
    soup = vertices[faces].reshape(-1, 3)
    fitted = fit(soup, np.arange(len(soup)).reshape(-1, 3), np.arange(len(faces)))
    np.testing.assert_allclose(
        fitted.patch.at(0.5, 0.5), fit(vertices, faces, np.arange(len(faces))).patch.at(0.5, 0.5)
    )


def test_what_is_refused():
    vertices, faces = sheet(ball, cells=6)
    everything = np.arange(len(faces))
    middles = vertices[faces].mean(axis=1)
    with pytest.raises(InputError, match="selection: is empty"):
        fit(vertices, faces, [])
    with pytest.raises(InputError, match="beyond the mesh's 72"):
        fit(vertices, faces, [72])
    with pytest.raises(InputError, match="degree: is 0 x 3"):
        fit(vertices, faces, everything, (0, 3))
    ring = np.linalg.norm(middles[:, :2], axis=1) > 0.004
    with pytest.raises(InputError, match="has holes"):
        fit(vertices, faces, ring)
    apart = np.abs(middles[:, 0]) > 0.005
    with pytest.raises(InputError, match="several pieces"):
        fit(vertices, faces, apart)
    with pytest.raises(InputError, match="both windings"):
        fit(vertices, np.vstack([faces[:1, ::-1], faces[1:]]), everything)

    def tube(u, v):
        return 0.05 * u, 0.02 * np.sin(4 * v), 0.02 * np.cos(4 * v)

    with pytest.raises(InputError, match="hemisphere"):
        fit(*sheet(tube), np.arange(288))
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) * 0.01
    closed = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    with pytest.raises(InputError, match="is closed"):
        fit(corners, closed, np.arange(4))
    with pytest.raises(InputError, match="no four corners"):
        fit(corners, closed, [0])
