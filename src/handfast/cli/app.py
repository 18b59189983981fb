"""The program: reads the arguments, runs the command, turns faults into one line."""

from __future__ import annotations

import ast
import difflib
import io
import os
import re
import sys
from collections.abc import Sequence
from contextlib import redirect_stderr, suppress
from dataclasses import MISSING, fields, make_dataclass
from functools import reduce
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, get_type_hints

from handfast.cli import console
from handfast.cli.options import Command, GraspOptions, is_number
from handfast.core.errors import InputError, unknown_name
from handfast.core.libraries import patient_interrupt

COMMAND_CLASSES = {  # "module:class" of each; a module is imported when its command is asked for
    "check": "questions:Check",
    "max": "questions:Max",
    "torques": "questions:LeastTorques",
    "hold": "hold:Hold",
    "map": "maps:Map",
    "sweep": "maps:Sweep",
    "robust": "robust:Robust",
    "measures": "measures:MeasureGrasp",
    "simulate": "simulate:Simulate",
    "settle": "simulate:Settle",
    "synthesize": "synthesize:Synthesize",
    "grasp": "grasp:FindGrasps",
    "propose": "propose:Propose",
    "plan": "plan:PlanGrasps",
    "import": "published:ImportGrasps",
    "export": "published:ExportGrasps",
    "label": "label:Label",
    "verify": "verify:Verify",
    "contacts": "contacts:Contacts",
    "close": "contacts:Close",
    "show": "show:Show",
    "view": "show:ViewGrasps",
    "list": "list:List",
    "paper": "paper:Paper",
    "demo": "demo:Demo",
}

ALIASES = dict.fromkeys(
    ("check", "max", "torques", "hold", "sweep", "robust", "simulate", "settle", "propose", "grasp", "plan", "label",
     "contacts", "close"),
    ("--com",),
)  # second names of options  # fmt: skip

ABOUT = """Will this grasp hold, and can the hand take that hold? Both for robot hands, both with proofs.

check, max, torques, map and sweep judge a grasp: does it resist a disturbance passively? hold looks for one preload \
under which all loads are resisted. robust asks grasps that are \
a little off, measures sets what the literature measures beside it. synthesize looks for \
configurations that bring regions of the hand onto regions of an object; grasp joins the two, from regions to a \
hold with its torques. propose chooses such regions, plan closes the hand from everywhere. label says of every grasp \
of a dataset what it holds. verify replays what backs an answer, simulate puts a load on a grasp in a dynamics engine, \
settle follows one that slips to where it rests. show looks at a hand, view at a grasp under your mouse. \
paper makes the tables and figures of the two papers again, and runs their own methods.

Start with `handfast demo` or `handfast list`. SI units throughout; object frame. Exit status: 0 answered, \
1 refused by verify, 2 bad input, 3 undecided."""


def command(name: str) -> Any:
    """The class of a command, a `Command`."""
    module, _, kind = COMMAND_CLASSES[name].partition(":")
    return getattr(import_module(f"handfast.cli.{module}"), kind)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status: 0 answered, 1 refused by `verify`, 2 bad input, 3 undecided."""
    if sys.stdout is None:
        return console.complain("standard output is closed; an answer needs somewhere to go")
    try:
        with patient_interrupt():
            status = _run(list(sys.argv[1:] if argv is None else argv))
        sys.stdout.flush()  # here, where a fault can still be told
        return status
    except BrokenPipeError:  # the reader, `head` for one, has had enough
        _drop_output()
        return console.ANSWERED
    except OSError as error:
        _drop_output()
        return console.complain(f"{error.filename or 'standard output cannot be written'}: {error.strerror}")
    except UnicodeEncodeError as error:
        _drop_output()
        sign = error.object[error.start]
        return console.complain(f"standard output: {error.encoding} has no '{sign}'; set PYTHONIOENCODING=utf-8")


def _run(arguments: list[str]) -> int:
    try:
        if arguments in (["--version"], ["-V"]):
            from handfast import __version__

            print(f"handfast {__version__}")
            return console.ANSWERED
        asked = parse(arguments)
        asked.refuse_files()
        return asked.run()
    except InputError as error:
        return console.complain(str(error))
    except KeyboardInterrupt:
        console.complain("interrupted")
        return console.UNDECIDED
    except SystemExit as stop:
        if isinstance(stop.__context__, BrokenPipeError):  # rich makes this of it
            raise BrokenPipeError from None
        return int(stop.code or 0)  # help was asked for


def _drop_output() -> None:
    """Let what is left of an output that cannot be written vanish, not fail once more at the end."""
    with suppress(OSError, ValueError):  # a stream without a file, in a notebook
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def parse(arguments: list[str]) -> Command:
    """The command that the arguments ask for, not yet run; `InputError` if they cannot be understood."""
    if not arguments:
        raise InputError(f"give a command: {', '.join(COMMAND_CLASSES)} (handfast --help tells more)")
    name = arguments[0]
    if not name.startswith("-"):
        if name not in COMMAND_CLASSES:
            raise unknown_name("command", name, COMMAND_CLASSES)
        _check_options(name, arguments[1:])
    elif name not in ("-h", "--help"):
        raise InputError(f"unknown option '{name}'; a command comes first: {', '.join(COMMAND_CLASSES)}")

    import tyro

    asked = name in COMMAND_CLASSES
    kind: Any = command(name) if asked else reduce(lambda a, b: a | b, map(_listed, COMMAND_CLASSES))
    if asked and not {"--help", "-h"}.isdisjoint(arguments):
        _hide_absent_defaults(kind)
    said = io.StringIO()
    try:
        with redirect_stderr(said):
            return tyro.cli(
                kind,
                prog=f"handfast {name}" if asked else "handfast",
                description=None if asked else ABOUT,
                args=arguments[asked:],
                config=(tyro.conf.OmitArgPrefixes, tyro.conf.FlagCreatePairsOff),
            )
    except SystemExit as stop:
        if not stop.code:
            raise
        complaint = _one_line(said.getvalue())
        if asked:
            complaint = _missing(name, arguments[1:], complaint)
        raise InputError(complaint, source=name if asked else None) from None


def _listed(name: str) -> Any:
    """A command as the list of all has it: its name, and what its class says first, read without importing it."""
    import tyro

    module, _, kind = COMMAND_CLASSES[name].partition(":")
    classes = ast.parse((Path(__file__).parent / f"{module}.py").read_bytes()).body
    about = next(ast.get_docstring(x) or "" for x in classes if isinstance(x, ast.ClassDef) and x.name == kind)
    line = " ".join(about.split("\n\n")[0].split())
    return Annotated[make_dataclass(kind, ()), tyro.conf.subcommand(name, description=line)]


def _hide_absent_defaults(kind: Any) -> None:
    """Leave "(default: None)" out of a command's help, and what switches are before they are given.

    What happens when an option is absent, its own help says.
    """
    import tyro

    hints = get_type_hints(kind, include_extras=True)
    quiet = tyro.conf.arg(help_behavior_hint="")
    for field in fields(kind):
        repeatable = "UseAppendAction" in str(field.type) or field.type == "Assignments"
        several = field.default is MISSING and "tuple" in str(field.type)  # of which the parser shows none
        if several or field.default in (None, True, False, "") or (field.default == () and not repeatable):
            kind.__annotations__[field.name] = Annotated[hints[field.name], quiet]


def _check_options(name: str, arguments: Sequence[str]) -> None:
    """Refuse an option that the command does not have, before it is taken for another option's value."""
    known = ["--help", *(option_name(f) for f in fields(command(name))), *ALIASES.get(name, ())]
    for word in arguments:
        option = option_of(word)
        if word.startswith("--") and len(word) > 2 and option not in known:
            near = difflib.get_close_matches(option[2:], [k[2:] for k in known if k.startswith("--")], 1)
            hint = f"did you mean --{near[0]}?" if near else f"see handfast {name} --help"
            raise InputError(f"unknown option '{option}'; {hint}", source=name)


