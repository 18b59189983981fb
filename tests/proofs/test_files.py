"""JSON files as they are read, schemas, and the folders of plans."""

from __future__ import annotations

import json
import os
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast.proofs import files
from handfast.proofs.certificate import Certificate, file_to_dict
from handfast.proofs.grasp import read_grasp
from handfast.proofs.replay import Replay, down
from handfast.proofs.tolerance import COMPLETE_CAP
from handfast.stability.problem.loads import Loads
from handfast.stability.studies.questions import hold
from tests.support.problems import pinch
from tests.support.proof_certificates import LEAVES, MU, proof, walls
from tests.support.proof_states import contact
from tests.support.refused import refused


@pytest.fixture
def written(tmp_path: Path):
    """A file of this text."""

    def write(text: str | bytes, name: str = "file.json") -> Path:
        path = tmp_path / name
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    return write


# --- JSON


def test_what_is_read(written) -> None:
    text = '{"a": [1, -2.5, "ü", true, null, {}], "b": 1e-3}'
    assert files.read_json(written(text)) == {"a": [1, -2.5, "ü", True, None, {}], "b": 1e-3}
    for value in ("3", "null", '"text"', "[]", "true"):
        assert files.read_json(written(value)) == json.loads(value)


@pytest.mark.parametrize("constant", ["NaN", "Infinity", "-Infinity"])
def test_constants_that_are_no_numbers(written, constant: str) -> None:
    with refused(f"contains {constant}; finite numbers are needed", "place"):
        files.read_json(written(f'{{"a": [1, {constant}]}}'), "place")


@pytest.mark.parametrize("digits", ["9" * 50, "-" + "9" * 49])
def test_whole_numbers(written, digits: str) -> None:
    assert files.read_json(written(f"[{digits}]")) == [int(digits)]
    with refused("contains a number of 51 digits; at most 50 are possible"):
        files.read_json(written(f"[{digits}9]"))


def test_a_number_without_end_takes_no_time(written) -> None:
    with refused("contains a number of 1000000 digits; at most 50 are possible"):
        files.read_json(written("9" * 1000000))


@pytest.mark.parametrize("text", ["1e999", "-2e50", "1.5e51"])
def test_numbers_that_nothing_has(written, text: str) -> None:
    assert files.read_json(written("[1e50, -1e50]")) == [1e50, -1e50]
    with refused(f"contains {text}; numbers up to 1e+50 are possible", "place"):
        files.read_json(written(f"[{text}]"), "place")


@pytest.mark.parametrize(
    ("word", "problem"),
    [
        (r"\ud800", r"contains half a character (a lone surrogate such as \ud800)"),
        (r"a\nPROVED", r"contains 'a\nPROVED'; names and texts are one line without control characters"),
        ("\x9b31m", r"contains '\x9b31m'; names and texts are one line without control characters"),
        (rf"{'a' * 39}\nb", rf"contains '{'a' * 39}\n'; names and texts are one line without control characters"),
        (r"\u2028PROVED", r"contains '\u2028PROVED'; names and texts are one line without control characters"),
        ("\u2029PROVED", r"contains '\u2029PROVED'; names and texts are one line without control characters"),
        (r"\u001b[31m", r"contains '\x1b[31m'; names and texts are one line without control characters"),
    ],
)
def test_texts_that_could_fake_what_is_printed(written, word: str, problem: str) -> None:
    for text in (f'["{word}"]', f'{{"a": {{"{word}": 1}}}}', f'"{word}"'):
        with refused(problem):
            files.read_json(written(text))


def test_texts_that_are_written_with_escapes(written) -> None:
    assert files.read_json(written(r'[3, null, {"\u00fc": [1.5, "a"]}, "b"]')) == [3, None, {"ü": [1.5, "a"]}, "b"]


@pytest.mark.parametrize(("ones", "shown"), [(17, "1" * 17 + "e99"), (18, "1" * 18 + "e9...")])
def test_how_much_of_a_number_is_shown(written, ones: int, shown: str) -> None:
    with refused(f"contains {shown}; numbers up to 1e+50 are possible"):
        files.read_json(written("1" * ones + "e99"))


def test_a_name_twice(written) -> None:
    with refused("has 'b' 2 times in one object; once is enough"):
        files.read_json(written('{"x": {"a": 1, "b": 2, "c": 3, "b": 2}}'))
    assert files.read_json(written('{"a": {"a": 1}, "b": {"a": 1}}')) == {"a": {"a": 1}, "b": {"a": 1}}


