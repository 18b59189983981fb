"""The tables of docs/simulation.md's study, from benchmarks/results/simulation_agreement.json.

python -m benchmarks.agreement_tables [--list]   # --list: every load that does not agree, one a line
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path
from typing import Any

from benchmarks.simulation_agreement import LOADINGS, RESULTS, STATEMENT, loads, outcome, statement

SPOKEN = {"preload-first": "load after commands", "together": "together", STATEMENT: f"**{STATEMENT}**"}
HEADED = {
    "said holds, slips": "holds said, slips",
    "said holds, settles": "holds said, jumps and rests",
    "said slips, holds": "slips said, holds",
    "open": "open",
}
PARTS = ("all", "moves little", "not fragile")


def counted(found: dict[str, Any]) -> str:
    """What was counted, for each kind of answers and way of loading."""
    head = (
        "| answers | loading | simulated | agree | holds said, slips | holds said, jumps and rests | slips said, holds "
    )
    lines = [head + "| open |", "|---|---|---:|---:|---:|---:|---:|---:|"]
    for part in PARTS:
        for loading in (*LOADINGS, STATEMENT):
            row = found[f"{part}, {loading}"]
            share = f"{row.get('agree', 0)} ({100 * row.get('agreement', 0):.1f} %)"
            cells = [part, SPOKEN[loading], row.get("simulated", 0), share, *(row.get(k, 0) for k in HEADED)]
            lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def by_family(questions: dict[str, dict[str, Any]]) -> str:
    """Of each family the questions, those whose maximum is bounded, and how the model's statement fares."""
    lines = [
        "| family | asked | bounded | contacts | loads | agree | not fragile | loads | agree |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    families = sorted({q["family"] for q in questions.values()})
    for family in (*families, None):
        chosen = [q for q in questions.values() if family in (q["family"], None)]
        bounded = [q for q in chosen if q["maximum"] is not None]
        firm = [q for q in bounded if not q["fragile"]]
        sizes = [q["contacts"] for q in bounded]
        span = f"{min(sizes)} to {max(sizes)}" if sizes else ""
        cells = [family or "all", len(chosen), len(bounded), span, *_agreement(bounded), len(firm), *_agreement(firm)]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def _agreement(chosen: list[dict[str, Any]]) -> tuple[int, str]:
    said = Counter(statement(rows) for q in chosen for rows in loads(q))
    total = said.total()
    return total, f"{100 * round(said['agree'] / total, 4):.1f} %" if total else ""  # rounded as in the summary


def disagreements(questions: dict[str, dict[str, Any]]) -> list[str]:
    """One line for each simulation or statement that does not agree."""
    out = []
    for name, question in questions.items():
        if question["maximum"] is None:
            continue
        kind = ", ".join(question["fragile"]) or "not fragile"
        for rows in loads(question):
            found = {r["loading"]: outcome(r) for r in rows if r["loading"] != "at it"} | {STATEMENT: statement(rows)}
            wrong = [f"{loading}: {what}" for loading, what in found.items() if what != "agree"]
            if wrong:
                rates = " ".join(f"{r['ending']} {r['rate']:.1e}" for r in rows)
                label = f"{name} ({question['contacts']}; {kind}) at {rows[0]['share']:g}"
                out.append(f"{label}: {'; '.join(wrong)} [{rates}]")
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--list", action="store_true", help="every load that does not agree")
    args = parser.parse_args()
    data = json.loads(args.results.read_text())
    if args.list:
        print(*disagreements(data["questions"]), sep="\n")
        return
    print(counted(data["summary"]), by_family(data["questions"]), sep="\n\n")


if __name__ == "__main__":
    main()
