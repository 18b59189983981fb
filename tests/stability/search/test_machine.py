"""The kernel's machine code: found, kept, made anew; and the arrays that it takes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from handfast.core.trusted import trusted
from handfast.stability.many import max_many
from handfast.stability.queries import maximum
from handfast.stability.search import arrays, machine
from handfast.stability.settings import Settings
from tests.support.problems import bell, solved

QUESTION = """
import sys
from handfast import check, load_grasp, maximum
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
    code = machine.machine_code()
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


def spoil(file: Path, how: str) -> None:
    data = bytearray(file.read_bytes())
    if how == "cut short":
        data = data[: len(data) // 2]
    elif how == "one bit":
        data[len(data) // 2] ^= 1
    else:
        data.clear()
    file.write_bytes(data)


@pytest.mark.parametrize("how", ["cut short", "one bit", "empty"])
def test_a_damaged_file_is_made_anew(elsewhere: list[Path], monkeypatch: pytest.MonkeyPatch, how: str) -> None:
    code = machine.machine_code()
    file = elsewhere[0] / machine.file_name()
    whole = file.read_bytes()
    spoil(file, how)
    made: list[int] = []
    monkeypatch.setattr(machine, "compiled", lambda: made.append(1) or code)
    assert machine.machine_code() == code
    assert made == [1]
    assert file.read_bytes() == whole


@pytest.mark.skipif(sys.platform == "win32", reason="modes of files are POSIX's")
@pytest.mark.parametrize("mode", [0o020, 0o002])
@pytest.mark.parametrize("what", ["file", "folder"])
def test_what_others_may_write_is_not_loaded(
    elsewhere: list[Path], monkeypatch: pytest.MonkeyPatch, what: str, mode: int
) -> None:
    code = machine.machine_code()
    file = elsewhere[0] / machine.file_name()
    file.write_bytes(machine.sealed(b"theirs"))
    assert machine.machine_code() == b"theirs"  # else this test shows nothing
    place = file if what == "file" else file.parent
    place.chmod(place.stat().st_mode | mode)
    made: list[int] = []
    monkeypatch.setattr(machine, "compiled", lambda: made.append(1) or code)
    assert machine.machine_code() == code
    assert made == [1]
    kept = elsewhere[0] if what == "file" else elsewhere[1]  # nothing is written where it would not be read
    assert (kept / machine.file_name()).read_bytes() == machine.sealed(code)
    assert not (kept / machine.file_name()).stat().st_mode & 0o022


@pytest.mark.skipif(sys.platform == "win32", reason="owners of files are POSIX's")
def test_only_the_user_and_root_are_trusted() -> None:
    def status(mode: int, owner: int) -> os.stat_result:
        return os.stat_result((mode, 0, 0, 1, owner, 0, 0, 0, 0, 0))

    me = os.geteuid()
    assert trusted(status(0o100644, me))
    assert trusted(status(0o40755, 0))
    assert not trusted(status(0o100644, me + 1))
    assert not trusted(status(0o100664, me))
    assert not trusted(status(0o40757, 0))


@pytest.mark.skipif(sys.platform == "win32", reason="the variable is another")
@pytest.mark.parametrize("value", ["", ".", "cache", "./cache", None])
def test_a_cache_that_is_no_absolute_path_is_ignored(monkeypatch: pytest.MonkeyPatch, value: str | None) -> None:
    monkeypatch.setenv("HOME", "/home/somebody")
    if value is None:
        monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    else:
        monkeypatch.setenv("XDG_CACHE_HOME", value)
    assert machine._folders()[1:] == (Path("/home/somebody/.cache/handfast"),)
    monkeypatch.setenv("XDG_CACHE_HOME", "/var/cache/somebody")
    assert machine._folders()[1:] == (Path("/var/cache/somebody/handfast"),)
    monkeypatch.setenv("XDG_CACHE_HOME", value or "")
    monkeypatch.setenv("HOME", "here")
    assert machine._folders()[1:] == ()


NUMBA = """
import sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from numba import config
config.CACHE_DIR = sys.argv[2]
from handfast.synthesis.search.kernel import balls, search
print(search.find.stats.cache_path, balls.add.stats.cache_path)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="modes of files are POSIX's")
def test_numba_keeps_code_only_where_nobody_else_can_write(tmp_path: Path) -> None:
    def kept(folder: str) -> str:
        source = str(Path(machine.HERE).parents[2])
        run = [sys.executable, "-c", NUMBA, source, folder]
        return subprocess.run(run, capture_output=True, text=True, check=True, cwd=tmp_path).stdout

    safe, open_ = tmp_path / "safe", tmp_path / "open"
    safe.mkdir()
    assert kept(str(safe)).count(str(safe)) == 2
    assert kept("here").split() == ["None", "None"]
    assert kept("").count("__pycache__") == 2
    kept(str(open_))
    for folder in open_.iterdir():
        folder.chmod(0o777)
    assert kept(str(open_)).split() == ["None", "None"]


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
    block = arrays.Block(arrays.LANE, ((3,), (2,), (2,), (9,), (1, 2), (5,)))
    made = block.arrays()
    assert arrays.table(arrays.LANE, made).tolist() == block.table.tolist()
    made[3][:] = np.arange(9)
    assert (block.arrays()[3] == np.arange(9)).all()


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
