"""The canonical system: its size, its equations, planted solutions, and caps."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from handfast.model.bernstein import evaluate
from handfast.model.region import Bezier, Cap
from handfast.papers.canonical_equations import canonical
from handfast.papers.patch_form import PatchForm, cap_parameters
from handfast.readers.load_hand import load_hand
from handfast.synthesis.task import Task
from tests.support.canonical_systems import TIGHT, at, check_solution, jacobian, nullity, sah_system, tip
from tests.support.places import SHARED
from tests.support.planted import HOME, X, Y, Z, bump, chain, joint, plant, pose, turn

TABLE = {
    "upholding": ("index_distal thumb_distal", 219, 209, 17),
    "handling": ("middle_distal thumb_distal palm", 243, 235, 16),
    "incision": ("middle_distal index_distal thumb_distal palm", 331, 324, 18),
    "lid lifting": ("index_distal thumb_distal", 219, 209, 17),
    "service": ("thumb_distal index_middle middle_distal", 288, 278, 19),
    "transportation": ("palm index_distal middle_distal ring_distal", 312, 305, 17),
    "tuning": ("index_distal thumb_distal", 219, 209, 17),
    "playing": ("index_distal middle_distal thumb_distal", 307, 298, 19),
    "holding": ("palm thumb_distal index_distal middle_distal", 331, 324, 18),
}


# --- Table 2 --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TABLE)
def test_sizes_of_table_2(name):
    links, n_v, n_e, d = TABLE[name]
    planted = sah_system(links)
    system = canonical(planted.task)
    assert (system.n_v, system.n_e, system.d) == (n_v, n_e, d)
    check_solution(planted, system)


def test_numbers_of_the_equations():
    system = canonical(sah_system("middle_distal thumb_distal palm").task)
    links, revolute, universal, angles, contacts, coupled = 9, 5, 2, 9, 3, 2
    expected = dict.fromkeys(("(4)", "(5)", "(6)"), links) | {"(7)": 3 * links}
    expected |= dict.fromkeys(("(8)", "(9)"), 3 * revolute) | {"(10)": 3 * universal, "(11)": universal}
    expected |= {"(12)": angles, "(13)": 3 * angles, "(14)": 3 * angles, "coupling": coupled}
    expected |= dict.fromkeys((f"({n})" for n in (15, 16, 17, 18, 22, 23, 24, 25)), 3 * contacts)
    expected |= {"(20)": contacts, "(21)": contacts}
    assert Counter(e.number for e in system.equations) == expected


@pytest.mark.parametrize("links", ["index_distal thumb_distal", "thumb_distal index_middle middle_distal"])
def test_d_is_the_dimension_of_the_solution_set(links):
    """The rank of all equations at a generic solution; the palm, whose box is a point, counts as movable."""
    planted = sah_system(links, seed=3)
    system = canonical(planted.task, unit=0.1)
    assert nullity(system, at(planted, system)) == system.d


def test_description():
    planted = sah_system("index_distal thumb_distal")
    text = canonical(planted.task, unit=0.001).describe()
    for part in (
        "lengths in units of 0.001 m",
        "n_v = 219: 108 poses of 9 links, 63 9 joint angles",
        "n_e = 209: (4) x 9",
        "d = 219 - 209 + 7 = 17",
        "5 revolute, 2 universal",
        "universal: thumb_abduction + thumb_proximal, thumb_base to thumb_proximal",
        "coupling: index_distal = 1 index_middle",
        "contact 1: cap on thumb_distal, 2x3 patch on object",
    ):
        assert part in text


def test_equations_are_written_and_grouped():
    hand = chain(("finger", "palm", pose(0.5 * X), [joint("l", Z, -0.5, 0.5)]))
    system = canonical(plant(hand, [("finger", tip(), bump(np.random.default_rng(0)))], np.random.default_rng(0)).task)
    groups = system.groups
    assert list(groups) == [f"({n})" for n in (*range(4, 10), *range(12, 19), *range(20, 26))]
    assert sorted(e for group in groups.values() for e in group) == list(range(system.n_e))
    assert system.write(groups["(4)"][0]) == "(4) palm: 0 = +1 c[palm].x c[palm].x +1 c[palm].y c[palm].y " + (
        "+1 c[palm].z c[palm].z -1"
    )
    assert system.write(groups["(8)"][0]) == "(8) l: 0 = +1 r[palm].x +0.5 c[palm].x -1 r[finger].x"
    assert system.write(groups["(12)"][0]).endswith("+1 a[l].z b[l].z -1 cos[l]")
    assert system.write(groups["(18)"][2]) == "(18) contact 0: o[0].z = f(s[0], t[0]) of degree 2x2"
    assert system.write(groups["(17)"][0]) == "(17) contact 0: 0 = +1 h[0].x -0.013 mhat[0].x -0.02"


# --- planted solutions -----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("unit", [1.0, 0.001])
def test_planted_solutions_satisfy_everything(seed, unit):
    planted = sah_system("index_distal thumb_distal palm", seed=seed)
    system = canonical(planted.task, unit=unit)
    q = check_solution(planted, system)
    assert np.isfinite([system.lower, system.upper]).all()
    assert np.abs(q).max() > 0.1 / unit * 0.5


def test_every_variable_and_every_equation_matters():
    """A solution that is off in any one variable is none, and every equation notices something."""
    planted = sah_system("index_distal thumb_distal palm", seed=1)
    system = canonical(planted.task, unit=0.1)
    J = np.abs(jacobian(system, at(planted, system)))
    assert J.max(axis=0).min() > 1e-3
    assert J.max(axis=1).min() > 1e-3


@pytest.mark.parametrize(
    "spoil, number",
    [
        (lambda p: p.pose.__setitem__((0, 3), p.pose[0, 3] + 1e-3), "(15)"),
        (lambda p: p.pose.__setitem__(slice(0, 3), p.pose[:3] @ -np.diag([1, 1, -1, -1])), "(16)"),  # half a turn
    ],
)
def test_configurations_that_miss_are_no_solutions(spoil, number):
    planted = sah_system("index_distal thumb_distal", seed=2)
    spoil(planted)
    system = canonical(planted.task)
    residual = np.abs(system.residual(at(planted, system)))
    wrong = {e.number for e, r in zip(system.equations, residual, strict=True) if r > 1e-4}
    assert number in wrong
    assert wrong <= {"(15)", "(16)"}  # everything else is by construction of the point


@pytest.mark.parametrize("name", ["upholding", "handling", "service"])
def test_the_tasks_of_the_authors(name):
    folder = SHARED / "tasks"
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent")
    from handfast.synthesis.task_file import load_task

    system = canonical(load_task(folder / f"{name}.json"))
    assert (system.n_v, system.n_e, system.d) == TABLE[name][1:]
    assert np.isfinite([system.lower, system.upper]).all()


# --- caps ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("half_angle", [0.2, 1.0, np.pi / 2, 1.7, 2.9, np.pi])
@pytest.mark.parametrize("flip", [False, True])
def test_caps_are_covered_exactly(half_angle, flip):
    rng = np.random.default_rng(2)
    cap = Cap(rng.normal(size=3), 0.5, rng.normal(size=3), half_angle, flip)
    T = pose(rng.normal(size=3), turn(rng))
    form = PatchForm.of(cap, T, 0.1)
    angles = np.concatenate([[0.0, half_angle], rng.uniform(0, np.pi, 400)])
    for theta in angles:
        phi = rng.uniform(0, 2 * np.pi)
        d = cap.frame @ [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
        u, v = cap_parameters(cap, d)
        m = evaluate(form.normals, u, v)
        norm = np.linalg.norm(m)
        inside = 0 <= u <= 1 and 0 <= v <= 1 and form.norm[0] <= norm <= form.norm[1]
        if abs(theta - half_angle) > 1e-6:
            assert inside == (theta < half_angle)
        if theta <= half_angle:
            point_ = form.at(u, v, m / norm)
            np.testing.assert_allclose(m / norm, cap.sign * T[:3, :3] @ d, atol=1e-12)
            np.testing.assert_allclose(0.1 * point_, T[:3, :3] @ cap.point(d) + T[:3, 3], atol=1e-12)
            assert -TIGHT <= min(u, v) <= max(u, v) <= 1 + TIGHT
            assert form.norm[0] <= norm <= form.norm[1] * (1 + TIGHT)
            for value, box in ((point_, form.point_box), (m, form.normal_box), (m / norm, form.unit_box)):
                assert (box[0] - TIGHT <= value).all()
                assert (value <= box[1] + TIGHT).all()


@pytest.mark.parametrize("half_angle", [1.0, np.pi])
def test_caps_on_hand_and_object(half_angle):
    rng = np.random.default_rng(6)
    hollow = Cap(np.zeros(3), 0.05, Z, half_angle, flip=True)
    regions = [
        ("index_distal", tip(half_angle), bump(rng)),
        ("palm", bump(rng, flip=True), Cap(X, 0.03, Y, half_angle)),
        ("thumb_distal", Cap(Z, 0.01, X, half_angle), hollow),
    ]
    planted = plant(load_hand("schunk-sah"), regions, rng)
    system = canonical(planted.task)
    plain = canonical(sah_system("index_distal palm thumb_distal").task)
    assert (system.n_v, system.n_e, system.d) == (plain.n_v, plain.n_e, plain.d)
    q = check_solution(planted, system)
    if half_angle < np.pi:
        assert nullity(canonical(planted.task, unit=0.1), q * scale(planted.task, 0.1)) == system.d


def scale(task: Task, unit: float) -> np.ndarray:
    """From metres to units, variable by variable."""
    system = canonical(task)
    out = np.ones(system.n_v)
    out[system.layout.position.ravel()] = 1 / unit
    for sides in system.layout.sides:
        for side in sides:
            out[side.point] = 1 / unit
    return out


def test_the_normals_of_a_patch_are_its_own():
    rng = np.random.default_rng(1)
    patch = bump(rng, (3, 2), flip=True)
    form = PatchForm.of(patch, HOME, 1.0)
    assert isinstance(patch, Bezier)
    for u, v in rng.uniform(0, 1, (50, 2)):
        n, m = patch.normal(u, v), evaluate(form.normals, u, v)
        np.testing.assert_allclose(m / np.linalg.norm(m), n / np.linalg.norm(n), atol=1e-12)
        assert form.norm[0] <= np.linalg.norm(m) <= form.norm[1]
    assert form.norm[0] > 0.5
