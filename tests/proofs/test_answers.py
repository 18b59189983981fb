"""What is refused of answers about one disturbance: planted faults in files of every query."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from handfast.core.answer import Verdict
from handfast.model.grasp import Contact, Grasp
from handfast.proofs import answers, checker
from handfast.proofs.certificate import Certificate, proof_to_dict
from handfast.proofs.existence import prove
from handfast.proofs.fields import EQUALITY_TOLERANCE, BadFile
from handfast.proofs.files import verify
from handfast.proofs.kinds import TURN_DIRECTIONS, Row
from handfast.proofs.leaves import LeafSystems
from handfast.proofs.replay import Refused, Replay, down
from handfast.proofs.states import Problem
from handfast.proofs.tolerance import COMPLETE_CAP, TOO_SMALL, drives, motion_size, size_of
from handfast.stability.studies.questions import check, maximum, torques
from tests.support.problems import bell, nest, pinch
from tests.support.refused import refused
from tests.support.saved_answers import (
    FAULTS,
    certificate_of,
    deep,
    far_contact,
    hardly_loaded,
    idle_actuators,
    idle_and_slack,
    overload,
    proof,
    put,
    text,
    times,
    unbounded,
    w,
)

pytestmark = pytest.mark.usefixtures("proved_once")
ONE_LINE = re.compile(r"[^\n]+\Z")


def saved(name: str) -> dict[str, Any]:
    """An answer as it stands in a file."""
    return json.loads(text(name))


@cache
def is_proved(name: str) -> bool:
    return verify(saved(name)).ok


def reason(data: dict[str, Any]) -> str:
    """Why a file is refused, in one line."""
    try:
        done = verify(data)
    except BadFile as fault:  # not even a question
        said = f"{fault.field}: {fault.problem}"
    else:
        assert not done.ok
        said = done.reason
    assert ONE_LINE.match(said), said
    return said


@pytest.mark.parametrize(("name", "change", "why"), FAULTS, ids=range(len(FAULTS)))
def test_planted_faults_are_refused(name: str, change: Any, why: str) -> None:
    data = saved(name)
    assert is_proved(name)
    change(data)
    said = reason(data)
    assert re.search(why, said), said


# --- what an answer says, key by key ---------------------------------------------------------------


@pytest.mark.parametrize("name", ["check holds", "check slips", "max", "torques", "max with a hole"])
@pytest.mark.parametrize("place", [(), ("answer",), ("witness",), ("certificate",), ("question",)])
def test_keys_that_nobody_knows(name: str, place: tuple[str, ...]) -> None:
    data = saved(name)
    if deep(data, *place) is not None:
        deep(data, *place)["colour"] = "red"
        assert "colour" in reason(data)


@pytest.mark.parametrize("name", ["check holds", "check slips", "max", "torques", "undecided"])
@pytest.mark.parametrize("place", ["answer", "witness"])
def test_keys_that_are_missing(name: str, place: str) -> None:
    for key in saved(name)[place] or ():
        data = saved(name)
        del data[place][key]
        assert re.search(r"missing|a l.* of None|has a certificate, but|the answer says None", reason(data)), key


@pytest.mark.parametrize("key", ["nodes", "leaves", "rows", "references", "proof"])
def test_keys_of_certificates_that_are_missing(key: str) -> None:
    data = saved("max")
    del data["certificate"][key]
    assert reason(data) == f"certificate.{key}: is missing"


@pytest.mark.parametrize("name", ["check holds", "check slips", "max", "torques", "undecided"])
@pytest.mark.parametrize("verdict", list(Verdict))
@pytest.mark.parametrize("query", ["check", "max", "torques"])
def test_verdicts_and_queries_that_contradict(name: str, verdict: Verdict, query: str) -> None:
    data = saved(name)
    right = data["answer"]["verdict"], data["answer"]["query"]
    data["answer"] |= {"verdict": str(verdict), "query": query}
    if (str(verdict), query) == right:
        assert verify(data).ok
    else:
        reason(data)


def test_the_course_of_the_search_is_recorded_and_not_proved() -> None:
    """Another one shows the same. Nor does the replay say so."""
    data = saved("check slips")
    data["answer"] |= {"seconds": 1e3, "nodes": 7, "stop": "time", "verified": False}
    done = verify(data)
    assert done.ok
    assert answers.ANSWER_NOT_REPLAYED in done.not_replayed
    said = json.dumps(done.to_json() | {"not_replayed": []})
    assert not any(word in said for word in ("1000", "nodes", "time", "stop"))


# --- forged answers ----------------------------------------------------------------------------------


def test_the_first_schema_is_refused() -> None:
    data = saved("torques") | {"schema": "handfast/result/0"}
    with refused("is 'handfast/result/0'; 'handfast/result/1' is needed", "schema"):
        answers.read_answer(data)
    assert re.match(r"schema: is 'handfast/result/0'; 'handfast/result/1' or ", reason(data))


@pytest.mark.parametrize("shown", ["least", "above", "by nothing"])
def test_larger_commands_are_not_the_least(shown: str) -> None:
    """3.3 times the least commands of 0.045 N m hold as well. That they were the least is not proved."""
    data, more = saved("torques"), 3.3
    upper, preload = (
        more * data["answer"][key] if key == "upper" else data["answer"][key] for key in ("upper", "preload")
    )
    preload = {name: more * x for name, x in preload.items()}
    held = check(bell().with_commands(preload), w(0, 1, 0)).to_file()
    assert held["answer"]["verdict"] == "holds"
    data["witness"] = held["witness"]
    data["answer"] |= {name: held["answer"][name] for name in ("exact", "motion")} | {
        "upper": upper,
        "preload": preload,
    }
    assert verify(data).ok  # its lower bound is the true one still
    data["answer"]["lower"] *= more
    if shown == "by nothing":
        put("answer", "certified", to=False)(data)
        data["certificate"] = None
        assert "no certificate" in reason(data)
    elif shown == "least":
        assert re.match("certificate: it covers 0 to 0.0449.* the answer needs 0 to 0.148", reason(data))
    else:
        data["certificate"]["scalar"][1] *= more
        assert re.match(r"certificate: leaf \d+", reason(data))


def capped() -> dict[str, Any]:
    """A bound that is proved up to motions of 10^6 N: of a wedge without friction that is as good as flat."""
    wedge = Grasp([Contact([-0.05 * s, 0, 0], [s, 1e-7, 0], 0.0) for s in (1, -1)])
    return json.loads(json.dumps(maximum(wedge, w(0, -1, 0)).to_file()))


def test_a_cap_on_motions_is_told() -> None:
    exact = capped()["answer"]["motion_cap"]
    assert 1e6 < exact < 2e6
    for cap in (None, exact * (1 + 10 * EQUALITY_TOLERANCE), 2 * exact, -1.0, True, 10**50):
        data = capped()
        data["answer"]["motion_cap"] = cap
        assert reason(data) == "answer: motion_cap is not what the rest of the file shows"
    for cap in (exact, exact * (1 - 10 * EQUALITY_TOLERANCE), 0.5 * exact, 1.0, 1):  # no state that moves by up to it
        data = capped()
        data["answer"]["motion_cap"] = cap
        done = verify(data)
        assert done.part("certificate").figures["motion_cap"] == exact
        assert done.ok


def test_a_force_that_is_held_does_not_slip() -> None:
    """The table slips at 4 N; it is said that it slips at any."""
    data = saved("max")
    data["answer"] |= {"verdict": "slips", "lower": 0.0, "upper": 0.0, "gap": 0.0} | {"attained": True, "limit": None}
    data["answer"] |= {"exact": None, "motion": None}
    data["witness"] = None
    assert re.match("certificate: it covers .* to 0.4495.*; the answer needs .* to inf", reason(data))
    data["certificate"]["scalar"] = [data["certificate"]["scalar"][0], None]
    assert re.match(r"certificate: leaf \d+", reason(data))
    slips = saved("check slips")
    slips["question"]["wrench"] = [0, 0.000654, 0, 0, 0, 0]
    assert re.match(r"certificate: leaf \d+", reason(slips))


def test_a_wrong_certificate_is_refused_at_its_first_leaf_that_is_not_proved(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file with very many such leaves would take minutes, as each is tried in rational arithmetic."""
    tried: list[int] = []
    more_exactly = LeafSystems.more_exactly

    def counted(systems: LeafSystems, *args: Any) -> Any:
        tried.append(len(systems.count))
        return more_exactly(systems, *args)

    monkeypatch.setattr(checker, "LEAF_BATCH", 1)
    monkeypatch.setattr(LeafSystems, "more_exactly", counted)
    for name, path in (("check slips", ("certificate",)), ("max with a hole", ("slips", 0))):
        data = saved(name)
        proof(lambda c: {"multiplier": np.zeros_like(c.multiplier)}, *path)(data)
        tried.clear()
        assert re.search(r"leaf \d+", reason(data))
        assert tried == [1]


