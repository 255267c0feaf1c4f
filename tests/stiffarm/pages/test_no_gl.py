"""Commands on a machine without any OpenGL library: simulated for real, by hiding the libraries from a process.

VTK ends its process with a segmentation fault there, which no ``except`` catches. In a mount namespace of their own
the libraries' files are replaced by an empty one, which the loader refuses as it would a missing one.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from cli_runs import ROOT, environment
from matplotlib.image import imread
from small_robot import write_readings, write_urdf
from verify_cases import cell_file, program_at, program_file

# What VTK loads, by the names in its error messages, and what these load in turn.
HIDE = """
for d in /lib /lib64 /usr/lib /usr/lib64 /usr/local/lib; do
  [ -d "$d" ] || continue
  for f in $(find "$d/" -maxdepth 3 -type f \\( -name 'libGL.so*' -o -name 'libGLX*.so*' -o -name 'libEGL*.so*' \\
      -o -name 'libOpenGL.so*' -o -name 'libOSMesa*.so*' -o -name 'libGLdispatch.so*' \\)); do
    mount --bind /dev/null "$f" || exit 97
  done
done
exec "$@"
"""
TRIAL = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(16, 16))
plotter.add_mesh(pyvista.Sphere())
plotter.screenshot(None, return_img=True)
"""
NO_PERMISSION = "mount namespaces are not permitted here"


def namespace() -> list[str]:
    """The beginning of a command that runs another one without OpenGL libraries."""
    unshare = shutil.which("unshare")
    if unshare is None:
        pytest.skip("no unshare here")
    for options in (["-m"], ["-r", "-m"]):
        begin = [unshare, *options, "sh", "-c", HIDE, "sh"]
        if subprocess.run([*begin, "true"], capture_output=True, check=False).returncode == 0:  # noqa: S603
            return begin
    pytest.skip(NO_PERMISSION)
    raise AssertionError


def without_gl(*command: str | Path) -> subprocess.CompletedProcess[str]:
    variables = {k: v for k, v in environment(OMP_NUM_THREADS="1").items() if k != "STIFFARM_NO_GL"}
    return subprocess.run(  # noqa: S603
        [*namespace(), sys.executable, *map(str, command)],
        capture_output=True,
        text=True,
        check=False,
        env=variables,
        cwd=ROOT,
        timeout=300,
    )


def said(outcome: subprocess.CompletedProcess[str]) -> int:
    """How often the missing package is named; nothing of VTK's own warnings may come through."""
    assert "vtk" not in outcome.stderr
    assert "Traceback" not in outcome.stderr
    return outcome.stderr.count("libosmesa6 (apt-get")


def painted(path: Path) -> float:
    """Share of a picture's pixels that are not white."""
    return float((imread(path)[..., :3].min(axis=2) < 0.95).mean())


@pytest.mark.slow
def test_vtk_crashes_there_so_the_simulation_is_true() -> None:
    # Ended by a signal: as a child of sh it shows as 128 + 11 or as -11.
    assert without_gl("-c", TRIAL).returncode in (-11, 139)


@pytest.mark.slow
def test_map_is_drawn_by_the_fallback_and_names_the_package_once(tmp_path: Path) -> None:
    outcome = without_gl("-m", "stiffarm", "map", "joints", "kr60-3", "--points", "5", "--out", tmp_path / "out")
    assert outcome.returncode == 0, outcome.stderr
    assert said(outcome) == 1
    pictures = sorted((tmp_path / "out").glob("*.png"))
    assert pictures
    # Robot and points: a blank picture with its bar has about a fiftieth painted.
    assert all(painted(p) > 0.05 for p in pictures if "oblique" in p.name or "side" in p.name)


@pytest.mark.slow
def test_map_of_a_box_with_surfaces(tmp_path: Path) -> None:
    ranges = ("--x", "600:1600:200", "--y", "-400:400:200", "--z", "200:1000:200")
    values = ("--values", "stiffness,softest", "--pose", "fixed", "--tool-axis", "0,0,1")
    outcome = without_gl("-m", "stiffarm", "map", "box", "kr60-3", *ranges, *values, "--out", tmp_path / "out")
    assert outcome.returncode == 0, outcome.stderr
    assert said(outcome) == 1
    assert painted(tmp_path / "out" / "map_stiffness_N_per_mm_surfaces.png") > 0.05


@pytest.mark.slow
def test_field_of_a_pose(tmp_path: Path) -> None:
    pose = ("--pose", "q2_deg=-70,q3_deg=60", "--load", "fz_N=-650")
    outcome = without_gl("-m", "stiffarm", "simulate", "kr60-3", *pose, "--field", "--out", tmp_path / "out")
    assert outcome.returncode == 0, outcome.stderr
    assert said(outcome) == 1
    assert painted(tmp_path / "out" / "field.png") > 0.05


@pytest.mark.slow
def test_picture_of_an_offence(tmp_path: Path) -> None:
    cell = cell_file(tmp_path)
    program = program_file(tmp_path, program_at(cell, 21, 0.102))
    outcome = without_gl("-m", "stiffarm", "verify", "kr60-3", program, "--cell", cell, "--out", tmp_path / "out")
    # 1: the program must not run, as on any machine.
    assert outcome.returncode == 1, outcome.stderr
    assert said(outcome) == 1
    assert painted(tmp_path / "out" / "worst_offence.png") > 0.05


@pytest.mark.slow
def test_the_whole_chain(tmp_path: Path) -> None:
    urdf = write_urdf(tmp_path / "small.urdf")
    given = urdf, write_readings(urdf, tmp_path / "readings.csv", poses=3)
    options = ("--points", "2", "--no-rehearse", "--out", tmp_path / "out")
    outcome = without_gl("-m", "stiffarm", "run", *given, *options)
    assert outcome.returncode == 0, outcome.stderr
    assert said(outcome) == 1
    assert (tmp_path / "out" / "report.html").is_file()
