"""The command line: check, max, torques, map and sweep, as JSON and as tables."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from handfast.cli.app import parse
from handfast.planning.question import PlanOptions
from handfast.readers.load_hand import load_hand
from tests.support.program import ask, complains, run

QUICK = ["--gap", "0.02"]
COMMON = {"schema", "query", "verdict", "stop", "seconds", "nodes"}
PROOF = {"certified", "verified", "motion_cap", "exact", "motion"}


def test_check(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    holds = ask(capsys, "check", grasp, "--wrench", "0", "2.2", "0", "0", "0", "0")
    keys = PROOF | {"residual", "contacts", "joint_torques", "object_motion", "joint_motion", "margin"}
    assert COMMON | keys <= set(holds)
    assert holds["verdict"] == "holds"
    assert holds["stop"] == "complete"
    assert holds["residual"] < 1e-9
    assert {"force", "motion", "state"} <= set(holds["contacts"][0])
    assert {c["state"] for c in holds["contacts"]} <= {"open", "stick", "slide"}
    assert np.sum([c["force"] for c in holds["contacts"]], axis=0) == pytest.approx([0, -2.2, 0])

    slips = ask(capsys, "check", grasp, "--wrench", "0", "2.5", "0")
    assert set(slips) == set(holds)
    assert slips["verdict"] == "slips"
    assert (holds["certified"], slips["certified"]) == (False, True)
    assert (holds["verified"], slips["verified"]) == (True, True)
    assert isinstance(holds["exact"], bool)
    assert slips["exact"] is None


def test_max(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "max", grasp, "--direction", "0", "1", "0", *QUICK)
    assert COMMON | PROOF | {"lower", "upper", "gap", "unbounded", "holds_from_zero_to", "attained", "limit"} == set(
        answer
    )
    # each finger's command turns it about its joint: normal and friction force at full strength at the
    # tip, n (0.093 - 0.003 mu) = 0.1 N m, so 2 mu n = 2.222 N in all; answers take 1e-9 of it off
    assert answer["lower"] == pytest.approx((1 - 1e-9) * 2 * 0.1 / (0.093 - 0.003), rel=1e-10)
    assert answer["lower"] <= answer["upper"] <= 1.02 * answer["lower"]
    assert answer["gap"] == pytest.approx(answer["upper"] / answer["lower"] - 1)
    assert answer["holds_from_zero_to"] is None


def test_max_without_bound(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    asked = "max", grasp, "--no-preload", "--direction", "0", "-1", "0", *QUICK
    status, out, _ = run(capsys, *asked, "--save", "max.json")
    assert status == 0
    answer = json.loads(Path("max.json").read_text())["answer"]
    assert (answer["verdict"], answer["unbounded"], answer["upper"]) == ("holds", True, None)
    assert "force along −y of any size is resisted" in out


def test_max_with_a_constant_load(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "max", grasp, "--direction", "0", "1", "0", "--base", "0", "-1", "0", *QUICK)
    assert answer["lower"] == pytest.approx(3.2222, rel=0.02)


def test_torques(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "torques", grasp, "--wrench", "0", "2", "0", *QUICK)
    assert COMMON | PROOF | {"preload", "lower", "upper"} == set(answer)
    assert answer["upper"] == pytest.approx(0.09, rel=1e-4)  # raised by up to a tenth of the gap, so that a check holds
    assert max(answer["preload"].values()) == pytest.approx(answer["upper"])


def test_tables_say_the_verdict_first(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "check", grasp, "--wrench", "0", "1", "0", *QUICK)
    assert (status, err) == (0, "")
    assert out.startswith("HOLDS  The grasp resists 1 N along +y")
    assert "right_distal" in out
    assert "0.1 N·m" in out
    status, out, _ = run(capsys, "check", grasp, "--no-preload", "--wrench", "0", "1", "0", *QUICK)
    assert status == 0
    assert out.startswith("SLIPS")
    assert "every actuator is locked" in out
    status, out, _ = run(capsys, "torques", grasp, "--wrench", "0", "2", "0", *QUICK)
    assert "largest command that 2 N along +y needs is 0.09" in out


def test_without_dissipation_it_holds_but_is_called_unphysical(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    question = ["check", grasp, "--no-preload", "--no-mdp", "--wrench", "0", "10", "0", *QUICK]
    assert ask(capsys, *question)["verdict"] == "holds"
    status, out, _ = run(capsys, *question)
    assert status == 0
    assert out.startswith("HOLDS?")
    assert "not physical" in out


def test_preload_replaces_that_of_the_file(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    question = ["max", grasp, "--direction", "0", "1", "0", *QUICK]
    double = ask(capsys, *question, "--preload", "left=0.2", "right=0.2")
    again = ask(capsys, *question, "--preload", "left=0.2", "--preload", "right=0.2")
    assert double["lower"] == pytest.approx(2 * 2.2222, rel=1e-4)
    assert again["lower"] == double["lower"]


def test_friction_and_limits(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    question = ["max", grasp, "--direction", "0", "1", "0", *QUICK]
    assert ask(capsys, *question, "--friction", "0.5")["lower"] < 1.2
    limited = ask(capsys, *question, "--force-limit", "0.5")
    # a limit on the normal forces leaves the contacts less than the commands would press
    assert limited["verdict"] in ("slips", "holds", "undecided")
    assert limited["lower"] <= 2.23


def test_a_limit_below_the_preload_is_named(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    """It contradicts the commands: the grasp does not slip by itself."""
    asked = ["check", grasp, "--wrench", "0", "1", "0", *QUICK]
    status, out, _ = run(capsys, *asked, "--torque-limit", "left=0.05")
    assert (status, out.split()[0]) == (0, "SLIPS")
    assert "left is commanded 0.1 N·m and may carry 0.05 N·m: no state has both." in out
    assert "Without the limits (--torque-limit, --force-limit) it is resisted." in out
    assert "its own forces do not balance" not in out
    _, out, _ = run(capsys, "torques", grasp, "--wrench", "0", "1", "0", "--torque-limit", "left=0.05", *QUICK)
    assert "no state has both" not in out  # other commands are sought


def test_a_sweep_tells_how_many_of_its_cases_slip(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A third finger that presses much harder than the others throws the object out; the page says the same."""
    monkeypatch.chdir(tmp_path)
    commands = ["--joint", "finger_3_prox", "--from", "0.03", "--to", "0.12", "--steps", "2"]
    _, out, _ = run(
        capsys, "sweep", "fig11", *commands, "--direction", "0", "0", "0", "1", "0", "0", *QUICK, "--report", "p.html"
    )
    text = "The command of finger_3_prox varies: something is resisted in 1 of 2 cases."
    assert out.startswith(f"SLIPS IN 1 OF 2  {text}")
    assert f'<b class="slips">SLIPS IN 1 OF 2</b><span>{text}</span>' in Path("p.html").read_text()