@pytest.mark.parametrize(("opened", "closed"), [("[", "]"), ('{"a":', "}")])
def test_depth(written, opened: str, closed: str) -> None:
    def nested(depth: int) -> Path:
        inner = "[]" if opened == "[" else "{}"
        return written(opened * (depth - 1) + inner + closed * (depth - 1))

    files.read_json(nested(50))
    files.read_json(written("[" * 50 + "3" + "]" * 50))
    for depth in (51, 900, 100_000):
        with refused("is nested too deeply; at most 50 lists and objects may be in each other"):
            files.read_json(nested(depth))


def test_depth_of_what_stands_behind_others(written) -> None:
    deep = "[" * 49 + "]" * 49
    files.read_json(written(f'{{"a": 1, "b": {deep}}}'))
    path = written(f'{{"a": 1, "b": [[], 2, {deep}]}}')
    with refused("is nested too deeply; at most 50 lists and objects may be in each other", "place"):
        files.read_json(path, "place")


@pytest.mark.parametrize("text", ["", "{", "[1,]", b"\xff\xfe", "{'a': 1}"])
def test_what_is_no_json(written, text: str | bytes) -> None:
    path = written(text)
    with pytest.raises(files.BadFile, match=r"\Ais not valid JSON: "):
        files.read_json(path)
    with pytest.raises(files.BadFile, match=r"\Aplace: is not valid JSON: "):
        files.read_json(path, "place")


def test_where_json_ends(written) -> None:
    with refused("is not valid JSON: Expecting value (line 2, column 2)", "place"):
        files.read_json(written("[\n ,"), "place")


def test_what_cannot_be_read(tmp_path: Path) -> None:
    with refused("no such file; one that --save wrote is needed", "place"):
        files.read_json(tmp_path / "none.json", "place")
    with refused("cannot be read: Is a directory"):
        files.read_json(tmp_path)


# --- schemas


def test_what_can_be_verified() -> None:
    schemas = "result/1", "certificate/1", "path/1", "hold/1", "synthesis/1", "grasps/1", "contacts/1"
    assert [*files.READERS] == [f"handfast/{schema}" for schema in schemas]


def known() -> str:
    return " or ".join(map(repr, files.READERS))


@pytest.mark.parametrize("data", [{}, [], 3, None, {"schema": None}])
def test_without_a_schema(data: Any) -> None:
    with refused(f"is missing; {known()} is needed", "schema"):
        files.verify(data)


@pytest.mark.parametrize("schema", ["handfast/result/0", "handfast/grasp/1", "", 3, [], {}])
def test_other_schemas(schema: Any) -> None:
    with refused(f"is {schema!r}; {known()} is needed", "schema"):
        files.verify({"schema": schema})


@pytest.mark.parametrize(
    ("query", "ask"),
    [
        ("check", "handfast check GRASP --save"),
        ("max", "handfast max GRASP --save"),
        ("torques", "handfast torques GRASP --save"),
        ("hold", "handfast hold GRASP --save"),
        ("map", "handfast verify FILE --replay"),
        ("sweep", "handfast verify FILE --replay"),
        ("synthesize", "handfast synthesize TASK --save"),
        ("grasp", "handfast grasp TASK -o FOLDER"),
        ("plan", "handfast verify FOLDER, for the folder that it stands in"),
        ("another", "with --save"),
        (3, "with --save"),
        (None, "with --save"),
    ],
)
def test_answers_without_a_proof_say_what_asks_for_one(query: Any, ask: str) -> None:
    with refused(f"is an answer without its proof; ask again: {ask}", "schema"):
        files.verify({"schema": "handfast/answer/1", "query": query})


def test_a_settled_grasp_keeps_no_proof() -> None:
    with refused("is an answer without its proof; ask again: handfast verify FILE --replay", "schema"):
        files.verify({"schema": "handfast/settled/1", "rest": "settles"})


def of_walls(c: Certificate, tilt: float = 0.0) -> dict[str, Any]:
    """The file of a certificate about `walls`."""
    normals = [1, 0, 0], [-np.cos(tilt), -np.sin(tilt), 0]
    contacts = [contact([x, 0, 0], normal, MU) for x, normal in zip((-1, 1), normals, strict=True)]
    grasp = {"schema": "handfast/grasp/1", "contacts": contacts}
    return file_to_dict(c, {"grasp": grasp, "goal": "check", "wrench": [0, 1, 0, 0, 0, 0]})


