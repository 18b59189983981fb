"""Proofs of existence: planted right ones are accepted, and the equations enclose exact values."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.proofs import configurations
from handfast.proofs.configurations import AND, CLAIM, SCHEMA, Bounds, check_configuration, read_existence
from handfast.proofs.contact_equations import ContactEquations
from handfast.proofs.fields import BadFile
from handfast.proofs.intervals import Dual, Interval
from handfast.proofs.replay import Replay
from handfast.proofs.tasks import read_task
from handfast.synthesis.solution import existence_from_dict
from handfast.synthesis.task import PoseBounds
from tests.support.contact_equations import contact_equations, surface_at
from tests.support.planted_proofs import (
    PlantedProof,
    all_joints,
    cone_edges,
    equations_of,
    limited,
    odd_case,
    pose_of,
    reshaped,
    sah_case,
    verify_existence,
)


@pytest.mark.parametrize("block", range(4))
@pytest.mark.parametrize("case", [odd_case, sah_case])
def test_planted_right_ones_are_accepted(case, block: int) -> None:
    for seed in range(14 * block, 14 * (block + 1)):
        planted = case(seed)
        report = verify_existence(planted.task, planted.proof())
        assert report.ok, (seed, report.reasons)
        assert report.reasons == ()
        assert report.gap < 1e-12
        assert report.step + report.contraction < 1
        assert min(report.slacks.values()) > 0


def test_bounds_that_leave_room_are_met() -> None:
    """A pose within bounds, and a joint limit and a cone as near as they may come."""
    planted = sah_case(3, ("cap",), ("bicubic",))
    R, p = pose_of(planted)
    near = PoseBounds(np.column_stack([p - 1e-7, p + 1e-7]), np.clip(np.stack([R.T - 1e-5, R.T + 1e-5], -1), -1.0, 1.0))
    report = verify_existence(replace(planted.task, pose=near), planted.proof())
    assert report.ok, report.reasons
    assert 0 < report.slacks["position:0"] < 1e-7
    assert 0 < report.slacks["x_axis:2"] < 1e-5
    for label in ("joint:index_distal", "joint:thumb_base"):
        name = label.removeprefix("joint:")
        narrow = limited(planted.task, name, -3.0, all_joints(planted)[name] + 1e-6)
        report = verify_existence(narrow, planted.proof())
        assert report.ok, report.reasons
        assert 0 < report.slacks[label] < 1e-6
    for k, edge in enumerate(cone_edges(planted)):
        report = verify_existence(reshaped(planted.task, k, hand={"half_angle": edge + 1e-5}), planted.proof())
        assert report.ok, report.reasons
        assert 0 < report.slacks[f"contact:{k}:cone"] < 1e-4


def test_no_bounds_are_no_bounds() -> None:
    planted = sah_case(2)
    position = np.array([[-np.inf, np.inf], [-np.inf, 9.0], [-9.0, np.inf]])
    axes = np.tile([-1.0, 1.0], (3, 3, 1))
    R, _ = pose_of(planted)
    axes[2, 1] = [R[1, 2] - 0.01, 1.0]
    report = verify_existence(replace(planted.task, pose=PoseBounds(position, axes)), planted.proof())
    assert report.ok, report.reasons
    assert [name for name in report.slacks if "axis" in name or "position" in name] == [
        "position:1",
        "position:2",
        "z_axis:1",
    ]
    assert 0.009 < report.slacks["z_axis:1"] < 0.01


def test_a_cap_may_be_passed_at_its_pole() -> None:
    """s on both sides of 0: the points of an object cap about its axis."""
    planted = sah_case(1, ("cap",), ("cap",))
    cap, values = planted.task.contact_pairs[0].object, planted.values
    pole, _, _ = surface_at(cap, *(np.array([values[f"contact:0:{x}"]]) for x in "st"))
    turned = replace(cap, axis=pole[0] - cap.center)
    spun = replace(planted.task.contact_pairs[0], object=turned)
    again = PlantedProof(
        replace(planted.task, contact_pairs=(spun, planted.task.contact_pairs[1])), values | {"contact:0:s": 0.0}
    )
    proof = again.proof(prefer="contact:0:s")
    assert "contact:0:s" in proof.dependent
    report = verify_existence(again.task, proof)
    assert report.ok, report.reasons


# --- the enclosure ----------------------------------------------------------------------------------


def balls(x: object) -> Array:
    """Floats as exact balls, in an object array."""
    arb = pytest.importorskip("flint").arb
    x = np.asarray(x, dtype=float)
    return np.array([arb(v) for v in x.ravel().tolist()], dtype=object).reshape(x.shape)


def encloses(x: Interval, exact: Array) -> bool:
    """Is every ball certainly within its interval?"""
    ends = zip(balls(x.lo).ravel(), exact.ravel(), balls(x.hi).ravel(), strict=True)
    return x.shape == exact.shape and all(lo <= v and v <= hi for lo, v, hi in ends)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("case", [odd_case, sah_case])
def test_equations_and_derivatives_enclose_exact_ones(case, seed: int) -> None:
    """At the floats, and at random points of a box as wide as the proofs' and of one much wider."""
    flint = pytest.importorskip("flint")
    planted, rng = case(seed), np.random.default_rng(seed)
    middle = np.array(list(planted.values.values()))
    equations = equations_of(planted.task)
    assert list(equations.column) == planted.labels
    n, (h, most) = len(middle), (2.0**-200, 2.0**-60)
    for radius in (1e-7, 1e-3):
        box = Interval.around(middle, radius)
        both = Interval.between(np.stack([middle, box.lo]), np.stack([middle, box.hi]))
        at = equations.at(both)
        with flint.ctx.workprec(700):
            x = balls(np.stack([middle, middle + radius * rng.uniform(-0.99, 0.99, n)]))
            F = contact_equations(planted.task, planted.labels, x)
            assert encloses(at.F.value, F)
            width = at.F.value.hi - at.F.value.lo
            assert width[0].max() < 1e-12
            least = 2 * radius * np.abs(at.F.slope.mid[:, 0]).sum(axis=0)  # the width of the linear part
            assert (width[1] < 50 * least).all()
            for point in (0, 1):
                up, down = (
                    contact_equations(planted.task, planted.labels, x[point] + s * h * balls(np.eye(n)))
                    for s in (1, -1)
                )
                slopes = (up - down) / (2 * h)
                J = at.F.slope[:, point]
                ends = np.nextafter(J.lo - most, -np.inf), np.nextafter(J.hi + most, np.inf)
                wide = Interval.between(*ends)  # the differences are right to 2^-390 or so
                assert encloses(wide, slopes)
                assert (J.hi - J.lo).max() < (1e-11 if point == 0 else 1e3 * radius)


