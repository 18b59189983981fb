"""Faults planted in the compiled functions of the kernels, each compiled and judged by the tests of its kernel.

`mutation.py kernels` runs them. `plant.py` cannot: its mutants are chosen while Python runs, and these functions are
compiled before. So each fault here is a piece of source and what stands in its place. It takes a minute to compile and,
where no test finds it, the two minutes of the tests: what is known is kept beside the copy of the sources in
build/mutation/kernels, and a run that was stopped goes on from there. A fault is tried again when its kernel or the
tests have changed.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
COPIED = ("src", "tests", "benchmarks", "pyproject.toml")
PATIENCE = 1800  # [s] after which tests do not end: a fault may keep compiled code in a loop
KILLED, ALIVE = "killed", "alive"


@dataclass(frozen=True)
class Fault:
    """A fault in a file of a kernel.

    Attributes:
        half: "stability" or "synthesis". file: in that half's search/kernel/.
        old, new: what stands there, once, and what is put in its place.
        about: what is wrong then.
    """

    half: str
    file: str
    old: str
    new: str
    about: str

    @property
    def name(self) -> str:
        return f"{self.half}/{self.file}: {self.about}"

    @property
    def path(self) -> Path:
        return Path("src") / "handfast" / self.half / "search" / "kernel" / self.file

    def planted(self) -> str:
        """The file with the fault in it."""
        text = (ROOT / self.path).read_text("utf-8")
        if text.count(self.old) != 1:
            raise SystemExit(f"{self.name}: '{self.old}' stands there {text.count(self.old)} times, not once")
        return text.replace(self.old, self.new)


FAULTS = (
    Fault("stability", "split.py", "child[1, 0] = OPEN", "child[1, 0] = CLOSED", "undecided contacts never open"),
    Fault(
        "stability", "split.py", "child[s, 1] + TURN_DIRECTIONS // 2", "child[s, 1] + TURN_DIRECTIONS // 4",
        "closed contacts lose half turns",
    ),
    Fault("stability", "split.py", "(third if s < 2 else TURN_DIRECTIONS - 2 * third)", "third",
          "a step of a turn is lost"),
    Fault("stability", "split.py", "child[1, 0] = MOVES", "child[1, 0] = LOCKED", "actuators never move"),
    Fault("stability", "values.py", "g[0] = mu * (1.0 + CONE_WIDENING)\n        g[1] = -xa",
          "g[0] = 0.99 * mu\n        g[1] = -xa",
          "friction is cut by a hundredth"),
    Fault("stability", "values.py", "-mu * (0.5 * h - CONE_WIDENING)", "-mu * (h - CONE_WIDENING)",
          "chords outside the arc"),
    Fault("stability", "values.py", "g[4] = -sin * (1.0 + CONE_WIDENING) * (xa + xb) / h", "g[4] = 0.0",
          "uncertain normals do not unload along one axis"),
    Fault("stability", "values.py", "cn * (2.0 * off[k] - cn)", "cn * (off[k] - cn)", "another balance of energy"),
    Fault("stability", "values.py", "rhs -= x * question.off[force + k]", "rhs += x * question.off[force + k]",
          "the load with the other sign"),
    Fault("stability", "simplex.py", "RAY if boxed <= PURE * cited else RAY_OF_BOX", "RAY", "rays of the box prove"),
    Fault("stability", "simplex.py", "theta = larger(work.y[leave], 0.0) * scale", "theta = 0.0",
          "multipliers are not carried on"),
    Fault("stability", "price.py", "if moves in (LOCKED, HIGH, LOW) and t > worst:",
          "if moves in (MOVES, HIGH, LOW) and t > worst:",
          "locked actuators move, moving ones do not"),
    Fault("stability", "newton.py", "gradients[1, 4] = w * u2 * u2 ", "gradients[1, 4] = w * u1 * u1 ",
          "the gradient along and across sliding"),
    Fault("stability", "newton.py", "residuals[e + 3] = c3 + mu * cn * x3", "residuals[e + 3] = c3 - mu * cn * x3",
          "torsion turns along"),
    Fault("stability", "newton.py", "if mode > GRAZE and c[k] < -slack:", "if mode > GRAZE and c[k] < -1e9 * slack:",
          "contacts that pull stay closed"),
    Fault("stability", "patch.py", "    if second:\n        size = -size\n    kept", "    kept",
          "both halves of a patch on one side"),
    Fault("stability", "tree.py", "found - gap * abs(found) - gap_absolute", "found + gap * abs(found) + gap_absolute",
          "a solution that is worse is better"),
    Fault("stability", "smoothed_state.py", "room.c[3 * i + 1] = -drag * d1", "room.c[3 * i + 1] = drag * d1",
          "friction along the motion"),
    Fault("stability", "batch_loop.py", "if pool.status[k] == UNRESOLVED:", "if pool.status[k] == WAITING:",
          "a row with unresolved nodes is refuted"),
    Fault("synthesis", "krawczyk.py", "if not reach * (1 + rounded) < radii[i]:",
          "if not reach * (1 + rounded) < 4 * radii[i]:", "a box is proved that does not contract"),
    Fault("synthesis", "krawczyk.py", "box[c, 0] - box[c, 1] * BALL_INFLATION, box[c, 0] + box[c, 1] * BALL_INFLATION",
          "box[c, 0] - box[c, 1] * BALL_INFLATION, box[c, 0]", "half of the box may stick out over a bound"),
    Fault("synthesis", "krawczyk.py", "proof.moved[i] = (abs(value) + total", "proof.moved[i] = (total",
          "the residual does not count"),
    Fault("synthesis", "krawczyk.py", "if not values[i, 0] - values[i, 1] * BALL_INFLATION > 0:",
          "if not values[i, 0] > 0:",
          "inequalities in the middle of the box alone"),
    Fault("synthesis", "balls.py", "a[1] * (abs(b[0]) + b[1]) + BALL_ROUNDOFF * abs(m)) * BALL_INFLATION",
          "a[1] * abs(b[0]) + BALL_ROUNDOFF * abs(m)) * BALL_INFLATION",
          "the product of two radii"),
    Fault("synthesis", "balls.py", "(a[1] + abs(m) * BALL_INFLATION * b[1]) / room", "a[1] / room",
          "the radius of a divisor"),
    Fault("synthesis", "balls.py", "return np.cos(a[0]), (min(a[1], 2.0) + CIRCULAR)",
          "return np.cos(a[0]), (0.5 * min(a[1], 2.0) + CIRCULAR)", "half the radius of a cosine"),
    Fault("synthesis", "narrowing.py", "top, bottom = -(least - g * low[i]) / g, -(most - g * high[i]) / g",
          "top, bottom = -(least - g * low[i]) / g, -(most - g * low[i]) / g", "the other end of a coordinate"),
    Fault("synthesis", "object_pose.py", "bend = 2.0 * far / least * TAYLOR_INFLATION",
          "bend = 0.5 * far / least * TAYLOR_INFLATION",
          "a quarter of what turning leaves out"),
    Fault("synthesis", "contact_equations.py", "work.object_surface[3 + way + other]",
          "work.object_surface[3 + 2 * way]",
          "second derivatives of a patch"),
    Fault("synthesis", "contact_equations.py", "put(values.inequality, k, scale(-1.0, dot(a, work.turned_vector)))",
          "put(values.inequality, k, scale(1.0, dot(a, work.turned_vector)))", "normals that do not oppose"),
    Fault("synthesis", "angle_terms.py", "0.578 * straight * straight", "0.1 * straight * straight",
          "how a line bends"),
    Fault("synthesis", "angle_terms.py", "a.remainder + b.remainder + a.stray * b.stray, half",
          "a.remainder + b.remainder, half", "what a product of two leaves out"),
    Fault("synthesis", "angle_terms.py", "both = a.stray * b.stray + b.stray * c.stray + a.stray * c.stray",
          "both = a.stray * b.stray + b.stray * c.stray", "what a product of three leaves out"),
    Fault("synthesis", "set_search.py", "(2 * e_size * e_error + e_stray * e_stray) * TAYLOR_INFLATION",
          "2 * e_size * e_error * TAYLOR_INFLATION", "what the square of a length leaves out"),
)  # fmt: skip


def run(folder: Path, size: int | None, seed: int) -> list[tuple[Fault, bool]]:
    """Which faults the tests of their kernel find: of all that are tried, or of so many, drawn at random.

    What is known is not tried again.

    Raises:
        SystemExit: a fault that cannot be planted, tests that fail without one.
    """
    chosen = list(FAULTS) if size is None else random.Random(seed).sample(FAULTS, min(size, len(FAULTS)))
    for fault in FAULTS:
        fault.planted()
    notes = folder / "known.json"
    known: dict[str, str] = json.loads(notes.read_text("utf-8")) if notes.exists() else {}
    found = []
    for fault in chosen:
        key = _key(fault)
        if key not in known:
            known[key] = _judged(fault, folder, known)
            notes.write_text(json.dumps(known, indent=1), encoding="utf-8")
            print(f"{known[key]}: {fault.name}", flush=True)
        found.append((fault, known[key] == KILLED))
    return found


def _judged(fault: Fault, folder: Path, known: dict[str, str]) -> str:
    """Whether the tests of its kernel find a fault; they have to pass without it, which is looked at once."""
    tree = folder / "tree"
    copy(COPIED, tree)
    clean = f"{fault.half}, no fault: {_digest(fault.half)}"
    if clean not in known:
        if not _passes(fault, tree, folder):
            raise SystemExit(f"the tests of the {fault.half} kernel fail without a fault; see {folder / 'log.txt'}")
        known[clean] = "pass"
    place = tree / fault.path
    own, codes = place.read_text("utf-8"), set(folder.rglob("kernel-*.o"))
    try:
        place.write_text(fault.planted(), encoding="utf-8")
        return ALIVE if _passes(fault, tree, folder) else KILLED
    finally:
        place.write_text(own, encoding="utf-8")
        for code in set(folder.rglob("kernel-*.o")) - codes:
            code.unlink()


def _passes(fault: Fault, tree: Path, folder: Path) -> bool:
    """Do the tests pass in this tree? Tests that do not end do not. What cannot be compiled ends the run."""
    library = "machine" if fault.half == "stability" else "library"
    compiles = f"from handfast.{fault.half}.search.{library} import LIBRARY; LIBRARY.machine_code()"
    if _ended([sys.executable, "-c", compiles], tree, folder) != 0:
        raise SystemExit(f"{fault.name}: cannot be compiled; see {folder / 'log.txt'}")
    tests = str(Path("tests") / fault.half / "search")
    code = _ended(
        [sys.executable, "-m", "pytest", tests, "-x", "-q", "-n", "0", "-p", "no:cacheprovider"], tree, folder
    )
    if code in (2, 3, 4, 5):  # pytest was interrupted, misused, or found no tests
        raise SystemExit(f"{fault.name}: the tests could not be run; see {folder / 'log.txt'}")
    return code == 0


def _ended(command: list[str], tree: Path, folder: Path) -> int:
    """The exit status of a command in the tree, with its own machine code; below 0 if it had to be ended."""
    environment = os.environ | {"PYTHONPATH": str(tree / "src"), "XDG_CACHE_HOME": str(folder / "cache")}
    with (folder / "log.txt").open("w") as log:
        running = subprocess.Popen(
            command, cwd=tree, env=environment, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
        )
        try:
            return running.wait(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            return -signal.SIGKILL
        finally:
            if running.poll() is None:
                os.killpg(running.pid, signal.SIGKILL)
                running.wait()


def copy(names: tuple[str, ...], target: Path) -> None:
    """Bring a copy of the repository's files and folders of these names up to date."""
    for name in names:
        for file in sorted((ROOT / name).rglob("*")) if (ROOT / name).is_dir() else [ROOT / name]:
            inside = file.relative_to(ROOT)
            # numba's machine code belongs to one path
            if file.is_dir() or "__pycache__" in file.parts:
                continue
            there = target / inside
            if not there.exists() or there.read_bytes() != file.read_bytes():
                there.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(file, there)


def _key(fault: Fault) -> str:
    """Of what is known of a fault: it, its kernel and the tests."""
    return f"{fault.name}: {_digest(fault.half, fault.old, fault.new)}"


def _digest(half: str, *texts: str) -> str:
    out = hashlib.sha256("\0".join(texts).encode())
    for folder in (ROOT / "src" / "handfast" / half / "search" / "kernel", ROOT / "tests" / half / "search"):
        for file in sorted(folder.glob("*.py")):
            out.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return out.hexdigest()[:16]
