"""Static condensation: the superelement is the full mesh, seen from its interfaces."""

from __future__ import annotations

import numpy as np
import pytest

from fem.elements import beam
from fem.elements.condensation import Superelement, condense
from meshes import BeamMesh, link_beam_mesh
from robots import load_description
from robots.arrays import Integers
from robots.robot import robot_from

# A forearm with three interfaces (root, tip, pin of the bar), one with a kink, and a pedestal.
LINKS = [("xr701", "forearm"), ("kr60-3", "forearm"), ("tx200", "pedestal")]

# Round-off of a solve: eps = 2e-16 times the condition number of a beam mesh in metres and radians,
# up to 1e5 (measured 1e-12 at the worst).
ROUND_OFF = 2e-11


def _mesh(robot: str, link: str, per_segment: int = 4) -> BeamMesh:
    model = load_description(robot)
    entry = next(entry for entry in model.link if entry.name == link)
    return link_beam_mesh(model, robot_from(model), entry, per_segment)


def _condensed(mesh: BeamMesh) -> Superelement:
    nodes = np.array(list(mesh.interfaces.values()))
    return condense(mesh.name, tuple(mesh.interfaces), mesh.interface_points, beam.assemble(mesh), nodes)


def _interface_rows(mesh: BeamMesh) -> Integers:
    return (6 * np.array(list(mesh.interfaces.values()))[:, None] + np.arange(6)).ravel()


@pytest.mark.parametrize(("robot", "link"), LINKS)
def test_flexibility_is_the_full_solve_with_the_root_clamped(robot: str, link: str) -> None:
    mesh = _mesh(robot, link)
    rows = _interface_rows(mesh)[6:]
    K = beam.assemble(mesh).toarray()
    full = np.linalg.inv(K[6:, 6:])[np.ix_(rows - 6, rows - 6)]
    element = _condensed(mesh)
    assert element.interfaces == tuple(mesh.interfaces)
    np.testing.assert_allclose(element.flexibility, full, rtol=0, atol=ROUND_OFF * np.abs(full).max())


@pytest.mark.parametrize(("robot", "link"), LINKS)
def test_stiffness_gives_the_forces_of_the_full_mesh(robot: str, link: str) -> None:
    mesh = _mesh(robot, link)
    element = _condensed(mesh)
    K, rows = beam.assemble(mesh).toarray(), _interface_rows(mesh)
    inner = np.setdiff1d(np.arange(len(K)), rows)
    moved = np.random.default_rng(1).normal(size=len(rows))
    u = np.zeros(len(K))
    u[rows] = moved
    u[inner] = np.linalg.solve(K[np.ix_(inner, inner)], -K[np.ix_(inner, rows)] @ moved)
    force = K @ u
    np.testing.assert_allclose(element.stiffness @ moved, force[rows], rtol=0, atol=ROUND_OFF * np.abs(force).max())
    # Exact also in energy, not only at the interfaces.
    assert moved @ element.stiffness @ moved == pytest.approx(u @ K @ u, rel=ROUND_OFF)


@pytest.mark.parametrize(("robot", "link"), LINKS)
def test_schur_complement_and_clamped_solve_agree(robot: str, link: str) -> None:
    element = _condensed(_mesh(robot, link))
    product = element.stiffness[6:, 6:] @ element.flexibility
    # Entries mix N/m with N m/rad, but lengths are about 1 m: the identity's round-off is eps x condition.
    np.testing.assert_allclose(product, np.eye(len(product)), rtol=0, atol=1e-9)


@pytest.mark.parametrize(("robot", "link"), LINKS)
def test_six_rigid_modes_cost_no_energy(robot: str, link: str) -> None:
    element = _condensed(_mesh(robot, link))
    eigenvalues = np.linalg.eigvalsh(element.stiffness)
    # Zero up to round-off of the largest eigenvalue; the seventh is real.
    assert np.abs(eigenvalues[:6]).max() < 1e-11 * eigenvalues[-1]
    assert eigenvalues[6] > 1e-6 * eigenvalues[-1]
    for k in range(3):
        axis = np.eye(3)[k]
        shift = np.concatenate([np.concatenate([axis, np.zeros(3)]) for _ in element.points])
        turn = np.concatenate([np.concatenate([np.cross(axis, p), axis]) for p in element.points])
        for mode in (shift, turn):
            assert np.abs(element.stiffness @ mode).max() < 1e-11 * np.abs(element.stiffness).max()


@pytest.mark.parametrize(("robot", "link"), LINKS)
def test_matrices_are_symmetric(robot: str, link: str) -> None:
    element = _condensed(_mesh(robot, link))
    np.testing.assert_array_equal(element.stiffness, element.stiffness.T)
    np.testing.assert_array_equal(element.flexibility, element.flexibility.T)


def test_without_inner_nodes_nothing_is_condensed() -> None:
    mesh = _mesh("xr701", "upper-arm", 1)
    assert len(mesh.nodes) == 2
    element = _condensed(mesh)
    np.testing.assert_array_equal(element.stiffness, beam.assemble(mesh).toarray())
    f = beam.element_flexibility(mesh)[0]
    # The element's own flexibility, its axes being a permutation of the body's up to sign: the same
    # eigenvalues. Round-off of one inversion there and back.
    np.testing.assert_allclose(
        np.linalg.eigvalsh(element.flexibility), np.linalg.eigvalsh(f), rtol=0, atol=1e-10 * np.abs(f).max()
    )


def test_interfaces_may_be_listed_in_any_order_of_nodes() -> None:
    mesh = _mesh("xr701", "upper-arm")
    K, last = beam.assemble(mesh), len(mesh.nodes) - 1
    forth = condense("", ("root", "tip"), mesh.nodes[[0, last]], K, np.array([0, last]))
    back = condense("", ("root", "tip"), mesh.nodes[[last, 0]], K, np.array([last, 0]))
    swap = np.r_[6:12, 0:6]
    np.testing.assert_allclose(
        back.stiffness, forth.stiffness[np.ix_(swap, swap)], rtol=0, atol=ROUND_OFF * forth.stiffness.max()
    )
    # Clamped at the other end, a link still stretches and twists by the same amount.
    np.testing.assert_allclose(np.diag(back.flexibility)[[2, 5]], np.diag(forth.flexibility)[[2, 5]], rtol=ROUND_OFF)
