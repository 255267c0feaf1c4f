"""The workflow's steps as functions: what is written beside the numbers comes from the computation."""

from __future__ import annotations

import numpy as np
import pytest

from fem import directional_stiffness
from fem.arm import Arm
from stiffarm.commands.fit import learning
from stiffarm.commands.maps.learned import LearnedRequest
from stiffarm.session import inputs
from surrogate import Surrogate, inputs_that_matter, train


def learned(given: Arm, direction: tuple[float, float, float]) -> Surrogate:
    names = inputs_that_matter(given.model)
    options = {"basis": "polynomial", "degree": 2, "runs": 300}
    rng = np.random.default_rng(0)
    task = learning.learning_task(given.description, given.model, names, rng, direction=direction)
    return train(task, rng, **options).best  # type: ignore[arg-type]


def test_a_map_names_the_load_it_was_made_with() -> None:
    given = inputs.read_model("kr60-3", "rigid", None)
    found = learned(given, (0.6, 0.0, 0.8))
    asked = LearnedRequest(kind="joints", points=2, learned=found, direction=found.load_direction)
    engine = asked.engine(given)
    made = engine.computed(asked.metadata(given, engine))
    assert made.metadata["load_direction"] == "0.75 0 1"
    # The model's own stiffness beside it is that of the same load.
    model = np.asarray(made.fields["model_stiffness_N_per_mm"].values)[made.reached]
    q = np.asarray(made.q)[made.reached]
    exact = directional_stiffness(given.model, q, np.array([0.6, 0.0, 0.8])) * 1e-3
    assert model == pytest.approx(exact, rel=1e-12)
    assert not np.allclose(model, directional_stiffness(given.model, q) * 1e-3, rtol=0.01)
