"""`stiffarm simulate --field`: files, figures and pictures of one pose, with and without OpenGL."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command, tree
from matplotlib.image import imread

from fem import build_model
from robots import InputError, load_description
from stiffarm.commands.simulate import field_picture, field_results
from stiffarm.commands.simulate.field_picture import DeformedArm, load_text, render_field
from stiffarm.commands.simulate.field_results import deformed_arm, pose_text
from stiffarm.pages.rendering import Picture, gl_available
from stiffarm.pages.scenes import corner_normals
from stiffarm.pages.style import OKABE_ITO

POSE = "q2_deg=5,q3real_deg=77.5,q5_deg=-40"
W = np.array([0.0, 0.0, -650.0, 0.0, 0.0, 0.0])
HEADING = {"heading": "An arm", "subtitle": "in a pose"}


@pytest.fixture(scope="module", autouse=True)
def coarse() -> Iterator[None]:
    """Shells of 12 elements around: what is tested here does not depend on how fine they are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("meshes.casings.AROUND", 12)
        patch.setattr("meshes.casings.AROUND_WITH_OPENINGS", 12)
        yield


@pytest.fixture(scope="module")
def arm(coarse: None) -> DeformedArm:
    description = load_description("xr701")
    model = build_model(description, "shell").with_springs({"j2": 5e5, "j3": 5e5})
    return deformed_arm(description, model, np.radians([20.0, 5.0, 77.5, 0.0, -40.0, 0.0]), W)


@pytest.mark.slow
def test_field_writes_file_pictures_and_budget(cli: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("STIFFARM_NO_GL", "1")
    outcome = cli("simulate", "kr60-3", "--pose", "q2_deg=-40,q3_deg=60", "--field", "--out", "out", "--json")
    assert outcome.code == 0, outcome.err
    names = {"field.vtu", "field.png", "energy_share.png", "budget.json", "simulation.json", "run.json"}
    names |= {"report.html", "parts.png", "simulation.csv"}
    assert set(tree(tmp_path / "out")) == names
    result = outcome.json
    assert result["links"] == "shell"
    assert result == json.loads((tmp_path / "out" / "simulation.json").read_text(encoding="utf-8"))
    assert set(result["field"]["files"]) < names
    assert "STIFFARM_NO_GL" in result["field"]["messages"][0]
    assert result["field"]["largest_von_mises_MPa"] > 0.0
    budget = json.loads((tmp_path / "out" / "budget.json").read_text(encoding="utf-8"))
    assert budget["pose_deg"]["q2_deg"] == -40.0
    parts = {part["part"]: part for part in budget["parts"]}
    moved_by = {row["part"]: row["dz_mm"] for row in result["by_part"]}
    assert parts.keys() == moved_by.keys() - {"total"}
    for name, part in parts.items():
        # Six significant digits; parts that carry nothing have round-off of either sign.
        moved = -moved_by[name]
        assert part["along_load_mm"] == pytest.approx(moved, rel=1e-5, abs=1e-9), name
    assert budget["along_load_mm"] == pytest.approx(-result["dz_mm"], rel=1e-5)
    for name in ("field.png", "energy_share.png"):
        assert imread(tmp_path / "out" / name)[..., :3].std() > 0.05


@pytest.mark.slow
def test_the_scale_asked_for_is_taken(cli: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    titles = []

    def draw(arm: DeformedArm, path: Path, *, heading: str, subtitle: str) -> Picture:
        titles.append((heading, subtitle))
        path.touch()
        return Picture(path, "pyvista", "")

    monkeypatch.setattr(field_results, "render_field", draw)
    pose = ("simulate", "xr701", "--pose", POSE, "--rigid-joints", "--field", "--out")
    shown = cli(*pose, "one", "--scale", "1")
    assert shown.code == 0, shown.err
    assert "deflection is drawn magnified 1 times" in shown.err
    assert "deflects most" in shown.err
    assert cli(*pose, "two", "--scale", "750", "--json").json["field"]["scale_factor"] == 750.0
    assert titles[0][0] == "ACMA XR701 under 650 N: motion drawn at true size"
    assert titles[1][0] == "ACMA XR701 under 650 N: motion drawn 750 times as large"
    assert titles[1][1].startswith("q2 5, q3real 77.5, q5 −40 deg, the others 0; the tool moves 0.")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ("--field --out out", ("--field", "a measurement table", "give --pose")),
        (f"--pose {POSE} --field", ("no folder", "give --out DIR")),
        (f"--pose {POSE} --field --links beam --out out", ("--links with --field", "beam", "--links shell")),
        (f"--pose {POSE} --field --links rigid --out out", ("--links with --field", "rigid")),
        (f"--pose {POSE} --scale 10 --out out", ("--scale", "only with --field")),
        (f"--pose {POSE} --field --scale 0 --out out", ("--scale", "greater than 0", "true size")),
        (f"--pose {POSE} --field --scale nan --out out", ("--scale", "greater than 0")),
    ],
)
def test_what_does_not_go_together_is_refused(
    cli: Command, tmp_path: Path, options: str, says: tuple[str, ...]
) -> None:
    outcome = cli("simulate", "xr701", *options.split())
    assert (outcome.code, outcome.out) == (2, "")
    for words in says:
        assert words in outcome.err
    assert outcome.err.count("stiffarm:") == 1
    assert tree(tmp_path) == {}


def test_a_model_calibrated_with_beams_needs_a_word(cli: Command, calibrated: Path) -> None:
    given = ("simulate", calibrated / "model.toml", "--pose", POSE, "--field", "--out", "out")
    refused = cli(*given)
    assert refused.code == 2
    assert "calibrated with links: got 'beam'" in refused.err
    assert "--links shell" in refused.err


