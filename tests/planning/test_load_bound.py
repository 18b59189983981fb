"""The grasp that holds most, and the bound on what any placement of the contacts holds: both proved, none forged."""

from __future__ import annotations

import copy
import json
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import InputError, Reach, Stop, Task, grasp_for, load_body, load_task, verify
from handfast.cli import console
from handfast.cli.grasp import FindGrasps, best_text, show_grasps
from handfast.planning.evaluation import local_search
from handfast.planning.filters.balance import circumscribed, least_load_factor, load_factor
from handfast.planning.load_bound import LoadBound
from handfast.planning.question import PlanLimits
from handfast.planning.results import grasps_file
from handfast.planning.results.folder import GraspFolder
from handfast.planning.results.grasps import Grasps
from handfast.proofs.fields import Fields
from handfast.proofs.tasks import read_task
from handfast.proofs.unbalanced import replay_unbalanced
from handfast.stability.problem.loads import Loads
from handfast.synthesis.embedded_task import task_to_dict
from tests.support.forged_grasps import refusals, renew
from tests.support.holds import grip

NAME = "scalpel-incision"


def bounded(task: Task, loads: Loads, boxes: int, limits: Any = 1.0, **how: Any) -> LoadBound:
    search = LoadBound(task, loads, 0.5, center=np.zeros(3), force_limits=limits, **how)
    search.run(boxes)
    return search


def replayed(search: LoadBound, loads: Loads, times: float = 1.0) -> str:
    """Why its proof with so many times its factor is refused; "" if it is not."""
    proof = json.loads(json.dumps(search.to_json()))
    factor, regions = times * proof.pop("factor"), read_task(task_to_dict(search.task)).on_object
    wrenches = {name: np.array(w) for name, w in loads.by_name.items()}
    limits = search.placements.force_limits
    return replay_unbalanced(regions, wrenches, 0.5, limits, None, Fields(proof), factor).reason


# --- by forces alone ----------------------------------------------------------------------------------

SIDES = np.array([[0, 0.02, 0], [0, -0.02, 0.0]]), np.array([[0, -1.0, 0], [0, 1.0, 0]])


@pytest.mark.parametrize(("load", "factor"), [([0, 0, -1, 0, 0, 0], 1.0), ([0, -2, 0, 0, 0, 0], 0.5)])
def test_what_two_jaws_carry(load: list[float], factor: float) -> None:
    """1 N from either side, mu = 0.5: friction carries 2 x 0.5 N, and a single side 1 N."""
    found, twist = load_factor(*SIDES, 0.5, np.ones(2), np.array(load, dtype=float))
    assert found == pytest.approx(factor, rel=1e-6)
    assert twist @ load > 0


def test_where_no_limit_counts_there_is_no_factor() -> None:
    load = np.array([0, 0, -1.0, 0, 0, 0])
    assert load_factor(*SIDES, 0.5, np.full(2, np.inf), load)[0] == np.inf
    assert load_factor(*SIDES, 0.5, np.ones(2), np.zeros(6))[0] == np.inf
    assert load_factor(*SIDES, 0.5, np.array([1.0, np.inf]), load)[0] == pytest.approx(1.0, rel=1e-6)  # they oppose


def test_the_bound_of_two_jaws_is_what_they_carry() -> None:
    loads = Loads.wrench([0, 0, -0.4, 0, 0, 0])
    search = bounded(grip(0.05), loads, 0)
    assert 2.5 <= search.factor <= 2.5 / np.cos(np.pi / 16) * (1 + 1e-6)
    assert replayed(search, loads) == ""
    assert replayed(search, loads, 0.97).startswith("1 of 1 boxes are not refuted")
    weaker = bounded(grip(0.05), loads, 0, np.array([1.0, 0.5]))  # the stronger side has less to push against
    assert 1.25 <= weaker.factor < 0.76 * search.factor
    assert replayed(weaker, loads) == ""


def test_some_force_has_to_be_limited() -> None:
    with pytest.raises(InputError, match="force_limit: is not there"):
        bounded(grip(0.05), Loads.wrench([0, 0, -1]), 0, np.inf)


@pytest.fixture(scope="module")
def scalpel() -> tuple[Task, Loads]:
    body = load_body("scalpel")
    return load_task(NAME), Loads.gravity(body, ["-y", "z"])


@pytest.fixture(scope="module")
def known(scalpel: tuple[Task, Loads]) -> LoadBound:
    return bounded(*scalpel, 20)


