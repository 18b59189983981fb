"""The documentation is true: snippets run, commands answer, formats load, every option is described.

A page's snippets run in the order in which they stand, in one temporary folder and one namespace:

- ```python is executed,
- ```console: every line `$ handfast ...` must end with exit status 0,
- ```json title="NAME" is written to NAME and loaded as what its schema says,
- ```xml title="NAME" is written to NAME and loaded as a hand.

`<!-- not run: reason -->` on the line before a block leaves it out.
"""

from __future__ import annotations

import ast
import contextlib
import importlib.util
import io
import itertools
import json
import re
import shlex
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, get_type_hints

import pytest

import handfast
from handfast import Loads, hold, maximum
from handfast.cli import main
from handfast.cli.app import ALIASES, COMMAND_CLASSES, command, option_name
from handfast.core.files import Strict
from handfast.core.schema import InFiles
from handfast.datasets.published.mapping_file import read_mapping
from handfast.model.configuration import Configuration
from handfast.proofs import configurations
from handfast.proofs.certificate import NODE_ARRAYS, ROW_ARRAYS, file_to_dict
from handfast.proofs.states import State
from handfast.readers.configuration_file import load_configuration
from handfast.readers.grasp_file import GraspFile, load_grasp
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.readers.region_file import REGION_KINDS, load_hand_regions
from handfast.stability.problem.loads import load_loads
from handfast.synthesis.synthesis_file import SynthesisAnswerEntry, SynthesisFile, SynthesisStateEntry
from handfast.synthesis.task_file import TaskFile, load_task
from tests.support.places import ROOT

DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(p for p in DOCS.glob("**/*.md") if not p.name.startswith("benchmarks"))]
LOADERS: dict[str, Callable[[str], object]] = {
    "handfast/grasp/1": load_grasp,
    "handfast/configuration/1": load_configuration,
    "handfast/body/1": load_body,
    "handfast/task/1": load_task,
    "handfast/loads/1": load_loads,
    "handfast/hand-regions/1": load_hand_regions,
    "handfast/mapping/1": read_mapping,
}
BLOCK = re.compile(
    r"(?:^<!-- not run: (?P<skip>[^\n]+) -->\n)?^```(?P<kind>\w+)(?P<rest>[^\n]*)\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    kind: str
    title: str
    text: str
    skip: str
    line: int

    def commands(self) -> list[list[str]]:
        """The arguments of every `$ handfast ...` line."""
        words = [shlex.split(line[2:]) for line in self.text.splitlines() if line.startswith("$ ")]
        return [w[1:] for w in words if w[0] == "handfast"]


def blocks(page: Path) -> list[Block]:
    text = page.read_text("utf-8")
    found = []
    for m in BLOCK.finditer(text):
        title = re.search(r'title="([^"]+)"', m["rest"])
        line = text.count("\n", 0, m.start("text")) + 1
        found.append(Block(m["kind"], title[1] if title else "", m["text"], m["skip"] or "", line))
    return found


def runnable(page: Path) -> bool:
    return any(b.kind in ("python", "console", "json", "xml") and not b.skip for b in blocks(page))


SLOW = (
    *("README", "command-line", "simulation", "robustness", "grasps", "answers", "index", "paper-grasps", "settling"),
    *("datasets", "tendon-hand", "soft-fingers", "fixture", "measures", "load-path", "tutorial", "no-grasp"),
    *("joint-laws", "hands"),
)


OPTIONAL = {"baselines": "pyscipopt", "datasets": "sklearn"}  # pages whose snippets need a package of the extra `all`


def marks(page: Path) -> list[pytest.MarkDecorator]:
    named = ((pytest.mark.slow, page.stem in SLOW), (pytest.mark.optional, page.stem in OPTIONAL))
    return [mark for mark, due in named if due]


@pytest.mark.parametrize("page", [pytest.param(p, marks=marks(p), id=p.stem) for p in PAGES if runnable(p)])
def test_snippets(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if page.stem in OPTIONAL:
        pytest.importorskip(OPTIONAL[page.stem])
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "__main__"}
    for block in blocks(page):
        if block.skip:
            continue
        if block.kind == "python":
            tree = ast.parse(block.text, f"{page.name}:{block.line}")
            ast.increment_lineno(tree, block.line - 1)
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(tree, str(page), "exec", dont_inherit=True), names)
        elif block.kind == "console":
            for arguments in block.commands():
                said, complaint = io.StringIO(), io.StringIO()
                with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complaint):
                    status = main(arguments)
                assert status == 0, f"{page.name}: handfast {shlex.join(arguments)}\n{complaint.getvalue()}"
                if "--json" in arguments:
                    json.loads(said.getvalue())
        elif block.kind == "json" and block.title:
            Path(block.title).write_text(block.text, "utf-8")
            LOADERS[json.loads(block.text)["schema"]](block.title)
        elif block.kind == "xml" and block.title:
            Path(block.title).write_text(block.text, "utf-8")
            assert load_hand(block.title).l > 0


