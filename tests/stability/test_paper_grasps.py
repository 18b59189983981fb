"""The stability paper's figures, rebuilt with the bundled Barrett: what the paper says of them, by number."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from handfast.core.answer import Verdict
from handfast.geometry.contacts import contact_grasp
from handfast.model.grasp import Grasp
from handfast.proofs import checker
from handfast.readers.configuration_file import load_configuration
from handfast.readers.grasp_file import load_grasp
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.stability.answers import MaxAnswer
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check, force_map, maximum, torques
from tests.support.places import ROOT
from tests.support.slow_cases import slow_after

BRIEF = Settings(nodes=500)  # for maxima of 0, which are never decided to the end


def up(newton: float) -> np.ndarray:
    return np.array([0, newton, 0, 0, 0, 0])


@pytest.mark.slow
def test_the_files_are_what_the_tool_makes() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "tools" / "paper_grasps.py"), "--check"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("name", ["fig1", "fig7", "fig9", "fig11"])
def test_hand_object_and_configuration_give_the_contact_level_file(name: str) -> None:
    configuration = load_configuration(name)
    hand, q = configuration.applied(load_hand(configuration.hand))
    grasp = contact_grasp(
        hand, q, load_body(configuration.object), configuration.pose, preload=configuration.preload, mechanism="direct"
    )
    stored = load_grasp(name)
    np.testing.assert_allclose(grasp.G, stored.G, atol=1e-9)
    np.testing.assert_allclose(grasp.J, stored.J, atol=1e-9)
    assert grasp.preload == pytest.approx(stored.preload)
    assert max(abs(c.depth) for c in grasp.contacts) < 1e-4  # they touch, and nothing penetrates


def links(grasp: Grasp) -> list[str]:
    return [c.link for c in grasp.contacts]


def test_contacts_are_where_the_paper_says() -> None:
    two = ["finger_1_prox", "finger_1_dist", "finger_2_prox", "finger_2_dist"]
    assert links(load_grasp("fig1")) == two
    assert links(load_grasp("fig7")) == two
    assert links(load_grasp("fig9")) == ["finger_1_dist", "finger_2_dist", "finger_3_prox", "finger_3_dist"]
    assert links(load_grasp("fig11")) == ["finger_1_dist", "finger_2_dist", "finger_3_dist"]
    tips = [c.position[1] for c in load_grasp("fig1").contacts if "dist" in c.link]
    assert abs(tips[0] - tips[1]) == pytest.approx(5e-4, abs=5e-5)  # a hair
    tips = [c.position[1] for c in load_grasp("fig7").contacts if "dist" in c.link]
    assert 0.01 < abs(tips[0] - tips[1]) < 0.03  # visible
    p = np.array([c.position for c in load_grasp("fig9").contacts])
    assert np.linalg.svd(p - p.mean(axis=0))[1][-1] > 2e-3  # not in one plane
    p = np.array([c.position for c in load_grasp("fig11").contacts])
    assert np.ptp(p[:, 1]) < 1e-6  # one plane, the xz plane


# --- Fig. 1 ---------------------------------------------------------------------------------------------


def sliding_limit(grasp: Grasp, mu: float, torque: float) -> float:
    """2 mu torque / arm by hand: a tip that slides along y has c_n (height - mu offset) = torque.

    Height and offset are those of the tip from its proximal joint. Both tips press equally, and the
    finger with the shorter arm is the one that turns at its command; the other's gearing takes more.
    """
    arms = []
    for k in (1, 2):
        tip = next(c for c in grasp.contacts if c.link == f"finger_{k}_dist").position
        joint = next(j for j in grasp.joints if j.name == f"finger_{k}_prox").origin
        height, offset = tip[1] - joint[1], abs(tip[0]) - abs(joint[0])
        arms.append(height - mu * offset)
    assert min(arms) == pytest.approx(0.09, rel=0.02)  # the paper's 90 mm
    return 2 * mu * torque / min(arms)


def test_fig1_holds_at_2_2_and_slips_at_2_5() -> None:
    g = load_grasp("fig1")
    held = check(g, up(2.2))
    assert held.verdict is Verdict.HOLDS
    assert held.witness.valid
    assert check(g, up(2.5)).verdict is Verdict.SLIPS


def test_fig1_maximum_is_the_sliding_limit() -> None:
    g = load_grasp("fig1")
    answer = maximum(g, up(1))
    by_hand = sliding_limit(g, 1.0, 0.1)
    assert answer.witness.valid
    assert answer.gap <= 1e-3
    assert answer.lower == pytest.approx(by_hand, rel=1e-2)
    assert answer.upper == pytest.approx(by_hand, rel=1e-2)


def test_fig1_without_preload_slips_up_and_carries_down() -> None:
    bare = load_grasp("fig1").with_preload(None)
    assert check(bare, up(1)).verdict is Verdict.SLIPS
    for sideways in (-0.5, 0.0, 0.5):
        for magnitude in (1.0, 100.0):
            w = magnitude * np.array([sideways, -1.0, 0, 0, 0, 0])
            assert check(bare, w).verdict is Verdict.HOLDS


def test_fig1_without_dissipation_holds_anything_out_of_nothing() -> None:
    bare = load_grasp("fig1").with_preload(None)
    for magnitude in (1.0, 100.0, 10_000.0):
        answer = check(bare, up(magnitude), mdp=False)
        assert answer.verdict is Verdict.HOLDS
        energy = answer.witness.energy
        assert energy.created > 1e-3 * energy.stored
        # somewhere friction points along the sliding motion, not against it
        assert energy.friction.min() < 0


@pytest.mark.slow
def test_fig1_hair_offset_wedges_to_one_side_and_eta_forgives_it() -> None:
    """Fig. 6a and 6b: at eta = 0 a push up and to one side is held at any force, to the other it is not."""
    g = load_grasp("fig1")
    a = np.radians(30)

    def pushed(side: float, eta: float):
        return maximum(g, [side * np.cos(a), np.sin(a), 0, 0, 0, 0], limits=GraspLimits(eta=np.radians(eta)))

    left, right = pushed(-1, 0), pushed(1, 0)
    assert left.unbounded != right.unbounded
    left, right = pushed(-1, 2.5), pushed(1, 2.5)
    assert not left.unbounded
    assert not right.unbounded
    assert left.lower == pytest.approx(right.lower, rel=0.05)


@pytest.mark.slow
def test_fig1_coupled_differs_from_the_papers_actuation() -> None:
    """The Barrett's distal joints follow at 1/3 instead of being locked: the load also closes them."""
    settings = Settings(gap=0.02)
    direct, coupled = (maximum(load_grasp(n), up(1), settings=settings) for n in ("fig1", "fig1-coupled"))
    assert coupled.witness.valid
    assert load_grasp("fig1-coupled").mechanism.A.shape[0] >= 2
    assert abs(coupled.upper - direct.upper) > 0.05


