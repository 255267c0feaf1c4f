"""Arcs of APT dialects: ``CIRCLE/`` with the ``GOTO`` behind it, ``MOVARC/``, and ``TLON,GOFWD/`` of CATIA."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from machining.toolpaths.apt.words import as_number, items, numbers
from machining.toolpaths.arcs import sweep_about
from machining.toolpaths.recorder import StatementError
from robots.arrays import Array

# Sine of the angle by which INDIRV may miss the tangent; five decimals on a radius of 1 mm leave less than 1e-4.
TANGENT = 0.02
# Longest such statement (characters).
TLON_LIMIT = 2000


@dataclass(frozen=True, eq=False)
class ArcWord:
    """Arc that waits for its end: ``center`` and ``axis`` (3,), ``radius`` m or None.

    It runs right-handed about ``axis``. ``turns`` as in :func:`arc_points`. ``angle`` rad: the sweep that the word
    states, None if it states none.
    """

    center: Array
    axis: Array
    radius: float | None = None
    turns: int = 1
    angle: float | None = None

    def settled(self, start: Array, end: Array) -> tuple[ArcWord, str | None]:
        """Arc with its sense checked against the angle stated, and a remark where the axis had to be reversed.

        Raises
        ------
        StatementError
            The angle leads to the end in neither sense.
        """
        if self.angle is None:
            return self, None
        lever = max(float(np.linalg.norm(end - self.center)), 1e-6)
        # An angle of six decimals in degrees, and ends rounded to a micrometre.
        slack = 1e-4 + 20e-6 / lever
        for axis, remark in ((self.axis, None), (-self.axis, "MOVARC turns left-handed about its axis by its angle")):
            miss = sweep_about(start, end, self.center, axis) - abs(self.angle)
            if abs(math.remainder(miss, 2.0 * math.pi)) < slack:
                turns = max(1, math.ceil(abs(self.angle) / (2.0 * math.pi) - slack))
                return ArcWord(self.center, axis, self.radius, turns), remark
        raise StatementError(
            f"angle {math.degrees(self.angle):.6g} deg does not lead from start to end", "the angle swept", code="P011"
        )


def circle(parts: list[str], scale: float, hand: str) -> ArcWord:
    """Arc of ``CIRCLE/x,y,z,i,j,k[,r[,t,s,d,c]][,TIMES,n]``.

    Creo: "the plane vector determines the plane and direction using the right hand rule" (PTC help, CL Output for
    Circular Interpolation); SolidWorks CAM writes the same without radius. Siemens NX adds tolerances and tool data
    and turns clockwise about its vector, as roll-in and corner arcs in its files show.

    Raises
    ------
    StatementError
        Numbers missing or too many.
    """
    parts, turns = _times(parts)
    values = numbers(parts, (6, 7, 8, 9, 10, 11))
    left = hand == "left" or (hand == "auto" and len(values) >= 10)
    axis = np.array(values[3:6]) * (-1.0 if left else 1.0)
    return ArcWord(np.array(values[:3]) * scale, axis, values[6] * scale if len(values) > 6 else None, turns)


def movarc(parts: list[str], scale: float) -> ArcWord:
    """Arc of ``MOVARC/[CENTER,]x,y,z,[AXIS,]i,j,k,[RADIUS,]r[,ANGLE,a][,TIMES,n]``, right-handed.

    Raises
    ------
    StatementError
        Numbers missing or too many.
    """
    parts, turns = _times(parts)
    angle = None
    if "ANGLE" in parts:
        at = parts.index("ANGLE")
        angle = math.radians(numbers(parts[at + 1 : at + 2], (1,))[0])
        parts = parts[:at] + parts[at + 2 :]
    values = numbers([part for part in parts if part not in ("CENTER", "AXIS", "RADIUS")], (7,))
    return ArcWord(np.array(values[:3]) * scale, np.array(values[3:6]), values[6] * scale, turns, angle)


_CIRCLE = re.compile(r"\(?\s*CIRCLE\s*/([^()]*)\)?\s*,\s*(?:ON|TO|PAST|TANTO)(?:\s*,\s*(\d+)\s*,\s*INTOF)?", re.I)
_CYLINDER = re.compile(r"\(\s*CYLNDR\s*/([^()]*)\)", re.I)
_LINE = re.compile(r"\(\s*LINE\s*/([^()]*)\)", re.I)
_POINT = re.compile(r"\(\s*POINT\s*/([^()]*)\)", re.I)


def tlon(rest: str, scale: float, start: Array, tangent: Array) -> tuple[ArcWord, Array]:
    """Arc of CATIA's ``TLON,GOFWD/`` and its end point (3,) m.

    ``(CIRCLE/xc,yc,zc,r),ON,[2,INTOF,](LINE/xc,yc,zc,xe,ye,ze)``, or a ``CYLNDR/`` with the end as last ``POINT/``.
    The arc starts along ``tangent`` (``INDIRV/``); the plane of a circle is that of tangent and radius.

    Raises
    ------
    StatementError
        Another form; a tangent that is none; an end that is not the one the words say it is.
    """
    if len(rest) > TLON_LIMIT:
        raise StatementError(f"TLON,GOFWD of {len(rest)} characters", f"up to {TLON_LIMIT}", code="P011")
    circle_part, line_part = _CIRCLE.search(rest), _LINE.search(rest)
    cylinder_part, point_parts = _CYLINDER.search(rest), _POINT.findall(rest)
    if circle_part and line_part:
        values = numbers(items(circle_part[1]), (4,))
        end = np.array(numbers(items(line_part[1]), (6,))[3:]) * scale
        second = circle_part[2] == "2"
        center, radius = np.array(values[:3]) * scale, values[3] * scale
        axis = np.cross(start - center, tangent)
    elif cylinder_part and point_parts:
        values = numbers(items(cylinder_part[1]), (7,))
        end = np.array(numbers(items(point_parts[-1]), (3,))) * scale
        center, axis, radius = np.array(values[:3]) * scale, np.array(values[3:6]), values[6] * scale
        if np.cross(axis, start - center) @ tangent < 0.0:
            axis = -axis
        second = None
    else:
        raise StatementError(
            f"{rest.strip()[:60]!r} behind TLON,GOFWD", "a CIRCLE with a LINE, or a CYLNDR with a POINT", code="P011"
        )
    lever, length = start - center, float(np.linalg.norm(tangent))
    lever = lever - (lever @ axis) / max(float(axis @ axis), 1e-300) * axis
    turns = 1e-9 < float(np.abs(axis).max()) < 1e9
    if not length or abs(lever @ tangent) > TANGENT * length * float(np.linalg.norm(lever)) or not turns:
        raise StatementError(
            "INDIRV is not tangent to the arc at its start", "the direction in which the arc starts", code="P011"
        )
    if second is not None and np.linalg.norm(end - start) > 1e-6:
        sweep = sweep_about(start, end, center, axis)
        # Within a thousandth of half a turn both words are right.
        if abs(sweep - math.pi) > 1e-3 and (sweep > math.pi) != second:
            stated = "the second" if second else "the first"
            raise StatementError(
                f"arc of {math.degrees(sweep):.4g} deg ends not on {stated} intersection", "its end", code="P011"
            )
    return ArcWord(center, axis, radius), end


def _times(parts: list[str]) -> tuple[list[str], int]:
    if "TIMES" not in parts:
        return parts, 1
    at = parts.index("TIMES")
    turns = as_number(parts[at + 1]) if len(parts) > at + 1 else None
    if turns is None or not 1 <= turns <= 10_000 or turns != int(turns):
        raise StatementError(f"TIMES,{','.join(parts[at + 1 : at + 2])}", "a whole number from 1 to 10000", code="P011")
    return parts[:at] + parts[at + 2 :], int(turns)
