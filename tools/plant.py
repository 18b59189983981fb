"""Small faults (mutants) of Python functions, one at a time.

Planted are: another operator, comparison, sign, number, text or name of a pair (`min` for `max`, `all` for `any`); a
condition that always or never holds; an argument that is None or left out; None for what is assigned; a call or an
assignment that is left out; `break` and `continue` for each other. Words of messages are left as they are.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from difflib import unified_diff
from pathlib import Path
from types import CodeType
from typing import Any

PAIRS = (
    (ast.Add, ast.Sub), (ast.Mult, ast.Div), (ast.BitAnd, ast.BitOr), (ast.Lt, ast.LtE), (ast.Gt, ast.GtE),
    (ast.Eq, ast.NotEq), (ast.Is, ast.IsNot), (ast.In, ast.NotIn), (ast.And, ast.Or), ("min", "max"), ("all", "any"),
    ("minimum", "maximum"), ("floor", "ceil"), ("argmin", "argmax"),
)  # fmt: skip
OTHER: dict[Any, Any] = {a: b for pair in PAIRS for a, b in (pair, pair[::-1])}
OTHER |= {ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult, ast.Pow: ast.Mult, ast.BitXor: ast.BitAnd}
# their texts are words of messages
TOLD = {"InputError", "BadCertificate", "ClaimRefused", "NotMeasured", "frozen", "BadFile", "Refused", "refuse"}
NOT_PLANTED = ("annotation", "returns", "decorator_list", "args", "type_comment")  # of functions: `args`
NONE = ast.Constant(None)


@dataclass(frozen=True)
class Mutant:
    """A fault in a function.

    Attributes:
        function, name: the function, and which of its faults this is.
        digest: of the function without the fault.
        tree: the function or its class. lines: the first and the last line of what is changed.
        holder, key: where the node stands that is changed. other: what is planted there.
    """

    function: str
    name: str
    digest: str
    tree: ast.stmt
    lines: tuple[int, int]
    holder: Any
    key: str | int
    other: ast.AST

    def made(self, use: Callable[[ast.stmt], Any]) -> Any:
        """What is made of the function or its class with the fault."""
        node = self.holder[self.key]
        self.holder[self.key] = ast.fix_missing_locations(ast.copy_location(self.other, node))
        try:
            return use(self.tree)
        finally:
            self.holder[self.key] = node

    def code(self) -> CodeType:
        """Of the function with the fault, to take the place of the function's."""
        flags = annotations.compiler_flag
        module = self.made(lambda tree: compile(ast.Module([tree], []), "mutant", "exec", flags, dont_inherit=True))
        return next(code for code in _codes(module) if code.co_qualname == self.function)

    def diff(self) -> list[str]:
        """The lines that differ."""
        lines = unified_diff(ast.unparse(self.tree).splitlines(), self.made(ast.unparse).splitlines(), n=0, lineterm="")
        return [line for line in list(lines)[2:] if not line.startswith("@@")]


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _codes(inner)


def mutants(path: Path) -> Iterator[Mutant]:
    """All of a file's functions and methods, those within others as parts of these."""
    for top in ast.parse(path.read_text("utf-8")).body:
        for function in top.body if isinstance(top, ast.ClassDef) else [top]:
            if isinstance(function, ast.FunctionDef):
                name = function.name if function is top else f"{top.name}.{function.name}"  # type: ignore[attr-defined]
                digest = hashlib.sha256(ast.unparse(function).encode()).hexdigest()[:12]
                for k, place in enumerate(list(_places(function, (0, 0)))):
                    yield Mutant(name, f"{name}#{k}", digest, top, *place)


def _places(
    node: ast.AST, lines: tuple[int, int], told: bool = False
) -> Iterator[tuple[tuple[int, int], Any, str | int, ast.AST]]:
    """Lines, holder, key and the other node of each fault below a node: not of annotations, defaults and words."""
    told = told or isinstance(node, ast.Raise | ast.JoinedStr | ast.Assert)
    told = told or (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in TOLD)
    for field, value in ast.iter_fields(node):
        if field in NOT_PLANTED and not isinstance(node, ast.Call):
            continue
        holder = value if isinstance(value, list) else vars(node)
        for key, child in enumerate(value) if isinstance(value, list) else [(field, value)]:
            text = isinstance(child, ast.Constant) and isinstance(child.value, str)
            words = (text and (told or isinstance(node, ast.Expr))) or (isinstance(child, ast.Lambda) and told)
            # strict, of zip, guards against lists of unequal lengths
            if words or not isinstance(child, ast.AST) or (isinstance(child, ast.keyword) and child.arg == "strict"):
                continue
            here = lines
            if isinstance(child, ast.stmt):
                here = (child.lineno, child.lineno if hasattr(child, "body") else child.end_lineno or child.lineno)
            elif isinstance(node, ast.stmt) and hasattr(node, "body"):
                here = (node.lineno, getattr(child, "end_lineno", None) or node.lineno)
            yield from ((here, holder, key, other) for other in _others(child))
            yield from _places(child, here, told)


def _others(node: ast.AST) -> Iterator[ast.AST]:
    """What may stand in a node's place."""

    def but(**changes: object) -> ast.AST:
        return type(node)(**dict(ast.iter_fields(node)) | changes)

    if other := OTHER.get(type(getattr(node, "op", None))):
        yield but(op=other())
    match node:
        case ast.Constant(value=bool(value)):
            yield but(value=not value)
        case ast.Constant(value=int(value) | float(value)):
            yield but(value=value + 1)
        case ast.Constant(value=str(value)):
            yield but(value=f"XX{value}XX")
        case ast.AugAssign(target, _, value):
            yield ast.Assign([target], value)
        case ast.Compare(ops=ops):
            yield from (but(ops=[*ops[:k], OTHER[type(op)](), *ops[k + 1 :]]) for k, op in enumerate(ops))
        case ast.UnaryOp(_, operand):
            yield operand
        case ast.If():
            yield from (but(test=ast.Constant(v)) for v in (True, False))
        case ast.IfExp(_, body, orelse):
            yield from (body, orelse)
        case ast.comprehension(ifs=tests):
            yield from (but(ifs=tests[:k] + tests[k + 1 :]) for k in range(len(tests)))
        case ast.Name(id=name) if name in OTHER:
            yield but(id=OTHER[name])
        case ast.Attribute(attr=name) if name in OTHER:
            yield but(attr=OTHER[name])
        case ast.Call(ast.Name(id="len" | "isinstance" | "super")):
            pass
        case ast.Call(_, args, keywords):
            for k, arg in enumerate(args):
                if not isinstance(arg, ast.Starred):
                    if not isinstance(arg, ast.Constant):
                        yield but(args=[*args[:k], NONE, *args[k + 1 :]])
                    if len(args) > 1:
                        yield but(args=args[:k] + args[k + 1 :])
            left_out = (k for k, keyword in enumerate(keywords) if keyword.arg not in (None, "strict"))
            yield from (but(keywords=keywords[:k] + keywords[k + 1 :]) for k in left_out)
        case ast.Assign() | ast.AnnAssign(value=ast.expr()):
            yield but(value=NONE)
        case ast.Expr(ast.Call()) if "super()" not in ast.unparse(node):  # without it the function has other cells
            yield ast.Pass()
        case ast.Break():
            yield ast.Continue()
        case ast.Continue():
            yield ast.Break()
