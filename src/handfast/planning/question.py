"""What a search was asked: a search that was cut short is gone on with only where the question is the same."""

from __future__ import annotations

from typing import Any

import numpy as np

from handfast.core.errors import InputError
from handfast.model.body import Body
from handfast.model.hand.hand import Hand
from handfast.model.shape import Shape
from handfast.stability.loads import Loads
from handfast.synthesis.embedded import digest


def fingerprint(hand: Hand, body: Body, loads: Loads, seed: int, **others: object) -> str:
    """What tells two questions apart: every number of hand, object and loads, the seed, and `others` as text."""
    m = hand.mechanism
    laws = [[j.law.friction, j.law.stiffness, *j.law.rest, *map(str, j.law.stops)] for j in hand.joints]
    tendons = [[*t.row.tolist(), str(t.law)] for t in hand.tendons]
    loops = [[o.first, o.second, o.on_first.tolist(), o.on_second.tolist()] for o in hand.loops]
    more: dict[str, list[Any]] = {
        "loops": loops,
        "non_colliding": sorted(map(sorted, hand.non_colliding)),
        "tendons": tendons,
    }
    more |= {"laws": laws if any(j.law.any for j in hand.joints) else []}
    more |= {"backdrivable": [n for n, yes in zip(m.actuators, m.backdrivable, strict=True) if yes]}
    return digest(
        {key: value for key, value in more.items() if value}
        | {
            "links": [
                [k.name, k.parent, k.pose.tolist(), list(k.joints), [_shape(s) for s in k.shapes]] for k in hand.links
            ],
            "joints": [
                [j.name, j.type, j.axis.tolist(), j.anchor.tolist(), j.lower, j.upper, j.ref] for j in hand.joints
            ],
            "couplings": [[c.joint, c.driver, c.ratio, c.offset] for c in hand.couplings],
            "mechanism": [list(m.actuators), m.R.tolist(), list(m.tendon)],
            "closing": [hand.closing.tolist(), hand.breakaway],
            "pieces": [_shape(s) for s in body.pieces],
            "body": [body.mass, np.asarray(body.center_of_mass).tolist(), body.friction],
            "loads": loads.by_name,
            "seed": seed,
            "others": {name: str(value) for name, value in others.items()},
        }
    )


def refuse_negative(seed: int) -> None:
    """`InputError` for a seed below 0, of which no random numbers can be drawn."""
    if seed < 0:
        raise InputError(f"is {seed}; a number from 0 on is needed", field="seed")


def refuse_another(found: str, question: str) -> None:
    """`InputError` if the fingerprint of what was begun is not that of what is asked."""
    if found != question:
        raise InputError(
            "was begun with another hand, object, load, seed or limit; ask the same, or take another folder",
            field="question",
        )


def _shape(s: Shape) -> list[Any]:
    return [s.kind, list(s.size), s.pose.tolist(), s.vertices.tolist()]
