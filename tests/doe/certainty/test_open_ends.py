"""Where the data do not exclude an end of a parameter's range, there is no limit on that side, and only there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from doe.certainty.uncertainty import ParameterEstimate, certainty
from doe.estimation.estimate import estimate
from fem.free.base import Scale
from fem.free.kinds import KINDS
from fem.free.parameters import Parameter
from stiffarm.commands.calibrate.words import interval_text
from tests.doe.plain_problems import PlainModel, problem_of

# Deflection is the parameter's variable itself, in m; readings scatter by 30 um.
SCATTER = 30e-6 * np.array([1.0, -1.0, 0.5, -0.5, 1.0, -1.0])


def found(truth: float, lower: float, upper: float, scale: Scale = "linear") -> ParameterEstimate:
    """What six readings say of an amplitude."""
    parameter = Parameter("settling", KINDS[0], "tool", (0,), "m", 0.5 * upper, lower, upper, scale)
    lever = np.ones((len(SCATTER), 1))
    model = PlainModel([parameter], np.array([parameter.inner(0.5 * upper)]), lambda u: (lever @ u, lever))
    (one,) = certainty(estimate(problem_of(model, truth + SCATTER), (30e-6, 30e-6))).estimates
    return one


@pytest.mark.parametrize(
    ("truth_um", "range_um", "status", "ends"),
    [
        # An amplitude without a sign that the readings cannot tell from none, and one that fits best at none.
        (10.0, (0.0, 800.0), "one-sided", (0.0, "finite")),
        (-10.0, (0.0, 800.0), "at bound", (0.0, "finite")),
        # Signed: none is inside the range, so both ends are limits.
        (10.0, (-800.0, 800.0), "determined", ("finite", "finite")),
        (-790.0, (-800.0, 800.0), "one-sided", (-math.inf, "finite")),
        (790.0, (-800.0, 800.0), "one-sided", ("finite", math.inf)),
        (300.0, (0.0, 800.0), "determined", ("finite", "finite")),
    ],
)
def test_an_open_end_is_on_its_own_side(
    truth_um: float, range_um: tuple[float, float], status: str, ends: tuple[float | str, float | str]
) -> None:
    one = found(1e-6 * truth_um, 1e-6 * range_um[0], 1e-6 * range_um[1])
    assert one.status == status
    assert one.interval[0] <= one.value <= one.interval[1]
    for end, wanted in zip(one.interval, ends, strict=True):
        assert math.isfinite(end) if wanted == "finite" else end == wanted


def test_an_amplitude_that_may_be_none_has_an_upper_limit_in_words() -> None:
    one = found(10e-6, 0.0, 800e-6)
    assert interval_text(one, 1e6) == f"<= {one.interval[1] * 1e6:.3g}"
    # Half of what a mean of six readings is known to, both ways: the limit cannot be far from it.
    assert 10e-6 < one.interval[1] < 100e-6
