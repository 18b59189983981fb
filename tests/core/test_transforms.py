"""Rigid transforms: the one frame from a normal, and what else makes rotations."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.core.transforms import (
    cross,
    cross_rows,
    matrix_quaternion,
    normal_frame,
    normal_frames,
    quaternion_matrix,
    rigid,
    transform,
)
from handfast.model.grasp import Contact
from handfast.model.region import Cap

DIRECTIONS = [*np.eye(3), *-np.eye(3), np.array([1, 1, 1]) / np.sqrt(3), np.array([0.6, 0.0, -0.8])]


def directions(count: int) -> list[np.ndarray]:
    drawn = np.random.default_rng(7).normal(size=(count, 3))
    return [*DIRECTIONS, *(d / np.linalg.norm(d) for d in drawn)]


@pytest.mark.parametrize("n", directions(20))
def test_a_frame_is_a_rotation_whose_first_column_is_the_normal(n):
    F = normal_frame(n)
    np.testing.assert_array_equal(F[:, 0], n)
    np.testing.assert_allclose(F.T @ F, np.eye(3), atol=1e-15)
    assert np.linalg.det(F) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("n", "t1"),
    [
        ((0, 0, 1), (0, 1, 0)),  # e = x is the first of the two that are at right angles to n
        ((1, 0, 0), (0, 0, 1)),  # e = y
        ((0, -1, 0), (0, 0, 1)),  # e = x
        ((0.6, 0.0, -0.8), (0.8, 0.0, 0.6)),  # e = y
    ],
)
def test_tangents_are_those_of_the_published_frames(n, t1):
    F = normal_frame(np.array(n, dtype=float))
    np.testing.assert_allclose(F[:, 1], t1, atol=1e-15)
    np.testing.assert_allclose(F[:, 2], np.cross(n, t1), atol=1e-15)


@pytest.mark.parametrize("n", directions(20))
def test_contacts_caps_and_the_kernels_have_the_same_tangents(n):
    contact, cap = Contact(np.zeros(3), n, 0.5), Cap(np.zeros(3), 0.01, n, 1.0)
    np.testing.assert_array_equal(contact.frame, normal_frame(contact.normal))
    for rotation, F in ((cap.frame, normal_frame(cap.axis)), (compiled(n), normal_frame(n))):
        np.testing.assert_allclose(rotation, np.column_stack([-F[:, 1], -F[:, 2], F[:, 0]]), atol=1e-15)


def compiled(n: np.ndarray) -> np.ndarray:
    from handfast.synthesis.search.kernel.random_start import _frame

    out = np.empty((3, 3))
    _frame.py_func(n, 0.0, out, np.empty((2, 3)))
    return out


@pytest.mark.parametrize("seed", range(5))
def test_products_are_numpys(seed):
    a, b = np.random.default_rng(seed).normal(size=(2, 3))
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))


@pytest.mark.parametrize("seed", range(10))
def test_quaternions_and_matrices_are_each_others_inverse(seed):
    q = np.random.default_rng(seed).normal(size=4)
    q /= np.linalg.norm(q) * np.sign(q[0])
    R = quaternion_matrix(3 * q)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(matrix_quaternion(R), q, atol=1e-15)


def test_a_quaternion_turns_by_the_right_hand_rule():
    half = np.sqrt(0.5)
    np.testing.assert_allclose(quaternion_matrix([half, 0, 0, half]) @ [1, 0, 0], [0, 1, 0], atol=1e-15)


@pytest.mark.parametrize("q", [(0, 0, 0, 0), (np.inf, 0, 0, 0), (np.nan, 0, 0, 1)])
def test_what_is_no_rotation_is_refused(q):
    with pytest.raises(InputError, match=r"quaternion: is \[.*\]; a unit quaternion w, x, y, z is needed"):
        quaternion_matrix(q)


def test_rigid_motions_are_told_from_others():
    turned = transform([0.1, 0.2, 0.3], quaternion_matrix([0.5, 0.5, -0.5, 0.5]))
    np.testing.assert_array_equal(rigid(turned), turned)
    for spoilt in (np.diag([1.0, 1.0, -1.0, 1.0]), np.diag([1.0, 1.0, 1.0001, 1.0]), turned + np.eye(4)[3]):
        with pytest.raises(InputError, match=r"base\.pose: is not a rigid motion"):
            rigid(spoilt, "base.pose")
    with pytest.raises(InputError, match=r"pose: is more than 1e\+06 m away"):
        rigid(transform([2e6, 0, 0]))


def test_frames_are_those_of_one_normal() -> None:
    n = np.random.default_rng(1).normal(size=(50, 3))
    n = np.vstack([n / np.linalg.norm(n, axis=1)[:, None], np.eye(3), -np.eye(3)])
    np.testing.assert_allclose(normal_frames(n), [normal_frame(x) for x in n], atol=1e-15)


def test_products_of_many_vectors_are_those_of_two() -> None:
    a, b = np.random.default_rng(2).normal(size=(2, 5, 4, 3))
    np.testing.assert_array_equal(cross_rows(a, b)[3, 2], cross(a[3, 2], b[3, 2]))
    np.testing.assert_allclose(cross_rows(a[0, 0], b), np.cross(a[0, 0], b), atol=1e-15)