# --- the file's form --------------- --------------------------------------------------------------


def test_every_bit_comes_back() -> None:
    planted = sah_case(4)
    proof = planted.proof()
    again = existence_from_dict(json.loads(json.dumps(proof.to_json())))
    assert again.to_json() == proof.to_json()
    assert again.coordinates == proof.coordinates
    assert list(proof.coordinates) == planted.labels
    assert verify_existence(planted.task, again) == verify_existence(planted.task, proof)


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda d: d.pop("radii"), "^radii: is missing$"),
        (lambda d: d.update(note="x"), "^note: is not a known field"),
        (lambda d: d.update(schema="handfast/existence/2"), "^schema: "),
        (lambda d: d.update(quaternion=[1.0, 0.0, 0.0]), "^quaternion: "),
        (lambda d: d["radii"].pop(), r"^radii: has \d+ numbers; \d+ are needed"),
        (
            lambda d: d["joints"].update(index_proximal=float("nan")),
            "^joints.index_proximal: is nan; a finite number is needed",
        ),
        (lambda d: d["contacts"][0].update(object=[0.5]), r"^contacts\[0\].object"),
        (lambda d: d["contacts"][0].pop("hand"), r"^contacts\[0\].hand: is missing$"),
    ],
)
def test_faults_in_files(change, message: str) -> None:
    data = sah_case(1).proof().to_json()
    change(data)
    with pytest.raises(InputError, match=message) as fault:
        existence_from_dict(data)
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize("field", ["joints", "position", "quaternion", "radii"])
def test_only_finite_numbers(field: str) -> None:
    proof = sah_case(0).proof()
    value = dict.fromkeys(proof.joints, np.inf) if field == "joints" else np.full_like(getattr(proof, field), np.nan)
    with pytest.raises(
        BadFile, match=f"^{field}: has (shape .* finite numbers are needed|a number that is not finite)$"
    ):
        replace(proof, **{field: value})


