"""Maps and sweeps: many maxima, in order, on all cores, without a lost one."""

from __future__ import annotations

import numpy as np
import pytest

from holdfast.answer import Stop, Verdict
from holdfast.errors import InputError
from holdfast.stability.many import default_jobs
from holdfast.stability.maps import force_map, sweep
from holdfast.stability.settings import Settings
from problems import pinch

QUICK = Settings(sectors=64, gap=1e-2, time_limit=30)


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
    force_map(pinch(), steps=3, settings=QUICK, jobs=1, on_item=lambda done, total: seen.append((done, total)))
    assert seen == [(k, 6) for k in range(1, 7)]


def test_ctrl_c_keeps_what_was_reached() -> None:
    def stop(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    answer = force_map(pinch(), steps=4, settings=QUICK, jobs=1, on_item=stop)
    assert answer.stop is Stop.INTERRUPTED
    assert np.isfinite(answer.passive.upper[1]) or answer.passive.unbounded[1]
    assert answer.passive.verdicts[3] is Verdict.UNDECIDED
    assert answer.to_json()["with_preload"]["lower"] == [None] * 4


def test_refusals() -> None:
    with pytest.raises(InputError, match="plane: is 'zz'; one of xy, xz, yz is needed"):
        force_map(pinch(), "zz")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="steps: is 0; at least 1 direction"):
        force_map(pinch(), steps=0)
    with pytest.raises(InputError, match="joint: unknown actuator 'thumb'; known: right, left"):
        sweep(pinch(), "thumb", [0.1], [[0, 1, 0, 0, 0, 0]])
    with pytest.raises(InputError, match="eta: is 60 degrees"):
        force_map(pinch(), steps=4, eta=np.radians(60))
    with pytest.raises(InputError, match="direction: has 3 numbers; six are needed"):
        sweep(pinch(), "left", [0.1], [[0, 1, 0]])


def test_default_jobs() -> None:
    assert default_jobs() >= 1
