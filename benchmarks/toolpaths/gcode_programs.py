"""Random programs of the grammar of :mod:`plain_gcode`: valid ones of 5 to 40 blocks, of one dialect each.

The interpreter goes along while a program is written, so that arcs and corners fit to where the tool is.
"""

from __future__ import annotations

import random

from gcode_writer_iso import Fanuc, LinuxCnc
from gcode_writer_siemens import Siemens
from plain_gcode import DIALECTS, moves

SUFFIX = {"fanuc": ".nc", "linuxcnc": ".ngc", "siemens": ".mpf"}


def program(seed: int, dialect: str | None = None) -> tuple[str, str]:
    """A program's text and its dialect."""
    while True:
        chance = random.Random(seed)  # noqa: S311 - the programs of a seed are the same each time
        kind = dialect or chance.choice(DIALECTS)
        writer = {"fanuc": Fanuc, "linuxcnc": LinuxCnc, "siemens": Siemens}[kind](chance, kind)
        try:
            text = writer.written()
            if moves(text, kind):
                return text, kind
        except ValueError:
            pass
        # A construct did not fit to where the tool was.
        seed += 1_000_000_007
