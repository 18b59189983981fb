"""First the squeeze, then the load: do answers along a path agree with a dynamics engine better than the paper's?

    python -m benchmarks.load_path [--hands FOLDER] [--shared ../shared] [--seconds 3600]
                                   [--again | --simulate | --tables]

Asks the questions of `benchmarks.simulation_agreement` again, at the same loads, with `loading="preload-first"`, and
holds the answers against the engine's stored outcomes with the commands first: all that have a bounded maximum, in one
shuffled order, so that what is asked is a fair sample wherever it ends. Questions of hands that are not in the
repository are left out unless the folders have them. Also the processor time of each path beside that of a check.
With `--simulate` those that were asked are simulated again, with commands that grow slowly: the stored ones act at once
and squeeze with a jolt; those that are not fragile first. With `--again` those that were asked by an older rule of
`check` are asked again, those that are not fragile first, at the loads where today's rule can change the answer.
Writes results/load_path.json as it goes on, and goes on where it was stopped. `--tables` prints those of
docs/load-path.md. Shadow and Adroit hands are counted apart.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import simulation_agreement as study
from benchmarks.agreement_grasps import questions
from benchmarks.closed_grasps import ClosedHands, add_folders
from benchmarks.machine import describe
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.simulation.simulate import simulate
from handfast.stability.answers.check_query import CheckAnswer
from handfast.stability.answers.load_path import LoadPath
from handfast.stability.problem.settings import Loading, Settings
from handfast.stability.studies.questions import check

RESULTS = Path(__file__).parent / "results" / "load_path.json"
LIMIT = Settings(timeout=20.0)
FIRST: Loading = "preload-first"
APART = "closed shadow", "closed adroit"  # families of hands that few have, not among all
RULE = 2  # of `check` on a path: 1 ended with two slips in turn, 2 goes on where the last step alone slips
CLOSING = 4.0  # [s of the twin] over which commands grow with --simulate


def rows_of(question: dict[str, Any]) -> list[dict[str, Any]]:
    """The simulations of a stored question with the commands first."""
    return [row for row in question["rows"] if row["loading"] == FIRST]


def timed(grasp: Grasp, wrench: Array, loading: Loading) -> tuple[CheckAnswer, float]:
    """An answer, and its processor time [s]."""
    begun = time.process_time()
    answer = check(grasp, wrench, loading=loading, settings=LIMIT)
    return answer, round(time.process_time() - begun, 4)


def on_path(grasp: Grasp, wrench: Array) -> dict[str, Any]:
    """What the path to a load (6,) says."""
    answer, seconds = timed(grasp, wrench, FIRST)
    path = answer.path
    assert isinstance(path, LoadPath)
    own = {"said": str(answer.verdict), "by_steps": path.by_steps, "other_choice": path.other_choice}
    own |= {"reached": path.reached, "straight": path.resolution == 0, "proved": answer.verify().ok}
    return own | {"seconds": seconds}


def answered(grasp: Grasp, most: Array, question: dict[str, Any]) -> list[dict[str, Any]]:
    """What the path says at each load that was simulated, and `together` now; most: (6,) the paper's maximum."""
    out = []
    for row in rows_of(question):
        own = on_path(grasp, row["share"] * most)
        again, together = timed(grasp, row["share"] * most, "together")
        own |= {"seconds together": together, "paper again": str(again.verdict)}
        out.append({"share": row["share"], "ending": row["ending"], "paper": row["said"]} | own)
    return out


def order(stored: dict[str, dict[str, Any]]) -> list[str]:
    """Names of questions with a bounded maximum, in the order in which they are asked."""
    names = [name for name, question in stored.items() if question.get("maximum")]
    return [names[k] for k in np.random.default_rng(30).permutation(len(names))]


def may_change(row: dict[str, Any]) -> bool:
    """Can rule 2 say otherwise than rule 1? Only where the last step alone slipped, or the time was over."""
    steps = max(map(int, row["by_steps"]))
    last = row["reached"] is not None and abs(row["reached"] - (1 - 1 / steps)) < 1e-9
    return row["said"] == "undecided" or (row["said"] == "slips" and steps > 1 and last)


