"""Machine code of a small library: made, found, kept, made anew; what may not be compiled, and what is not loaded.

And that of both engines, for every baseline that this processor can run.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from handfast import check, load_grasp, load_task, maximum, synthesize
from handfast.core import machine_code
from handfast.core.errors import InputError
from handfast.core.groups import table
from handfast.core.machine_code import BASELINES, Baseline, Library, loaded, own_baseline, sealed
from handfast.core.trusted import exposed, trusted
from handfast.stability.search.machine import LIBRARY as STABILITY
from handfast.synthesis.search.library import LIBRARY as SYNTHESIS
from tests.support.slow_cases import slow_after

DECLARED = """
from pathlib import Path
from typing import NamedTuple
from handfast.core.groups import Flags, RealMatrix, Reals, Wholes
from handfast.core.machine_code import EntryPoint, Library

class Sample(NamedTuple):
    points: RealMatrix
    weights: Reals
    places: Wholes
    used: Flags
    scale: float
    many: int
    negative: bool

HERE = Path(__file__).parent
LIBRARY = Library("toy", __name__, {"weigh": EntryPoint("toy.kernel", (Sample, int, float, bool))}, SOURCES)
"""
KERNEL = """
import numpy as np
from handfast.core.compiled import inner
from toy.helper import turned

@inner
def weigh(sample, power, shift, flip):
    total = 0.0
    for i in range(sample.many):
        if sample.used[i]:
            x = sample.points[sample.places[i], 1] + shift
            total += sample.weights[i] * power * x
    sample.weights[0] = turned(total * sample.scale)
    if flip != sample.negative:
        sample.weights[0] = -sample.weights[0]
    return sample.points.shape[0]
"""
HELPER = """
import numpy as np
from handfast.core.compiled import inner

@inner
def turned(x):
    return np.arctan2(x, 1.0)
