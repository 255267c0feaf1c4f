"""Quadrilateral shell: patch tests, zero-energy modes, invariance, locking, and what bad input says."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp
from refusals import refuses
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation
from skfem import Basis, ElementQuad1

from fem.elements import quad as shell_quad
from fem.elements.quad import quad_frames, quad_stiffness
from robots.arrays import Array, Bools, Integers

E, NU, T = 1e6, 0.25, 0.01
FLAT = np.array([[0.0, 0.0, 0.0], [1.1, 0.1, 0.0], [1.3, 0.9, 0.0], [-0.1, 1.2, 0.0]])
WARPED = FLAT + np.array([0.0, 0.0, 0.15]) * np.array([1.0, -1.0, 1.0, -1.0])[:, None]

# MacNeal and Harder (1985), doi:10.1016/0168-874X(85)90003-4, figure 2: four outer and four inner nodes.
PATCH_NODES = np.array(
    [[0, 0], [0.24, 0], [0.24, 0.12], [0, 0.12], [0.04, 0.02], [0.18, 0.03], [0.16, 0.08], [0.08, 0.08]]
)
PATCH_ELEMENTS = np.array([[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [4, 5, 6, 7]])
SOME_ROTATION = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()

# The patch's stiffness has a condition of up to 1e6 (membrane to bending); times 1e-16.
PATCH_ROUND_OFF = 1e-10
# One product of a matrix with a vector, relative to its largest entry.
ROUND_OFF = 1e-12


def _global(nodes: Array, elements: Integers, thickness: float = T, nu: float = NU, youngs: float = E) -> sp.csc_array:
    K = quad_stiffness(nodes[elements], youngs, nu, np.full(len(elements), thickness))
    dofs = (6 * elements[:, :, None] + np.arange(6)).reshape(-1, 24)
    rows, columns = np.repeat(dofs, 24, axis=1).ravel(), np.tile(dofs, (1, 24)).ravel()
    return sp.coo_array((K.ravel(), (rows, columns)), shape=(6 * len(nodes), 6 * len(nodes))).tocsc()


def _solve(K: sp.csc_array, fixed: Integers, load: Array, prescribed: Array | None = None) -> Array:
    free = np.setdiff1d(np.arange(K.shape[0]), fixed)
    u = np.zeros(K.shape[0]) if prescribed is None else prescribed.copy()
    u[free] = 0.0
    factor = splu(K[free][:, free], permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    u[free] = factor.solve(load[free] - (K @ u)[free])
    return u


def _freedoms(nodes: Bools, which: list[int]) -> Integers:
    return np.asarray((6 * np.flatnonzero(nodes)[:, None] + which).ravel())


def _grid(nx: int, ny: int) -> tuple[Array, Array, Integers]:
    """Parameters u, v in [0, 1] of the nodes and the elements of a regular grid."""
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1), indexing="ij"))
    i, j = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    a = (i * (ny + 1) + j).ravel()
    return u, v, np.stack([a, a + ny + 1, a + ny + 2, a + 1], axis=1)


def _turned(R: Array, fields: Array) -> Array:
    return np.asarray((fields.reshape(-1, 2, 3) @ R.T).ravel())


def _membrane_field(x: Array, y: Array) -> Array:
    """Strains (1, 0.5, 1) 1e-3 with their own mean rotation."""
    fields = np.zeros((len(x), 6))
    fields[:, 0], fields[:, 1], fields[:, 5] = 1e-3 * (x + 0.8 * y), 1e-3 * (0.2 * x + 0.5 * y), -0.3e-3
    return fields


def _bending_field(x: Array, y: Array) -> Array:
    """w = (x^2 + x y + y^2) / 2 1e-3 with the rotations of the Kirchhoff normal."""
    fields = np.zeros((len(x), 6))
    fields[:, 2] = 0.5e-3 * (x**2 + x * y + y**2)
    fields[:, 3], fields[:, 4] = 1e-3 * (y + 0.5 * x), -1e-3 * (x + 0.5 * y)
    return fields


AREA = 0.24 * 0.12
C = E / (1 - NU**2)
# Energies by hand: 1/2 area t (C (ex^2 + ey^2 + 2 nu ex ey) + G gxy^2) and the like with w,xx = w,yy = 1, 2 w,xy = 1.
MEMBRANE_ENERGY = 0.5 * AREA * T * 1e-6 * (C * (1 + 0.25 + NU) + 0.5 * E / (1 + NU))
BENDING_ENERGY = 0.5 * AREA * T**3 / 12 * 1e-6 * (C * (2 + 2 * NU) + 0.5 * E / (1 + NU))


@pytest.mark.parametrize("R", [np.eye(3), SOME_ROTATION], ids=["in the plane z = 0", "turned in space"])
@pytest.mark.parametrize(
    ("field", "energy"),
    [(_membrane_field, MEMBRANE_ENERGY), (_bending_field, BENDING_ENERGY)],
    ids=["membrane", "bending"],
)
def test_patch(R: Array, field: Callable[[Array, Array], Array], energy: float) -> None:
    """A constant strain or curvature imposed on the rim appears inside a patch of distorted elements."""
    exact = _turned(R, field(*PATCH_NODES.T))
    K = _global(np.column_stack([PATCH_NODES, np.zeros(8)]) @ R.T, PATCH_ELEMENTS)
    u = _solve(K, np.arange(24), np.zeros(48), exact)
    assert np.abs(u - exact).max() < PATCH_ROUND_OFF * np.abs(exact).max()
    # The right displacements with the wrong stress would have the wrong energy.
    assert 0.5 * u @ K @ u == pytest.approx(energy, rel=PATCH_ROUND_OFF)


@pytest.mark.parametrize("direction", [0, 1])
def test_constant_transverse_shear_has_its_energy(direction: int) -> None:
    """A slope without rotation of the normals: 5/6 G t gamma^2 / 2 over the area of the distorted patch."""
    field = np.zeros((8, 6))
    field[:, 2] = PATCH_NODES[:, direction]
    u = _turned(SOME_ROTATION, field)
    K = _global(np.column_stack([PATCH_NODES, np.zeros(8)]) @ SOME_ROTATION.T, PATCH_ELEMENTS)
    assert 0.5 * u @ K @ u == pytest.approx(0.5 * 5 / 6 * E / (2 * (1 + NU)) * T * AREA, rel=ROUND_OFF)


def _roof_patch() -> tuple[Array, Integers]:
    """Nine warped elements on a saddle, one node of the inside moved."""
    u, v, elements = _grid(3, 3)
    nodes = np.stack([u, v, 0.6 * (u - 0.4) * (v - 0.5) + 0.1 * u**2], axis=1)
    nodes[5] += [0.05, -0.03, 0.02]
    return nodes, elements


def _rigid_modes(nodes: Array) -> Array:
    """Translations along and rotations about the three axes, (6k, 6)."""
    modes = np.zeros((len(nodes), 6, 6))
    modes[:, :3, :3] = modes[:, 3:, 3:] = np.eye(3)
    for axis in range(3):
        modes[:, :3, 3 + axis] = np.cross(np.eye(3)[axis], nodes)
    return modes.reshape(-1, 6)


BODIES = {
    "one flat element": (FLAT, np.arange(4)[None]),
    "one warped element": (WARPED @ SOME_ROTATION.T, np.arange(4)[None]),
    "a flat patch": (np.column_stack([PATCH_NODES, np.zeros(8)]) @ SOME_ROTATION.T * 5.0, PATCH_ELEMENTS),
    "a warped patch": _roof_patch(),
}


@pytest.mark.parametrize("name", BODIES)
def test_exactly_six_zero_energy_modes(name: str) -> None:
    nodes, elements = BODIES[name]
    values = np.linalg.eigvalsh(_global(nodes, elements, thickness=0.1).toarray())
    # Zero is round-off of the largest; the softest true mode of these bodies stands above 1e-5 of it.
    assert np.abs(values[:6]).max() < 1e-13 * values[-1]
    assert values[6] > 1e-5 * values[-1]


@pytest.mark.parametrize("name", BODIES)
def test_rigid_bodies_feel_no_force(name: str) -> None:
    nodes, elements = BODIES[name]
    K = _global(nodes, elements)
    forces = K @ _rigid_modes(nodes)
    assert np.abs(forces).max() < ROUND_OFF * abs(K).max()


def test_warp_without_its_correction_resists_rotation(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the correction is there for: the flat facet alone sees strain in a rigid rotation."""
    monkeypatch.setattr(shell_quad, "_linked_to_plane", lambda K, height: K)
    K = quad_stiffness(WARPED[None], E, NU, np.array([T]))[0]
    assert np.abs(K @ _rigid_modes(WARPED)).max() > 1e-2 * np.abs(K).max()


