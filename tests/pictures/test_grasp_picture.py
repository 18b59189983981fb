"""The still picture of a grasp: what stands for the names of many joints."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.pictures.grasp_picture import draw_grasp, joint_key


def many(n: int) -> Grasp:
    """Two contacts, one of them on a finger of n joints with long names."""
    contacts = [Contact([0.02 * s, 0, 0], [-s, 0, 0], 0.5, "tip") for s in (1, -1)]
    joints = [
        GraspJoint(f"a_finger_with_a_long_name_{k}", [0, 1, 0], [0.02, 0, 0.01 * (k + 1)], (0,)) for k in range(n)
    ]
    return Grasp(contacts, joints)


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in (*figure.texts, *(t for ax in figure.axes for t in ax.texts))]


@pytest.mark.parametrize(("n", "keyed"), [(8, False), (20, True)])
def test_many_joints_are_numbered_and_named_in_a_key(n: int, keyed: bool) -> None:
    grasp = many(n)
    key, said = joint_key(grasp), texts(draw_grasp(grasp, count=1))
    assert len(key) == (n if keyed else 0)
    assert ("j7" in said) is keyed
    for k, joint in enumerate(grasp.joints):
        assert said.count(f"j{k} {joint.name}" if keyed else joint.name) == 1


def test_lines_of_the_key_do_not_lie_on_each_other() -> None:
    figure = draw_grasp(many(20), count=1)
    places = np.array([text.get_position() for text in figure.texts])
    assert len(places) == 20
    inches = places * figure.get_size_inches()
    apart = np.abs(inches[:, None] - inches[None])
    assert ((apart[..., 0] > 2) | (apart[..., 1] > 0.12) | np.eye(20, dtype=bool)).all()
    assert (inches[:, 1] > 0.1).all()
