"""Beam meshes of links: where the nodes are, how the section runs, what the interfaces are."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refuses

from meshes import BeamMesh, crank_beam_mesh, link_beam_mesh
from robots import ModelDescription, load_description
from robots.library.models import parse_description
from robots.robot import robot_from

# Interpolation along a centre line of about 1 m.
ROUND_OFF_M = 1e-14


def _mesh(model: ModelDescription, link: str, per_segment: int = 4) -> BeamMesh:
    entry = next(entry for entry in model.link if entry.name == link)
    return link_beam_mesh(model, robot_from(model), entry, per_segment)


def _span(mesh: BeamMesh) -> np.ndarray:
    return np.linalg.norm(np.diff(mesh.nodes[mesh.elements], axis=1)[:, 0], axis=1)


def test_a_straight_link_runs_from_its_joint_to_the_next() -> None:
    mesh = _mesh(load_description("xr701"), "upper-arm", 5)
    assert list(mesh.interfaces) == ["root", "tip"]
    np.testing.assert_allclose(mesh.interface_points, [[0, 0, 0], [0, 0, 1.10]], atol=ROUND_OFF_M)
    np.testing.assert_allclose(_span(mesh), 0.22, atol=ROUND_OFF_M)
    np.testing.assert_array_equal(mesh.elements, [[0, 1], [1, 2], [2, 3], [3, 4], [4, 5]])


def test_the_section_tapers_linearly_along_the_whole_link() -> None:
    mesh = _mesh(load_description("xr701"), "upper-arm")
    np.testing.assert_allclose(mesh.dimensions[0, 0], [0.24, 0.34, 0.01], rtol=1e-14)
    np.testing.assert_allclose(mesh.dimensions[-1, 1], [0.22, 0.28, 0.01], rtol=1e-14)
    np.testing.assert_allclose(mesh.dimensions[1, 1], [0.23, 0.31, 0.01], rtol=1e-14)
    # Neighbours share the station, so they share its section exactly.
    np.testing.assert_array_equal(mesh.dimensions[:-1, 1], mesh.dimensions[1:, 0])


def test_via_points_are_nodes() -> None:
    mesh = _mesh(load_description("kr60-3"), "forearm")
    corner = np.linalg.norm(mesh.nodes - [0.145, 0.0, 0.0], axis=1)
    assert corner.min() < ROUND_OFF_M
    assert len(mesh.elements) == 8
    tip = mesh.nodes[mesh.interfaces["tip"]]
    assert _span(mesh).sum() == pytest.approx(0.145 + np.linalg.norm(tip - [0.145, 0, 0]), rel=1e-14)


def test_the_driven_link_carries_the_lever_of_the_bar() -> None:
    mesh = _mesh(load_description("xr701"), "forearm")
    assert list(mesh.interfaces) == ["root", "tip", "pin"]
    np.testing.assert_allclose(mesh.interface_points, [[0, 0, 0], [0, 0, 1.25], [0, 0, -0.40]], atol=ROUND_OFF_M)
    # The lever starts at the root and keeps the root's section.
    lever = mesh.elements[4:]
    assert lever[0, 0] == mesh.interfaces["root"]
    np.testing.assert_allclose(mesh.dimensions[4:], np.broadcast_to([0.32, 0.32, 0.01], (4, 2, 3)), rtol=1e-14)


def test_the_crank_goes_to_the_bars_pin() -> None:
    model = load_description("xr701")
    mesh = crank_beam_mesh(model, robot_from(model), 3)
    np.testing.assert_allclose(mesh.interface_points, [[0, 0, 0], [0, 0, -0.40]], atol=ROUND_OFF_M)
    # The section's height lies in the plane in which the crank bends, that is across its axis (y).
    assert abs(mesh.up @ [0.0, 1.0, 0.0]) < ROUND_OFF_M


def test_a_robot_without_a_parallelogram_has_no_crank() -> None:
    model = load_description("kr60-3")
    refuses("R002", "no parallelogram", crank_beam_mesh, model, robot_from(model))


def test_a_link_of_length_zero_is_refused() -> None:
    model = load_description("xr701")
    # Body j4's next joint sits at the same point: there is nothing to mesh.
    entry = next(link for link in model.link if link.name == "wrist").model_copy(update={"body": "j4"})
    refuses("L007", r"length zero.*remove the link", link_beam_mesh, model, robot_from(model), entry)


def test_repeated_points_make_no_empty_elements() -> None:
    text = """
schema = "stiffarm-model/1"
name = "stub"
title = "one joint, one link with a via point on its root"
sources = {}
[materials.steel]
youngs_modulus = { value = 206, unit = "GPa", source = "assumed" }
poissons_ratio = { value = 0.3, unit = "1", source = "assumed" }
density = { value = 7850, unit = "kg/m^3", source = "assumed" }
[[joint]]
name = "j1"
coordinate = "q1_deg"
limits = { value = [-90, 90], unit = "deg", source = "assumed" }
frame = { xyz = { value = [0, 0, 0], unit = "m", source = "assumed" } }
[flange]
xyz = { value = [1, 0, 0], unit = "m", source = "assumed" }
[[link]]
name = "link"
body = "j1"
material = "steel"
via = [{ value = [0, 0, 0], unit = "m", source = "assumed" }]
[link.section]
kind = "tube"
diameter = { value = 100, unit = "mm", source = "assumed" }
wall = { value = 10, unit = "mm", source = "assumed" }
"""
    mesh = _mesh(parse_description(text, "stub"), "link")
    np.testing.assert_allclose(_span(mesh), 0.25, rtol=1e-14)
