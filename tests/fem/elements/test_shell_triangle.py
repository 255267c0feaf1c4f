"""Triangular shell element: patch tests, zero modes, exact in-plane bending, and broken elements that fail."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refuses
from scipy.spatial.transform import Rotation

from fem.elements import triangle as shell_triangle
from fem.elements.assembly import assemble_shell, freedoms
from fem.elements.couplings import rigid_motion
from fem.elements.facets import plane_stress
from fem.elements.triangle import triangle_stiffness
from meshes.shell_mesh import ShellMesh
from robots.arrays import Array

E, NU, T = 70e9, 0.3, 0.01

# Distorted patch of MacNeal and Harder (doi:10.1016/0168-874X(85)90003-4), quads cut into triangles.
PATCH = np.array(
    [[0, 0], [0.24, 0], [0.24, 0.12], [0, 0.12], [0.04, 0.02], [0.18, 0.03], [0.16, 0.08], [0.08, 0.08]], dtype=float
)
QUADS = np.array([[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [4, 5, 6, 7]])
TRIANGLES = np.concatenate([QUADS[:, [0, 1, 2]], QUADS[:, [0, 2, 3]]])
AREA = 0.24 * 0.12
TURN = Rotation.from_euler("xyz", [0.3, -1.1, 2.0]).as_matrix()

# Round-off: eps = 2e-16 times the ratio of membrane to bending stiffness, 12 (size / t)^2 = 1e3 to 1e4 in turned
# axes where the two mix, times the digits a solve loses (measured up to 1e-11).
ROUND_OFF = 1e-10


def _patch(turn: Array = TURN) -> ShellMesh:
    nodes = np.column_stack([PATCH, np.zeros(8)]) @ turn.T + 0.5
    return ShellMesh("patch", nodes, TRIANGLES, np.zeros((0, 4), int), np.full(10, T), E, NU, {})


def _field(kind: str, turn: Array) -> tuple[Array, float]:
    """Nodal freedoms (8, 6) of a constant strain or curvature and its exact energy."""
    x, y = PATCH.T
    u = np.zeros((8, 6))
    if kind == "membrane":
        exx, eyy, gxy, spin = 1e-3, -4e-4, 7e-4, 3e-4
        u[:, 0] = exx * x + (0.5 * gxy - spin) * y + 2e-4
        u[:, 1] = eyy * y + (0.5 * gxy + spin) * x
        u[:, 5] = spin
        strain, rigidity = np.array([exx, eyy, gxy]), T
    else:
        kxx, kyy, kxy = 2.0, -1.0, 0.7
        u[:, 2] = 0.5 * (kxx * x**2 + kyy * y**2 + kxy * x * y) + 0.1 * x
        u[:, 3] = kyy * y + 0.5 * kxy * x
        u[:, 4] = -(kxx * x + 0.5 * kxy * y + 0.1)
        strain, rigidity = np.array([kxx, kyy, kxy]), T**3 / 12.0
    energy = 0.5 * strain @ plane_stress(E, NU) @ strain * rigidity * AREA
    return np.concatenate([u[:, :3] @ turn.T, u[:, 3:] @ turn.T], axis=1), float(energy)


def _patch_errors(kind: str, turn: Array = TURN) -> tuple[float, float]:
    """Errors of the inner nodes' displacement and of the energy, relative, all outer freedoms prescribed."""
    exact, energy = _field(kind, turn)
    K = assemble_shell(_patch(turn)).toarray()
    outer, inner = freedoms(np.arange(4)).ravel(), freedoms(np.arange(4, 8)).ravel()
    u = exact.ravel().copy()
    u[inner] = np.linalg.solve(K[np.ix_(inner, inner)], -K[np.ix_(inner, outer)] @ u[outer])
    displacement = np.abs(u - exact.ravel()).max() / np.abs(exact).max()
    return float(displacement), float(abs(0.5 * u @ K @ u / energy - 1.0))


