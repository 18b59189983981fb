"""The report: one file, the verdict, the numbers, and a warning where friction creates energy."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handfast.cli import demo, main
from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.pictures import Entry, words, write_report
from handfast.pictures.words import num
from handfast.stability.answers.check_query import CheckAnswer
from handfast.stability.answers.max_query import MaxAnswer
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.maps import Curve, MapAnswer
from handfast.stability.studies.questions import check, maximum, torques

Y = np.eye(6)[1]
QUICK = Settings(gap=0.02)


@pytest.fixture(scope="module")
def grasp() -> Grasp:
    """Two mirrored fingers with two contacts each, in a plane."""
    contacts, joints = [], []
    tilted = np.array([0.819, 0.574]) / np.hypot(0.819, 0.574)
    for side, name in ((1, "right"), (-1, "left")):
        first = 2 * len(joints)
        contacts.append(Contact([side * 0.078, 0, 0], [-side, 0, 0], 1.0, f"{name}_distal"))
        normal = [-side * tilted[0], tilted[1], 0]
        contacts.append(Contact([side * 0.0955, -0.0463, 0], normal, 1.0, f"{name}_proximal"))
        joints.append(GraspJoint(name, [0, 0, side], [side * 0.075, -0.093, 0], (first, first + 1)))
    return Grasp(contacts, joints, preload={"right": 0.1, "left": 0.1}, name="two <fingers> & a box")


def page(path: Path) -> str:
    """The page, checked to need nothing from outside."""
    text = path.read_text("utf-8")
    for link in re.findall(r"""(?:src|href)\s*=\s*["']([^"']*)""", text):
        assert link.startswith("data:")
    assert "@import" not in text
    assert "url(" not in text
    assert text.count("<script") == 2  # the 3-D view's data and its program
    assert "<script>(() =>" in text
    return text


def test_check_page_has_verdict_forces_and_residuals(grasp: Grasp, tmp_path: Path) -> None:
    answer = check(grasp, 2.2 * Y, settings=QUICK)
    write_report(tmp_path / "a.html", grasp, [Entry("Does it resist 2.2 N?", answer)], settings=QUICK)
    text = page(tmp_path / "a.html")
    assert "two &lt;fingers&gt; &amp; a box" in text
    assert '<b class="holds">HOLDS</b>' in text
    assert answer.witness is not None
    c = answer.witness.state.c.reshape(-1, 3)
    for i, state in enumerate(answer.witness.contact_states):
        assert grasp.contacts[i].link in text
        if state != "open":
            assert f">{num(c[i, 0])}</td>" in text
    for said in ("maximum dissipation principle demands", "(8) actuators", "tree search", "The search:", "handfast 0."):
        assert said in text
    assert '<div class="warning">' not in text


def test_titles_break_rather_than_widen_a_page(grasp: Grasp, tmp_path: Path) -> None:
    write_report(tmp_path / "a.html", grasp, [])
    style = (tmp_path / "a.html").read_text()
    assert re.search(r"\bh1\b[^{}]*\{[^}]*overflow-wrap: anywhere", style)


def test_a_page_is_the_same_every_time(grasp: Grasp, tmp_path: Path) -> None:
    entry = Entry("Does it resist 1 N?", check(grasp, Y, settings=QUICK))
    for name in ("a.html", "b.html"):
        write_report(tmp_path / name, grasp, [entry])
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_friction_that_creates_energy_is_called_unphysical(grasp: Grasp, tmp_path: Path) -> None:
    bare = grasp.with_preload(None)
    answer = check(bare, Y, mdp=False, settings=QUICK)
    assert answer.verdict is Verdict.HOLDS
    assert answer.witness is not None
    write_report(tmp_path / "a.html", bare, [Entry("Without dissipation", answer, mdp=False)])
    text = page(tmp_path / "a.html")
    assert '<b class="unreal">HOLDS?</b>' in text
    assert '<div class="warning"><strong>This solution is not physical: friction pushes along the motion.' in text
    e = answer.witness.energy
    assert f"{num(e.created)} N² of work come out of nothing" in text
    for i in np.flatnonzero(e.friction < -1e-3 * e.created):
        assert f"fed in by friction at contact {i}" in text
        assert grasp.contacts[i].link in text.split('class="warning"')[1].split("</div>")[0]
    assert "left out" in text  # the residual of (6), (7)


def test_bounds_commands_and_slips(grasp: Grasp, tmp_path: Path) -> None:
    largest = maximum(grasp, Y, settings=QUICK)
    best = torques(grasp, 2 * Y, settings=QUICK)
    slips = check(grasp, 2.5 * Y, settings=QUICK)
    entries = [Entry("max", largest, direction=Y), Entry("torques", best), Entry("check", slips)]
    write_report(tmp_path / "a.html", grasp, entries, settings=QUICK)
    text = page(tmp_path / "a.html")
    assert f">{num(largest.lower, 6)} N</td>" in text
    assert f">{num(largest.upper, 6)} N</td>" in text
    assert "0.09 N·m" in text
    assert '<b class="slips">SLIPS</b>' in text
    assert "every case of equations (1) to (8) was refuted: certificate of" in text


def test_undecided_says_why(grasp: Grasp, tmp_path: Path) -> None:
    answer = CheckAnswer(Verdict.UNDECIDED, Stop.TIME, 1.0, 0, None, None)
    write_report(tmp_path / "a.html", grasp, [Entry("?", answer)], settings=Settings(timeout=1.0))
    text = page(tmp_path / "a.html")
    assert '<b class="undecided">UNDECIDED</b>' in text
    assert "The time limit of 1 s was hit" in text


def test_the_grasp_alone_and_no_writing_over(grasp: Grasp, tmp_path: Path) -> None:
    write_report(tmp_path / "a.html", grasp, [], notes=["Taken as it lies."])
    text = page(tmp_path / "a.html")
    assert "Taken as it lies." in text
    assert "right_proximal" in text
    with pytest.raises(InputError, match=r"a\.html: exists already"):
        write_report(tmp_path / "a.html", grasp, [])


def test_map_table_has_every_direction(grasp: Grasp, tmp_path: Path) -> None:
    answers = [MaxAnswer(Verdict.HOLDS, Stop.COMPLETE, 0.0, 0, None, None, v, v, False) for v in (1.25, 2.5, 3.75, 5)]
    curve = Curve.of([*answers[:3], None])
    directions = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0.0]])
    answer = MapAnswer(grasp, "xy", directions, curve, None, 1.0, 0)
    write_report(tmp_path / "a.html", grasp, [Entry("map", answer)])
    text = page(tmp_path / "a.html")
    for said in (">1.25<", ">2.5<", ">3.75<", ">not reached<", ">270<", "1 not decided"):
        assert said in text