@pytest.mark.parametrize(("rows", "ok"), [(4, True), (3, False)])
def test_a_file_of_a_certificate_is_as_good_as_its_proof(rows: int, ok: bool) -> None:
    """Walls that hold no weight: of the leaf in which both are closed all rows are needed."""
    c = proof(leaves=[*LEAVES[:2], LEAVES[2][:rows]])
    done = files.verify(of_walls(c))
    (part,) = done.parts
    assert (done.name, part.name, part.claim) == ("certificate", "certificate", c.claim)
    assert (done.ok, part.ok, part.figures["leaves"]) == (ok, ok, 3)
    assert ("leaf 2 (node 4) is not proved" in done.reason) != ok


def test_a_certificate_alone_may_be_up_to_any_cap() -> None:
    """Walls that are not quite parallel: it does not say that it is complete, and the cap is told."""
    c = proof(walls(tilt=-1e-4))
    done = files.verify(of_walls(c, tilt=-1e-4))
    assert done.ok
    cap = done.parts[0].figures["motion_cap"]
    assert isinstance(cap, float)
    assert cap < COMPLETE_CAP
    assert done.parts[0].claim == f"{c.claim}, up to virtual motions of {down(cap)} N"


# --- folders: which files are read, and what is made of them; what a file claims is said by a reader of this test


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> str:
    """A schema whose files say themselves what is proved of them."""
    schema = "handfast/said/1"
    reader = lambda data, place: Replay(data["name"] + place, "it is said", data.get("refused", ""))  # noqa: E731
    monkeypatch.setitem(files.READERS, schema, reader)
    return schema


def test_the_reader_of_the_schema_is_asked(said: str, written) -> None:
    assert files.verify({"schema": said, "name": "a"}).name == "a"
    assert files.verify({"schema": said, "name": "a"}, " at b").name == "a at b"
    assert files.verify_path(str(written(json.dumps({"schema": said, "name": "c"})))).name == "c"


PLAN_LOADS = {"up": [0.0, 1.0, 0, 0, 0, 0], "side": [0.2, 0.0, 0, 0, 0, 0]}


@cache
def held_text(verdict: str = "holds", friction: float = 0.5) -> str:
    """A pinch that holds both loads under one preload, or does not within a limit of commands."""
    loads = Loads(tuple(PLAN_LOADS), np.array(list(PLAN_LOADS.values())))
    answer = hold(pinch(friction), loads, command_limit=None if verdict == "holds" else 0.04)
    assert answer.verdict == verdict
    return json.dumps(answer.to_file())


def planned(written, **files_by_name: Any) -> dict[str, Any]:
    """The files of a plan of one grasp and one that is kept besides; by name others."""
    held = {name: json.loads(held_text(friction=mu)) for name, mu in (("a", 0.5), ("b", 0.6))}
    grasps = {
        name: data["question"]["grasp"] | {"preload": data["answer"]["preload"]}
        for name, data in zip("gh", held.values(), strict=True)
    }
    one, two = ({"hold_file": f"{a}.json", "grasp_file": f"{g}.json"} for a, g in ("ag", "bh"))
    made = {"plan": {"grasps": [one], "others": [two], "loads": PLAN_LOADS, "x": 1}} | held | grasps | files_by_name
    for name, data in made.items():
        written(json.dumps(data), f"{name}.json")
    return made


def test_a_plan_is_all_of_its_grasps(written, tmp_path: Path) -> None:
    made = planned(written)
    done = files.verify_path(tmp_path)
    assert done.ok
    assert (done.name, [p.name for p in done.parts]) == ("plan", ["a.json", "b.json"])
    assert [p.parts[0].name for p in done.parts] == ["hold", "hold"]
    assert done.not_replayed == (files.OF_PLAN,)
    made["b"]["answer"]["upper"] *= 2
    written(json.dumps(made["b"]), "b.json")
    assert files.verify_path(tmp_path).reason.startswith("b.json: hold: answer: its largest command is ")