# --- Fig. 11 and 12 -------------------------------------------------------------------------------------


def fig11(third: float) -> Grasp:
    g = load_grasp("fig11")
    return g.with_preload(g.preload | {"finger_3_prox": third})


def by_hand(third: float) -> tuple[float, float]:
    """Force along z and torque about x: friction of tips 1 and 2, mu 0.1 / h each, less what finger 3 takes.

    All tips are h above their joints. Finger 3 pushes with third / h along z, so 2 mu 0.1 / h - third / h is
    left. The torque is finger 3's friction times its 50 mm from the x axis, limited by its own cone and by
    what tips 1 and 2 can still hold sideways.
    """
    g = load_grasp("fig11")
    h = -next(j for j in g.joints if j.name == "finger_3_prox").origin[1]
    mu, out = 0.45, 0.05
    force = max(0.0, (2 * mu * 0.1 - third) / h)
    sideways = np.sqrt(max(0.0, (2 * mu * 0.1 / h) ** 2 - (third / h) ** 2))
    return force, out * min(mu * third / h, sideways)


def assert_next_to_nothing(answer: MaxAnswer) -> None:
    """Slips but for magnitudes that are nothing beside the commands, which numbers do not decide."""
    assert answer.witness is None
    assert answer.upper < 1e-4 * 0.1 / 0.05
    assert checker.verify(answer.certificate).ok


@pytest.mark.parametrize("third", slow_after(2, [0.0, 0.045, 0.08, 0.0895]))
def test_fig12_two_curves(third: float) -> None:
    force, torque = by_hand(third)
    for direction, expected in (([0, 0, 1, 0, 0, 0], force), ([0, 0, 0, 1, 0, 0], torque)):
        answer = maximum(fig11(third), direction, settings=None if expected else BRIEF)
        if expected == 0:
            assert_next_to_nothing(answer)
        else:
            assert answer.lower <= expected * (1 + 1e-6)
            assert answer.upper >= expected * (1 - 1e-6)
            assert answer.lower == pytest.approx(expected, rel=2e-3)


def test_fig12_nothing_is_left_at_0_09() -> None:
    """3 digits: a trace is resisted at 0.0899 N m, nothing at 0.0901 N m."""
    trace = maximum(fig11(0.0899), [0, 0, 1, 0, 0, 0])
    assert 0 < trace.upper < 0.002
    for direction in ([0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0]):
        assert_next_to_nothing(maximum(fig11(0.0901), direction, settings=BRIEF))


# --- Fig. 9 ---------------------------------------------------------------------------------------------


def test_fig9_wastes_preload() -> None:
    """Section VII-C: the force that 0.1 N m everywhere resists needs less than that of some fingers."""
    g = load_grasp("fig9")
    settings = Settings(gap=2e-2)
    assert check(g, 1.2 * up(-1), settings=settings).verdict is Verdict.HOLDS
    answer = torques(g, 1.2 * up(-1), settings=settings)
    assert answer.verdict is Verdict.HOLDS
    assert answer.witness.valid
    assert answer.upper < 0.1
    # at the optimum itself the only solutions move without bound; a hundredth more leaves room for others
    a_bit_more = {name: 1.01 * value for name, value in answer.preload.items()}
    assert check(g.with_preload(a_bit_more), 1.2 * up(-1)).verdict is Verdict.HOLDS


def test_a_coarse_map_of_fig1_shows_the_paper() -> None:
    """Without preload everything below is held and nothing straight up; with it, straight up too."""
    answer = force_map(load_grasp("fig1"), "xy", steps=8, settings=Settings(gap=0.02))
    below = slice(5, 8)
    assert answer.passive.unbounded[below].all()
    assert answer.passive.verdicts[2] is Verdict.SLIPS
    assert answer.preloaded.lower[2] == pytest.approx(2.22, rel=0.03)
