"""Templates: Jinja2 in a sandbox, a shop's own folder before the bundled one, rendered in pieces.

The environment is immutable and sandboxed, undefined names are errors, and texts of source files come as
:class:`~machining.programs.source_text.SourceText`, which only the filters ``comment`` and ``word`` print.

To change a format, copy one file of ``templates/<format>/`` into a folder of the same name and edit it there:
``events.j2`` has the macros for tools, spindle, operations and events
(:class:`~machining.programs.commands.Happening`), ``main.j2`` (VAL3: ``start.j2``, ``data.j2``) the head of a program,
``moves.j2`` the lines of each move (:class:`~machining.programs.job.Move`). All know the options as ``o``, ``head``,
``count``, ``cartesian`` and ``after``. What is written is read back and compared with the tool path, so coordinates,
and speeds in the form that the bundled templates have, must stay readable; lines that are no motion are the shop's own.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import jinja2
from jinja2.sandbox import ImmutableSandboxedEnvironment

from machining.programs.job import Move
from machining.programs.source_text import comment, word
from robots import InputError

# Pieces of a template joined before they are handed on; each is a few characters.
BUFFER = 4096
_FIELDS = frozenset(field.name for field in dataclasses.fields(Move))


class _Sandbox(ImmutableSandboxedEnvironment):
    """The sandbox, with a short way to the plain data of moves: its own checks take most of a long program's time."""

    def getattr(self, obj: Any, attribute: str) -> Any:
        if type(obj) is Move and attribute in _FIELDS:
            return getattr(obj, attribute)
        return super().getattr(obj, attribute)


@functools.lru_cache(maxsize=1)
def bundled() -> jinja2.Environment:
    """Bundled templates only; compiled once."""
    return _made([])


def environment(folder: Path | None) -> jinja2.Environment:
    """Templates of ``folder`` (with one folder a format, as the bundled ones), the bundled ones behind them.

    Raises
    ------
    InputError
        ``folder`` is no folder.
    """
    if folder is None:
        return bundled()
    if not folder.is_dir():
        raise InputError("folder of templates", value=str(folder), allowed="a folder that exists")
    return _made([jinja2.FileSystemLoader(folder)])


def _made(first: list[jinja2.BaseLoader]) -> jinja2.Environment:
    made = _Sandbox(
        loader=jinja2.ChoiceLoader([*first, jinja2.PackageLoader("machining.programs", "templates")]),
        undefined=jinja2.StrictUndefined,
        # Controllers' languages are no HTML; what is foreign is guarded by SourceText.
        autoescape=False,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.filters["comment"], made.filters["word"] = comment, word
    made.globals["zip"] = zip
    return made


def rendered(made: jinja2.Environment, name: str, context: Mapping[str, Any]) -> Iterator[str]:
    """Pieces of a rendered template.

    Raises
    ------
    InputError
        The template has a fault: its name, and the line if known.
    """
    try:
        stream = made.get_template(name).stream(**context)
        stream.enable_buffering(BUFFER)
        yield from stream
    except jinja2.TemplateSyntaxError as error:
        raise InputError(f"template {error.name or name}, line {error.lineno}: {error.message}") from error
    except jinja2.TemplateNotFound as error:
        raise InputError(f"template {error} is not there", remedy="give it in the folder of templates") from error
    except (
        jinja2.TemplateError,
        TypeError,
        ValueError,
        AttributeError,
        KeyError,
        IndexError,
        ZeroDivisionError,
    ) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"template {name}: {error}") from error
