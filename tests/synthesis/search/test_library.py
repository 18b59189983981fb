"""The kernels as a library: what answering needs, what it is made of, and the workspace that they are handed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import njit

from handfast.synthesis.search import library
from handfast.synthesis.search.kernel.krawczyk import _invert
from handfast.synthesis.search.workspace import CANDIDATE_MARGIN, interior
from handfast.synthesis.task_problem import TaskProblem
from tests.support.holds import grip

ANSWERS = """
import sys
from handfast import load_task
from handfast.synthesis.task_problem import TaskProblem
from handfast.synthesis.query import synthesize
from handfast.synthesis.search.prover import Prover
task = load_task("scalpel-handling")
assert synthesize(task, count=2, jobs=1).solutions
assert Prover(TaskProblem.of(task), workers=1).run(nodes=10).nodes >= 10
print([name for name in ("numba", "handfast.core.compiled") if name in sys.modules])
"""


def test_answers_need_no_compiler() -> None:
    run = subprocess.run([sys.executable, "-c", ANSWERS], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_every_kernel_file_is_among_the_sources() -> None:
    """So that machine code of another version of any of them is not found."""
    folder = Path(library.__file__).parent / "kernel"
    assert set(folder.glob("*.py")) <= set(library.LIBRARY.sources)


def test_the_interior_keeps_off_every_bound() -> None:
    """By the margin where there is room, by a quarter of the range where there is little, not where it is a point."""
    flat = TaskProblem.of(grip(0.05)).flat
    lower, upper = flat.coordinates.lower.copy(), flat.coordinates.upper.copy()
    upper[:2] = lower[:2] + np.array([0.0, CANDIDATE_MARGIN])
    inside = interior(flat._replace(coordinates=flat.coordinates._replace(lower=lower, upper=upper)))
    assert inside.lower[:2] == pytest.approx(lower[:2] + np.array([0.0, CANDIDATE_MARGIN / 4]), abs=1e-15)
    assert inside.upper[2:] == pytest.approx(upper[2:] - CANDIDATE_MARGIN, abs=1e-15)


@njit
def _inverted(matrix, inverse):
    return _invert(matrix, inverse)


@pytest.mark.parametrize("seed", range(5))
def test_the_inverse_is_one_and_a_singular_matrix_has_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, inverse = rng.normal(size=(7, 7)), np.full((7, 7), np.nan)
    matrix[0, 0] = 0.0  # a pivot that must not be taken
    assert _inverted(matrix.copy(), inverse)
    np.testing.assert_allclose(matrix @ inverse, np.eye(7), atol=1e-12)
    matrix[:, 3] = 0.0
    assert not _inverted(matrix, inverse)