@pytest.mark.parametrize("corners", [FLAT, WARPED], ids=["flat", "warped"])
def test_symmetric_and_indifferent_to_numbering_and_sense(corners: Array) -> None:
    orders = np.array([np.roll(np.arange(4), k) for k in range(4)] + [[3, 2, 1, 0]])
    K = quad_stiffness(corners[orders], E, NU, np.full(5, T))
    # The stiffness is made symmetric by averaging, so this is exact.
    assert np.array_equal(K, np.swapaxes(K, 1, 2))
    for order, turned in zip(orders, K, strict=True):
        dofs = (6 * order[:, None] + np.arange(6)).ravel()
        assert np.abs(K[0][np.ix_(dofs, dofs)] - turned).max() < ROUND_OFF * np.abs(K).max()


def test_turns_with_the_mesh(rng: np.random.Generator) -> None:
    corners = np.stack([FLAT, WARPED]) + 0.1 * rng.standard_normal((2, 4, 3))
    R = SOME_ROTATION
    Q = np.kron(np.eye(8), R)
    K, turned = (quad_stiffness(x, E, NU, np.array([T, 2 * T])) for x in (corners, corners @ R.T + [3.0, -2.0, 5.0]))
    # Shifting by 6 m rounds the 1 m corners ten times more coarsely.
    assert np.abs(Q @ K @ Q.T - turned).max() < 10 * ROUND_OFF * np.abs(K).max()


