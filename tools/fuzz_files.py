"""Mutated files of every kind: whatever they hold, they are read or refused by one line, and nothing false is proved.

    python tools/fuzz_files.py --count 10000 --seed 1 --keep /tmp/faults
    python tools/fuzz_files.py --count 5000 --seed 2 --kinds result certificate

Every file is one of ours with one to three mutations: bytes flipped, lost or doubled, a file cut short; in JSON fields
deleted, retyped, doubled, nested, swapped, numbers made extreme or a little different (checksums are renewed, else
nothing else would be seen); in XML and meshes numbers and names replaced. File `i` of a seed is always the same.

It is read, used a little, and if it is an answer verified, in a process of its own, so that a crash or an endless loop
is a finding too. Outcomes are counted; faults are printed, and kept with their files if a folder is given. Answers that
are accepted though they claim something else than the original are asked anew, and printed if they are not so.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import random
import re
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from handfast import (
    check,
    load_body,
    load_configuration,
    load_grasp,
    load_hand,
    load_task,
    maximum,
    torques,
)
from handfast.core import bundled
from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.geometry.scene import Scene
from handfast.model import mesh_pieces
from handfast.model.hand.coupling import driver_ranges
from handfast.planning.grasp_for import grasp_for
from handfast.planning.results.search_file import load_search, save_search
from handfast.proofs import answers as saved_answers
from handfast.proofs.certificate import file_to_dict
from handfast.readers.grasp_file import from_dict, to_dict
from handfast.readers.region_file import load_hand_regions
from handfast.saved import verify
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.loads import Loads, load_loads
from handfast.stability.problem.settings import Settings
from handfast.synthesis.embedded_task import digest
from handfast.synthesis.query import synthesize

PATIENCE = 120.0  # [s] for one file
EXTREME = ["0", "-0.0", "-1", "1e308", "-1e308", "1e-308", "5e-324", "1e999", "NaN", "-Infinity", "2147483648", "1e20"]
EXTREME += [
    "9223372036854775808",
    "9" * 400,
    "9" * 5000,
    "1e6",
    "1e-9",
    "0.1e-13",
    "1e150",
    "1e-150",
    "1.7976931348623157e308",
]
STRINGS = ["", "x", "0.5", "\ud800", "\0", "../../etc/passwd", "a" * 300, "é", "nan", "palm", "\n", "%s", "/dev/null"]
NUMBER = re.compile(rb"(?<![\w.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?(?![\w.])")
RAW = "@raw@"  # stands in JSON for text that `json.dumps` would not write


# --- samples ------------------------------------------------------------------------------------


def samples(folder: Path) -> dict[str, list[Path]]:
    """Files of every kind, those that are bundled and some that are made now."""
    data = bundled.folder("grasps").parent
    out: dict[str, list[Path]] = {
        "grasp": sorted((data / "grasps").glob("*.json")),
        "configuration": sorted((data / "configurations").glob("*.json")),
        "body": sorted((data / "objects").glob("*.json")),
        "task": sorted((data / "tasks").glob("*.json")),
        "regions": sorted((data / "hand_regions").glob("*.json")),
        "urdf": sorted((data / "hands").glob("*.urdf")),
        "mjcf": [*sorted((data / "hands").glob("*.xml")), write(folder / "hand.xml", MJCF)],
    }
    wrench = [0.0, 0.0, -0.4, 0.0, 0.0, 0.0]
    loads = {"schema": "handfast/loads/1", "loads": {"weight": wrench, "push": [0.1, 0, 0, 0, 0, 0.01]}}
    out["loads"] = [write(folder / "loads.json", json.dumps(loads))]
    small = Settings(jobs=1)
    answers: dict[str, Any] = {}
    for name in ("fig1", "fig7", "barrett-ball"):
        grasp = load_grasp(name)
        for force in (1.0, 2.5, 20.0):
            answers[f"check-{name}-{force:g}"] = check(grasp, [0, force, 0, 0, 0, 0], settings=small)
        for axis in ([0, 1, 0, 0, 0, 0], [0, -1, 0, 0, 0, 0], [0, 0, 0, 0.01, 0, 0]):
            answers[f"max-{name}-{axis}"] = maximum(grasp, axis, settings=small)
        answers[f"torques-{name}"] = torques(grasp, [0, 1, 0, 0, 0, 0], settings=small)
    answers["limited"] = maximum(
        load_grasp("fig1"), [0, 1, 0, 0, 0, 0], base=[0, 0.3, 0, 0, 0, 0], limits=GraspLimits(force_limit=5.0)
    )
    out["result"], out["certificate"] = [], []
    for name, answer in answers.items():
        out["result"].append(folder / f"{name}.result.json")
        answer.save(out["result"][-1])
        if answer.certificate:
            out["certificate"].append(folder / f"{name}.certificate.json")
            question = answer.posed.to_json()
            write(out["certificate"][-1], json.dumps(file_to_dict(answer.certificate, question)))
    task = load_task("scalpel-upholding")
    out["synthesis"] = [folder / "found.synthesis.json", folder / "open.synthesis.json"]
    synthesize(task, count=2, timeout=30).save(out["synthesis"][0])
    synthesize(load_task("scalpel-handling"), count=99, timeout=0.5).save(out["synthesis"][1])
    body = load_body("scalpel")
    grasps = grasp_for(
        load_task("scalpel-incision"),
        body,
        Loads.gravity(body, ["-z"]),
        jobs=1,
        timeout=None,
    )
    out["grasps"], out["search"] = [folder / "grasps.json"], [folder / "search.json"]
    grasps.save(out["grasps"][0])
    save_search(grasps.search, out["search"][0])
    import trimesh

    solids = {"box": trimesh.creation.box((0.1, 0.2, 0.3)), "ball": trimesh.creation.icosphere(1, 0.05)}
    out["mesh"] = []
    for name, solid in solids.items():
        for kind, options in {"obj": {}, "stl": {}, "ply": {}, "off": {}}.items():
            file = folder / f"{name}.{kind}"
            solid.export(file, **options)
            out["mesh"].append(file)
        ascii_ = {"encoding": "ascii"}
        solid.export(folder / f"{name}-text.ply", **ascii_)
        solid.export(folder / f"{name}-text.stl", file_type="stl_ascii")
        out["mesh"] += [folder / f"{name}-text.ply", folder / f"{name}-text.stl"]
    return out


MJCF = """<mujoco model="two"><compiler angle="radian"/><asset>
<mesh name="t" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset><worldbody><body name="palm">
<geom type="box" size=".03 .03 .01"/><body name="p" pos=".05 0 0" quat="1 0 0 0">
<joint name="a" axis="0 -1 0" range="0 1.5" ref="0.1"/><geom type="mesh" mesh="t"/>
<body name="d" pos=".05 0 0"><joint name="b" axis="0 -1 0" range="-0.1 1.2"/><geom type="capsule" size=".01 .03"/>
</body></body><body name="s" pos="-.05 0 0"><joint name="c" type="slide" axis="1 0 0" range="-0.01 0.05"/>
<geom type="ellipsoid" size=".01 .02 .03"/></body></body></worldbody>
<equality><joint joint1="b" joint2="a" polycoef="0 0.5 0 0 0"/></equality>
<tendon><fixed name="w"><joint joint="a" coef="0.01"/><joint joint="b" coef="0.02"/></fixed></tendon>
<actuator><motor name="m" tendon="w" gear="1" ctrllimited="true" ctrlrange="0 10"/>
<motor name="n" joint="c"/></actuator>
</mujoco>"""


def write(path: Path, text: str) -> Path:
    path.write_text(text, "utf-8")
    return path


# --- mutations ----------------------------------------------------------------------------------


def mutated(rng: random.Random, path: Path) -> bytes:
    """One to three mutations of a file."""
    data = path.read_bytes()
    is_json = path.suffix == ".json"
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        if is_json and rng.random() < 0.85:
            try:
                value = json.loads(data)
            except (ValueError, RecursionError):
                return data
            return in_json(rng, value)
        change = in_text if not is_json and rng.random() < 0.6 else in_bytes
        data = change(rng, data)
    return data


def in_bytes(rng: random.Random, data: bytes) -> bytes:
    at = rng.randrange(len(data) + 1)
    end = min(len(data), at + rng.choice([1, 4, 50, 1000]))
    match rng.randrange(6):
        case 0:
            return data[:at]
        case 1:
            return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]
        case 2:
            return data[:at] + data[end:]
        case 3:
            return data[:end] + data[at:end] * rng.choice([1, 2, 100]) + data[end:]
        case 4:
            return (
                data[:at] + rng.choice([b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"[" * 100_000, b"9" * 5000]) + data[at:]
            )
        case _:
            changed = bytearray(data)
            for _ in range(rng.randint(1, 20)):
                if changed:
                    changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
            return bytes(changed)


def in_text(rng: random.Random, data: bytes) -> bytes:
    """A number replaced, a word in quotation marks replaced or lost, a line lost or doubled."""
    numbers, words = list(NUMBER.finditer(data)), list(re.finditer(rb'"[^"<>]*"', data))
    choice = rng.randrange(5)
    if choice <= 1 and numbers:
        place, new = rng.choice(numbers), rng.choice([*EXTREME, "inf", "nan", "abc", "-5", "3", "1000000000"]).encode()
    elif choice == 2 and words:
        other = rng.choice(words)[0]
        texts = [b'"' + s.encode("utf-8", "surrogatepass").replace(b'"', b"") + b'"' for s in STRINGS]
        place, new = rng.choice(words), rng.choice([other, other, *texts])
    else:
        lines = data.splitlines(keepends=True) or [b""]
        k = rng.randrange(len(lines))
        lines[k : k + 1] = rng.choice([[], [lines[k]] * 2, [rng.choice(lines)], [lines[k], rng.choice(lines)]])
        return b"".join(lines)
    return data[: place.start()] + new + data[place.end() :]


def in_json(rng: random.Random, value: Any) -> bytes:
    """Some fields mutated, and the checksum renewed."""
    raw: list[str] = []
    gentle = rng.random() < 0.5
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        if gentle:
            nudge(rng, value)
            continue
        places = list(walk(value))
        if rng.random() < 0.5:  # rather what stands alone than one of a thousand numbers
            places = [p for p in places if not isinstance(p[0], list)] or places
        if not places:
            break
        holder, key = rng.choice(places)
        mutate(rng, holder, key, raw)
    if isinstance(value, dict) and "checksum" in value and not raw and rng.random() < 0.9:
        with suppress(ValueError):
            value["checksum"] = digest({k: v for k, v in value.items() if k != "checksum"})
    text = json.dumps(value)
    for k, new in enumerate(raw):
        text = text.replace(f'"{RAW}{k}"', new)
    return text.encode("utf-8", "surrogatepass")


def walk(value: Any) -> Any:
    """(holder, key) of everything in a JSON value."""
    todo = [value]
    while todo:
        x = todo.pop()
        keys = list(x) if isinstance(x, dict) else range(len(x)) if isinstance(x, list) else ()
        for key in keys:
            yield x, key
            todo.append(x[key])


def nudge(rng: random.Random, value: Any) -> None:
    """Another number, name or truth value in one place: a file that is well formed."""
    holder, key = descent(rng, value)
    if holder is None:
        return
    old, (there, other) = holder[key], descent(rng, value)
    if isinstance(old, bool):
        holder[key] = not old
    elif isinstance(old, int):
        holder[key] = rng.choice([old + 1, old - 1, 0, 2 * old, -old, rng.randrange(30)])
    elif isinstance(old, float) and rng.random() < 0.7:
        factor = 1 + rng.choice([1e-15, 1e-12, 1e-9, 1e-6, 1e-3, -1e-3, 0.1, -0.1, -2, 1, 9, 1e4, 1e9, -0.5, -1])
        holder[key] = old * factor + rng.choice([0, 0, 0, 1e-6, 1e-3, 1.0])
    elif there is not None and type(there[other]) is type(old):
        holder[key], there[other] = there[other], old
    elif isinstance(old, str):
        names = ["holds", "slips", "found", "none", "complete", "check", "max", "torques", "largest", "sum", "revolute"]
        holder[key] = rng.choice([*names, "prismatic", "smallest preload", "undecided", "time"])
    elif old is None:
        holder[key] = rng.choice([0.0, 1.0, 10.0])


def descent(rng: random.Random, value: Any) -> Any:
    """(holder, key) of something that holds nothing, each branch as likely: few fields are as good as many numbers."""
    holder, key = None, None
    while isinstance(value, dict | list) and value:
        holder, key = value, rng.choice(list(value)) if isinstance(value, dict) else rng.randrange(len(value))
        value = holder[key]
    return (None, None) if isinstance(value, dict | list) else (holder, key)


def mutate(rng: random.Random, holder: Any, key: Any, raw: list[str]) -> None:
    def text(new: str) -> str:
        raw.append(new)
        return f"{RAW}{len(raw) - 1}"

    old = holder[key]
    match rng.randrange(9):
        case 0:
            del holder[key]
        case 1:
            retyped = [None, True, False, "0.5", str(old)[:50], [], {}, [old], {"x": old}, 0, 1.5, -1]
            holder[key] = rng.choice(retyped)
        case 2:
            holder[key] = text(rng.choice(EXTREME))
        case 3 if isinstance(old, int | float) and not isinstance(old, bool):
            new = float(old) * (1 + rng.choice([1e-15, 1e-12, 1e-9, 1e-6, 1e-3, -1e-3, -2, 1, 9, -0.5]))
            holder[key] = round(new) if isinstance(old, int) else new
        case 3 if isinstance(old, str):
            holder[key] = rng.choice(STRINGS)
        case 4 if isinstance(old, int) and not isinstance(old, bool):
            holder[key] = old + rng.choice([-1, 1, 2, -old, 100, 1 << 24])
        case 5 if isinstance(holder, dict):
            name = rng.choice([key, "x", "schema", *holder])
            copy = json.dumps(old)
            holder[key] = text(f"{copy}, {json.dumps(name)}: {copy}")
        case 5:
            holder.insert(key, old)
        case 6 if isinstance(holder, dict):
            holder[rng.choice(["x", "", "\ud800", key + "_", *holder])] = old
        case 6:
            other = rng.randrange(len(holder))
            holder[key], holder[other] = holder[other], old
        case 7:
            depth = rng.choice([3, 60, 900, 100_000])
            holder[key] = text("[" * depth + "0" + "]" * depth)
        case _:
            holder[key] = (
                rng.choice(STRINGS) if rng.random() < 0.3 else text(rng.choice(["0", "1", "1e-3", "-1", "true"]))
            )


# --- what is done with a file -------------------------------------------------------------------

BALL = "ball"


def use_grasp(path: Path) -> str:
    grasp = load_grasp(path)
    to_dict(grasp)
    check(grasp, np.sum(grasp.G[:, ::3], axis=1), settings=Settings(nodes=50, timeout=5.0, jobs=1))
    return "loaded"


def use_configuration(path: Path) -> str:
    placed = load_configuration(path)
    hand, q = placed.applied(load_hand(placed.hand or "barrett-bh8-280"))
    hand.link_poses(q)
    return "loaded"


def use_hand(path: Path) -> str:
    hand = load_hand(path)
    hand.link_poses(hand.configuration())
    driver_ranges(hand)
    Scene(hand, load_body(BALL)).clearances(hand.configuration(), np.eye(4))
    return "loaded"


def use_body(path: Path) -> str:
    body = load_body(path)
    Scene(load_hand("parallel-gripper"), body).distance(load_hand("parallel-gripper").configuration(), np.eye(4))
    if body.mass:
        Loads.gravity(body)
    return "loaded"


def use_task(path: Path) -> str:
    task = load_task(path)
    driver_ranges(task.hand, task.involved.tolist())
    return "loaded"


def use(function: Callable[[Path], Any]) -> Callable[[Path], str]:
    def used(path: Path) -> str:
        function(path)
        return "loaded"

    return used


def use_answer(path: Path) -> str:
    return "proved" if verify(path).ok else "not proved"


USES: dict[str, Callable[[Path], str]] = {
    "grasp": use_grasp,
    "configuration": use_configuration,
    "body": use_body,
    "task": use_task,
    "regions": use(load_hand_regions),
    "loads": use(load_loads),
    "urdf": use_hand,
    "mjcf": use_hand,
    "mesh": use_body,
    "search": use(lambda path: load_search(path, load_task("scalpel-incision"))),
} | dict.fromkeys(("result", "certificate", "synthesis", "grasps"), use_answer)


def outcome(kind: str, path: Path) -> tuple[str, str]:
    """What became of a file, and more about a fault."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            return USES[kind](path), ""
    except InputError as fault:
        line = str(fault)
        if "\n" in line or not line:
            return "FAULT", f"not one line: {line!r}"
        return "refused", line
    except Exception:
        return "FAULT", traceback.format_exc()


