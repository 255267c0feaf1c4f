"""The commands that pages show, as their reader would type them: one after the other, in a folder of the page's own.

Comments above a block, which no reader sees, say what a page leaves to its reader:
``<!-- run with: readings.csv=doe/data/xr701_gotlih.csv MODEL=xr701 -->`` copies a file of this tree under the name that
the block has for it, and puts a word in the place of one in capitals; ``<!-- not run: why -->`` leaves the block out,
``<!-- not run (study, map slice): why -->`` those commands of it.
``<!-- run in how-to/maps.md -->`` and ``<!-- run in how-to/maps.md (map slice) -->`` leave out what that page runs word
for word, but for ``--out``. Beside the commands ``cd``, ``cp`` and ``cat FILE >> FILE`` are carried out.
``<!-- shown -->`` above a block of text says that its lines are among what the commands print.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from test_house import ROOT

MARKS = r"(?P<marks>(?:^ *<!-- [^\n]*? -->\n+)*)"
BLOCK = re.compile(MARKS + r"^ *```(?:sh|bash|console)\n(?P<body>.*?)^ *```", re.MULTILINE | re.DOTALL)
RUN_WITH = re.compile(r"<!-- run with: (.+?) -->")
SHOWN = re.compile(r"^<!-- shown -->\n+```text\n(.*?)^```", re.MULTILINE | re.DOTALL)
SHELL = ("cd", "cp", "cat")
RUN_IN = re.compile(r"<!-- run in ([\w./-]+)(?: \(([^)]+)\))? -->")
NOT_RUN = re.compile(r"<!-- not run(?: \(([^)]+)\))?: (.+?) -->")


@dataclass(frozen=True)
class Typed:
    """A line of a page: the words behind ``stiffarm`` or, of the shell's own, all.

    ``skipped``: why it is not run; ``run_in``: the page that runs it.
    """

    words: tuple[str, ...]
    given: Mapping[str, str]
    skipped: str = ""
    run_in: str = ""


def typed(text: str) -> Iterator[Typed]:
    """Lines of a page's examples that are commands of ``stiffarm``, and the shell's own that they need."""
    for block in BLOCK.finditer(text):
        marks = block["marks"]
        given = dict(one.split("=", 1) for some in RUN_WITH.findall(marks) for one in some.split())
        out = {name.strip(): why for names, why in NOT_RUN.findall(marks) for name in names.split(",")}
        there = {name.strip(): page for page, names in RUN_IN.findall(marks) for name in names.split(",")}
        for line in block["body"].replace("\\\n", " ").splitlines():
            words = tuple(re.split(r"(?:^|\s)#", line)[0].replace("'", "").split())
            if words and words[0] in SHELL:
                yield Typed(words, given, out.get("", ""))
            elif words[:1] == ("stiffarm",):
                yield Typed(words[1:], given, _of(out, words[1:]), _of(there, words[1:]))


def _of(marked: Mapping[str, str], words: tuple[str, ...]) -> str:
    """What is marked of the commands that begin like this one."""
    said = " ".join(words)
    return next((value for name, value in marked.items() if said.startswith(name)), "")


def filled_in(words: tuple[str, ...], given: Mapping[str, str]) -> list[str]:
    """The words with what a page leaves to its reader; what stands in brackets goes where nothing is given for it."""
    text = " ".join(words)
    for part in re.findall(r"\[[^\]]+\]", text):
        needed = set(re.findall(r"\b[A-Z]{4,}\b", part))
        text = text.replace(part, part[1:-1] if needed <= given.keys() else "")
    return [re.sub(r"^[A-Z]+\b", lambda found: given.get(found[0], found[0]), word) for word in text.split()]


def lay_out(given: Mapping[str, str], folder: Path) -> None:
    """Copy files under the names that a block has for them; from this tree or from what the page has made so far."""
    for name, source in given.items():
        if not name.isupper():
            made = folder / source
            shutil.copy(made if made.exists() else ROOT / source, folder / name)


def by_the_shell(words: tuple[str, ...], folder: Path) -> Path:
    """Carry out one of the shell's own; the folder that the page is in then."""
    match words:
        case ("cd", to):
            return folder / to
        case ("cp", source, name):
            shutil.copy(folder / source, folder / name)
        case ("cat", source, ">>", name):
            with (folder / name).open("a", encoding="utf-8") as file:
                file.write((folder / source).read_text(encoding="utf-8"))
        case _:
            raise ValueError(words)
    return folder


def not_said(text: str, said: str) -> list[str]:
    """Lines that a page shows as printed, and that nothing printed; frames of tables and blanks do not count."""
    flat = " ".join(said.split())
    lines = [" ".join(line.strip(" │").split()) for block in SHOWN.findall(text) for line in block.splitlines()]
    return [line for line in lines if line != "..." and line not in flat]
