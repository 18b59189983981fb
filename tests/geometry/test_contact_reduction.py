"""Few contacts in place of many: what is left out, by how much it is missed, and what is never left out."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.geometry.contact_patch import distance_to_cone, patches, reduced_contacts, spanning, wrench_edges
from handfast.model.body import Body
from handfast.model.grasp import Contact
from handfast.model.shape import Shape


def cube() -> Body:
    return Body.of([Shape("box", [0.04] * 3)])


def line(*places: float, link: str = "tip", normal: tuple[float, float, float] = (0, 0, 1)) -> list[Contact]:
    return [Contact(np.array([x, 0, -0.02]), np.array(normal), 0.5, link) for x in places]


def test_what_lies_between_two_is_left_out_without_error() -> None:
    found = reduced_contacts(line(-0.01, 0.0, 0.004, 0.01), cube(), tolerance=0.01)
    assert [c.position[0] for c in found.contacts] == [-0.01, 0.01]
    assert found.before == 4
    assert found.error < 1e-9


def test_the_error_is_the_distance_of_the_farthest_wrench() -> None:
    contacts = line(0.0, 0.002)
    found = reduced_contacts(contacts, cube(), tolerance=0.2)
    assert len(found.contacts) == 1
    edges = [wrench_edges(c, np.zeros(3), 0.02 * np.sqrt(3)) for c in contacts]
    left_out = [i for i, c in enumerate(contacts) if c is not found.contacts[0]]
    kept = 1 - left_out[0]
    assert found.error == pytest.approx(distance_to_cone(edges[left_out[0]], edges[kept]))
    assert 0.02 < found.error < 0.08  # 2 mm over 35 mm, shortened as friction may do some of it
    assert len(reduced_contacts(contacts, cube(), tolerance=found.error * 0.99).contacts) == 2


def test_nothing_is_left_out_across_links_or_edges() -> None:
    contacts = [*line(0.0), *line(0.0, link="other"), *line(0.0, normal=(1, 0, 0))]
    assert sorted(map(len, patches(contacts))) == [1, 1, 1]
    assert len(reduced_contacts(contacts, cube(), tolerance=0.5).contacts) == 3
    assert reduced_contacts(line(0.0, 0.0), cube(), tolerance=0).before == 2


def test_kept_contacts_span_what_is_left_out_to_the_tolerance() -> None:
    rng = np.random.default_rng(1)
    for tolerance in (0.02, 0.05, 0.2):
        normals = np.array([0, 0, 1.0]) + 0.2 * rng.normal(size=(9, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        contacts = [Contact(p, n, 0.4, "tip") for p, n in zip(0.005 * rng.normal(size=(9, 3)), normals, strict=True)]
        edges = [wrench_edges(c, np.zeros(3), 0.03) for c in contacts]
        chosen, error = spanning(edges, tolerance)
        cone = np.vstack([edges[k] for k in chosen])
        worst = max((distance_to_cone(e, cone) for i, e in enumerate(edges) if i not in chosen), default=0.0)
        assert worst == pytest.approx(error)
        assert worst <= tolerance
    assert len(chosen) < 9


def test_a_tolerance_that_is_none() -> None:
    with pytest.raises(InputError, match=r"tolerance: is 1\.5; a number from 0 to below 1"):
        reduced_contacts(line(0.0), cube(), tolerance=1.5)
