"""Write the same part in two dialects: bracket.cls as NX writes it, bracket.mpf for a SINUMERIK 840D with TRAORI.

    python make_part.py [FOLDER]

Made up: a pocket that a flat mill plunges into and clears, a crown that a ball mill follows with five axes, three holes
in a face that leans. Coordinates in mm in the part frame, z up; axes point from the tip into the holder.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

Move = tuple[tuple[float, float, float], tuple[float, float, float], float | None]

UP = (0.0, 0.0, 1.0)
SAFE = 60.0
# The face with the holes leans by so much about y.
LEAN_DEG = 20.0


def pocket() -> list[Move]:
    """A plunge to 4 mm, then a zigzag; feed None: a rapid move."""
    moves: list[Move] = [((10.0, 10.0, SAFE), UP, None), ((10.0, 10.0, 2.0), UP, None), ((10.0, 10.0, -4.0), UP, 200.0)]
    for row in range(5):
        y = 10.0 + 7.0 * row
        ends = (10.0, 90.0) if row % 2 == 0 else (90.0, 10.0)
        if row:
            moves.append(((ends[0], y, -4.0), UP, 900.0))
        moves.append(((ends[1], y, -4.0), UP, 900.0))
    last = moves[-1][0]
    return [*moves, ((last[0], last[1], SAFE), UP, None)]


def crown() -> list[Move]:
    """Three passes over a cylinder of radius 150 mm along x, the tool leaning 5 deg forward of its normal."""
    moves: list[Move] = []
    for row in range(3):
        y, points = 60.0 + 6.0 * row, []
        for k in range(31):
            t = math.radians(-15.0 + k)
            lean = t + math.radians(5.0)
            points.append(
                ((50.0 + 150.0 * math.sin(t), y, 150.0 * (math.cos(t) - 1.0)), (math.sin(lean), 0.0, math.cos(lean)))
            )
        points = points[::-1] if row % 2 else points
        (x, _, z), axis = points[0]
        start = (x + 25.0 * axis[0], y, z + 25.0 * axis[2])
        moves += [((start[0], start[1], SAFE), axis, None), (start, axis, None)] if row == 0 else [(start, axis, None)]
        moves.append((points[0][0], points[0][1], 400.0))
        moves += [(point, axis, 1500.0) for point, axis in points[1:]]
        (x, _, z), axis = points[-1]
        moves.append(((x + 25.0 * axis[0], y, z + 25.0 * axis[2]), axis, None))
    (x, y, _), axis, _ = moves[-1]
    return [*moves, ((x, y, SAFE), axis, None)]


def holes() -> tuple[tuple[float, float, float], list[tuple[float, float, float]], float]:
    """Axis of three holes, where they begin, and their depth."""
    lean = math.radians(LEAN_DEG)
    axis = (math.sin(lean), 0.0, math.cos(lean))
    across = (math.cos(lean), 0.0, -math.sin(lean))
    starts = [(120.0 + s * across[0], y, s * across[2]) for s, y in ((0.0, 20.0), (0.0, 50.0), (15.0, 35.0))]
    return axis, starts, 12.0


def cls() -> list[str]:
    """The part as NX writes it."""

    def goto(point: tuple[float, ...], axis: tuple[float, ...]) -> str:
        return "GOTO/" + ",".join(f"{v:.4f}" for v in point) + "," + ",".join(f"{v:.7f}" for v in axis)

    def path(moves: list[Move]) -> list[str]:
        out, feed = [], None
        for point, axis, wanted in moves:
            if wanted is None:
                out.append("RAPID")
            elif wanted != feed:
                out.append(f"FEDRAT/MMPM,{wanted:.1f}")
            feed = wanted
            out.append(goto(point, axis))
        return out

    axis, starts, depth = holes()
    above = [tuple(p + SAFE * a for p, a in zip(start, axis, strict=True)) for start in starts]
    return [
        "TOOL PATH/POCKET,TOOL,MILL_D20",
        "UNITS/MM",
        "TLDATA/MILL,20.0000,0.0000,75.0000,0.0000,0.0000",
        "MSYS/0.0000,0.0000,0.0000,1.0000000,0.0000000,0.0000000,0.0000000,1.0000000,0.0000000",
        "LOADTL/1",
        "SPINDL/RPM,8000,CLW",
        "COOLNT/ON",
        *path(pocket()),
        "COOLNT/OFF",
        "SPINDL/OFF",
        "END-OF-PATH",
        "TOOL PATH/CROWN,TOOL,BALL_D10",
        "TLDATA/MILL,10.0000,5.0000,60.0000,0.0000,0.0000",
        "LOADTL/2",
        "SPINDL/RPM,12000,CLW",
        "COOLNT/MIST",
        *path(crown()),
        "COOLNT/OFF",
        "SPINDL/OFF",
        "END-OF-PATH",
        "TOOL PATH/HOLES,TOOL,DRILL_D8",
        "TLDATA/DRILL,8.0000,118.0000,90.0000,0.0000",
        "OPSTOP",
        "LOADTL/3",
        "SPINDL/RPM,3000,CLW",
        "COOLNT/FLOOD",
        "RAPID",
        goto(above[0], axis),
        f"CYCLE/DRILL,RAPTO,3.0000,FEDTO,{-depth:.4f},RTRCTO,3.0000,MMPM,240.0000",
        *(goto(start, axis) for start in starts),
        "CYCLE/OFF",
        "RAPID",
        goto(above[-1], axis),
        "COOLNT/OFF",
        "SPINDL/OFF",
        "END-OF-PATH",
    ]


def mpf() -> list[str]:
    """The part for a SINUMERIK 840D, tools by name."""

    def path(moves: list[Move]) -> list[str]:
        out = []
        for (x, y, z), (i, j, k), feed in moves:
            words = f"X{x:.4f} Y{y:.4f} Z{z:.4f} A3={i:.7f} B3={j:.7f} C3={k:.7f}"
            out.append(f"G0 {words}" if feed is None else f"G1 {words} F{feed:.1f}")
        return out

    def tool(name: str, rpm: int) -> list[str]:
        return [f'T="{name}"', "M6", f"S{rpm} M3"]

    axis, starts, depth = holes()
    lean = math.radians(LEAN_DEG)
    # In the swivelled plane: x along the face, z out of it, from where the part frame is.
    local = [(p[0] * math.cos(lean) - p[2] * math.sin(lean), p[1], p[0] * axis[0] + p[2] * axis[2]) for p in starts]
    lines = [
        "; BRACKET, MADE UP FOR STIFFARM",
        "G17 G90 G71 G94",
        "G54",
        "; POCKET",
        *tool("MILL_D20", 8000),
        "M8",
        "TRAORI",
        *path(pocket()),
        "M9",
        "M5",
        "TRAFOOF",
        "; CROWN",
        *tool("BALL_D10", 12000),
        "M7",
        "TRAORI",
        *path(crown()),
        "M9",
        "M5",
        "TRAFOOF",
        "; HOLES",
        "M1",
        *tool("DRILL_D8", 3000),
        "M8",
        f'CYCLE800(0,"TABLE",0,57,0,0,0,0,{LEAN_DEG:.4f},0,0,0,0,-1)',
    ]
    x, y, z = local[0]
    lines += [f"G0 X{x:.4f} Y{y:.4f} Z{z + SAFE:.4f}", "F240"]
    for x, y, z in local:
        lines.append(f"G0 X{x:.4f} Y{y:.4f}")
        lines.append(f"CYCLE81({z + 3.0:.4f},{z:.4f},3,{z - depth:.4f})")
    x, y, z = local[-1]
    return [*lines, f"G0 X{x:.4f} Y{y:.4f} Z{z + SAFE:.4f}", "CYCLE800()", "M9", "M5", "M30"]


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    for name, text in (("bracket.cls", cls()), ("bracket.mpf", mpf())):
        (folder / name).write_text("\n".join(text) + "\n", encoding="utf-8")
