"""An arm with a solid link: condensed, as one assembly, as fields and in CalculiX."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import oracles
import pytest
from calculix_runs import run_ccx

from benchmarks.statics.calculix.arm import arm_deck
from fem import ArmModel, arm_fields, build_model, deflection
from fem.reference.shell_arm import solve_shell_arm
from meshes import save_solid
from robots import ModelDescription, load_description
from robots.schema.description import FlangeCoupling, Solid
from robots.schema.quantities import PositiveLength
from tests.fem.solid_bars import bar

WRENCH = np.array([100.0, 50.0, -650.0, 10.0, 20.0, 30.0])


@pytest.fixture(scope="module", params=["rigid", "distributing"])
def arm(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> ArmModel:
    """The xr701 with one flexible link, its pedestal of 0.4 m as a square bar."""
    given = load_description("xr701")
    pedestal = next(link for link in given.link if link.name == "pedestal")
    mesh = bar(0.4, 0.15, 3, 1)
    # From along x to along z, right-handed.
    mesh = replace(mesh, nodes=mesh.nodes[:, [1, 2, 0]])
    file = tmp_path_factory.mktemp("solid") / "bar.npz"
    solid = Solid(
        file=str(file),
        sha256=save_solid(mesh, file),
        size=PositiveLength(value=100.0, unit="mm", source="assumed"),
        source=next(iter(given.sources)),
    )
    only = given.model_copy(update={"link": (pedestal.model_copy(update={"solid": solid}),)})
    flanges: FlangeCoupling = request.param
    return build_model(ModelDescription.model_validate(only.model_dump(by_alias=True)), "solid", "serial", flanges)


def test_condensed_assembled_and_drawn_arms_agree(arm: ArmModel) -> None:
    q = np.full(arm.robot.dof, 0.2)
    expected = deflection(arm, q[None], WRENCH[None])[0]
    # Round-off of springs of 1e12 N m/rad beside the bar.
    np.testing.assert_allclose(solve_shell_arm(arm, q, WRENCH).displacement[0], expected, rtol=1e-6)
    fields = arm_fields(arm, q, WRENCH)
    np.testing.assert_allclose(fields.displacement, expected, rtol=1e-9)
    assert sum(fields.energy_by_part.values()) == pytest.approx(0.5 * WRENCH @ expected, rel=1e-9)
    assert fields.links[0].von_mises.max() > 0.0


@oracles.needs("ccx")
def test_calculix_gives_the_same(arm: ArmModel, tmp_path: Path) -> None:
    deck = arm_deck(arm, np.full(arm.robot.dof, 0.2), WRENCH)
    printed = run_ccx(deck.text, tmp_path).displacements
    found = np.concatenate([1e-3 * printed[deck.tool[0]], printed[deck.tool[1]]])
    # Seven digits are printed, coordinates are written with twelve.
    np.testing.assert_allclose(found, deck.displacement, rtol=1e-5)
