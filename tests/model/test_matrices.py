"""Grasps from a grasp map and a Jacobian: the same matrices in other tangents, the same answers, and refusals."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from handfast import Body, Grasp, InputError, Mechanism, Verdict, check, load_grasp, maximum
from handfast.core.arrays import Array
from handfast.readers.grasp_file import from_dict, to_dict
from tests.support.problems import pinch

UP = [0.0, 1.0, 0, 0, 0, 0]


def turned(grasp: Grasp, seed: int = 0, order: tuple[int, int, int] = (0, 1, 2)) -> tuple[Array, Array, Array]:
    """G and J of a grasp with its tangents turned and some mirrored, the normal elsewhere; and T: G = grasp.G @ T."""
    rng = np.random.default_rng(seed)
    T = np.zeros((3 * grasp.m, 3 * grasp.m))
    for i in range(grasp.m):
        a = rng.uniform(0, 2 * np.pi)
        turn = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        turn[:, 2] *= (-1) ** i
        T[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = turn[:, order]
    return grasp.G @ T, T.T @ grasp.J, T


@pytest.mark.parametrize("name", ["fig1", "fig9", "fig11-coupled", "barrett-mug"])
@pytest.mark.parametrize("order, normal", [((0, 1, 2), 0), ((1, 2, 0), 2)])
def test_real_grasps_come_back_joint_by_joint(name: str, order: tuple[int, int, int], normal: int) -> None:
    old = load_grasp(name)
    G, J, T = turned(old, order=order)
    new = Grasp.from_matrices(
        G,
        J,
        old.mu,
        normal=normal,
        joints=[j.name for j in old.joints],
        mechanism=old.mechanism,
        preload=old.command,
    )
    back = np.vstack([new.contacts[i].frame.T @ old.contacts[i].frame for i in range(old.m)])
    assert np.allclose(back[::3, 0], 1)
    assert np.allclose(new.positions, old.positions, atol=1e-12)
    assert np.allclose(new.G, old.G, atol=1e-12)
    assert np.allclose(new.J, old.J, atol=1e-9)
    assert [j.name for j in new.joints] == [j.name for j in old.joints]
    assert np.array_equal(new.mechanism.R, old.mechanism.R)
    assert new.preload == old.preload
    assert T.shape == (3 * old.m, 3 * old.m)


def test_the_answers_are_those_of_the_grasp() -> None:
    old = pinch()
    G, J, _ = turned(old)
    new = Grasp.from_matrices(G, J, old.mu, preload=old.command)
    assert maximum(new, UP).lower == pytest.approx(maximum(old, UP).lower, rel=2e-3)
    again = from_dict(to_dict(new))
    assert np.array_equal(again.J, new.J)


def test_a_column_that_no_joint_has_becomes_joints_that_are_coupled() -> None:
    """Two fingers closed by one motor, reduced to one column of J."""
    two = pinch()
    together = two.J @ np.ones((2, 1))
    one = Grasp.from_matrices(two.G, together, 0.5, joints=["close"], preload={"close": 0.2})
    assert [j.name for j in one.joints] == ["close", "close at contact 1"]
    assert one.mechanism.A.shape == (1, 2)
    q = np.linalg.svd(one.mechanism.A)[2][1]  # what the coupling lets move
    assert np.allclose(one.J @ q / (one.mechanism.R @ q), together[:, 0])
    coupled = Grasp(
        two.contacts,
        two.joints,
        Mechanism(("close",), np.array([[1.0, 0]]), np.array([[1.0, -1]]), (False,)),
        {"close": 0.2},
    )
    assert maximum(one, UP).lower == pytest.approx(maximum(coupled, UP).lower, rel=2e-3)
    assert check(one, [0, 0.4, 0]).verdict is Verdict.HOLDS


def test_units_of_a_prismatic_column_stay_those_of_its_motor() -> None:
    """A jaw of which one unit of motor is 2 m: its motor's force is half of that at the jaw."""
    two = pinch()
    J = np.zeros((6, 1))
    J[3, 0] = 2.0  # the second contact, along its normal
    jaw = Grasp.from_matrices(two.G, J, 0.5, joints=["jaw"], types=["prismatic"], preload={"jaw": 4.0})
    plain = Grasp.from_matrices(two.G, J / 2, 0.5, joints=["jaw"], types=["prismatic"], preload={"jaw": 2.0})
    assert jaw.joints[0].type == "prismatic"
    assert maximum(jaw, UP).lower == pytest.approx(maximum(plain, UP).lower, rel=2e-3) == pytest.approx(2.0, rel=2e-3)


def test_a_column_of_zeros_and_no_columns() -> None:
    two = pinch()
    idle = Grasp.from_matrices(two.G, np.zeros((6, 1)), 0.5)
    assert idle.joints[0].moves == ()
    assert Grasp.from_matrices(two.G, np.zeros((6, 0)), [0.5, 0.4]).l == 0


