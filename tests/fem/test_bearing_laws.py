"""Stiffness across a joint's axis that varies with the joint's angle: as a constant at every single angle."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refuses

import fem
from fem.effects import build_arm, reading_effects
from fem.free.parameters import parameter
from fem.model import build_model
from fem.springs import WIDEST_LOG, FourierBasis, LawSpring
from robots import load_description
from robots.schema.description import ModelDescription
from robots.schema.effects import EffectTable


def described() -> ModelDescription:
    """kr60-3 whose joint 2 has laws about x and along y."""
    plain = load_description("kr60-3").model_dump(by_alias=True)
    law = {"kind": "log-fourier", "input": "q2_deg", "source": "assumed"}
    plain["joint"][1]["bearing_laws"] = {
        "rx": law | {"coefficients": (14.5, 0.3, -0.2)},
        "ty": law | {"coefficients": (17.0, -0.1, 0.25)},
    }
    return ModelDescription.model_validate(plain)


@pytest.fixture(scope="module")
def model() -> fem.ArmModel:
    return fem.build_model(described(), links="rigid")


def constant_at(q2: float) -> fem.ArmModel:
    """The same arm with the laws' values at an angle of joint 2 (rad) as constants."""
    plain = load_description("kr60-3").model_dump(by_alias=True)
    values = {
        name: float(np.exp(a + b * np.cos(q2) + c * np.sin(q2)))
        for name, (a, b, c) in {"rx": (14.5, 0.3, -0.2), "ty": (17.0, -0.1, 0.25)}.items()
    }
    units = {"rx": "N m/rad", "ty": "N/m"}
    plain["joint"][1]["bearing"] = {n: {"value": v, "unit": units[n], "source": "assumed"} for n, v in values.items()}
    return fem.build_model(ModelDescription.model_validate(plain), links="rigid")


def test_at_each_angle_it_is_the_constant_of_that_angle(model: fem.ArmModel, rng: np.random.Generator) -> None:
    low, high = model.robot.limits.T
    q = rng.uniform(low, high, (6, 6))
    for row in q:
        one = fem.compliance(constant_at(row[1]), row[None])
        # Round-off of sums of a handful of terms.
        np.testing.assert_allclose(fem.compliance(model, row[None]), one, rtol=1e-12, atol=1e-18)
    plain = fem.compliance(fem.build_model(load_description("kr60-3"), links="rigid"), q)
    assert np.abs(fem.compliance(model, q) / plain - 1.0).max() > 1e-3


def test_rigid_joints_have_no_laws(model: fem.ArmModel) -> None:
    assert not fem.compliance(model.with_rigid_joints(), np.zeros((1, 6))).any()


def test_a_direction_with_a_law_is_no_free_constant(model: fem.ArmModel) -> None:
    refuses("M001", "law over the joint's angle", parameter, model, "j2.rx")
    assert parameter(model, "j2.ry").place == "j2"


def test_the_file_is_checked(model: fem.ArmModel) -> None:
    bad = described().model_dump(by_alias=True)
    bad["joint"][1]["bearing_laws"]["rx"]["input"] = "q9_deg"
    with pytest.raises(ValueError, match="q9_deg"):
        ModelDescription.model_validate(bad)


# ------------------------------------------------------------
# Figures that a model file may hold one by one, and that no arm can have together: bad input, no figure


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("coefficient", [1.01 * WIDEST_LOG, -1.01 * WIDEST_LOG, 1e30, -1e30])
def test_a_law_that_runs_away_gives_no_stiffness(coefficient: float) -> None:
    q = np.zeros((2, 3))
    refuses(
        "M002", "stiffness of a joint by its law", LawSpring(FourierBasis(1, 0), np.array([coefficient])).compliance, q
    )
    assert LawSpring(FourierBasis(1, 0), np.array([14.0])).compliance(q) == pytest.approx(np.exp(-14.0), rel=1e-15)


def test_a_link_that_cannot_be_solved_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def singular(*_: object) -> None:
        raise ArithmeticError("the stiffness matrix is singular")

    monkeypatch.setattr("fem.model.condense", singular)
    monkeypatch.setattr("fem.model._beam_parts", {})
    refuses(
        "M004",
        r"link pedestal: the stiffness matrix is singular.*far too small",
        build_model,
        load_description("xr701"),
        "beam",
    )


@pytest.mark.parametrize(
    ("code", "name", "value", "unit"),
    [
        ("softening:j2", "torque", 1e-300, "N m"),
        ("softening:j2", "power", 900.0, "1"),
        ("backlash:j2", "crossing", 1e-9, "N m"),
    ],
)
def test_numbers_of_a_law_far_from_plausible_are_refused(code: str, name: str, value: float, unit: str) -> None:
    plausible = {
        "softening:j2": {"share": (0.3, "1"), "torque": (500.0, "N m"), "power": (1.0, "1")},
        "backlash:j2": {"gap": (0.5, "mrad"), "crossing": (10.0, "N m")},
    }[code]

    def effects_with(numbers: dict[str, tuple[float, str]]) -> int:
        rows = {key: {"value": v, "unit": u, "source": "assumed"} for key, (v, u) in numbers.items()}
        table = EffectTable.model_validate({"code": code, "parameters": rows})
        description = load_description("xr701").model_copy(update={"effect": (table,)})
        return len(reading_effects(description, build_arm(description, "rigid")))

    assert effects_with(plausible) == 1
    refuses("M011", f"{name}.*not far from what is plausible", effects_with, plausible | {name: (value, unit)})
