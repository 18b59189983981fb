"""Machine code of a small library: made, found, kept, made anew; what may not be compiled, and what is not loaded."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from handfast.core import machine_code
from handfast.core.groups import table
from handfast.core.machine_code import Library, sealed
from handfast.core.trusted import trusted

DECLARED = """
from pathlib import Path
from typing import NamedTuple
from handfast.core.groups import Flags, RealMatrix, Reals, Wholes
from handfast.core.machine_code import Entry, Library

class Sample(NamedTuple):
    points: RealMatrix
    weights: Reals
    places: Wholes
    used: Flags
    scale: float
    many: int
    negative: bool

HERE = Path(__file__).parent
LIBRARY = Library("toy", __name__, {"weigh": Entry("toy.kernel", (Sample, int, float, bool))}, SOURCES)
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


def test_a_library_computes_what_its_functions_say(toy: Toy, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")  # settings of numba do not count
    library = toy()
    Sample = library.entries["weigh"].takes[0]
    points, weights = np.arange(12.0).reshape(4, 3), np.array([1.0, 2.0, 3.0])
    used, places = np.array([True, False, True]), np.array([3, 0, 1])
    sample = Sample(points, weights, places, used, 0.25, 3, True)
    lines = table(sample)
    expected = -np.arctan2(0.25 * 2 * (1 * 12.0 + 3 * 6.0), 1.0)
    assert library.functions.weigh(lines, 2, 2.0, False) == 4
    assert weights[0] == pytest.approx(expected, rel=1e-14)
    weights[0] = 1.0
    library.functions.weigh(lines, 2, 2.0, True)
    assert weights[0] == pytest.approx(-expected, rel=1e-14)


def test_its_answer_needs_no_numba(toy: Toy, tmp_path: Path) -> None:
    assert toy().functions.weigh
    code = "import sys; from toy.library import LIBRARY; LIBRARY.functions.weigh; print('numba' in sys.modules)"
    path = os.pathsep.join([str(tmp_path), *sys.path])
    run = [sys.executable, "-c", code]
    done = subprocess.run(run, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("sample.weights[:] = np.ones(len(sample.weights)) * shift", "NRT_MemInfo_alloc"),
        ("if shift > 1e6: raise ValueError('too far')", "PyErr_Clear"),
    ],
)
def test_functions_neither_allocate_nor_raise(
    toy: Toy, capfd: pytest.CaptureFixture[str], line: str, wanted: str
) -> None:
    library = toy(KERNEL.replace("total = 0.0\n", f"{line}\n    total = 0.0\n"))
    with pytest.raises(subprocess.CalledProcessError, match="non-zero exit status 1"):
        library.compiled()
    said = capfd.readouterr().err
    assert "toy: kernels must not allocate or raise, but want" in said
    assert wanted in said


def test_no_source_is_forgotten(toy: Toy, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(subprocess.CalledProcessError):
        toy(sources='(HERE / "library.py", HERE / "kernel.py")').compiled()
    assert "helper.py is compiled, too, but not among the library's sources" in capfd.readouterr().err
