"""Scopes, runs and surrogates of a planar arm that is known in closed form, and quick trainings of real ones."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from fem import ArmModel, build_model
from robots import load_description
from robots.arrays import Array
from surrogate import factored, training
from surrogate.designs import Density, space_filling_design
from surrogate.error_bars import learn_bars
from surrogate.fit import Fit, fit
from surrogate.model import ErrorFigures, Surrogate
from surrogate.scope import Couplings, Scope

NAMES = ("q2_deg", "q3_deg", "q4_deg", "q5_deg")
LOWER = np.radians([-35.0, 40.0, -200.0, -100.0])
UPPER = np.radians([45.0, 115.0, 200.0, 100.0])
# Limit q2 - q3 to -110..0 deg; the box allows -150..5.
COUPLED = Couplings(("forearm",), np.array([[1.0, -1.0]]), np.radians([-110.0]), np.array([0.0]))
SPRINGS = (1.2e6, 9e5, 7e5, 2e5, 1.5e5, 8e4)


def planar_scope(k: int, couplings: Couplings | None = None, **changes: Any) -> Scope:
    made = Scope(
        robot="arm",
        model_hash="abc",
        load_direction=(0.0, 0.0, -1.0),
        inputs=NAMES[:k],
        fixed_deg={"q1_deg": 0.0},
        lower=LOWER[:k],
        upper=UPPER[:k],
        couplings=Couplings.none(k) if couplings is None else couplings,
    )
    return replace(made, **changes)


def poses(n: int, k: int, seed: int = 0, density: Density = "uniform", couplings: Couplings | None = None) -> Array:
    rng = np.random.default_rng(seed)
    return space_filling_design(LOWER[:k], UPPER[:k], n, rng, density=density, couplings=couplings)


def arm_compliance(Q: Array) -> Array:
    """m/N of a planar arm under a vertical load: sum of joint compliance times squared lever.

    The levers are sums of cosines of angle sums, of order 1 in each angle; their squares of order 2.
    """
    joint = 1.0 / np.array([1.4e6, 0.8e6, 1.2e6, 0.9e6])
    length = np.array([1.1, 1.2, 0.5, 0.4])
    k = Q.shape[1]
    x = length[:k] * np.cos(np.cumsum(Q, axis=1))
    lever = np.cumsum(x[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(2e-7 + lever**2 @ joint[:k])


def surrogate_from(scope: Scope, found: Fit, **more: Any) -> Surrogate:
    """A surrogate out of a fit, with made-up error figures."""
    own = {f.name: getattr(scope, f.name) for f in fields(Scope)}
    figures = ErrorFigures(
        found.basis.name, found.basis.degree, found.target, found.basis.n_terms, found.runs, 0, *(0.01,) * 5, 0.95, 2.0
    )
    return Surrogate(
        **own,
        basis=found.basis.name,
        degree=found.basis.degree,
        target=found.target,
        expansion=found.basis.expansion(found.coefficients),
        errors=figures,
        **more,
    )


def fitted(
    n: int = 150, k: int = 2, couplings: Couplings | None = None, *, bars: bool = False, **options: Any
) -> Surrogate:
    """A surrogate of the planar arm; ``options`` are those of `fit`."""
    scope = planar_scope(k, couplings)
    Q = poses(n, k, 1, "arcsine", couplings)
    found = fit(Q, arm_compliance(Q), scope, **options)
    plain = surrogate_from(scope, found)
    if not bars:
        return plain
    fresh = poses(1000, k, 2, "random", couplings)
    error = np.exp(plain.expansion(fresh)[:, 0]) if found.target == "logarithm" else plain.expansion(fresh)[:, 0]
    return replace(plain, bars=learn_bars(found.basis, scope, Q, fresh, error / arm_compliance(fresh) - 1.0))


def sprung(name: str, links: Any = "rigid", load_path: Any = None, **springs: Any) -> ArmModel:
    """A bundled robot with constant springs, or others by name of the joint."""
    model = build_model(load_description(name), links=links, load_path=load_path)
    return model.with_springs(dict(zip(model.robot.joint_names, SPRINGS, strict=True))).with_springs(springs)


@contextmanager
def few_runs(
    calibration: int = 600, uniform: int = 1000, boundary: int = 64, rows: int = 500, most: int = 600
) -> Iterator[None]:
    """Train on few runs: for tests of what is done with them, not of how good it is."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "CALIBRATION_RUNS", calibration)
        patch.setattr(training, "HELD_OUT_UNIFORM", uniform)
        patch.setattr(training, "HELD_OUT_BOUNDARY", boundary)
        patch.setattr(training, "_MATRICES", 100)
        patch.setattr(training, "TRAINING_RUNS", most)
        patch.setattr(factored, "_FEWEST_RUNS", rows)
        yield