def test_every_block_is_of_a_known_kind() -> None:
    """A misspelt kind would silently leave a snippet out."""
    for page in PAGES:
        for block in blocks(page):
            assert block.kind in ("python", "console", "json", "xml", "bash", "text"), f"{page.name}: {block.kind}"
            assert block.kind not in ("json", "xml") or block.title, f"{page.name}:{block.line}: it needs a title"
            assert block.kind != "console" or block.commands(), f"{page.name}:{block.line}: no command"


def test_console_lines_are_commands_that_exist() -> None:
    """Also those that are not run because they take too long."""
    for page in PAGES:
        for block in blocks(page):
            for arguments in block.commands() if block.kind == "console" else []:
                if arguments[0].startswith("--"):
                    continue
                known = {option_name(f) for f in fields(command(arguments[0]))} | {
                    "--help",
                    "-o",
                    "-n",
                    *ALIASES.get(arguments[0], ()),
                }  # type: ignore[arg-type]
                asked = {w for w in arguments[1:] if re.match(r"--?[a-z]", w)}
                assert asked <= known, f"{page.name}: {asked - known}"


def test_the_tutorial_is_of_ten_commands_at_most_and_ends_with_a_report() -> None:
    found = blocks(DOCS / "tutorial.md")
    commands = [command for b in found if b.kind == "console" for command in b.commands()]
    assert found[0].kind == "xml"
    assert 0 < len(commands) <= 10
    assert not any(b.skip for b in found)
    assert "--report" in commands[-1]


def test_pages_that_are_read_first_write_to_files_of_their_own() -> None:
    """README, front page and tutorial can be followed in one folder: nothing asks for --force."""
    first = [ROOT / "README.md", DOCS / "index.md", DOCS / "tutorial.md"]
    written = {page: {file for block in blocks(page) for file in _written(block)} for page in first}
    assert all(written.values())
    for one, other in itertools.combinations(first, 2):
        assert not written[one] & written[other], f"{one.name} and {other.name}"


def _written(block: Block) -> set[str]:
    """The files and folders that the commands of a block write."""
    named = {"close": "--grasp", "synthesize": "--configuration"}  # beside those of every command
    commands = block.commands() if block.kind == "console" else []
    return {
        file
        for words in commands
        for option, file in itertools.pairwise(words)
        if option in ("-o", "--output", "--save", "--report", named.get(words[0]))
    }


def test_the_python_page_has_every_name_and_every_name_is_there() -> None:
    paths = re.findall(r"^::: (\S+)$", (DOCS / "api.md").read_text("utf-8"), re.MULTILINE)
    modules = {path for path in paths if importlib.util.find_spec(path.rpartition(".")[0]) and _is_module(path)}
    for path in set(paths) - modules:
        home, _, name = path.rpartition(".")
        assert hasattr(importlib.import_module(home), name), path
    assert set(handfast.__all__) <= {path.rpartition(".")[2] for path in paths}
    for name in handfast.__all__:
        assert getattr(handfast, name) is not None


def _is_module(path: str) -> bool:
    try:
        return importlib.util.find_spec(path) is not None
    except ModuleNotFoundError:  # its parent is a module, so that it is a name in there
        return False


# --- the reference pages are complete ----------------------------------------------------------------


