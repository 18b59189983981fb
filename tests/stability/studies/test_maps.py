"""Maps and sweeps: many maxima, in order, on all cores, without a lost one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as given_settings
from hypothesis import strategies as st

from handfast.cli import main
from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.core.parallel import default_jobs
from handfast.model.grasp import Grasp
from handfast.readers.grasp_file import save_grasp
from handfast.stability.answers.batch_answer import BatchAnswer
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.studies import batch, maps
from handfast.stability.studies.batch import max_many
from handfast.stability.studies.maps import sweep
from handfast.stability.studies.questions import force_map
from tests.support.problems import bell, pinch, table

QUICK = Settings(gap=1e-2)


def test_map_of_the_pinch_by_hand() -> None:
    """yz: 1 N in every direction with preload, nothing without. xy: along x anything."""
    answer = force_map(pinch(), "yz", steps=8, settings=QUICK)
    np.testing.assert_allclose(answer.directions[2], [0, 0, 1], atol=1e-15)
    assert (answer.passive.upper == 0).all()
    assert (answer.preloaded.lower <= 1 + 1e-9).all()
    assert (answer.preloaded.upper >= 1 - 1e-6).all()
    assert (answer.preloaded.upper <= 1.02).all()
    along = force_map(pinch(), "xy", steps=4, settings=QUICK)
    assert along.passive.unbounded.tolist() == [True, False, True, False]
    assert along.preloaded.unbounded.tolist() == [True, False, True, False]
    assert along.verdict is Verdict.HOLDS
    assert along.stop is Stop.COMPLETE
    assert answer.verdict is Verdict.HOLDS  # with the preload
    assert replace(answer, preloaded=None).verdict is Verdict.SLIPS
    assert replace(along, preloaded=None).verdict is Verdict.SLIPS  # across the fingers


def test_one_process_and_two_agree() -> None:
    one = force_map(pinch(), "xy", steps=4, settings=QUICK, jobs=1)
    two = force_map(pinch(), "xy", steps=4, settings=QUICK, jobs=2)
    assert one.to_json()["with_preload"] == two.to_json()["with_preload"]


def test_sweep_by_hand() -> None:
    """Across: the weaker finger does not limit, the other is locked and takes it: max(t, 0.1) / 0.1 * 2 mu."""
    values = [0.0, 0.05, 0.2]
    answer = sweep(pinch(), "right", values, [[0, 1, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0]], settings=QUICK, jobs=1)
    for curve in answer.curves:
        expected = np.maximum(values, 0.1) / 0.1
        assert (curve.lower <= expected * (1 + 1e-9)).all()
        assert (curve.upper >= expected * (1 - 1e-6)).all()
        assert (curve.upper <= expected * 1.02).all()
    assert [row["preload"] for row in answer.to_json()["rows"]] == values


def test_progress_counts_every_case() -> None:
    seen = []
    force_map(pinch(), steps=3, settings=QUICK, jobs=1, on_progress=lambda done, total: seen.append((done, total)))
    assert seen == [(k, 6) for k in range(1, 7)]


def test_ctrl_c_keeps_what_was_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "QUESTION_BLOCK", 2)

    def stop(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    answer = force_map(pinch(), steps=4, settings=QUICK, jobs=1, on_progress=stop)
    assert answer.stop is Stop.INTERRUPTED
    assert np.isfinite(answer.passive.upper[1]) or answer.passive.unbounded[1]
    assert answer.passive.verdicts[3] is Verdict.UNDECIDED
    assert answer.to_json()["with_preload"]["lower"] == [None] * 4


def test_refusals() -> None:
    with pytest.raises(InputError, match="plane: is 'zz'; one of xy, xz, yz is needed"):
        force_map(pinch(), "zz")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="steps: is 0; 1 to 1000000 directions"):
        force_map(pinch(), steps=0)
    with pytest.raises(InputError, match="joint: unknown actuator 'thumb'; known: right, left"):
        sweep(pinch(), "thumb", [0.1], [[0, 1, 0, 0, 0, 0]])
    with pytest.raises(InputError, match="eta: is 60 degrees"):
        force_map(pinch(), steps=4, limits=GraspLimits(eta=np.radians(60)))
    with pytest.raises(InputError, match="direction: has 2 numbers; six are needed"):
        sweep(pinch(), "left", [0.1], [[0, 1]])


def test_default_jobs() -> None:
    assert default_jobs() >= 1


def test_a_force_beside_the_origin_has_its_torque(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every case is (f, at x f); at the origin there is no torque, and the answer is the one of a plain map.

    Of a box on a table: what is asked counts, not the answer.
    """
    asked: list[np.ndarray] = []

    def watched(grasps: list[Grasp], wrenches: np.ndarray, **rest: object) -> BatchAnswer:
        asked.append(wrenches)
        return max_many(grasps, wrenches, **rest)  # type: ignore[arg-type]

    monkeypatch.setattr(maps, "max_many", watched)
    at = np.array([0.01, -0.02, 0.03])
    answer = force_map(table(), "xz", at=at, steps=4, settings=QUICK, jobs=1)
    np.testing.assert_array_equal(answer.at, at)
    assert answer.to_json()["at"] == at.tolist()
    f = answer.directions
    by_hand = [[at[1] * z - at[2] * y, at[2] * x - at[0] * z, at[0] * y - at[1] * x] for x, y, z in f]
    np.testing.assert_allclose(asked[0], np.hstack([f, by_hand]), atol=1e-18)
    origin = force_map(table(), "xz", at=(0, 0, 0), steps=4, settings=QUICK, jobs=1)
    plain = force_map(table(), "xz", steps=4, settings=QUICK, jobs=1)
    assert origin.to_json() | {"seconds": 0} == plain.to_json() | {"seconds": 0}
    assert origin.to_json()["at"] == [0, 0, 0]