def test_facts_are_a_table_near_the_top(grasp: Grasp, tmp_path: Path) -> None:
    facts = [("clearance", "3.2 mm"), ("rank of G", "6"), ("a <b>", "& c")]
    write_report(tmp_path / "a.html", grasp, [], facts=facts, notes=["Taken as it lies."])
    text = page(tmp_path / "a.html")
    assert "<td>clearance</td><td>3.2 mm</td>" in text
    assert "<td>a &lt;b&gt;</td><td>&amp; c</td>" in text
    assert text.index("Taken as it lies.") < text.index("3.2 mm") < text.index('class="view3d"') < text.index("<h2>")


def test_many_loads_are_drawn_once_and_listed(grasp: Grasp, tmp_path: Path) -> None:
    """Up to three checks have pictures of their own; of four, the first that holds, and a table of all."""
    loads = [2.5, 1.0, 1.5, 2.0]
    entries = [Entry(f"{f} N?", check(grasp, f * Y, settings=QUICK)) for f in loads]
    assert [str(e.answer.verdict) for e in entries] == ["slips", "holds", "holds", "holds"]
    write_report(tmp_path / "three.html", grasp, entries[1:])
    three = page(tmp_path / "three.html")
    assert three.count("<img") == 3
    assert "The loads" not in three
    write_report(tmp_path / "four.html", grasp, entries)
    four = page(tmp_path / "four.html")
    assert four.count("<img") == 1
    assert four.count("<summary>The equilibrium in numbers</summary>") == 2
    assert four.index("<h2>1.0 N?") < four.index("<img") < four.index("<h2>1.5 N?")
    assert "<h3>The loads</h3>" in four
    witness = entries[1].answer.witness
    assert witness is not None
    largest = num(float(witness.state.c.reshape(-1, 3)[:, 0].max()))
    assert f'>1.0 N?</td><td>holds</td><td class="n">{largest}</td>' in four
    assert '>2.5 N?</td><td class="bad">slips</td><td class="n">–</td>' in four
    rows = four.split("The loads")[1].split("</table>")[0]
    states = witness.contact_states
    said = ", ".join(f"{states.count(s)} {s}" for s in ("stick", "slide", "open") if s in states)
    assert f'<td class="n">{largest}</td><td>{said}</td>' in rows


