"""OpenSees in a process of its own, as it would spoil ours: decks come in and displacements go out, one JSON line each.

A task is ``{"deck": [[command, argument, ...], ...], "patterns": [{"times", "values", "loads"}, ...], "legs": [[end of
the leg in s, steps, whether to read], ...], "node": tag}``. Pseudo time is time: materials with dashpots see seconds.
"""

from __future__ import annotations

import ctypes
import importlib.util
import json
import os
import sys
from pathlib import Path
from typing import Any

TOLERANCE = 1e-11  # m and rad: some thousandth of the last digit that is written down
# Most laws go by Newton; those that bend sharply on reversal by their first, stiffest tangent, which takes many rounds.
WAYS: tuple[tuple[tuple[Any, ...], int], ...] = (
    (("Newton",), 40),
    (("KrylovNewton",), 100),
    (("NewtonLineSearch", "-type", "Bisection"), 60),
    (("ModifiedNewton", "-initial"), 1500),
)
DEEPEST = 5
FOREVER = 1e9  # s


def engine() -> Any:
    """The module; the BLAS that it brings along is loaded first, as its LAPACK does not find it by itself."""
    found = importlib.util.find_spec("openseespylinux")
    if found and found.origin:
        brought = Path(found.origin).parent / "lib" / "libblas.so.3"
        if brought.exists():
            ctypes.CDLL(str(brought), mode=ctypes.RTLD_GLOBAL)
    import openseespy.opensees as ops

    return ops


def _set_up(ops: Any, task: dict[str, Any]) -> None:
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for command, *arguments in task["deck"]:
        getattr(ops, command)(*arguments)
    for tag, pattern in enumerate(task["patterns"], 1):
        times, values = pattern["times"], pattern["values"]
        ops.timeSeries("Path", tag, "-time", *times, FOREVER, "-values", *values, values[-1])  # Behind its end it is 0.
        ops.pattern("Plain", tag, tag)
        for node, *load in pattern["loads"]:
            ops.load(node, *load)
    ops.constraints("Transformation")
    ops.numberer("RCM")
    ops.system("BandGeneral")
    ops.integrator("LoadControl", 1.0)
    ops.test("NormDispIncr", TOLERANCE, 40, 0)
    ops.algorithm("Newton")
    ops.analysis("Static", "-noWarnings")


def _one(ops: Any, seconds: float, depth: int) -> None:
    """One step, by another algorithm or in halves where it does not converge."""
    ops.integrator("LoadControl", seconds)
    for way, rounds in WAYS:
        ops.test("NormDispIncr", TOLERANCE, rounds, 0)
        ops.algorithm(*way)
        if ops.analyze(1) == 0:
            return
    if depth == DEEPEST:
        raise RuntimeError(f"no equilibrium at {ops.getTime()} s")
    for _ in range(2):
        _one(ops, seconds / 2, depth + 1)


def run(ops: Any, task: dict[str, Any]) -> list[list[float]]:
    """Displacements (n, 6) of the node at the ends of the legs that are to be read."""
    _set_up(ops, task)
    found = []
    for end, steps, is_read in task["legs"]:
        first = ops.getTime()
        for _ in range(steps):
            _one(ops, (end - first) / steps, 0)
        if is_read:
            found.append(ops.nodeDisp(task["node"]))
    return found


def main() -> None:
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # What materials print about themselves is no answer.
    ops = engine()
    for line in sys.stdin:
        try:
            answer: dict[str, Any] = {"found": run(ops, json.loads(line))}
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        out.write(json.dumps(answer) + "\n")
        out.flush()
    os._exit(0)  # It crashes on its way out now and then.


if __name__ == "__main__":
    main()
