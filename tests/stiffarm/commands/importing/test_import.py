"""`import`: a URDF with meshes becomes a model with one command, one file a link of a model; or a clear message."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import oracles
import pytest
import trimesh
from cli_runs import Command, Outcome, run_here, tree
from urdf_arms import FOREARM_M, SECTION_M, UPPER_M, Arm, casing

from fem import build_model
from meshes import load_shell, section_dimensions
from robots import load_description

COARSE = ("--size-mm", "40", "--wall-mm", "8", "--boss", "1")


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Outcome, Path]:
    folder = tmp_path_factory.mktemp("robot")
    out = folder / "model"
    arguments = (*COARSE, "--material", "aluminium", "--wall", "upper_arm=10", "--json")
    return run_here("import", Arm().write(folder / "arm"), "--out", out, *arguments), out


@pytest.mark.slow
def test_a_urdf_becomes_a_model_with_shell_links(imported: tuple[Outcome, Path]) -> None:
    outcome, out = imported
    assert outcome.code == 0, outcome.err
    description = load_description(out / "model.toml")
    assert [link.name for link in description.link] == ["column", "upper_arm", "forearm"]
    assert [link.body for link in description.link] == ["base", "j2", "j3"]
    walls = {link.name: link.surface.wall.si for link in description.link if link.surface}
    assert walls == {"column": 0.008, "upper_arm": 0.010, "forearm": 0.008}
    assert description.materials["aluminium"].youngs_modulus.si == 70e9
    for link in description.link:
        mesh = load_shell(link.surface.file, link.surface.sha256)
        assert trimesh.Trimesh(mesh.nodes, mesh.triangles, process=False).is_watertight
        assert "read" in link.surface.changes[0]
    assert (out / "import.png").stat().st_size > 10_000
    assert not list(out.glob(".partial*"))


def test_the_report_has_each_link_and_says_what_stays_rigid(imported: tuple[Outcome, Path]) -> None:
    outcome, out = imported
    content = outcome.json
    assert content == json.loads((out / "import.json").read_text(encoding="utf-8"))
    assert content["answer"].startswith("3 links became shells, 2 stay rigid;")
    links = {link["link"]: link for link in content["links"]}
    assert set(content["rigid"]) == {"carousel", "hand"}
    assert "0 mm apart" in content["rigid"]["carousel"]
    upper = links["upper_arm"]
    assert (upper["bodies"], upper["wrapped"], upper["wall_mm"]) == (2, True, 10.0)
    assert upper["open_edges"] == 6
    assert upper["minimum_angle_deg"] > 10.0
    assert "coordinates multiplied by 0.001, 0.001, 0.001" in upper["changes"]
    # The upper arm lies beside its joints, on their +y side at 0.25 - 0.1 m: held there, not on its far side.
    for ring in upper["rings"].values():
        assert "at +15" in ring["chosen"]
        assert 60.0 <= ring["radius_mm"] <= 120.0
    # A box of 10 mm wall: area times wall times density, with both ends. Elements of 40 mm take 12 mm off each of
    # its edges, (2 - sqrt 2) x 12 mm x 4.9 m of 0.66 m2: 5 %.
    a, b, length = SECTION_M[0] - 0.01, SECTION_M[1] - 0.01, UPPER_M + 0.19
    mass = 2 * (a * b + (a + b) * length) * 0.01 * 2700
    assert upper["casing_mass_kg"] == pytest.approx(mass, rel=0.08)
    assert upper["urdf_mass_kg"] == 60.0
    assert "link hand stays rigid" in " ".join(content["remarks"])


def test_the_beam_section_is_that_of_the_casing(imported: tuple[Outcome, Path]) -> None:
    _, out = imported
    (upper,) = [link for link in load_description(out / "model.toml").link if link.name == "upper_arm"]
    found = np.sort(section_dimensions(upper.section))
    # 5 % of the sides for the edges that elements of 40 mm cut off.
    np.testing.assert_allclose(found, np.sort([*SECTION_M, 0.010]), rtol=0.05)
    assert upper.section.wall.source == "derived"


@pytest.mark.slow
def test_the_imported_robot_bends_as_shells_and_as_beams(imported: tuple[Outcome, Path]) -> None:
    _, out = imported
    pose = ("--pose", "j2_deg=90", "--load", "fz_N=-500", "--json")
    results = {}
    for kind in ("shell", "beam"):
        outcome = run_here("simulate", out / "model.toml", "--links", kind, *pose)
        assert outcome.code == 0, outcome.err
        results[kind] = outcome.json
    shell, beam = (abs(results[kind]["dz_mm"]) for kind in ("shell", "beam"))
    # Discs on thin side walls give way where a beam's ends are held: the shell is softer, and not out of sight.
    assert beam < shell < 20.0 * beam


@pytest.mark.slow
def test_a_clean_prismatic_link_is_as_stiff_as_its_beam_through_the_whole_chain(tmp_path: Path) -> None:
    # Joints along the links at their very ends: both models hold the same sections.
    clean = casing(0.14, 0.14, 0.0, FOREARM_M)
    urdf = Arm(meshes={"forearm.ply": clean}).write(tmp_path / "arm")
    text = urdf.read_text(encoding="utf-8").replace('<axis xyz="0 1 0"/>', '<axis xyz="0 0 1"/>')
    urdf.write_text(text, encoding="utf-8")
    rigid = "column,carousel,upper_arm,hand"
    ratios = {}
    for repair in ("none", "wrap"):
        out = tmp_path / repair
        arguments = ("--repair", repair, "--rigid", rigid, "--size-mm", "12", "--wall-mm", "6")
        outcome = run_here("import", urdf, "--out", out, *arguments)
        assert outcome.code == 0, outcome.err
        description = load_description(out / "model.toml")
        (shell,), (beam,) = (build_model(description, kind).links for kind in ("shell", "beam"))
        ratios[repair] = np.diag(shell.element.flexibility) / np.diag(beam.element.flexibility)
    # Rigid ends over the first half element and half a wall: 2 % of 0.6 m less to bend, up to 5 % in bending.
    np.testing.assert_allclose(ratios["none"], 1.0, atol=0.05)
    # The wrap cuts up to 6 mm off the edges. The beam's section has lost their bending stiffness too, and as it is
    # a box with sharp edges, more of the torsional stiffness than the casing (measured 8 % in torsion, 3 % else).
    np.testing.assert_allclose(ratios["wrap"][:5], 1.0, atol=0.05)
    assert ratios["wrap"][5] == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_masses_that_are_fillings_are_left_out(tmp_path: Path) -> None:
    urdf = Arm(mass_upper=1.0).write(tmp_path / "arm")
    outcome = run_here("import", urdf, "--out", tmp_path / "out", *COARSE, "--rigid", "column,forearm")
    assert outcome.code == 0, outcome.err
    assert "masses of the URDF left out: lighter than the casings alone (upper_arm)" in outcome.err
    description = load_description(tmp_path / "out" / "model.toml")
    assert description.mass is None
    assert description.link[0].mass is None


@pytest.mark.slow
def test_all_links_that_fail_are_named_with_the_way_out_and_nothing_is_left(tmp_path: Path) -> None:
    two = trimesh.util.concatenate([casing(0.1, 0.1, 0, 0.2), casing(0.1, 0.1, 0.5, 0.7)])
    arm = Arm(meshes={"forearm.ply": two, "column.stl": casing(0.01, 0.01, 0, 0.3)}, upper_file="lost.stl")
    urdf = arm.write(tmp_path / "arm")
    outcome = run_here("import", urdf, "--out", tmp_path / "out", *COARSE)
    assert outcome.code == 2
    for words in (
        "3 problem(s)",
        "lost.stl",
        "mesh not found",
        "ROS_PACKAGE_PATH",
        "column",
        "surface forearm: no closing width by trial",
        "80 mm (grid): 2 separate bodies",
        "--close-mm",
        "--rigid NAME",
    ):
        assert words in outcome.err
    assert not (tmp_path / "out").exists()
    rest = run_here("import", urdf, "--out", tmp_path / "out", *COARSE, "--rigid", "column,upper_arm,j3")
    assert rest.code == 2  # then nothing is left to make a shell of
    assert "no link became a shell" in rest.err


def refused(folder: Path, arm: Arm, *arguments: str) -> str:
    urdf = arm.write(folder / "arm")
    before = tree(folder)
    outcome = run_here("import", urdf, "--out", folder / "out", *COARSE, *arguments)
    assert outcome.code == 2, outcome.err
    assert tree(folder) == before
    return outcome.err


ONE = ("--rigid", "column,forearm")


def test_millimetres_read_as_metres_are_noticed_either_way(tmp_path: Path) -> None:
    message = refused(tmp_path / "large", Arm(scale_upper=""), *ONE)
    assert "scale of upper_arm" in message
    assert "multiply scale by 0.001 " in message
    small = Arm(scale_upper='scale="0.000001 0.000001 0.000001"')
    message = refused(tmp_path / "small", small, *ONE)
    assert "multiply scale by 1000 " in message
    assert "<mesh ... scale=...>" in message


def test_bad_surfaces_are_refused_without_repair_and_each_says_why(tmp_path: Path) -> None:
    open_box = casing(0.16, 0.2, -0.1, 0.8).subdivide()
    open_box.update_faces(np.arange(len(open_box.faces)) > 8)
    meshes = {"upper_arm.stl": open_box.apply_scale(1000.0)}
    assert "is open" in refused(tmp_path / "open", Arm(meshes=meshes), *ONE, "--repair", "none")
    message = refused(tmp_path / "two", Arm(), *ONE, "--repair", "none")
    assert "surface upper_arm" in message


@pytest.mark.slow
def test_a_wall_that_the_casing_has_no_room_for_is_refused(tmp_path: Path) -> None:
    assert "wall 0.08 m" in refused(tmp_path, Arm(), *ONE, "--wall", "upper_arm=80")


def test_empty_and_unreadable_files_are_refused(tmp_path: Path) -> None:
    for name, text in (("empty.stl", ""), ("junk.obj", "not a surface")):
        arm = Arm(upper_file=name)
        (tmp_path / name / "arm" / "meshes").mkdir(parents=True)
        (tmp_path / name / "arm" / "meshes" / name).write_text(text, encoding="utf-8")
        assert f"surface {name}" in refused(tmp_path / name, arm, *ONE)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--wall", "elbow=5"), "--wall: link: got 'elbow'"),
        (("--wall", "upper_arm=thick"), "--wall: upper_arm"),
        (("--wall", "upper_arm=-1"), "greater than 0"),
        (("--rigid", "elbow"), "--rigid: link: got 'elbow'"),
        (("--material", "wood"), "--material: got 'wood'"),
        (("--youngs-modulus-GPa", "7e10"), "--youngs-modulus-GPa"),
        (("--poissons-ratio", "0.5"), "--poissons-ratio"),
        (("--wall-mm", "0"), "--wall-mm: got 0.0"),
        (("--size-mm", "nan"), "--size-mm"),
        (("--meshes", "both"), "--meshes: got 'both'"),
        (("--repair", "maybe"), "--repair: got 'maybe'"),
        (("--repair", "none,wrap"), "--repair: got 'none,wrap'"),
        (("--wrap", "foil"), "--wrap: got 'foil'"),
        (("--link", "upper_arm"), "--link: not for this SOURCE"),
        (("--tip", "nose"), "nose"),
    ],
)
def test_options_that_make_no_sense_are_refused(arguments: tuple[str, ...], words: str, tmp_path: Path) -> None:
    assert words in refused(tmp_path, Arm(), *arguments)


def test_collision_meshes_are_taken_when_asked_for(tmp_path: Path) -> None:
    assert "look for collision meshes" in refused(tmp_path, Arm(), "--meshes", "collision")


def test_sources_that_are_none(cli: Command, tmp_path: Path) -> None:
    assert "existing file" in cli("import", tmp_path / "none.urdf", "--out", "out").err
    (tmp_path / "part.iges").touch()
    assert ".urdf, .stl" in cli("import", tmp_path / "part.iges", "--out", "out").err
    casing(0.1, 0.1, 0, 0.5).export(tmp_path / "part.stl")
    message = cli("import", tmp_path / "part.stl", "--out", "out").err
    assert "--model MODEL --link NAME" in message


@pytest.mark.slow
def test_one_file_becomes_a_link_of_a_model(cli: Command, tmp_path: Path) -> None:
    # The tx200's upper arm runs 0.95 m along x of its body; its joints turn about z.
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
    file = tmp_path / "upper arm.stl"
    casing(0.24, 0.3, -0.15, 1.1).apply_transform(turn).apply_scale(1000.0).export(file)
    given = load_description("tx200")
    (link,) = [link.name for link in given.link if link.body == "j2"]
    arguments = ("--model", "tx200", "--link", link, "--size-mm", "50")
    wrong = cli("import", file, "--out", "out", *arguments)
    assert wrong.code == 2
    assert "multiply scale by 0.001" in wrong.err
    outcome = cli("import", file, "--out", "out", *arguments, "--scale", "0.001", "--json")
    assert outcome.code == 0, outcome.err
    description = load_description(tmp_path / "out" / "model.toml")
    (done,) = [one for one in description.link if one.name == link]
    assert done.surface is not None
    assert done.surface.wall.si == pytest.approx(section_dimensions(done.section)[-1])
    assert description.sources[done.surface.source] == "upper arm.stl, prepared by stiffarm import"
    assert [one.surface for one in description.link if one.name != link] == [None] * (len(given.link) - 1)
    assert outcome.json["links"][0]["link"] == link
    unknown = cli("import", file, "--out", "other", "--model", "tx200", "--link", "leg", "--scale", "0.001")
    assert unknown.code == 2
    assert "--link: got 'leg'" in unknown.err
    steel = cli("import", file, "--out", "other", *arguments, "--material", "steel")
    assert "--material: not for this SOURCE" in steel.err


@pytest.mark.slow
def test_alpha_wrap_gives_a_like_model(tmp_path: Path) -> None:
    oracles.load_apart("pymeshlab")
    urdf = Arm().write(tmp_path / "arm")
    outcome = run_here("import", urdf, "--out", tmp_path / "out", *COARSE, *ONE, "--wrap", "alpha", "--json")
    assert outcome.code == 0, outcome.err
    (upper,) = outcome.json["links"]
    assert any("alpha wrap" in line for line in upper["changes"])
