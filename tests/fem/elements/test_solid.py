"""Ten-noded tetrahedra, and bars of them condensed by the code of the shells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refuses

from fem.elements.link_cache import superelement_key
from fem.elements.shell import shell_superelement
from fem.elements.solid import assemble_solid, solid_energy, solid_stress, solid_volume, von_mises_solid
from meshes.solid_mesh import SolidMesh
from tests.fem.solid_bars import bar

LENGTH, SIDE = 0.5, 0.05
POINTS = np.array([[0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0]])
# Sums over some hundred elements.
ROUND_OFF = 1e-11


@pytest.fixture(scope="module")
def coarse() -> SolidMesh:
    return bar(LENGTH, SIDE, 6, 1)


def distorted(mesh: SolidMesh) -> SolidMesh:
    """Inner nodes of the bar's length moved, so that elements differ; edges bent a little."""
    rng = np.random.default_rng(3)
    return replace(mesh, nodes=mesh.nodes + 0.03 * SIDE * rng.uniform(-1.0, 1.0, mesh.nodes.shape))


def test_even_strain_gives_even_stress_and_its_energy(coarse: SolidMesh, rng: np.random.Generator) -> None:
    """The patch test; even with bent edges, whose elements hold all linear fields."""
    mesh = distorted(coarse)
    gradient = rng.uniform(-1e-4, 1e-4, (3, 3))
    u = mesh.nodes @ gradient.T
    strain = 0.5 * (gradient + gradient.T)
    shear = mesh.youngs_modulus / (2.0 * (1.0 + mesh.poissons_ratio))
    lame = 2.0 * shear * mesh.poissons_ratio / (1.0 - 2.0 * mesh.poissons_ratio)
    stress = 2.0 * shear * strain + lame * np.trace(strain) * np.eye(3)
    np.testing.assert_allclose(solid_stress(mesh, u), np.broadcast_to(stress, (len(mesh.tetrahedra), 3, 3)), rtol=1e-9)
    density = 0.5 * (stress * strain).sum()
    np.testing.assert_allclose(solid_energy(mesh, u), density * solid_volume(mesh)[0], rtol=1e-9)
    assert solid_energy(mesh, u).sum() == pytest.approx(0.5 * u.ravel() @ assemble_solid(mesh) @ u.ravel(), rel=1e-9)


def test_six_motions_cost_nothing(coarse: SolidMesh) -> None:
    values = np.linalg.eigvalsh(assemble_solid(distorted(coarse)).toarray())
    assert (np.abs(values[:6]) < ROUND_OFF * values[-1]).all()
    assert values[6] > 1e-6 * values[-1]


def test_a_pulled_bar_lengthens_by_its_section(coarse: SolidMesh) -> None:
    """Without Poisson's ratio held ends hinder nothing, so both couplings agree with F L / (E A)."""
    mesh = replace(coarse, poissons_ratio=0.0)
    exact = LENGTH / (mesh.youngs_modulus * SIDE**2)
    for coupling in ("rigid", "distributing"):
        assert shell_superelement(mesh, POINTS, coupling).flexibility[0, 0] == pytest.approx(exact, rel=1e-8)


def test_a_bent_bar_is_timoshenkos() -> None:
    """Six quadratic elements along a slender bar come within half a percent."""
    mesh = bar(LENGTH, SIDE, 6, 2, 0.0)
    E, inertia, area = mesh.youngs_modulus, SIDE**4 / 12.0, SIDE**2
    bent = LENGTH**3 / (3.0 * E * inertia) + LENGTH / (5.0 / 6.0 * E / 2.0 * area)
    F = shell_superelement(mesh, POINTS).flexibility
    assert F[1, 1] == pytest.approx(bent, rel=5e-3)
    assert F[5, 5] == pytest.approx(LENGTH / (E * inertia), rel=5e-3)


def test_free_flanges_are_softer(coarse: SolidMesh) -> None:
    rigid, free = (shell_superelement(coarse, POINTS, kind).flexibility for kind in ("rigid", "distributing"))
    assert np.linalg.eigvalsh(free - rigid).min() > -ROUND_OFF * np.abs(free).max()
    assert (np.diag(free) > np.diag(rigid)).all()


def test_von_mises_of_a_pulled_bar_is_its_stress() -> None:
    assert von_mises_solid(np.diag([5.0, 0.0, 0.0])) == pytest.approx(5.0)
    assert von_mises_solid(7.0 * np.eye(3)) == pytest.approx(0.0, abs=1e-14)


def test_elements_inside_out_are_refused(coarse: SolidMesh) -> None:
    turned = replace(coarse, tetrahedra=coarse.tetrahedra[:, [1, 0, 2, 3, 4, 6, 5, 8, 7, 9]])
    refuses("L007", "inside out", assemble_solid, turned)


def test_the_cache_tells_solids_apart(coarse: SolidMesh) -> None:
    kinds = {"root": "rigid", "tip": "rigid"}
    moved = replace(coarse, nodes=coarse.nodes * [1.0, 1.0, 1.001])
    assert superelement_key(coarse, POINTS, kinds) != superelement_key(moved, POINTS, kinds)  # type: ignore[arg-type]
