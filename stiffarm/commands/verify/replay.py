"""replay.html: a program in its cell as one page that opens without a network, with its offences on a timeline."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from machining.verification import Offence, Verification
from robots.arrays import Array, Integers
from stiffarm.commands.verify.picture import Spot, spot_of, view_of
from stiffarm.commands.verify.words import kinds_words, offence_words, value_words
from stiffarm.pages.cell_bodies import cell_data
from stiffarm.pages.numbers import typeset
from stiffarm.pages.parts import packed, render_page

# Points kept of a long program: 60 bytes each in the file.
MOST_POINTS = 40_000
# Triangles of all bodies together: 30 bytes each.
MOST_TRIANGLES = 60_000
MOST_OFFENCES = 500
# Offences, the worst, whose worst pose and whose camera are looked for; others are shown where they begin.
SEARCHED, VIEWED = 40, 8


def replay_page(found: Verification, title: str) -> str:
    """The page as HTML text; what comes from files is escaped."""
    said = f"must not run: {kinds_words(found)}" if found.errors else "no offence found"
    scripts = ("page_matrices.js", "shop_scene.js")
    return render_page("replay.html.j2", replay_data(found), scripts, title=title, verdict=said)


def replay_data(found: Verification) -> dict[str, Any]:
    """Everything that the page shows: kinematics, bodies, points, offences; arrays as base64, little end first."""
    program, scenes = found.program, list(dict.fromkeys(found.scenes))
    tool = np.array([scenes.index(scene) for scene in found.scenes])
    spots = [spot_of(found, o) if k < SEARCHED else spot_of(found, o, 1) for k, o in enumerate(shown_offences(found))]
    kept = kept_points(found, also=[spot.move for spot in spots])
    distance = np.minimum(found.swept.distance, found.swept.within)
    time = np.cumsum(found.timing.time + program.motions.dwell)
    timed = bool(np.isfinite(time).all())
    return {
        **cell_data(scenes[0], MOST_TRIANGLES, scenes[1:]),
        "axes": [
            {"name": name, "linear": bool(linear), "lower": _bound(low), "upper": _bound(high)}
            for name, linear, low, high in zip(
                found.axes.names, found.axes.linear, found.axes.lower, found.axes.upper, strict=True
            )
        ],
        "n": len(kept),
        "moves": program.n,
        "values": packed(found.courses.points[kept], "<f4"),
        "tips": packed(found.courses.reached[kept, :3, 3], "<f4"),
        "move": packed(kept, "<i4"),
        "line": packed(program.motions.line[kept], "<i4"),
        "rapid": packed(program.motions.rapid[kept], "<u1"),
        "tool": packed(tool[program.motions.tool[kept]], "<u1"),
        "feed": packed(program.motions.feed[kept] * 6e4, "<f4"),
        "clearance": packed(_least_between(distance, kept) * 1e3, "<f4"),
        "horizon": found.swept.within * 1e3,
        "time": packed(time[kept], "<f8") if timed else None,
        "offences": [
            _offence(spot, view_of(found, spot)[0].towards if k < VIEWED else None) for k, spot in enumerate(spots)
        ],
        "note": "between points all axes are shown moving evenly" if found.courses.straight.any() else "",
        "left_out": len(found.offences) - len(spots),
    }


def shown_offences(found: Verification) -> Sequence[Offence]:
    """The offences that the page holds: the worst."""
    return found.ranked[:MOST_OFFENCES]


def kept_points(found: Verification, most: int = MOST_POINTS, also: Sequence[int] = ()) -> Integers:
    """Numbers of the points that the page holds: all, or of a long program some, with those at offences.

    ``also``: moves whose two ends are kept.
    """
    n = found.program.n
    if n <= most:
        return np.arange(n)
    offences = shown_offences(found)
    marked = np.array([k for o in offences for k in (o.move - 1, o.move, o.last)], dtype=np.int64)
    ends = np.array([k for move in also for k in (move - 1, move)], dtype=np.int64)
    even = np.round(np.linspace(0, n - 1, most - min(most // 2, marked.size))).astype(np.int64)
    return np.unique(np.clip(np.concatenate([even, marked, ends]), 0, n - 1))


def _least_between(values: Array, kept: Integers) -> Array:
    """Least value of all moves that lead from one kept point to the next."""
    first = np.concatenate([[0], kept[:-1] + 1])
    return np.asarray(np.minimum.reduceat(values, first))


def _offence(spot: Spot, towards: Array | None) -> dict[str, Any]:
    """An offence for the page; ``towards``: from its place to the eye."""
    offence, contact = spot.offence, spot.contact
    pair = np.stack([spot.place, spot.place]) if contact is None else contact.points
    return {
        "kind": str(offence.kind),
        "severity": str(offence.severity),
        "move": offence.move,
        "last": offence.last,
        "worst": spot.move,
        "at": offence.at if contact is None else contact.at,
        "line": offence.line,
        "worst_line": spot.line,
        "words": typeset(offence_words(offence)),
        "value": typeset(spot.distance_words or value_words(offence)),
        "bodies": list(spot.bodies),
        "pair": pair.tolist(),
        "apart": contact is not None and contact.gap > 0.0,
        "eye": None if towards is None else (towards / np.linalg.norm(towards)).tolist(),
    }


def _bound(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
