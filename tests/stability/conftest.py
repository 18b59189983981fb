"""An answer with a hole, for the tests of what is resisted below a maximum."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.model.grasp import Grasp
from handfast.stability.answers import MaxAnswer
from tests.support.saved_answers import HOLED, answer

GAP = 1e-3


@pytest.fixture(scope="module")
def holed() -> tuple[Grasp, np.ndarray, MaxAnswer]:
    """A grasp that resists 4.7 N, but slips at 2 to 3 N: the paper's warning in section VII-B."""
    found = answer("max with a hole")
    assert isinstance(found, MaxAnswer)
    return HOLED.grasp, HOLED.direction, found
