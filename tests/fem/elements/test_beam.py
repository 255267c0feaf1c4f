"""Beam elements against closed forms, quadrature, and an independent weak form in scikit-fem."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from skfem import Basis, BilinearForm, ElementLineP1, ElementVector, MeshLine, condense, solve

from fem.elements import beam
from meshes import BeamMesh, link_beam_mesh, section_properties
from robots import load_description
from robots.arrays import Array
from robots.robot import robot_from

E, NU, LENGTH = 210e9, 0.3, 1.2
G = E / (2.0 * (1.0 + NU))
BOX = np.array([0.12, 0.20, 0.008])
TAPERED = np.array([0.08, 0.10, 0.006])

# Closed forms of well-conditioned quantities: what remains is round-off, amplified a few times by the
# inverse of the 6x6 flexibility.
ROUND_OFF = 1e-11


def _mesh(
    elements: int = 1,
    end: Array = BOX,
    *,
    tip: Array | None = None,
    up: Array | None = None,
) -> BeamMesh:
    tip = np.array([LENGTH, 0.0, 0.0]) if tip is None else tip
    t = np.linspace(0.0, 1.0, elements + 1)[:, None]
    sections = BOX + t * (end - BOX)
    return BeamMesh(
        name="beam",
        nodes=t * tip,
        elements=np.stack([np.arange(elements), np.arange(1, elements + 1)], axis=1),
        kind="box",
        dimensions=np.stack([sections[:-1], sections[1:]], axis=1),
        up=np.array([0.0, 0.0, 1.0]) if up is None else up,
        youngs_modulus=E,
        poissons_ratio=NU,
        interfaces={"root": 0, "tip": elements},
    )


def _tip_displacement(mesh: BeamMesh, wrench: Array) -> Array:
    K = beam.assemble(mesh).toarray()
    load = np.zeros(len(K))
    load[-6:] = wrench
    return np.linalg.solve(K[6:, 6:], load[6:])[-6:]


@pytest.mark.parametrize("elements", [1, 3])
def test_cantilever_closed_forms(elements: int) -> None:
    p = section_properties("box", BOX, NU)
    mesh = _mesh(elements)
    L, F, M = LENGTH, 1000.0, 500.0

    d = _tip_displacement(mesh, np.array([0, 0, F, 0, 0, 0]))
    w = F * L**3 / (3 * E * p.iyy) + F * L / (G * p.shear_z)
    slope = -F * L**2 / (2 * E * p.iyy)
    np.testing.assert_allclose(d, [0, 0, w, 0, slope, 0], rtol=ROUND_OFF, atol=ROUND_OFF * w)

    d = _tip_displacement(mesh, np.array([0, F, 0, 0, 0, 0]))
    v = F * L**3 / (3 * E * p.izz) + F * L / (G * p.shear_y)
    slope = F * L**2 / (2 * E * p.izz)
    np.testing.assert_allclose(d, [0, v, 0, 0, 0, slope], rtol=ROUND_OFF, atol=ROUND_OFF * v)

    d = _tip_displacement(mesh, np.array([0, 0, 0, 0, M, 0]))
    expected = np.array([0, 0, -M * L**2 / (2 * E * p.iyy), 0, M * L / (E * p.iyy), 0])
    np.testing.assert_allclose(d, expected, rtol=ROUND_OFF, atol=ROUND_OFF * expected[4])

    d = _tip_displacement(mesh, np.array([F, 0, 0, M, 0, 0]))
    expected = np.array([F * L / (E * p.area), 0, 0, M * L / (G * p.torsion), 0, 0])
    np.testing.assert_allclose(d, expected, rtol=ROUND_OFF, atol=ROUND_OFF * expected[0])


def _przemieniecki() -> Array:
    """Stiffness of a prismatic beam with shear (Przemieniecki 1968, eq. 5.116), written out."""
    p = section_properties("box", BOX, NU)
    L = LENGTH
    phi_y = 12 * E * p.izz / (G * p.shear_y * L**2)
    phi_z = 12 * E * p.iyy / (G * p.shear_z * L**2)
    K = np.zeros((12, 12))
    K[0, 0] = K[6, 6] = E * p.area / L
    K[0, 6] = -E * p.area / L
    K[3, 3] = K[9, 9] = G * p.torsion / L
    K[3, 9] = -G * p.torsion / L
    # Bending in the x-y plane about z (sign +1) and in the x-z plane about y (sign -1).
    for u, r, second, phi, sign in ((1, 5, p.izz, phi_y, 1.0), (2, 4, p.iyy, phi_z, -1.0)):
        k = E * second / (L**3 * (1 + phi))
        K[u, u] = K[u + 6, u + 6] = 12 * k
        K[u, u + 6] = -12 * k
        K[u, r] = K[u, r + 6] = sign * 6 * L * k
        K[r, u + 6] = K[u + 6, r + 6] = -sign * 6 * L * k
        K[r, r] = K[r + 6, r + 6] = (4 + phi) * L**2 * k
        K[r, r + 6] = (2 - phi) * L**2 * k
    return np.triu(K) + np.triu(K, 1).T


def test_prismatic_element_is_przemienieckis() -> None:
    expected = _przemieniecki()
    K = beam.element_stiffness(_mesh())[0]
    np.testing.assert_allclose(K, expected, rtol=ROUND_OFF, atol=ROUND_OFF * expected.max())


def _rigid_modes(points: Array) -> Array:
    """Displacements (6k, 6) of points moved as one rigid body."""
    blocks = []
    for x, y, z in points:
        turn = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
        blocks.append(np.block([[np.eye(3), turn], [np.zeros((3, 3)), np.eye(3)]]))
    return np.vstack(blocks)


@pytest.mark.parametrize("tip", [np.array([1.2, 0, 0]), np.array([0.5, -0.9, 0.7]), np.array([0, 0, -0.4])])
def test_six_zero_energy_modes_and_they_are_the_rigid_ones(tip: Array) -> None:
    mesh = _mesh(3, TAPERED, tip=tip, up=np.array([1.0, 0.2, 0.1]))
    K = beam.assemble(mesh).toarray()
    np.testing.assert_array_equal(K, K.T)
    eigenvalues = np.linalg.eigvalsh(K)
    # Zero modes are round-off of the largest eigenvalue; the softest true one is far above that.
    assert np.abs(eigenvalues[:6]).max() < 1e-12 * eigenvalues[-1]
    assert eigenvalues[6] > 1e-8 * eigenvalues[-1]
    force = K @ _rigid_modes(mesh.nodes)
    assert np.abs(force).max() < 1e-12 * eigenvalues[-1]


def test_an_oblique_element_is_the_turned_element() -> None:
    rng = np.random.default_rng(3)
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    R *= np.linalg.det(R)
    turned = _mesh(2, TAPERED, tip=R @ [LENGTH, 0, 0], up=R @ [0, 0, 1])
    T = np.kron(np.eye(6), R)
    expected = T @ beam.assemble(_mesh(2, TAPERED)).toarray() @ T.T
    K = beam.assemble(turned).toarray()
    np.testing.assert_allclose(K, expected, atol=ROUND_OFF * expected.max())


def test_axes_follow_the_direction_of_the_height() -> None:
    _, R = beam.element_axes(_mesh(1, tip=np.array([0, 0, 2.0]), up=np.array([1.0, 0, 0])))
    # x along the beam (base z), z the height (base x), y = z cross x: exact numbers, no rounding.
    np.testing.assert_array_equal(R[0], np.array([[0, 0, 1.0], [0, -1.0, 0], [1.0, 0, 0]]))


def test_a_height_along_the_beam_still_gives_right_handed_axes() -> None:
    _, R = beam.element_axes(_mesh(1, tip=np.array([0, 0, 2.0]), up=np.array([0, 0, 1.0])))
    np.testing.assert_allclose(R[0].T @ R[0], np.eye(3), atol=1e-15)
    assert np.linalg.det(R[0]) == pytest.approx(1.0, rel=1e-14)
    np.testing.assert_array_equal(R[0][:, 0], [0, 0, 1.0])


def _tapered_by_quad() -> tuple[float, float, float]:
    """Tip deflection under a unit force, its slope, and torsion under a unit moment, by scipy."""

    def at(x: float) -> tuple[float, float, float]:
        p = section_properties("box", BOX + x / LENGTH * (TAPERED - BOX), NU)
        return float(E * p.iyy), float(G * p.shear_z), float(G * p.torsion)

    def integral(f: object) -> float:
        return float(quad(f, 0.0, LENGTH, epsabs=0.0, epsrel=1e-13)[0])  # type: ignore[arg-type]

    bending = integral(lambda x: (LENGTH - x) ** 2 / at(x)[0]) + integral(lambda x: 1.0 / at(x)[1])
    return bending, -integral(lambda x: (LENGTH - x) / at(x)[0]), integral(lambda x: 1.0 / at(x)[2])


def test_tapered_beam_agrees_with_adaptive_quadrature() -> None:
    bending, slope, torsion = _tapered_by_quad()
    error = []
    for elements in (1, 2, 4):
        mesh = _mesh(elements, TAPERED)
        force = _tip_displacement(mesh, np.array([0, 0, 1.0, 0, 0, 0]))
        moment = _tip_displacement(mesh, np.array([0, 0, 0, 1.0, 0, 0]))
        error.append(max(abs(force[2] / bending - 1), abs(force[4] / slope - 1), abs(moment[3] / torsion - 1)))
    # Five Gauss points integrate the smooth 1/EI with an error of order h^10 in the end: each halving
    # gains a factor towards 1024 (some 250 here). This taper, to a fifth of EI, is steeper than any
    # bundled link's.
    assert error[0] < 1e-4
    assert error[1] < error[0] / 100.0
    assert error[2] < error[1] / 100.0


@pytest.mark.parametrize("robot", ["xr701", "kr60-3", "tx200"])
def test_bundled_links_do_not_change_under_refinement(robot: str) -> None:
    model = load_description(robot)
    for link in model.link:
        tips = []
        for per_segment in (4, 16):
            mesh = link_beam_mesh(model, robot_from(model), link, per_segment)
            K = beam.assemble(mesh).toarray()
            rows = slice(6 * mesh.interfaces["tip"] - 6, 6 * mesh.interfaces["tip"])
            tips.append(np.linalg.inv(K[6:, 6:])[rows, rows])
        # Quadrature error of 1/EI at the default mesh (the gentle tapers leave 3e-13), and round-off of the
        # fine mesh's solve (condition number up to 1e5 after scaling, times eps = 2e-16).
        np.testing.assert_allclose(tips[0], tips[1], rtol=0, atol=2e-11 * np.abs(tips[1]).max())


def _timoshenko_weak_form(elements: int, end: Array) -> float:
    """Tip deflection under a unit force: P1 deflection and rotation, shear integrated at one point.

    Nothing of the element under test enters: other unknowns, other integrals, linear interpolation.
    """
    basis = Basis(MeshLine(np.linspace(0.0, LENGTH, elements + 1)), ElementVector(ElementLineP1(), 2), intorder=1)

    @BilinearForm
    def energy(u, v, w):  # type: ignore[no-untyped-def]
        x = w.x[0]
        sizes = np.moveaxis(BOX[:, None, None] + x / LENGTH * (end - BOX)[:, None, None], 0, -1)
        p = section_properties("box", sizes, NU)
        slope_u, slope_v = u.grad[:, 0], v.grad[:, 0]
        shear_u, shear_v = slope_u[0] - u[1], slope_v[0] - v[1]
        return E * p.iyy * slope_u[1] * slope_v[1] + G * p.shear_z * shear_u * shear_v

    K = energy.assemble(basis)
    load = np.zeros(K.shape[0])
    load[basis.nodal_dofs[0, -1]] = 1.0
    x = solve(*condense(K, load, D=basis.nodal_dofs[:, 0]))
    return float(x[basis.nodal_dofs[0, -1]])


@pytest.mark.parametrize("end", [BOX, TAPERED])
def test_scikit_fem_weak_form_converges_to_the_element(end: Array) -> None:
    exact = _tip_displacement(_mesh(4, end), np.array([0, 0, 1.0, 0, 0, 0]))[2]
    sizes = np.array([16, 32, 64, 128])
    ratio = np.array([_timoshenko_weak_form(int(n), end) / exact for n in sizes])
    rate = -np.polyfit(np.log(sizes), np.log(np.abs(ratio - 1.0)), 1)[0]
    # Linear elements with one-point shear converge with h^2; the fitted rate deviates by the h^4 term.
    assert rate == pytest.approx(2.0, abs=0.03)
    # The h^2 term taken out (Richardson): left is the h^4 term, of the order of the square of the 1e-3
    # error that 64 elements have.
    assert (4.0 * ratio[-1] - ratio[-2]) / 3.0 == pytest.approx(1.0, abs=3e-6)
