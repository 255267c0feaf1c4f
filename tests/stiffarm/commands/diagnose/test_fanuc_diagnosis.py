"""The bundled FANUC campaign diagnosed by its name alone: what is named, what has a twin, and what it is worth."""

from __future__ import annotations

import pytest
from cli_runs import Command

FRAME, ZERO = "turned-frame", "joint-zero-offset:j1"


@pytest.mark.slow
def test_a_turned_frame_and_the_first_zero_are_each_others_twins(cli: Command) -> None:
    r = cli("diagnose", "fanuc-r2000ic", "--next", "0", "--folds", "2", "--json").json
    assert r["verdict"] == "ambiguous"
    named = [e["code"] for e in r["effects"]]
    assert not {FRAME, ZERO} & set(named)
    assert ZERO in r["twins"][FRAME]
    assert FRAME in r["twins"][ZERO]
    # Whatever was found has an entry, if only an empty one.
    assert {e["code"] for e in (*r["effects"], *r["provisional"])} <= set(r["twins"])
    # The nested figure is the one shown.
    gap = r["gap"]
    assert gap["held_out_by"] == "nested folds"
    nested = gap["nested"]
    assert (nested["folds"], len(nested["effects"])) == (2, 2)
    assert gap["after"]["holdout_rms_mm"] == nested["after_rms_mm"]
    # Choosing effects on all poses flatters them; gear springs alone leave 0.234 mm in an independent reckoning.
    assert gap["after"]["left_one_pose_out_rms_mm"] < nested["after_rms_mm"] < 0.8 * 0.234


@pytest.mark.parametrize(("folds", "says"), [("1", "2 or more"), ("51", "50"), ("-1", "0")])
def test_folds_that_leave_nothing_to_learn_from_are_refused(cli: Command, folds: str, says: str) -> None:
    outcome = cli("diagnose", "fanuc-r2000ic", "--folds", folds)
    assert outcome.code == 2
    assert says in outcome.err