# --- claims -------------------------------------------------------------------------------------


def claim(path: Path) -> Any:
    """What a result file claims: the question without labels, and what is said to be proved."""
    data = json.loads(path.read_text("utf-8"))
    said = {key: value for key, value in data["answer"].items() if key not in saved_answers.COURSE_KEYS}
    question = data["question"]
    question["grasp"] = to_dict(from_dict(question["grasp"])) | {"name": ""}
    for contact in question["grasp"]["contacts"]:
        del contact["link"], contact["depth"]
    return {"question": question, "answer": said}


def contradicted(path: Path) -> str:
    """Why an accepted result is not so, asked anew; '' if it may be."""
    data = json.loads(path.read_text("utf-8"))
    saved = saved_answers.read_answer(data)
    q, said, grasp = saved.question, saved.said, from_dict(data["question"]["grasp"])
    settings = Settings(timeout=20.0, jobs=1)
    within = GraspLimits(q.eta, q.torque_limits, q.force_limit if np.isfinite(q.force_limit) else None)
    limits: dict[str, Any] = {"limits": within, "mdp": q.mdp, "settings": settings}
    if said["query"] == "check":
        fresh = check(grasp, q.wrench, **limits)
        if {fresh.verdict, said["verdict"]} == {Verdict.HOLDS, Verdict.SLIPS}:
            return f"says {said['verdict']}, is {fresh.verdict}"
    elif said["query"] == "max":
        base, along = (q.wrench, q.direction) if q.has_scalar else (np.zeros(6), q.wrench)
        again = maximum(grasp, along, base=base, **limits)
        lower, upper = said["lower"], np.inf if said["upper"] is None else said["upper"]
        room = 1e-6 * max(abs(again.lower), 1e-9)
        if again.lower > upper + room or (again.upper < lower - room and not again.unbounded):
            return f"says {lower} to {upper}, is {again.lower} to {again.upper}"
    return ""


