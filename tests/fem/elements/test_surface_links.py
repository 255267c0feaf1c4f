"""Links whose prepared surface takes the casing's place in the model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from refusals import refuses

from fem import build_model, deflection, solve_shell_arm
from meshes import casing_mesh, save_shell
from robots import ModelDescription
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
