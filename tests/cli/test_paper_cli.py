"""`handfast paper`: the list, tables and figures, and the papers' own methods."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handfast.cli import main
from handfast.model.grasp import Contact, Grasp
from handfast.papers import mixed_integer_solvers
from handfast.papers.exhibits import EXHIBITS
from handfast.papers.methods import METHODS
from handfast.readers.grasp_file import save_grasp

needs_solver = pytest.mark.skipif(not mixed_integer_solvers.available("scip"), reason="pyscipopt is not installed")


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def asked(capsys: pytest.CaptureFixture[str], *words: str) -> dict:
    """The JSON of an answer."""
    status = main(["paper", *words, "--json"])
    out, err = capsys.readouterr()
    assert (status, err) == (0, "")
    return json.loads(out)


def test_the_list_names_everything(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["paper"]) == 0
    out = capsys.readouterr().out
    for name in (*EXHIBITS, *METHODS):
        assert f"  {name} " in out
    listed = asked(capsys)
    assert list(listed["exhibits"]) == list(EXHIBITS)
    assert listed["methods"]["canonical"]["about"] == "task"


def test_a_figure_is_written_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["paper", "fig3", "-o", "other.svg", "--quick"]) == 0
    assert Path("other.svg").read_text("utf-8").startswith("<?xml")
    assert main(["paper", "fig3"]) == 0
    assert Path("fig3.svg").exists()
    assert main(["paper", "fig3"]) == 2
    assert "fig3.svg: exists already; give --force" in capsys.readouterr().err


def test_a_table_is_printed_and_written(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["paper", "regions-table1", "-o", "hands.md"]) == 0
    assert "Robonaut" in capsys.readouterr().out
    assert Path("hands.md").read_text("utf-8").count("\n| ") == 12
    assert len(asked(capsys, "regions-table3")["table"]) == 17


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["fig99"], "unknown table, figure or method 'fig99'"),
        (["regions-fig4"], "regions-fig4: is a sketch without data; see (15), (16)"),
        (["fig8", "fig9"], "fig8 is made from bundled data alone"),
        (["fig8", "-o", "fig8.txt"], "fig8.txt: a name that ends in .svg or .png is needed"),
        (["regions-table1", "-o", "a.png"], "a.png: a name that ends in .md is needed"),
        (["fig8", "--json"], "--json: means nothing to fig8, which takes --force, --output, --quick, --steps"),
        (["fig2", "--steps", "3"], "--steps: means nothing to fig2"),
        (["regions-table1", "--eta", "3"], "--eta: means nothing to regions-table1, which takes --force, --json"),
        (["--eta", "3"], "--eta: means nothing to the list, which takes --json"),
        (["canonical", "scalpel-upholding", "--timeout", "3"], "--timeout: means nothing to canonical"),
        (["pyramids", "fig9", "--wrench", "0", "1", "0", "--plane", "xy"], "--plane: means nothing to pyramids"),
        (["algorithm1", "fig9", "--direction", "0", "1", "0", "--least"], "--least: is for --wrench; give both"),
        (["algorithm1", "fig9", "--wrench", "0", "1", "0", "--base", "0", "1", "0"], "--base: is for --direction or"),
        (["algorithm1", "fig9", "--wrench", "0", "1", "0", "--steps", "3"], "--steps: is for --plane; give both"),
        (["algorithm1", "fig9", "--wrench", "0", "1", "0", "--plane", "xy"], "--plane: asks in all directions"),
        (["algorithm1"], "missing: GRASP, a file or the name of a bundled one"),
        (["box-shrinking"], "missing: TASK"),
        (["algorithm1", "fig9"], "give either --direction"),
        (["algorithm1", "fig9", "--direction", "0", "1", "0", "--sectors", "100"], "sectors: is 100; 4, 8, 16"),
        (["pyramids", "fig9"], "--wrench: is missing"),
        (["pyramids", "fig9", "--wrench", "0", "1", "0", "--edges", "3"], "edges: is 3"),
        (["planar", "fig9", "--wrench", "0", "1", "0"], "contacts[0]: is not in the plane z = 0"),
    ],
)
def test_what_cannot_be_done_is_one_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["paper", *words]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert said in err


@pytest.mark.optional
@needs_solver
def test_algorithm_1_on_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    coarse = ["--sectors", "32"]
    most = asked(capsys, "algorithm1", "fig9", "--direction", "0", "-1", "0", *coarse)
    assert most["verdict"] == "holds"
    assert most["lower"] <= 1.46994
    assert most["upper"] >= 1.46847
    assert most["steps"][-1]["program"] == "optimal"
    assert asked(capsys, "algorithm1", "fig9", "--wrench", "0", "-1.4", "0", *coarse)["verdict"] == "holds"
    least = asked(capsys, "algorithm1", "fig9", "--wrench", "0", "-1.2", "0", "--least", *coarse)
    assert 0 < least["upper"] < 0.1
    plane = asked(capsys, "algorithm1", "fig1", "--plane", "xy", "--steps", "2", "--sectors", "8")["directions"]
    assert [row["angle"] for row in plane] == [0, 180]


@pytest.mark.optional
@needs_solver
def test_algorithm_1_tells_its_steps(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["paper", "algorithm1", "fig1", "--wrench", "0", "9", "0", "--sectors", "16"]) == 3
    out = capsys.readouterr().out
    assert out.startswith("UNDECIDED  ")
    assert "a solution at the finest of 16 sectors" in out
    assert "Algorithm 1 on scip: " in out
    assert "widest active sector" in out


@pytest.mark.parametrize("solver", mixed_integer_solvers.SOLVERS)
def test_a_missing_solver_is_one_line(
    solver: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mixed_integer_solvers, "available", lambda solver: False)
    assert main(["paper", "algorithm1", "fig1", "--wrench", "0", "1", "0", "--solver", solver]) == 2
    said = f"'{solver}' is not installed; Algorithm 1 on it needs pip install 'handfast[reference]'"
    assert said in capsys.readouterr().err


def test_older_methods(capsys: pytest.CaptureFixture[str]) -> None:
    pyramids = asked(capsys, "pyramids", "fig9", "--wrench", "0", "-1.4", "0", "--edges", "4")
    assert pyramids["verdict"] == "slips"
    assert pyramids["unbalanced"] > 0.1


def test_a_planar_grasp(capsys: pytest.CaptureFixture[str]) -> None:
    """Against a wall on the left and a floor: any push into the corner is held, no pull is."""
    contacts = [Contact([-0.5, 0, 0], [1, 0, 0], 0.5), Contact([0, -0.5, 0], [0, 1, 0], 0.5)]
    save_grasp(Grasp(contacts, name="corner"), "corner.json")
    assert asked(capsys, "planar", "corner.json", "--direction", "-1", "-1", "0")["ranges"] == [[0.0, None]]
    assert asked(capsys, "planar", "corner.json", "--wrench", "1", "1", "0")["verdict"] == "slips"


def test_the_canonical_system(capsys: pytest.CaptureFixture[str]) -> None:
    sizes = asked(capsys, "canonical", "scalpel-upholding")
    assert (sizes["n_v"], sizes["n_e"], sizes["d"]) == (219, 209, 17)


@pytest.mark.slow
def test_box_shrinking(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("highspy")
    assert main(["paper", "box-shrinking", "scalpel-upholding", "--timeout", "0.01", "--json"]) == 3
    found = json.loads(capsys.readouterr().out)
    assert (found["pending"], found["solution_boxes"]) == (1, 0)
    assert found["discarded"] < 1