# --- a finger at a wall, by hand ------------------------------------------------------------------
#
# A finger slides along x from the palm, with a ball of 10 mm about its origin, or with a flat pad across x. The wall
# is the plane x = 0 of the object, over 2 m, and faces the finger.

TIP: dict[str, Any] = {"cap": {"center": [0, 0, 0], "radius": 0.01, "axis": [1, 0, 0], "half_angle": 0.5}}
PAD: dict[str, Any] = {"bezier": [[[0, y, z] for z in (-0.1, 0.1)] for y in (-0.1, 0.1)]}
WALL: dict[str, Any] = {"bezier": [[[0, y, z] for z in (-1, 1)] for y in (-1, 1)], "flip": True}
DOME: dict[str, Any] = {"cap": {"center": [0, 0, 0], "radius": 0.1, "axis": [1, 0, 0], "half_angle": 1.0}}
FREE = [[None, None]] * 3


def equations(
    hand: Any = None, thing: Any = None, limits: Any = (0, 0.1), position: Any = FREE, axes: Any = None
) -> Any:
    links = [
        {"name": name, "parent": k - 1, "pose": np.eye(4).tolist(), "joints": [0] * k}
        for k, name in enumerate(("palm", "finger"))
    ]
    slide = {
        "name": "slide",
        "type": "prismatic",
        "axis": [1, 0, 0],
        "anchor": [0] * 3,
        "limits": list(limits),
        "ref": 0,
    }
    of_hand = {"name": "hand", "source": "", "links": links, "joints": [slide], "couplings": []}
    contact = {"link": "finger", "hand": hand or TIP, "object": thing or WALL}
    pose = {"position": position, "axes": axes or [FREE] * 3}
    return ContactEquations.of(read_task({"name": "t", "hand": of_hand, "contacts": [contact], "pose": pose}))


@cache
def round_tip() -> Any:
    return equations()


@cache
def flat_tip() -> Any:
    return equations(PAD)


def at_the_wall(those: Any = None, **other: Any) -> Replay:
    """The finger is 50 mm out, so that the wall is at 60 mm, and touched half a metre before its middle along y."""
    contact = {"link": "finger", "object": [0.25, 0.625], "hand": None}
    data = {"schema": SCHEMA, "joints": {"slide": 0.05}, "position": [0.06, 0.5, -0.25], "quaternion": [1, 0, 0, 0]}
    data |= {"contacts": [contact], "dependent": ["joint:slide", "contact:0:s", "contact:0:t"]}
    return check_configuration(those or round_tip(), read_existence(data | {"radii": [0.01, 0.02, 0.04]} | other))


def flat_at_the_wall(those: Any = None, **other: Any) -> Replay:
    """The pad 50 mm out, a quarter of it from one end of y and in the middle of z: at -0.05 m and 0."""
    contact = {"link": "finger", "object": [0.25, 0.625], "hand": [0.25, 0.5]}
    own = {"position": [0.05, 0.45, -0.25], "contacts": [contact], "radii": [0.01] * 5}
    own |= {"dependent": ["joint:slide", "contact:0:s", "contact:0:v", "quaternion:2", "quaternion:3"]}
    return at_the_wall(those or flat_tip(), **own | other)


def numbers(done: Replay) -> dict[str, float]:
    return {name: x for name, x in done.figures.items() if isinstance(x, float)}


SOLVED = ("contraction", "step", "gap")


def test_a_ball_touches_a_wall_in_its_box() -> None:
    done = at_the_wall()
    assert (done.ok, done.name, done.claim, done.reason) == (True, "configuration", CLAIM, "")
    assert 0 < max(numbers(done)[name] for name in SOLVED) < 1e-11  # nothing is curved here
    room = {"joint:slide": 0.04, "contact:0:s": 0.23, "contact:0:t": 0.335, "contact:0:cone": 1 - np.cos(0.5)}
    assert {k: x for k, x in numbers(done).items() if k not in SOLVED} == pytest.approx(room)
    moved = at_the_wall(joints={"slide": 0.052})
    assert moved.ok
    assert (numbers(moved)["step"], numbers(moved)["gap"]) == pytest.approx((0.2, 0.002))
    assert numbers(moved)["step"] >= 0.2
    assert numbers(moved)["gap"] >= 0.002


