"""An answer with a hole, for the tests of what is resisted below a maximum."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.grasps import random_case
from handfast.model.grasp import Grasp
from handfast.stability.queries import MaxAnswer, maximum

GAP = 1e-3


@pytest.fixture(scope="module")
def holed() -> tuple[Grasp, np.ndarray, MaxAnswer]:
    """A grasp that resists 4.7 N, but slips at 2 to 3 N: the paper's warning in section VII-B."""
    case = random_case(3, 510)
    return case.grasp, case.direction, maximum(case.grasp, case.direction, interval=True)
