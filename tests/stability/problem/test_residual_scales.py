"""What residuals are measured against: of a state that solves nothing, every number worked out a second time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.proofs.states import State
from handfast.stability.problem import judge, model
from handfast.stability.problem.judge import EXACT_SUM_THRESHOLD
from handfast.stability.problem.model import scaled, state_of
from tests.support.problems import X, Z, pinch
from tests.support.rounding_edges import W, hand


def wrong(seed: int, still: tuple[int, ...] = ()) -> State:
    """A state of `hand` out of every balance; contacts that carry nothing are `still`."""
    rng = np.random.default_rng(seed)
    c = rng.normal(size=(3, 3))
    c[list(still)] = 0.0
    return state_of(rng.normal(size=6), rng.normal(size=3), c.reshape(-1), rng.normal(size=3), rng.normal(size=1))


def expected(g: Grasp, w: np.ndarray, s: State, f_c: np.ndarray, eta: float) -> dict[str, float]:
    """Contact by contact and joint by joint, as `Residuals` says."""
    c, mu = s.c.reshape(-1, 3), g.mu
    forces = [contact.frame @ c[i] for i, contact in enumerate(g.contacts)]
    middle = sum(g.positions) / g.m
    F = max(float(np.linalg.norm(w[:3])), float(np.linalg.norm(w[3:] - np.cross(middle, w[:3]))) / g.size)
    d, dt, torque, arms = [], [], np.zeros(3), np.zeros(3)
    for i, contact in enumerate(g.contacts):
        moving = s.r[:3] + np.cross(s.r[3:], contact.position)
        for j, joint in enumerate(g.joints):
            if i in joint.moves:
                column = contact.frame.T @ joint.velocity_at(contact.position)
                moving = moving - s.q[j] * joint.velocity_at(contact.position)
                torque[j] += column @ c[i]
                arms[j] += column @ column
        d.append(contact.frame.T @ moving)
        dt.append(float(np.linalg.norm(d[-1][1:])))
    arms = np.sqrt(arms)
    wrench = np.r_[sum(forces), sum(np.cross(p, f) for p, f in zip(g.positions, forces, strict=True))] + w
    units = [g.size if joint.type == "revolute" else 1.0 for joint in g.joints]
    missing = np.abs(torque - g.mechanism.R.T @ s.f - g.mechanism.A.T @ s.coupling)
    lever = np.array([min(arms[j] / abs(x) for j, x in enumerate(row) if x) for row in g.mechanism.R])
    actuators = []
    for j in range(3):
        sense = -1.0 if f_c[j] < 0 else 1.0
        t = sense * (g.mechanism.R[j] @ s.q) * lever[j]
        slack = sense * (s.f[j] - f_c[j]) / lever[j]
        moves = f_c[j] != 0 or g.mechanism.tendon[j]
        actuators.append(max(-t, -slack, min(abs(t), abs(slack))) if moves else abs(t))
    spring = [max(0.0, -(np.cos(eta) * x[0] + np.sin(eta) * t)) for x, t in zip(d, dt, strict=True)]
    friction = [c[i, 1:] * dt[i] + mu[i] * c[i, 0] * d[i][1:] for i in range(3)]
    return {
        "object_balance": max(
            float(np.linalg.norm(wrench[:3])),
            float(np.linalg.norm(wrench[3:] - np.cross(middle, wrench[:3]))) / g.size,
        ) / F,
        "joint_balance": max(missing / units) / F,
        "couplings": max(
            abs(row @ s.q) * arms[j] / abs(x) for row in g.mechanism.A for j, x in enumerate(row) if x
        ) / F,
        "normal": max(abs(c[i, 0] - spring[i]) for i in range(3)) / F,
        "cone": max(0.0, *(float(np.linalg.norm(c[i, 1:])) - mu[i] * c[i, 0] for i in range(3))) / F,
        "dissipation": max(float(np.abs(x).max()) / max(t, F) for x, t in zip(friction, dt, strict=True)) / F,
        "actuators": max(0.0, *actuators) / F,
    }  # fmt: skip


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("still", [(), (0,), (1,), (2,), (0, 1)])
@pytest.mark.parametrize("eta", [0.0, 0.2])
def test_every_residual(seed: int, still: tuple[int, ...], eta: float) -> None:
    g, s = hand((-1.0) ** seed), wrong(seed, still)
    w = W * 10.0 ** (seed % 3 - 1)
    found = judge.residuals(g, w, s, eta=eta)
    for name, value in expected(g, w, s, g.command, eta).items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-9), name
    command = np.array([0.0, -0.7, 0.3])
    found = judge.residuals(g, w, s, command=command, mdp=False)
    for name, value in expected(g, w, s, command, 0.0).items():
        assert getattr(found, name) == pytest.approx(0.0 if name == "dissipation" else value, rel=1e-9), name


@pytest.mark.parametrize("turn", [1e-3, 10.0])
@pytest.mark.parametrize("far", [0.0, 50.0])
def test_a_torque_counts_about_the_middle_of_the_contacts(turn: float, far: float) -> None:
    """Over the grasp's size, wherever the object's origin is."""
    at = far * np.array([0.3, -0.2, 0.7])
    g = Grasp([Contact(c.position + at, c.normal, c.friction) for c in hand().contacts])
    for force in (np.zeros(3), np.array([0.4, -0.3, 0.2])):
        torque = turn * np.array([0.2, 0.9, -0.4])
        w = np.r_[force, torque + np.cross(g.positions.mean(axis=0), force)]
        expected = max(float(np.linalg.norm(force)), float(np.linalg.norm(torque)) / hand().size)
        assert judge.load_scale(g, w) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("power", [-160, -200, -300])
def test_numbers_whose_squares_vanish(power: int, seed: int) -> None:
    """Homogeneous: 10^-200 of everything has the same residuals, eta and (6) included."""
    g, s, k = hand(), wrong(seed), 10.0**power
    small = g.with_preload(k * g.command)
    for more in ({}, {"eta": 0.3}, {"mdp": False}, {"command": np.array([0.2, 0.0, 0.1])}):
        tiny = {name: k * v if name == "command" else v for name, v in more.items()}
        whole, part = judge.residuals(g, W, s, **more), judge.residuals(small, k * W, scaled(s, k), **tiny)
        for name in expected(g, W, s, g.command, 0.0):
            assert getattr(part, name) == pytest.approx(getattr(whole, name), rel=1e-6), name


def test_without_loads_the_largest_command_is_the_scale() -> None:
    """Of 0.1 and 0.3 N m at hinges: 0.3 over the grasp's size. Without commands, 1."""
    g = pinch().with_preload({"right": 0.1, "left": 0.3})
    idle = state_of(np.zeros(6), np.array([0.5, 0.0]), np.zeros(6), np.zeros(2), np.zeros(0))
    assert judge.residuals(g, np.zeros(6), idle).normal == pytest.approx(0.05 * g.size / 0.3)  # 0.5 turns 0.1 m away
    assert judge.residuals(g.with_preload({"left": 0.2}), np.zeros(6), idle).normal == pytest.approx(
        0.05 * g.size / 0.2
    )
    assert judge.residuals(g.with_preload(None), np.zeros(6), idle).normal == pytest.approx(0.05)
    loaded = np.array([0, 0, 1e-6, 0, 0, 0])  # however small it is
    assert judge.residuals(g, loaded, idle).normal == pytest.approx(0.05 / 1e-6)