def test_a_pad_lies_on_a_wall_in_its_box() -> None:
    done = flat_at_the_wall()
    assert done.ok
    assert [*numbers(done)] == [*SOLVED, "joint:slide", *(f"contact:0:{x}" for x in "stuv"), "contact:0:normals"]
    assert numbers(done)["contact:0:normals"] == pytest.approx(1, abs=1e-3)
    assert numbers(done)["contact:0:v"] == pytest.approx(0.49)
    assert numbers(done)["gap"] < 1e-13


@pytest.mark.parametrize(("r", "off", "reason"), [
    (0.2, 0.0, ""),
    (0.2, 0.1, ""),
    (0.2, 0.145, "the box is too tight: a solution near it may lie outside in quaternion:1"),
])  # fmt: skip
def test_how_much_a_box_contracts_by_hand(r: float, off: float, reason: str) -> None:
    """Turned about x by a quaternion of (1, q, 0, 0) the point (y, z) = (-1/2, 1/4) changes its z by

    (1 - q^2 + q) / (1 + q^2)^2 per unit of -q: 1 at 0, and 0.7027 at -0.2, which is 0.297 less.
    """
    turned = {"dependent": ["joint:slide", "position:1", "quaternion:1"], "radii": [0.04, 2.0, r]}
    done = at_the_wall(position=[0.06, 0.5, -0.25 + off], **turned)
    assert done.reason == reason
    assert 0.297 < numbers(done)["contraction"] < 0.31
    assert numbers(done)["step"] == pytest.approx(off / r, abs=0.02)


@pytest.mark.parametrize(("other", "reason"), [
    ({"joints": {"slide": 0.061}, "position": [0.06, 0.5, -0.25]},
     "the floats do not meet the equations (contact 0 is open by 0.011 m)"
     ": a Newton step moves joint:slide by 1.1 radii"),
    ({"dependent": ["joint:slide", "position:0", "contact:0:s"]},
     "the dependent coordinates are not determined: their Jacobian is singular"),
    ({"dependent": ["joint:slide", "quaternion:0", "contact:0:s"], "radii": [0.01, 2.0, 0.01]},
     "the box is too wide: in it the equations have no finite derivatives"
     "; and contact 0 may leave the hand's cap, by a cosine of nan"),
    ({"dependent": ["joint:slide", "position:1", "quaternion:1"], "radii": [0.04, 2.0, 0.5]},
     "the box is too wide, or the equations too nearly singular: quaternion:1 contracts by a factor of 1.17 only"
     "; and contact 0 may leave the hand's cap, by a cosine of 0.278"),
    ({"joints": {}}, "has no value for joint slide; the free joints are slide"),
    ({"joints": {"slide": 0.05, "thumb": 0}}, "has a value for joint thumb; the free joints are slide"),
    ({"contacts": []}, "has 0 contacts; the task has 1"),
    ({"contacts": [{"link": "palm", "object": [0, 0], "hand": None}]},
     "contact 0 is on palm; in the task it is on finger"),
    ({"contacts": [{"link": "finger", "object": [0, 0], "hand": [0, 0]}]},
     "contact 0: the hand region is a cap, which has no u and v"),
    ({"quaternion": [1e-3, 0, 0, 0]}, "the quaternion is shorter than 0.001"),
    ({"dependent": ["joint:slide"], "radii": [1]}, "1 coordinates are dependent; the 3 equations need as many"),
    ({"dependent": ["joint:slide", "x", "contact:0:s"]},
     "'x' is no coordinate of this task; they are joint:slide, position:0, position:1, position:2, quaternion:0, "
     "quaternion:1, quaternion:2, quaternion:3, contact:0:s, contact:0:t"),
    ({"dependent": ["contact:0:s", "joint:slide", "joint:slide"]}, "joint:slide is dependent twice"),
    ({"radii": [0.01, 0.0, 0.01]}, "the radius of contact:0:s is 0; it must be positive"),
    ({"radii": [0.01, -0.5, 0.01]}, "the radius of contact:0:s is -0.5; it must be positive"),
])  # fmt: skip
def test_why_no_configuration_is_shown(other: dict[str, Any], reason: str) -> None:
    done = at_the_wall(**other)
    assert (done.ok, done.claim, done.reason) == (False, CLAIM, reason)
    if "is too" not in reason and "do not meet" not in reason:
        assert (numbers(done)["contraction"], numbers(done)["step"]) == (np.inf, np.inf)
        assert (numbers(done)["gap"] == np.inf) == ("Jacobian" not in reason)


