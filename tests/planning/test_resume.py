"""Searches that are killed: what was found is there, no worker is left, and they go on without beginning anew."""

from __future__ import annotations

import json
import signal
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import load_task, verify
from handfast.cli.grasp import FindGrasps
from handfast.cli.plan import PlanGrasps
from handfast.core.errors import InputError
from handfast.core.parallel import START
from handfast.planning.results.search_file import load_search
from handfast.synthesis.search.starts import Certified, Starts
from handfast.synthesis.task_problem import TaskProblem
from tests.support.interruptions import interrupted_program, killed, python

TASK = "scalpel-incision"
PLAN = ["plan", "barrett-bh8-280", "ball", "--up", "z", "--seed", "3", "--count", "3"]
GRASP = ["grasp", TASK, "--up", "z", "--count", "6"]
ROUGH = {"seconds", "first_seconds"}  # what another run may say differently

needs_fork = pytest.mark.skipif(START != "fork", reason="there are no workers")


def plan(folder: Path, **options: Any) -> PlanGrasps:
    return PlanGrasps(
        hand="barrett-bh8-280", object="ball", up="z", seed=3, jobs=1, output=folder, json=True, **options
    )


def grasp(folder: Path, **options: Any) -> FindGrasps:
    return FindGrasps(task=TASK, up="z", jobs=1, output=folder, json=True, **options)


def contents(folder: Path) -> dict[str, Any]:
    """The folder's files, parsed, without what may differ from run to run."""
    return {file.name: without(json.loads(file.read_text("utf-8"))) for file in folder.glob("*.json")}


def without(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: without(value) for key, value in data.items() if key not in {*ROUGH, "checksum"}}
    return [without(value) for value in data] if isinstance(data, list) else data


def kill(arguments: list[str], folder: Path, step: str, call: int) -> None:
    """Run a command with two workers, kill it at a step, and see its workers end."""
    done = interrupted_program(step, call, *arguments, "--jobs", "2", "-o", str(folder), action=killed)
    assert (done.returncode, done.stderr) == (-signal.SIGKILL, "")
    workers_end(done.stdout)


def workers_end(processes: str) -> None:
    """Two at least, whose numbers were printed; a test that never ends fails."""
    children = [int(child) for child in processes.split()]
    assert len(children) >= 2
    while any(map(alive, children)):
        time.sleep(0.01)