def asked_again(grasp: Grasp, most: Array, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of rule 1 with what rule 2 says on the path; those that it cannot change stay. `rule 1`: what that said.

    Where rule 2 had not the time, the answer of rule 1 stays, and `late` is true.
    """

    def again(row: dict[str, Any]) -> dict[str, Any]:
        now = on_path(grasp, row["share"] * most) if may_change(row) else {}
        return {"late": True} if now.get("said") == "undecided" else now

    return [row | {"rule 1": row["said"]} | again(row) for row in rows]


def simulated(grasp: Grasp, most: Array, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows with how simulations end whose commands grow slowly."""
    options: dict[str, Any] = {"loading": FIRST, "ramp": study.RAMP, "closing": CLOSING}
    return [row | {"slowly": str(simulate(grasp, row["share"] * most, **options).ending)} for row in rows]


def counted(rows: list[dict[str, Any]], said: str, ending: str = "ending") -> dict[str, Any]:
    """How answers fare beside the engine; said: "paper" or "said", ending: or "slowly"."""
    counts = Counter(study.outcome({"ending": r[ending], "said": r[said]}) for r in rows)
    return {"agreement": round(counts["agree"] / max(len(rows), 1), 4)} | dict(sorted(counts.items()))


def summary(asked: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Counts of all answers, of those that are not fragile, and of each family; times of paths over those of checks."""
    most = [q for q in asked.values() if q["family"] not in APART]
    parts = {"all": most, "not fragile": [q for q in most if not q["fragile"]]}
    for family in sorted({q["family"] for q in asked.values()}):
        parts[family] = [q for q in asked.values() if q["family"] == family]
        parts[f"{family}, not fragile"] = [q for q in parts[family] if not q["fragile"]]
    out: dict[str, Any] = {}
    for name, chosen in parts.items():
        rows = [row for q in chosen for row in q["rows"]]
        out[name] = {"questions": len(chosen), "loads": len(rows)}
        out[name] |= {"together": counted(rows, "paper"), "path": counted(rows, "said")}
        some = [row for row in rows if "slowly" in row]
        if some:
            counts = {"together": counted(some, "paper", "slowly"), "path": counted(some, "said", "slowly")}
            at_once = {"together": counted(some, "paper"), "path": counted(some, "said")}
            out[name]["simulated again"] = {"loads": len(some), "at once": at_once, "slowly": counts}
    rows = [row for q in asked.values() for row in q["rows"]]
    if rows:
        times = np.array([[row["seconds"], row["seconds together"]] for row in rows])
        out["path over check"] = {
            "sum": round(float(times[:, 0].sum() / times[:, 1].sum()), 2),
            "median": round(float(np.median(times[:, 0] / times[:, 1])), 2),
        }
        ruled = [row for q in asked.values() if q.get("rule") == RULE for row in q["rows"]]
        out["asked with the rule of today"] = len(ruled)
        out["late with it"] = sum(row.get("late", False) for row in ruled)
        out["changed by it"] = sum(row["said"] != row.get("rule 1", row["said"]) for row in ruled)
        out["proved"] = sum(row["proved"] for row in rows)
        out["depends on the choice of a state"] = sum(
            row["other_choice"] not in (None, *row["by_steps"].values()) for row in rows
        )
        out["together says otherwise now"] = sum(
            {row["paper"], row["paper again"]} == {"holds", "slips"} for row in rows
        )
    return out


def tables(parts: dict[str, Any]) -> str:
    """Those of the page, in Markdown, from a summary."""
    heads = "questions", "loads", "agree, together", "agree, on the path", "slips said, holds"
    lines = [f"| answers | {' | '.join(heads)} | holds said, slips or jumps | open |", "|---" + 7 * "|---:" + "|"]
    for name, part in parts.items():
        if not isinstance(part, dict) or not part.get("questions"):
            continue
        path, both = part["path"], [f"{100 * part[x]['agreement']:.1f} %" for x in ("together", "path")]
        wrong = path.get("said slips, holds", 0), path.get("said holds, slips", 0) + path.get("said holds, settles", 0)
        cells = name, part["questions"], part["loads"], *both, *wrong, path.get("open", 0)
        lines.append(f"| {' | '.join(map(str, cells))} |")
    lines += ["", "| answers | loads | commands | agree, together | agree, on the path |", "|---|---:|---|---:|---:|"]
    for name, part in parts.items():
        again = part.get("simulated again", {}) if isinstance(part, dict) else {}
        for key, words in (("at once", "act at once"), ("slowly", "grow within 4 s")) if again else ():
            both = [f"{100 * again[key][x]['agreement']:.1f} %" for x in ("together", "path")]
            lines.append(f"| {name} | {again['loads']} | {words} | {' | '.join(both)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_folders(parser)
    parser.add_argument("--seconds", type=float, default=3600.0, help="stop after the question at which this is over")
    parser.add_argument(
        "--simulate", action="store_true", help="simulate again what was asked, commands growing slowly"
    )
    parser.add_argument("--again", action="store_true", help="ask again what was asked by an older rule")
    parser.add_argument("--tables", action="store_true", help="print those of the page, and ask nothing")
    parser.add_argument("--results", type=Path, default=RESULTS)
    args = parser.parse_args()
    begun = time.monotonic()
    data = json.loads(args.results.read_text()) if args.results.exists() else {"questions": {}}
    asked = data["questions"]
    if args.tables:
        print(tables(summary(asked)))
        return
    stored = json.loads(study.RESULTS.read_text())["questions"]
    known = {q.name: q for q in questions(ClosedHands(args.hands, args.shared)) if not q.missing}
    names = order(stored)
    if args.simulate:
        names = sorted((n for n in names if n in asked), key=lambda n: asked[n]["fragile"])
    if args.again:
        names = [n for n in names if n in asked and asked[n].get("rule", 1) != RULE]
        names.sort(key=lambda n: asked[n]["fragile"])
    for name in names:
        done = ("slowly" in asked[name]["rows"][0]) if args.simulate else (name in asked and not args.again)
        if name not in known or done:
            continue
        if time.monotonic() - begun > args.seconds:
            break
        try:
            grasp, direction = known[name].made()
        except InputError:
            continue
        most = stored[name]["maximum"] * direction
        if args.simulate:
            asked[name]["rows"] = simulated(grasp, most, asked[name]["rows"])
        else:
            about = {"family": stored[name]["family"], "fragile": bool(stored[name]["fragile"]), "rule": RULE}
            again = asked_again(grasp, most, asked[name]["rows"]) if args.again else None
            asked[name] = about | {"rows": again or answered(grasp, most, stored[name])}
        data |= {"machine": describe(), "summary": summary(asked)}
        study.save(data, args.results)
    print(json.dumps(summary(asked), indent=1), flush=True)


if __name__ == "__main__":
    main()
