"""The engine's machine code: no numba to answer, and nothing read or written but what it is given."""

from __future__ import annotations

import subprocess
import sys
from copy import copy

import numpy as np
import pytest

from handfast.core.groups import Block, Layout, Reals
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.search import arrays
from handfast.stability.search.arrays import Workspace, WorkspaceLayout
from handfast.stability.search.machine import LIBRARY
from handfast.stability.studies.batch import max_many
from handfast.stability.studies.questions import maximum
from tests.support.problems import bell, solved

QUESTION = """
import sys
from handfast import check, load_grasp, maximum
print(check(load_grasp("fig1"), [0, 2.2, 0, 0, 0, 0]).verdict, check(load_grasp("fig1"), [0, 2.5, 0, 0, 0, 0]).verdict)
print("numba" in sys.modules)
"""


@pytest.mark.slow
def test_questions_are_answered_without_numba() -> None:
    assert LIBRARY.functions.run
    done = subprocess.run([sys.executable, "-c", QUESTION], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["holds", "slips", "False"]


@pytest.mark.parametrize("sizes", [(3, 4, 21, 13, 24, 24, 5), (1, 0, 4, 6, 4, 12, 0), (15, 16, 80, 60, 80, 64, 30)])
def test_workspaces_lie_apart(sizes: tuple[int, ...]) -> None:
    spaces = [Workspace(WorkspaceLayout.of(*sizes)) for _ in range(2)]
    first, second = (np.concatenate(space.tables) for space in spaces)
    assert not np.intersect1d(first[:, 0], second[:, 0]).size
    assert (np.diff(np.sort(first[:, 0])) >= 0).all()


def test_a_new_workspace_keeps_no_working_set() -> None:
    space = Workspace(WorkspaceLayout.of(3, 4, 21, 13, 24, 24, 5))
    (lines, *_) = space.tables
    assert lines[0, 1:3].tolist() == [2, arrays.KEPT_WORKING_SETS + 1]
    assert (space._kept.array("owner") == -1).all()


def answers() -> list[tuple[float, float, int]]:
    """Of grasps with one worker and with two, many directions together, limits and uncertain normals."""
    out = []
    for seed in range(4):
        s = solved(seed, 3 + seed, 0.05 * (seed % 2))
        if s.wrench.any():
            out.append(maximum(s.grasp, s.wrench, limits=GraspLimits(eta=s.eta), settings=Settings(nodes=3000)))
    directions = [[np.cos(x), np.sin(x), 0, 0, 0, 0] for x in np.linspace(0, 1, 6)]
    many = max_many(bell(), directions, jobs=1)
    limited = max_many(bell(), directions, limits=GraspLimits(force_limit=5.0), jobs=1)
    rows = [(float(x.lower[i]), float(x.upper[i]), int(x.nodes[i])) for x in (many, limited) for i in range(6)]
    return [(a.lower, a.upper, a.nodes) for a in out] + rows


@pytest.fixture(scope="module")
def usual() -> list[tuple[float, float, int]]:
    return answers()


@pytest.mark.slow
@pytest.mark.parametrize("rest", [np.nan, 1e300])
def test_the_kernel_reads_nothing_that_nobody_wrote(
    usual: list[tuple[float, float, int]], monkeypatch: pytest.MonkeyPatch, rest: float
) -> None:
    made = Block.__init__

    def filled(self: Block, layout: Layout, memory: Reals | None = None) -> None:
        made(self, layout, memory)
        self.memory[:] = rest

    monkeypatch.setattr(Block, "__init__", filled)
    assert answers() == usual
    assert max(nodes for *_, nodes in usual) > 200  # two workers


@pytest.mark.slow
def test_the_kernel_writes_nowhere_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays without padding, apart from each other: what lies between them stays as it is."""
    mark, between, blocks = 1.25e67, 16, []
    made = Block.__init__

    def marked(self: Block, layout: Layout, memory: Reals | None = None) -> None:  # in memory of its own: it is larger
        apart = copy(layout)
        apart.table, apart.fields, apart.size = layout.table.copy(), {}, between
        for line, (name, (dtype, begin, end, shape)) in zip(apart.table, layout.fields.items(), strict=True):
            line[0] = 8 * apart.size
            apart.fields[name] = dtype, apart.size, apart.size + end - begin, shape
            apart.size += end - begin + between
        made(self, apart)
        free = np.ones(apart.size, bool)
        for _, begin, end, _ in apart.fields.values():
            free[begin:end] = False
        self.memory[free] = mark
        blocks.append((self.memory, free))

    monkeypatch.setattr(Block, "__init__", marked)
    answers()
    assert len(blocks) > 30
    assert all((memory[free] == mark).all() for memory, free in blocks)
