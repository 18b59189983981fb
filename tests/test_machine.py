"""The kernel's machine code: found, kept, made anew; and the arrays that it takes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from holdfast.stability.engine import arrays, machine
from holdfast.stability.many import max_many
from holdfast.stability.queries import maximum
from holdfast.stability.settings import Settings
from problems import bell, solved

QUESTION = """
import sys
from holdfast import check, load_grasp, maximum
print(check(load_grasp("fig1"), [0, 2.2, 0, 0, 0, 0]).verdict, check(load_grasp("fig1"), [0, 2.5, 0, 0, 0, 0]).verdict)
print("numba" in sys.modules)
"""


def test_questions_are_answered_without_numba() -> None:
    machine.kernel()
    done = subprocess.run([sys.executable, "-c", QUESTION], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["holds", "slips", "False"]


@pytest.fixture
def elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Path]:
    """Two empty folders in place of the usual ones; compiling gives what this processor has."""
    code = next(f.read_bytes() for f in (d / machine.file_name() for d in machine._folders()) if f.exists())
    folders = [tmp_path / "package", tmp_path / "user"]
    made: list[int] = []

    def compiled() -> bytes:
        made.append(1)
        assert len(made) == 1, "compiled twice"
        return code

    monkeypatch.setattr(machine, "compiled", compiled)
    monkeypatch.setattr(machine, "_folders", lambda: tuple(folders))
    return folders


def test_machine_code_is_made_once_and_kept(elsewhere: list[Path]) -> None:
    machine.kernel.__wrapped__()
    assert [f.name for f in elsewhere[0].iterdir()] == [machine.file_name()]  # and no draft
    assert machine.kernel.__wrapped__().run


def test_where_the_package_cannot_be_written_the_user_keeps_it(elsewhere: list[Path]) -> None:
    elsewhere[0].write_text("a file where a folder would be")
    machine.kernel.__wrapped__()
    assert (elsewhere[1] / machine.file_name()).exists()
    assert machine.kernel.__wrapped__().run


def test_other_source_or_processor_is_other_code(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    names = {machine.file_name()}
    changed = tmp_path / "simplex.py"
    changed.write_bytes(next(f for f in machine.SOURCES if f.name == "simplex.py").read_bytes() + b"\n")
    with monkeypatch.context() as patch:
        patch.setattr(machine, "SOURCES", (*(f for f in machine.SOURCES if f.name != "simplex.py"), changed))
        names.add(machine.file_name())
    monkeypatch.setattr(machine, "_processor", lambda: ("another", ""))
    names.add(machine.file_name())
    assert len(names) == 3
    assert {f.name for f in machine.SOURCES} >= {"rows.py", "arrays.py", "tree.py", "simplex.py", "newton.py"}


@pytest.mark.parametrize(
    "x", [np.zeros(3, np.float32), np.zeros((3, 3)), np.zeros((3, 2))[:, 0], np.zeros(3, np.int64)]
)
def test_a_table_takes_only_what_its_layout_names(x: np.ndarray) -> None:
    with pytest.raises(TypeError, match="where the kernel takes f1"):
        arrays.table("f1", [x])


def test_a_table_says_where_and_how_long() -> None:
    x, y = np.arange(6.0).reshape(2, 3), np.zeros(4, np.bool_)
    lines = arrays.table("f2 b1", [x, y])
    assert lines[0].tolist() == [x.ctypes.data, 2, 3, 0]
    assert lines[1].tolist() == [y.ctypes.data, 4, 0, 0]
    with pytest.raises(ValueError, match="longer"):
        arrays.table("f2 b1", [x])


@pytest.mark.parametrize("sizes", [(3, 4, 21, 13, 24, 24, 5), (1, 0, 4, 6, 4, 12, 0), (15, 16, 80, 60, 80, 64, 30)])
def test_the_arrays_of_a_room_lie_apart_within_it(sizes: tuple[int, ...]) -> None:
    room = arrays.room(sizes)
    memory, begin = room._memory, room.table[:, 0]
    shapes = [line[1 : 1 + int(kind[1])] for line, kind in zip(room.table, arrays.WORK.split(), strict=True)]
    length = 8 * np.array([np.prod(shape) for shape in shapes])
    assert (begin[1:] >= (begin + length)[:-1]).all()
    assert begin[0] == memory.ctypes.data
    assert begin[-1] + length[-1] <= memory.ctypes.data + memory.nbytes
    assert (memory.view(np.int64)[: 2 * (arrays.KEPT + 1)] == -1).all()
    other = arrays.room(sizes)
    assert not np.intersect1d(other.table[:, 0], begin).size


def test_the_arrays_of_a_block_are_those_of_its_table() -> None:
    block = arrays.Block(arrays.LANE, ((3,), (2,), (2,), (2,), (9,), (1, 2), (5,)))
    made = block.arrays()
    assert arrays.table(arrays.LANE, made).tolist() == block.table.tolist()
    made[4][:] = np.arange(9)
    assert (block.arrays()[4] == np.arange(9)).all()


def answers() -> list[tuple[float, float, int]]:
    """Of grasps with one lane and with two, a map's neighbours, limits and uncertain normals."""
    out = []
    for seed in range(8):
        s = solved(seed, 3 + seed % 4, 0.05 * (seed % 2))
        if s.wrench.any():
            out.append(maximum(s.grasp, s.wrench, eta=s.eta, settings=Settings(node_limit=3000)))
    out += max_many(bell(), [[np.cos(x), np.sin(x), 0, 0, 0, 0] for x in np.linspace(0, 1, 6)], force_limit=5.0)
    return [(a.lower, a.upper, a.nodes) for a in out]


@pytest.mark.parametrize("rest", [0.0, np.nan, -1.0, 1e300])
def test_the_kernel_reads_nothing_that_nobody_wrote(monkeypatch: pytest.MonkeyPatch, rest: float) -> None:
    usual, made = answers(), arrays.Block.__init__

    def filled(self: arrays.Block, layout: str, shapes: tuple[arrays.Shape, ...]) -> None:
        made(self, layout, shapes)
        self._memory[:] = rest

    monkeypatch.setattr(arrays.Block, "__init__", filled)
    assert answers() == usual
    assert max(nodes for *_, nodes in usual) > 200  # two lanes


def test_the_kernel_writes_nowhere_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays without padding, apart from each other: what lies between them stays as it is."""
    mark, between, blocks = 1.25e67, 16, []

    def apart(layout: str, shapes: tuple[arrays.Shape, ...]) -> tuple[np.ndarray, tuple[int, ...], int]:
        lines, begin, at = np.zeros((len(shapes), arrays.LINE), np.int64), [], between
        for line, shape in zip(lines, shapes, strict=True):
            line[0], line[1 : 1 + len(shape)] = 8 * at, shape
            begin.append(at)
            at += int(np.prod(shape)) + between
        return lines, tuple(begin), at

    made = arrays.Block.__init__

    def marked(self: arrays.Block, layout: str, shapes: tuple[arrays.Shape, ...]) -> None:
        made(self, layout, shapes)
        free = np.ones(len(self._memory), bool)
        for begin, shape in zip(self._begin, shapes, strict=True):
            free[begin : begin + int(np.prod(shape))] = False
        self._memory[free] = mark
        blocks.append((self._memory, free))

    monkeypatch.setattr(arrays, "_places", apart)
    monkeypatch.setattr(arrays.Block, "__init__", marked)
    answers()
    assert len(blocks) > 30
    assert all((memory[free] == mark).all() for memory, free in blocks)
