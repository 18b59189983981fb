"""Hand and object in the engine: thresholds known by hand, and the same rest as the grasp's contacts alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.simulation_floor import across, pinch
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.model.shape import Shape
from handfast.readers.grasp_file import load_grasp
from handfast.simulation.bodies import Bodies
from handfast.simulation.result import Ending
from handfast.simulation.simulate import simulate, simulate_bodies
from tests.support.sprung_jaws import sprung_jaws


def cube(edge: float, at: tuple[float, float, float], *, mesh: bool = False) -> Shape:
    pose = np.eye(4)
    pose[:3, 3] = at
    if not mesh:
        return Shape("box", (edge,) * 3, pose)
    return Shape.hull(0.5 * edge * np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]), pose)


def pinched(mu: float, **options: bool) -> tuple[Grasp, Bodies]:
    """A cube of 0.1 m between two balls, one on a slide; their contacts are those of `pinch`."""
    grasp = pinch(mu)
    contacts = [replace(c, link=link) for c, link in zip(grasp.contacts, ("finger", "thumb"), strict=True)]
    grasp = Grasp(contacts, grasp.joints, grasp.mechanism, grasp.preload, "pinch")
    ball = [Shape("sphere", 0.02, np.block([[np.eye(3), np.c_[[x, 0, 0]]], [np.zeros(3), 1]])) for x in (0.07, -0.07)]
    shapes = ((), (ball[0],), (ball[1],))
    return grasp, Bodies(
        ("base", "finger", "thumb"), (-1, 0, 0), ((), ("slide",), ()), shapes, (cube(0.1, (0, 0, 0), **options),)
    )


@pytest.mark.parametrize("mesh", [False, True])
def test_a_pinched_cube_carries_twice_mu_times_the_command(mesh: bool) -> None:
    grasp, bodies = pinched(0.4, mesh=mesh)
    held = simulate_bodies(grasp, across(0.4, 0.95), ramp=1.0, bodies=bodies)
    assert held.ending is Ending.HOLDS
    assert held.bodies
    assert held.points[-1] == 2
    assert held.forces[-1, :, 0] == pytest.approx([1, 1], abs=1e-3)
    carried = sum(c.frame @ f for c, f in zip(grasp.contacts, held.forces[-1], strict=True))
    assert carried == pytest.approx(-across(0.4, 0.95)[:3], abs=1e-3)
    assert simulate_bodies(grasp, across(0.4, 1.06), ramp=1.0, bodies=bodies).ending is Ending.SLIPS


def test_hand_and_object_rest_as_their_contacts_do() -> None:
    """The Barrett hand on the ball: the same forces, though the engine finds where they touch."""
    grasp = load_grasp("barrett-ball")
    wrench = [0, 0, 4.5]
    alone, whole = (ask(grasp, wrench, ramp=1.0) for ask in (simulate, simulate_bodies))
    assert (alone.ending, whole.ending) == (Ending.HOLDS, Ending.HOLDS)
    assert whole.forces[-1] == pytest.approx(alone.forces[-1], abs=0.02 * alone.forces.max())


def test_an_object_that_left_its_contacts_may_touch_the_hand_elsewhere() -> None:
    """Pulled out from between its fingers, the cube comes to rest on a plate that bears no contact of the grasp."""
    grasp, b = pinched(0.4)
    plate = replace(b, shapes=((cube(0.2, (0, 0, -0.1502)),), *b.shapes[1:]))
    assert simulate_bodies(grasp, across(0.4, 1.5), ramp=1.0, bodies=b).ending is Ending.SLIPS
    found = simulate_bodies(grasp, across(0.4, 1.5), ramp=1.0, bodies=plate)
    assert found.ending is Ending.SETTLES
    assert found.shift[-1, 2] == pytest.approx(-2e-4, rel=0.01)
    assert found.points[-1] > 2


def test_the_commands_of_bodies_grow_unless_they_are_to_act_at_once() -> None:
    """Pressed with 1 N at once the fingers overshoot; a fingers' squeeze that grows follows the command."""
    grasp, bodies = pinched(0.4)
    grown, jolted = (
        simulate_bodies(grasp, across(0.4, 0.5), ramp=0.1, bodies=bodies, closing=c).forces[:, :, 0]
        for c in (None, 0.0)
    )
    assert grown.max() < 1.001
    assert np.diff(grown[:40], axis=0).min() > 0
    assert jolted[5].min() > 10 * grown[5].max()


def test_on_flat_faces_a_contact_belongs_to_the_solids_on_whose_surfaces_it_lies() -> None:
    """The nearest points of plate and cube are anywhere on their faces; those of what is behind, at the contact."""
    grasp, b = pinched(0.4)
    plate, behind = cube(0.2, (0.15, 0, 0)), Shape("sphere", 0.01, cube(1.0, (0.067, 0, 0)).pose)
    for shapes in ((plate, behind), (behind, plate)):
        finger = replace(b, shapes=((), shapes, b.shapes[2]))
        found = simulate_bodies(grasp, across(0.4, 0.95), ramp=1.0, bodies=finger)
        assert found.ending is Ending.HOLDS


def test_what_is_not_there_is_refused() -> None:
    grasp, bodies = pinched(0.4)
    with pytest.raises(InputError, match="hand and object are not known"):
        simulate_bodies(grasp, [0, 0, -0.1])
    away = replace(bodies, pieces=(cube(0.08, (0, 0, 0)),))
    with pytest.raises(InputError, match=r"contacts\[0\]: is off by 10 mm: finger does not touch"):
        simulate_bodies(grasp, [0, 0, -0.1], bodies=away)
    stiff = replace(bodies, joints=((), (), ()))
    with pytest.raises(InputError, match="joints: are not the hand's: slide"):
        simulate_bodies(grasp, [0, 0, -0.1], bodies=stiff)


@pytest.mark.slow
def test_what_a_jolt_squeezed_is_not_kept_by_dry_friction(tmp_path: Path) -> None:
    """2 N and 0.5 N of the spring less 0.3 N of friction on the left, the right jaw locked: 2.2 N, as the model has."""
    grasp = sprung_jaws(tmp_path, lock=["right"])
    for ask in (simulate, simulate_bodies):
        found = ask(grasp, [0, 0, -1], ramp=0.5)
        assert found.forces[found.load == 0][-1, :, 0].sum() == pytest.approx(2 * 2.2, rel=0.01)
        assert ask(grasp, [0, 0, -4], ramp=4.0).ending is Ending.SLIPS


def test_a_tendon_that_rubs_is_part_of_hand_and_object(tmp_path: Path) -> None:
    tendon = '<tendon><fixed name="t" frictionloss=".2"><joint joint="left" coef="1"/></fixed></tendon>'
    grasp = sprung_jaws(tmp_path, tendon, lock=["right"])
    assert grasp.joints[-1].name == "tendon t"
    found = simulate_bodies(grasp, [0, 0, -1], ramp=0.5)
    assert found.ending is Ending.HOLDS
    assert found.forces[found.load == 0][-1, :, 0].sum() == pytest.approx(2 * 2.0, rel=0.01)


def test_a_link_has_the_least_friction_of_its_contacts(tmp_path: Path) -> None:
    grasp = sprung_jaws(tmp_path, laws="none")
    rough = [replace(c, friction=0.9 if i % 4 == 3 else 0.1) for i, c in enumerate(grasp.contacts)]
    mixed = Grasp(rough, grasp.joints, grasp.mechanism, grasp.preload).about(provenance=grasp.provenance)
    assert simulate_bodies(mixed, [0, 0, -1.2], ramp=0.5).ending is Ending.SLIPS
