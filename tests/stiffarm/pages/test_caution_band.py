"""Pictures and pages of a model with joints held rigid for want of a spring say so; those of other models do not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from cli_runs import Command
from figure_texts import drawn_meanwhile
from matplotlib.figure import Figure
from matplotlib.image import imread
from PIL import Image  # type: ignore[import-not-found, unused-ignore]

from fem.arm import Arm
from robots import load_description
from stiffarm.pages.report import render
from stiffarm.pages.style import new_figure, save_png
from stiffarm.session.caution import caution, cautioned, uncalibrated

SPRINGS = [f"--set=j{k}.stiffness=1e6" for k in range(1, 7)]
SLICE = ("--x", "1000:2200:400", "--z", "400:1600:400", "--pose", "fixed", "--values", "stiffness")
WORDS = "held rigid for want of a spring: j1"


@contextmanager
def pictures_saved() -> Iterator[dict[str, list[str]]]:
    """What is written on each figure while it is saved, by the end of its file's name."""
    found: dict[str, list[str]] = {}
    original = Figure.savefig

    def savefig(self: Figure, fname: Any, **more: Any) -> None:
        with drawn_meanwhile() as texts:
            original(self, fname, **more)
        found[f"{len(found)} {more['format']}"] = texts

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", savefig)
        yield found


def said(path: Path) -> str | None:
    """What a PNG's own table warns of."""
    with Image.open(path) as image:
        return image.info.get("Warning")


def together(texts: list[str]) -> str:
    return " ".join(" ".join(texts).split())


def a_figure() -> Figure:
    figure, (ax,) = new_figure("single")
    ax.plot([0.0, 1.0], [1.0, 2.0])
    return figure


def test_the_band_is_above_the_picture_which_stays_as_it_is(tmp_path: Path) -> None:
    figure = a_figure()
    save_png(figure, tmp_path / "plain.png")
    with cautioned(WORDS), pictures_saved() as texts:
        save_png(figure, tmp_path / "warned.png")
    save_png(figure, tmp_path / "again.png")
    plain, warned = imread(tmp_path / "plain.png"), imread(tmp_path / "warned.png")
    taller = len(warned) - len(plain)
    assert 20 < taller < 100
    assert warned.shape[1] == plain.shape[1]
    # To a pixel: the band need not end on one.
    assert abs(warned[taller + 1 : -1] - plain[1:-1]).mean() < 0.01
    assert WORDS in together(*texts.values())
    assert said(tmp_path / "warned.png") == WORDS
    assert said(tmp_path / "plain.png") is said(tmp_path / "again.png") is None
    assert (imread(tmp_path / "again.png") == plain).all()


def test_a_long_warning_is_broken_into_lines_within_the_picture(tmp_path: Path) -> None:
    with cautioned(" ".join([WORDS] * 8)), drawn_meanwhile() as texts:
        save_png(a_figure(), tmp_path / "warned.png")
    band = [text for text in texts if WORDS in " ".join(text.split())][-1]
    assert band.count("\n") >= 3
    assert caution() == ""


def test_the_warning_names_the_joints() -> None:
    arm = Arm.of(load_description("xr701"))
    assert "no joint" in uncalibrated(arm)
    model = arm.model.with_springs(dict.fromkeys(("j2", "j3", "j4", "j5"), 1000000.0))
    some = Arm(arm.description, arm.robot, model)
    assert "j1 and j6 are" in uncalibrated(some)
    assert uncalibrated(Arm(arm.description, arm.robot, model.with_springs({"j1": 1e6, "j6": 1e6}))) == ""


@pytest.mark.slow
def test_every_picture_and_page_of_a_map_warns(cli: Command, tmp_path: Path) -> None:
    with pictures_saved() as texts:
        outcome = cli("map", "slice", "xr701", *SLICE, "--html", "--out", "out", "--json")
    assert outcome.code == 0, outcome.err
    (warning,) = outcome.json["remarks"]
    assert warning == uncalibrated(Arm.of(load_description("xr701")))
    pngs = sorted((tmp_path / "out").glob("*.png"))
    assert pngs
    assert {said(png) for png in pngs} == {warning}
    assert texts
    assert all(warning in together(seen) for seen in texts.values())
    page = (tmp_path / "out" / "map.html").read_text(encoding="utf-8")
    assert f'<p id="caution" role="note">{warning}</p>' in page


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ("map", "joints", "xr701", "--points", "2"),
        ("map", "index", "xr701", "--x", "1200:1600:400", "--y", "0:400:400", "--z", "900", "--gamma", "0:90:90"),
        ("index", "xr701", "--pose", "q2_deg=5,q3real_deg=77.5"),
    ],
)
def test_other_commands_warn_too(
    command: tuple[str, ...], cli: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STIFFARM_NO_GL", "1")
    outcome = cli(*command, "--out", "out", "--json")
    assert outcome.code == 0, outcome.err
    pngs = sorted((tmp_path / "out").glob("*.png"))
    assert pngs
    assert all("no joint" in (said(png) or "") for png in pngs)


@pytest.mark.slow
def test_the_deformed_arm_warns(cli: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshes.casings.AROUND", 12)
    monkeypatch.setattr("meshes.casings.AROUND_WITH_OPENINGS", 12)
    monkeypatch.setenv("STIFFARM_NO_GL", "1")
    pose = ("simulate", "xr701", "--pose", "q2_deg=5,q3real_deg=77.5", "--field", "--out")
    outcome = cli(*pose, "out", "--json")
    assert outcome.code == 0, outcome.err
    pngs = sorted((tmp_path / "out").glob("*.png"))
    assert len(pngs) == 3
    assert all("no joint" in (said(png) or "") for png in pngs)
    # What gives most in the structure is not what gives most in the arm.
    assert "all joints rigid" in outcome.json["field"]["budget"]["leader"]


@pytest.mark.slow
def test_a_model_with_all_its_springs_has_no_band(cli: Command, tmp_path: Path) -> None:
    outcome = cli("map", "slice", "xr701", *SLICE, *SPRINGS, "--html", "--out", "out", "--json")
    assert outcome.code == 0, outcome.err
    assert "warning" not in outcome.json or outcome.json["warning"] is None
    assert all(said(png) is None for png in (tmp_path / "out").glob("*.png"))
    assert 'id="caution"' not in (tmp_path / "out" / "map.html").read_text(encoding="utf-8")


def test_a_report_says_it_before_its_title() -> None:
    with cautioned("<b>joints</b> are rigid"):
        page = render("t", "l", (), (), "f")
    assert page.index("&lt;b&gt;joints&lt;/b&gt; are rigid") < page.index("<h1>")
    assert 'class="caution"' not in render("t", "l", (), (), "f")
