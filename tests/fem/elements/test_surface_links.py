"""Links whose prepared surface takes the casing's place in the model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from refusals import refuses

import fem
from fem import (
    ArmModel,
    arm_fields,
    build_model,
    compliance,
    deflection,
    deflection_by_part,
    link_shapes,
    solve_shell_arm,
)
from fem.elements.couplings import Coupling
from fem.elements.shell import shell_superelement
from fem.elements.trust import trust_in
from fem.model import LinkPart
from fem.reference import direct
from fem.reference.shell_arm import all_links, couple_links
from meshes import ShellMesh, casing_mesh, save_shell
from meshes.surfaces.remesh import remesh
from robots import ModelDescription, load_description
from robots.arrays import Array
from robots.schema.description import Surface


def with_surface(description: ModelDescription, path: Path, digest: str) -> ModelDescription:
    wall = {"value": 10.0, "unit": "mm", "source": "assumed"}
    surface = Surface.model_validate(
        {"file": str(path), "sha256": digest, "wall": wall, "size": wall, "source": "assumed"}
    )
    link = description.link[0].model_copy(update={"surface": surface})
    return description.model_copy(update={"link": (link,)})


def test_a_prepared_surface_is_the_link(boom: Callable[..., ModelDescription], tmp_path: Path) -> None:
    description, path = boom(length=0.2, stiffness=1e6), tmp_path / "tube.npz"
    beam = build_model(description, "beam")
    # Coarser than the casing, and a tenth of it cut into triangles: no mesh that the program makes by itself.
    mesh = casing_mesh(beam.links[0].mesh, 0.03)
    cut = mesh.quads[: len(mesh.quads) // 10]
    mesh = replace(
        mesh,
        triangles=np.concatenate([cut[:, [0, 1, 2]], cut[:, [0, 2, 3]]]),
        quads=mesh.quads[len(cut) :],
        thickness=np.full(len(mesh.quads) + len(cut), 0.01),
    )
    described = with_surface(description, path, save_shell(mesh, path))
    model = build_model(described, "shell")
    shell = model.links[0].shell
    assert shell is not None
    assert len(shell.triangles) == len(mesh.triangles) > 0
    q, w = np.array([[0.3]]), np.array([100.0, 50.0, -400.0, 20.0, 0.0, 5.0])
    d = deflection(model, q, w)[0]
    full = solve_shell_arm(model, q[0], w)
    # Round-off, as in test_shell_arm.py.
    np.testing.assert_allclose(full.displacement[0], d, rtol=0, atol=1e-7 * np.abs(d).max())
    # Eleven corners for a circle, partly of triangles: 7 % at most. The beam of the link stays as it was.
    np.testing.assert_allclose(d[:3], deflection(build_model(description, "shell"), q, w)[0, :3], rtol=0.1)
    np.testing.assert_array_equal(deflection(build_model(described, "beam"), q, w), deflection(beam, q, w))
    # The file is looked at each time, whatever the cache holds of the link.
    path.write_bytes(b"something else")
    refuses("F007", "has changed since the model was written", build_model, described, "shell")
    build_model(described, "beam")


# ------------------------------------------------------------
# shell links


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "path"), [("kr60-3", "serial"), ("tx200", "serial"), ("xr701", "parallelogram"), ("xr701", "serial")]
)
def test_fast_path_equals_direct_stiffness_with_shell_links(name: str, path: str, rng: np.random.Generator) -> None:
    model = fem.build_model(load_description(name), "shell", path)  # type: ignore[arg-type]
    model = model.with_springs(dict(zip(model.robot.joint_names, rng.uniform(3e5, 3e6, 6), strict=True)))
    limits = model.robot.limits
    q = rng.uniform(limits[:, 0], limits[:, 1], (400, 6))
    q = q[model.robot.reachable(q)][:20]
    assert len(q) == 20
    C, D = fem.compliance(model, q), direct.compliance(model, q)
    scale = np.sqrt(np.einsum("nii->ni", C))
    # eps times the condition of the direct system, as for beams (tests/fem/reference/test_fast_against_direct.py).
    assert (np.abs(C - D) / (scale[:, :, None] * scale[:, None])).max() < 2e-9


def test_shell_and_beam_links_of_the_xr701_agree_within_ten_percent() -> None:
    description = load_description("xr701")
    q = np.radians([[0, -35, 40, 0, 0, 0], [0, 5, 77.5, 0, 0, 0], [0, 45, 115, 0, 0, 0]])
    load = np.array([0.0, 0.0, -650.0, 0.0, 0.0, 0.0])
    d = {kind: fem.deflection(fem.build_model(description, kind), q, load)[:, 2] for kind in ("beam", "shell")}  # type: ignore[arg-type]
    # 10 %: short fat casings with rigid rings are stiffer than beams; measured 1 to 3 % here.
    np.testing.assert_allclose(d["shell"], d["beam"], rtol=0.10)


def test_full_assembly_of_shell_links_is_refused_by_the_dense_reference() -> None:
    model = fem.build_model(load_description("kr60-3"), "shell")
    refuses("B003", "shell", direct.compliance, model, np.zeros((1, 6)), condensed=False)


# ------------------------------------------------------------
# Where a shell's energy sits and how its wall bends tells a sound link from one held by too little

WALL_M, LENGTH_M = 0.005, 0.6


def test_a_small_ring_on_a_wall_shows_and_a_whole_end_does_not() -> None:
    box = trimesh.creation.box((LENGTH_M, 0.15, 0.15)).apply_translation([LENGTH_M / 2, 0, 0])
    nodes, faces = remesh(np.asarray(box.vertices), np.asarray(box.faces), 0.02)
    ends = {"root": np.flatnonzero(nodes[:, 0] < 1e-9), "tip": np.flatnonzero(nodes[:, 0] > LENGTH_M - 1e-9)}
    none = np.zeros((0, 4), dtype=np.int64)
    sound = ShellMesh("box", nodes, faces, none, np.full(len(faces), WALL_M), 2.1e11, 0.3, ends)
    points = np.array([[0.0, 0, 0], [LENGTH_M, 0, 0]])
    couplings = {"root": "rigid", "tip": "rigid"}
    good = trust_in(sound, points, couplings)
    off = np.linalg.norm(nodes - [LENGTH_M, 0, 0], axis=1)
    poor = trust_in(replace(sound, interfaces=ends | {"tip": np.argsort(off)[:6]}), points, couplings)
    assert good.half_energy_share > 0.1
    # Stretched and sheared walls: as 1 / t.
    assert 0.95 < good.wall_exponent < 1.1
    assert poor.half_energy_share < 0.03
    assert poor.wall_exponent > 1.8
    assert np.linalg.norm(poor.hot - [LENGTH_M, 0, 0]) < 0.06


# ------------------------------------------------------------
# Couplings of shell links by choice: what a model takes from where, and that all of its solutions use the same

Random = np.random.Generator
Draw = Callable[..., Array]
Soften = Callable[..., ArmModel]

# As in test_shell_arm.py, where walls far stiffer than the springs enlarge round-off. Measured here: 1e-9.
ROUND_OFF = 1e-7
# As in test_fields.py: measured 7e-14.
BALANCE = 1e-9
COARSE_M = 0.14
INTERFACES = ("root", "tip", "pin")
CHOICES: dict[str, dict[str, Coupling]] = {
    "distributing": dict.fromkeys(INTERFACES, "distributing"),
    "rigid root": {"root": "rigid", "tip": "distributing", "pin": "distributing"},
    "rigid tip": {"root": "distributing", "tip": "rigid", "pin": "distributing"},
    "rigid pin": {"root": "distributing", "tip": "distributing", "pin": "rigid"},
}


def _coarse(part: LinkPart, flanges: Mapping[str, Coupling]) -> LinkPart:
    shell = casing_mesh(part.mesh, COARSE_M)
    kinds = {name: flanges[name] for name in shell.interfaces}
    return replace(part, shell=shell, element=shell_superelement(shell, part.element.points, kinds), flanges=kinds)


def coarse(name: str, flanges: Mapping[str, Coupling]) -> ArmModel:
    """Shell model with large elements: exactness does not depend on their size."""
    model = build_model(load_description(name), links="beam")
    bar = model.bar
    if bar is not None and bar.crank is not None:
        bar = replace(bar, crank=_coarse(bar.crank, flanges))
    links = tuple(_coarse(link, flanges) for link in model.links)
    return replace(model, link_kind="shell", links=links, bar=bar)


@pytest.fixture(scope="module", params=CHOICES)
def arm(request: pytest.FixtureRequest) -> ArmModel:
    return coarse("xr701", CHOICES[request.param])


def difference(a: Array, b: Array) -> float:
    size = np.sqrt(np.diag(b))
    return float((np.abs(a - b) / (size[:, None] * size)).max())


def test_condensed_path_equals_the_full_solve(arm: ArmModel, reachable: Draw, soften: Soften, rng: Random) -> None:
    shells = couple_links(arm)
    variants = [soften(arm, rng, other=True), replace(arm.with_rigid_joints(), load_path="serial", bar=None)]
    for model, q in zip(variants, reachable(arm.robot, len(variants), rng), strict=True):
        point = 0.3 * rng.normal(size=3)
        full = solve_shell_arm(model, q, np.eye(6), point, shells=shells)
        assert difference(full.displacement.T, compliance(model, q[None], point)[0]) < ROUND_OFF


def test_fields_equal_the_full_solve_and_balance(arm: ArmModel, reachable: Draw, rng: Random) -> None:
    shells = couple_links(arm)
    q, w = reachable(arm.robot, 1, rng)[0], np.array([300.0, -200.0, -650.0, 40.0, -30.0, 50.0])
    fields = arm_fields(arm, q, w, shapes=link_shapes(arm, shells))
    full = solve_shell_arm(arm, q, w, shells=shells)
    size = np.abs(fields.displacement).max()
    assert {field.name for field in fields.links} == {link.name for link in all_links(arm)}
    shares = deflection_by_part(arm, q[None], w)
    for field in fields.links:
        assert np.abs(field.displacement - full.links[field.name][0]).max() < ROUND_OFF * size
        assert field.energy.sum() == pytest.approx(0.5 * w @ shares[field.name][0], rel=BALANCE)


@pytest.mark.parametrize("link", ["forearm", "crank"])
def test_a_link_coupled_otherwise_is_noticed(link: str, reachable: Draw, rng: Random) -> None:
    arm = coarse("xr701", CHOICES["distributing"])
    shells = couple_links(arm) | {link: couple_links(coarse("xr701", CHOICES["rigid tip"]))[link]}
    q = reachable(arm.robot, 1, rng)
    full = solve_shell_arm(arm, q[0], np.eye(6), shells=shells)
    # A rigid tip on the crank alone, the part that matters least, makes 1e-3.
    assert difference(full.displacement.T, compliance(arm, q)[0]) > 100.0 * ROUND_OFF


@pytest.mark.slow
def test_rigid_flanges_bound_distributing_ones(reachable: Draw, rng: Random) -> None:
    choices: list[Mapping[str, Coupling]] = [dict.fromkeys(INTERFACES, "rigid"), *CHOICES.values()]
    models = [coarse("xr701", choice).with_rigid_joints() for choice in choices]
    for q in reachable(models[0].robot, 3, rng):
        stiff, soft, *between = (compliance(model, q[None])[0] for model in models)
        scale = np.sqrt(np.diag(soft))
        for C in between:
            for gain in (C - stiff, soft - C):
                # A wrench never finds a stiffer arm where a ring is set free: round-off.
                assert np.linalg.eigvalsh(gain / np.outer(scale, scale))[0] > -BALANCE
        assert soft[2, 2] > 1.5 * stiff[2, 2]  # open ends oval under distributed loads


# What a model takes from where


def _with_flanges(description: ModelDescription, link: str, **flanges: Coupling) -> ModelDescription:
    links = tuple(
        entry.model_copy(update={"flanges": flanges}) if entry.name == link else entry for entry in description.link
    )
    return description.model_copy(update={"link": links})


def test_the_description_chooses_and_the_caller_may_overrule(boom: Callable[..., ModelDescription]) -> None:
    plain = boom(length=0.15)
    chosen = _with_flanges(plain, "tube", tip="distributing")
    both, tip, none, overruled = (
        build_model(description, "shell", flanges=flanges).links[0]
        for description, flanges in (
            (chosen, "distributing"),
            (chosen, None),
            (plain, None),
            (chosen, "rigid"),
        )
    )
    assert both.flanges == {"root": "distributing", "tip": "distributing"}
    assert tip.flanges == {"root": "rigid", "tip": "distributing"}
    assert none.flanges == overruled.flanges == {"root": "rigid", "tip": "rigid"}
    np.testing.assert_array_equal(none.element.stiffness, overruled.element.stiffness)
    bending = [part.element.flexibility[2, 2] for part in (none, tip, both)]
    assert bending[0] * 1.0001 < bending[1]
    assert bending[1] * 1.0001 < bending[2]


@pytest.mark.slow
def test_all_flanges_of_the_bundled_arm_distributing(reachable: Draw, rng: Random) -> None:
    model = build_model(load_description("xr701"), "shell", flanges="distributing")
    assert all(set(link.flanges.values()) == {"distributing"} for link in all_links(model))
    assert [link.name for link in all_links(model)][-1] == "crank"
    q = reachable(model.robot, 1, rng)
    full = solve_shell_arm(model, q[0], np.eye(6))
    assert difference(full.displacement.T, compliance(model, q)[0]) < ROUND_OFF
    assert full.unknowns > 20_000


@pytest.mark.parametrize("links", ["beam", "shell"])
def test_flanges_of_an_interface_that_is_not_there(links: str) -> None:
    refuses(
        "M003",
        r"flanges of link upper-arm: got 'pin'; allowed: root, tip.*remove it",
        build_model,
        _with_flanges(load_description("xr701"), "upper-arm", pin="rigid"),
        links,
    )


def test_unknown_flanges() -> None:
    refuses(
        "M003",
        r"flanges: got 'welded'; allowed: rigid, distributing",
        build_model,
        load_description("xr701"),
        "shell",
        flanges="welded",
    )