def _zero_modes(K: Array) -> int:
    """Count modes without energy, rotations scaled to metres of the patch's size."""
    scale = np.tile([1.0, 1.0, 1.0, 10.0, 10.0, 10.0], len(K) // 6)
    values = np.linalg.eigvalsh(K * scale[:, None] * scale)
    # Round-off leaves 1e-16 of the largest; the softest bending mode of the patch has 1e-8 of it.
    return int((np.abs(values) < 1e-12 * values[-1]).sum())


def _bending_ratio(aspect: float, nu: float = NU) -> float:
    """Energy over beam theory's of a rectangle of two triangles whose corners follow pure in-plane bending."""
    x, y = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]).T * np.array([[aspect], [1.0]]) - [[aspect / 2], [0.5]]
    u = np.zeros((4, 6))
    u[:, 0], u[:, 1], u[:, 5] = -x * y, 0.5 * (x**2 + nu * y**2), x
    cells = np.array([[0, 1, 2], [0, 2, 3]])
    K = triangle_stiffness(np.stack([x, y, 0 * x], axis=1)[cells], E, nu, np.full(2, T))
    ends = u[cells].reshape(2, 18)
    return float(0.5 * np.einsum("ei,eij,ej", ends, K, ends) / (0.5 * E * T / 12.0 * aspect))


@pytest.mark.parametrize("kind", ["membrane", "bending"])
@pytest.mark.parametrize("turn", [np.eye(3), TURN], ids=["flat", "turned"])
def test_patch_test_to_round_off(kind: str, turn: Array) -> None:
    displacement, energy = _patch_errors(kind, turn)
    assert displacement < ROUND_OFF
    assert energy < ROUND_OFF


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
def test_six_zero_modes_of_one_element_and_of_a_patch(nu: float, rng: np.random.Generator) -> None:
    for K in triangle_stiffness(0.1 * rng.normal(size=(20, 3, 3)), E, nu, np.full(20, T)):
        assert _zero_modes(K) == 6
    assert _zero_modes(assemble_shell(_patch()).toarray()) == 6


def test_rigid_motion_needs_no_force(rng: np.random.Generator) -> None:
    corners = rng.normal(size=(50, 3, 3))
    K = triangle_stiffness(corners, E, NU, np.full(50, T))
    modes = rigid_motion(corners.reshape(-1, 3)).reshape(50, 18, 6)
    # Round-off of sums of 18 terms; slivers among the random triangles amplify it a thousandfold.
    assert (np.abs(K @ modes).max(axis=(1, 2)) < 1e-12 * np.abs(K).max(axis=(1, 2))).all()


@pytest.mark.parametrize("aspect", [0.25, 1.0, 5.0, 10.0])
@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_in_plane_bending_is_exact_at_any_aspect_ratio(aspect: float, nu: float) -> None:
    # Felippa's claim for the optimal parameters; round-off grows with the aspect ratio's square.
    assert _bending_ratio(aspect, nu) == pytest.approx(1.0, abs=ROUND_OFF)


def test_symmetric_and_the_same_from_any_corner_and_side(rng: np.random.Generator) -> None:
    corners, t = rng.normal(size=(10, 3, 3)), rng.uniform(0.01, 0.1, 10)
    K = triangle_stiffness(corners, E, NU, t)
    # Round-off only: another corner order is another local frame (slivers as above).
    tolerance = 1e-11 * np.abs(K).max(axis=(1, 2), keepdims=True)
    assert (np.abs(K - K.swapaxes(1, 2)) <= tolerance).all()
    for order in ([1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0]):
        dofs = freedoms(np.array(order)).ravel()
        turned = triangle_stiffness(corners[:, order], E, NU, t)
        assert (np.abs(turned - K[:, dofs[:, None], dofs]) <= tolerance).all()