def test_commands_that_suffice_are_some() -> None:
    data = saved("torques")
    data["answer"] |= {"verdict": "slips", "lower": None, "upper": None, "preload": None, "exact": None, "motion": None}
    data["witness"] = None
    assert re.match("certificate: it covers 0 to 0.0449.* the answer needs 0 to inf", reason(data))
    data["certificate"]["scalar"] = [0.0, None]
    assert re.match(r"certificate: leaf \d+", reason(data))


def test_unbounded_means_as_far_as_the_search_goes() -> None:
    """A witness at less than the search's end does not show it, nor does none."""
    data = saved("max")
    unbounded(data)
    assert re.match(r"answer: unbounded, but shown up to 2\.22\d* only; 942\.4\d* is needed", reason(data))
    data["answer"]["lower"] = 1e3
    assert reason(data) == "answer: witness: it is a state under another disturbance"
    data = saved("max unbounded")
    data["witness"] = None
    assert reason(data) == "answer: HOLDS without a witness"


def test_a_state_of_the_base_load_but_for_rounding() -> None:
    """Its magnitude, w - base over the direction, may be rounded to less than 0; one that is truly less is refused."""
    read = answers.read_answer(saved("max with base"))
    assert read.witness is not None
    base, along = answers.line(read)
    said = replace(read, said=dict(read.said) | {"lower": 0.0})
    held = answers.Maximum().held(said, replace(read.witness, wrench=base - 1e-17 * along))
    assert held[0] == "the base load is resisted"
    assert held[3] == 0
    with pytest.raises(Refused, match="a state under another disturbance"):
        answers.Maximum().held(said, replace(read.witness, wrench=base - 1e-3 * along))