def test_a_plan_is_of_holds_of_its_own_grasps_and_loads(written, tmp_path: Path) -> None:
    """What holds nothing, or another grasp or other loads, is proved as well, but is not what the plan says."""
    slips = json.loads(held_text("slips"))
    made = planned(written, b=slips)
    assert files.verify(slips).ok
    assert files.verify_path(tmp_path).reason == "b.json: it does not say that h.json holds"
    contacts = [made["g"]["contacts"][0] | {"friction": 0.9}, *made["g"]["contacts"][1:]]
    planned(written, g=made["g"] | {"contacts": contacts})
    assert files.verify_path(tmp_path).reason == "a.json: it is about another grasp than g.json"
    preload = {name: 2 * x for name, x in made["g"]["preload"].items()}
    planned(written, g=made["g"] | {"preload": preload})
    assert files.verify_path(tmp_path).reason == "a.json: it is about another preload than that of g.json"
    planned(written, g=made["g"] | {"name": "other", "mass": 3.0})  # no equation knows these
    assert files.verify_path(tmp_path).ok
    up, side = PLAN_LOADS["up"], PLAN_LOADS["side"]
    for loads in ({"up": up}, {"up": up, "side": [0.1, 0, 0, 0, 0, 0]}, {"up": up, "aside": side}):
        planned(written, plan=made["plan"] | {"loads": loads})
        assert files.verify_path(tmp_path).reason == "a.json: its loads are not those of plan.json"
    planned(written, plan={key: x for key, x in made["plan"].items() if key != "loads"})
    with refused("is missing", "plan.json.loads"):
        files.verify_path(tmp_path)


@pytest.mark.parametrize(
    ("key", "value", "place"),
    [
        ("preload", {"left": 0.5}, "plan.json.grasps[0].preload"),
        ("preload", None, "plan.json.grasps[0].preload"),
        ("contacts", 3, "plan.json.grasps[0].contacts"),
        ("links", ["palm"], "plan.json.grasps[0].links"),
        ("largest_command", {"actuator": "right", "value": 0.5, "unit": "N m"}, "plan.json.grasps[0].largest_command"),
        ("configuration_file", "c.json", "c.json.preload"),
    ],
)
def test_what_a_plan_repeats_of_a_grasp_is_what_it_has(
    key: str, value: Any, place: str, written, tmp_path: Path
) -> None:
    made = planned(written)
    own = made["g"]["preload"]
    most = max(own, key=lambda name: abs(own[name]))
    right = {"preload": own, "contacts": 2, "links": sorted({c["link"] for c in made["g"]["contacts"]})}
    right |= {"largest_command": {"actuator": most, "value": own[most], "unit": "N m"}, "configuration_file": "d.json"}
    configuration = {"schema": "handfast/configuration/1", "preload": own}
    entry, plan = made["plan"]["grasps"][0], made["plan"]
    written(json.dumps(configuration), "d.json")
    written(json.dumps(configuration | {"preload": {"left": 0.5}}), "c.json")
    written(json.dumps(plan | {"grasps": [entry | right]}), "plan.json")
    assert files.verify_path(tmp_path).ok
    written(json.dumps(plan | {"grasps": [entry | right | {key: value}]}), "plan.json")
    assert files.verify_path(tmp_path).reason == f"a.json: {place} is not what g.json has"


def test_a_grasp_is_in_a_plan_once(written, tmp_path: Path) -> None:
    """Not under another name either; with other commands it is another one."""
    made = planned(written)
    more = json.loads(held_text())
    planned(written, b=more, h=made["g"] | {"name": "other"})
    assert files.verify_path(tmp_path).reason == "b.json: h.json is a grasp that the plan has before"
    planned(written, plan=made["plan"] | {"others": made["plan"]["grasps"]})
    assert files.verify_path(tmp_path).reason == "a.json: g.json is a grasp that the plan has before"
    contacts = made["g"]["contacts"][::-1]  # in another order as well
    joints = [j | {"moves": [len(contacts) - 1 - k for k in j["moves"]]} for j in made["g"]["joints"]]
    turned = made["g"] | {"contacts": contacts, "joints": joints}
    one, other = read_grasp(made["g"], "g"), read_grasp(turned, "g")
    assert not one.same_but_commands(other)
    assert files._parts_of(one) == files._parts_of(other)
    assert files._parts_of(one) != files._parts_of(other.with_command(2 * other.command))
    moved = [made["g"]["contacts"][0] | {"position": [0.0, 0.0, 1.0]}, *made["g"]["contacts"][1:]]
    assert files._parts_of(one) != files._parts_of(read_grasp(made["g"] | {"contacts": moved}, "g"))
    names = {"hold_file": "a.json", "grasp_file": "g.json"}
    grasp, loads = read_grasp(made["g"], "g"), {name: np.array(w) for name, w in PLAN_LOADS.items()}
    for times, again in ((2.0, False), (1.0, True)):
        known = [grasp.with_command(times * grasp.command)]
        assert bool(files._planned(tmp_path, files.Fields(names), loads, known).reason) == again
        assert len(known) == 2