def test_why_no_pad_is_shown_to_touch() -> None:
    contact = {"link": "finger", "object": [0.25, 0.625], "hand": None}
    done = flat_at_the_wall(contacts=[contact])
    assert done.reason == "contact 0: the hand region is no cap, so it needs u and v"
    whole = ["joint:slide", *(f"quaternion:{k}" for k in range(4))]
    assert flat_at_the_wall(dependent=whole).reason == (
        "all of the quaternion is dependent; its length is free, so one component must be frozen"
    )
    assert flat_at_the_wall(equations(PAD | {"flip": True})).reason == (
        "contact 0: the normals are not opposite: their cosine comes to [0.99960008, 1.0002] in the box"
    )


ONE = [[0.9, None], [None, None], [None, None]]


@pytest.mark.parametrize(("task", "reason"), [
    ({"limits": (0, 0.06)}, "joint slide comes to [0.04, 0.06] in the box, not strictly inside [0, 0.06]"),
    ({"limits": (0.04, 0.1)}, "joint slide comes to [0.04, 0.06] in the box, not strictly inside [0.04, 0.1]"),
    ({"limits": (0.035, 0.065)}, ""),
    ({"position": [[None, None], [None, 0.5], [None, None]]},
     "pose.position[1] comes to [0.5, 0.5] in the box, not strictly inside [-inf, 0.5]"),
    ({"position": [[0.059, None], [0.4, 0.6], [None, -0.2]]}, ""),
    ({"position": [[None, None], [0.5, 0.5], [None, None]]},
     "pose.position[1] is bounded to 0.5 alone; nothing lies strictly inside"),
    ({"axes": [ONE, FREE, [FREE[0], FREE[0], [0.5, None]]]}, ""),
    ({"axes": [FREE, FREE, [[None, None], [0, 0], [None, None]]]},
     "pose.z_axis[1] is bounded to 0 alone; nothing lies strictly inside"),
    ({"hand": {"cap": TIP["cap"] | {"axis": [1, 1, 0], "half_angle": 0.7}}},
     "contact 0 may leave the hand's cap, by a cosine of 0.0577"),
    ({"hand": {"cap": TIP["cap"] | {"axis": [1, 1, 0], "half_angle": 0.8}}}, ""),
])  # fmt: skip
def test_bounds_of_a_ball_at_a_wall_by_hand(task: dict[str, Any], reason: str) -> None:
    done = at_the_wall(equations(**task))
    assert done.reason == reason


def test_bounds_of_axes_are_of_the_one_that_is_turned_there() -> None:
    """By a quarter turn about x, y to z and z to -y."""
    turned = {"quaternion": [1, 1, 0, 0], "position": [0.06, 0.25, 0.5]}
    below = [FREE[0], FREE[0], [None, 0.9]]
    done = at_the_wall(equations(axes=[FREE, below, [FREE[0], [None, 0.9], FREE[0]]]), **turned)
    assert done.reason == "pose.y_axis[2] comes to [1, 1] in the box, not strictly inside [-inf, 0.9]"
    assert numbers(done)["z_axis:1"] == pytest.approx(1.9)
    assert numbers(done)["y_axis:2"] == pytest.approx(-0.1)


def test_what_is_bounded_at_all() -> None:
    half, whole = DOME, {"cap": DOME["cap"] | {"half_angle": np.pi}}

    def bounds(**task: Any) -> dict[str, tuple[float, float]]:
        found = Bounds.of(equations(**task))
        return dict(zip(found.labels, zip(found.lower.tolist(), found.upper.tolist(), strict=True), strict=True))

    inf, slide = np.inf, {"joint:slide": (0.0, 0.1)}
    cone = {"contact:0:cone": (pytest.approx(np.cos(0.5)), inf)}
    assert bounds(thing=half) == slide | {"contact:0:s": (-1, 1)} | cone
    assert bounds(thing=whole, hand={"cap": TIP["cap"] | {"half_angle": np.pi}}) == slide
    assert bounds(thing=half, hand=PAD) == slide | {"contact:0:s": (-1, 1)} | {
        "contact:0:u": (0, 1),
        "contact:0:v": (0, 1),
        "contact:0:normals": (0, inf),
    }
    fixed = bounds(thing=whole, limits=(0.05, 0.05), position=[[0, None], [None, 1], [-1, 2]], axes=[FREE, ONE, FREE])
    assert (
        fixed
        == {"position:0": (0, inf), "position:1": (-inf, 1), "position:2": (-1, 2)} | {"y_axis:0": (0.9, inf)} | cone
    )
    assert Bounds.of(equations()).lower[-1] >= np.cos(0.5)