@pytest.mark.parametrize(
    "change, says",
    [
        (lambda a: a | {"G": a["G"][:, :5]}, r"G: has shape \(6, 5\); \(6, 3 m\) is needed"),
        (lambda a: a | {"G": a["G"].T}, r"G\[:, 0:3\]: is no force at a point"),
        (lambda a: a | {"J": a["J"][:4]}, r"J: has shape \(4, 2\); \(6, l\) is needed, three rows for each of the 2"),
        (lambda a: a | {"J": a["J"][:, 0]}, r"J: has shape \(6,\)"),
        (lambda a: a | {"G": 2 * a["G"]}, r"G\[:, 0:3\]: has no orthonormal frame"),
        (lambda a: a | {"G": np.vstack([a["G"][3:], a["G"][:3]])}, r"G\[:, 0:3\]: has no orthonormal frame"),
        (
            lambda a: a | {"G": a["G"] + np.outer([0, 0, 0, 0, 0, 1], [0] * 5 + [1])},
            r"G\[:, 3:6\]: is no force at a point",
        ),
        (lambda a: a | {"J": np.full((6, 2), np.nan)}, "J: contains NaN"),
        (lambda a: a | {"friction": [0.5] * 3}, r"friction: has shape \(3,\), needs \(2,\)"),
        (lambda a: a | {"friction": -0.5}, "friction: is -0.5"),
        (lambda a: a | {"joints": ["a"]}, "joints: has 1 entries; J has 2 columns"),
        (lambda a: a | {"types": ["revolute", "ball"]}, r"types\[1\]: is 'ball'"),
        (lambda a: a | {"normal": 3}, "normal: is 3; 0, 1 or 2"),
        (lambda a: a | {"mechanism": Mechanism.direct(["a"])}, "mechanism: has 1 joint columns; J has 2"),
        (lambda a: a | {"joints": ["a", "a"]}, "'a' is"),
        (lambda a: a | {"G": [[1.0, 2.0], [3.0]]}, "G: has rows of different lengths"),
        (lambda a: a | {"J": [[1.0, 2.0], [3.0]]}, "J: has rows of different lengths"),
        (lambda a: a | {"J": a["J"] + 0.1j}, "J: must be numbers"),
        (lambda a: a | {"normal": True}, "normal: is True; 0, 1 or 2"),
        (lambda a: a | {"normal": 1.0}, r"normal: is 1\.0; 0, 1 or 2"),
        (lambda a: a | {"joints": [1, 2]}, r"joints\[0\]: is 1; a name is needed"),
    ],
)
def test_what_does_not_belong_together_is_refused(change, says: str) -> None:  # type: ignore[no-untyped-def]
    two = pinch()
    asked = change({"G": np.array(two.G), "J": np.array(two.J), "friction": 0.5})
    with pytest.raises(InputError, match=says):
        Grasp.from_matrices(**asked)


# --- bodies from meshes ---------------------------------------------------------------------------------


def test_a_body_from_a_trimesh() -> None:
    import trimesh

    box = trimesh.creation.box((40, 60, 100))
    body = Body.from_mesh(box, name="box", mass=0.2, friction=0.7, scale=0.001)
    assert (body.mass, body.friction, len(body.pieces), body.source) == (0.2, 0.7, 1, "")
    assert np.ptp(body.vertices, axis=0) == pytest.approx([0.04, 0.06, 0.1])
    assert body.pieces[0].volume == pytest.approx(0.04 * 0.06 * 0.1)
    two = trimesh.util.concatenate([box, box.copy().apply_translation([100, 0, 0])])
    assert len(Body.from_mesh(two, scale=0.001).pieces) == 2
    assert Body.from_mesh(two, scale=0.001).center_of_mass == pytest.approx([0.05, 0, 0])


def test_what_is_no_mesh_is_refused() -> None:
    import trimesh

    box = trimesh.creation.box((1, 1, 1))
    with pytest.raises(InputError, match="thing: is a Scene without vertices and faces"):
        Body.from_mesh(trimesh.Scene(), name="thing")
    with pytest.raises(InputError, match="scale: is 0"):
        Body.from_mesh(box, scale=0)
    with pytest.raises(InputError, match="object: mass: is -1"):
        Body.from_mesh(box, mass=-1)
    ragged = SimpleNamespace(vertices=[[0, 0, 0], [1]], faces=[[0, 1, 1]])
    with pytest.raises(InputError, match="object: has vertices or faces that are no numbers, or of different lengths"):
        Body.from_mesh(ragged)  # type: ignore[arg-type]
    halves = SimpleNamespace(vertices=box.vertices, faces=box.faces + 0.5)
    with pytest.raises(InputError, match="object: has faces that are no whole numbers"):
        Body.from_mesh(halves)  # type: ignore[arg-type]
    box.vertices[0] = np.nan
    with pytest.raises(InputError, match="NaN"):
        Body.from_mesh(box)
