"""Result files and `verify`: what is saved replays without engine or solver."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import handfast
from handfast import verify
from handfast.cli import main
from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.proofs.certificate import file_to_dict
from handfast.stability.answers import CheckAnswer
from handfast.stability.problem.witness import VALID
from handfast.stability.studies.questions import check, torques
from tests.support.problems import bell, pinch
from tests.support.saved_answers import ANSWERS, answer, text


@pytest.mark.parametrize("name", ANSWERS)
@pytest.mark.slow
def test_what_is_saved_is_proved(name: str, tmp_path: Path) -> None:
    a, path = answer(name), tmp_path / "r.json"
    a.save(path)
    done = verify(path)
    assert done.ok, done.reason
    witness, certificate = done.part("witness"), done.part("certificate")
    assert (witness is not None) == (a.verdict is Verdict.HOLDS)
    assert witness is None or witness.figures["residual"] <= VALID
    assert witness is None or witness.figures["exact"] == a.exact
    assert (certificate is not None) == (a.certificate is not None)
    assert a.verdict is not Verdict.SLIPS or certificate is not None
    assert done.to_json() == verify(a).to_json()  # every bit comes back
    assert json.loads(path.read_text())["answer"] == a.to_json()
    with pytest.raises(InputError, match=r"r\.json: exists already"):
        a.save(path)


@pytest.mark.slow
def test_the_sample_has_every_verdict() -> None:
    assert {(a.to_json()["query"], a.verdict) for a in map(answer, ANSWERS)} >= {
        (query, verdict) for query in ("check", "max", "torques") for verdict in (Verdict.HOLDS, Verdict.SLIPS)
    }
    assert answer("undecided").verdict is Verdict.UNDECIDED
    assert answer("max cut short").stop is Stop.NODES


# --- what verify takes ----------------------------------------------------------------------------------


def test_a_bare_certificate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    c = answer("max").certificate
    assert c is not None
    (tmp_path / "c.json").write_text(json.dumps(file_to_dict(c, json.loads(text("max"))["question"])))
    done = verify(tmp_path / "c.json")
    assert done.ok
    assert done.part("witness") is None
    part = done.part("certificate")
    assert part is not None
    assert part.figures["leaves"] == len(c.leaves)
    assert "times the preload" in part.claim
    assert main(["verify", str(tmp_path / "c.json")]) == 0
    assert "PROVED  certificate of bell" in capsys.readouterr().out


def test_an_answer_that_knows_no_question_is_not_saved(tmp_path: Path) -> None:
    bare = CheckAnswer(Verdict.UNDECIDED, Stop.TIME, 0.0, 0, None, None)
    with pytest.raises(InputError, match="answer: does not know its question"):
        bare.save(tmp_path / "r.json")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.pop("schema"), "schema: is missing; 'handfast/result/1' or 'handfast/certificate/1' or "),
        (lambda d: d.update(schema="handfast/grasp/1"), "schema: is 'handfast/grasp/1'; 'handfast/result/1' or"),
        (lambda d: d.update(schema="handfast/grasp/1"), "is needed; this is a grasp .*, which claims nothing"),
        (lambda d: d.update(schema="handfast/loads/1"), "schema: is 'handfast/loads/1'; 'handfast/result/1' or"),
        (lambda d: d.update(schema="handfast/loads/1"), "is needed; this is a file of loads, which claims nothing"),
        (lambda d: d.update(colour=1), "colour: is not a known field"),
        (lambda d: d["answer"].update(query="map"), "answer"),
        (lambda d: d["answer"].update(verdict="maybe"), "answer.*verdict"),
        (lambda d: d["witness"].update(wrench=[1.0]), r"witness.wrench"),
        (lambda d: d["witness"].update(c=[1.0]), "witness.c: has 1 numbers; 12 are needed"),
        (lambda d: d["witness"]["command"].update(thumb=1), "witness.command: are not those of the actuators"),
        (lambda d: d["certificate"].pop("leaves"), "certificate.leaves: is missing"),
        (lambda d: d["question"].update(goal="guess"), "question.goal"),
        (lambda d: d["question"]["grasp"].pop("contacts"), "question.grasp.contacts: is missing"),
    ],
)
def test_bad_files_are_one_line(change, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = json.loads(text("max"))
    change(data)
    path = tmp_path / "r.json"
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match=message):
        verify(path)
    assert main(["verify", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"handfast: {path}: ")
    assert said.count("\n") == 1


def test_it_needs_neither_engine_nor_solver(tmp_path: Path) -> None:
    answer("max").save(tmp_path / "r.json")
    code = (
        "import sys, handfast; done = handfast.verify(sys.argv[1]); assert done.ok, done.reason;"
        "names = ('numba', 'llvmlite', 'scipy', 'pyscipopt', 'gurobipy', 'highspy', 'handfast.stability.search');"
        "sys.exit(' '.join(n for n in names if n in sys.modules) or 0)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "r.json")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_on_the_command_line(tmp_path: Path, monkeypatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    handfast.save_grasp(bell(), "bell.json")
    asked = [["check", "--wrench", "0", "2.3", "0"], ["max", "--direction", "0", "1", "0"]]
    for command, *options in [*asked, ["torques", "--wrench", "0", "1", "0"]]:
        question = [command, "bell.json", *options, "--save", f"{command}.json"]
        assert main(question) == 0
        assert f"Written: {command}.json" in capsys.readouterr().out
        assert main(question) == 2
        assert "exists already; give --force" in capsys.readouterr().err
        assert main([*question, "--force", "--json"]) == 0
        said = json.loads(capsys.readouterr().out)
        assert said["certified"] is True
        assert said["verified"] is True
        assert said["motion_cap"] is None
        assert main(["verify", f"{command}.json"]) == 0
        out = capsys.readouterr().out
        assert out.startswith(f"PROVED  {command} of bell: ")
        assert "leaves, margin" in out
    assert main(["check", "bell.json", "--wrench", "0", "1", "0", "--save", "a.txt"]) == 2
    assert "a.txt: a name that ends in .json is needed" in capsys.readouterr().err

    assert main(["check", "bell.json", "--wrench", "0", "2.3", "0", "--nodes", "1", "--save", "open.json"]) == 3
    assert main(["verify", "open.json"]) == 0
    assert "NOTHING CLAIMED  check of bell: UNDECIDED, stop nodes" in capsys.readouterr().out

    data = json.loads(Path("max.json").read_text())
    assert data["answer"]["upper"] == pytest.approx(data["answer"]["lower"], rel=1e-3)
    data["answer"]["upper"] -= 0.5 * (data["answer"]["upper"] - data["answer"]["lower"])
    Path("wrong.json").write_text(json.dumps(data))
    assert main(["verify", "wrong.json"]) == 1
    out = capsys.readouterr().out
    assert out.startswith("REFUSED  max of bell")
    assert "certificate: it covers" in out
    assert main(["verify", "wrong.json", "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert (said["schema"], said["ok"]) == ("handfast/verification/1", False)
    assert {part["name"]: part["ok"] for part in said["parts"]} == {"witness": True, "certificate": False}


@pytest.mark.parametrize("ask", ["check", "torques"])
def test_what_is_proved_is_about_the_load_as_it_was_asked(ask: str) -> None:
    """The load of a state that was found may be off by rounding: `verify` asks about that of the file."""
    load = np.array([0, 0.3, 0.1, 0, 0, 0.0])
    answer = check(pinch(), load) if ask == "check" else torques(pinch(), load)
    assert answer.found is not None
    off = replace(answer, found=replace(answer.found, wrench=np.nextafter(load, 1)))
    assert np.array_equal(off._problem(off.found).load, load)
