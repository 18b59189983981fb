"""A slow motion that goes on from where a load's path ends: what it begins with is known by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import Settings, load_grasp
from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.pictures.motion_picture import details
from handfast.proofs.fields import BadFile
from handfast.simulation.settled import Rest, replay_settled, verdict_of
from handfast.simulation.settling import LOADS, NO_STATE, GraspInScene, settle
from handfast.stability.studies.ask_again import Asking
from handfast.stability.studies.questions import check
from tests.support.program import run
from tests.support.slides import pinch_of_balls

FIRST: Any = {"loading": "preload-first", "judge": False}
BACK = np.array([1.0, 0, 1.0])  # pushes the finger back and across


def pinched() -> GraspInScene:
    """1 N between a finger on a slide and the palm, mu = 0.5: `jaw` of tests/stability/answers/test_load_path.py."""
    return pinch_of_balls(0.5, 1.0)


def test_it_begins_with_the_last_state_of_the_path() -> None:
    """Under 0.6 (1, 0, 1) the path holds: the finger presses with 1 + 0.3, the palm with 1 - 0.3.

    The finger closed by 2 N of unit springs in the squeeze, and stands; the object gave way by 1 N towards the palm
    then, and by 0.3 back; both sides stick, so that nothing moves across.
    """
    placed = pinched()
    found = settle(placed, 0.6 * BACK, follow=True, **FIRST)
    assert verdict_of(found.before) is Verdict.HOLDS
    assert (found.rest, found.onset) == (Rest.SETTLES, None)
    rest, begun, *after = found.path
    assert (rest.share, rest.moved, begun.share) == (0.0, 0.0, 1.0)
    assert begun.links == ("palm", "finger")
    assert begun.forces == pytest.approx([0.7, 1.3], abs=1e-6)
    assert begun.q[0] / (begun.pose[0, 3] / -0.7) == pytest.approx(2.0, rel=1e-5)
    assert begun.pose[:3, 3] == pytest.approx([-0.7 * begun.q[0] / 2, 0, 0], abs=1e-9)
    assert 1e-6 < begun.q[0] < 1e-4
    assert [p.share for p in after] == [1.0] * len(after)
    assert len(after) == 3  # nothing moves: three whole steps are rest
    assert after[-1].forces == pytest.approx([0.7, 1.3], rel=5e-3)
    assert found.gone_on_at == 1.0


def test_from_rest_it_has_more_steps_and_no_such_beginning() -> None:
    found = settle(pinched(), 0.6 * BACK, judge=False)
    assert verdict_of(found.before) is Verdict.SLIPS
    assert found.path[1].share == 0
    assert found.gone_on_at is None
    assert not any("goes on" in line for line in details(found))
    assert "loading" not in found.to_json()


def test_it_goes_on_with_the_load_of_the_last_state_and_gives_way_where_the_path_ends() -> None:
    """The path ends at 2/3 (1, 0, 1); of 1.5 (1, 0, 1) that is 0.444, and the last step before may be far below."""
    found = settle(pinched(), 1.5 * BACK, **FIRST)
    path = check(pinched().grasp, 1.5 * BACK, loading="preload-first").path
    assert found.gone_on_at == path.reached < 2 / 3 / 1.5
    assert found.path[1].forces == pytest.approx([1 - 0.75 * path.reached, 1 + 0.75 * path.reached], abs=1e-6)
    assert all(p.moved < 1e-5 for p in found.path if p.share < 2 / 3 / 1.5)
    assert next(p.share for p in found.path if p.moved > 5e-5) == pytest.approx(2 / 3 / 1.5, abs=1 / LOADS)
    assert found.rest is Rest.SETTLES  # it tilts, so that one side rubs more than the other
    shares = [p.share for p in found.path]
    assert shares == sorted(shares)
    assert any("goes on from where the load's path ends, at 25 % of the load" in line for line in details(found))


def test_a_hand_of_several_joints_begins_as_deep_as_its_springs_are_pressed() -> None:
    """Each contact presses as the path says, so all joints turned in their senses, and the object with them."""
    grasp = load_grasp("fig9")
    found = settle(grasp, [0, 3.4, 0], steps=2, **FIRST)
    begun, first = found.path[1:3]
    assert begun.share == 13 / 16
    assert begun.links == tuple(str(c.link) for c in grasp.contacts)
    assert first.forces == pytest.approx(begun.forces, abs=0.01)
    assert begun.moved == pytest.approx(1.41e-5, rel=0.1)


def test_without_a_state_of_the_commands_it_is_followed_from_rest() -> None:
    """Commands alone that nothing opposes: the finger pushes the object away from a palm that is not there."""
    placed = pinched()
    alone = replace(placed, grasp=replace_contacts(placed, keep="finger"))
    found = settle(alone, [0.5, 0, 0], steps=3, **FIRST)
    assert NO_STATE in found.notes
    assert found.path[1].share == 0
    assert found.gone_on_at is None


def replace_contacts(placed: GraspInScene, keep: str) -> Any:
    from handfast import Grasp

    g = placed.grasp
    kept = [i for i, c in enumerate(g.contacts) if c.link == keep]
    joints = [replace(j, moves=tuple(kept.index(i) for i in j.moves if i in kept)) for j in g.joints]
    return Grasp([g.contacts[i] for i in kept], joints, g.mechanism, g.preload, g.name)


@pytest.mark.slow
def test_both_grasps_are_asked_on_paths_and_the_file_says_so() -> None:
    found = settle(pinched(), 0.6 * BACK, loading="preload-first", follow=True, settings=Settings(gap=0.2))
    assert found.after is not None
    assert found.after.path is not None
    assert found.most is not None
    assert found.most.path is not None
    data = found.to_json()
    assert data["loading"] == "preload-first"
    done = replay_settled(data, Asking(jobs=1))
    assert done.ok, done.reason
    together = {k: v for k, v in data.items() if k != "loading"}
    assert "before: is 'holds'; asked again, it slips" in replay_settled(together, Asking(jobs=1)).fault
    with pytest.raises(BadFile, match="loading: is 'later'"):
        replay_settled(data | {"loading": "later"}, Asking(jobs=1))


def test_another_word_is_refused() -> None:
    with pytest.raises(InputError, match="'later'; 'preload-first' or 'together'"):
        settle(pinched(), BACK, loading="later")  # type: ignore[arg-type]


def test_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["settle", "fig9", "--wrench", "0", "3.4", "0", "--loading", "preload-first", "--steps", "2", "--no-judge"]
    status, out, err = run(capsys, *asked, "-o", str(tmp_path / "settled"))
    assert status == 3, err
    assert "It goes on from where the load's path ends, at 81.25 % of the load." in out
    status, out, _ = run(capsys, "verify", str(tmp_path / "settled" / "settled.json"), "--replay")
    assert status == 0
    assert "first the squeeze, then the load" in out