# --- certificates ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["check slips", "max", "torques", "max with base"])
def test_a_certificate_of_another_answer(name: str) -> None:
    for other in {"check slips", "max", "torques", "max with base"} - {name}:
        data = saved(name)
        data["certificate"] = saved(other)["certificate"]
        assert re.search("certificate", reason(data))


@pytest.mark.parametrize("name", ["check slips", "max", "torques", "max slips", "torques do not exist"])
def test_every_multiplier_counts(name: str) -> None:
    """Without those of a leaf nothing is proved of it."""
    data = saved(name)
    c = certificate_of(data, "certificate")
    for leaf in (0, len(c.start) - 2):
        less = saved(name)
        rows = slice(c.start[leaf], c.start[leaf + 1])
        y = c.multiplier.copy()
        y[rows] = 0.0
        proof(lambda _, y=y: {"multiplier": y})(less)
        assert re.match(rf"certificate: leaf {leaf} ", reason(less))


def test_a_capped_bound_is_far_above_the_forces_in_play() -> None:
    data = saved("max")
    q = answers.read_answer(data).question
    assert answers.cap_fault(q, 1e9, data["answer"]["upper"], None) == ""
    most = data["answer"]["upper"]  # states of this question are told divided by their magnitude
    assert re.match(f"it is proved for motions up to {most:.3g} N only", answers.cap_fault(q, 1.0, most, None))


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e5])
def test_a_cap_is_in_proportion_to_the_magnitude(size: float) -> None:
    """However long the direction is: at the bound or, where nothing is resisted, where it is as large as the rest."""
    q = answers.read_answer(saved("max")).question
    q = replace(q, direction=size * q.direction)
    assert answers.told_cap(q, 3.0, 2.0) == 6
    assert answers.told_cap(q, 3.0, 0.0) == 3
    assert answers.told_cap(replace(q, goal="check"), 3.0, 2.0) == 3
    of_load, rest = size_of(q.grasp, q.direction), drives(q)
    for magnitude in (0.0, rest / of_load):
        assert answers.cap_fault(q, 1.001 * COMPLETE_CAP * of_load, magnitude, None) == ""
        assert answers.cap_fault(q, 0.999 * COMPLETE_CAP * of_load, magnitude, None)
    free = replace(q, grasp=q.grasp.with_command(0 * q.grasp.command))  # nothing else acts
    assert answers.cap_fault(free, 1.001 * COMPLETE_CAP * of_load, 0.0, None) == ""
    assert answers.cap_fault(free, 0.999 * COMPLETE_CAP * of_load, 0.0, None)


