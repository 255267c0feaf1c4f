"""Fields from the condensed path: against the full solve, energy balance, and stress of known states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from refusals import refuses
from scipy.spatial.transform import Rotation

from fem import ArmModel, build_model, deflection, deflection_by_part
from fem.elements.shell import CoupledShell, shell_superelement
from fem.reference.shell_arm import couple_links, solve_shell_arm
from fem.statics.fields import LinkShapes, arm_fields, face_stress, link_shapes, von_mises
from meshes import ShellMesh
from robots import ModelDescription, load_description
from robots.arrays import Array

Random = np.random.Generator
Draw = Callable[..., Array]
Soften = Callable[..., ArmModel]
Prepared = tuple[ArmModel, dict[str, CoupledShell], dict[str, LinkShapes]]

# As in test_shell_arm.py: the full solve's round-off, relative to the largest displacement.
ROUND_OFF = 1e-7
# Products of the same few numbers in another order, energies as quadratic forms of shapes: measured 7e-14.
BALANCE = 1e-9
W = np.array([300.0, -200.0, -650.0, 40.0, -30.0, 50.0])


def _prepared(name: str) -> Prepared:
    model = build_model(load_description(name), links="shell")
    shells = couple_links(model)
    return model, shells, link_shapes(model, shells)


@pytest.fixture(scope="module")
def xr701() -> Prepared:
    return _prepared("xr701")


@pytest.fixture(
    scope="module",
    params=[
        "xr701 parallelogram",
        *(pytest.param(a, marks=pytest.mark.slow) for a in ("xr701 serial", "kr60-3 serial")),
    ],
)
def arm(request: pytest.FixtureRequest, xr701: Prepared) -> Prepared:
    model, shells, shapes = xr701 if request.param.startswith("xr701") else _prepared("kr60-3")
    if request.param == "xr701 serial":
        # The links are the same; to condense them again would cost a second.
        model = replace(model, load_path="serial", bar=None)
    assert model.load_path == request.param.split()[1]
    return model, shells, shapes


@pytest.mark.slow
def test_displacements_of_all_nodes_equal_the_full_solve(
    arm: Prepared, reachable: Draw, soften: Soften, furnish: Soften, rng: Random
) -> None:
    bare, shells, shapes = arm
    soft = soften(bare, rng, other=True)
    for model, q in zip((bare, soft, furnish(soft, rng)), reachable(bare.robot, 3, rng), strict=True):
        point = 0.3 * rng.normal(size=3)
        fields = arm_fields(model, q, W, point, shapes=shapes)
        full = solve_shell_arm(model, q, W, point, shells=shells)
        assert {field.name for field in fields.links} == set(full.links)
        size = np.abs(fields.displacement).max()
        for field in fields.links:
            tip = field.mesh.interfaces["tip"]
            assert np.abs(field.displacement[tip]).max() > 1e-9  # something moves there: m
            assert np.abs(field.displacement - full.links[field.name][0]).max() < ROUND_OFF * size
        # Kinematics down the chain against virtual forces: two ways over the same deformations.
        expected = deflection(model, q[None], W, point)[0]
        assert np.abs(fields.displacement - expected).max() < BALANCE * size


def test_energies_add_up_to_half_the_work(arm: Prepared, reachable: Draw, soften: Soften, rng: Random) -> None:
    bare, _, shapes = arm
    for model, q in zip((bare, soften(bare, rng, other=True)), reachable(bare.robot, 2, rng), strict=True):
        fields = arm_fields(model, q, W, shapes=shapes)
        energy = fields.energy_by_part
        shares = deflection_by_part(model, q[None], W)
        work = 0.5 * W @ deflection(model, q[None], W)[0]
        assert sum(energy.values()) == pytest.approx(work, rel=BALANCE)
        assert set(energy) == set(shares)
        for name, share in shares.items():
            assert energy[name] == pytest.approx(0.5 * W @ share[0], rel=BALANCE, abs=BALANCE * work)
        for field in fields.links:
            assert field.energy.shape == (len(field.mesh.triangles) + len(field.mesh.quads),)
            assert (field.energy > -BALANCE * work).all()


def _split(mesh: ShellMesh, kept: int) -> ShellMesh:
    """Cut all quads but the first ``kept`` into triangles."""
    cut = mesh.quads[kept:]
    triangles = np.concatenate([cut[:, [0, 1, 2]], cut[:, [0, 2, 3]]])
    thickness = np.concatenate([np.tile(mesh.thickness[kept:], 2), mesh.thickness[:kept]])
    return replace(mesh, triangles=triangles, quads=mesh.quads[:kept], thickness=thickness)


@pytest.mark.slow
def test_a_link_of_triangles_beside_quads(xr701: Prepared, reachable: Draw, rng: Random) -> None:
    model, shells, shapes = xr701
    wrist = next(link for link in model.links if link.name == "wrist")
    assert wrist.shell is not None
    mesh = _split(wrist.shell, 120)
    mixed = replace(wrist, shell=mesh, element=shell_superelement(mesh, wrist.element.points))
    model = replace(model, links=tuple(mixed if link is wrist else link for link in model.links))
    alone = replace(model, links=(mixed,))
    shells, shapes = shells | couple_links(alone), shapes | link_shapes(alone)
    q = reachable(model.robot, 1, rng)[0]
    fields, full = arm_fields(model, q, W, shapes=shapes), solve_shell_arm(model, q, W, shells=shells)
    field = next(field for field in fields.links if field.name == "wrist")
    size = np.abs(fields.displacement).max()
    assert np.abs(field.displacement - full.links["wrist"][0]).max() < ROUND_OFF * size
    share = 0.5 * W @ deflection_by_part(model, q[None], W)["wrist"][0]
    assert field.energy.sum() == pytest.approx(share, rel=BALANCE)


def test_stress_of_constant_strain_and_curvature(rng: Random) -> None:
    """A flat, crooked patch of triangles and quads in space: both faces to round-off."""
    x, y = np.meshgrid(np.linspace(0.0, 0.4, 5), np.linspace(0.0, 0.3, 4), indexing="ij")
    flat = np.stack([x.ravel(), y.ravel()], axis=1) + 0.02 * rng.uniform(-1.0, 1.0, (20, 2))
    number = np.arange(20).reshape(5, 4)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    E, nu, t = 7e10, 0.3, 0.004
    strain, curvature = np.array([2e-4, -1e-4, 3e-4]), np.array([0.1, 0.02, -0.04])
    u = np.zeros((20, 6))
    u[:, 0] = strain[0] * flat[:, 0] + 0.25 * strain[2] * flat[:, 1]
    u[:, 1] = strain[1] * flat[:, 1] + 0.75 * strain[2] * flat[:, 0]
    u[:, 5] = 0.25 * strain[2]
    # Normals turn by (ry, -rx) = -grad w, and curvature is the gradient of that.
    slope = np.stack(
        [
            curvature[0] * flat[:, 0] + 0.5 * curvature[2] * flat[:, 1],
            0.5 * curvature[2] * flat[:, 0] + curvature[1] * flat[:, 1],
        ],
        axis=1,
    )
    u[:, 2] = -0.5 * np.einsum("ij,ij->i", slope, flat)
    u[:, 4], u[:, 3] = slope[:, 0], -slope[:, 1]
    R = Rotation.random(random_state=1).as_matrix()
    plane = np.column_stack([flat, np.zeros(20)])
    mesh = _split(ShellMesh("patch", plane @ R.T, np.zeros((0, 3), np.int64), quads, np.full(12, t), E, nu, {}), 6)
    stress = von_mises(face_stress(mesh, (u.reshape(-1, 2, 3) @ R.T).reshape(-1, 6)))
    D = E / (1.0 - nu**2) * np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, 0.5 * (1.0 - nu)]])
    for face, sign in enumerate((1.0, -1.0)):
        sx, sy, sxy = D @ (strain + sign * 0.5 * t * curvature)
        expected = np.sqrt(0.5 * ((sx - sy) ** 2 + sx**2 + sy**2) + 3.0 * sxy**2)
        # A few hundred products with mesh and stress of one size: round-off.
        assert stress[:, face] == pytest.approx(np.full(len(stress), expected), rel=1e-10)
    assert abs(stress[0, 0] / stress[0, 1] - 1.0) > 0.1  # the faces differ, so that a swap shows


def test_stress_of_a_warped_quad_is_that_of_its_projection(rng: Random) -> None:
    """Corners h, -h, h, -h off a parallelogram move it through rigid links: u - h theta x n."""
    flat = np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [1.3, 1.0, 0.0], [0.3, 0.9, 0.0]])
    height = 0.2 * np.array([1.0, -1.0, 1.0, -1.0])
    u = rng.normal(size=(4, 6))
    moved = u.copy()
    moved[:, :3] -= height[:, None] * np.cross(u[:, 3:], [0.0, 0.0, 1.0])
    mesh = ShellMesh("flat", flat, np.zeros((0, 3), np.int64), np.arange(4)[None], np.array([0.1]), 1.0, 0.3, {})
    warped = face_stress(replace(mesh, nodes=flat + np.outer(height, [0.0, 0.0, 1.0])), u)
    # The same sums of a dozen terms of one size.
    assert warped == pytest.approx(face_stress(mesh, moved), abs=1e-13)
    assert np.abs(warped - face_stress(mesh, u)).max() > 0.01


@pytest.mark.slow
def test_stress_halfway_along_a_tube(boom: Callable[..., ModelDescription]) -> None:
    model = build_model(boom(length=0.6), links="shell")
    shapes = link_shapes(model)
    bending, torsion, tension = (
        arm_fields(model, np.zeros(1), w, shapes=shapes).links[0]
        for w in ([0, 0, 0, 0, 2e3, 0], [0, 0, 0, 2e3, 0, 0], [1e5, 0, 0, 0, 0, 0])
    )
    r, t = 0.045, 0.01  # mid-surface of the 100 mm tube, wall 10 mm
    mesh = bending.mesh
    middle = mesh.nodes[mesh.quads].mean(axis=1)
    half = np.abs(middle[:, 0] - 0.3) < 0.1
    # 32 facets for a circle: area and inertia 0.5 and 1 % small, and the rings' grip fades within some 50 mm.
    near = 0.02
    assert torsion.von_mises[half].mean(axis=1) == pytest.approx(
        np.sqrt(3.0) * 2e3 / (2.0 * np.pi * r**2 * t), rel=near
    )
    assert tension.von_mises[half] == pytest.approx(1e5 / (2.0 * np.pi * r * t), rel=near)
    first, second = (b - a for a, b in pairwise(np.moveaxis(mesh.quad_corners, 1, 0)[:3]))
    outward = np.einsum("ei,ei->e", np.cross(first, second), middle * [0.0, 1.0, 1.0]) > 0.0
    outer = np.where(outward, *bending.von_mises.T)
    inner = np.where(outward, *bending.von_mises.T[::-1])
    inertia = np.pi * r**3 * t * (1.0 + (0.5 * t / r) ** 2)
    top = half & (np.abs(middle[:, 2]) > 0.99 * np.abs(middle[:, 2]).max())
    height = np.abs(middle[top, 2])
    assert outer[top] == pytest.approx(2e3 * height * (1.0 + 0.5 * t / r) / inertia, rel=near)
    assert inner[top] == pytest.approx(2e3 * height * (1.0 - 0.5 * t / r) / inertia, rel=near)


def test_bad_input(xr701: Prepared) -> None:
    model, _, shapes = xr701
    refuses("B003", "loads of a field", arm_fields, model, np.full(6, 0.5), np.ones((2, 6)), shapes=shapes)
    refuses("M003", "shell", arm_fields, build_model(load_description("kr60-3"), links="beam"), np.zeros(6), W)
    refuses("B001", "pose", arm_fields, model, np.zeros(3), W, shapes=shapes)
