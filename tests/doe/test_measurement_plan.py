"""Plans: predicted uncertainty is what simulated readings then have, and beats random poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from doe import Measurements, bundled_data, read_measurements, select_loads
from doe.estimate import estimate
from doe.measurement_plan import Protocol, experiments, plan
from doe.outset import design_point, known_information, outset
from doe.pose_designs import pose_design
from doe.problem import problem
from doe.uncertainty import certainty
from fem import ArmModel, build_model, deflection
from fem.parameters import parameter
from robots import InputError, load_description

GAUGE = (1e-5, 1e-5)
DOWN = np.array([[0.0, 0.0, -1.0]])


@pytest.fixture(scope="module")
def model() -> ArmModel:
    return build_model(load_description("xr701"))


@pytest.fixture(scope="module")
def nine(model: ArmModel) -> Measurements:
    return select_loads(read_measurements(bundled_data("xr701"), model.robot), (650.0,))


def _added(data: Measurements, q: np.ndarray, wrench: np.ndarray, value: np.ndarray) -> Measurements:
    n = len(q)
    unknown = np.full(n, np.nan)
    return replace(
        data,
        q=np.vstack([data.q, q]),
        wrench=np.vstack([data.wrench, wrench]),
        displacement=np.vstack([data.displacement, value]),
        point=np.vstack([data.point, np.full((n, 3), np.nan)]),
        sigma=np.concatenate([data.sigma, unknown]),
        step=np.concatenate([data.step, unknown]),
        pose=(*data.pose, *(f"new {k}" for k in range(n))),
        repeat=(*data.repeat, *[None] * n),
        phase=(*data.phase, *[None] * n),
        row_numbers=(*data.row_numbers, *range(1000, 1000 + n)),
        extra={},
    )


def test_simulated_readings_shrink_the_intervals_as_predicted(model: ArmModel, nine: Measurements) -> None:
    springs = [parameter(model, f"j{k}.stiffness") for k in (2, 3, 4, 5)]
    e = estimate(problem(model, nine, springs), GAUGE)
    c = certainty(e)
    poses = pose_design(model.robot, 400, rng=np.random.default_rng(0))
    made = plan(outset(e, c), poses, 6, Protocol(np.array([650.0]), DOWN), rng=np.random.default_rng(0), starts=1)
    assert made.value < made.random_median
    u = design_point(e, c)
    truth = model.with_springs({p.place: p.outer(float(v)) for p, v in zip(springs, u, strict=True)})
    rng = np.random.default_rng(1)
    wrench = np.tile([0.0, 0.0, -650.0, 0.0, 0.0, 0.0], (6, 1))
    read = deflection(truth, made.q, wrench) + rng.normal(size=(6, 6)) * e.noise.white[0]
    read[:, [0, 1, 3, 4, 5]] = np.nan
    after = estimate(
        problem(model, _added(nine, made.q, wrench, read), springs), GAUGE, fixed_noise=e.noise, robust=False
    )
    sure = certainty(after, profiles=False)
    sd = np.sqrt(np.diag(sure.covariance)) / after.u
    # j2 and j3 are determined before and after, so their logarithm's standard deviation is comparable; the estimates
    # moved by some 10 % with the new noise, and with them the relative standard deviations.
    for k in (0, 1):
        assert sd[k] == pytest.approx(made.foresight[k].after, rel=0.25)
    assert made.foresight[2].shrink > 3.0  # joint 4 was open


def test_information_of_single_readings_adds_up(model: ArmModel, nine: Measurements) -> None:
    springs = [parameter(model, f"j{k}.stiffness") for k in (2, 3)]
    e = estimate(problem(model, nine, springs), GAUGE)
    one = Protocol(np.array([650.0]), DOWN)
    B = experiments(replace(outset(e, certainty(e)), u=e.u), nine.q, one)
    # The readings made already, made once more, double the information but for the vague prior.
    known = known_information(e, e.u)
    total = np.einsum("jrp,jrq->pq", B, B)
    np.testing.assert_allclose(known - total, np.diag(np.diag(known - total)), atol=1e-6 * np.abs(known).max())
    assert np.all(np.diag(known - total) < 0.1)


def test_the_i_criterion_predicts_better_than_the_d_criterion(model: ArmModel, nine: Measurements) -> None:
    springs = [parameter(model, f"j{k}.stiffness") for k in (2, 3, 4, 5)]
    e = estimate(problem(model, nine, springs), GAUGE)
    c = certainty(e)
    poses = pose_design(model.robot, 200, rng=np.random.default_rng(0))
    protocol = Protocol(np.array([300.0, 650.0]), DOWN, repeats=3)
    rng = np.random.default_rng(0)
    by_i = plan(outset(e, c), poses, 3, protocol, "I", rng=rng, starts=1)
    by_a = plan(outset(e, c), poses, 3, protocol, "A", rng=rng, starts=1)
    assert by_i.value <= by_i.random_median
    assert by_a.value <= by_a.random_median
    assert by_i.q.shape == by_a.q.shape == (3, 6)


def test_bad_protocols() -> None:
    for bad in (
        {"forces": np.array([]), "directions": DOWN},
        {"forces": np.array([-1.0]), "directions": DOWN},
        {"forces": np.array([1.0]), "directions": 2.0 * DOWN},
        {"forces": np.array([1.0]), "directions": DOWN, "components": (7,)},
        {"forces": np.array([1.0]), "directions": DOWN, "repeats": 0},
    ):
        with pytest.raises(InputError):
            Protocol(**bad)  # type: ignore[arg-type]