def test_reasons_are_told_together() -> None:
    done = at_the_wall(
        equations(limits=(0, 0.055)), contacts=[{"link": "finger", "object": [1.25, 0.625], "hand": None}]
    )
    first, *others = done.reason.split(AND)
    assert re.fullmatch(r"the floats do not meet the equations \(contact 0 is open by 2 m\): .* 50 radii", first)
    assert others == [
        "joint slide comes to [0.04, 0.06] in the box, not strictly inside [0, 0.055]",
        "contact:0:s comes to [1.23, 1.27] in the box, not strictly inside [0, 1]",
    ]


def test_contacts_in_a_file_have_no_other_fields() -> None:
    contact = {"link": "finger", "object": [0.25, 0.625], "hand": None, "more": 1}
    with pytest.raises(BadFile, match=r"^contacts\[0\]\.more: is not a known field"):
        at_the_wall(contacts=[contact])


@pytest.mark.parametrize("name", ["position", "quaternion", "radii"])
def test_each_number_of_a_configuration_is_finite(name: str) -> None:
    data = {"schema": SCHEMA, "joints": {"slide": 0.05}, "position": [0.06, 0.5, -0.25], "quaternion": [1, 0, 0, 0]}
    data |= {"contacts": [], "dependent": ["joint:slide", "position:0"], "radii": [0.01, 0.02]}
    proof = read_existence(data)
    for wrong in (np.nan, np.inf):
        numbers = getattr(proof, name).copy()
        numbers[-1] = wrong
        with pytest.raises(BadFile, match=f"^{name}: has shape .* finite numbers are needed$"):
            replace(proof, **{name: numbers})
    assert not getattr(proof, name).flags.writeable


def test_the_largest_of_quotients_is_rounded_up() -> None:
    assert 1 < configurations._most(np.array([0.5, 1.0])) < 1 + 1e-15
    assert configurations._most(np.array([0.5, np.nan])) == np.inf
    assert configurations._worst(np.array([0.5, 2.0, 1.0])) == 1
    assert configurations._worst(np.array([0.5, 2.0, np.nan])) == 2


# --- two equations by hand -------------------------------------------------------------------------------


def solved(
    J: Any, F: tuple[float, float], gaps: tuple[float, float] = (0.0, 0.0), wide: Any = ((0, 0), (0, 0))
) -> tuple[list[str], dict[str, float]]:
    """Of coordinates a and b, each within 2: F at the floats, derivatives J over the box, so `wide` either way."""
    slope = np.zeros((3, 2, 2, 2))  # by a, by one that is frozen, by b; at the floats and over the box
    around = Interval.between(np.array(J) - np.array(wide), np.array(J) + np.array(wide))
    slope[[0, 2], 1] = around.swapped().ends
    value = Interval.of(np.array([F, [np.nan, np.nan]]))
    gap = Interval.of(np.array([[[0, 0, g] for g in gaps], [[np.nan] * 3] * 2]))
    at: Any = SimpleNamespace(F=Dual(value, Interval(slope)), gap=gap)
    box: Any = SimpleNamespace(dependent=[0, 2], labels=("a", "b"), radii=np.array([2.0, 2.0]))
    with np.errstate(all="ignore"):
        return configurations._krawczyk(box, at)


TIGHT = "the box is too tight: a solution near it may lie outside in"
SINGULAR = "the dependent coordinates are not determined: their Jacobian is singular"
INFINITE = "the box is too wide: in it the equations have no finite derivatives"


