"""The tables of docs/dataset-audit.md, written from benchmarks/results/dataset_audit.json; see `dataset_audit.py`."""

from __future__ import annotations

from typing import Any

from benchmarks.audit_summary import HARD, MEASURES, OURS
from handfast.measures.catalogue import CATALOGUE

SETS = {"DexGraspBench": "DexGraspBench", "bundled": "bundled"}
NAMES = {m.key: m.name for m in CATALOGUE} | {OURS: "**passive margin**"}
SHOWN = ("0.3", "0.6", "1", "3", "10")  # coefficients of friction


def tables(data: dict[str, Any]) -> dict[str, str]:
    """Markdown by the table's name: what passes and holds, joint laws, coefficients of friction, areas."""
    return {"passes": passes(data), "laws": laws(data), "friction": frictions(data), "areas": areas(data)}


def _table(head: list[str], rows: list[list[Any]], aligned: str = "---:") -> str:
    cells = [head, ["---"] + [aligned] * (len(head) - 1), *rows]
    return "\n".join("| " + " | ".join("" if c is None else str(c) for c in row) + " |" for row in cells)


def passes(data: dict[str, Any]) -> str:
    """There and here."""
    said = {"holds": "holds here", "slips": "slips here", "undecided": "open"}
    head = [""] + [f"{title}: {text}" for title in SETS.values() for text in said.values()]
    rows = []
    for there, text in (("passes", "passes its test"), ("fails", "fails it"), ("open", "its test is open")):
        counts = [data[s]["summary"]["there, here"].get(f"{there}, {here}", 0) for s in SETS for here in said]
        rows += [[text, *counts]] if any(counts) else []
    return _table(head, rows)


def laws(data: dict[str, Any]) -> str:
    """How many hold with what the hand's file says of its joints, and without."""
    rows: list[list[Any]] = []
    for name, title in SETS.items():
        found = data[name]["summary"]
        parts = [("laws of joints", found["holds here"]), ("without", found["without laws"])]
        if "tendons free" in found:
            parts[:0] = [("laws of joints, tendons as the file has them", found["tendons free"])]
        rows += [[f"{title}, {text}", part["own"], part["preload alone"], found["asked"]] for text, part in parts]
    return _table(["", "all six loads", "no load", "of"], rows)


def frictions(data: dict[str, Any]) -> str:
    """By coefficient: the tests, what holds here, and sets without commands."""
    rows: list[list[Any]] = []
    for name, title in SETS.items():
        found = data[name]["summary"]
        if any(mu in found["passes"] for mu in SHOWN):
            rows.append([f"{title}: passes its test, of {found['grasps']}", *(found["passes"].get(mu) for mu in SHOWN)])
        rows.append([f"{title}: holds here, of {found['asked']}", *(found["holds here"][mu] for mu in SHOWN)])
        rows.append(["open here", *(found["open here"][mu] for mu in SHOWN)])
    for name, found in data.get("friction", {}).items():
        label = f"{name}: some forces balance the weight, of {found['imported']}"
        rows.append([label, *(found["balanced"][mu] for mu in SHOWN)])
    return _table(["", *SHOWN], rows)


def areas(data: dict[str, Any]) -> str:
    """Areas under the curves with 5 % to 95 % of bootstrap samples, by the area of the bundled grasps."""
    columns = [data["bundled"]["summary"]["area"], data["DexGraspBench"]["summary"]["area"]]
    columns.append(data["DexGraspBench"]["summary"]["area, hard test"])
    order = sorted((OURS, *MEASURES), key=lambda key: -columns[0][key][0])
    head = ["measure", "bundled: area", "DexGraspBench: area", f"the same at friction {HARD}"]
    return _table(head, [[NAMES[key], *(_area(column[key]) for column in columns)] for key in order])


def _area(found: list[float] | None) -> str:
    return "" if found is None else f"{found[0]:.2f} ({found[1]:.2f} to {found[2]:.2f})"
