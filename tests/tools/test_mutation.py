"""Which modules are mutated, which tests judge them, and faults of kernels that can be planted."""

from __future__ import annotations

import ast
from pathlib import Path
from types import ModuleType

import pytest

from tests.support.places import ROOT

SOURCES = ROOT / "src" / "handfast"


@pytest.fixture
def mutation(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import mutation

    return mutation


@pytest.fixture
def plant(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import plant

    return plant


@pytest.fixture
def kernel_faults(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import kernel_faults

    return kernel_faults


def test_every_module_of_a_package_but_kernels_is_mutated(mutation: ModuleType) -> None:
    mutated = [source for part in mutation.packages().values() for source in part.sources]
    assert len(mutated) == len(set(mutated))
    every = {str(file.relative_to(SOURCES)) for file in SOURCES.glob("*/**/*.py") if file.name != "__init__.py"}
    assert every - set(mutated) - set(mutation.NOT_MUTATED) == {f for f in every if Path(f).parent.name == "kernel"}
    assert set(mutation.NOT_MUTATED) <= every


def test_a_package_is_judged_by_the_tests_beside_it(mutation: ModuleType) -> None:
    parts = mutation.packages()
    assert "measures/test_measure.py" in parts["measures"].tests
    assert {Path(t).parent for t in parts["proofs"].tests if t not in mutation.ALSO["proofs"]} == {Path("proofs")}
    assert set(mutation.ALSO) <= set(parts)
    assert parts["planning/filters"].tests == parts["planning"].tests  # it has no folder of its own
    assert all((ROOT / "tests" / test).is_file() for part in parts.values() for test in part.tests)
    one = mutation.part_named("model/hand/coupling.py")
    assert (one.sources, one.tests) == (("model/hand/coupling.py",), parts["model/hand"].tests)
    assert mutation.part_named("model/hand/none.py") is None
    assert mutation.part_named("none") is None


PLANTED = [
    ("def f(x):\n    return -x < 2", ["-x <= 2", "x < 2", "-x < 3"]),
    ("def f(x):\n    super().f()\n    return x or 1", ["x and 1", "x or 2"]),
    ("def f(x):\n    return min(x, 1)", ["min(None, 1)", "min(1)", "min(x)", "max(x, 1)", "min(x, 2)"]),
    ("def f(x):\n    return x if x else g(k=x)", ["x", "g(k=x)", "x if x else g()"]),
    ("def f(x):\n    return [y for y in x if not y]", ["[y for y in x]", "[y for y in x if y]"]),
    ("def f(x: int = 1) -> 'A':\n    return x and 'a'", ["x or 'a'", "x and 'XXaXX'"]),
    ("def f(x):\n    return zip(x, x, strict=True)",
     ["zip(None, x, strict=True)", "zip(x, strict=True)", "zip(x, None, strict=True)", "zip(x, strict=True)"]),
    ("def f(x):\n    'said'\n    return InputError('said', f'{x} N')",
     ["InputError(f'{x} N')", "InputError('said', None)", "InputError('said')"]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "others"), PLANTED)
def test_what_is_planted_by_hand(plant: ModuleType, tmp_path: Path, text: str, others: list[str]) -> None:
    (tmp_path / "a.py").write_text(text, encoding="utf-8")
    found = list(plant.mutants(tmp_path / "a.py"))
    assert [mutant.diff()[-1] for mutant in found] == [f"+    return {other}" for other in others]
    assert [mutant.name for mutant in found] == [f"f#{k}" for k in range(len(others))]


def test_a_mutant_takes_the_place_of_a_method(plant: ModuleType, tmp_path: Path) -> None:
    text = "class A:\n    @property\n    def f(self):\n        return self.x + 1\n"
    (tmp_path / "a.py").write_text(text, encoding="utf-8")
    place: dict[str, type] = {}
    exec(text, place)
    a = place["A"]()
    a.x = 5
    got = []
    for mutant in plant.mutants(tmp_path / "a.py"):
        assert (mutant.function, mutant.lines) == ("A.f", (4, 4))
        vars(place["A"])["f"].fget.__code__ = mutant.code()
        got.append(a.f)
    assert got == [4, 7]


def test_faults_of_kernels_can_be_planted(kernel_faults: ModuleType) -> None:
    """Each stands in its kernel once, in both halves there are ten at least, and what is planted is Python."""
    faults = kernel_faults.FAULTS
    assert len({fault.name for fault in faults}) == len(faults)
    assert min(sum(fault.half == half for fault in faults) for half in ("stability", "synthesis")) >= 10
    for fault in faults:
        text = fault.planted()
        assert text != (ROOT / fault.path).read_text("utf-8")
        ast.parse(text)


def test_a_fault_that_stands_nowhere_is_refused(kernel_faults: ModuleType) -> None:
    gone = kernel_faults.Fault("stability", "tree.py", "no such line", "none", "nothing")
    with pytest.raises(SystemExit, match=r"tree.py: nothing: 'no such line' stands there 0 times, not once"):
        gone.planted()


def test_what_is_known_of_a_fault_is_not_tried_again(
    kernel_faults: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = []

    def judged(fault: object, folder: Path, known: dict[str, str]) -> str:
        tried.append(fault)
        return kernel_faults.KILLED if len(tried) % 2 else kernel_faults.ALIVE

    monkeypatch.setattr(kernel_faults, "_judged", judged)
    found = kernel_faults.run(tmp_path, 4, 0)
    assert [killed for _, killed in found] == [True, False, True, False]
    assert kernel_faults.run(tmp_path, 4, 0) == found
    assert len(tried) == 4
    assert len(kernel_faults.run(tmp_path, 6, 0)) == 6
    assert {fault.name for fault in tried} <= {fault.name for fault in kernel_faults.FAULTS}
