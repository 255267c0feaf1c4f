"""The reference of commands, read from the commands themselves: a page for each, sub-commands included."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import pages
import typer

INTRODUCTION = """# Commands

Every command says the same with `--help`. What all of them have in common (files, exit codes) is in
[Results and exit codes](../results.md).
"""


def write(folder: Path) -> None:
    """Write ``index.md`` and a page for each command into the folder."""
    from stiffarm.cli import COMMANDS, app, command_of

    top = typer.Context(typer.main.get_command(app), info_name="stiffarm")
    # Not the bare name: a command called index would be taken for the folder's first page.
    written = {f"stiffarm-{name}.md": page(name, command_of(name), top) for name in COMMANDS}
    lines = [INTRODUCTION]
    for group in dict.fromkeys(entry.group for entry in COMMANDS.values()):
        lines += [f"## {group}", "", "| command | what it does |", "|---|---|"]
        for name, entry in COMMANDS.items():
            if entry.group == group:
                lines.append(f"| [`stiffarm {name}`](stiffarm-{name}.md) | {one_line(entry.summary)} |")
        lines.append("")
    written["index.md"] = "\n".join([*lines, *pages.hidden_toctree([f"stiffarm-{name}" for name in COMMANDS])])
    pages.write_all(folder, written)


def page(name: str, command: Any, above: Any) -> str:
    """One command with its arguments and options; below it, its sub-commands in the same way."""
    return "\n".join(section(name, command, above, 1))


def section(name: str, command: Any, above: Any, level: int) -> list[str]:
    """Markdown lines of a command and of all commands below it."""
    context = typer.Context(command, info_name=name, parent=above)
    path = context.command_path
    usage = re.sub(r"\{([A-Z]+)\}", r"\1", command.get_usage(context).removeprefix("Usage: "))
    lines = ["#" * level + f" {path}", "", *paragraphs(command.help or ""), "```", usage, "```", ""]
    lines += [f"```{{program}} {path}", "```", ""]
    shown = [parameter for parameter in command.params if not parameter.hidden]
    for parameter in shown:
        if parameter.param_type_name == "argument":
            lines += [f"`{parameter.display_name_raw}`", f": {explained(parameter, context)}", ""]
    for parameter in shown:
        if parameter.param_type_name == "option" and "--help" not in parameter.opts:
            lines += option(parameter, context)
    for sub in getattr(command, "commands", ()):
        lines += section(sub, command.commands[sub], context, level + 1)
    return lines


def option(parameter: Any, context: Any) -> list[str]:
    """One option, so that it can be linked to and found in the index."""
    record, _ = parameter.get_help_record(context)
    _, _, value = record.partition(" ")
    names = [*parameter.opts, *parameter.secondary_opts]
    shown = ", ".join(names) if parameter.secondary_opts or not value else f"{', '.join(names)} {value}"
    return [f"````{{option}} {shown}", explained(parameter, context), "````", ""]


def explained(parameter: Any, context: Any) -> str:
    """Its help; what the terminal puts into brackets behind it, as sentences."""
    record = parameter.get_help_record(context)
    text, _, facts = (record[1] if record else "").partition("  [")
    said = [fact.strip() for fact in facts.removesuffix("]").split(";") if fact.strip()]
    return " ".join([one_line(text), *(f"{fact[:1].upper()}{fact[1:]}." for fact in map(in_words, said))])


def in_words(fact: str) -> str:
    """``1<=x<=10`` as the range that it is."""
    return f"range: `{fact}`" if "x" in fact and "=" in fact.replace("default", "") else fact


def paragraphs(text: str) -> list[str]:
    """Help text as Markdown: paragraphs stay paragraphs."""
    parts = re.split(r"\n\s*\n", inspect.cleandoc(text).replace("\b\n", ""))
    return [line for part in parts for line in (one_line(part), "")]


def one_line(text: str) -> str:
    """Text in one line, with options as code, and nothing else that Markdown would take for its own."""
    text = re.sub(r"(?<![\w`-])--[a-z][a-z-]*", r"`\g<0>`", " ".join(text.split()))
    parts = re.split(r"(`[^`]*`)", text)
    quoted = [re.sub(r"([\\*_<>\[\]#|])", r"\\\1", part) if i % 2 == 0 else part for i, part in enumerate(parts)]
    line = "".join(quoted)
    return line[:1].upper() + line[1:] + ("." if line and line[-1] not in ".?!:" else "")
