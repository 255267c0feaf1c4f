"""The command line: a table of commands, each loaded when it is asked for."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Final, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup

from robots import InputError
from robots.errors import one_line
from stiffarm import __version__
from stiffarm.session.console import EXIT_BAD_INPUT, say_error


class Entry(NamedTuple):
    """A command: its folder in stiffarm/commands, its function in command.py there, its group and what it does."""

    folder: str
    function: str
    group: str
    summary: str


MODEL: Final = "Model"
MEASURE: Final = "Measure"
CALIBRATE: Final = "Calibrate and diagnose"
USE: Final = "Use"
MACHINE: Final = "Machine"

COMMANDS: dict[str, Entry] = {
    "robots": Entry("robots", "robots", MODEL, "List robots, show one, or check its kinematics."),
    "new": Entry("new", "new", MODEL, "Make a model file of a new arm, and tables to check it with."),
    "import": Entry(
        "importing", "import_command", MODEL, "Build a model from a URDF, or one link from a surface file."
    ),
    "simulate": Entry("simulate", "simulate", MODEL, "Compute tool-point deflections at a pose or for a table."),
    "readings": Entry("readings", "readings", MEASURE, "Make a measurement table from instrument files or sheets."),
    "plan": Entry("plan", "plan", MEASURE, "Choose what to measure next and write a sheet to fill in."),
    "sensitivity": Entry("sensitivity", "sensitivity", MEASURE, "Show which parameters matter at which pose."),
    "run": Entry("run", "run", CALIBRATE, "Run everything from readings to report, surrogate and maps."),
    "calibrate": Entry("calibrate", "calibrate", CALIBRATE, "Identify parameters from measured deflections."),
    "diagnose": Entry("diagnose", "diagnose", CALIBRATE, "Find out what the model is missing, and how sure that is."),
    "rehearse": Entry("rehearse", "rehearse", MEASURE, "Forecast what a planned sheet would show, before you measure."),
    "compare": Entry("compare", "compare", CALIBRATE, "Show what differs between two results by more than noise."),
    "identify": Entry("identify", "identify", CALIBRATE, "Identify six stiffnesses per joint from joint twists."),
    "fit": Entry("fit", "fit", USE, "Fit a surrogate of the stiffness over the joint angles."),
    "query": Entry("query", "query", USE, "Evaluate a surrogate at poses, with error bars."),
    "map": Entry("maps", "map_command", USE, "Map the stiffness over joints or over points in space."),
    "index": Entry("index", "index", USE, "Compute stiffness indices at poses, such as k_fs and NSPI."),
    "posture": Entry("posture", "posture", MACHINE, "Find the stiffest posture along a tool path."),
    "place": Entry("place", "place", MACHINE, "Find where the base should stand for the stiffest cut."),
    "post": Entry("post", "post", MACHINE, "Write robot programs from a tool path and read them back."),
    "verify": Entry("verify", "verify", MACHINE, "Check a program for collisions, limits and singularities."),
    "help": Entry("help", "help_command", USE, "Explain an error or warning by its code."),
    "serve": Entry("serve", "serve_command", MACHINE, "Answer questions from other programs, line by line."),
}

# Codes of wrong options, by the class of what the parser raises.
CODES: Final = {
    "NoSuchOption": "A021",
    "MissingParameter": "A022",
    "BadOptionUsage": "A022",
    "BadArgumentUsage": "A022",
    "BadParameter": "A023",
    "UsageError": "A024",
}


# Commands, and options of a command, that are gone or have another name: what to do instead.
GONE: Final = {
    "export": "from the source: python -m benchmarks.statics.calculix MODEL --pose-deg ... --out arm.inp",
    "study": "from the source: python -m benchmarks.diagnosis.study FOLDER",
    "fit --accuracy": "give more --runs, or another --basis; the report states the error",
    "fit --compare": "from the source: python benchmarks/surrogates/surrogate_peers.py",
    "fit --solver": "leave it out; where runs do not determine all terms, give more --runs or a lower --degree",
    "map --svg": "leave it out: pictures are PNG",
    "plan --iso9283": "plan --design-only 1 --loads ... --directions +x,-x,+y,-y,+z,-z --read xyz",
    "plan --pose": "leave it out: --design-only N chooses the poses",
    "plan --rated-N": "give --loads, in N",
    "posture --motion": "leave it out",
}


class _Commands(TyperGroup):
    """Commands by name. The list says what the table says; a command is imported when it is called."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = {
            name: TyperCommand(name, help=entry.summary, rich_help_panel=entry.group)
            for name, entry in COMMANDS.items()
        }

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name, known, rest = super().resolve_command(ctx, args)
        return name, None if known is None else command_of(str(name)), rest

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **more: Any) -> Any:
        _refuse_empty(args)
        _refuse_gone(args)
        with _printable():
            return super().make_context(info_name, args, *rest, **more)

    def invoke(self, ctx: Any) -> Any:
        with _printable():
            return super().invoke(ctx)


