"""Links whose walls were assumed: free within what is known of them, and counted in where springs are found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from doe import Measurements
from doe.certainty.uncertainty import certainty
from doe.diagnosis.setting import setting_of
from doe.estimation.assumed_walls import WALL_SD, assumed_walls, remarks, with_assumed_walls
from doe.estimation.campaign import campaign_of
from doe.estimation.estimate import Estimate, estimate
from doe.estimation.problem import problem
from fem import ArmModel
from fem.free.parameters import parameter
from robots import ModelDescription, Robot, load_description
from robots.schema.links import Surface

Readings = Callable[..., Measurements]
LINK = "forearm"
SPRINGS = ("j1.stiffness", "j2.stiffness", "j3.stiffness")


def imported(source: str) -> ModelDescription:
    """The xr701 as if its forearm had come from a surface whose wall has that source."""
    given = load_description("xr701")
    wall = {"value": 6.0, "unit": "mm", "source": source}
    size = {"value": 20.0, "unit": "mm", "source": "derived"}
    surface = Surface.model_validate({"file": "no.npz", "sha256": "0" * 64, "wall": wall, "size": size, "source": "a"})
    links = tuple(one.model_copy(update={"surface": surface}) if one.name == LINK else one for one in given.link)
    return given.model_copy(update={"link": links})


@pytest.fixture
def model(arm: Callable[..., ArmModel]) -> ArmModel:
    return arm(load_path="serial").with_springs({"j1": 9e5, "j2": 8e5, "j3": 6e5})


@pytest.fixture
def soft(model: ArmModel, readings: Readings, random_poses: Callable[..., np.ndarray]) -> Measurements:
    """Readings of the arm with a forearm half as stiff again: a wall of 4 mm where 6 are assumed."""
    modulus = parameter(model, f"{LINK}.modulus")
    softer = modulus.kind.changed(modulus, 1.5 / modulus.value, model, {})
    rng = np.random.default_rng(5)
    q = random_poses(model.robot, 12, rng)
    wrench = np.array([200.0, 300.0, -650.0, 0.0, 0.0, 0.0])
    return readings(softer, {}, q, wrench, "xyz", noise_m=1e-6 * rng.normal(size=(12, 6)))


def found(model: ArmModel, data: Measurements, description: ModelDescription) -> Estimate:
    campaign = with_assumed_walls(campaign_of("xr701", SPRINGS), description, model)
    parameters, laws = campaign.free(model)
    return estimate(problem(model, data, parameters, laws), (1e-6, 1e-6), robust=False)


def test_only_walls_that_nobody_gave_are_free(model: ArmModel) -> None:
    assert assumed_walls(imported("assumed"), model) == (LINK,)
    assert assumed_walls(imported("definition"), model) == ()
    assert assumed_walls(load_description("xr701"), model) == ()
    rigid = replace(model, links=())
    assert assumed_walls(imported("assumed"), rigid) == ()


def test_what_is_free_already_or_in_stages_stays_as_it_is(model: ArmModel) -> None:
    own = campaign_of("xr701", (*SPRINGS, f"{LINK}.modulus"))
    assert with_assumed_walls(own, imported("assumed"), model) == own
    (*_, added) = with_assumed_walls(campaign_of("xr701", SPRINGS), imported("assumed"), model).parameter
    assert added.name == f"{LINK}.modulus"
    assert added.prior is not None
    assert added.prior.factor == pytest.approx(np.exp(WALL_SD))


def test_springs_intervals_count_the_walls_in(model: ArmModel, soft: Measurements) -> None:
    """The truth of j2 and j3 lies in the intervals where the wall is free, and not where it is taken for exact."""
    inside = {}
    for source in ("assumed", "definition"):
        sure = certainty(found(model, soft, imported(source)))
        springs = {e.parameter.name: e for e in sure.estimates if e.parameter.name in SPRINGS[1:]}
        truth = {"j2.stiffness": 8e5, "j3.stiffness": 6e5}
        inside[source] = [springs[n].interval[0] <= v <= springs[n].interval[1] for n, v in truth.items()]
    assert all(inside["assumed"])
    assert not all(inside["definition"])


def test_a_diagnosis_takes_it_for_a_small_error_of_every_arm(model: ArmModel, soft: Measurements) -> None:
    given = [setting_of(imported(source), model, soft).errors for source in ("assumed", "definition")]
    assert given[0].shape[1] == given[1].shape[1] + 1


def test_what_a_tilt_spring_can_stand_in_for_is_said(model: ArmModel, xr701: Robot) -> None:
    description = imported("assumed")
    body = next(link.body for link in description.link if link.name == LINK)
    plain = with_assumed_walls(campaign_of("xr701", SPRINGS), description, model)
    tilted = with_assumed_walls(campaign_of("xr701", (*SPRINGS, f"{body}.rx")), description, model)
    assert len(remarks(plain, description, model)) == 1
    assert len(remarks(tilted, description, model)) == 2
    assert remarks(campaign_of("xr701", SPRINGS), description, model) == ()
