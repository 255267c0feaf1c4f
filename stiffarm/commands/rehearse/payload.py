"""A rehearsal as JSON: keys with units, null where there is no number."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from rehearsal.possible import NOTHING
from rehearsal.scoring import DETECTABLE
from robots.quantities import rounded
from stiffarm.commands.rehearse import words
from stiffarm.commands.rehearse.step import Number, Rehearsed
from stiffarm.session.json_text import share

SCHEMA = "stiffarm-rehearsal/1"


def rehearsal(draws: Sequence[Rehearsed], secret: bool, seed: int) -> dict[str, Any]:
    """All draws, and their tally."""
    first = draws[0]
    every, seen = words.right(draws)
    return {
        "schema": SCHEMA,
        "robot": first.diagnosed.given.robot.name,
        "load_path": first.diagnosed.given.model.load_path,
        "links": first.diagnosed.given.model.link_kind,
        "set_ups": first.set_ups.source,
        "noise": first.set_ups.words,
        "secret": secret,
        "seed": seed,
        "detectable_chi2": DETECTABLE,
        "outcomes": dict(Counter(r.outcome for r in draws)),
        "right_family": share(every),
        "right_family_of_visible": share(seen),
        "draws": [draw(r) for r in draws],
    }


def draw(r: Rehearsed) -> dict[str, Any]:
    """One draw, unveiled."""
    v = r.verdict
    return {
        "hidden": r.world.code,
        "law": None if r.world.code == NOTHING else r.world.truth.effects[0]["law"],
        "verdict": v.kind,
        "found": list(v.found),
        "sure": list(v.found[: v.sure]),
        "set95": list(r.diagnosed.credible),
        "outcome": r.outcome,
        "in_words": words.outcome(r),
        "right_family_first": r.is_right,
        "visible": r.is_visible,
        "excess_chi2": rounded(r.excess, 4),
        "gap": None if r.gap_mm is None else {"before_mm": rounded(r.gap_mm[0]), "after_mm": rounded(r.gap_mm[1])},
        "parameters": {n.name: parameter(n) for n in r.numbers},
        "not_testable": r.world.code in v.not_testable,
    }


def parameter(n: Number) -> dict[str, Any]:
    """A true number beside the one found."""
    return {
        "unit": n.unit,
        "true": rounded(n.true),
        "found": None if n.found is None else rounded(n.found),
        "interval95": None if n.interval95 is None else [rounded(v) for v in n.interval95],
        "inside": n.is_inside,
    }
