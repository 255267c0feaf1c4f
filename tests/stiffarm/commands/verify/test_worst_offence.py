"""The worst offence comes first: in the file, on the page, in its first picture and in the replay."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command
from PIL import Image
from verify_cases import cell_file, program_at, program_file

from machining.cell import arm_of
from machining.verification import Demands, Kind, Severity, Verification, contact_of, verify, worst_first
from stiffarm.commands.verify.command import drawn_offences
from stiffarm.commands.verify.picture import draw_offence, spot_of, view_of
from stiffarm.commands.verify.replay import replay_data
from stiffarm.pages.sight import towards, unhidden
from stiffarm.pages.style import save_png


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Verification:
    """Too near to the clamp in line 45, into it in line 47, and too near again in line 57."""
    program = program_at(cell_file(tmp_path_factory.mktemp("worst")), 61, 0.102)
    return verify(program, arm_of("kr60-3"), Demands(tolerance=2e-4, safety=0.01))


def test_a_collision_comes_before_what_is_earlier_and_milder(found: Verification) -> None:
    assert found.offences[0].kind is Kind.CLEARANCE
    assert (found.ranked[0].kind, found.ranked[0].line) == (Kind.COLLISION, 47)
    ranks = [list(Kind).index(o.kind) for o in found.ranked if o.severity is Severity.ERROR]
    assert ranks == sorted(ranks)
    assert set(found.ranked) == set(found.offences)


def test_warnings_come_last_and_larger_excess_first(tmp_path: Path) -> None:
    found = verify(program_at(cell_file(tmp_path), 21, 0.102), arm_of("kr60-3"), Demands(tolerance=1e-6))
    some = next(o for o in found.offences if o.kind is Kind.DEVIATION)
    mild, wild = replace(some, value=2.0 * some.limit), replace(some, value=5.0 * some.limit)
    warned = replace(some, kind=Kind.COLLISION, severity=Severity.WARNING)
    assert worst_first([warned, mild, wild]) == (wild, mild, warned)


def test_the_first_picture_is_the_worst_and_shows_the_contact(found: Verification, tmp_path: Path) -> None:
    drawn = drawn_offences(found)
    assert [o.kind for o in drawn] == [Kind.COLLISION, Kind.CLEARANCE]
    save_png(draw_offence(found, drawn[0], renderer="matplotlib"), tmp_path / "worst.png")
    contact = contact_of(found, drawn[0])
    assert contact is not None
    # The clamp is 40 mm wide and the mill has 4 mm radius: half-way through it takes 24 mm less their rounding.
    assert contact.gap == pytest.approx(-0.022, abs=3e-3)
    np.testing.assert_allclose(contact.points.mean(axis=0), [1.35, 0.1, 0.71], atol=0.03)
    spot = spot_of(found, drawn[0])
    np.testing.assert_allclose(spot.place, contact.points.mean(axis=0))
    assert view_of(found, spot)[1] == ()
    pixels = np.asarray(Image.open(tmp_path / "worst.png").convert("RGB")).astype(int)
    red, green, blue = np.moveaxis(pixels, 2, 0)
    assert ((red > 120) & (red > 1.8 * green) & (blue < 0.5 * green + 20)).sum() > 500


def test_the_eye_sees_past_what_stands_in_the_way(found: Verification) -> None:
    place = spot_of(found, found.ranked[0]).place
    ahead = np.array([np.cos(np.radians(-57.0)), np.sin(np.radians(-57.0)), 0.0])
    base = np.array([0.0, 0.1, 0.0])
    # A wall where the first view would be from, up to the sky.
    side = np.cross(ahead, [0.0, 0.0, 1.0])
    low, high = place + 0.3 * ahead - 0.2 * side, place + 0.3 * ahead + 0.2 * side
    up = np.array([0.0, 0.0, 5.0])
    wall = np.array([[low - up, high - up, high + up], [low - up, high + up, low + up]])
    free = towards(base, place, [place[None]], np.zeros((0, 3, 3)))
    way = towards(base, place, [place[None]], wall)
    assert not unhidden(place[None], free, wall).any()
    assert unhidden(place[None], way, wall).all()


def test_a_joint_beyond_its_limit_is_shown_at_the_joint(found: Verification) -> None:
    offence = replace(found.offences[0], kind=Kind.LIMIT, bodies=None, axis="q3", unit="rad")
    spot = spot_of(found, offence)
    assert spot.contact is None
    assert spot.bodies == ("forearm",)
    # The elbow of the KR60-3, above its base and not at the tip.
    assert spot.place[2] > 1.0


def test_the_replay_lists_the_worst_first_with_its_place(found: Verification) -> None:
    offences = replay_data(found)["offences"]
    assert [o["line"] for o in offences] == [o.line for o in found.ranked]
    assert offences[0]["bodies"] == ["mill", "clamp"]
    assert offences[0]["eye"] is not None
    assert offences[1]["apart"] is True
    first, second = np.array(offences[1]["pair"])
    assert np.linalg.norm(second - first) == pytest.approx(1e-3, abs=1e-4)


@pytest.mark.slow
def test_page_and_files(cli: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STIFFARM_NO_GL", "1")
    program = program_file(tmp_path, program_at(cell_file(tmp_path), 61, 0.102))
    out = tmp_path / "out"
    outcome = cli("verify", "kr60-3", program, "--cell", tmp_path / "cell.toml", "--safety", "10", "--out", out)
    assert outcome.code == 1
    assert "line 47" in outcome.err.strip().splitlines()[-1]
    page = (out / "report.html").read_text(encoding="utf-8")
    first = re.search(r'<img alt="([^"]*)"', page)
    assert first is not None
    assert "collision" in first[1]
    assert "mill and clamp" in first[1]
    content = json.loads((out / "verification.json").read_text(encoding="utf-8"))
    assert content["offences"][0]["kind"] == "collision"
    with (out / "verification.csv").open(encoding="utf-8") as stream:
        assert [row["line"] for row in csv.DictReader(stream)] == ["47", "45", "57"]
    named = set(re.findall(r'href="([^"#:]+)"', page))
    assert {name for name in named if not (out / name).exists()} == set()
