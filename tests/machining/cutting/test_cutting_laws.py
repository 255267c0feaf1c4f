"""Springs over angles with a covariance: the surface error's spread against arms built with drawn laws."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from cutting_cases import SOFT, postures, wall_task

import fem
from fem.springs import LawSpring
from machining.cutting import ConstantForce, ToolBending, calibrated_uncertainty, surface_error
from machining.cutting.surface_error import cutting_deflection
from robots import ModelDescription, load_description
from robots.library.models import parse_description, to_toml
from robots.schema.description import Calibration, LogFourierLaw
from robots.schema.springs import BearingLaws
from robots.schema.uncertainty import CalibrationUncertainty

F = np.array([40.0, 60.0, -20.0])
# A standard deviation from n draws is known to 1/sqrt(2 n): 1.1 % here; four times that is allowed, and the second
# order of ln k with a standard deviation of 0.08, below 1 %.
DRAWS, WITHIN = 4000, 0.055
NAMES = ("j2.law[0]", "j2.law[1]", "j2.law[2]", "j3.rx.law[0]", "j3.rx.law[1]", "j3.rx.law[2]")
LAWS = ((13.7, 0.2, -0.1), (14.2, -0.3, 0.1))


def described() -> tuple[ModelDescription, np.ndarray]:
    """KR60-3 with a law about joint 2 and one across joint 3, and the covariance of their coefficients."""
    given = load_description("kr60-3")
    axial, across = (
        LogFourierLaw(kind="log-fourier", input=name, coefficients=c, source="assumed")
        for name, c in zip(("q2_deg", "q3_deg"), LAWS, strict=True)
    )
    joints = tuple(
        j.model_copy(update={"stiffness": axial if j.name == "j2" else None})
        if j.name != "j3"
        else j.model_copy(update={"bearing_laws": BearingLaws(rx=across), "stiffness": None})
        for j in given.joint
    )
    rng = np.random.default_rng(0)
    root = 0.04 * rng.normal(size=(6, 6))
    V = root @ root.T / 2.0
    table = CalibrationUncertainty(
        parameters=NAMES,
        unit=("ln(N m/rad)",) * 6,
        variable=("value",) * 6,
        estimate=(*LAWS[0], *LAWS[1]),
        covariance=tuple(map(tuple, V.tolist())),
        degrees_of_freedom=(1e6,) * 6,
        status=("determined",) * 6,
        note="made up",
    )
    origin = Calibration(
        scheme="made up",
        load_path=given.load_path,
        links="rigid",
        data="made up",
        data_sha256="0" * 64,
        rms_mm=0.01,
        loads_N=(),
        uncertainty=table,
    )
    made = given.model_copy(update={"joint": joints, "calibration": origin})
    return parse_description(to_toml(made), "model.toml"), V


def test_laws_about_and_across_the_axes_are_carried_to_the_error(rng: np.random.Generator) -> None:
    description, V = described()
    model = fem.build_model(description, "rigid")
    arm = calibrated_uncertainty(model, description)
    assert arm is not None
    task = wall_task(4)
    q = postures(model, task, SOFT)
    error = surface_error(model, task, q, ConstantForce(F, relative_sd=0.0), stiffness=arm)
    drawn = rng.multivariate_normal([*LAWS[0], *LAWS[1]], V, DRAWS)
    # Deflection is a sum over springs: each law's share of the joint, scaled by its drawn compliance.
    parts, own = [], []
    for number, (name, coefficients) in enumerate(zip(("j2", "j3"), LAWS, strict=True)):
        bare = model.with_rigid_joints()
        one = next(j for j in model.joints if j.name == name)
        alone = replace(bare, joints=tuple(one if j.name == name else j for j in bare.joints))
        spring = one.axial if name == "j2" else one.laws[0][1]
        assert isinstance(spring, LawSpring)
        ratio = np.exp(-(drawn[:, 3 * number : 3 * number + 3] - coefficients) @ spring.basis(q).T)
        own.append(fem.deflection(alone, q, np.r_[F, 0, 0, 0], task.tip)[:, 1])
        parts.append(ratio * own[-1])
    np.testing.assert_allclose(error.normal, own[0] + own[1], rtol=1e-9)
    np.testing.assert_allclose(error.sd, (parts[0] + parts[1]).std(axis=0), rtol=WITHIN)
    assert not error.is_rough


@pytest.mark.parametrize("relative", [1.0, 4.0])
def test_the_spread_is_that_of_the_covariance(relative: float) -> None:
    description, _ = described()
    origin = description.calibration
    assert origin is not None
    assert origin.uncertainty is not None
    V = relative * np.array(origin.uncertainty.covariance)
    table = origin.uncertainty.model_copy(update={"covariance": tuple(map(tuple, V.tolist()))})
    wider = description.model_copy(update={"calibration": origin.model_copy(update={"uncertainty": table})})
    model = fem.build_model(description, "rigid")
    sd = []
    for one in (description, wider):
        arm = calibrated_uncertainty(model, one)
        assert arm is not None
        task = wall_task(3)
        q = postures(model, task, SOFT)
        sd.append(surface_error(model, task, q, ConstantForce(F, relative_sd=0.0), stiffness=arm).sd)
    np.testing.assert_allclose(sd[1], np.sqrt(relative) * sd[0], rtol=1e-9)


def test_points_in_memory_at_once_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    description, _ = described()
    model = fem.build_model(description, "rigid")
    arm = calibrated_uncertainty(model, description)
    task = wall_task(7)
    q = postures(model, task, SOFT)
    tool = ToolBending(0.04, 0.008, 6e11)
    whole = surface_error(model, task, q, ConstantForce(F), stiffness=arm, tool=tool)
    # The package has a function of the module's name.
    monkeypatch.setattr(import_module("machining.cutting.surface_error"), "AT_ONCE", 3)
    in_parts = surface_error(model, task, q, ConstantForce(F), stiffness=arm, tool=tool)
    # Sums in another order: round-off.
    np.testing.assert_allclose(in_parts.form, whole.form, rtol=1e-9, atol=1e-12 * np.abs(whole.form).max())
    np.testing.assert_allclose(in_parts.sd, whole.sd, rtol=1e-9)
    moved = cutting_deflection(model, task, q, whole.force, tool)
    np.testing.assert_array_equal(moved, whole.deflection)
