"""Which modules are mutated, which tests judge them, and faults of kernels that can be planted."""

from __future__ import annotations

import ast
from pathlib import Path
from types import ModuleType

import pytest

from tests.support.places import ROOT

SOURCES = ROOT / "src" / "handfast"


pytestmark = pytest.mark.optional


@pytest.fixture
def mutation(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    pytest.importorskip("mutmut")
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import mutation

    return mutation


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
    assert {Path(test).parent for test in parts["proofs"].tests} == {Path("proofs")}
    assert parts["planning/filters"].tests == parts["planning"].tests  # it has no folder of its own
    assert all((ROOT / "tests" / test).is_file() for part in parts.values() for test in part.tests)
    one = mutation.part_named("model/hand/coupling.py")
    assert (one.sources, one.tests) == (("model/hand/coupling.py",), parts["model/hand"].tests)
    assert mutation.part_named("model/hand/none.py") is None
    assert mutation.part_named("none") is None


def test_words_do_not_count(mutation: ModuleType) -> None:
    """Those of messages, and `strict` of zip: what they are makes no difference between two functions."""

    def counted(text: str) -> str:
        return ast.dump(mutation.Silent().visit(ast.parse(text)))

    for one, other in (
        ("raise InputError(f'is {x}', field='a')", "raise InputError(f'IS {x}', field='b')"),
        ("y = f'{x} N'", "y = f'{x} kg'"),
        ("frozen(x, (3,), 'about')", "frozen(x, (3,), 'XX')"),
        ("zip(a, b, strict=True)", "zip(a, b, strict=False)"),
    ):
        assert counted(one) == counted(other)
    for one, other in (
        ("raise InputError(f'is {x}')", "raise InputError(f'is {y}')"),
        ("frozen(x, (3,), 'about')", "frozen(x, (4,), 'about')"),
        ("y = 'a'", "y = 'b'"),
    ):
        assert counted(one) != counted(other)


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
    assert len(kernel_faults.run(tmp_path, None, 0, only_known=True)) == 4
    assert len(kernel_faults.run(tmp_path, 6, 0)) == 6
    assert {fault.name for fault in tried} <= {fault.name for fault in kernel_faults.FAULTS}
