"""The twelve bundled Barrett grasps: their counts, that they are what their configurations say, that they hold."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from handfast import Verdict, check, contact_grasp, load_body, load_configuration, load_grasp, load_hand
from handfast.core import bundled
from handfast.geometry.collision import always_meeting
from handfast.geometry.scene import Scene
from handfast.stability.problem.loads import Loads

TWELVE = [n for n in bundled.names("grasps") if n.startswith("barrett-")]
SOLID = 1e-3  # [m]


def test_as_many_contacts_as_in_the_papers_figure() -> None:
    assert len(TWELVE) == 12
    assert Counter(load_grasp(n).m for n in TWELVE) == {3: 4, 4: 5, 5: 1, 6: 2}
    assert len({load_configuration(n).object for n in TWELVE}) == 12
    assert {load_configuration(n).hand for n in TWELVE} == {"barrett-bh8-280"}


@pytest.mark.parametrize("name", TWELVE)
def test_the_grasp_is_that_of_its_configuration(name: str) -> None:
    placed, stored = load_configuration(name), load_grasp(name)
    hand, q = placed.applied(load_hand(placed.hand or ""))
    body = load_body(placed.object or "")
    made = contact_grasp(hand, q, body, placed.pose, preload=placed.preload)

    assert [c.link for c in made.contacts] == [c.link for c in stored.contacts]
    for a, b in zip(made.contacts, stored.contacts, strict=True):
        np.testing.assert_allclose(a.position, b.position, atol=1e-8)
        # surfaces that nearly touch: their distance is known to 1e-9 m, its direction less well
        np.testing.assert_allclose(a.normal, b.normal, atol=1e-5)
        assert a.friction == b.friction
    assert stored.preload == made.preload == placed.preload
    assert sum(v > 0 for v in stored.preload.values()) >= 2
    np.testing.assert_allclose(made.J, stored.J, atol=1e-5)
    np.testing.assert_array_equal(made.mechanism.R, stored.mechanism.R)
    assert {c.link.split("_")[1] for c in stored.contacts if c.link != "palm"} == {"1", "2", "3"}

    scene = Scene(hand, body)
    links, meetings = scene.clearances(q, placed.pose)
    watched = [pair not in always_meeting(scene) for pair in scene.self_pairs]
    assert max(c.depth for c in made.contacts) < SOLID
    assert links.min() > -SOLID
    assert meetings[watched].min() > -SOLID


@pytest.mark.parametrize("name", TWELVE)
def test_it_holds_its_weight_whichever_way_it_is_turned(name: str) -> None:
    grasp, body = load_grasp(name), load_body(load_configuration(name).object or "")
    loads = Loads.gravity(body)
    assert len(loads) == 6
    for load, wrench in zip(loads.names, loads.wrenches, strict=True):
        answer = check(grasp, wrench)
        assert answer.verdict is Verdict.HOLDS, load
        assert answer.witness is not None
        assert answer.witness.residuals.worst < 1e-9
        np.testing.assert_allclose(answer.witness.forces.sum(axis=0), -wrench[:3], atol=1e-8)
