"""The reference of failures, read from the program's own catalogue: each code is an anchor of the page."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import pages

INTRODUCTION = """# Failures

Every error of the command line ends with a code, and so do warnings that change how far results can be trusted.
`stiffarm help CODE` prints the entry below. Codes never change and are never used again; a link to one is this page
with `#` and the code in small letters, as in `#t012`. Errors of input exit with 2, others with 1
([exit codes](../results.md)).
"""


def write(folder: Path) -> None:
    """Write ``index.md`` into the folder."""
    from stiffarm.failures import catalogue

    lines = [INTRODUCTION]
    for area, failures in groupby(catalogue().values(), key=lambda failure: failure.area):
        lines += [f"## {area}", ""]
        for failure in failures:
            lines += [f"({failure.code.lower()})=", f"### {failure.code}: {failure.title}", ""]
            lines += [failure.cause, "", f"**What to do:** {failure.remedy}", "", "```", failure.example, "```", ""]
    pages.write_all(folder, {"index.md": "\n".join(lines)})