@pytest.mark.slow
def test_no_placement_reaches_the_bound(scalpel: tuple[Task, Loads], known: LoadBound) -> None:
    """At random placements, and in boxes the factor of their leaf; more boxes are a smaller bound, which is proved."""
    assert known.reached <= known.factor < bounded(*scalpel, 0).factor
    p, rng = known.placements, np.random.default_rng(3)
    whole = [(p.root, known.factor)] * 20 + [(leaf.node.box, leaf.factor) for _, _, leaf in known.heap]
    for box, factor in whole:
        points, normals = (a[0] for a in p.at(box[None, :, 0] + np.ptp(box, axis=1) * rng.random(len(box))))
        assert least_load_factor(points, normals, 0.5, p.force_limits, p.loads, least=factor) <= factor
    assert replayed(known, scalpel[1]) == ""
    assert "boxes are not refuted" in replayed(known, scalpel[1], 0.99)


@pytest.mark.slow
def test_loads_and_limits_scale_together(scalpel: tuple[Task, Loads], known: LoadBound) -> None:
    task, loads = scalpel
    assert bounded(task, loads.scaled(4.0), 20, 4.0).factor == pytest.approx(known.factor, rel=1e-4)
    assert bounded(task, loads, 20, 2.0).factor == pytest.approx(2 * known.factor, rel=1e-4)


@pytest.mark.slow
def test_a_bound_goes_on_where_it_was(scalpel: tuple[Task, Loads], known: LoadBound) -> None:
    saved = json.loads(json.dumps(known.to_json()))
    again = bounded(*scalpel, 0, saved=saved)
    assert again.factor == pytest.approx(known.factor, rel=1e-6)
    again.run(64)
    assert again.factor < known.factor
    assert replayed(again, scalpel[1]) == ""
    for forged in ({"factor": 0.5 * saved["factor"]}, {"factor": -1.0}, {"factor": None}):
        with pytest.raises(InputError, match=r"factor|tree"):
            bounded(*scalpel, 0, saved=saved | forged)


def test_pyramids_about_the_cones_are_an_upper_bound() -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        n = rng.normal(size=(3, 3))
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        p, w = 0.03 * rng.normal(size=(3, 3)), rng.normal(size=6)
        inside, outside = (load_factor(p, n, mu, np.ones(3), w)[0] for mu in (0.5, 0.5 * circumscribed()))
        assert 0 <= inside <= outside * (1 + 1e-9)
        R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        R *= np.sign(np.linalg.det(R))
        turned = load_factor(p @ R.T, n @ R.T, 0.5, np.ones(3), np.r_[R @ w[:3], R @ w[3:]])[0]
        assert inside * np.cos(np.pi / 8) ** 2 <= turned * (1 + 1e-6)  # the pyramids are others


