"""Where a shell's energy sits and how its wall bends tells a sound link from one held by too little."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from fem.elements.trust import trust_in
from meshes import ShellMesh
from meshes.surfaces.remesh import remesh

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
