"""What is set on the page: each change of the load, and which states share a map."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handfast.pictures.live.view_state import ViewState, following
from tests.support.viewed import jaws, two_fingers


def test_the_first_load_is_the_weight_if_it_is_known() -> None:
    state = ViewState.of(jaws(mass=0.2, center_of_mass=[0.01, 0, 0]))
    assert state.wrench == pytest.approx([0, 0, -1.962, 0, 0.01 * 1.962, 0])
    assert state.frame[:, 0] == pytest.approx([0, 0, -1])
    assert np.linalg.det(state.frame) == pytest.approx(1)


def test_the_first_load_of_a_grasp_of_contacts_lies_in_its_plane() -> None:
    state = ViewState.of(two_fingers())
    assert state.force[:2] != pytest.approx([0, 0])
    assert state.force[2] == 0
    assert abs(state.frame[2, 2]) == pytest.approx(1)  # the map is of the plane in which the fingers lie


def test_the_load_turns_with_its_handle() -> None:
    state = ViewState.of(jaws(mass=0.2, center_of_mass=[0, 0, 0])).with_torque(0.1)
    by = Rotation.from_rotvec([0, np.pi / 2, 0]).as_matrix()
    turned = state.turned(by @ state.frame)
    assert turned.force == pytest.approx([-1.962, 0, 0])
    assert turned.torque == pytest.approx([-0.1, 0, 0])


def test_a_force_acts_where_it_was_grabbed() -> None:
    state = ViewState.of(jaws()).with_torque(0.3).pulled([0, 3.0, 4.0], at=[0.1, 0, 0])
    assert state.wrench == pytest.approx([0, 3, 4, 0, -0.4, 0.3])
    assert state.frame[:, 0] == pytest.approx([0, 0.6, 0.8])
    assert state.direction == pytest.approx(state.wrench / 5)


def test_a_torque_replaces_the_force() -> None:
    state = ViewState.of(jaws()).twisted([0, 0, 0.2])
    assert state.is_torque
    assert state.wrench == pytest.approx([0, 0, 0, 0, 0, 0.2])
    assert state.direction == pytest.approx([0, 0, 0, 0, 0, 1])


def test_sizes_keep_the_direction_also_through_zero() -> None:
    state = ViewState.of(jaws()).pulled([0, 0, 2.0])
    gone = state.with_force(0.0)
    assert gone.size == 0
    assert gone.direction == pytest.approx([0, 0, 1, 0, 0, 0])
    assert gone.with_force(3.0).force == pytest.approx([0, 0, 3])


def test_what_is_asked_about_has_the_sliders_friction_and_commands() -> None:
    state = ViewState.of(jaws(mu=0.5)).with_friction(0.8).commanded(1, 7.0)
    assert state.asked.mu == pytest.approx([0.8, 0.8])
    assert state.asked.command == pytest.approx([10, 7])
    assert state.preloaded(0.5).asked.command == pytest.approx([5, 5])
    assert state.grasp.mu == pytest.approx([0.5, 0.5])


def test_a_map_is_shared_by_all_loads_in_its_plane_and_by_no_other() -> None:
    state = ViewState.of(jaws())
    within = Rotation.from_rotvec(0.4 * state.frame[:, 2]).as_matrix()
    out = Rotation.from_rotvec(0.4 * state.frame[:, 1]).as_matrix()
    assert state.turned(within @ state.frame).map_key == state.map_key
    assert state.with_force(0.3).map_key == state.map_key
    for other in (
        state.turned(out @ state.frame),
        state.moved(np.array([0, 0, 0.01])),
        state.with_friction(0.6),
        state.with_normals(0.01),
        state.preloaded(2.0),
        state.twisted(np.array([0, 0, 0.1])),
        state.with_plane("yz"),
    ):
        assert other.map_key != state.map_key
    assert state.with_plane("none").map_key is None
    assert state.with_plane("yz").map_axes == pytest.approx(np.eye(3)[1:])


def test_leafing_keeps_what_is_assumed_and_takes_the_new_load() -> None:
    state = ViewState.of(jaws()).with_normals(0.05).with_plane("xz").pulled([9.0, 0, 0])
    other = state.leafed(two_fingers(), 3)
    assert (other.number, other.eta, other.plane) == (3, 0.05, "xz")
    assert other.force == pytest.approx(ViewState.of(two_fingers()).force)


@pytest.mark.parametrize("along", [[1.0, 2.0, 3.0], [0, 0, -2.0], [0, 0, 0]])
def test_a_frame_that_follows_is_right_handed(along: list[float]) -> None:
    frame = following(np.eye(3), np.array(along))
    assert frame.T @ frame == pytest.approx(np.eye(3))
    assert np.linalg.det(frame) == pytest.approx(1)
    if any(along):
        assert np.cross(frame[:, 0], along) == pytest.approx([0, 0, 0])
