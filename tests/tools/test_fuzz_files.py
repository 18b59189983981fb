"""The tool that mutates files: it finds what it should find, and a few hundred files here and now."""

from __future__ import annotations

import importlib.util
import json
import warnings
from collections import Counter
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from handfast import load_grasp, maximum
from handfast.core import bundled
from handfast.core.errors import InputError
from tests.support.places import ROOT

KINDS = {"grasp": "grasps", "configuration": "configurations", "task": "tasks", "regions": "hand_regions"}


@pytest.fixture(scope="module")
def fuzz() -> ModuleType:
    path = ROOT / "tools" / "fuzz_files.py"
    spec = importlib.util.spec_from_file_location("fuzz_files", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def files() -> dict[str, list[Path]]:
    out = {kind: sorted(bundled.folder(name).glob("*.json")) for kind, name in KINDS.items()}
    return out | {"urdf": sorted(bundled.folder("hands").glob("*.urdf"))}


@pytest.mark.slow
def test_mutated_files_are_read_or_refused(fuzz: ModuleType, tmp_path: Path) -> None:
    counts: Counter[str] = Counter()
    for index in range(200):
        kind, original, path = fuzz.sample_and_file(0, index, files(), tmp_path)
        what, more = fuzz.outcome(kind, path)
        counts[what] += 1
        assert what in ("loaded", "refused"), (index, original, more)
    assert min(counts.values()) > 10


@pytest.mark.parametrize("kind", ["configuration", "task", "regions", "urdf"])
def test_its_own_samples_are_loaded(fuzz: ModuleType, kind: str) -> None:
    """Bundled files of every hand: the tool begins with them, and shows nothing where one is refused."""
    assert {fuzz.outcome(kind, file) for file in files()[kind]} == {("loaded", "")}


def test_a_number_always_gives_the_same_file(fuzz: ModuleType, tmp_path: Path) -> None:
    some = [fuzz.sample_and_file(1, k, files(), tmp_path) for k in range(20)]
    data = [path.read_bytes() for *_, path in some]
    again = [fuzz.sample_and_file(1, k, files(), tmp_path)[2].read_bytes() for k in range(20)]
    assert data == again
    assert sum(d == original.read_bytes() for d, (_, original, _) in zip(data, some, strict=True)) < 5


def test_what_is_no_input_error_is_a_fault(fuzz: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def told(fault: Exception) -> str:
        def use(path: Path) -> str:
            raise fault

        monkeypatch.setitem(fuzz.USES, "loads", use)
        return fuzz.outcome("loads", tmp_path)[0]

    def warned(path: Path) -> str:
        warnings.warn("overflow", RuntimeWarning, stacklevel=1)
        return "loaded"

    assert told(InputError("is wrong")) == "refused"
    assert told(InputError("")) == "FAULT"
    assert told(KeyError("x")) == "FAULT"
    assert told(RecursionError()) == "FAULT"
    monkeypatch.setitem(fuzz.USES, "loads", warned)
    assert fuzz.outcome("loads", tmp_path)[0] == "FAULT"


@pytest.mark.slow
def test_a_claim_that_is_not_so_is_seen(fuzz: ModuleType, tmp_path: Path) -> None:
    answer = maximum(load_grasp("fig1"), [0, 1, 0, 0, 0, 0])
    original, forged = tmp_path / "true.json", tmp_path / "forged.json"
    answer.save(original)
    assert fuzz.contradicted(original) == ""
    data = json.loads(original.read_text("utf-8"))
    data["answer"]["upper"] = data["answer"]["lower"] = 0.5 * answer.lower
    forged.write_text(json.dumps(data))
    changed = fuzz.differences(fuzz.claim(original), fuzz.claim(forged))
    assert [line.split(":")[0] for line in changed] == [".answer.lower", ".answer.upper"]
    assert "says" in fuzz.contradicted(forged)
    assert np.isfinite(answer.upper)