def alive(process: int) -> bool:
    with suppress(OSError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


# --- plan ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plan") / "whole"
    assert plan(folder, count=2).run() == 0
    return folder


@needs_fork
@pytest.mark.slow
def test_a_plan_that_was_killed_goes_on_as_if_it_had_not_been(tmp_path: Path, planned: Path) -> None:
    folder = tmp_path / "out"
    kill([*PLAN[:-1], "200"], folder, "handfast.planning.results.folder.save_grasp", 2)
    kept = json.loads((folder / "plan.json").read_text("utf-8"))
    assert len(kept["grasps"]) == 1
    assert (folder / "001.grasp.json").exists()
    for entry in kept["grasps"]:
        assert (folder / entry["grasp_file"]).exists()
    before = {file.name: file.stat().st_mtime_ns for file in folder.glob("0*.json")}
    assert plan(folder, count=2, resume=True).run() == 0
    again = {name: (folder / name).stat().st_mtime_ns for name in before if int(name[:3]) < len(kept["grasps"])}
    assert again == {name: before[name] for name in again}  # nothing is found twice
    assert contents(folder) == contents(planned)


@pytest.mark.slow
def test_attempts_are_counted_from_the_first(tmp_path: Path, planned: Path) -> None:
    tried = json.loads((planned / "plan.json").read_text("utf-8"))["tried"]
    folder = tmp_path / "out"
    assert plan(folder, count=1).run() == 0  # all that was asked for
    for attempts in (2, tried):
        status = plan(folder, count=2, resume=True, attempts=attempts).run()
        assert json.loads((folder / "plan.json").read_text("utf-8"))["tried"] == attempts
    assert status == 0
    assert contents(folder) == contents(planned)


@pytest.mark.slow
def test_a_pool_is_kept_whole(tmp_path: Path, planned: Path) -> None:
    folder = tmp_path / "out"
    assert plan(folder, count=1, pool=2).run() == 0
    data = json.loads((folder / "plan.json").read_text("utf-8"))
    best = json.loads((planned / "plan.json").read_text("utf-8"))
    assert [e["attempt"] for e in data["grasps"]] == [best["grasps"][0]["attempt"]]
    assert data["tried"] == best["tried"]  # both were gathered
    assert sum(not e["fragile"] for e in (*data["grasps"], *data["others"])) == 2
    assert plan(folder, count=2, resume=True).run() == 0
    assert contents(folder) == contents(planned)


def copied(source: Path, target: Path) -> Path:
    target.mkdir()
    for file in source.iterdir():
        (target / file.name).write_bytes(file.read_bytes())
    return target


def test_a_plan_goes_on_only_with_what_it_was_asked(tmp_path: Path, planned: Path) -> None:
    folder = copied(planned, tmp_path / "out")
    for other in ({"mass": 0.3}, {"friction": 0.9}, {"eta": 1.0}, {"force_limit": 50.0}, {"approach": (0.1, 0.0, 1.0)}):
        with pytest.raises(InputError, match=r"plan\.json: question: was begun with another hand"):
            plan(folder, count=4, resume=True, **other).run()
    with pytest.raises(InputError, match="--resume or --force"):
        plan(folder, resume=True, force=True).run()
    with pytest.raises(InputError, match="holds a plan already; give --resume"):
        plan(folder).run()
    (folder / "plan.json").unlink()
    with pytest.raises(InputError, match="holds a plan already"):
        plan(folder).run()
    with pytest.raises(InputError, match="--resume: needs the folder"):
        PlanGrasps(hand="barrett-bh8-280", object="ball", resume=True).run()


def test_a_grasp_that_does_not_hold_is_not_gone_on_from(tmp_path: Path, planned: Path) -> None:
    folder = copied(planned, tmp_path / "out")
    file = folder / "000.grasp.json"
    data = json.loads(file.read_text("utf-8"))
    for contact in data["contacts"]:
        contact["friction"] = 0.01
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"000\.grasp\.json: does not hold what is asked"):
        plan(folder, count=4, resume=True).run()
    file.unlink()
    with pytest.raises(InputError, match=r"000\.grasp\.json: no such file"):
        plan(folder, count=4, resume=True).run()
    (folder / "plan.json").write_text('{"query": "plan"')
    with pytest.raises(InputError, match=r"plan\.json: is not valid JSON"):
        plan(folder, count=4, resume=True).run()


# --- grasp --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def searched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("grasp") / "whole"
    assert grasp(folder, count=3, timeout=float("inf")).run() == 0
    return folder


@needs_fork
@pytest.mark.slow
def test_a_search_that_was_killed_goes_on_as_if_it_had_not_been(tmp_path: Path, searched: Path) -> None:
    folder = tmp_path / "out"
    kill([*GRASP, "--timeout", "inf"], folder, "handfast.planning.results.folder.save_search", 1)
    assert len(load_search(folder / "search.json", load_task(TASK)).found) == 3
    assert verify(folder / "grasps.json").ok
    assert grasp(folder, count=3, resume=True, timeout=float("inf")).run() == 0
    assert verify(folder / "grasps.json").ok
    assert contents(folder) == contents(searched)


