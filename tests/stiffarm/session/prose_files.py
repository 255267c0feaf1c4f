"""What a command says of itself, one golden file a command: `python tests/stiffarm/session/prose_files.py` writes them.

The texts are those of ``--help`` before they are laid out, so that no version of a library changes them.
"""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent / "prose"
sys.path.insert(0, str(FOLDER.parents[3]))

from stiffarm.cli import COMMANDS, command_of  # noqa: E402


def parts(name: str, command: Any) -> list[tuple[str, Any]]:
    """A command and the commands below it, by their full names."""
    below = getattr(command, "commands", {})
    return [(name, command), *(part for sub, one in below.items() for part in parts(f"{name} {sub}", one))]


def prose(name: str) -> str:
    """Help, arguments and options of a command and of those below it."""
    out = []
    for full, command in parts(name, command_of(name)):
        out += [f"# stiffarm {full}", "", inspect.cleandoc(command.help or ""), ""]
        out += [f"{'/'.join(p.opts)}: {p.help}" for p in command.params] + [""]
    return "\n".join(out)


if __name__ == "__main__":
    for each in COMMANDS:
        (FOLDER / f"{each}.txt").write_text(prose(each), encoding="utf-8")
