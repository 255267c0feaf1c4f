from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from refusals import refuses

from fem.elements import beam as fem_beam
from fem.elements.condensation import condense
from fem.elements.shell import shell_superelement
from meshes import BeamMesh, ShellMesh, casing_mesh, casing_size, crank_beam_mesh, link_beam_mesh
from robots import bundled_names, load_description
from robots.robot import robot_from
from robots.schema.description import Opening, Rim


class Casing(NamedTuple):
    """A bundled casing: its beam, and what its shell has beside it."""

    beam: BeamMesh
    openings: tuple[Opening, ...] = ()
    rim: Rim | None = None

    def mesh(self, refined: int = 1) -> ShellMesh:
        size = casing_size(self.beam, self.openings) / refined
        return casing_mesh(self.beam, size, openings=self.openings, rim=self.rim)


def _casings() -> list[Casing]:
    out = []
    for name in bundled_names():
        description = load_description(name)
        robot = robot_from(description)
        out += [Casing(link_beam_mesh(description, robot, link), link.opening, link.rim) for link in description.link]
        if robot.parallelogram is not None:
            out.append(Casing(crank_beam_mesh(description, robot)))
    return out


CASINGS = _casings()


def _straight(kind: str, dimensions: list[float], length: float = 1.0) -> BeamMesh:
    nodes = np.array([[0.0, 0.0, z] for z in np.linspace(0.0, length, 5)])
    return BeamMesh(
        name="test tube",
        nodes=nodes,
        elements=np.stack([np.arange(4), np.arange(1, 5)], axis=1),
        kind=kind,  # type: ignore[arg-type]
        dimensions=np.tile(np.array(dimensions), (4, 2, 1)),
        up=np.array([1.0, 0.0, 0.0]),
        youngs_modulus=210e9,
        poissons_ratio=0.3,
        interfaces={"root": 0, "tip": 4},
    )


def _diagonals(beam: BeamMesh, size: float | None = None) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[type-arg]
    shell = shell_superelement(casing_mesh(beam, size), beam.interface_points)
    nodes = np.array(list(beam.interfaces.values()))
    line = condense(beam.name, tuple(beam.interfaces), beam.interface_points, fem_beam.assemble(beam), nodes)
    return np.diag(shell.flexibility), np.diag(line.flexibility)


def test_area_and_mass_of_a_box_casing() -> None:
    mesh = casing_mesh(_straight("box", [0.3, 0.2, 0.008]))
    a, b, c, d = (mesh.quad_corners[:, i] for i in range(4))
    area = 0.5 * np.linalg.norm(np.cross(c - a, d - b), axis=1)
    # Mid-surface perimeter times length; a straight sweep is exact but for round-off.
    assert area.sum() == pytest.approx(2.0 * (0.292 + 0.192) * 1.0, rel=1e-12)
    assert (area * mesh.thickness).sum() == pytest.approx(2.0 * (0.292 + 0.192) * 0.008, rel=1e-12)


def test_rings_stand_on_the_interfaces() -> None:
    for casing in CASINGS:
        mesh = casing.mesh()
        assert list(mesh.interfaces) == list(casing.beam.interfaces)
        for ring, point in zip(mesh.interfaces.values(), casing.beam.interface_points, strict=True):
            # The middle of a ring's box is its centre: exact for boxes and for tubes of 4n elements around.
            corners = mesh.nodes[ring].min(axis=0), mesh.nodes[ring].max(axis=0)
            np.testing.assert_allclose(np.mean(corners, axis=0), point, atol=1e-9)


def test_long_box_tube_agrees_with_timoshenko() -> None:
    shell, line = _diagonals(_straight("box", [0.3, 0.3, 0.008]), size=0.02)
    # 1 %: warping and ovalling are held at the rigid end rings; the rest is thin-wall theory on both sides.
    np.testing.assert_allclose(shell, line, rtol=0.01)


@pytest.mark.parametrize(
    "casing",
    # Four times the nodes of the finer meshes that openings ask for take seconds.
    [pytest.param(c, id=c.beam.name, marks=[pytest.mark.slow] if c.openings else []) for c in CASINGS],
)
def test_bundled_links_are_within_two_percent_of_half_the_size(casing: Casing) -> None:
    shell, fine = (shell_superelement(casing.mesh(n), casing.beam.interface_points) for n in (1, 2))
    scale = np.sqrt(np.outer(np.diag(fine.flexibility), np.diag(fine.flexibility)))
    # 2 %: discretisation, as the casing's default size promises.
    assert (np.abs(shell.flexibility - fine.flexibility) / scale).max() < 0.02


def test_a_section_that_turns_at_a_kink_is_refused() -> None:
    description = load_description("kr60-3")
    robot = robot_from(description)
    forearm = next(link for link in description.link if link.name == "forearm")
    along_the_first_run = link_beam_mesh(description, robot, forearm.model_copy(update={"beam_up": (1.0, 0.0, 0.0)}))
    refuses("L009", "beam_up", casing_mesh, along_the_first_run)


def test_a_casing_twice_as_thick_is_half_as_flexible_in_membrane_directions() -> None:
    thin = _straight("tube", [0.3, 0.004])
    # Same mid-surface: the outer diameter grows by the wall's growth.
    thick = replace(thin, dimensions=np.tile(np.array([0.304, 0.008]), (4, 2, 1)))
    a, b = (np.diag(shell_superelement(casing_mesh(m), m.interface_points).flexibility) for m in (thin, thick))
    # 1 %: wall bending is not proportional to thickness, but a tube carries these loads as a membrane.
    np.testing.assert_allclose(a / b, 2.0, rtol=0.01)