def section(text: str, heading: str) -> str:
    """From `## heading` to the next `## `."""
    found = re.search(rf"^## {re.escape(heading)}\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    assert found, f"no section '{heading}'"
    return found[1]


@pytest.mark.parametrize("name", COMMAND_CLASSES)
def test_every_option_is_described(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    page = (DOCS / "command-line.md").read_text("utf-8")
    described = section(page, name)
    if name in ("check", "max", "torques", "hold", "map", "sweep"):
        described += section(page, "Options of every question")
    assert main([name, "--help"]) == 0
    helped = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", capsys.readouterr().out)) - {"--help"}
    mine = {option_name(f) for f in fields(command(name))}  # type: ignore[arg-type]
    options = {o for o in helped if o in mine}
    assert options, "no options found in the help"
    tables = "\n".join(line for line in described.splitlines() if line.startswith("| `--"))
    written = set(re.findall(r"`(--[a-z][a-z-]*)", tables))
    assert options - written == set(), "not described"
    assert written - options == set(ALIASES.get(name, ())), "described, but not there"


def test_option_defaults_are_described() -> None:
    page = (DOCS / "command-line.md").read_text("utf-8")
    for row, default in (("--sectors N", 2048), ("--gap G", 0.001), ("--steps N", 360), ("--threshold M", 0.0005)):
        assert f"| `{row}` | {default} |" in page


def keys_of(model: type[Any], prefix: str = "") -> set[str]:
    """Field names of a file format as its table writes them, one level of models deep at a time."""
    if issubclass(model, Strict):
        kinds = {info.alias or name: str(info.annotation) for name, info in model.model_fields.items()}
    else:
        kinds = {f.name: str(get_type_hints(model)[f.name]) for f in fields(model)}
    out = set()
    for name, kind in kinds.items():
        key = prefix + name
        out.add(key)
        for path in re.findall(r"handfast\.[\w.]+", kind):
            module, _, cls = path.rpartition(".")
            found = getattr(__import__(module, fromlist=[cls]), cls)
            if isinstance(found, type) and issubclass(found, (Strict, InFiles)):
                out |= keys_of(found, key + ("[]." if "list[" in kind else "."))
    return out


@pytest.mark.parametrize(
    "heading, model",
    [("Grasp: `handfast/grasp/1`", GraspFile), ("Configuration: `handfast/configuration/1`", Configuration)],
)
def test_every_field_is_in_its_table(heading: str, model: type[Strict]) -> None:
    table = section((DOCS / "file-formats.md").read_text("utf-8"), heading)
    written = {
        name
        for line in table.splitlines()
        if line.startswith("| `")
        for name in re.findall(r"`([^`]+)`", line.split("|")[1])
    }
    refused = {"provenance.hand.scale", "provenance.configuration.scale"}  # of objects alone, says `Provenance`
    assert written == keys_of(model) - refused


def test_every_field_of_a_body_is_in_its_table() -> None:
    from handfast.readers.body_file import BodyFile, ShapeFile

    table = section((DOCS / "file-formats.md").read_text("utf-8"), "Body: `handfast/body/1`")
    written = {line.split("`")[1] for line in table.splitlines() if line.startswith("| `")}
    top = {info.alias or name for name, info in BodyFile.model_fields.items()}
    assert written == top | {f"shapes[].{name}" for name in ShapeFile.model_fields}


def test_every_field_of_results_and_certificates_is_in_its_table() -> None:
    page = (DOCS / "file-formats.md").read_text("utf-8")
    grasp, state = load_grasp("fig9"), {f.name for f in fields(State)}
    answer = maximum(grasp, [0, 1, 0, 0, 0, 0], interval=True)
    result, one = answer.to_file(), {"wrench", "command"} | state
    assert set(result["witness"]) <= one
    inside = {f"witness.{name}" for name in one} | {"arcs[].first", "arcs[].last", "arcs[].controls"}
    assert {key for arc in result["arcs"] for key in arc} == {"first", "last", "controls"}
    assert fields_in_tables(section(page, "Result: `handfast/result/1`")) == set(result) | inside
    assert answer.certificate
    assert answer.posed
    certificate = file_to_dict(answer.certificate, answer.posed.to_json())
    text = section(page, "Certificate: `handfast/certificate/1`")
    assert fields_in_tables(text) == set(certificate) | {"question.goal"}
    assert all(f"`{name}`" in text for name in certificate["question"])
    assert all(re.search(rf"^\| [^|]*\b{name}\b", text, re.MULTILINE) for name in (*NODE_ARRAYS, *ROW_ARRAYS))


def test_every_field_of_a_hold_is_in_its_table() -> None:
    text = section((DOCS / "file-formats.md").read_text("utf-8"), "Hold: `handfast/hold/1`")
    data = hold(load_grasp("fig9"), Loads(("up",), [[0, 1, 0, 0, 0, 0]]), margins=True).to_file()
    assert fields_in_tables(text) == set(data) | {f"question.{name}" for name in data["question"]}
    assert all(f"`{name}`" in text for name in data["answer"])


def fields_in_tables(text: str) -> set[str]:
    lines = [line for line in text.splitlines() if line.startswith("| `")]
    return {name for line in lines for name in re.findall(r"`([^`]+)`", line.split("|")[1])}


def test_every_field_of_a_task_is_in_its_table() -> None:
    written = fields_in_tables(section((DOCS / "file-formats.md").read_text("utf-8"), "Task: `handfast/task/1`"))
    kinds = {name for name in written if name.startswith("{")}
    assert sorted(re.findall(r"^\{\"(\w+)", "\n".join(sorted(kinds)), re.MULTILINE)) == sorted(REGION_KINDS)
    sides = [f"contacts[].{side}.region." for side in ("hand", "object")]
    regions = {side + name for side in sides for name in (*REGION_KINDS, "flip")}
    entries = tuple(f"{side}{name}." for side in sides for name in REGION_KINDS)
    known = {key for key in keys_of(TaskFile) - regions if not key.startswith(entries)}
    assert written - kinds == known


def test_every_field_of_a_synthesis_is_in_its_table() -> None:
    page = (DOCS / "file-formats.md").read_text("utf-8")
    text = section(page, "Synthesis: `handfast/synthesis/1`")
    named = {info.alias or name for name, info in SynthesisFile.model_fields.items()}
    assert fields_in_tables(text) == named | {"schema", *(field.name for field in fields(configurations.Existence))}
    assert all(f"`{name}`" in text for name in SynthesisStateEntry.model_fields)
    keys = {info.alias or name for name, info in SynthesisAnswerEntry.model_fields.items()}
    answers = section((DOCS / "answers.md").read_text("utf-8"), "JSON")
    assert all(f"| `{key}` |" in answers for key in keys)


@pytest.mark.slow
def test_answers_have_the_documented_keys(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = (DOCS / "answers.md").read_text("utf-8")
    up, proof = ["--direction", "0", "0", "1"], {"certified", "verified", "motion_cap", "exact", "motion"}
    asked = {
        "check": ["check", "fig1", "--wrench", "0", "1", "0"],
        "max": ["max", "fig1", "--direction", "0", "-1", "0", "--no-preload", "--interval"],
        "torques": ["torques", "fig11", "--wrench", "0", "0", "0.5"],
        "hold": ["hold", "fig1", "--wrench", "0", "1", "0"],
        "map": ["map", "fig11", "--plane", "xz", "--steps", "1"],
        "sweep": ["sweep", "fig11", "--joint", "finger_3_prox", "--to", "0.01", "--steps", "2", *up],
        "synthesize": ["synthesize", "scalpel-upholding"],
        "grasp": ["grasp", "scalpel-incision", "--count", "1", "--up", "z"],
    }
    common = {"schema", "query", "verdict", "stop", "seconds", "nodes"}
    for name, arguments in asked.items():
        main([*arguments, "--json"])
        keys = set(json.loads(capsys.readouterr().out)) - common
        adds = re.search(rf"^`{name}` adds.*?\n\n(.*?)\n\n", page, re.MULTILINE | re.DOTALL)
        assert adds, name
        written = {k for line in adds[1].splitlines()[2:] for k in re.findall(r"`(\w+)`", line.split("|")[1])}
        assert written == keys - (proof if name in ("check", "max", "torques") else set()), name
    for key in common | proof:
        assert f"| `{key}` |" in section(page, "JSON")


# --- pages and pictures ------------------------------------------------------------------------------


def test_pictures_exist_and_are_small() -> None:
    for page in PAGES:
        for target in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text("utf-8")):
            picture = page.parent / target
            assert picture.is_file(), f"{page.name}: {target}"
            assert picture.stat().st_size < 300_000, target


def test_every_page_is_in_the_navigation() -> None:
    nav = (ROOT / "mkdocs.yml").read_text("utf-8")
    for page in PAGES:
        if page.is_relative_to(DOCS):
            assert f": {page.relative_to(DOCS)}" in nav


def test_every_page_opens_with_what_it_is_for_and_a_command() -> None:
    """A title, a paragraph, and a command before the first section; the front page and the tutorial are commands."""
    for page in (p for p in PAGES if p.is_relative_to(DOCS) and p.stem not in ("changelog", "index", "tutorial")):
        text = page.read_text("utf-8")
        title, _, rest = text.partition("\n\n")
        assert re.fullmatch(r"# [^\n]+", title), page.name
        assert re.match(r"[A-Z*`]", rest), f"{page.name} begins with no paragraph"
        opening = rest.split("\n## ")[0]
        assert re.search(r"^```|`handfast \w+", opening, re.MULTILINE), (
            f"{page.name}: no command before its first section"
        )


def test_the_navigation_has_four_parts() -> None:
    nav = (ROOT / "mkdocs.yml").read_text("utf-8").partition("\nnav:\n")[2].partition("\nplugins:\n")
    assert re.findall(r"^  - ([\w ]+):$", nav[0], re.MULTILINE) == ["Start", "How to", "Explanation", "Reference"]
    assert nav[2].startswith("  - search\n")


def test_all_numbered_equations_are_there() -> None:
    text = (DOCS / "model.md").read_text("utf-8") + (DOCS / "algorithm.md").read_text("utf-8")
    for number in range(1, 28):
        assert f"({number})" in text, number


def test_the_site_needs_no_network() -> None:
    text = (ROOT / "mkdocs.yml").read_text("utf-8")
    assert "font: false" in text
    assert "extra_javascript" not in text
    assert "http" not in text