@pytest.mark.parametrize("times", [1.0, 1e6])
def test_contact_forces_are_no_scale(times: float) -> None:
    """0.5 N m that nothing carries at a hinge count over the size of the grasp, 0.5 N at a slide as they are."""
    contacts = [Contact([0.03, 0, 0], -X, 0.5), Contact([-0.03, 0, 0], X, 0.5), Contact([0.0, 0.08, 0], -X, 0.5)]
    turns = GraspJoint("turns", Z, [0.0, 0.0, 0.0], (2,))
    slide = GraspJoint("slide", X, [0.0, 0.0, 0.0], (2,), "prismatic")
    c = times * np.array([2.0, 0, 0, 2.0, 0, 0, 0, 0, 0])
    for joint, size in ((turns, Grasp(contacts).size), (slide, 1.0)):
        g = Grasp(contacts, [joint])
        state = state_of(np.zeros(6), np.zeros(1), c, np.array([0.5]), np.zeros(0))
        for load in (0.1, 3.0):
            w = np.r_[0, 0, 0, load * g.size, 0, 0]
            assert judge.residuals(g, w, state).joint_balance == pytest.approx(0.5 / size / load)


# --- where rounding may matter -----------------------------------------------------------------------------------

FIELDS = ("r", "q", "c", "f", "coupling")


