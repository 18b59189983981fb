"""Certificates and answers about joints with laws: a law that is changed afterwards is refused."""

import copy
from typing import Any

import pytest

from handfast import Verdict, check, maximum, torques
from handfast.model.grasp import Grasp
from handfast.model.mechanism import Mechanism
from handfast.stability import answer_file, saved_answer
from handfast.stability.certify import certificate_file, checker
from tests.support.law_grasps import BACKDRIVABLE, DOWN, OPENS, curled, jaw

MOTOR = Mechanism.direct(["hinge"])


def slipping(grasp: Grasp, direction: list[int], load: float) -> dict[str, Any]:
    """The certificate of a load that slips, as its file has it."""
    found = check(grasp, [load * x for x in direction])
    assert found.verdict is Verdict.SLIPS
    assert found.certificate is not None
    return certificate_file.to_dict(found.certificate)


def proves(data: dict[str, Any]) -> bool:
    return checker.verify(certificate_file.from_dict(data)).ok


def raised(data: dict[str, Any], joint: int, **laws: Any) -> dict[str, Any]:
    """With other laws at a joint."""
    out = copy.deepcopy(data)
    out["question"]["grasp"]["joints"][joint].update(laws)
    return out


@pytest.mark.parametrize(
    ("grasp", "direction", "load", "joint", "laws"),
    [
        (jaw(friction=0.2), OPENS, 2.1, 0, {"friction": 0.22}),  # would hold 2.2 N
        (jaw(friction=0.2), OPENS, 2.1, 0, {"stop": "lower"}),
        (jaw(friction=0.2), OPENS, 2.1, 0, {"torque": 0.02}),
        (jaw(torque=0.2), OPENS, 2.1, 0, {"torque": 0.22}),
        (jaw(MOTOR, {"hinge": 0.5}, friction=0.2), DOWN, 3.1, 0, {"friction": 0.18}),  # less is lost
        (jaw(stop="upper"), OPENS, 0.5, 0, {"stop": "lower"}),
        (jaw(stop="upper"), OPENS, 0.5, 0, {"stop": "both"}),
        (curled(knuckle={"friction": 0.05}, tip={"friction": 0.04}), OPENS, 1.6, 1, {"friction": 0.05}),
    ],
)
def test_a_proof_does_not_hold_for_other_laws(
    grasp: Grasp, direction: list[int], load: float, joint: int, laws: dict[str, Any]
) -> None:
    """The same proof, said of a grasp that does hold the load."""
    data = slipping(grasp, direction, load)
    assert proves(data)
    assert not proves(raised(data, joint, **laws))


def test_a_proof_about_a_backdrivable_motor_is_not_one_about_gears() -> None:
    data = slipping(jaw(BACKDRIVABLE, {"motor": 0.1}), OPENS, 1.1)
    assert proves(data)
    other = copy.deepcopy(data)
    other["question"]["grasp"]["mechanism"]["actuators"][0]["backdrivable"] = False
    assert not proves(other)
    stronger = copy.deepcopy(data)
    stronger["question"]["grasp"]["preload"] = {"motor": 0.12}
    assert not proves(stronger)


def test_less_friction_makes_a_proof_no_worse() -> None:
    """What slips with 0.2 N m slips with 0.1, by the same rows."""
    assert proves(raised(slipping(jaw(friction=0.2), OPENS, 2.1), 0, friction=0.1))


@pytest.mark.parametrize("laws", [{"friction": 0.1}, {"friction": 0.0}, {"torque": -0.2}])
def test_a_state_is_none_of_other_laws(laws: dict[str, Any]) -> None:
    """The witness of a load that holds by friction, said of a joint with less of it."""
    found = check(jaw(friction=0.2), [1.9, 0, 0])
    data = saved_answer.to_dict(found.saved())
    assert answer_file.from_dict(data).verify().ok  # type: ignore[union-attr]
    changed = answer_file.from_dict(raised(data, 0, **laws))
    assert not changed.verify().ok  # type: ignore[union-attr]


def test_a_state_that_leans_on_a_stop_is_none_without_it() -> None:
    data = saved_answer.to_dict(check(jaw(stop="lower"), [1.9, 0, 0]).saved())
    assert answer_file.from_dict(data).verify().ok  # type: ignore[union-attr]
    for other in ("upper", ""):
        assert not answer_file.from_dict(raised(data, 0, stop=other)).verify().ok  # type: ignore[union-attr]


def test_bounds_of_a_largest_load_are_of_its_laws() -> None:
    found = maximum(jaw(MOTOR, {"hinge": 0.5}, friction=0.2), DOWN)
    data = saved_answer.to_dict(found.saved())
    assert answer_file.from_dict(data).verify().ok  # type: ignore[union-attr]
    for friction in (0.18, 0.22):
        both = raised(data, 0, friction=friction)
        both["certificate"]["question"]["grasp"] = both["question"]["grasp"]
        assert not answer_file.from_dict(both).verify().ok  # type: ignore[union-attr]


def test_a_backdrivable_command_is_not_sought() -> None:
    """A witness of least commands that drives the backdrivable motor harder is refused."""
    two = Mechanism(("a", "b"), [[1.0], [1.0]], [], (False,) * 2, (False, True))  # type: ignore[arg-type]
    found = torques(jaw(two, {"b": 0.1}), [0, 0, -3])
    data = saved_answer.to_dict(found.saved())
    assert answer_file.from_dict(data).verify().ok  # type: ignore[union-attr]
    data["witness"]["command"]["b"] = 0.2
    verified = answer_file.from_dict(data).verify()  # type: ignore[union-attr]
    assert "or a backdrivable one otherwise" in verified.reason