def test_frames_are_right_handed_on_the_mean_plane() -> None:
    frames = quad_frames(np.stack([FLAT, WARPED]) @ SOME_ROTATION.T)
    np.testing.assert_allclose(np.swapaxes(frames, 1, 2) @ frames, [np.eye(3)] * 2, atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, rtol=1e-15)
    # Lifting the corners in turn leaves the mean plane where it was; round-off.
    np.testing.assert_allclose(frames[1], frames[0], atol=1e-15)
    np.testing.assert_allclose(frames[0, :, 2], SOME_ROTATION[:, 2], atol=1e-15)


def test_elements_do_not_see_each_other() -> None:
    both = quad_stiffness(np.stack([FLAT, 3 * WARPED]), E, NU, np.array([T, 5 * T]))[1]
    alone = quad_stiffness(3 * WARPED[None], E, NU, np.array([5 * T]))[0]
    # The BLAS may order its sums differently in another batch size.
    np.testing.assert_allclose(both, alone, atol=ROUND_OFF * np.abs(alone).max())
    assert quad_stiffness(np.zeros((0, 4, 3)), E, NU, np.zeros(0)).shape == (0, 24, 24)


def _clamped_plate(n: int, slenderness: float) -> float:
    """Centre deflection of a clamped square plate under pressure, over Kirchhoff's; a quarter, n x n."""
    u, v, elements = _grid(n, n)
    nodes = np.stack([0.5 * u, 0.5 * v, 0 * u], axis=1)
    rigidity = E * slenderness**3 / (12 * (1 - 0.3**2))
    load = np.zeros(6 * len(nodes))
    np.add.at(load, 6 * elements + 2, rigidity * (0.5 / n) ** 2 / 4)
    fixed = [_freedoms((u == 1) | (v == 1), list(range(6))), _freedoms(u == 0, [0, 4, 5]), _freedoms(v == 0, [1, 3, 5])]
    d = _solve(_global(nodes, elements, slenderness, nu=0.3), np.unique(np.concatenate(fixed)), load)
    # 0.00126532: Taylor and Govindjee, Commun. Numer. Meth. Eng. 20 (2004) 757-765.
    return float(d[2] / 0.00126532)


@pytest.mark.parametrize("slenderness", [1e-2, 1e-3, 1e-4])
def test_thin_plates_do_not_lock(slenderness: float) -> None:
    # Discretisation error of 16 elements a half span is 0.1 %; shear adds 0.2 % at t/L = 1e-2.
    assert _clamped_plate(16, slenderness) == pytest.approx(1.0, abs=0.003)


def test_the_plate_converges_with_the_square_of_the_element_size() -> None:
    errors = [1.0 - _clamped_plate(n, 1e-3) for n in (4, 8, 16)]
    # Bilinear elements: 2; the coarsest mesh is not yet asymptotic.
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all((rates > 1.9) & (rates < 2.2)), rates