def test_a_load_beyond_the_edge_tips_the_box_by_hand() -> None:
    """Four corners of a 100 mm square carry any press between them and none beyond; nothing carries a pull."""
    inside = force_map(table(), "xz", at=(0.03, 0.01, 0.2), steps=4, settings=QUICK, jobs=1)
    assert inside.passive.unbounded.tolist() == [False, False, False, True]  # down, along -z
    outside = force_map(table(), "xz", at=(0.06, 0.01, 0.2), steps=4, settings=QUICK, jobs=1)
    assert (outside.passive.upper == 0).all()
    assert outside.verdict is inside.verdict is Verdict.SLIPS


@given_settings(max_examples=5, deadline=None, derandomize=True)
@given(
    shift=st.tuples(*3 * [st.floats(-0.2, 0.2)]),
    at=st.tuples(*3 * [st.floats(-0.05, 0.05)]),
)
def test_a_map_belongs_to_the_physical_point(shift: tuple[float, ...], at: tuple[float, ...]) -> None:
    """Moving the object's origin, with the contacts, joints and the point given from the new one, changes nothing."""
    grasp, t = bell(), np.array(shift)
    contacts = [replace(c, position=c.position + t) for c in grasp.contacts]
    joints = [replace(j, origin=j.origin + t) for j in grasp.joints]
    moved = Grasp(contacts, joints, preload=grasp.preload)
    here = force_map(grasp, "xy", at=at, steps=5, settings=QUICK, jobs=1)
    there = force_map(moved, "xy", at=np.array(at) + t, steps=5, settings=QUICK, jobs=1)
    for a, b in zip(here.curves, there.curves, strict=True):
        assert a.unbounded.tolist() == b.unbounded.tolist()
        assert a.verdicts == b.verdicts
        bounded = np.logical_not(a.unbounded)
        for low, high in ((a.lower, b.upper), (b.lower, a.upper)):  # the same maximum lies between both pairs of bounds
            assert (low[bounded] <= high[bounded] * (1 + 1e-7) + 1e-12).all()


def test_refuses_a_point_that_is_none_or_that_no_force_could_balance() -> None:
    with pytest.raises(InputError, match=r"at: has shape \(2,\), needs \(3,\)"):
        force_map(pinch(), at=(0, 1), steps=2)
    with pytest.raises(InputError, match="at: contains NaN or infinity"):
        force_map(pinch(), at=(0, 0, np.nan), steps=2)
    seen: list[int] = []
    with pytest.raises(InputError, match=r"cannot be balanced by any forces at these 2 contacts"):
        force_map(pinch(), "xy", at=(0, 0, 0.01), steps=4, on_progress=lambda done, total: seen.append(done))
    assert not seen  # before any work


def test_the_command_line_maps_at_a_point(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(tmp_path / "bell.json")
    save_grasp(bell(), file)
    asked = ["map", file, "--steps", "2", "--at", "0", "0.02", "0", "--weight", "3", "--json"]
    picture, report = str(tmp_path / "m.svg"), str(tmp_path / "m.html")
    assert main([*asked, "-o", picture, "--report", report]) == 0
    assert json.loads(capsys.readouterr().out)["at"] == [0, 0.02, 0]
    assert "they act at (0, 20, 0) mm. A weight of 3 N:" in Path(report).read_text("utf-8")
    for wrong, says in (("0", "--weight: is 0; a force above 0"), ("nan", "--weight: is nan; a force above 0")):
        assert main(["map", file, "--weight", wrong]) == 2
        assert says in capsys.readouterr().err
    assert main(["map", file, "--at", "0", "1"]) == 2
    assert "three are needed, X Y Z" in capsys.readouterr().err