@pytest.mark.slow
def test_a_search_goes_on_to_more_grasps(tmp_path: Path, searched: Path) -> None:
    folder = tmp_path / "out"
    assert grasp(folder, count=1, timeout=float("inf")).run() == 0
    first = contents(folder)["grasp-1.json"]
    assert grasp(folder, count=3, resume=True, timeout=float("inf")).run() == 0
    now = [contents(folder)[f"grasp-{k}.json"] for k in (1, 2, 3)]
    kept = ("contacts", "joints", "preload", "mass")  # its rank, which its sources name, may be another
    assert [first[key] for key in kept] in [[g[key] for key in kept] for g in now]
    here, there = (load_search(f / "search.json", load_task(TASK)) for f in (folder, searched))
    assert [f.existence for f in here.found] == [f.existence for f in there.found]
    names = ("configuration-{}.json", "grasp-{}.json")
    for name in (n.format(k) for n in names for k in (1, 2, 3)):
        assert contents(folder)[name] == contents(searched)[name]


def test_a_search_that_has_enough_is_done_where_it_goes_on(tmp_path: Path, searched: Path) -> None:
    """It tries nothing: what was found before is found."""
    folder = copied(searched, tmp_path / "out")
    assert grasp(folder, count=3, resume=True).run() == 0
    assert contents(folder) == contents(searched)


def test_a_search_goes_on_only_with_what_it_was_asked(tmp_path: Path, searched: Path) -> None:
    folder = copied(searched, tmp_path / "out")
    for other in ({"mass": 0.3}, {"seed": 1}, {"depth": 2e-3}, {"eta": 1.0}):
        with pytest.raises(InputError, match=r"search\.json: question: was begun with another hand"):
            grasp(folder, count=4, resume=True, **other).run()
    with pytest.raises(InputError, match="holds grasps already; give --resume"):
        grasp(folder).run()
    with pytest.raises(InputError, match="--resume or --force"):
        grasp(folder, resume=True, force=True).run()
    with pytest.raises(InputError, match="--resume: needs the folder"):
        FindGrasps(task=TASK, resume=True).run()


@pytest.mark.parametrize(
    "at, value, fault",
    [
        (("existence", "position", 0), 0.3, r"found\[0\]\.existence: is not proved"),
        (("existence", "radii", 0), 1e-30, r"found\[0\]\.existence: is not proved"),
        (("preload",), {}, r"found\[0\]\.preload: does not hold every load"),
        (("preload",), {"nobody": 1.0}, r"found\[0\]\.preload: unknown actuator"),
        (("upper",), "1.0", r"found\[0\]\.upper: input should be a valid number"),
        (("existence", "contacts"), [], r"found\[0\]\.existence\.contacts: has 0 entries"),
    ],
)
def test_a_search_does_not_go_on_from_what_is_not_so(
    tmp_path: Path, searched: Path, at: tuple[Any, ...], value: object, fault: str
) -> None:
    folder = copied(searched, tmp_path / "out")
    file = folder / "search.json"
    data = json.loads(file.read_text("utf-8"))
    inner = data["found"][0]
    for key in at[:-1]:
        inner = inner[key]
    inner[at[-1]] = value
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match=fault):
        grasp(folder, count=3, resume=True).run()


def test_certified_configurations_come_back_from_their_proofs() -> None:
    problem = TaskProblem.of(load_task(TASK))
    for certified in Starts(problem, 0).run(5):
        again = Certified.of(certified.existence(problem), problem)
        np.testing.assert_array_equal(again.x, certified.x)
        np.testing.assert_array_equal(again.chosen, certified.chosen)
        np.testing.assert_array_equal(again.radii, certified.radii)


# --- many ---------------------------------------------------------------------------------------


MAP = """
import numpy as np
from handfast import load_grasp
from handfast.stability.studies.batch import max_many
from tests.support.interruptions import killed
angles = np.linspace(0, 6, 20000)
directions = [[np.cos(a), np.sin(a), 0, 0, 0, 0] for a in angles]
max_many(load_grasp("fig1"), directions, jobs=2, on_progress=lambda done, of: killed())
"""


@needs_fork
def test_the_workers_of_a_map_end_with_it() -> None:
    done = python(MAP)
    assert (done.returncode, done.stderr) == (-signal.SIGKILL, "")
    workers_end(done.stdout)
