"""Solids from STEP files and closed surfaces, by Netgen."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import trimesh
from refusals import refuses

from fem.elements.solid import solid_volume
from meshes.solid_mesh import SolidMesh
from meshes.solids.link import SolidSettings, import_solid
from meshes.solids.tetrahedra import in_surface, open_step
from meshes.surfaces.rings import Interface
from robots import InputError

occ = pytest.importorskip("netgen.occ", reason="needs the extra solid")

AXIS = np.array([1.0, 0.0, 0.0])
ENDS = {"root": Interface(np.zeros(3), AXIS), "tip": Interface(np.array([0.3, 0.0, 0.0]), AXIS)}
SETTINGS = SolidSettings(2.1e11, 0.3, 0.03)


@pytest.fixture(scope="module")
def step(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A round bar along x, 300 mm long, R30, in mm."""
    path = tmp_path_factory.mktemp("step") / "bar.step"
    occ.Cylinder(occ.Pnt(0, 0, 0), occ.X, 30, 300).WriteStep(str(path))
    return path


def volume(nodes: np.ndarray, cells: np.ndarray) -> float:
    return float(solid_volume(SolidMesh("part", nodes, cells, 1.0, 0.3, {}))[0].sum())


@pytest.mark.slow
def test_a_step_file_is_in_mm_and_its_seats_are_whole_faces(step: Path) -> None:
    done = import_solid(step, ENDS, SETTINGS)
    assert volume(done.mesh.nodes, done.mesh.tetrahedra) == pytest.approx(np.pi * 0.03**2 * 0.3, rel=5e-3)
    for name, x in (("root", 0.0), ("tip", 0.3)):
        face = np.flatnonzero(np.abs(done.mesh.nodes[:, 0] - x) < 1e-9)
        np.testing.assert_array_equal(np.sort(done.mesh.interfaces[name]), face)


def test_a_wrong_unit_is_refused(step: Path) -> None:
    refuses("L002", "scale of bar", import_solid, step, ENDS, SolidSettings(2.1e11, 0.3), scale=1.0)


@pytest.mark.slow
def test_a_seat_that_is_not_there_is_refused(step: Path) -> None:
    away = {"root": ENDS["root"], "tip": Interface(np.array([0.3, 0.4, 0.0]), AXIS)}
    with pytest.raises(InputError, match="interface tip"):
        import_solid(step, away, SETTINGS)


def test_several_solids_are_refused(tmp_path: Path) -> None:
    both = occ.Compound([occ.Box((0, 0, 0), (1, 1, 1)), occ.Box((3, 0, 0), (4, 1, 1))])
    both.WriteStep(str(tmp_path / "two.step"))
    caught = refuses("L008", "solids", open_step, tmp_path / "two.step")
    assert caught.value == 2


def test_what_is_no_step_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "no.step").write_text("nothing of the kind")
    refuses("L008", r"no\.step", open_step, tmp_path / "no.step")


@pytest.mark.slow
def test_a_surface_is_filled_up_to_its_curvature() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    nodes, cells, _, _ = in_surface("ball", np.asarray(ball.vertices), np.asarray(ball.faces), 0.04)
    # Straight edges of 40 mm would lose 5 %.
    assert volume(nodes, cells) == pytest.approx(ball.volume, rel=0.01)


def test_without_netgen_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch, step: Path) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    caught = refuses("F013", "netgen", open_step, step)
    assert "stiffarm[solid]" in str(caught)
