"""Patches fitted to faces: planted shapes, both directions of the error, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from handfast.core.errors import InputError
from handfast.geometry.region_fit import fit
from handfast.model.region import Bezier


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


# --- pieces of a closed mesh, as one selects them ----------------------------------------------------


def icosphere(radius: float = 0.03) -> tuple[np.ndarray, np.ndarray]:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return np.array(mesh.vertices), np.array(mesh.faces)


def within(vertices: np.ndarray, faces: np.ndarray, axis: np.ndarray, degrees: float) -> np.ndarray:
    middles = vertices[faces].mean(axis=1)
    return middles @ axis > np.cos(np.radians(degrees)) * np.linalg.norm(middles, axis=1)


@pytest.mark.parametrize("degrees", [15, 30, 50, 70])
def test_a_round_selection_of_a_sphere(degrees: float) -> None:
    """The corners of the patch need an angle: it covers most of a disc, and lies on the sphere where it does."""
    vertices, faces = icosphere()
    axis = np.array([0.36, 0.48, 0.8])
    fitted = fit(vertices, faces, within(vertices, faces, axis, degrees), (5, 5))
    assert 0.75 < fitted.coverage < 1.05
    u, v = np.meshgrid(np.linspace(0, 1, 30), np.linspace(0, 1, 30))
    points = fitted.patch.at(u, v).reshape(-1, 3)
    sagitta = 0.03 - np.linalg.norm(vertices[faces].mean(axis=1), axis=1).min()
    assert np.abs(np.linalg.norm(points, axis=1) - 0.03).max() < fitted.error_max + 2 * sagitta
    assert fitted.error_max < 1.5e-4
    assert fitted.error_rms < 4e-5
    normals = fitted.patch.normal(u, v).reshape(-1, 3)
    cosines = np.einsum("ij,ij->i", normals, points) / np.linalg.norm(normals, axis=1) / np.linalg.norm(points, axis=1)
    assert cosines.min() > np.cos(np.radians(8))
    assert (points @ axis / np.linalg.norm(points, axis=1)).min() > np.cos(np.radians(degrees + 5))


def test_a_worse_degree_has_the_larger_error() -> None:
    vertices, faces = icosphere()
    chosen = within(vertices, faces, np.array([0.0, 0.0, 1.0]), 50)
    errors = [fit(vertices, faces, chosen, (d, d)).error_rms for d in (1, 2, 4)]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 10 * errors[-1]


def test_the_place_of_the_mesh_does_not_matter() -> None:
    vertices, faces = sheet(hill)
    turn = Rotation.from_rotvec([0.3, -1.2, 0.7]).as_matrix()
    here = fit(vertices, faces, np.arange(len(faces)))
    there = fit(vertices @ turn.T + [1.0, -2.0, 0.5], faces, np.arange(len(faces)))
    assert there.error_max == pytest.approx(here.error_max, rel=1e-4)
    assert there.coverage == pytest.approx(here.coverage, rel=1e-6)
    assert there.patch.at(0.5, 0.5) == pytest.approx(turn @ here.patch.at(0.5, 0.5) + [1.0, -2.0, 0.5], abs=1e-5)


def test_errors_against_brute_force() -> None:
    """Both ways, against trimesh: points of the patch to the mesh, inner vertices of the mesh to the patch."""
    vertices, faces = sheet(drum, cells=8)
    fitted = fit(vertices, faces, np.arange(len(faces)), (1, 2))
    spots, cells = sheet(lambda u, v: np.moveaxis(fitted.patch.at(u, v), -1, 0), cells=60)
    inner = vertices.reshape(9, 9, 3)[1:-1, 1:-1].reshape(-1, 3)  # the rim may stand out a little
    away = np.concatenate([to_mesh(spots[::7], vertices, faces), to_mesh(inner, spots, cells)])
    assert fitted.error_max == pytest.approx(away.max(), rel=0.15)


def to_mesh(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Distances to a mesh; in millimetres inside, because the tolerances of trimesh are absolute."""
    mesh = trimesh.Trimesh(1e3 * vertices, faces, process=False)
    return 1e-3 * trimesh.proximity.closest_point_naive(mesh, 1e3 * points)[1]


def test_more_that_is_refused() -> None:
    vertices, faces = icosphere()
    with pytest.raises(InputError, match=r"selection: turns by 8[0-9] degrees .* like a hemisphere or more"):
        fit(vertices, faces, within(vertices, faces, np.array([0.0, 0.0, 1.0]), 84))
    with pytest.raises(InputError, match=r"selection: has shape \(3,\); a mask of the mesh needs \(5120,\)"):
        fit(vertices, faces, np.array([True, False, True]))
    with pytest.raises(InputError, match="selection: has no such face"):
        fit(vertices, faces, [-1])
    flat, cells = sheet(lambda u, v: (0.03 * u, 0.03 * v, 0 * u), cells=30)
    middles = np.abs(flat[cells].mean(axis=1) - 0.015)
    cross = (middles[:, 0] < 0.003) | (middles[:, 1] < 0.003)
    with pytest.raises(InputError, match="selection: has an outline that cannot be taken as four sides"):
        fit(flat, cells, cross)
