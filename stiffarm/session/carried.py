"""What the flange carries, as options say it: ``KG`` or ``KG,X,Y,Z``."""

from __future__ import annotations

from typing import Final

import numpy as np

from doe.absolute.readings import Payload
from robots import InputError
from stiffarm.session.parsing import parse_numbers

HEAVIEST_kg: Final = 5000.0
WIDEST_mm: Final = 5000.0


def parse_payload(text: str) -> Payload:
    """Mass and centre in the flange frame, mm.

    Raises
    ------
    InputError
        No mass, or a place that no tool has.
    """
    values = parse_numbers(text) or ()
    kg, *centre = (*values, 0.0, 0.0, 0.0) if len(values) == 1 else values or (-1.0,)
    if len(centre) != 3 or not 0.0 <= kg <= HEAVIEST_kg or max(map(abs, centre)) > WIDEST_mm:
        raise InputError(
            "--payload", value=text, allowed=f"KG or KG,X,Y,Z: 0 to {HEAVIEST_kg:g} kg, its centre within "
            f"{WIDEST_mm:g} mm of the flange", remedy="give the mass of spindle and tool, as in 25,0,0,120",
        )  # fmt: skip
    return Payload(float(kg), np.array(centre) * 1e-3)