def test_turned_element_has_the_turned_stiffness(rng: np.random.Generator) -> None:
    corners, t = rng.normal(size=(10, 3, 3)), np.full(10, 0.05)
    R = np.kron(np.eye(6), TURN)
    K = triangle_stiffness(corners, E, NU, t)
    turned = triangle_stiffness(corners @ TURN.T + 3.0, E, NU, t)
    tolerance = 1e-11 * np.abs(K).max(axis=(1, 2), keepdims=True)  # round-off, slivers as above
    assert (np.abs(turned - R @ K @ R.T) <= tolerance).all()


def test_membrane_grows_with_thickness_and_bending_with_its_cube() -> None:
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0.2, 0.8, 0]]], dtype=float)
    K1, K2 = (triangle_stiffness(corners, E, NU, np.array([t]))[0] for t in (0.01, 0.03))
    for component, factor in ((0, 3.0), (1, 3.0), (5, 3.0), (2, 27.0), (3, 27.0), (4, 27.0)):
        assert K2[component, component] / K1[component, component] == pytest.approx(factor, rel=1e-12)  # round-off


# Broken elements: each must be caught by the test that watches over the broken part.


def test_without_the_higher_order_membrane_part_there_are_mechanisms(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shell_triangle, "_AT_MIDSIDES", np.zeros((3, 3, 3)))
    assert _zero_modes(assemble_shell(_patch()).toarray()) > 6
    corners = 0.1 * np.random.default_rng(0).normal(size=(1, 3, 3))
    assert _zero_modes(triangle_stiffness(corners, E, NU, np.full(1, T))[0]) == 9


def test_other_parameters_lose_in_plane_bending(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shell_triangle, "ALPHA_B", 1.0)
    # Still consistent, as Felippa's family of templates promises, but no longer optimal.
    assert max(_patch_errors("membrane")) < ROUND_OFF
    assert abs(_bending_ratio(5.0) - 1.0) > 0.1


def test_a_wrong_template_fails_in_plane_bending(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shell_triangle, "_AT_MIDSIDES", shell_triangle._AT_MIDSIDES.swapaxes(1, 2))
    assert abs(_bending_ratio(5.0) - 1.0) > 0.1


def test_without_kirchhoffs_condition_on_the_sides_bending_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    linear = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])
    true = shell_triangle._fibre_rotations

    def without(xy: Array) -> Array:
        beta = true(xy)
        beta[:, :, 3:] = np.einsum("si,ecij->ecsj", linear, beta[:, :, :3])
        return beta

    monkeypatch.setattr(shell_triangle, "_fibre_rotations", without)
    # The deflection has no stiffness any more.
    assert _zero_modes(assemble_shell(_patch()).toarray()) > 6


def test_a_wrong_side_slope_fails_the_bending_patch_test(monkeypatch: pytest.MonkeyPatch) -> None:
    true = shell_triangle._fibre_rotations

    def wrong(xy: Array) -> Array:
        beta = true(xy)
        beta[:, :, 3:] *= 0.99
        return beta

    monkeypatch.setattr(shell_triangle, "_fibre_rotations", wrong)
    assert max(_patch_errors("bending")) > 1e3 * ROUND_OFF


GOOD = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], dtype=float)


@pytest.mark.parametrize(
    ("corners", "youngs_modulus", "nu", "thickness", "message"),
    [
        (GOOD[0], E, NU, np.full(1, T), "corners"),
        (GOOD, E, NU, np.full(2, T), "thickness"),
        (GOOD * [1, 0, 0], E, NU, np.full(1, T), "without area"),
        (GOOD * np.nan, E, NU, np.full(1, T), "not finite"),
        (GOOD, E, NU, np.zeros(1), "thickness"),
        (GOOD, E, NU, np.full(1, np.nan), "thickness"),
        (GOOD, -1.0, NU, np.full(1, T), "Young"),
        (GOOD, E, 0.5, np.full(1, T), "Poisson"),
        (GOOD, E, np.nan, np.full(1, T), "Poisson"),
    ],
)
def test_bad_input_is_refused(corners: Array, youngs_modulus: float, nu: float, thickness: Array, message: str) -> None:
    refuses("L007", message, triangle_stiffness, corners, youngs_modulus, nu, thickness)