def sizes(g: Grasp, field: str) -> list[float]:
    """Of one unit of each entry of a state [N]: how it compares to the force scale."""
    arms = model.joint_arms(g)
    reach = np.abs(g.positions).max() + g.size
    lever = model.actuator_arms(g)
    return {
        "r": [1.0] * 3 + [reach] * 3,
        "q": arms.tolist(),
        "c": [1.0] * 9,
        "f": (1 / lever).tolist(),
        "coupling": [float((np.abs(g.mechanism.A) / arms).max())],
    }[field]


@pytest.mark.parametrize("field", FIELDS)
def test_sums_are_exact_where_numbers_are_large(field: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond `EXACT_SUM_THRESHOLD` times the force scale, each entry by what it does at a contact; of either sign."""
    g, calls = hand(), []
    monkeypatch.setattr(judge, "exact_sums", lambda *of: calls.append(of))
    for k, unit in enumerate(sizes(g, field)):
        for factor, exact in ((1 - 1e-9, False), (1 + 1e-9, True)):
            for sign in (1.0, -1.0):
                parts: dict[str, Any] = {"r": np.zeros(6), "q": np.zeros(3), "f": np.zeros(3), "coupling": np.zeros(1)}
                parts["c"] = np.arange(9.0)
                parts[field][k] = sign * factor * EXACT_SUM_THRESHOLD * 2.5 / unit
                state = state_of(**parts)
                calls.clear()
                sums = judge.linear_sums(g, W, state, 2.5)
                assert bool(calls) == exact == (sums is None), (field, k, factor)
                if exact:
                    assert all(mine is its for mine, its in zip(calls[0], (g, W, state), strict=True))


def test_sums_are_exact_where_contacts_are_far_from_the_origin(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond `EXACT_SUM_THRESHOLD` times the spacing of the contacts."""
    calls: list[Any] = []
    monkeypatch.setattr(judge, "exact_sums", lambda *of: calls.append(of))
    for factor, exact in ((0.9, False), (1.1, True)):
        calls.clear()
        spacing = pinch().spacing
        far = factor * EXACT_SUM_THRESHOLD * spacing
        contacts = [Contact(c.position + np.array([0.0, far, 0.0]), c.normal, c.friction) for c in pinch().contacts]
        g = Grasp(contacts)
        assert g.spacing == pytest.approx(spacing, rel=1e-3)
        state = state_of(np.zeros(6), np.zeros(0), np.ones(6), np.zeros(0), np.zeros(0))
        judge.linear_sums(g, W, state, 1.0)
        assert bool(calls) == exact


def test_sums_say_what_the_exact_ones_say() -> None:
    for seed in range(4):
        g, s = hand(), wrong(seed)
        mine = judge.linear_sums(g, W, s, 1.0)
        exact = judge.exact_sums(g, W, s)
        for name in ("object", "joints", "couplings", "d", "t"):
            np.testing.assert_allclose(getattr(mine, name), getattr(exact, name), rtol=1e-12, atol=1e-13)
