"""What a plan leans on is searched for once, whichever test plans the same grasp again; not if faults are planted."""

from __future__ import annotations

import json
import os
from typing import Any

import pytest

from handfast.model.grasp import Grasp
from handfast.planning.evaluation import quality
from handfast.readers.grasp_file import to_dict
from tests.support.once import once, parts


def _asked(grasp: Grasp, *given: Any) -> Any:
    return json.dumps(to_dict(grasp)), [list(parts(x)) for x in given]


WHY_FRAGILE = once(quality.why_fragile, _asked)


@pytest.fixture(autouse=True)
def fragility_searched_once(monkeypatch: pytest.MonkeyPatch) -> None:
    if "PROVE_ANEW" not in os.environ:
        monkeypatch.setattr(quality, "why_fragile", WHY_FRAGILE)
