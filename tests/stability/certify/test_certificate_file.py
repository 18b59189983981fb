"""The certificate's file and its directions: every bit comes back, every fault is one line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.stability.certify import checker
from handfast.stability.certify.certificate import HALF, TURN, directions
from handfast.stability.certify.certificate_file import from_dict, load_certificate, save_certificate, to_dict
from tests.support.certificates import CASES, capped_proof, proof


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("proof", [proof, capped_proof], ids=["all motions", "capped"])
def test_file_keeps_every_bit(name: str, proof, tmp_path) -> None:
    c = replace(proof(name), references=np.random.default_rng(1).random((2, proof(name).question.grasp.m + 1)))
    save_certificate(c, tmp_path / "c.json")
    again = load_certificate(tmp_path / "c.json")
    assert to_dict(again) == to_dict(c)
    assert checker.verify(again) == checker.verify(proof(name))


def test_directions() -> None:
    k = np.random.default_rng(0).integers(-TURN, 2 * TURN, 10_000)
    U = directions(k)
    assert (directions(k + HALF) == -U).all()
    assert (directions(k + TURN) == U).all()
    assert np.abs(np.linalg.norm(U, axis=1) - 1).max() < 4e-16
    np.testing.assert_allclose(U[:, 0], np.cos(2 * np.pi * k / TURN), atol=1e-14)
    u = directions(np.arange(TURN // 4 - 500, TURN // 4 + 500))
    assert (u[:-1, 0] * u[1:, 1] > u[:-1, 1] * u[1:, 0]).all()  # in order, across a quarter


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda d: d.pop("leaves"), "leaves: is missing"),
        (lambda d: d.update(extra=1), "extra: is not a known field"),
        (lambda d: d["nodes"]["part"].pop(), r"part: has shape \(\d+,\), needs \(\d+,\)"),
        (lambda d: d["rows"]["multiplier"].pop(), "multiplier: has shape"),
        (lambda d: d["rows"]["start"].pop(), "start: has shape"),
        (lambda d: d["rows"]["start"].__setitem__(1, -1), "start: must rise from 0"),
        (lambda d: d["rows"]["kind"].__setitem__(1, 1.5), r"rows.kind\[1\]"),
        (lambda d: d.update(references=[[1.0]]), "references: has shape"),
        (lambda d: d.update(references=[[1.0, 1.0, 1.0], [1.0]]), "references: must be numbers"),
        (lambda d: d.update(references=[[1.0, 1.0, float("inf")]]), "references"),
        (lambda d: d.update(cap_q=[1.0, 1.0]), "cap_q: is not a known field"),
        (lambda d: d.update(schema="handfast/certificate/1"), "cap_r: is missing"),
        (lambda d: d.update(schema="handfast/certificate/3"), "schema"),
        (lambda d: d.update(scalar=[0, 1]), "scalar: is the range"),
        (lambda d: d["question"].update(wrench=[0.0]), "question.wrench"),
        (lambda d: d["question"].update(eta=1.0), "eta: is 1 rad"),
        (lambda d: d["question"].update(direction=[1.0] * 6), "direction: has no meaning"),
        (lambda d: d["question"].update(driven=["left"]), "driven: have no meaning"),
        (lambda d: d["question"].update(goal="largest"), "direction: is needed"),
        (lambda d: d["question"].update(torque_limits={"middle": 1}), "unknown actuator 'middle'"),
        (lambda d: d["question"].update(force_limit=0), "is positive"),
        (lambda d: d["question"]["grasp"]["contacts"][0].update(friction=-1), "question.grasp.contacts"),
    ],
)
def test_faults_in_files(change, message: str) -> None:
    data = to_dict(proof("check"))
    change(data)
    with pytest.raises(InputError, match=message) as fault:
        from_dict(data)
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda d: d.update(cap_q=[1.0]), "cap_q: has shape"),
        (lambda d: d.update(cap_r=[-1.0] * 6), "cap_r: is negative"),
        (lambda d: d.pop("cap_q"), "cap_q: is missing"),
        (lambda d: d.update(schema="handfast/certificate/2"), "cap_r: is not a known field"),
    ],
)
def test_faults_in_caps(change, message: str) -> None:
    data = to_dict(capped_proof("check"))
    assert data["schema"] == "handfast/certificate/1"
    change(data)
    with pytest.raises(InputError, match=message):
        from_dict(data)


def test_a_range_without_end(tmp_path) -> None:
    """Of claims about all motions alone."""
    for goal in ("smallest preload", "largest", "max"):
        c = replace(proof(goal), scalar=(0.1, np.inf))
        save_certificate(c, tmp_path / f"{goal}.json")
        assert load_certificate(tmp_path / f"{goal}.json").scalar == (0.1, np.inf)
    for wrong in (-np.inf, np.inf, np.nan):
        with pytest.raises(InputError, match=r"scalar: is .* to inf, not a range that the goal knows"):
            replace(proof("largest"), scalar=(wrong, np.inf))
    with pytest.raises(InputError, match=r"scalar: is 0\.1 to inf, not a range that the goal knows"):
        replace(capped_proof("smallest preload"), scalar=(0.1, np.inf))


def test_file_that_is_no_certificate(tmp_path) -> None:
    (tmp_path / "c.json").write_text('{"schema": "handfast/grasp/1"}')
    with pytest.raises(InputError, match=r"c\.json: schema"):
        load_certificate(tmp_path / "c.json")
    with pytest.raises(InputError, match=r"none\.json: no such file"):
        load_certificate(tmp_path / "none.json")
