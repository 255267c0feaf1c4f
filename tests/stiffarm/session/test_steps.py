"""The workflow's steps as functions: what is written beside the numbers comes from the computation."""

from __future__ import annotations

import numpy as np
import pytest

import stiffarm as sa
from fem import directional_stiffness
from stiffarm.commands.maps.joints import JointsRequest
from stiffarm.session import inputs


@pytest.mark.parametrize(("direction", "works"), [((0.0, 0.0, -1.0), True), ((0.6, 0.0, 0.8), False)])
def test_a_map_takes_a_surrogate_of_its_own_load_only(direction: tuple[float, float, float], works: bool) -> None:
    given = inputs.read_model("kr60-3", "rigid", None)
    surrogate = sa.fit(given, direction=direction, basis="polynomial", degree=2, runs=300)
    asked = JointsRequest(points=2, surrogate=surrogate)
    if not works:
        with pytest.raises(sa.InputError, match="load direction"):
            asked.engine(given)
        return
    engine = asked.engine(given)
    made = engine.computed(asked.metadata(given, engine))
    assert made.metadata["load_direction"] == "0 0 -1"
    model = np.asarray(made.fields["model_stiffness_N_per_mm"].values)[made.reached]
    exact = directional_stiffness(given.model, np.asarray(made.q)[made.reached]) * 1e-3
    assert model == pytest.approx(exact, rel=1e-12)