def test_numbers_that_cannot_be_judged(said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def reader(data: Any, place: str) -> Replay:
        raise np.linalg.LinAlgError

    monkeypatch.setitem(files.READERS, said, reader)
    for place in ("", "place"):
        with refused("has numbers too large or too small beside each other to be judged", place):
            files.verify({"schema": said}, place)


def test_how_many_contacts_a_plan_takes_is_verified(written, tmp_path: Path) -> None:
    """1 N along z, and against it, without friction, on a ball: two contacts, and no more is shown."""
    loads = {"up": [0, 0, 1.0, 0, 0, 0], "down": [0, 0, -1.0, 0, 0, 0]}
    said: dict[str, Any] = {"schema": "handfast/contacts/1", "object": "ball", "contacts": 2, "reason": "opposed"}
    said |= {"friction": 0.0, "center_of_mass": [0, 0, 0], "loads": loads, "solids": [{"kind": "sphere", "size": [1]}]}
    written(json.dumps({"contacts_file": "c.json"}), "plan.json")
    written(json.dumps(said), "c.json")
    assert files.verify_path(tmp_path).ok
    written(json.dumps(said | {"contacts": 3}), "c.json")
    reason = files.verify_path(tmp_path).reason
    assert reason.startswith("c.json: contacts: shown is only that 1 contact on its surface cannot hold")
    written(held_text(), "c.json")
    with refused("is 'handfast/hold/1'; 'handfast/contacts/1' is needed", "c.json.schema"):
        files.verify_path(tmp_path)


@pytest.mark.parametrize("schema", [s for s in files.READERS if s != "handfast/synthesis/1"])
def test_a_reader_says_which_file_is_wrong(schema: str) -> None:
    with pytest.raises(files.BadFile, match=r"\Aa\.json\."):
        files.verify({"schema": schema}, "a.json")


@pytest.mark.parametrize(
    ("plan", "field", "problem"),
    [
        ([], "", "is no object"),
        ({}, ".grasps", "names no grasps"),
        ({"grasps": [], "others": []}, ".grasps", "names no grasps"),
        ({"grasps": 3}, ".grasps", "is no list"),
        ({"grasps": None}, ".grasps", "is no list"),
        ({"others": {"hold_file": "a"}}, ".others", "is no list"),
        ({"grasps": ["a.json"]}, ".grasps[0]", "is no object"),
        ({"grasps": [{}]}, ".grasps[0].hold_file", "is missing"),
        ({"grasps": [{"hold_file": None}]}, ".grasps[0].hold_file", "is None; a text is needed"),
        (
            {"others": [{"hold_file": "../a.json"}]},
            ".others[0].hold_file",
            "is '../a.json'; a file of the folder is needed",
        ),
        ({"grasps": [{"hold_file": "/a"}]}, ".grasps[0].hold_file", "is '/a'; a file of the folder is needed"),
    ],
)
def test_faults_of_plans(plan: Any, field: str, problem: str, written, tmp_path: Path) -> None:
    written(json.dumps(plan | {"loads": {}} if isinstance(plan, dict) else plan), "plan.json")
    with refused(problem, f"plan.json{field}"):
        files.verify_path(tmp_path)


@pytest.mark.parametrize(
    ("name", "text", "problem"),
    [
        ("none.json", None, "none.json: no such file; one that --save wrote is needed"),
        ("..", None, "..: cannot be read: Is a directory"),
        ("", None, "cannot be read: Is a directory"),
        ("a.json", "[NaN]", "a.json: contains NaN; finite numbers are needed"),
        ("a.json", '{"schema": 3}', "a.json.schema: is 3; "),
        (
            "a.json",
            '{"schema": "handfast/answer/1"}',
            "a.json.schema: is 'handfast/answer/1'; 'handfast/hold/1' is need",
        ),
    ],
)
def test_files_of_a_plan_that_are_none(name: str, text: str | None, problem: str, written, tmp_path: Path) -> None:
    written(json.dumps({"grasps": [{"hold_file": name}], "loads": {}}), "plan.json")
    if text is not None:
        written(text, name)
    with pytest.raises(files.BadFile, match=rf"\A{re.escape(problem)}"):
        files.verify_path(tmp_path)


def test_a_folder_without_a_plan(tmp_path: Path) -> None:
    with refused("no such file; one that --save wrote is needed", "plan.json"):
        files.verify_path(tmp_path)


def test_a_name_that_no_file_has() -> None:
    with refused("cannot be read: File name too long"):
        files.verify_path("a" * 5000)


def test_what_is_no_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.json")
    (tmp_path / "zeros.json").symlink_to("/dev/zero")
    for name in ("pipe.json", "zeros.json"):
        with refused("is no file"):
            files.verify_path(tmp_path / name)
        with refused("is no file", "place"):
            files.read_json(tmp_path / name, "place")


def test_how_many_contacts_it_takes_goes_with_the_rest_of_a_plan(written, tmp_path: Path) -> None:
    """The grasps of the plan have two contacts each."""
    made = planned(written)
    said: dict[str, Any] = {"schema": "handfast/contacts/1", "object": "ball", "contacts": 2, "reason": "opposed"}
    said |= {"friction": 0.5, "center_of_mass": [0, 0, 0], "solids": [{"kind": "sphere", "size": [1]}]}
    loads = PLAN_LOADS | {"down": [-x for x in PLAN_LOADS["up"]]}
    words = "1 contact on its surface cannot hold: loads of both signs need more contacts than the directions that"
    plan = made["plan"] | {"contacts_file": "c.json", "verdict": "holds"}
    held = {name: json.loads(json.dumps(hold(pinch(mu), Loads(tuple(loads), np.array(list(loads.values())))).to_file()))
            for name, mu in (("a", 0.5), ("b", 0.6))}  # fmt: skip
    files_of = {"a": held["a"], "b": held["b"]}
    files_of |= {g: made[g] | {"preload": held[name]["answer"]["preload"]} for g, name in (("g", "a"), ("h", "b"))}
    plan |= {"loads": loads, "fewest_contacts": f"{words} these span"}
    good = said | {"loads": loads}
    planned(written, **files_of, plan=plan, c=good)
    assert files.verify_path(tmp_path).reason == ""
    cases: list[tuple[dict[str, Any], dict[str, Any], str]] = [
        (
            plan,
            said | {"loads": PLAN_LOADS | {"down": [-1.0, 0, 0, 0, 0, 0]}},
            "c.json: its loads are not those of plan",
        ),
        (plan | {"fewest_contacts": "no number of contacts"}, good, f"fewest_contacts is not '{words} these span'"),
        (plan | {"verdict": "none"}, good, "NONE with a grasp, or without a contacts_file"),
        (plan | {"grasps": [], "verdict": "holds"}, good, "HOLDS without a grasp"),
    ]
    for its, contacts, why in cases:
        planned(written, **files_of, plan=its, c=contacts)
        assert files.verify_path(tmp_path).reason.startswith(why), why
    for verdict, why in (("none", "NONE with a grasp, or without"), ("undecided", "fewest_contacts is said without a")):
        its = {key: x for key, x in plan.items() if key != "contacts_file"} | {"verdict": verdict}
        planned(written, **files_of, plan=its)
        assert files.verify_path(tmp_path).reason.startswith(why)
    one = {"loads": {"up": loads["up"]}, "contacts": 1, "reason": ""}
    planned(written, plan={"grasps": [], "verdict": "none", "contacts_file": "c.json"}, c=good | one)
    assert files.verify_path(tmp_path).reason == "NONE, but any number of contacts on its surface may hold"
    turned = {"solids": [{"kind": "sphere", "size": [1]}], "friction": 0.0, "contacts": None, "reason": "turning"}
    claim = files.few_contacts.read_claim(good | turned)
    grasp = read_grasp(made["g"], "g")
    assert files._beside(claim, {}, [grasp]).startswith("a grasp has 2 contacts, but no number of contacts on its surf")
    claim = files.few_contacts.read_claim(good | {"contacts": 3})
    assert files._beside(claim, {}, [grasp]).startswith("a grasp has 2 contacts, but 1 or 2 contacts on its surface")
    assert files._beside(files.few_contacts.read_claim(good), {}, [grasp]) == ""
