"""What came of a rehearsal is told as it is: every kind of verdict against every kind of truth."""

from __future__ import annotations

import pytest
from scipy.stats import beta

from rehearsal.scoring import Share, Verdict, family, outcome


def said(kind: str, *found: str, sure: int | None = None, left: tuple[str, ...] = (), blind: tuple[str, ...] = ()):
    return Verdict(kind, found, len(found) if sure is None else sure, left, blind)


@pytest.mark.parametrize(
    ("hidden", "verdict", "came"),
    [
        ("payload", said("named", "payload"), "named"),
        ("payload", said("named", "friction:j2", "payload"), "named"),
        ("gravity-compensator:j2", said("named", "angle-dependent-stiffness:j2"), "family"),
        ("backlash:j2", said("named", "backlash:j3"), "family"),
        ("joint-tilt:j1", said("named", "base-tilt"), "family"),
        ("joint-tilt:j2", said("named", "base-tilt"), "wrong"),
        ("payload", said("named", "drift"), "wrong"),
        ("payload", said("named", "drift", left=("drift", "payload")), "candidate"),
        ("payload", said("ambiguous", "payload", sure=0, left=("payload", "drift")), "candidate"),
        ("payload", said("ambiguous", "drift", sure=0, left=("payload", "drift")), "candidate"),
        ("payload", said("ambiguous", "drift", sure=0, left=("drift", "none")), "wrong"),
        ("payload", said("unknown"), "unnamed"),
        ("payload", said("unknown", "payload", sure=0), "candidate"),
        ("payload", said("none"), "nothing"),
        ("payload", said("none", blind=("payload",)), "not testable"),
        ("payload", said("uninformative"), "nothing"),
        ("none", said("none"), "named"),
        ("none", said("named", "payload"), "wrong"),
        ("none", said("ambiguous", "payload", sure=0), "unnamed"),
    ],
)
def test_each_outcome(hidden: str, verdict: Verdict, came: str) -> None:
    assert outcome(hidden, verdict) == came


def test_what_the_diagnosis_does_not_know_is_right_to_be_called_unknown() -> None:
    assert outcome("tool-point", said("unknown"), known=False) == "named"
    assert outcome("tool-point", said("named", "payload"), known=False) == "wrong"


def test_right_is_what_the_blind_study_calls_right() -> None:
    assert said("ambiguous", "payload", sure=0).is_right(("payload",))
    assert not said("named", "drift", "payload").is_right(("payload",))
    assert said("none").is_right(())
    assert not said("unknown").is_right(("payload",))
    # What it tried on the way to "unknown" is no answer.
    assert not said("unknown", "payload", sure=0).is_right(("payload",))


def test_the_first_joint_has_any_name() -> None:
    assert family("joint-tilt:waist", "waist") == "base-tilt"
    assert family("joint-tilt:waist") == "joint-tilt"


def test_shares_have_exact_intervals() -> None:
    low, high = Share(17, 20).interval95
    assert (low, high) == pytest.approx((beta.ppf(0.025, 17, 4), beta.ppf(0.975, 18, 3)))
    assert Share(0, 0).interval95 == (0.0, 1.0)
    assert Share(20, 20).interval95[1] == 1.0