@pytest.mark.parametrize(("J", "F", "wide", "reasons", "contraction", "step"), [
    ([[1, 0], [0, 1]], (0.5, -1.0), ((0, 0), (0, 0)), [], 0, 0.5),
    ([[0, 2], [4, 0]], (1.0, -2.0), ((0, 0), (0, 0)), [], 0, 0.25),  # b moves by 1 / 2, a by -2 / 4
    ([[1, 0], [0, 1]], (0.5, 1.0), ((0.25, 0), (0, 0.4)), [], 0.4, 0.5),
    ([[1, 0], [0, 1]], (0.5, -1.0), ((0.25, 0), (0, 0.6)), [f"{TIGHT} b"], 0.6, 0.5),
    ([[1, 0], [0, 1]], (0.4, 1.8), ((0.85, 0), (0, 0.05)), [f"{TIGHT} a"], 0.85, 0.9),
    ([[1, 0], [0, 1]], (0.0, 0.0), ((0.5, 0.75), (0, 0)), ["the box is too wide, or the equations too nearly singular: "
     "a contracts by a factor of 1.25 only"], 1.25, 0),
    ([[1, 0], [0, 1]], (0.5, 3.0), ((0, 0), (0, 0)), ["the floats do not meet the equations (contact 1 is open by "
     "0.75 m): a Newton step moves b by 1.5 radii"], 0, 1.5),
    ([[1, 1], [1, 1]], (0.0, 0.0), ((0, 0), (0, 0)), [SINGULAR], np.inf, np.inf),
    ([[1e-320, 0], [0, 1]], (0.0, 0.0), ((0, 0), (0, 0)), [SINGULAR], np.inf, np.inf),
    ([[1, np.inf], [0, 1]], (0.0, 0.0), ((0, 0), (0, 0)), [INFINITE], np.inf, np.inf),
])  # fmt: skip
def test_two_equations_by_hand(J: Any, F: Any, wide: Any, reasons: list[str], contraction: float, step: float) -> None:
    found, figures = solved(J, F, (0.5, -0.75), wide)
    assert found == reasons
    assert figures == pytest.approx({"contraction": contraction, "step": step, "gap": 0.75}, abs=1e-12)
    assert (
        min(figures["contraction"] - contraction, figures["step"] - step, figures["gap"] - 0.75) >= 0 or step == np.inf
    )


def test_the_largest_gap_is_infinite_where_one_is_not_known() -> None:
    assert solved([[1, 0], [0, 1]], (0.0, 0.0), (0.5, np.nan))[1]["gap"] == np.inf


@pytest.mark.parametrize(("step", "contraction", "share"), [
    (0.0, 0.5, 0.0),
    (0.125, 0.5, 0.25),  # 1 / 8 + 1 / 2 of 1 / 4 is 1 / 4
    (0.75, 0.125, 6 / 7),
    (0.75, 0.5, 1.0),
    (0.0, 1.0, 1.0),
])  # fmt: skip
def test_how_far_the_solution_is_from_the_floats(
    step: float, contraction: float, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One coordinate is 3 or within 2 of that, one 7 or within 4, and does not move; one is frozen at 5."""
    floats, wide = [[-3.0, 3.0], [-5.0, 5.0], [-7.0, 7.0]], [[-1.0, 5.0], [-5.0, 5.0], [-3.0, 11.0]]
    at: Any = SimpleNamespace(coordinates=Interval(np.array([floats, wide])))
    box = SimpleNamespace(dependent=[0, 2], radii=np.array([2.0, 4.0]))
    moved = Interval.around(np.zeros(2), [2 * step, 0.0]), Interval.around(np.zeros(2), [2 * contraction, 0.0])
    monkeypatch.setattr(configurations._Box, "of", lambda *_: box)
    monkeypatch.setattr(configurations, "_moved", lambda *_: moved)
    found = configurations.solution(None, None, at)  # type: ignore[arg-type]
    due = np.array([[[2 * share - 3, 3 + 2 * share], [-5.0, 5.0], [-7.0, 7.0]]])
    assert found.ends == pytest.approx(due, abs=1e-14)
    assert (found.ends >= due).all()
    monkeypatch.setattr(configurations, "_moved", lambda *_: None)
    assert configurations.solution(None, None, at).ends.tolist() == [wide]  # type: ignore[arg-type]


def test_what_is_refused_has_its_name_and_place() -> None:
    assert at_the_wall(joints={}).name == "configuration"
    contact = {"link": "finger", "object": [0.25, 0.625], "hand": [0.5]}
    with pytest.raises(BadFile, match=r"^contacts\[0\]\.hand: has 1 numbers; 2 are needed$"):
        at_the_wall(contacts=[contact])
