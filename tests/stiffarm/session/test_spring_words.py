"""A spring in words: its value, its interval, and at which bound it stands."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.text import Annotation

from doe.certainty.uncertainty import ParameterEstimate, certainty
from doe.estimation.estimate import estimate as estimated
from fem.free.kinds import KINDS
from fem.free.parameters import Parameter
from stiffarm.commands.calibrate.figures.identifiability import intervals_figure
from stiffarm.commands.calibrate.payload import spring as estimate
from stiffarm.commands.calibrate.words import bound_of, estimate_text
from stiffarm.session.words.springs import mega
from tests.doe.plain_problems import PlainModel, problem_of
from tests.stiffarm.made_estimates import INF, NAN, made_spring

RIGID = made_spring("j4", 1e9, (0.36e6, INF), "at bound")
SOFT = made_spring("j3", 1e3, (0.0, 0.02e6), "at bound")


@pytest.mark.parametrize(
    ("spring", "text"),
    [
        (made_spring("j2", 1.45e6, (0.94e6, 3.19e6), "determined"), "1.45 (0.940 to 3.19)"),
        (made_spring("j2", 0.84e6, (0.05e6, INF), "one-sided"), "0.840 (>= 0.0500)"),
        (RIGID, "at its bound: rigid fits best (>= 0.360)"),
        (SOFT, "at its bound: soft fits best (<= 0.0200)"),
        (made_spring("j2", 1e9, (NAN, NAN), "at bound"), "at its bound: rigid fits best (no spare reading)"),
        (made_spring("j2", 1e3, (NAN, NAN), "at bound"), "at its bound: soft fits best (no spare reading)"),
        (made_spring("j2", 1.5e6, (NAN, NAN), "determined"), "1.50 (no spare reading)"),
        (made_spring("j2", NAN, (NAN, NAN), "not identified"), "not identified"),
    ],
)
def test_a_spring_in_words(spring: ParameterEstimate, text: str) -> None:
    assert estimate_text(spring) == text


@pytest.mark.parametrize(
    ("deflection_mm", "bound", "spare"),
    # The rest of the model alone bends 1 mm. Less was measured: the spring would have to be stiffer than rigid.
    # 660 mm: softer than the softest spring (1e3 N m/rad), which 650 N at 1 m turn by 0.65 rad.
    [(0.5, "rigid", True), (660.0, "soft", True), (0.5, "rigid", False), (660.0, "soft", False)],
)
def test_the_bound_is_the_one_the_fit_stands_at(deflection_mm: float, bound: str, spare: bool) -> None:
    """By a fit of one spring under 650 N at 1 m, not by made-up estimates."""
    n = 3 if spare else 1
    # Scatter of a micrometre, so that there is an interval.
    value = 1e-3 * (deflection_mm + 1e-3 * np.array([1.0, -1.0, 0.0])[:n])
    free = Parameter("j1.stiffness", KINDS[0], "j1", (5,), "N m/rad", 1e6, 1e3, 1e9, "compliance")
    lever = np.full((n, 1), 650.0)
    model = PlainModel([free], np.array([1e-6]), lambda u: (1e-3 + lever @ u, lever))
    (spring,) = certainty(estimated(problem_of(model, value), (1e-5, 1e-5))).estimates
    assert spring.status == "at bound"
    assert bound_of(spring) == bound
    assert f"{bound} fits best" in estimate_text(spring)
    assert estimate(spring)["bound"] == bound
    assert estimate(spring)["k_Nm_per_rad"] is None


def test_a_spring_with_a_value_is_at_no_bound() -> None:
    spring = made_spring("j2", 0.84e6, (0.05e6, INF), "one-sided")
    assert bound_of(spring) is None
    assert "bound" not in estimate(spring)


def test_the_arrow_points_to_the_bound() -> None:
    ax = intervals_figure({"a": (RIGID, SOFT)}, expected=(1e5, 1e6)).axes[0]
    low, high = ax.get_xlim()
    # In 1e6 N m/rad. Neither 0, where the soft interval ends, nor 1000 stretches the axis.
    assert (low, high) == pytest.approx((0.02 / 1.8, 1.0 * 1.8))
    arrows = [a for a in ax.texts if isinstance(a, Annotation) and a.arrow_patch is not None]
    tips = [(a.xy[0], a.xyann[0]) for a in arrows]
    assert tips == [(high, 0.36), (low, 0.02)]


def test_without_spare_readings_a_bound_has_no_arrow() -> None:
    springs = (made_spring("j2", 1e9, (NAN, NAN), "at bound"), made_spring("j3", 1e3, (NAN, NAN), "at bound"))
    ax = intervals_figure({"a": springs}).axes[0]
    assert not [a for a in ax.texts if isinstance(a, Annotation) and a.arrow_patch is not None]


def test_millions() -> None:
    assert [mega(v) for v in (1.234e6, 1e9, 2345.0, NAN, INF)] == ["1.23", "rigid", "0.00234", "–", "rigid"]
