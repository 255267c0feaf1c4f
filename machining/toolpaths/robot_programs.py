"""Robot programs given where a tool path is wanted: recognised by what stands in them."""

from __future__ import annotations

import re
from collections.abc import Sequence

from robots import InputError

# Language, what its programs begin with or hold, and the format of `stiffarm post` for it.
_LANGUAGES: tuple[tuple[str, re.Pattern[str], str], ...] = (
    ("FANUC (TP, .LS)", re.compile(r"^\s*/PROG\b"), ""),
    ("Yaskawa (INFORM, .JBI)", re.compile(r"^\s*/JOB\s*$"), ""),
    (
        "ABB (RAPID, .mod)",
        re.compile(r"^\s*MODULE\s+\w+\s*(?:\([\w,\s]*\))?\s*$|^\s*Move(?:AbsJ|J|L|C)\s+[\w\[*]+.*,", re.I),
        "rapid",
    ),
    (
        "Universal Robots (URScript, .script)",
        re.compile(r"^\s*(?:def\s+\w+\s*\([^)]*\)\s*:|(?:move[jlpc]|servoj|set_tcp|set_payload)\s*\()"),
        "urscript",
    ),
    (
        "KUKA (KRL, .src)",
        re.compile(
            r"^\s*(?:&ACCESS\b|(?:GLOBAL\s+)?DEF\s+\w+\s*\(|DEFDAT\s+\w+|BAS\s*\(\s*#|"
            r"S?(?:PTP|LIN|CIRC)\s+(?:\{|X\w+))",
            re.I,
        ),
        "krl",
    ),
)


def refuse_robot_program(name: str, head: Sequence[str]) -> None:
    """Refuse a robot program by the name of its language; ``head``: its first lines.

    Raises
    ------
    InputError
        It is one.
    """
    for language, pattern, form in _LANGUAGES:
        if any(pattern.match(line) for line in head):
            raise InputError(
                f"{name}: a robot program of {language}, no tool path",
                code="P023",
                allowed="tool paths of CAM systems: G-code, APT or CL data, Heidenhain's language, CSV",
                remedy="give the CAM file that it was made from: stiffarm post writes robot programs from that"
                + (f" (--format {form})" if form else "")
                + ", and stiffarm verify checks them; or write its points as CSV "
                "(x_mm, y_mm, z_mm, nx, ny, nz)",
            )
