"""What is counted of a package's sources."""

from __future__ import annotations

from types import ModuleType

import pytest

from tests.support.places import ROOT

LONG = "def f(a, b, /, c, *d, e, f, g, h, **i): ...\n"  # 9
METHOD = "class C:\n    def m(self, a, b, c, d, e, f, g, h): ...\n"  # 8 beside self
EMPTY = ""
NAMED = "from typing import Any\nx: Any = 1\ny: dict[str, Any] = {}\n" + 60 * "\n"


@pytest.fixture
def size(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import size

    return size


def test_files_lines_parameters_and_any(size: ModuleType) -> None:
    counts = list(size.counted([LONG, METHOD, EMPTY, NAMED]).values())
    assert counts == [4, 1 + 2 + 0 + 63, 1, 2, 2]  # an empty file is a package's


def test_what_a_package_needs_is_counted_once(size: ModuleType) -> None:
    """scipy needs numpy alone."""
    assert size.megabytes("numpy") == 0
    assert 20 < size.megabytes("scipy") < 200
    assert size.megabytes("handfast") > size.megabytes("scipy")
