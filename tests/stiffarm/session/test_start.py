"""What a command imports when it starts: only what it uses. Each runs in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from cli_runs import environment

# Prints the names of all modules that were loaded, after whatever the command itself prints on stdout.
CODE = """
import json, sys
from stiffarm.__main__ import main
try:
    main()
finally:
    print(json.dumps(sorted(sys.modules)))
"""
ROOT = Path(__file__).resolve().parents[3]
LIBRARIES = {"numpy", "scipy", "pandas", "pyvista", "matplotlib", "trimesh"}
HEAVY = {"pandas", "pyvista", "matplotlib", "trimesh", "sklearn", "skfem", "openpyxl", "SALib", "networkx", "numba"}
POSE = "q2_deg=5,q3real_deg=77.5"
KR60 = "q1_deg=10,q2_deg=-60,q3_deg=40,q5_deg=40"


def modules(*arguments: str | Path) -> set[str]:
    """Modules that a command loads."""
    run = subprocess.run(  # noqa: S603 - our own interpreter
        [sys.executable, "-c", CODE, *map(str, arguments)],
        env=environment(),
        capture_output=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return set(json.loads(run.stdout.splitlines()[-1]))


def loaded(found: set[str], names: set[str]) -> set[str]:
    """Which of some packages or modules are among those loaded."""
    return {name for name in names if any(m == name or m.startswith(f"{name}.") for m in found)}


@pytest.mark.parametrize("arguments", [("--help",), ("--version",)])
def test_help_and_version_load_no_library(arguments: tuple[str, ...]) -> None:
    assert loaded(modules(*arguments), LIBRARIES | HEAVY) == set()


@pytest.mark.slow
def test_a_query_loads_neither_the_arms_model_nor_scipy(fitted: Path) -> None:
    found = modules("query", fitted / "surrogate.json", "--pose", POSE)
    assert loaded(found, HEAVY | {"scipy", "meshes", "doe", "machining", "fem.model", "fem.elements"}) == set()


@pytest.mark.slow
def test_a_pose_is_simulated_without_tables_shells_and_pictures() -> None:
    found = modules("simulate", "xr701", "--pose", POSE)
    assert loaded(found, HEAVY | {"doe", "surrogate", "machining", "fem.elements.shell", "scipy.optimize"}) == set()


@pytest.mark.slow
def test_indices_load_neither_readings_nor_pictures() -> None:
    found = modules("index", "kr60-3", "--pose", KR60, "--tool", "200,0,80,0,90,0")
    assert loaded(found, HEAVY | {"doe", "surrogate", "fem.elements.shell", "scipy.optimize", "scipy.stats"}) == set()


@pytest.mark.slow
def test_robots_are_listed_without_their_mechanics() -> None:
    # The tables bundled with robots are listed too, so where they lie is asked, and nothing more of them.
    found = modules("robots")
    assert loaded(found, HEAVY | {"scipy", "fem", "surrogate", "machining"}) == set()
    assert loaded(found, {"doe.estimation", "doe.calibration", "doe.diagnosis", "doe.certainty"}) == set()


@pytest.mark.slow
def test_a_calibration_loads_neither_surrogates_nor_tables_of_others() -> None:
    found = modules("calibrate", "xr701", "--scheme", "global")
    assert loaded(found, HEAVY | {"surrogate", "machining"}) == set()


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("sensitivity", "xr701"),
        ("plan", "xr701", "--poses", "1", "--free", "j2.stiffness,j3.stiffness"),
        ("diagnose", "xr701", "--loads", "650", "--next", "0", "--folds", "0"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_what_asks_readings_loads_neither_maps_nor_the_shop_floor(arguments: tuple[str, ...]) -> None:
    rest = {"machining", "surrogate.fit", "fem.elements.shell"}
    assert loaded(modules(*arguments), HEAVY | rest) == set()


@pytest.mark.slow
def test_an_identification_loads_no_surfaces_and_no_surrogates(tmp_path: Path) -> None:
    made = ("identify", "tx200", "--synthetic", "--law", "constant", "--out", tmp_path / "out")
    modules(*made)
    found = modules("identify", "tx200", tmp_path / "out" / "synthetic_joint_twists.csv", "--law", "constant")
    assert loaded(found, (HEAVY - {"matplotlib"}) | {"machining", "surrogate", "fem.elements.shell"}) == set()


@pytest.mark.slow
def test_a_posture_without_a_cell_loads_bodies_and_no_pictures(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("x_mm,y_mm,z_mm,nx,ny,nz\n1000,0,600,0,0,1\n1010,0,600,0,0,1\n", encoding="utf-8")
    task = ("--tool", "200,0,80,0,90,0", "--gamma=-180:180:30")
    found = modules("posture", "kr60-3", path, "--links", "rigid", *task)
    # numba comes with the sweep over gamma where it is installed; the arm keeps above the floor that it stands on.
    assert loaded(found, (HEAVY - {"numba", "trimesh", "networkx"}) | {"surrogate"}) == set()


@pytest.mark.slow
def test_a_map_without_pictures_loads_what_computes_only(tmp_path: Path) -> None:
    ranges = ("--x", "900:1300:400", "--z", "600:1000:400")
    found = modules("map", "slice", "kr60-3", "--links", "rigid", *ranges, "--no-pictures", "--out", tmp_path / "out")
    # The compiled loops are numba's, and the map's file is VTK's.
    assert loaded(found, (HEAVY - {"numba", "skfem", "pyvista"}) | {"scipy.stats", "machining.cell", "doe"}) == set()


@pytest.mark.slow
def test_programs_are_written_without_renderers_and_surrogates(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("x_mm,y_mm,z_mm,nx,ny,nz\n1000,0,600,0,0,1\n1010,0,600,0,0,1\n", encoding="utf-8")
    task = ("--links", "rigid", "--tool", "200,0,80,0,90,0", "--format", "json", "--out", tmp_path / "out")
    # The cell's solids are trimesh's, the report's figures are matplotlib's.
    mine = {"matplotlib", "trimesh", "networkx", "numba"}
    assert loaded(modules("post", "kr60-3", path, *task), (HEAVY - mine) | {"surrogate"}) == set()


@pytest.mark.slow
def test_a_program_is_verified_and_a_base_placed_without_renderers(tmp_path: Path) -> None:
    part = ROOT / "docs" / "examples" / "kr60_posture"
    program, out = tmp_path / "out" / "json" / "path.json", ("--out", tmp_path / "out")
    path = tmp_path / "path.csv"
    path.write_text("\n".join((part / "path.csv").read_text(encoding="utf-8").splitlines()[:4]), encoding="utf-8")
    cell = ("--cell", part / "cell.toml")
    modules("post", "kr60-3", path, *cell, "--links", "rigid", "--format", "json", *out)
    # Distances between solids are trimesh's.
    rest = (HEAVY - {"trimesh", "networkx", "numba"}) | {"doe", "surrogate"}
    assert loaded(modules("verify", "kr60-3", program, *cell), rest) == set()
    on_rail = tmp_path / "cell.toml"
    axis = '[[linear_axis]]\nname = "rail"\nlimits_mm = [0, 200]\ndirection = [1, 0, 0]\n'
    on_rail.write_text((part / "cell.toml").read_text(encoding="utf-8") + axis, encoding="utf-8")
    task = ("--cell", on_rail, "--force", "80,40,-60", "--gamma=-180:180:30", "--links", "rigid")
    # What place says in its table stands with its report's figures, and its map of the axes is a field of a map.
    assert loaded(modules("place", "kr60-3", path, *task), rest - {"doe", "matplotlib", "surrogate"}) == set()