def _integrated_shear(side_basis: Basis, _: Array) -> Array:
    """Transverse shear strain of the bilinear displacements themselves: what MITC4 replaces."""
    basis = Basis(side_basis.mesh, ElementQuad1(), intorder=shell_quad.QUADRATURE_ORDER)
    B = np.zeros((*basis.dx.shape, 2, 12))
    for node, shape in enumerate(basis.basis):
        B[..., 3 * node] = np.moveaxis(shape[0].grad, 0, -1)
        B[:, :, 0, 3 * node + 2], B[:, :, 1, 3 * node + 1] = np.asarray(shape[0]), -np.asarray(shape[0])
    return B


def test_fully_integrated_shear_locks(monkeypatch: pytest.MonkeyPatch) -> None:
    """The plate test sees locking: at t/L = 1e-4 hardly anything of the deflection is left."""
    monkeypatch.setattr(shell_quad, "_assumed_shear", _integrated_shear)
    assert _clamped_plate(16, 1e-4) < 1e-3


def test_twist_of_a_plate_by_corner_forces() -> None:
    """Two edges held straight, the free corner pushed, w = c x y: 6 P a^2 (1 + nu) / (E t^3), Kirchhoff."""
    side, thickness, force = 1.0, 1e-3, 1e-6
    u, v, elements = _grid(4, 4)
    nodes = np.stack([side * u, side * v, 0 * u], axis=1)
    load = np.zeros(6 * len(nodes))
    load[6 * (len(nodes) - 1) + 2] = force
    held = _freedoms(u * v == 0, [2])  # the hyperbolic paraboloid w = x y leaves two edges straight
    w = _solve(_global(nodes, elements, thickness), np.union1d(held, _freedoms(u >= 0, [0, 1, 5])), load)[-4]
    # Shear deformation along the free edges is of the order of t/a.
    assert w == pytest.approx(6 * force * side**2 * (1 + NU) / (E * thickness**3), rel=2e-3)


@pytest.mark.parametrize("elements_along", [1, 2, 5])
def test_bending_in_the_plane_is_exact_for_rectangles(elements_along: int) -> None:
    """A row of rectangles under an end moment: M L^2 / 2 E I, whatever their aspect ratio."""
    length, height, moment = 10.0, 1.0, 1e-3
    u, v, elements = _grid(elements_along, 1)
    nodes = np.stack([length * u, height * (v - 0.5), 0 * u], axis=1)
    load = np.zeros(6 * len(nodes))
    load[_freedoms((u == 1) & (v == 1), [0])], load[_freedoms((u == 1) & (v == 0), [0])] = -moment, moment
    held = [_freedoms(u == 0, [0]), _freedoms((u == 0) & (v == 0), [1]), _freedoms(u >= 0, [2, 3, 4])]
    d = _solve(_global(nodes, elements), np.unique(np.concatenate(held)), load)
    # Exact but for round-off, amplified by the condition (L/h)^4.
    assert d[-11] == pytest.approx(moment * length**2 / (2 * E * T / 12), rel=1e-9)


@pytest.mark.parametrize(
    ("corners", "youngs", "nu", "thickness", "says"),
    [
        (FLAT[None, [0, 2, 1, 3]], E, NU, [T], "convex"),
        (FLAT[None, [0, 1, 1, 3]], E, NU, [T], "convex"),
        (FLAT[None, [0, 0, 0, 0]], E, NU, [T], "convex"),
        (np.array([[[0, 0, 0], [1, 0, 0], [0.2, 0.2, 0], [0, 1, 0]]]), E, NU, [T], "convex"),
        (FLAT[None] * np.nan, E, NU, [T], "finite"),
        (FLAT[None, :3], E, NU, [T], "shape"),
        (FLAT[None], E, NU, [T, T], "shape"),
        (FLAT[None], E, NU, [0.0], "greater than 0"),
        (FLAT[None], E, NU, [np.nan], "greater than 0"),
        (FLAT[None], 0.0, NU, [T], "greater than 0"),
        (FLAT[None], E, 0.5, [T], "between -1 and 0.5"),
    ],
    ids=["crossing", "a triangle", "a point", "re-entrant", "NaN", "3 corners", "2 walls", "0", "nan wall", "E", "nu"],
)
def test_bad_input_is_refused(corners: Array, youngs: float, nu: float, thickness: list[float], says: str) -> None:
    refuses("L007", says, quad_stiffness, corners, youngs, nu, np.array(thickness))


def test_the_message_names_the_bad_element() -> None:
    refuses(
        "L007",
        r"1 quad\(s\) .* the first is quad 1",
        quad_stiffness,
        np.stack([FLAT, FLAT[[0, 2, 1, 3]], WARPED]),
        E,
        NU,
        np.full(3, T),
    )
