"""`import` of STEP files and of meshes of the material itself: links that `--links solid` takes as solids."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from cli_runs import run_here

from fem import build_model
from robots import load_description

occ = pytest.importorskip("netgen.occ", reason="needs the extra solid")

# A bar of 300 x 40 x 40 mm between two discs, all along x.
URDF = """<robot name="bar">
  <link name="stand"><visual><origin xyz="-0.02 0 0" rpy="0 1.5707963 0"/>
    <geometry><cylinder radius="0.03" length="0.04"/></geometry></visual></link>
  <link name="arm"><visual><geometry><mesh filename="arm.stl"/></geometry></visual></link>
  <link name="hand"><visual><origin xyz="0.02 0 0" rpy="0 1.5707963 0"/>
    <geometry><cylinder radius="0.03" length="0.04"/></geometry></visual></link>
  <joint name="one" type="revolute"><parent link="stand"/><child link="arm"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="two" type="revolute"><parent link="arm"/><child link="hand"/><origin xyz="0.3 0 0"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


@pytest.mark.slow
def test_a_step_file_of_a_link_becomes_its_solid(tmp_path: Path) -> None:
    bar = trimesh.creation.box((0.3, 0.04, 0.04))
    bar.apply_translation((0.15, 0.0, 0.0))
    bar.export(tmp_path / "arm.stl")
    (tmp_path / "bar.urdf").write_text(URDF)
    occ.Box((0, -20, -20), (300, 20, 20)).WriteStep(str(tmp_path / "arm.step"))
    out = tmp_path / "model"
    given = ("--step", f"arm={tmp_path / 'arm.step'}", "--size-mm", "20", "--wall-mm", "3", "--json")
    outcome = run_here("import", tmp_path / "bar.urdf", "--out", out, *given)
    assert outcome.code == 0, outcome.err
    assert outcome.json["solids"][0]["mass_kg"] == pytest.approx(7850 * 0.3 * 0.04**2, rel=1e-3)
    link = build_model(load_description(str(out / "model.toml")), "solid").links[0]
    # Bending by a moment at the tip, which held ends hinder a little.
    inertia = 0.04**4 / 12.0
    assert np.diag(link.element.flexibility)[4:] == pytest.approx(0.3 / (2.1e11 * inertia), rel=0.03)


def test_a_step_file_of_no_link_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bar.urdf").write_text(URDF)
    outcome = run_here("import", tmp_path / "bar.urdf", "--out", tmp_path / "out", "--step", "arm")
    assert outcome.code == 2
    assert "--step" in outcome.err