@pytest.mark.parametrize(
    ("cap", "moved", "fault"),
    [
        (3 * COMPLETE_CAP, 3 * COMPLETE_CAP, ""),
        (3 * COMPLETE_CAP * (1 - 1e-9), 0.0, f"not {COMPLETE_CAP:g} times the forces in play, 3 N"),
        (4 * COMPLETE_CAP, 5 * COMPLETE_CAP, f"and its own witness moves by {5 * COMPLETE_CAP:.3g} N"),
    ],
)
def test_how_far_a_cap_has_to_be(cap: float, moved: float, fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answers, "in_play", lambda _, magnitude: 3.0 * magnitude)
    monkeypatch.setattr(answers, "motion_size", lambda *_: moved)
    q = answers.read_answer(saved("max")).question
    assert answers.cap_fault(q, cap, 1.0, np.zeros(6)).endswith(fault)
    assert bool(answers.cap_fault(q, cap, 1.0, np.zeros(6))) == bool(fault)


def test_a_bound_is_beyond_what_its_own_witness_moves_by(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(
        answers, "refuted", lambda *args: asked.append(args) or Replay("", "", "", {"motion_cap": None})
    )
    data = answers.read_answer(saved("max"))
    for one in (data, replace(data, witness=None)):
        answers._certificate(one, answers.QUERIES["max"])
    assert data.witness is not None
    (*_, motion, complete), (*_, none, _) = asked
    assert motion.tolist() == data.witness.state.motion.tolist()
    assert none is None
    assert complete


@pytest.mark.parametrize(("at", "within"), [(0.0, True), (1.0, True), (-1.0, False), (2.0, False), (None, False)])
def test_a_limit_lies_between_the_bounds(at: float | None, within: bool) -> None:
    data = saved("max")
    lower, upper = (data["answer"][key] for key in ("lower", "upper"))
    value = at if at is None else [lower * (1 - 1e-6), lower, upper, upper * (1 + 1e-6)][int(at) + 1]
    data["answer"] |= {"limit": {"value": value}, "attained": False}
    if within:
        done = verify(data)
        assert (done.ok, answers.LIMIT_CLAIM in done.not_replayed) == (True, True)
    else:
        assert reason(data) == "answer: its limit lies outside of its bounds"


def test_zeros_are_zeros() -> None:
    """Rounding is let pass as a share of the largest number that is shown."""
    assert answers.matches({"a": [0.0, 0]}, {"a": [0.0, 0.0]})
    assert not answers.matches({"a": [1e-12, 0]}, {"a": [0.0, 0.0]})


def test_states_of_smaller_magnitudes_are_read() -> None:
    assert answers.read_answer(saved("max with a hole")).arcs


def wedge(tilt: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """A check that holds, and one of the same question that slips up to a cap.

    A wedge of two contacts without friction carries 1 N with forces of 1 / (2 tilt), pressed in by 1 / (2 tilt^2). That
    tilt counts as rounding in a proof, which then goes up to a cap.
    """
    contacts = [{"position": [-0.05 * s, 0, 0], "normal": [s, tilt, 0], "friction": 0.0} for s in (1, -1)]
    grasp = {"schema": "handfast/grasp/1", "contacts": contacts}
    held, wrench = saved("check holds"), [0, -1, 0, 0, 0, 0]
    held["question"] = {"grasp": grasp, "goal": "check", "wrench": wrench}
    pressed = {"r": [0, -0.5 / tilt**2, 0, 0, 0, 0], "c": [0.5 / tilt, 0, 0] * 2}
    held["witness"] |= {"wrench": wrench, "command": {}, "q": [], "f": [], "coupling": []} | pressed
    q, state = answers.read_answer(held).question, answers.read_answer(held).witness.state
    proved = prove(Problem.of(q, q.grasp.command, q.wrench), state)
    held["answer"] |= {"exact": True, "motion": proved.motion} | answers.described(q.grasp, state, proved)

    zero = np.zeros(1, np.int64)
    rows = (np.full(2, int(Row.TANGENT)), np.arange(2), np.array([TURN_DIRECTIONS // 2, 0]), np.zeros(2, np.int64))
    forged = Certificate(q, None, zero - 1, zero, zero, zero, zero, np.array([0, 2]), *rows, np.ones(2))
    slips = held | {"witness": None, "certificate": proof_to_dict(forged)}
    slips["answer"] = held["answer"] | dict.fromkeys(answers.UNPROVED_STATE) | {"verdict": "slips", "certified": True}
    slips["answer"] |= {"exact": None, "motion": None, "motion_cap": checker.verify(forged).cap}
    return held, slips


@pytest.mark.parametrize("tilt", [10.0**-k for k in range(4, 14)])
def test_a_slip_up_to_a_cap_and_a_hold_beyond_it_name_their_motions(tilt: float) -> None:
    """Both are proved, and say of which motions."""
    held, slips = wedge(tilt)
    assert verify(held).ok
    assert held["answer"]["motion"] == pytest.approx(0.5 / tilt**2, rel=1e-6)
    claim = verify(held).part("witness").claim
    assert claim == f"the disturbance is resisted, with virtual motions of {held['answer']['motion']:.6g} N"

    cap = slips["answer"]["motion_cap"]
    if tilt < 1e-5:  # else the cap is not far above the forces in play
        assert verify(slips).ok
        assert verify(slips).part("certificate").claim.endswith(f"up to virtual motions of {down(cap)} N")
    assert cap < held["answer"]["motion"]


def test_a_smaller_cap_than_the_proved_one_may_be_named_and_no_larger_one() -> None:
    """No state that moves by up to C: so none that moves by less. A larger cap, or none, claims more than is shown.

    Rounding may differ from one computer to another, so a cap that is larger by that alone is the same. The replay
    names what the certificate shows, whatever the answer does.
    """
    _, slips = wedge(1e-8)
    exact = slips["answer"]["motion_cap"]
    for cap in (exact, exact * (1 - 10 * EQUALITY_TOLERANCE), 0.5 * exact, 1.0, 0.0):
        slips["answer"]["motion_cap"] = cap
        done = verify(slips)
        assert done.ok, done.reason
        assert done.part("certificate").figures["motion_cap"] == exact
        assert done.part("certificate").claim.endswith(f"up to virtual motions of {down(exact)} N")
    for cap in (exact * (1 + 10 * EQUALITY_TOLERANCE), 2 * exact, 1e300, -1.0, None, "1e4", True):
        slips["answer"]["motion_cap"] = cap
        assert reason(slips) == "answer: motion_cap is not what the rest of the file shows", cap


def test_a_cap_that_is_not_far_above_the_forces_in_play_is_refused_whatever_is_named() -> None:
    """It counts what the certificate shows. No larger number in the answer makes more of it."""
    _, slips = wedge(1e-4)
    exact = slips["answer"]["motion_cap"]
    for cap in (exact, 0.5 * exact, 1e12):
        slips["answer"]["motion_cap"] = cap
        assert "times the forces in play" in reason(slips)


def test_the_measure_of_motions() -> None:
    """At the contacts' centroid, turns by the farthest contact, hinges likewise; what may be off adds up."""
    q = answers.read_answer(saved("check holds")).question
    g = q.grasp
    at = np.zeros(6 + g.l)
    for r, size in (([3, 4, 0, 0, 0, 0], 5.0), ([0, 0, 0, 0, 0, 2], 2 * g.size)):
        x, y, z = r[3:]
        back = np.cross([x, y, z], g.centroid)
        at[:6] = np.r_[np.array(r[:3], dtype=float) - back, r[3:]]
        assert motion_size(g, at) == pytest.approx(size, rel=1e-9)
        assert motion_size(g, at) >= size * (1 - 1e-15)
        assert motion_size(g, np.stack([0 * at, at])) == motion_size(g, at)
    joint = at * 0
    joint[6] = -7.0
    assert motion_size(g, joint) == pytest.approx(7 * g.joint_units[0])
    off = np.zeros(6 + g.l)
    off[:3], off[6] = [0, 0.3, 0.4], 1.0
    assert motion_size(g, joint, off) == pytest.approx(max(8 * g.joint_units[0], 0.5))
    assert motion_size(g, 0 * at, off) == pytest.approx(max(0.5, g.joint_units[0]))
    off = np.r_[np.zeros(5), 1.0, np.zeros(g.l)]
    assert motion_size(g, 0 * at, off) == pytest.approx(max(g.size, np.linalg.norm(g.centroid)))


# --- smaller magnitudes --------------------------------------------------------------------------------


def forged(name: str) -> dict[str, Any]:
    """A result file in which something is claimed of smaller magnitudes that is not shown."""
    out = saved("max with a hole")
    said, arcs = out["answer"], out["arcs"]
    first, last = said["holes"][0]
    if name == "no hole":
        said["holes"] = []
    elif name == "hole one step longer":
        said["holes"] = [[first, last * 1.001]]
    elif name == "hole one step shorter":
        said["holes"] = [[first * 1.001, last]]
    elif name == "holds up to the hole's end":
        said["holds_from_zero_to"] = last
    elif name == "slips earlier":
        said["holds_from_zero_upper"] = said["holds_from_zero_to"]
    elif name == "finer than it is":
        said["resolution"] = 1e-6
    elif name == "no resolution":
        del said["resolution"]
    elif name == "no step at all":
        said["resolution"] = 0.0
    elif name == "a range is missing":
        del arcs[1]
    elif name == "a range is there twice":
        arcs.append(arcs[0])
    elif name == "a range is longer":
        arcs[-1]["last"] *= 1.01
    elif name == "a state is off":
        arcs[0]["controls"][-1]["c"][0] *= 1 + 1e-6
    elif name == "a state across the hole":
        ends = sorted(arcs, key=lambda a: a["first"])
        left = max((a for a in ends if a["last"] <= first), key=lambda a: a["last"])
        right = min((a for a in ends if a["first"] >= last), key=lambda a: a["first"])
        middle = [left["controls"][-1], right["controls"][0]]
        arcs.append({"first": left["last"], "last": right["first"], "controls": middle})
    elif name == "no certificate":
        out["slips"] = []
    elif name == "a wider certificate":
        lo, hi = out["slips"][0]["scalar"]
        out["slips"][0]["scalar"] = [0.9 * lo, hi * 1.1]
    elif name == "a certificate of another range":
        out["slips"][0] = out["certificate"]
    elif name == "nothing asked":
        said["holds_from_zero_to"] = None
    elif name == "nothing said":
        for key in ("holds_from_zero_to", "holds_from_zero_upper", "holes", "unproved", "resolution"):
            said.pop(key)
    return out


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("no hole", "it says"),
        ("hole one step longer", "it says"),
        ("hole one step shorter", "it says"),
        ("holds up to the hole's end", "it says"),
        ("slips earlier", "it says"),
        ("finer than it is", "it says"),
        ("no resolution", "its resolution is None"),
        ("no step at all", "its resolution is 0.0; a number above 0, of 1 at most, is needed"),
        ("a range is missing", "it says"),
        ("a range is there twice", "an arc is there twice"),
        ("a range is longer", "is missed by"),
        ("a state is off", "is missed by"),
        ("a state across the hole", "is missed by"),
        ("no certificate", "it says"),
        ("a wider certificate", "is not resisted with"),
        ("a certificate of another range", "it says"),
        ("nothing asked", "has holes, but does not say up to where everything is resisted"),
        ("nothing said", "claims nothing of them"),
    ],
)
def test_forged_ranges_are_refused(name: str, why: str) -> None:
    assert why in reason(forged(name))


def test_states_of_the_wrong_size_are_one_clear_line() -> None:
    data = saved("max with a hole")
    data["arcs"][2]["controls"][1]["c"].append(0.0)
    with refused("has 10 numbers; 9 are needed", "arcs[2].controls[1].c"):
        verify(data)


# --- nothing hides a load ------------------------------------------------------------------------------


def residual(done: Replay) -> float:
    part = done.part("witness")
    assert part is not None
    found = part.figures["residual"]
    assert isinstance(found, float)
    return found


@pytest.mark.parametrize("grow", [far_contact, hardly_loaded, idle_actuators, idle_and_slack])
def test_nothing_idle_hides_an_imbalance(grow: Callable[[dict], None]) -> None:
    """However large the numbers of what takes no part, what is missing is judged by what acts."""
    data = saved("check holds")
    grow(data)
    if grow is far_contact:  # of the others some torque goes nowhere
        assert residual(verify(data)) < 1e-9
    overload(data)
    assert residual(verify(data)) > 0.1
    assert re.match("witness: ", reason(data))


@pytest.mark.parametrize("size", [1.0, 1e-12, 1e-170, 1e-200, 1e-310])
def test_no_load_is_too_small_to_slip(size: float) -> None:
    """A fixture cannot pull: a state without forces is none under any load."""
    data = check(nest(), w(0, 0, -1)).to_file()
    for wrench in (data["question"]["wrench"], data["witness"]["wrench"]):
        wrench[2] = size
    for name in ("r", "c"):
        data["witness"][name] = [0.0] * len(data["witness"][name])
    assert re.match("witness: ", reason(data))
    data = check(nest(), w(0, 0, 1)).to_file()
    data["question"]["wrench"][2] = size
    said = verify(data).reason
    assert said == ("" if size > 1e-100 else f"certificate: {TOO_SMALL}")


@pytest.mark.parametrize("key", ["holes", "unproved"])
@pytest.mark.parametrize("value", [0, [1.0], [[1.0]], [[1.0, "2"]], "none", {"a": 1}])
def test_ranges_are_pairs_of_numbers(key: str, value: Any) -> None:
    data = saved("max with a hole")
    data["answer"][key] = value
    assert f"{key} is no list of pairs of numbers" in reason(data)


def test_certificates_of_smaller_magnitudes_are_a_list() -> None:
    data = saved("max with a hole") | {"slips": 3}
    assert reason(data) == "slips: is no list"


def test_numbers_that_no_box_can_be_made_of() -> None:
    data = saved("check holds")
    data["question"]["grasp"]["contacts"][0]["position"] = [5e-324, 5e-324, 5e-324]
    reason(data)


def test_a_bound_beyond_the_end_of_the_search_is_none() -> None:
    """What is claimed has to be shown up to twice the bound at least; else a range that is empty would do."""
    data = saved("max")
    far = 1e7 * data["answer"]["upper"]
    data["answer"] |= {"upper": far, "gap": far / data["answer"]["lower"] - 1}
    assert re.match(r"certificate: it covers .*; the answer needs ", reason(data))


def test_the_sense_of_a_command_is_that_of_the_question() -> None:
    """Pulled by commands of the other sense: what holds is no answer."""
    data = torques(pinch(), w(0, 1, 0)).to_file()
    assert verify(data).ok
    preload = data["question"]["grasp"]["preload"]
    put("question", "grasp", "preload", to={name: -x for name, x in preload.items()})(data)
    assert "a command has the wrong sense" in reason(data)


def test_what_is_shown_may_differ_by_rounding_only() -> None:
    data = saved("check holds")
    """What is a sum, by 10^-14 of its terms; what is copied not at all."""
    for name, by, key in (
        ("contacts", 9e-15, "friction_force"),
        ("contacts", -2e-14, "friction_force"),
        ("contacts", 1e-15, "normal_force"),
    ):
        data = saved("check holds")
        put("answer", name, 0, key, to=times(1 + by))(data)
        assert verify(data).ok == (by == 9e-15)
        if by != 9e-15:
            assert reason(data) == f"answer: {name} is not what the rest of the file shows"


def test_numbers_of_a_state_count_each_by_itself() -> None:
    """Where a force of another joint is 10^10 times as large, that of this one is told as it is, too."""
    for key in ("joint_torques", "actuator_forces", "joint_motion"):
        data = saved("check holds")
        told = data["answer"][key]
        name = min(told, key=lambda k: abs(told[k]))
        for by, right in ((0.0, True), (1e-9 * max(map(abs, told.values())), False)):
            data["answer"][key] = told | {name: told[name] + by}
            assert verify(data).ok == right


def test_commands_that_are_told_are_those_that_are_proved() -> None:
    data = json.loads(json.dumps(torques(pinch(), w(0, 1, 0)).to_file()))
    name, value = next(iter(data["answer"]["preload"].items()))
    data["answer"]["preload"][name] = np.nextafter(value, 1.0)
    assert reason(data) == "answer: preload is not what the rest of the file shows"


def test_numbers_are_numbers() -> None:
    for value in (True, "2.2", [2.2], {}):
        data = saved("max")
        data["answer"]["lower"] = value
        reason(data)
    assert np.isfinite(saved("max")["answer"]["lower"])


@pytest.mark.parametrize("k", [0, 1])
def test_soft_fingers_beside_contacts_without_torsion(k: int) -> None:
    """Fingers push along x; the soft one alone takes a torque about x: mu_tau c_n = 5 mm * 1 N."""
    grasp = pinch()
    contacts = [replace(contact, torsion=0.005 * (i == k)) for i, contact in enumerate(grasp.contacts)]
    grasp = Grasp(contacts, grasp.joints, preload={"right": 0.1, "left": 0.1})
    data = check(grasp, [0, 0, 0, 0.003, 0, 0]).to_file()
    data = json.loads(json.dumps(data))
    assert verify(data).ok
    assert [("torsion" in x) for x in data["answer"]["contacts"]] == [i == k for i in range(2)]
    data["answer"]["contacts"][k]["torsion"] *= 2
    assert reason(data) == "answer: contacts is not what the rest of the file shows"
    data["answer"]["contacts"][1 - k]["torsion"] = 0.0
    assert reason(data) == "answer: contacts is not what the rest of the file shows"
    data["answer"]["contacts"][k] = 1
    assert reason(data) == "answer: contacts is not what the rest of the file shows"
