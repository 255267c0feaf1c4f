"""The Python face: joint twists, imported arms, and pictures of what the shop floor's steps find."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from cli_runs import run_here
from urdf_arms import Arm as MadeArm
from urdf_arms import casing

import stiffarm as sa

PART = Path(__file__).resolve().parents[3] / "docs" / "examples" / "kr60_posture"
PNG = b"\x89PNG"


@pytest.mark.usefixtures("blank")
def test_an_identification_is_that_of_the_command_line(tmp_path: Path) -> None:
    found = sa.identify(sa.load("tx200"), synthetic=True, law="constant")
    asked = run_here("identify", "tx200", "--synthetic", "--law", "constant", "--json")
    assert asked.code == 0, asked.err
    assert asked.json == found.as_json
    assert found.arm is not None
    assert found.arm.model.link_kind == "rigid"
    assert not found.arm.joints_without_springs
    assert found.plot().png.startswith(PNG)


@pytest.mark.slow
def test_an_imported_arm_has_shells_and_its_folder(tmp_path: Path) -> None:
    urdf = MadeArm().write(tmp_path / "arm")
    made = sa.import_arm(urdf, size_mm=40, wall={"upper_arm": 10.0}, material="aluminium")
    frame = made.to_frame().set_index("link")
    assert list(frame.index) == ["column", "upper_arm", "forearm"]
    assert frame["wall_mm"]["upper_arm"] == 10.0
    assert made.as_json["links"][1]["wall_basis"] == "given"
    assert made.arm.model.link_kind == "shell"
    made.save(tmp_path / "out")
    files = {"model.toml", "meshes", "import.json", "import.csv", "import.png", "tip_compliance.png", "report.html"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == files | {"run.json"}


@pytest.mark.slow
def test_an_imported_link_is_that_of_the_command_line(tmp_path: Path) -> None:
    # The tx200's upper arm runs 0.95 m along x of its body; its joints turn about z.
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
    file = tmp_path / "upper arm.stl"
    casing(0.24, 0.3, -0.15, 1.1).apply_transform(turn).export(file)
    arm = sa.load("tx200")
    (link,) = [one.name for one in arm.description.link if one.body == "j2"]
    made = sa.import_arm(file, model=arm, link=link, size_mm=50)
    asked = run_here("import", file, "--out", tmp_path / "asked", "--model", "tx200", "--link", link, "--size-mm", "50")
    assert asked.code == 0, asked.err
    folder = made.save(tmp_path / "out")
    for name in ("model.toml", "import.csv", "import.png"):
        assert (folder / name).read_bytes() == (tmp_path / "asked" / name).read_bytes(), name
    assert list(made.to_frame()["link"]) == [link]
    assert made.arm.model.link_kind == "shell"
    assert not [one for one in arm.description.link if one.surface is not None], "the arm given is not changed"
    with pytest.raises(sa.InputError, match="link: got 'leg'"):
        sa.import_arm(file, model=arm, link="leg")


def test_a_length_that_is_none_is_refused(tmp_path: Path) -> None:
    urdf = MadeArm().write(tmp_path / "arm")
    with pytest.raises(sa.InputError, match=r"wall: upper_arm \(mm\): got 0"):
        sa.import_arm(urdf, wall={"upper_arm": 0.0})


@pytest.mark.slow
def test_what_the_shop_floor_finds_draws_itself(tmp_path: Path) -> None:
    arm = sa.load("kr60-3", links="rigid")
    path = tmp_path / "path.csv"
    path.write_text("\n".join((PART / "path.csv").read_text(encoding="utf-8").splitlines()[:12]), encoding="utf-8")
    posture = sa.posture(arm, path, cell=PART / "cell.toml", gamma=(-180, 180, 30))
    assert posture.plot("joints", tmp_path / "posture.png").png.startswith(PNG)
    program = sa.post(arm, path, cell=PART / "cell.toml", tolerance_um=100)
    program.save(tmp_path / "programs")
    assert program.plot().png.startswith(PNG)
    checked = sa.verify(arm, tmp_path / "programs" / "json" / "path.json", cell=PART / "cell.toml")
    assert checked.plot().png.startswith(PNG)


@pytest.mark.parametrize("call", ["posture", "place", "post"])
def test_a_file_with_several_tools_names_the_arguments_that_choose(tmp_path: Path, call: str) -> None:
    path, cell = tmp_path / "part.nc", PART / "cell.toml"
    path.write_text("G21 G90\nT1 M6\nG0 X0 Y0 Z9\nG1 X9 F60\nT2 M6\nG0 Z10\nG1 X0\nM30\n")
    arm = sa.load("kr60-3", links="rigid")
    calls = {
        "posture": lambda **more: sa.posture(arm, path, cell=cell, **more),
        "place": lambda **more: sa.place(arm, path, cell=cell, force=(1, 0, 0), **more),
        "post": lambda **more: sa.post(arm, path, cell=cell, **more),
    }
    with pytest.raises(sa.InputError, match=r"tool number 1; tool number 2.*tool_number"):
        calls[call]()
    with pytest.raises(sa.InputError, match="tool number of the tool path"):
        calls[call](tool_number=[3])
