"""Templates: Jinja2 in a sandbox, a shop's own folder before the bundled one, rendered in pieces.

The environment is :class:`~machining.programs.sandbox.Sandbox`, undefined names are errors, and texts of source files
come as :class:`~machining.programs.source_text.SourceText`, which only the filters ``comment`` and ``word`` print.

To change a format, copy one file of ``templates/<format>/`` into a folder of the same name and edit it there:
``events.j2`` has the macros for tools, spindle, operations and events
(:class:`~machining.programs.job.Happening`), ``main.j2`` (VAL3: ``start.j2``, ``data.j2``) the head of a program,
``moves.j2`` the lines of each move (:class:`~machining.programs.job.Move`). All know the options as ``o``, ``head``,
``count``, ``cartesian`` and ``after``. What is written is read back and compared with the tool path, so coordinates,
configurations and speeds must stay readable in the form that the bundled templates have; lines that are no motion are
the shop's own.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator, Mapping
from importlib import resources
from itertools import islice
from pathlib import Path
from typing import Any

import jinja2
from jinja2.loaders import split_template_path

from machining.programs.sandbox import Budget, Sandbox
from machining.programs.source_text import comment, word
from robots import InputError
from robots.files.reading import read_text

# Pieces of a template joined before they are handed on; each is a few characters.
BUFFER = 512
# Characters that a template may print, and those for each move: the bundled ones need some 200.
PRINTED, PRINTED_PER_MOVE = 10_000_000, 10_000
# Bytes of a template; the bundled ones have 3 kB.
LARGEST_TEMPLATE = 2**20
# All that a template can run into; what it runs into is its own fault.
_FAULTS = (
    jinja2.TemplateError,
    ArithmeticError,
    AttributeError,
    LookupError,
    MemoryError,
    NameError,
    RuntimeError,  # RecursionError is one
    SyntaxError,
    TypeError,
    ValueError,
)


class _OwnTemplates(jinja2.BaseLoader):
    """A shop's folder: a template that is there is used or refused, never passed over for the bundled one."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def get_source(self, environment: jinja2.Environment, template: str) -> tuple[str, str, None]:
        path = self.folder.joinpath(*split_template_path(template))
        if not _there(path):
            raise jinja2.TemplateNotFound(template)
        remedy = "mend or remove it; without it the bundled one is used"
        text = read_text(path, "template", most=LARGEST_TEMPLATE, remedy=remedy)
        return text, str(path), None


def _there(path: Path) -> bool:
    """Whether something has this name, be it only a link to nowhere. Raises InputError where that cannot be seen."""
    try:
        os.lstat(path)
    except FileNotFoundError:
        return False
    except OSError as error:
        raise InputError(
            f"template {path} cannot be read ({error.strerror})", code="F001", remedy="check its folder"
        ) from error
    return True


@functools.lru_cache(maxsize=1)
def bundled() -> Sandbox:
    """Bundled templates only; compiled once."""
    return _made([])


def environment(folder: Path | None) -> Sandbox:
    """Templates of ``folder`` (with one folder a format, as the bundled ones), the bundled ones behind them.

    Raises
    ------
    InputError
        ``folder`` is no folder, or holds no template of a name that is used.
    """
    if folder is None:
        return bundled()
    if not folder.is_dir():
        raise InputError("folder of templates", code="A007", value=str(folder), allowed="a folder that exists")
    names = _names()
    if not any(_there(folder / name) for name in names):
        raise InputError(
            f"folder of templates {folder} holds no template that is used",
            code="Q010",
            allowed=", ".join(names),
            remedy="name its files as the bundled ones",
        )
    return _made([_OwnTemplates(folder)])


def _names() -> list[str]:
    """Names of the bundled templates."""
    folder = resources.files("machining.programs") / "templates"
    inner = [f"{sub.name}/{file.name}" for sub in folder.iterdir() if sub.is_dir() for file in sub.iterdir()]
    return sorted(name for name in [*(file.name for file in folder.iterdir()), *inner] if name.endswith(".j2"))


def _made(first: list[jinja2.BaseLoader]) -> Sandbox:
    made = Sandbox(
        loader=jinja2.ChoiceLoader([*first, jinja2.PackageLoader("machining.programs", "templates")]),
        undefined=jinja2.StrictUndefined,
        # Controllers' languages are no HTML; what is foreign is guarded by SourceText.
        autoescape=False,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.add_filter("comment", comment)
    made.add_filter("word", word)
    return made


def rendered(made: Sandbox, name: str, context: Mapping[str, Any]) -> Iterator[str]:
    """Pieces of a rendered template; ``context["count"]``: moves of the program.

    Raises
    ------
    InputError
        The template has a fault, cannot be opened, does not come to an end or prints too much: its name, and the line
        if known.
    """
    moves = int(context.get("count", 0))
    made.budget = Budget.of(name, moves)
    room = PRINTED + PRINTED_PER_MOVE * moves
    try:
        tokens = made.get_template(name).generate(**context)
        while piece := "".join(islice(tokens, BUFFER)):
            room -= len(piece)
            if room < 0:
                raise made.budget.too_long(PRINTED, PRINTED_PER_MOVE)
            yield piece
    except InputError:
        raise
    except jinja2.TemplateSyntaxError as error:
        raise InputError(f"template {error.name or name}, line {error.lineno}: {error.message}", code="Q010") from error
    except jinja2.TemplateNotFound as error:
        raise InputError(
            f"template {error} is not there", code="Q010", remedy="give it in the folder of templates"
        ) from error
    except _FAULTS as error:
        raise InputError(f"template {name}: {_said(error)}", code="Q010", remedy="correct the template") from error


def _said(error: BaseException) -> str:
    if isinstance(error, RecursionError):
        return "nested too deep; macros or templates that call themselves?"
    if isinstance(error, MemoryError):
        return "needs more memory than there is"
    return str(error)[:200] or type(error).__name__
