"""A power analysis as JSON: keys with units, null where there is no number."""

from __future__ import annotations

from typing import Any

from doe.power.chances import POWER, Chance
from robots.quantities import rounded
from stiffarm.commands.rehearse.power.step import Addition, Power, Prospect, SpringProspect

SCHEMA = "stiffarm-power/1"


def power(r: Power, seed: int) -> dict[str, Any]:
    """Everything that a planned sheet would show."""
    return {
        "schema": SCHEMA,
        "robot": r.given.robot.name,
        "load_path": r.given.model.load_path,
        "links": r.given.model.link_kind,
        "set_ups": r.set_ups.source,
        "readings": r.readings,
        "poses": len(r.set_ups.table.pose_groups()),
        "noise": r.set_ups.words,
        "draws": r.draws,
        "seed": seed,
        "power": POWER,
        "mean_found": rounded(r.mean[0], 4),
        "mean_named": rounded(r.mean[1], 4),
        "effects": {p.code: prospect(p) for p in r.prospects},
        "springs": {s.joint: spring(s) for s in r.springs},
        "springs_assumed": list(r.assumed),
        "one_more": {a.what.removeprefix("one more ").replace("-", ""): addition(a) for a in r.additions},
    }


def prospect(p: Prospect) -> dict[str, Any]:
    """One effect; ``smallest_found``: of a stiffness the stiffest; null where nothing usual is found."""
    return {
        "words": p.words,
        "parameter": p.parameter or None,
        "unit": p.unit or None,
        "smallest_found": None if p.smallest is None else rounded(p.smallest, 3),
        "is_stiffness": p.is_stiffness,
        "usual": None if p.usual is None else [rounded(v) for v in p.usual],
        "found": _chance(p.found),
        "named": _chance(p.named),
        "chi2_of_usual": rounded(p.chi2, 4),
        "size_interval95_share": None if p.accuracy95 is None else rounded(p.accuracy95, 3),
        "twin": p.twin or None,
        "why_not": p.why_not,
        "sizes_from": "rehearsals" if p.by_rehearsal else "catalogue",
    }


def spring(s: SpringProspect) -> dict[str, Any]:
    """A spring; the upper end is null where rigid is possible."""
    return {
        "k_Nm_per_rad": rounded(s.stiffness),
        "interval95_Nm_per_rad": [rounded(s.low), None if s.high is None else rounded(s.high)],
    }


def addition(a: Addition) -> dict[str, Any]:
    """What one more adds to the chances in the mean over effects."""
    return {
        "readings": a.readings,
        "found": rounded(a.found, 3),
        "named": rounded(a.named, 3),
        "gains_most": a.most or None,
        "most_gain": rounded(a.most_gain, 3),
    }


def _chance(c: Chance) -> dict[str, Any]:
    return {"chance": rounded(c.value, 3), "interval95": [rounded(c.low, 3), rounded(c.high, 3)]}