"""
ALL = '(HERE / "library.py", HERE / "kernel.py", HERE / "helper.py")'
Toy = Callable[..., Library]
RUN_HERE = BASELINES[BASELINES.index(own_baseline()) :]


def own_name(library: Library) -> str:
    return library.file_name(own_baseline())


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Toy:
    """A library in a package of its own."""

    def make(kernel: str = KERNEL, sources: str = ALL) -> Library:
        folder = tmp_path / "toy"
        folder.mkdir(exist_ok=True)
        for name, text in (("library", DECLARED.replace("SOURCES", sources)), ("kernel", kernel), ("helper", HELPER)):
            (folder / f"{name}.py").write_text(text)
        (folder / "__init__.py").touch()
        monkeypatch.syspath_prepend(str(tmp_path))
        for name in ("toy", "toy.library"):
            sys.modules.pop(name, None)
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
        return importlib.import_module("toy.library").LIBRARY

    return make


def test_a_function_is_compiled_once_for_all_constants_that_it_is_given() -> None:
    """Numba would do it once for each: here for 1 and (0.5, 1), and for 2 and (0.5, 2)."""
    numba = pytest.importorskip("numba")
    from handfast.core.compiler import _of_any_constant

    types, chosen = numba.types, numba.njit(lambda number, pair: number + pair[1])
    for number in map(types.literal, (1, 2)):
        _of_any_constant(chosen, (number, types.Tuple([types.float64, number])), {})
    assert chosen.signatures == [(types.int64, types.Tuple([types.float64, types.int64]))]
    _of_any_constant(chosen, (types.literal(3),), {"pair": types.Tuple([types.float64, types.literal(4)])})
    assert len(chosen.signatures) == 1


@pytest.mark.slow
def test_a_library_computes_what_its_functions_say(toy: Toy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")  # settings of numba do not count
    library = toy()
    Sample = library.entries["weigh"].takes[0]
    points, weights = np.arange(12.0).reshape(4, 3), np.array([1.0, 2.0, 3.0])
    used, places = np.array([True, False, True]), np.array([3, 0, 1])
    sample = Sample(points, weights, places, used, 0.25, 3, True)
    lines = table(sample)
    expected = -np.arctan2(0.25 * 2 * (1 * 12.0 + 3 * 6.0), 1.0)
    codes = library.machine_codes(BASELINES)
    for baseline, code in zip(BASELINES, codes, strict=True):
        assert code == library.machine_code(baseline)
        assert f"numba {version('numba')}, llvmlite {version('llvmlite')}".encode() in code
        if baseline not in RUN_HERE:
            continue
        functions = loaded(code, {"weigh": library.entries["weigh"].takes})
        weights[0] = 1.0
        assert functions.weigh(lines, 2, 2.0, False) == 4
        assert weights[0] == pytest.approx(expected, rel=1e-14)
        weights[0] = 1.0
        functions.weigh(lines, 2, 2.0, True)
        assert weights[0] == pytest.approx(-expected, rel=1e-14)
    assert len(set(codes)) == len(BASELINES)
    assert library.compiled(RUN_HERE[:1])[RUN_HERE[0]] == library.machine_code(RUN_HERE[0])  # the same alone
    script = "import sys; from toy.library import LIBRARY; LIBRARY.functions.weigh; print('numba' in sys.modules)"
    path = os.pathsep.join([str(tmp_path), *sys.path])
    run = [sys.executable, "-c", script]
    done = subprocess.run(run, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]  # what is kept needs no numba


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "sample.weights[:] = np.ones(len(sample.weights)) * shift",
            ["sample.weights[:] = np.ones(", "built-in function empty"],
        ),
        (
            "if shift > 1e6: raise ValueError('far')",
            ["toy: kernels must not allocate or raise, but want", "PyErr_Clear"],
        ),
    ],
    ids=["allocate", "raise"],
)
def test_functions_neither_allocate_nor_raise(
    toy: Toy, capfd: pytest.CaptureFixture[str], line: str, said: list[str]
) -> None:
    library = toy(KERNEL.replace("total = 0.0\n", f"{line}\n    total = 0.0\n"))
    with pytest.raises(subprocess.CalledProcessError, match="non-zero exit status 1"):
        library.compiled(BASELINES)
    messages = capfd.readouterr().err
    assert all(text in messages for text in said)


def test_no_source_is_forgotten(toy: Toy, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(subprocess.CalledProcessError):
        toy(sources='(HERE / "library.py", HERE / "kernel.py")').compiled(BASELINES)
    assert "helper.py is compiled, too, but not among the library's sources" in capfd.readouterr().err


def test_a_package_that_defines_something_is_a_source(toy: Toy, capfd: pytest.CaptureFixture[str]) -> None:
    library = toy()
    package = library.sources[0].parent / "__init__.py"
    package.write_text("SPARE = 2.0\n")
    with pytest.raises(subprocess.CalledProcessError):
        library.compiled(BASELINES)
    assert "__init__.py is compiled, too, but not among the library's sources" in capfd.readouterr().err


# --- where code is kept, and what is loaded ---------------------------------------------------------------


@pytest.fixture
def elsewhere(toy: Toy, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> tuple[Library, list[Path], list[int]]:
    """A library as if it compiled, two empty folders in place of the usual ones, and how often it compiled."""
    library, folders, made = toy(), [tmp_path / "package", tmp_path / "own"], []
    monkeypatch.setattr(
        Library, "compiled", lambda self, baselines: made.append(1) or dict.fromkeys(baselines, b"code")
    )
    monkeypatch.setattr(Library, "folders", lambda self: tuple(folders))
    return library, folders, made


Elsewhere = tuple[Library, list[Path], list[int]]


def test_code_is_made_once_and_kept(elsewhere: Elsewhere) -> None:
    library, folders, made = elsewhere
    assert library.machine_code() == library.machine_code() == b"code"
    assert made == [1]
    assert [f.name for f in folders[0].iterdir()] == [own_name(library)]  # and no draft
    assert not folders[1].exists()


def test_where_the_package_cannot_be_written_the_user_keeps_it(elsewhere: Elsewhere) -> None:
    library, folders, made = elsewhere
    folders[0].write_text("a file where a folder would be")
    assert library.machine_code() == library.machine_code() == b"code"
    assert made == [1]
    assert (folders[1] / own_name(library)).exists()


@pytest.mark.parametrize("how", ["cut short", "one bit", "empty"])
def test_a_damaged_file_is_made_anew(elsewhere: Elsewhere, how: str) -> None:
    library, folders, made = elsewhere
    library.machine_code()
    file = folders[0] / own_name(library)
    whole = file.read_bytes()
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
    file.write_bytes({"cut short": whole[:middle], "one bit": flipped, "empty": b""}[how])
    assert library.machine_code() == b"code"
    assert made == [1, 1]
    assert file.read_bytes() == whole


@pytest.mark.skipif(sys.platform == "win32", reason="modes of files are POSIX's")
@pytest.mark.parametrize("mode", [0o020, 0o002])
@pytest.mark.parametrize("what", ["file", "folder"])
def test_what_others_may_write_is_not_loaded(elsewhere: Elsewhere, what: str, mode: int) -> None:
    library, folders, made = elsewhere
    folders[0].mkdir()
    file = folders[0] / own_name(library)
    file.write_bytes(sealed(b"theirs"))
    assert library.machine_code() == b"theirs"  # else this test shows nothing
    place = file if what == "file" else file.parent
    place.chmod(place.stat().st_mode | mode)
    assert library.machine_code() == b"code"
    assert made == [1]
    kept = folders[0] if what == "file" else folders[1]  # nothing is written where it would not be read
    assert (kept / own_name(library)).read_bytes() == sealed(b"code")
    assert not (kept / own_name(library)).stat().st_mode & 0o022


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


@pytest.fixture
def private(tmp_path: Path) -> Path:
    """A folder of a way on which nobody else can write, which holds for the folders of a test."""
    assert exposed(tmp_path) is None, "the folder of the tests is open to others: these tests show nothing"
    return tmp_path


@pytest.mark.skipif(sys.platform == "win32", reason="modes of folders are POSIX's")
@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777])
def test_a_folder_below_one_that_others_may_write_to_is_exposed(private: Path, mode: int) -> None:
    open_, inner = private / "open", private / "open" / "below" / "inner"
    inner.mkdir(parents=True)
    assert exposed(inner) is None
    open_.chmod(mode)
    assert exposed(inner) == exposed(open_) == open_
    open_.chmod(mode | 0o1000)  # nobody may rename what is another's
    assert exposed(inner) is None
    assert exposed(open_) == open_  # but anybody add files


@pytest.mark.skipif(sys.platform == "win32", reason="modes of folders are POSIX's")
@pytest.mark.parametrize("relative", [False, True])
def test_every_link_on_the_way_is_followed(private: Path, relative: bool) -> None:
    open_, safe = private / "open", private / "safe"
    (open_ / "below").mkdir(parents=True)
    (safe / "below").mkdir(parents=True)
    way = Path("..") / "open" if relative else open_
    (safe / "link").symlink_to(way)  # a safe folder with a link into an open one
    (open_ / "link").symlink_to(Path("..") / "safe" if relative else safe)  # an open folder with a link into a safe one
    for through in (safe / "link" / "below", open_ / "link" / "below", safe / "link" / "link" / "below"):
        open_.chmod(0o755)
        assert exposed(through) is None
        open_.chmod(0o777)
        assert exposed(through) == open_
    (safe / "turns").symlink_to(safe / "turns")
    with pytest.raises(OSError, match="more than 40 links"):
        exposed(safe / "turns" / "below")
    with pytest.raises(FileNotFoundError):
        exposed(safe / "none")


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() != 0, reason="only root can give files away")
def test_what_belongs_to_another_is_exposed(private: Path) -> None:
    theirs, inner = private / "theirs", private / "theirs" / "inner"
    inner.mkdir(parents=True)
    os.chown(theirs, 12345, -1)
    assert exposed(inner) == theirs
    theirs.chmod(0o1777)  # the owner of a folder may rename what is in it, sticky or not
    assert exposed(inner) == theirs
    shared = private / "shared"
    (shared / "mine").mkdir(parents=True)
    (shared / "link").symlink_to(private)
    shared.chmod(0o1777)
    assert exposed(shared / "mine") is None
    assert exposed(shared / "link") is None
    os.chown(shared / "link", 12345, -1, follow_symlinks=False)
    assert exposed(shared / "link") == shared


@pytest.mark.skipif(sys.platform == "win32", reason="modes of folders are POSIX's")
@pytest.mark.parametrize("how", ["above", "link", "file"])
def test_code_below_a_folder_that_others_may_write_to_is_not_loaded(
    elsewhere: Elsewhere, private: Path, caplog: pytest.LogCaptureFixture, how: str
) -> None:
    library, folders, made = elsewhere
    open_ = private / "open"
    kept = open_ / "kept"
    kept.mkdir(parents=True)
    (kept / own_name(library)).write_bytes(sealed(b"theirs"))
    if how == "above":
        folders[0] = kept
    elif how == "link":
        folders[0].symlink_to(kept)
    else:
        folders[0].mkdir()
        (folders[0] / own_name(library)).symlink_to(kept / own_name(library))
    folders[1] = folders[0]
    assert library.machine_code() == b"theirs"  # else this test shows nothing
    open_.chmod(0o777)
    assert library.machine_code() == b"code"
    assert made == [1]
    if how != "file":  # a link is replaced by a file of one's own
        assert (
            f"not kept: no folder that only you can write to at {folders[0]} (others can write to {open_})"
            in caplog.text
        )
        assert (kept / own_name(library)).read_bytes() == sealed(b"theirs")


@pytest.mark.skipif(sys.platform == "win32", reason="the variable is another")
@pytest.mark.parametrize("value", ["", ".", "cache", "./cache", None])
def test_a_cache_that_is_no_absolute_path_is_ignored(
    toy: Toy, monkeypatch: pytest.MonkeyPatch, value: str | None
) -> None:
    library = toy()
    monkeypatch.setenv("HOME", "/home/somebody")
    if value is None:
        monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    else:
        monkeypatch.setenv("XDG_CACHE_HOME", value)
    assert library.folders() == (library.home, Path("/home/somebody/.cache/handfast"))
    monkeypatch.setenv("XDG_CACHE_HOME", "/var/cache/somebody")
    assert library.folders()[1:] == (Path("/var/cache/somebody/handfast"),)
    monkeypatch.setenv("XDG_CACHE_HOME", value or "")
    monkeypatch.setenv("HOME", "here")
    assert library.folders()[1:] == ()


@pytest.mark.parametrize("what", ["kernel", "helper", "library", "compiler"])
def test_other_sources_are_other_code(toy: Toy, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, what: str) -> None:
    library = toy()
    before = own_name(library)
    assert own_name(library) == before
    if what == "compiler":
        changed = tmp_path / "compiler.py"
        changed.write_text("# another")
        others = (path for path in machine_code.OWN_SOURCES if path.name != "compiler.py")
        monkeypatch.setattr(machine_code, "OWN_SOURCES", (*others, changed))
    else:
        source = tmp_path / "toy" / f"{what}.py"
        source.write_text(source.read_text() + "\n")
    assert own_name(library) != before


# --- baselines: code that travels -------------------------------------------------------------------------


def test_names_hold_neither_the_processor_nor_versions(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    library = toy()
    before = [library.file_name(x) for x in BASELINES]
    assert len(set(before)) == len(BASELINES)
    for name, baseline in zip(before, BASELINES, strict=True):
        start, digest = name.rsplit("-", 1)
        assert start == f"kernel-toy-{machine_code.ARCHITECTURE}-{baseline.name}-{sys.platform}"
        assert len(digest) == len("0123456789abcdef.o")
    monkeypatch.setattr(machine_code.llvm, "get_host_cpu_name", lambda: "another")
    monkeypatch.setattr(machine_code.llvm, "get_host_cpu_features", dict)
    monkeypatch.setattr("importlib.metadata.version", lambda name: "0.0")
    assert [library.file_name(x) for x in BASELINES] == before


@pytest.mark.parametrize(
    ("features", "chosen"),
    [
        ({"wide": True, "fused": True, "other": True}, "new"),
        ({"wide": True, "fused": False}, "old"),  # the processor has it, the system does not let it be used
        ({"fused": True}, "old"),
        ({}, "old"),
    ],
)
def test_the_first_baseline_that_the_processor_can_run_is_taken(
    monkeypatch: pytest.MonkeyPatch, features: dict[str, bool], chosen: str
) -> None:
    baselines = (Baseline("new", "second", frozenset({"wide", "fused"})), Baseline("old", "first"))
    monkeypatch.setattr(machine_code, "BASELINES", baselines)
    monkeypatch.setattr(machine_code.llvm, "get_host_cpu_features", lambda: features)
    assert own_baseline().name == chosen


def test_the_last_baseline_is_for_every_processor() -> None:
    assert not BASELINES[-1].needs


def test_without_numba_kept_code_is_loaded_and_other_code_is_not_made(
    elsewhere: Elsewhere, monkeypatch: pytest.MonkeyPatch
) -> None:
    library, folders, made = elsewhere
    monkeypatch.setattr(machine_code, "find_spec", lambda name: None)
    with pytest.raises(
        InputError, match=r"numba: is needed to compile the toy engine.*pip install 'handfast\[compiler\]'"
    ):
        library.machine_code()
    folders[1].mkdir()
    (folders[1] / own_name(library)).write_bytes(sealed(b"made elsewhere"))
    assert library.machine_code() == b"made elsewhere"
    assert made == []


def test_only_what_is_missing_is_compiled(elsewhere: Elsewhere, monkeypatch: pytest.MonkeyPatch) -> None:
    library, folders, made = elsewhere
    baselines = [Baseline(name, "first") for name in ("new", "middle", "old")]
    folders[0].mkdir()
    (folders[0] / library.file_name(baselines[1])).write_bytes(sealed(b"kept"))
    assert library.machine_codes(baselines) == [b"code", b"kept", b"code"]
    assert library.machine_codes(baselines) == [b"code", b"kept", b"code"]
    assert made == [1]


@pytest.mark.parametrize("baseline", slow_after(1, RUN_HERE), ids=lambda x: x.name)  # others may have to be compiled
@pytest.mark.slow
@pytest.mark.timeout(1500)  # it compiles both kernels where none are kept, however busy the machine is
def test_every_baseline_answers_alike(monkeypatch: pytest.MonkeyPatch, baseline: Baseline) -> None:
    for library in (STABILITY, SYNTHESIS):
        takes = {name: entry.takes for name, entry in library.entries.items()}
        monkeypatch.setitem(library.__dict__, "functions", loaded(library.machine_code(baseline), takes))
    fig1, fig7 = load_grasp("fig1"), load_grasp("fig7")
    assert [check(fig1, [0, y, 0, 0, 0, 0]).verdict for y in (2.2, 2.5)] == ["holds", "slips"]
    assert check(fig7, [0, 0, -1, 0, 0, 0]).verdict == "holds"
    answer = maximum(fig1, [0, 1, 0, 0, 0, 0])
    assert 2.2 < answer.lower <= answer.upper < 2.5
    assert len(synthesize(load_task("scalpel-handling"), count=2, jobs=1).solutions) == 2
