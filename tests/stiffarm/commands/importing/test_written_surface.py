"""What a model file says of a shell that was made."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from meshes.shell_mesh import ShellMesh
from meshes.surfaces.walls import Wall
from stiffarm.commands.importing.results import written_surface


def made(times: float, basis: str) -> Any:
    """A box of 100 mm whose walls are 6 mm, ``times`` as thick where the mesh is."""
    corners = np.array([[x, y, z] for z in (0.0, 0.1) for x, y in ((0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1))])
    quads = np.array([[i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i] for i in range(4)])
    rings = {"root": np.arange(4), "tip": np.arange(4, 8)}
    mesh = ShellMesh("box", corners, np.zeros((0, 3), int), quads, np.full(4, 0.006 * times), 2.1e11, 0.3, rings)
    link = SimpleNamespace(mesh=mesh, figures=SimpleNamespace(size_m=0.02), report=())
    return SimpleNamespace(name="box", link=link, wall=0.006, basis=Wall(0.006, basis, "words"))


@pytest.mark.parametrize(("times", "wall_mm"), [(1.0, 6.0), (2.5, 15.0)])
def test_a_link_that_is_all_boss_has_the_bosses_wall(times: float, wall_mm: float, tmp_path: Path) -> None:
    """Its mesh has no place with the barrel's wall, and a model file is checked against its mesh."""
    assert written_surface(made(times, "mass"), tmp_path, "a").wall.value == pytest.approx(wall_mm)


@pytest.mark.parametrize(("basis", "source"), [("given", "definition"), ("mass", "assumed"), ("assumed", "assumed")])
def test_only_a_wall_that_was_given_is_known(basis: str, source: str, tmp_path: Path) -> None:
    assert written_surface(made(1.0, basis), tmp_path, "a").wall.source == source