def command_of(name: str) -> Any:
    """The command itself, imported; one with commands of its own is a Typer, to which capabilities add theirs."""
    entry = COMMANDS[name]
    module = importlib.import_module(f"stiffarm.commands.{entry.folder}.command")
    made = made_of_requests()
    found: Any = made.get(name) or getattr(module, entry.function)
    own = {name: found}
    if isinstance(found, typer.Typer):
        known = {one.name for one in found.registered_commands}
        own = {full.partition(" ")[2]: one for full, one in made.items() if full.startswith(f"{name} ")}
        own = {word: one for word, one in own.items() if word not in known}
    else:
        found = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    for word, one in own.items():
        found.command(word)(one)
    return typer.main.get_command(found)


def made_of_requests() -> dict[str, Any]:
    """Commands that are made of requests and have been imported, by name."""
    module = sys.modules.get("stiffarm.capability")
    return {} if module is None else module.COMMANDS


def _refuse_empty(args: list[str]) -> None:
    """An empty name, as of a variable that is not set, would stand for the folder one is in."""
    for before, argument in zip(["", *args], args, strict=False):
        if not argument.strip() or (argument.startswith("--") and argument.endswith("=")):
            place = argument if argument.strip() else f"the argument after {before}" if before else "the first argument"
            say_error(
                InputError(
                    f"{place} is empty",
                    code="A008",
                    remedy="give a value, or leave it out ('.' is the folder you are in)",
                )
            )
            raise SystemExit(EXIT_BAD_INPUT)


def _refuse_gone(args: list[str]) -> None:
    """An old name is answered with what took its place."""
    name = next((a for a in args if not a.startswith("-")), "")
    for old in (name, *(f"{name} {a.partition('=')[0]}" for a in args if a.startswith("--"))):
        if old in GONE:
            say_error(InputError(f"{old} is gone", code="A026", remedy=GONE[old]))
            raise SystemExit(EXIT_BAD_INPUT)


@contextmanager
def _printable() -> Iterator[None]:
    """What the command line says of wrong options: as text that a terminal only prints, with what may be meant."""
    try:
        yield
    except Exception as error:
        if isinstance(message := getattr(error, "message", None), str):
            close = getattr(error, "possibilities", None)
            text = one_line(message) + (f". Did you mean {' or '.join(close)}?" if close else "")
            error.message = _coded(text, error)  # type: ignore[attr-defined]
            error.possibilities = None  # type: ignore[attr-defined]
        raise


def _coded(text: str, error: Exception) -> str:
    """What the command line says of wrong options, with the code of the failure."""
    from stiffarm.failures import MORE

    code = CODES.get(type(error).__name__)
    if code is None or MORE in text:
        return text
    end = "" if not text or text.endswith((".", "?")) else "."
    return f"{text}{end} {MORE} {code}".lstrip()


app = typer.Typer(
    name="stiffarm",
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="How stiff is my robot arm in this pose, and why does the model disagree with my gauge?",
    epilog="To begin: stiffarm calibrate xr701 --free j2.stiffness,j3.stiffness --out cal (uses bundled readings). "
    "Options of a command: stiffarm COMMAND --help.",
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(__version__)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass
