"""The canonical system: Table 2, planted solutions, couplings on the angle, caps, every joint type."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.model.hand import Coupling, load_hand
from handfast.model.region import Bezier, Cap, evaluate
from handfast.synthesis.paper.canonical import Canonical
from handfast.synthesis.paper.canonical_build import canonical, point
from handfast.synthesis.paper.loops import Kind
from handfast.synthesis.paper.patch_form import PatchForm, cap_parameters
from handfast.synthesis.task import ContactPair, PoseBounds, Task
from tests.support.places import SHARED
from tests.support.planted import HOME, X, Y, Z, bump, chain, joint, plant, pose, turn

TIGHT = 1e-12  # rounding, in units of length and of direction

# synthesis paper, Table 2: contacts, n_v, n_e, d; handling prints d = 19, its own formula gives 16
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


def tip(half_angle: float = np.pi / 3) -> Cap:
    return Cap(np.array([0.02, 0, 0]), 0.013, np.array([0.14, 0, 0.99]), half_angle)


def sah(links: str, seed: int = 0, regions=None):
    """A planted task of the SA hand: fingertip caps, a patch on the palm, patches on the object."""
    rng = np.random.default_rng(seed)
    pairs = []
    for link in links.split():
        on_hand = bump(rng, (1, 2)) if link == "palm" else tip()
        pairs.append((link, on_hand, bump(rng, (2, 3))))
    return plant(load_hand("schunk-sah"), regions or pairs, rng)


def at(planted, system: Canonical) -> np.ndarray:
    return point(system, planted.q, planted.pose, planted.parameters)


def jacobian(system: Canonical, q: np.ndarray) -> np.ndarray:
    step = 1e-6
    columns = [(system.residual(q + step * e) - system.residual(q - step * e)) / (2 * step) for e in np.eye(len(q))]
    return np.array(columns).T


def nullity(system: Canonical, q: np.ndarray) -> int:
    singular = np.linalg.svd(jacobian(system, q), compute_uv=False)
    singular = np.concatenate([singular, np.zeros(max(0, len(q) - len(singular)))])
    small, large = singular[singular < 1e-7], singular[singular > 1e-5]
    assert len(small) + len(large) == len(singular), singular[len(large) - 2 :]  # a clear gap between the two
    return len(small)


def check_solution(planted, system: Canonical) -> np.ndarray:
    q = at(planted, system)
    assert np.abs(system.residual(q)).max() < TIGHT
    assert system.outside(q).max() < TIGHT
    x = system.expanded
    lifted = x.lift(q)
    assert np.abs(x.linear(lifted)).max() < TIGHT
    assert np.abs(x.forms(lifted)).max() < TIGHT
    assert np.maximum(x.lower - lifted, lifted - x.upper).max() < TIGHT
    return q


# --- Table 2 --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TABLE)
def test_sizes_of_table_2(name):
    links, n_v, n_e, d = TABLE[name]
    planted = sah(links)
    system = canonical(planted.task)
    assert (system.n_v, system.n_e, system.d) == (n_v, n_e, d)
    check_solution(planted, system)


def test_numbers_of_the_equations():
    system = canonical(sah("middle_distal thumb_distal palm").task)
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
    planted = sah(links, seed=3)
    system = canonical(planted.task, unit=0.1)
    assert nullity(system, at(planted, system)) == system.d


def test_description():
    planted = sah("index_distal thumb_distal")
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
    planted = sah("index_distal thumb_distal palm", seed=seed)
    system = canonical(planted.task, unit=unit)
    q = check_solution(planted, system)
    assert np.isfinite([system.lower, system.upper]).all()
    assert np.abs(q).max() > 0.1 / unit * 0.5


def test_every_variable_and_every_equation_matters():
    """A solution that is off in any one variable is none, and every equation notices something."""
    planted = sah("index_distal thumb_distal palm", seed=1)
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
    planted = sah("index_distal thumb_distal", seed=2)
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


# --- limits and couplings --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["index_abduction", "index_proximal", "thumb_base", "thumb_proximal"])
def test_joint_limits_are_the_boxes_of_the_cosines(name):
    planted = sah("index_distal thumb_distal", seed=5)
    system = canonical(planted.task)
    j = planted.task.hand.joint(name)
    c = system.names.index(f"cos[{name}]")
    lower, upper = planted.task.hand.limits[j]
    for value, inside in ((lower, True), (upper, True), (lower - 0.01, False), (upper + 0.01, False)):
        q = planted.q.copy()
        q[j] = value
        x = point(system, q, planted.pose, planted.parameters)
        assert x[c] == pytest.approx(np.cos(value - (lower + upper) / 2), abs=1e-12)
        assert (system.outside(x)[c] < TIGHT) == inside
    others = [k for k in range(system.n_v) if system.names[k].startswith("cos[") and k != c]
    assert system.outside(x)[others].max() == 0


def test_a_range_of_nearly_a_turn_and_one_of_more():
    rng = np.random.default_rng(0)
    hand = chain(("a", "palm", HOME, [joint("a", Z, -3.0, 3.0)]), ("b", "a", pose(0.1 * X), [joint("b", Z, -4.0, 4.0)]))
    planted = plant(hand, [("b", tip(), bump(rng))], rng)
    system = canonical(planted.task)
    check_solution(planted, system)
    assert [name for name in system.names if name.startswith("cos")] == ["cos[a]"]
    x = point(system, np.array([3.1, 0.0]), planted.pose, planted.parameters)
    assert system.outside(x)[system.names.index("cos[a]")] > 1e-3


def test_the_mirror_image_of_a_coupled_angle_is_excluded():
    """phi_distal = 90 degrees - phi_middle: cosines about the middle agree, those from the lower end do not."""
    hand = load_hand("schunk-sah")
    rng = np.random.default_rng(4)
    limits = {f"index_{part}": (0.0, np.pi / 2) for part in ("proximal", "middle", "distal")}
    hand = Task.of(hand, (ContactPair("index_distal", tip(), bump(rng)),), limits=limits).hand
    q = hand.configuration({"index_middle": 0.3})
    middle, distal = hand.joint("index_middle"), hand.joint("index_distal")

    def residuals(value: float) -> tuple[float, float]:
        q[distal] = value
        planted = plant(hand, [("index_distal", tip(), bump(rng))], rng, q=q)
        system = canonical(planted.task)
        x = at(planted, system)
        rest = np.abs(system.residual(x))
        coupling = [e.number == "coupling" for e in system.equations]
        assert sum(coupling) == 1
        slip = x[system.names.index("cos[index_middle]")] - x[system.names.index("cos[index_distal]")]
        assert rest[~np.array(coupling)].max() < TIGHT
        return float(rest[coupling][0]), float(slip)

    equal, mirrored = residuals(q[middle]), residuals(np.pi / 2 - q[middle])
    assert equal[0] < TIGHT
    assert abs(equal[1]) < TIGHT
    assert abs(mirrored[1]) < TIGHT  # what the authors' runs let pass
    assert mirrored[0] > 0.5


def coupled(
    *couplings: Coupling, types=("revolute",) * 3, ranges=((0.2, 1.4),) * 3, refs=(0.0,) * 3, cross: bool = False
):
    axes = [Z, X if cross else Z, Y]
    each = zip("abc", axes, ranges, types, refs, strict=True)
    joints = [joint(n, a, *r, type=t, ref=ref) for n, a, r, t, ref in each]
    parts = [(f"link {j.name}", p, pose(0.05 * X + 0.01 * Y), [j]) for j, p in
             zip(joints, ("palm", "link a", "link b"), strict=True)]  # fmt: skip
    if cross:
        parts[1] = ("link b", "link a", HOME, [joints[1]])
    return chain(*parts, couplings=couplings)


@pytest.mark.parametrize(
    "hand",
    [
        coupled(Coupling(1, 0, 1.0)),
        coupled(Coupling(1, 0, -1.0, 1.6)),
        coupled(Coupling(1, 0, 1.0, 0.5), ranges=((0.2, 1.4), (0.7, 2.4), (0, 1))),
        coupled(Coupling(0, 2, -1.0, 1.6), Coupling(1, 2, 1.0)),
        coupled(Coupling(1, 0, 1.0, -0.1), cross=True),  # both angles of a universal joint
        coupled(Coupling(2, 1, -1.0, 1.6), cross=True),
        coupled(Coupling(1, 0, 1.0), ranges=((0, np.pi), (0, 4.0), (0, 1))),
        coupled(Coupling(2, 0, 0.5, 0.01), types=("prismatic", "revolute", "prismatic")),
        coupled(Coupling(2, 0, 0.5, 0.01), types=("prismatic", "revolute", "prismatic"), refs=(0.3, 0, 0)),
        coupled(Coupling(2, 0, 0.5, 0.01), types=("prismatic", "revolute", "prismatic"), refs=(0, 0, -0.2)),
        coupled(Coupling(0, 2, -2.0, 2.6), types=("prismatic", "revolute", "prismatic"), refs=(0.3, 0, -0.2)),
        coupled(Coupling(1, 0, 1.0, 0.1), refs=(0.3, -0.2, 0)),
    ],
)
def test_couplings_hold_on_the_angle_and_only_there(hand):
    rng = np.random.default_rng(7)
    for _ in range(5):
        low, high = canonical_range(hand)
        leader = hand.couplings[0].driver
        q = np.array([rng.uniform(j.lower, j.upper) for j in hand.joints])
        q[leader] = rng.uniform(low, high)
        for c in hand.couplings:
            q[c.joint] = c.ratio * q[c.driver] + c.offset
        planted = plant(hand, [("link c", tip(), bump(rng))], rng, q=q)
        system = canonical(planted.task)
        x = check_solution(planted, system)
        rows = [k for k, e in enumerate(system.equations) if e.number == "coupling"]
        assert len(rows) == len(hand.couplings)
        j = hand.couplings[0].joint
        for wrong in np.linspace(*system.loops.ranges[j], 12):  # every other value in the range is refused
            if abs(wrong - q[j]) > 1e-2:
                other = q.copy()
                other[j] = wrong
                x = point(system, other, planted.pose, planted.parameters)
                assert np.abs(system.residual(x)[rows]).max() > 1e-5


def canonical_range(hand):
    """The range of the first leader that its followers leave."""
    c = hand.couplings[0]
    ends = [np.array(hand.limits[c.driver])]
    ends += [np.sort((hand.limits[k.joint] - k.offset) / k.ratio) for k in hand.couplings if k.driver == c.driver]
    return max(e[0] for e in ends), min(e[1] for e in ends)


@pytest.mark.parametrize(
    "hand, message",
    [
        (coupled(Coupling(1, 0, 0.5)), r"couplings.b: has ratio 0.5 to a; cosines can say 1 and -1 only"),
        (
            coupled(Coupling(1, 0, 1.0), ranges=((0, 4.0), (0, 4.0), (0, 1))),
            r"couplings.b: ties a over 229.2 degrees; the cosine tells angles apart up to 180",
        ),
        (
            coupled(Coupling(1, 0, 0.1), types=("revolute", "prismatic", "revolute"), ranges=((0, 1),) * 3),
            r"couplings.b: ties an angle to a length \(a\)",
        ),
        (
            coupled(Coupling(1, 0, 1.0), ranges=((0, 1), (2, 3), (0, 1))),
            r"limits.b: leave nothing for a, to which it is coupled",
        ),
        (
            coupled(Coupling(1, -1, 0.0, 5.0)),
            r"limits.b: excludes 5, at which a coupling holds it",
        ),
    ],
)
def test_couplings_that_cannot_be_said_are_refused(hand, message):
    with pytest.raises(InputError, match=message):
        canonical(Task.of(hand, (ContactPair("link c", tip(), bump(np.random.default_rng(0))),)))


def test_the_unit_is_checked():
    with pytest.raises(InputError, match="unit: is -1; a positive length"):
        canonical(sah("index_distal").task, unit=-1.0)


# --- joint types -----------------------------------------------------------------------------------------


def tilted(*parts) -> list[tuple]:
    """A chain of links, each at a random pose on the one before, its joint at random on it."""
    rng = np.random.default_rng(11)
    out, before = [], "palm"
    for name, joints in parts:
        out.append((name, before, pose(rng.normal(0, 0.05, 3), turn(rng)), joints))
        before = name
    return out


FREE = {"lower": -4.0, "upper": 4.0}
SLIDE = {"type": "prismatic", "lower": -0.02, "upper": 0.05}
DIAGONAL = (X + Y) / np.sqrt(2)
MECHANISMS = {
    "revolute away from the origin": (
        tilted(("tip", [joint("a", DIAGONAL, 0.1, 1.0, anchor=0.03 * Z, ref=0.4)])),
        {Kind.REVOLUTE: 1},
    ),
    "prismatic": (tilted(("tip", [joint("a", DIAGONAL, **SLIDE, ref=0.01)])), {Kind.PRISMATIC: 1}),
    "two prismatic": (
        tilted(("mid", [joint("a", X, **SLIDE)]), ("tip", [joint("b", Y, **SLIDE)])),
        {Kind.PRISMATIC: 2},
    ),
    "revolute, then prismatic along it": (
        tilted(("tip", [joint("a", Z, anchor=0.02 * X), joint("b", -Z, **SLIDE)])),
        {Kind.CYLINDRICAL: 1},
    ),
    "prismatic, then revolute about it": (
        tilted(("tip", [joint("b", Z, **SLIDE, ref=0.01), joint("a", Z, anchor=0.02 * X, ref=0.3)])),
        {Kind.CYLINDRICAL: 1},
    ),
    "revolute and prismatic askew": (
        tilted(("tip", [joint("a", Z), joint("b", X, **SLIDE)])),
        {Kind.REVOLUTE: 1, Kind.PRISMATIC: 1},
    ),
    "universal": (
        tilted(("tip", [joint("a", DIAGONAL, anchor=0.02 * X, ref=0.2), joint("b", Z, anchor=0.02 * X)])),
        {Kind.UNIVERSAL: 1},
    ),
    "revolutes that miss": (
        tilted(("tip", [joint("a", X), joint("b", Z, anchor=0.02 * Y)])),
        {Kind.REVOLUTE: 2},
    ),
    "revolutes askew": (tilted(("tip", [joint("a", X), joint("b", DIAGONAL)])), {Kind.REVOLUTE: 2}),
    "spherical": (
        tilted(("tip", [joint(n, a, **FREE, anchor=0.02 * X) for n, a in zip("abc", (Z, X, Y), strict=True)])),
        {Kind.SPHERICAL: 1},
    ),
    "a ball with limits": (
        tilted(("tip", [joint(n, a, anchor=0.02 * X) for n, a in zip("abc", (Z, X, Z), strict=True)])),
        {Kind.UNIVERSAL: 1, Kind.REVOLUTE: 1},
    ),
    "a fixed link and a locked joint between": (
        tilted(
            ("first", [joint("a", Z)]), ("fixed", []), ("locked", [joint("b", X, 0.3, 0.3)]), ("tip", [joint("c", Y)])
        ),
        {Kind.REVOLUTE: 2},
    ),
    "a universal joint across a fixed link": (
        [
            ("first", "palm", pose(0.1 * Z), [joint("a", Z)]),
            ("fixed", "first", pose(0.03 * Z), []),
            ("tip", "fixed", pose(0.01 * Z), [joint("b", X)]),
        ],
        {Kind.UNIVERSAL: 1},
    ),
}


@pytest.mark.parametrize("name", MECHANISMS)
def test_joint_types(name):
    parts, kinds = MECHANISMS[name]
    hand = chain(*parts)
    rng = np.random.default_rng(3)
    pairs = [("tip", bump(rng), bump(rng, (1, 1))), ("palm", bump(rng, (1, 1)), bump(rng))]
    planted = plant(hand, pairs, rng)
    system = canonical(planted.task, unit=0.1)
    assert {kind: n for kind in Kind if (n := system.loops.count(kind))} == kinds
    q = check_solution(planted, system)
    assert nullity(system, q) == system.d
    # as many freedoms as the mechanism has: joints, object 6, palm 6, four parameters less five equations a contact
    joints = sum(j.upper > j.lower for j in hand.joints)
    assert system.d == joints + 12 - 2
    poses = hand.link_poses(planted.q)
    bodies = system.loops.body_poses(planted.q)
    for (body, inside), pair in zip(system.loops.carriers, planted.task.contact_pairs, strict=True):
        np.testing.assert_allclose(bodies[body] @ inside, poses[hand.link(pair.link)], atol=1e-14)


def test_a_link_between_that_carries_a_contact_is_kept():
    parts, _ = MECHANISMS["a universal joint across a fixed link"]
    rng = np.random.default_rng(3)
    planted = plant(chain(*parts), [("tip", tip(), bump(rng)), ("fixed", tip(), bump(rng))], rng)
    system = canonical(planted.task)
    assert system.loops.count(Kind.REVOLUTE) == 2
    assert system.layout.links == ("palm", "first", "tip", "object")
    check_solution(planted, system)


def test_contacts_on_the_palm_alone():
    rng = np.random.default_rng(3)
    planted = plant(load_hand("schunk-sah"), [("palm", bump(rng), bump(rng))], rng)
    system = canonical(planted.task)
    assert (system.n_v, system.n_e, system.d) == (48, 38, 11)
    assert nullity(system, check_solution(planted, system)) == 11


def test_two_fingers_on_one_moving_link():
    rng = np.random.default_rng(3)
    hand = chain(
        ("wrist", "palm", pose(0.1 * Z), [joint("w", Z)]),
        ("left", "wrist", pose(0.05 * X), [joint("l", Y)]),
        ("right", "wrist", pose(-0.05 * X), [joint("r", Y)]),
    )
    planted = plant(hand, [("left", tip(), bump(rng)), ("right", tip(), bump(rng))], rng)
    system = canonical(planted.task)
    assert system.loops.count(Kind.REVOLUTE) == 3
    check_solution(planted, system)


@pytest.mark.parametrize("name", MECHANISMS)
def test_positions_stay_in_their_boxes(name):
    """Whatever the configuration within the limits, without any contact."""
    hand = chain(*MECHANISMS[name][0])
    rng = np.random.default_rng(5)
    system = canonical(plant(hand, [("tip", tip(), bump(rng))], rng).task, unit=0.01)
    at_ = system.layout
    for _ in range(200):
        q = np.array([rng.choice([j.lower, j.upper, rng.uniform(j.lower, j.upper)]) for j in hand.joints])
        r = system.loops.body_poses(q)[:, :3, 3].ravel() / system.unit
        places = at_.position[:-1].ravel()
        assert (r >= system.lower[places] - TIGHT).all()
        assert (r <= system.upper[places] + TIGHT).all()


def test_pose_bounds_are_boxes_of_the_object():
    rng = np.random.default_rng(0)
    planted = plant(load_hand("schunk-sah"), [("index_distal", tip(), bump(rng))], rng, object_pose=HOME)
    bounds = PoseBounds.none()
    position, axes = bounds.position.copy(), bounds.axes.copy()
    position[0], axes[2, 1] = (-0.01, 0.02), (-0.3, 0.25)
    task = Task.of(planted.task.hand, planted.task.contact_pairs, pose=PoseBounds(position, axes))
    system, free = canonical(task, unit=0.001), canonical(planted.task, unit=0.001)
    for name, low, high in (("r[object].x", -10, 20), ("e[object].y", -0.3, 0.25)):
        k = system.names.index(name)
        assert (system.lower[k], system.upper[k]) == pytest.approx((low, high))
    same = [k for k, n in enumerate(system.names) if n not in ("r[object].x", "e[object].y")]
    np.testing.assert_array_equal(system.lower[same], free.lower[same])
    assert "palm" in system.names[0]
    assert np.all(system.lower[:12] == system.upper[:12])  # the palm does not move


def test_bounds_out_of_reach_leave_a_finite_box():
    rng = np.random.default_rng(0)
    planted = plant(load_hand("schunk-sah"), [("index_distal", tip(), bump(rng))], rng, object_pose=HOME)
    position = np.array([[5.0, np.inf], [-np.inf, np.inf], [-np.inf, np.inf]])
    task = Task.of(planted.task.hand, planted.task.contact_pairs, pose=PoseBounds(position, PoseBounds.none().axes))
    system = canonical(task)
    assert np.isfinite([system.lower, system.upper]).all()
    assert (system.lower <= system.upper).all()


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
    plain = canonical(sah("index_distal palm thumb_distal").task)
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
