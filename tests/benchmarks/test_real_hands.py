"""Real hands on real objects, end to end: load, close, contacts, check; as benchmarks/real_hands.py records it."""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from handfast import Verdict, check
from tests.support.places import ROOT, SHARED

BENCHMARKS = ROOT / "benchmarks"
RESULTS = BENCHMARKS / "results" / "real_hands.json"
SIDES = ("+z", "-x")

pytestmark = pytest.mark.skipif(not SHARED.is_dir(), reason="needs the hands and objects in ../shared")


@pytest.fixture(scope="module")
def benchmark_module() -> ModuleType:
    from benchmarks import real_hands

    return real_hands


@pytest.mark.parametrize(("hand", "thing"), [("barrett", "tomato_soup_can"), ("allegro", "master_chef_can")])
def test_chain_from_files_to_verdict(benchmark_module: ModuleType, hand: str, thing: str) -> None:
    scene = benchmark_module.prepare(SHARED, hand, thing)
    rows = json.loads(RESULTS.read_text("utf-8"))["rows"]
    kept = next(r for r in rows if (r["pair"], r["variant"]) == (scene.pair, scene.variant))

    assert scene.fingers >= 3
    assert scene.closed.penetration < 1e-4
    assert [c.link for c in scene.grasp.contacts] == [c["link"] for c in kept["contacts"]]
    at = np.array([c["position"] for c in kept["contacts"]])
    np.testing.assert_allclose([c.position for c in scene.grasp.contacts], at, atol=1e-4)
    assert scene.grasp.preload == pytest.approx(kept["preload"], abs=1e-4)

    for side in SIDES:
        expected = next(r["verdict"] for r in kept["checks"] if r["gravity"] == side)
        wrench = scene.body.gravity_wrench(benchmark_module.SIDES[side])
        answer = check(scene.grasp, wrench)
        assert str(answer.verdict) == expected, side
        if answer.verdict is Verdict.HOLDS:
            assert answer.witness is not None
            assert answer.witness.valid
            np.testing.assert_allclose(answer.witness.forces.sum(axis=0), -wrench[:3], atol=1e-8)


@pytest.mark.parametrize("hand", ["barrett", "allegro"])
def test_every_pair_has_a_pose_that_names_no_place(benchmark_module: ModuleType, hand: str) -> None:
    for thing in benchmark_module.MASSES:
        text = (benchmark_module.POSES / f"{hand}_{thing}.json").read_text("utf-8")
        data = json.loads(text)
        assert data["object"] == f"objects/ycb/{thing}.obj"
        assert not Path(data["hand"]).is_absolute()
        assert min(data["preload"].values()) > 0