def differences(a: Any, b: Any, at: str = "") -> list[str]:
    """Where two JSON values differ, one line each."""
    if isinstance(a, dict) and isinstance(b, dict):
        return [d for k in {**a, **b} for d in differences(a.get(k), b.get(k), f"{at}.{k}")]
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        return [d for i, (x, y) in enumerate(zip(a, b, strict=True)) for d in differences(x, y, f"{at}[{i}]")]
    return [] if a == b else [f"{at}: {str(a)[:60]} -> {str(b)[:60]}"]


# --- the whole ----------------------------------------------------------------------------------


def sample_and_file(seed: int, index: int, files: dict[str, list[Path]], folder: Path) -> tuple[str, Path, Path]:
    """The kind, the original and the mutated file of a number."""
    rng = random.Random(f"{seed} {index}")
    kind = rng.choice(list(files))
    original = rng.choice(files[kind])
    path = folder / f"{index}-{original.name}"
    path.write_bytes(mutated(rng, original))
    return kind, original, path


def work(channel: Any, seed: int, indices: range, files: dict[str, list[Path]], folder: Path) -> None:
    """Send (index, kind, outcome, more) of each file."""
    mesh_pieces.COACD_SECONDS = 10
    for mesh in files.get("mesh", []):
        (folder / mesh.name).write_bytes(mesh.read_bytes())  # what other files name
    for file in bundled.folder("objects").iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    for index in indices:
        kind, original, path = sample_and_file(seed, index, files, folder)
        channel.send((index, kind, original.name))
        what, more = outcome(kind, path)
        if what == "proved" and kind == "result":
            changed = differences(claim(original), claim(path))
            if changed:
                why = contradicted(path)
                what, more = (
                    ("FALSE", why + "; " + "; ".join(changed)) if why else ("proved, another claim", changed[0])
                )
        channel.send((what, more))
        if what not in ("FAULT", "FALSE"):
            path.unlink()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="*", default=None)
    parser.add_argument("--keep", type=Path, default=None, help="folder for files with faults")
    parser.add_argument("--verbose", action="store_true", help="print accepted files with other claims, too")
    a = parser.parse_args()
    begin = time.monotonic()
    counts: Counter[tuple[str, str]] = Counter()
    faults: list[str] = []
    with tempfile.TemporaryDirectory() as made:
        (Path(made) / "samples").mkdir()
        (Path(made) / "work").mkdir()
        files = samples(Path(made) / "samples")
        files = {kind: files[kind] for kind in (a.kinds or files)}
        for kind, some in files.items():  # else nothing is shown
            for file in some:
                assert outcome(kind, file)[0] in ("loaded", "proved"), (file, outcome(kind, file))
        print(f"{sum(map(len, files.values()))} originals", file=sys.stderr)
        index, last = a.first, a.first + a.count
        context = multiprocessing.get_context("fork")
        while index < last:
            mine, theirs = context.Pipe(duplex=False)
            arguments = (theirs, a.seed, range(index, last), files, Path(made) / "work")
            worker = context.Process(target=work, args=arguments, daemon=True)
            worker.start()
            theirs.close()
            while index < last:
                now: Any = (index, "?", "?")
                try:
                    now = mine.recv() if mine.poll(PATIENCE) else now
                    got = mine.recv() if mine.poll(PATIENCE) else ("HANGS", "")
                except EOFError:
                    worker.join()
                    got = ("CRASH", f"exit code {worker.exitcode}")
                _, kind, name = now
                what, more = got
                counts[kind, what] += 1
                if what.isupper():
                    faults.append(f"{what} {index} {kind} {name}\n{more}")
                    print(faults[-1], flush=True)
                    kept = Path(made) / "work" / f"{index}-{name}"
                    if a.keep and kept.exists():
                        a.keep.mkdir(parents=True, exist_ok=True)
                        (a.keep / f"{a.seed}-{kept.name}").write_bytes(kept.read_bytes())
                elif a.verbose and "another" in what:
                    print(f"{what} {index} {name}: {more}", flush=True)
                index += 1
                if what in ("CRASH", "HANGS"):
                    break
            worker.kill()
            worker.join()
    print(f"seed {a.seed}, {a.count} files in {time.monotonic() - begin:.0f} s")
    for (kind, what), n in sorted(counts.items()):
        print(f"{kind:14} {what:22} {n}")
    print(f"{len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
