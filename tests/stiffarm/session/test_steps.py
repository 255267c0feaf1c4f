"""The workflow's steps as functions: what is written beside the numbers comes from the computation."""

from __future__ import annotations

import numpy as np
import pytest

from fem import directional_stiffness
from stiffarm.commands.fit import learning
from stiffarm.session import inputs, steps
from surrogate import Surrogate, train


def learned(given: inputs.ModelInput, direction: tuple[float, float, float]) -> Surrogate:
    names = steps.default_inputs(given.model)
    options = {"basis": "polynomial", "degree": 2, "runs": 300}
    rng = np.random.default_rng(0)
    task = learning.learning_task(given.description, given.model, names, rng, direction=direction)
    return train(task, rng, **options).best  # type: ignore[arg-type]


def test_a_map_names_the_load_it_was_made_with() -> None:
    given = inputs.read_model("kr60-3", "rigid", None)
    assert steps.stiffness_map(given.description, given.model, 2, None).metadata["load_direction"] == "0 0 -1"
    sideways = learned(given, (0.6, 0.0, 0.8))
    made = steps.stiffness_map(given.description, given.model, 2, sideways)
    assert made.metadata["load_direction"] == "0.6 0 0.8"
    # The model's own stiffness beside it is that of the same load.
    name = "model_stiffness_N_per_mm"
    q = np.radians(np.stack([made.joints[coordinate] for coordinate in given.robot.coordinates], axis=1))
    exact = directional_stiffness(given.model, q, np.array([0.6, 0.0, 0.8])) * 1e-3
    assert made.scalars[name] == pytest.approx(exact, rel=1e-9)  # round-off of degrees and back
    assert not np.allclose(made.scalars[name], directional_stiffness(given.model, q) * 1e-3, rtol=0.01)