def _missing(name: str, arguments: Sequence[str], complaint: str) -> str:
    """The parser's complaint; where something is missing, all of it, options of which one is needed included."""
    kind = command(name)
    words = [word for word in arguments if not word.startswith("--")]
    if issubclass(kind, GraspOptions) and all(is_number(word) for word in words):
        # where nothing but numbers was given, the parser took the last one for the grasp
        missing = complaint.removeprefix("missing: ") if complaint.startswith("missing: GRASP") else "GRASP"
    elif complaint.startswith("missing: "):
        missing = complaint.removeprefix("missing: ")
    else:
        return complaint
    given = {option_of(word) for word in arguments}
    if kind.one_of and not any(option_of(option) in given for option in kind.one_of):
        missing += f"; {kind.needed()}"
    about = "; GRASP is a file or the name of a bundled grasp" if missing.startswith("GRASP") else ""
    return f"missing: {missing}{about}"


def option_of(word: str) -> str:
    """The option that a word of the command line begins with: "--eta" of "--eta=2"."""
    return re.split("[= ]", word)[0].replace("_", "-")


def option_name(field: Any) -> str:
    """How a command's field is called on the command line."""
    name = field.name.rstrip("_").replace("_", "-")
    return f"--no-{name}" if field.default is True else f"--{name}"


def _one_line(said: str) -> str:
    """The parser's complaint as one line: no title, frame, help of arguments or pointer to it."""
    lines = [re.sub(r"^[│|]|[│|]?\s*$", "", line) for line in said.splitlines()]
    rule = [not line.strip(" ─-╭╰╮╯+") or line.startswith(("╭", "╰", "+-")) for line in lines]
    begin = rule.index(True) + 1 if True in rule else 0  # the title stands above the first rule, or in it
    text: list[str] = []
    margin = None
    for line, is_rule in zip(lines[begin:], rule[begin:], strict=True):
        if is_rule or line.strip().startswith("For full helptext"):
            break
        indent = len(line) - len(line.lstrip())
        margin = indent if margin is None else margin
        if indent < margin + 8:  # deeper lines are the help of an argument
            text.append(line.strip())
    message = " ".join(text).removeprefix("Error parsing ")
    message = re.sub(r"\('[^()]*'\) ?", _choices, message)
    message = re.sub(r"could not convert string to float: ('[^']*')", r"\1 is not a number", message)
    message = re.sub(r"invalid literal for int\(\) with base 10: ('[^']*')", r"\1 is not a whole number", message)
    kinds = {"FLOAT": "a number", "INT": "a whole number"}
    message = re.sub(
        r"no type matching \{None\}\|(FLOAT|INT) could be instantiated from \[('[^']*')\]\.",
        lambda found: f"{found[2]} is not {kinds[found[1]]}",
        message,
    )
    message = re.sub(
        r"no type matching \{None\}\|\{STR FLOAT\} could be instantiated from \[(.*)\]\.",
        lambda found: f"is {found[1].replace(chr(39), '').replace(',', '') or 'empty'}; a word and a number are needed",
        message,
    )
    message = re.sub(r"^Missing from [\w ]+: ", "missing: ", message)
    return message[:1].lower() + message[1:]


def _choices(listed: re.Match[str]) -> str:
    """Choices in an order that does not change, without the one of giving none."""
    words = sorted(set(re.findall(r"'([^']*)'", listed[0])) - {"None"}, key=lambda w: (w.lstrip("-"), w))
    return ", ".join(words)
