"""SRDF in, pairs of links out: what a URDF's companion says about links that are not checked against each other."""

from __future__ import annotations

from pathlib import Path

from handfast.core.errors import InputError
from handfast.model.hand.hand import Hand
from handfast.model.hand.urdf import parse_xml


def read_srdf(path: Path, hand: Hand, *, strict: bool = True) -> frozenset[tuple[str, str]]:
    """The pairs of an SRDF file's `disable_collisions` elements. Everything else in it is left alone.

    Args:
        hand: whose links they have to be.
        strict: False leaves out pairs with a link that the hand does not have, as where only a part of a robot is read.

    Raises:
        InputError: not an SRDF file; an element without two links, with the same one twice, or with one that the hand
            does not have.
    """
    root = parse_xml(path)
    if root.tag != "robot":
        raise InputError(f"has root element <{root.tag}>; an SRDF file has <robot>", source=str(path))
    pairs = set()
    for n, e in enumerate(root.iter("disable_collisions")):
        field, ends = f"disable_collisions[{n}]", []
        for key in ("link1", "link2"):
            name = e.get(key)
            if not name:
                raise InputError(f"has no {key}; two links are needed", source=str(path), field=field)
            ends.append(name)
        if ends[0] == ends[1]:
            raise InputError(f"names {ends[0]} twice; two links are needed", source=str(path), field=field)
        strangers = [name for name in ends if name not in hand.link_names]
        if strangers and strict:
            problem = f"names link '{strangers[0]}', which the hand does not have"
            raise InputError(problem, source=str(path), field=field)
        if not strangers:
            pairs.add((ends[0], ends[1]))
    return frozenset(pairs)
