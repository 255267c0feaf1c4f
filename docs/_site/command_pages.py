"""The reference of commands, read from the commands themselves: a page for each, sub-commands included."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import pages

INTRODUCTION = """# Commands

Every command says the same with `--help`. What all of them have in common (files, exit codes) is in
[Results and exit codes](../results.md).
"""


def write(folder: Path) -> None:
    """Write ``index.md`` and a page for each command into the folder."""
    import typer

    from stiffarm.cli import app

    group = typer.main.get_command(app)
    context = group.make_context("stiffarm", [], resilient_parsing=True)
    commands = [(name, group.get_command(context, name)) for name in group.list_commands(context)]
    # Not the bare name: a command called index would be taken for the folder's first page.
    written = {f"stiffarm-{name}.md": page(name, command, context) for name, command in commands}
    rows = [f"| [`stiffarm {name}`](stiffarm-{name}.md) | {cell(summary(command))} |" for name, command in commands]
    table = ["| command | what it does |", "|---|---|", *rows, ""]
    written["index.md"] = "\n".join([INTRODUCTION, *table, *pages.toctree([f"stiffarm-{name}" for name, _ in commands])])
    pages.write_all(folder, written)


def page(name: str, command: Any, above: Any) -> str:
    """One command with its arguments and options; below it, its sub-commands in the same way."""
    return "\n".join(section(f"stiffarm {name}", command, above, 1))


def section(name: str, command: Any, above: Any, level: int) -> list[str]:
    """Markdown lines of a command and of all commands below it."""
    context = type(above)(command, info_name=name.split()[-1], parent=above)
    lines = ["#" * level + f" {name}", "", *paragraphs(command.help or ""), ""]
    below = [] if not hasattr(command, "list_commands") else command.list_commands(context)
    usage = " ".join(["COMMAND ..." if below else "", *(a.make_metavar(context) for a in arguments(command))])
    lines += ["```", re.sub(r" +", " ", f"{name} [OPTIONS] {usage}").strip(), "```", "", f"```{{program}} {name}", "```", ""]
    for parameter in arguments(command):
        default = said_default(parameter, context)
        lines += [f"`{parameter.make_metavar(context)}`", f": {one_line(parameter.help or '')}{default}", ""]
    for parameter in command.params:
        if parameter.param_type_name == "option" and not parameter.hidden and "--help" not in parameter.opts:
            lines += option(parameter, context)
    for sub in below:
        lines += section(f"{name} {sub}", command.get_command(context, sub), context, level + 1)
    return lines


def arguments(command: Any) -> list[Any]:
    """Its positional parameters."""
    return [parameter for parameter in command.params if parameter.param_type_name == "argument"]


def option(parameter: Any, context: Any) -> list[str]:
    """One option, so that it can be linked to and found in the index."""
    is_flag = getattr(parameter, "is_flag", False)
    metavar = "" if is_flag else f" {parameter.make_metavar(context)}"
    names = ", ".join(f"{name}{metavar}" for name in [*parameter.opts, *parameter.secondary_opts])
    required = " Required." if parameter.required else ""
    text = one_line(parameter.help or "") + said_default(parameter, context) + required
    return [f"````{{option}} {names}", text, "````", ""]


def said_default(parameter: Any, context: Any) -> str:
    """The default where the help does not say it; none for flags that are off, and what Python computes."""
    value = parameter.get_default(context, call=False)
    if value is None or value is False or value in ((), []) or callable(value) or "default" in (parameter.help or ""):
        return ""
    if value is True:
        return f" Default: `{parameter.opts[0]}`."
    return f" Default: `{value}`."


def summary(command: Any) -> str:
    """Its first sentence."""
    first = one_line(inspect.cleandoc(command.help or "").split("\n\n")[0])
    return re.split(r"(?<=[.?]) (?=[A-Z])", first)[0]


def paragraphs(text: str) -> list[str]:
    """Help text as Markdown: paragraphs stay paragraphs."""
    parts = re.split(r"\n\s*\n", inspect.cleandoc(text).replace("\b\n", ""))
    return [line for part in parts for line in (one_line(part), "")]


def one_line(text: str) -> str:
    """Text in one line, with what Markdown would read as its own taken literally outside of code."""
    parts = re.split(r"(`[^`]*`)", " ".join(text.split()))
    quoted = [re.sub(r"([\\*_<>\[\]#|])", r"\\\1", part) if i % 2 == 0 else part for i, part in enumerate(parts)]
    line = "".join(quoted)
    return line[:1].upper() + line[1:] + ("." if line and line[-1] not in ".?!:" else "")


def cell(text: str) -> str:
    """Text for a table's cell."""
    return text.replace("\n", " ")
