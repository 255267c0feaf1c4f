"""CalculiX as an oracle: read an input as it does, run it, read what it printed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from robots.arrays import Array

Freedom = tuple[int, int]

CCX = shutil.which("ccx")
TIME_LIMIT = 900.0  # s


@dataclass
class Read:
    """What an input file says. ``equations``: terms, the dependent one first; ``rigid``: set, reference, rotation."""

    nodes: dict[int, Array] = field(default_factory=dict)
    elements: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[str]] = field(default_factory=dict)
    equations: list[dict[Freedom, float]] = field(default_factory=list)
    rigid: list[tuple[str, int, int]] = field(default_factory=list)
    fixed: list[Freedom] = field(default_factory=list)
    springs: dict[str, float] = field(default_factory=dict)
    sections: dict[str, list[str]] = field(default_factory=dict)
    loads: dict[Freedom, float] = field(default_factory=dict)
    keywords: list[str] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)

    def members(self, name: str) -> list[int]:
        """Elements of a set that may name other sets."""
        out: list[int] = []
        for member in self.element_sets[name]:
            out += self.members(member) if member in self.element_sets else [int(member)]
        return out


def _blocks(text: str) -> Iterator[tuple[str, dict[str, str], list[list[str]]]]:
    """Keyword, parameters and data lines; comments are left out."""
    lines = [line for line in text.split("\n") if line and not line.startswith("**")]
    starts = [i for i, line in enumerate(lines) if line.startswith("*")]
    for i, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        keyword, *parameters = lines[i].split(",")
        pairs = (p.partition("=") for p in parameters)
        yield keyword, {name: value for name, _, value in pairs}, [line.split(",") for line in lines[i + 1 : end]]


def read_deck(text: str) -> Read:
    """Read an input; unknown keywords are an error."""
    out = Read(comments=[line for line in text.split("\n") if line.startswith("**")])
    for keyword, given, data in _blocks(text):
        out.keywords.append(keyword)
        flat = [field for line in data for field in line if field]
        match keyword:
            case "*NODE":
                out.nodes |= {int(n): np.array([float(x), float(y), float(z)]) for n, x, y, z in data}
                out.node_sets[given["NSET"]] = [int(line[0]) for line in data]
            case "*ELEMENT":
                out.elements |= {int(line[0]): (given["TYPE"], [int(n) for n in line[1:]]) for line in data}
                out.element_sets[given["ELSET"]] = [line[0] for line in data]
            case "*NSET":
                out.node_sets[given["NSET"]] = [int(n) for n in flat]
            case "*ELSET":
                out.element_sets[given["ELSET"]] = flat
            case "*EQUATION":
                assert int(flat[0]) == (len(flat) - 1) // 3
                terms = [flat[i : i + 3] for i in range(1, len(flat), 3)]
                out.equations.append({(int(n), int(d)): float(c) for n, d, c in terms})
                assert len(out.equations[-1]) == len(terms), "a freedom twice in an equation"
            case "*RIGID BODY":
                out.rigid.append((given["NSET"], int(given["REF NODE"]), int(given["ROT NODE"])))
            case "*BOUNDARY":
                assert all(first == last for _, first, last in data)
                out.fixed += [(int(node), int(direction)) for node, direction, _ in data]
            case "*SPRING":
                assert "." not in flat[0], "CalculiX takes what has a point for the constant"
                assert "." in flat[1], "and what has none for a direction"
                out.springs[given["ELSET"]] = float(flat[1])
            case "*SHELL SECTION" | "*BEAM SECTION":
                out.sections[given["ELSET"]] = flat
            case "*CLOAD":
                out.loads |= {(int(node), int(direction)): float(value) for node, direction, value in data}
            case "*MATERIAL" | "*ELASTIC" | "*STEP" | "*STATIC" | "*NODE PRINT" | "*NODE FILE" | "*EL FILE":
                pass
            case "*END STEP":
                pass
            case _:
                raise AssertionError(f"unknown keyword {keyword}")
    return out


@dataclass(frozen=True)
class Printed:
    """Displacements (3,) of the printed nodes by number, the file's units; the process's time and its solver."""

    displacements: dict[int, Array]
    seconds: float
    solver: str


def run_ccx(text: str, folder: Path, threads: int = 1) -> Printed:
    """Run CalculiX on an input.

    Raises
    ------
    RuntimeError
        CalculiX is missing, or printed nothing; the message has the end of its log.
    """
    if CCX is None:
        raise RuntimeError("CalculiX (ccx) is not installed")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.inp").write_text(text, encoding="ascii")
    start = time.perf_counter()
    done = subprocess.run(  # noqa: S603 - a program found on the path, constant arguments
        [CCX, "arm"],
        cwd=folder,
        env={**os.environ, "OMP_NUM_THREADS": str(threads)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=TIME_LIMIT,
        check=False,
    )
    seconds = time.perf_counter() - start
    printed = folder / "arm.dat"
    rows = [line.split() for line in printed.read_text(encoding="ascii").split("\n")] if printed.exists() else []
    found = {int(row[0]): np.array([float(v) for v in row[1:]]) for row in rows if len(row) == 4 and row[0].isdigit()}
    if done.returncode or not found:
        raise RuntimeError(f"CalculiX failed ({done.returncode}):\n{done.stdout[-1500:]}{done.stderr[-500:]}")
    solver = re.search(r"using the (.+) solver", done.stdout)
    return Printed(found, seconds, solver[1] if solver else "unknown")