def test_undecided_is_status_3(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "check", grasp, "--wrench", "0", "2.2", "0", "--timeout", "1e-6", status=3)
    assert (answer["verdict"], answer["stop"]) == ("undecided", "time")
    status, out, _ = run(capsys, "check", grasp, "--wrench", "0", "2.2", "0", "--timeout", "1e-6")
    assert status == 3
    assert out.startswith("UNDECIDED")
    assert "--timeout" in out


def test_a_node_limit_is_undecided_too(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    question = ["max", grasp, "--direction", "0", "1", "0", "--nodes", "1", "--gap", "1e-12"]
    assert ask(capsys, *question, status=3)["stop"] == "nodes"
    status, out, _ = run(capsys, *question)
    assert status == 3
    assert "The node limit of 1 was hit; a larger --nodes may decide it." in out


# --- maps and sweeps ----------------------------------------------------------------------------


def test_map_writes_what_it_answers(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "map", grasp, "--plane", "xy", "--steps", "4", "-o", "map.csv", *QUICK)
    assert COMMON | {"plane", "directions", "without_preload", "with_preload"} <= set(answer)
    assert {"lower", "upper", "unbounded"} <= set(answer["with_preload"])
    assert answer["with_preload"]["lower"][1] == pytest.approx(2.2222, rel=1e-4)
    assert answer["with_preload"]["unbounded"][3] is True
    assert answer["without_preload"]["lower"][1] == 0
    lines = Path("map.csv").read_text().splitlines()
    heads = lines[0].split(",")
    for i, line in enumerate(lines[1:]):
        row = dict(zip(heads, line.split(","), strict=True))
        assert [float(row[k]) for k in ("dx", "dy", "dz")] == answer["directions"][i]
        for name in ("without", "with"):
            curve = answer[f"{name}_preload"]
            assert float(row[f"lower_{name}_preload"]) == curve["lower"][i]
            upper = row[f"upper_{name}_preload"]
            assert (float(upper) if upper else None) == curve["upper"][i]
            assert row[f"unbounded_{name}_preload"] == str(curve["unbounded"][i]).lower()
    assert len(lines) == 5


def test_map_table_and_picture(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "map", grasp, "--steps", "2", "-o", "map.json", "--report", "map.html", *QUICK)
    assert (status, err) == (0, "")
    assert "2 directions of force in the xy plane" in out
    assert json.loads(Path("map.json").read_text())["query"] == "map"
    assert "data:image/svg+xml;base64," in Path("map.html").read_text()


def test_sweep(grasp: str, capsys: pytest.CaptureFixture[str]) -> None:
    question = ["sweep", grasp, "--joint", "left", "--from", "0.1", "--to", "0.2", "--steps", "2"]
    question += ["--direction", "0", "1", "0", "--direction", "0", "-1", "0", "0", "0", "0", *QUICK]
    answer = ask(capsys, *question, "-o", "sweep.csv")
    assert COMMON | {"question", "joint", "directions", "rows"} == set(answer)
    assert [r["preload"] for r in answer["rows"]] == [0.1, 0.2]
    assert answer["rows"][0]["lower"][0] == pytest.approx(2.2222, rel=1e-4)
    assert answer["rows"][0]["unbounded"] == [False, True]
    lines = [line.split(",") for line in Path("sweep.csv").read_text().splitlines()]
    assert lines[0] == ["left", "lower_1", "upper_1", "unbounded_1", "lower_2", "upper_2", "unbounded_2"]
    for row, line in zip(answer["rows"], lines[1:], strict=True):
        assert [float(line[0]), float(line[1]), float(line[2])] == [
            row["preload"],
            row["lower"][0],
            row["upper"][0],
        ]
        assert line[5] == ""


def test_torque_limits_as_the_file_of_the_hand_states_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same as by name; one by name comes first; what knows no hand, or a hand without, is refused."""
    monkeypatch.chdir(tmp_path)
    asked = ("max", "barrett-can", "--direction", "0", "0", "-1", *QUICK, "--save", "max.json", "--force")
    motors = ("finger_1_spread", "finger_1_prox", "finger_2_prox", "finger_3_prox")

    def limits(*given: str) -> dict[str, float]:
        assert run(capsys, *asked, "--torque-limit", *given)[0] == 0
        return json.loads(Path("max.json").read_text())["question"]["torque_limits"]

    assert limits("hand") == dict.fromkeys(motors, 5)
    assert limits("hand", "finger_1_prox=2") == dict.fromkeys(motors, 5) | {"finger_1_prox": 2}
    direction = ("--direction", "0", "0", "1", "--torque-limit", "hand")
    complains(
        capsys, ["max", "four-feet", *direction], ["step-ground: --torque-limit: states no strength of its motors"]
    )
    complains(capsys, ["max", "tendon-fingers", *direction], ["does not say which hand it came from"])
    assert "motors at most  5 N·m each, by its file" in run(capsys, "show", "barrett-bh8-280")[1]


def test_searches_take_the_strengths_of_their_hand() -> None:
    told = parse(["plan", "tendon-hand", "ball", "--torque-limit", "left=90", "hand"])
    limits = told.options(PlanOptions, lambda: load_hand("tendon-hand")).limits
    assert limits.torque_limits == {"thumb": 200, "left": 90, "right": 200}
