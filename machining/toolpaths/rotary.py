"""Tool axis in the part frame from the rotary axes of five-axis machines.

With signs by ISO 841 (a positive angle turns the tool against the part in the positive sense, whichever of them turns)
table, head and mixed machines have one formula: axis = Rz(C) Rx(A) z or Rz(C) Ry(B) z. The C axis is the one next to
the part on a table, the one away from the tool on a head. Inclined (nutating) axes are not covered.
"""

from __future__ import annotations

import math

from machining.toolpaths.recorder import Vector


def tool_axis(rotary: str, angles: dict[str, float]) -> Vector:
    """Unit tool axis, from the tip into the holder, for ``angles`` by letter in rad; ``rotary`` such as "table-AC"."""
    tilt = rotary.rpartition("-")[2][0]
    c, s = math.cos(angles[tilt]), math.sin(angles[tilt])
    # Rx(A) z = (0, -sin A, cos A); Ry(B) z = (sin B, 0, cos B).
    x, y = (0.0, -s) if tilt == "A" else (s, 0.0)
    cc, sc = math.cos(angles["C"]), math.sin(angles["C"])
    return cc * x - sc * y, sc * x + cc * y, c