def test_hubs_move_with_the_shells(arm: DeformedArm) -> None:
    still, moved = ({b.name: b.mesh for b in field_picture._moved_bodies(arm, s)} for s in (0.0, 100.0))
    assert {"base plate", "j2", "j3", "bar", "crank pin", "lever pin", "mounting plate"} <= set(still)
    assert not {"crank", "lever", "forearm", "pedestal"} & set(still)
    plates = [np.asarray(m["base plate"].vertices) for m in (still, moved)]
    # The ground holds the pedestal's root: no motion but round-off, mm.
    np.testing.assert_allclose(plates[1], plates[0], atol=1e-6)
    centres = [m["mounting plate"].vertices.mean(axis=0) for m in (still, moved)]
    # The plate's centre is some 10 mm from the tool point, which moves with it.
    shift = 100.0 * 1e3 * arm.fields.displacement[:3]
    np.testing.assert_allclose(centres[1] - centres[0], shift, atol=0.02 * np.linalg.norm(shift))
    start, end = arm.tool_mm
    np.testing.assert_allclose(end - start, arm.scale * 1e3 * arm.fields.displacement[:3], rtol=1e-9)


def test_the_serial_load_path_has_no_bar(arm: DeformedArm) -> None:
    links = tuple(link for link in arm.fields.links if link.name != "crank")
    serial = replace(arm, fields=replace(arm.fields, links=links))
    names = {body.name for body in field_picture._moved_bodies(serial, 1.0)}
    assert not {"bar", "crank pin", "lever pin"} & names
    assert "j3" in names


@pytest.fixture(scope="module")
def fallback(arm: DeformedArm, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("field") / "fallback.png"
    picture = render_field(arm, path, renderer="matplotlib", **HEADING)
    assert picture.renderer == "matplotlib"
    return path


@pytest.mark.slow
def test_the_picture_shows_arm_load_and_scale(fallback: Path) -> None:
    image = imread(fallback)[..., :3]
    assert image.shape[:2] == (1200, 1600)
    assert (np.concatenate([image[:6], image[-6:]]) == 1.0).all()  # nothing is cut off at the edge
    assert (image[:, :6] == 1.0).all()
    plot = image[150:1150, 60:1330]
    load = [int(OKABE_ITO["vermillion"][i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    assert (np.abs(plot - load).max(axis=2) < 0.02).mean() > 5e-4  # an arrow
    saturation = np.ptp(plot, axis=2)
    assert (saturation > 0.2).mean() > 0.03  # shells in colour
    assert ((saturation < 0.06) & (plot.mean(axis=2) < 0.6)).mean() > 0.01  # grey hubs, dashes, labels


@pytest.mark.slow
def test_pyvista_and_fallback_draw_alike(arm: DeformedArm, fallback: Path, tmp_path: Path) -> None:
    works, message = gl_available()
    if not works:
        pytest.skip(message)
    render_field(arm, tmp_path / "gl.png", renderer="pyvista", **HEADING)
    a, b = (imread(path)[..., :3] for path in (tmp_path / "gl.png", fallback))
    # As in test_rendering; sharp edges are found by two codes, which may smooth a strip of faces differently.
    assert (np.abs(a - b).max(axis=2) > 0.1).mean() < 0.015
    assert (np.abs(np.roll(a, 16, axis=1) - b).max(axis=2) > 0.1).mean() > 0.04


def test_normals_are_smooth_across_facets_and_not_across_edges() -> None:
    angle = 2.0 * np.pi * np.arange(32) / 32
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(32)], axis=1)
    nodes = np.concatenate([ring, ring + np.array([0.0, 0.0, 1.0])])
    i, j = np.arange(32), np.roll(np.arange(32), -1)
    triangles = np.concatenate([np.stack([i, j, j + 32], axis=1), np.stack([i, j + 32, i + 32], axis=1)])
    normals = corner_normals(nodes, triangles)
    radial = nodes[triangles] * [1.0, 1.0, 0.0]
    # A corner has three triangles, two of them on one side: their mean is a sixth of a facet's 11.25 deg off.
    assert np.einsum("mci,mci->mc", normals, radial).min() > np.cos(np.radians(11.25 / 6.0) * 1.01)
    fold = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    sharp = corner_normals(fold, np.array([[0, 1, 2], [1, 0, 3]]))
    assert sharp[0] == pytest.approx(np.tile([0.0, 0.0, 1.0], (3, 1)))
    assert sharp[1] == pytest.approx(np.tile([0.0, 1.0, 0.0], (3, 1)))


def test_words_for_pose_and_load() -> None:
    robot = build_model(load_description("kr60-3"), "rigid").robot
    assert pose_text(robot, np.zeros(6)) == "all joints at 0 deg"
    assert pose_text(robot, np.radians([1.0, 2, 3, 4, 5, 6.5])) == "q1 1, q2 2, q3 3, q4 4, q5 5, q6 6.5 deg"
    assert load_text(np.array([3.0, 4.0, 0.0, 0.0, 0.0, 20.0])) == "5 N, 20 N m"
    assert load_text(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 20.0])) == "20 N m"


def test_bad_requests_for_a_picture(arm: DeformedArm, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="oblique, side"):
        render_field(arm, tmp_path / "x.png", view="top", **HEADING)
    with pytest.raises(InputError, match="existing folder"):
        render_field(arm, tmp_path / "nowhere" / "x.png", renderer="matplotlib", **HEADING)