def test_a_slip_names_its_load(grasp: Grasp, tmp_path: Path) -> None:
    write_report(tmp_path / "a.html", grasp, [Entry("?", check(grasp, 2.5 * Y, settings=QUICK))])
    assert "The object slips under 2.5 N along +y" in page(tmp_path / "a.html")


def test_a_map_says_where_its_forces_act_and_what_the_weight_meets(grasp: Grasp, tmp_path: Path) -> None:
    holds = [MaxAnswer(Verdict.HOLDS, Stop.COMPLETE, 0.0, 0, None, None, v, v, False) for v in (1.0, 3.0)]
    directions = np.array([[1, 0, 0], [-1, 0, 0.0]])
    plain = MapAnswer(grasp, "xy", directions, Curve.of(holds), None, 1.0, 0)
    entry = Entry("map", replace(plain, at=np.array([0, 0.02, 0])), weight=2.0)
    write_report(tmp_path / "a.html", grasp, [entry])
    text = page(tmp_path / "a.html")
    assert "they act at (0, 20, 0) mm." in text
    assert "A weight of 2 N: 1 of 2 directions resist as much, 1 less." in text
    write_report(tmp_path / "b.html", grasp, [Entry("map", plain)])
    text = page(tmp_path / "b.html")
    assert "they act at the object&#x27;s origin." in text
    assert "A weight of" not in text


@pytest.mark.parametrize(
    ("load", "text"),
    [
        ([0, 2.2, 0, 0, 0, 0], "2.2 N along +y"),
        ([0, 0, -1, 0, 0, 0], "1 N along −z"),
        ([0, 0, 0, 0.1, 0, 0], "0.1 N·m about +x"),
        ([3, 4, 0, 0, 0, -1], "5 N along (0.6, 0.8, 0) with 1 N·m about −z"),
        ([5, 0, 0, 0, 0, 1e-6], "5 N along +x with 1.00e−06 N·m about +z"),  # 0.2 µm off the axis
        ([5, 0, 0, 0, 0, 4e-12], "5 N along +x"),  # less than 1e-12 m off it is rounding
        ([0] * 6, "no load"),
    ],
)
def test_loads_in_words(load: list[float], text: str) -> None:
    assert words.load_text(load) == text


@pytest.mark.parametrize(
    ("x", "text"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (2.22222, "2.222"),
        (-0.05, "−0.05"),
        (12345.6, "12346"),
        (1e-7, "1.00e−07"),
        (4.65e9, "4.65e+09"),
        (float("inf"), "∞"),
        (float("nan"), "?"),
    ],
)
def test_numbers(x: float, text: str) -> None:
    assert num(x) == text


@pytest.mark.slow
def test_demo_tells_a_story(grasp: Grasp, tmp_path: Path, capsys, monkeypatch) -> None:
    """The whole demo, on a small grasp and few directions; the bundled one has its own test."""
    monkeypatch.setattr(demo, "build", lambda: (grasp, []))
    monkeypatch.setattr(demo, "DEMO_DIRECTIONS", 4)
    monkeypatch.setattr(demo, "DIRECTION_TIMEOUT", math.inf)
    folder = tmp_path / "demo"
    assert main(["demo", "--output", str(folder)]) == 0
    out = capsys.readouterr().out
    for said in ("HOLDS", "SLIPS", "2.222 N", "report.html", "0.05", "directions resisted"):
        assert said in out
    assert sorted(f.name for f in folder.iterdir()) == ["grasp.json", "map.png", "report.html"]
    page(folder / "report.html")
    assert main(["demo", "--output", str(folder)]) == 2
    assert "exists already; give --force" in capsys.readouterr().err