# --- the best grasp -----------------------------------------------------------------------------------


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Little work, none of it by the clock: one unit, few boxes."""
    _small(monkeypatch.setattr)


def _small(set_: Callable[[Any, str, Any], None]) -> None:
    set_(local_search, "RAW", 6)
    set_(local_search, "QUESTIONS", 3)
    set_(local_search.LocalSearch, "numbers", lambda _, first: iter([first]))
    module = sys.modules["handfast.planning.grasp_for"]  # the package has the function of that name
    set_(module, "FIRST_BOXES", 64)
    set_(module, "BOUND_SHARE", 0.0)


ASKED: dict[str, Any] = {"count": 2, "timeout": None, "jobs": 1, "best": "margin"}
LIMITS = PlanLimits(force_limit=2.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("best") / "out"


@pytest.fixture(scope="module")
def best(folder: Path) -> Grasps:
    with pytest.MonkeyPatch.context() as patch:
        _small(patch.setattr)
        body = load_body("scalpel")
        how = ASKED | {"limits": LIMITS, "journal": GraspFolder(folder)}
        return grasp_for(load_task(NAME), body, Loads.gravity(body, "-z"), **how)


def test_the_best_grasps_come_first_below_the_bound(best: Grasps) -> None:
    factors = [g.strength.factor for g in best.grasps if g.strength]
    assert (best.verdict, best.stop) == (Reach.FOUND, Stop.TIME)
    assert len(factors) == len(best.grasps) > 0
    assert factors == sorted(factors, reverse=True)
    assert best.bound is not None
    assert 1 < factors[0] <= best.bound.factor < np.inf
    assert all(len(g.strength.checks) == 1 for g in best.grasps if g.strength)
    assert best.verify().ok
    assert best_text(best, 1.5).startswith("The best holds ")
    assert "no placement of the contacts reaches" in best_text(best, 1.5)


@pytest.fixture(scope="module")
def saved(best: Grasps) -> dict[str, Any]:
    return json.loads(json.dumps(grasps_file.to_dict(best.saved)))  # type: ignore[no-any-return]


def lower(data: dict[str, Any]) -> None:
    data["bound"]["factor"] = 0.9 * data["grasps"][0]["strength"]["factor"]


def stronger(data: dict[str, Any]) -> None:
    data["grasps"][0]["strength"]["factor"] *= 1.01


def beyond(data: dict[str, Any]) -> None:
    data["grasps"][0]["strength"]["factor"] = 1.01 * data["bound"]["factor"]


def tighter(data: dict[str, Any]) -> None:
    data["bound"]["factor"] *= 0.97


def without_witness(data: dict[str, Any]) -> None:
    data["grasps"][0]["strength"]["witnesses"].popitem()


def without_leaf(data: dict[str, Any]) -> None:
    data["bound"]["tree"].pop()


def bound_alone(data: dict[str, Any]) -> None:
    data["grasps"] = data["answer"]["grasps"] = []
    data["answer"]["verdict"] = "undecided"


def weaker_limit(data: dict[str, Any]) -> None:
    data["question"]["force_limit"] *= 1.1


FORGED: dict[str, tuple[Callable[[dict[str, Any]], None], str]] = {
    "a bound below what is held": (lower, "no placement is said to hold the loads .* times, and a grasp .* times"),
    "a smaller bound": (tighter, "bound: .* boxes are not refuted"),
    "more than is held": (stronger, "times gravity -z: "),
    "more than the bound": (beyond, "no placement is said to hold"),
    "a load without a witness": (without_witness, "has no witness of .* times gravity -z"),
    "a box left out": (without_leaf, "bound: the tree leaves out 1 boxes"),
    "a bound without a grasp": (bound_alone, "UNDECIDED with a bound"),
    "stronger contacts": (weaker_limit, "bound: .* boxes are not refuted"),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_bound_or_factor_is_refused(saved: dict[str, Any], name: str) -> None:
    change, match = FORGED[name]
    assert not refusals(saved)
    data = copy.deepcopy(saved)
    change(data)
    with pytest.raises(InputError, match="checksum: does not fit"):
        grasps_file.from_dict(data)
    lines = refusals(renew(data))
    assert any(re.search(match, line) for line in lines), lines


def test_the_command_line_goes_on(
    small: None, tmp_path: Path, capsys: pytest.CaptureFixture[str], best: Grasps, folder: Path
) -> None:
    """With the folder of the same question, asked in Python."""
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    first = json.loads((tmp_path / "search.json").read_text())
    assert first["bound"]["factor"] == pytest.approx(best.bound.factor)  # type: ignore[union-attr]
    assert [f["factor"] for f in first["found"]] == pytest.approx(
        sorted((g.strength.factor for g in best.grasps if g.strength), reverse=True), abs=10
    )
    asked = FindGrasps(
        task=NAME, count=2, up="z", safety=1.0, force_limit=2.0, best="margin", timeout=float("inf"), jobs=1,
        output=tmp_path, resume=True,
    )  # fmt: skip
    assert asked.run() in (0, 3)
    out = " ".join(capsys.readouterr().out.split())
    assert "no placement of the contacts reaches" in out
    assert "[times]" in out
    again = json.loads((tmp_path / "search.json").read_text())
    assert again["bound"]["factor"] <= first["bound"]["factor"]
    assert max(f["factor"] for f in again["found"]) >= max(f["factor"] for f in first["found"])
    assert verify(tmp_path / "grasps.json").ok


def test_without_a_limit_no_bound_is_known(small: None, capsys: pytest.CaptureFixture[str]) -> None:
    body = load_body("scalpel")
    answer = grasp_for(load_task(NAME), body, Loads.gravity(body, "-z"), **ASKED | {"count": 1})
    assert answer.verdict is Reach.FOUND
    assert answer.bound is None
    show_grasps(console.out(), answer)
    assert "no bound is known, as nothing limits the contact forces" in " ".join(capsys.readouterr().out.split())


def test_a_bound_below_one_is_a_proof_that_there_is_none(small: None, tmp_path: Path) -> None:
    body = load_body("scalpel")
    loads = Loads.gravity(body, "-z").scaled(100.0)
    how = ASKED | {"limits": LIMITS, "journal": GraspFolder(tmp_path)}
    answer = grasp_for(load_task(NAME), body, loads, **how)
    assert (answer.verdict, answer.stop, answer.grasps) == (Reach.NONE, Stop.COMPLETE, ())
    assert answer.verify().ok


def test_another_best_is_refused() -> None:
    with pytest.raises(InputError, match="best: is 'force'; margin is needed"):
        grasp_for(load_task(NAME), best="force")
