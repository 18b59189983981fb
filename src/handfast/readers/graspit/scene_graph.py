"""The text of an Inventor or VRML file as nodes with fields, before anything is made of them.

Both formats share one grammar, which can be read without knowing the nodes: `Kind { field values ... Child { ... } }`,
`DEF name Kind {...}` and `USE name`; a field's values are numbers, a string, a word, a node, or any of them in
brackets.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError

TOKEN = re.compile(r'#[^\n]*|"(?:[^"\\]|\\.)*"|[{}\[\]()|]|[^\s,{}\[\]()|"#]+|"', re.DOTALL)
MAX_NODE_DEPTH = 64  # nodes in nodes
NUMBER_CHARACTERS = frozenset("+-.0123456789")


@dataclass
class SceneNode:
    """One node: its kind, its fields by name (texts, or nodes) and the nodes in it."""

    kind: str
    fields: dict[str, list[str | SceneNode]] = field(default_factory=dict)
    children: list[SceneNode] = field(default_factory=list)

    def field(self, name: str) -> list[str | SceneNode]:
        """The values of a field, [] if it is not stated."""
        return self.fields.get(name, [])

    def nodes(self, name: str) -> list[SceneNode]:
        """The nodes among the values of a field."""
        return [v for v in self.field(name) if isinstance(v, SceneNode)]

    def word(self, name: str) -> str:
        """The first word or string of a field, "" if it is not stated."""
        first = next((v for v in self.field(name) if isinstance(v, str)), "")
        return first.strip('"')

    def numbers(self, name: str, n: int, default: tuple[float, ...]) -> Array:
        """(n,) numbers of a field; `InputError` if it has others."""
        values = self._floats(name) if name in self.fields else np.array(default, dtype=float)
        if len(values) != n:
            raise InputError(f"has {len(values)} numbers, not {n}", field=f"{self.kind}.{name}")
        return values

    def integers(self, name: str) -> list[int]:
        """The whole numbers of a field."""
        values = self._floats(name)
        if (np.abs(values) > 2**31).any() or (values != np.round(values)).any():
            raise InputError("has a number that is no index", field=f"{self.kind}.{name}")
        return values.astype(int).tolist()

    def table(self, name: str) -> Array:
        """(n, 3) numbers of a field."""
        values = self._floats(name)
        if len(values) % 3:
            raise InputError(f"has {len(values)} numbers, no multiple of three", field=f"{self.kind}.{name}")
        return values.reshape(-1, 3)

    def _floats(self, name: str) -> Array:
        try:
            values: Array = np.array([float(v) for v in self.field(name)], dtype=np.float64)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            raise InputError("has values that are no numbers", field=f"{self.kind}.{name}") from None
        if not np.isfinite(values).all():
            raise InputError("has a number that is NaN or infinite", field=f"{self.kind}.{name}")
        return values


def parse_scene_graph(text: str) -> list[SceneNode]:
    """The nodes at the top of a file. A node that is used again is the same object again.

    Raises:
        InputError: brackets that do not match, a name used before it was defined, prototypes, nodes more than
            `MAX_NODE_DEPTH` deep in each other.
    """
    return _Parser([t for t in TOKEN.findall(text) if not t.startswith("#")]).top()


class _Parser:
    def __init__(self, tokens: list[str]) -> None:
        self.tokens, self.at = tokens, 0
        self.named: dict[str, SceneNode] = {}
        self.deep = 0

    def peek(self, ahead: int = 0) -> str:
        at = self.at + ahead
        return self.tokens[at] if at < len(self.tokens) else ""

    def take(self, expected: str = "") -> str:
        token = self.peek()
        if not token or (expected and token != expected):
            raise InputError(f"has {token or 'its end'!r} where '{expected or 'more'}' is needed")
        self.at += 1
        return token

    def top(self) -> list[SceneNode]:
        nodes = []
        while self.at < len(self.tokens):
            if self.peek() == "ROUTE":  # of animations
                self.at += 4
            elif self.starts_node():
                nodes.append(self.node())
            elif set(self.tokens[self.at :]) == {"}"}:  # one too many at the end: other readers stop there, too
                break
            else:
                raise InputError(f"has '{self.peek()[:40]}' where a node is needed")
        return nodes

    def starts_node(self) -> bool:
        if self.peek() in ("PROTO", "EXTERNPROTO"):
            raise InputError("defines a prototype, which is not read; save the mesh as OBJ, STL, PLY or OFF")
        return self.peek() in ("DEF", "USE") or (self.is_word() and self.peek(1) == "{")

    def is_word(self) -> bool:
        return self.peek()[:1] not in ("", "{", "}", "[", "]", "(", ")", "|", '"')

    def node(self) -> SceneNode:
        token = self.take()
        if token == "USE":
            name = self.take()
            if name not in self.named:
                raise InputError(f"uses '{name}', which is not defined before")
            return self.named[name]
        name = ""
        if token == "DEF":
            name, token = self.take(), self.take()
        self.take("{")
        self.deep += 1
        if self.deep > MAX_NODE_DEPTH:
            raise InputError(f"has nodes more than {MAX_NODE_DEPTH} deep in each other")
        node = SceneNode(token)
        while self.peek() != "}":
            if self.starts_node():
                node.children.append(self.node())
            elif self.is_word():
                name_of_field = self.take()
                node.fields[name_of_field] = self.values()
            else:
                raise InputError(f"has {self.peek() or 'its end'!r} in {token}, where a field or a node is needed")
        self.take("}")
        self.deep -= 1
        if name:  # known from here on, so that no node can be in itself
            self.named[name] = node
        return node

    def values(self) -> list[str | SceneNode]:
        first = self.peek()
        if first in ("[", "("):
            close = "]" if first == "[" else ")"
            self.take()
            out: list[str | SceneNode] = []
            while self.peek() != close:
                out.append(self.node() if self.starts_node() else self.take())
            self.take(close)
            return out
        if self.starts_node():
            return [self.node()]
        if first == "" or first in "{}])|":
            return []
        if first[0] not in NUMBER_CHARACTERS:
            words: list[str | SceneNode] = [self.take()]
            while self.peek() == "|":
                self.take()
                words.append(self.take())
            return words
        start = self.at
        while self.peek()[:1] in NUMBER_CHARACTERS and self.peek():
            self.at += 1
        return list(self.tokens[start : self.at])
