"""States found from equilibrium under smooth laws: exact ones where a tree takes long, none where there is none."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.grasps import random_case
from handfast import check, maximum
from handfast.core.answer import Verdict
from handfast.model.grasp import Grasp
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.objective import ANY_STATE
from handfast.stability.problem.settings import Settings
from handfast.stability.search import arrays
from handfast.stability.search.kernel import tree
from handfast.stability.search.reduced import reduce
from handfast.stability.search.search import Search

QUICK = Settings(verify=False, jobs=1)


@pytest.fixture(scope="module")
def grasp() -> Grasp:
    """Of ten contacts; a tree takes hundreds of nodes to find that it holds."""
    return random_case(10, 3).grasp


def test_dense_grasps_hold_without_a_tree(grasp: Grasp) -> None:
    for force in np.vstack([np.eye(3), -np.eye(3)]):
        answer = check(grasp, force, settings=QUICK)
        assert answer.verdict is Verdict.HOLDS
        assert answer.witness is not None
        assert answer.witness.valid
        assert answer.nodes <= tree.EARLY_SEARCH_NODES + arrays.CHILDREN


def test_what_is_resisted_at_any_magnitude_is_found_at_the_end(grasp: Grasp) -> None:
    answer = maximum(grasp, [1.0, 0, 0], settings=QUICK)
    assert answer.unbounded
    assert answer.nodes <= tree.LATE_SEARCH_NODES + arrays.CHILDREN + 1
    assert answer.verify().ok


def test_it_is_tried_once_and_finds_nothing_where_a_load_slips() -> None:
    weak, load = random_case(6, 2).grasp, np.array([0, 0, 0.5, 0, 0, 0])
    search = Search(reduce(scaled_problem.build(weak, load), ANY_STATE), workers=1)
    for _ in search:
        pass
    assert search.z is None
    assert search.nodes > tree.EARLY_SEARCH_NODES
    assert search.counts[arrays.SETTLED] == 1
    answer = check(weak, load)
    assert answer.verdict is Verdict.SLIPS
    assert answer.verified
