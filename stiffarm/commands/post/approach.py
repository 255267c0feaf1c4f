"""Positioning moves that come from the calibrated side: what was asked, figures and words."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from doe.absolute.table import ways_of
from machining.programs.approach import ANGLE, LARGEST, Approach, Approached
from machining.programs.run import PostRun
from robots import InputError, Robot
from stiffarm.session.json_text import number

DEGREES, LARGEST_DEG = round(float(np.degrees(ANGLE)), 9), round(float(np.degrees(LARGEST)), 9)
SIGNS: Final = {1.0: "+", -1.0: "-", 0.0: "0"}


def parse_approach(signs: str | None, deg: float | None, robot: Robot) -> Approach | None:
    """What ``--approach`` and ``--approach-deg`` ask for; None: nothing.

    Raises
    ------
    InputError
        Other signs, as many as the arm has no joints, all of them 0; an angle that is none or too large, or alone.
    """
    if deg is not None and not 0.0 < deg <= LARGEST_DEG:
        raise InputError(
            "--approach-deg",
            code="Q009",
            value=deg,
            allowed=f"above 0, up to {LARGEST_DEG:g} deg",
            remedy="give several times the lost motion of the joints, as 0.5",
        )
    if signs is None:
        if deg is not None:
            raise InputError(
                "--approach-deg without --approach", code="A003", remedy="add --approach with a sign for each joint"
            )
        return None
    ways = ways_of(signs.strip(), robot.dof)
    if ways is None or not ways.any():
        raise InputError(
            "--approach",
            code="A004",
            value=signs,
            allowed=f"a +, - or 0 for each of {robot.dof} joints, not all 0",
            remedy="write + for a joint that shall turn the positive way as it arrives, as in the column approach",
        )
    return Approach(ways, float(np.radians(DEGREES if deg is None else deg)))


def payload(found: Approached, approach: Approach) -> dict[str, Any]:
    """Figures, keys with units."""
    return {
        "signs": "".join(SIGNS[float(way)] for way in approach.ways),
        "angle_deg": number(float(np.degrees(approach.angle))),
        "positioning_moves": found.targets,
        "points_put_in": len(found.moves),
        "no_room_within_limits": dict(found.left_out),
        "farthest_from_target_mm": number(found.away * 1e3),
        "deepest_beyond_target_mm": number(found.deeper * 1e3),
    }


def words(run: PostRun) -> tuple[str, ...]:
    """What was put in, and what must be known of it; nothing where nothing was asked for."""
    found, approach = run.approached, run.request.approach
    if found is None or approach is None:
        return ()
    c = payload(found, approach)
    out = (
        f"{c['points_put_in']} of {found.targets} positioning moves that end where something begins come from the side "
        f"of `--approach {c['signs']}` in their last {c['angle_deg']:.3g} deg: by points up to {found.away * 1e3:.3g} "
        f"mm from their targets, up to {found.deeper * 1e3:.3g} mm deeper along the tool. Moves at feed are not "
        "changed."
    )
    if not found.left_out:
        return (out,)
    lacks = ", ".join(f"{joint} at {count}" for joint, count in found.left_out.items())
    return (out, f"not from that side, for want of room within the joints' limits: {lacks} of {found.targets} moves")
