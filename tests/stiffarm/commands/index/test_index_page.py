"""The pages of `index` and `map index`: the answer first, its interval where the model has one, its price."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from cli_runs import Command

from fem import build_model
from fem.arm import Arm
from robots import load_description
from stiffarm.pages.arm_uncertainty import half_widths
from stiffarm.session.stated import stiffness_interval

POSE = ("--pose", "q1_deg=10,q2_deg=-60,q3_deg=40,q5_deg=40")


def answer_of(page: str) -> str:
    """What the first screen says, without its tags."""
    found = re.search(r'<main id="answer".*?</nav>', page, re.DOTALL)
    assert found is not None
    return " ".join(re.sub(r"<[^>]*>", " ", found[0]).split())


def test_the_page_of_indices_says_the_softest_direction_first(cli: Command, tmp_path: Path) -> None:
    outcome = cli("index", "kr60-3", "--links", "rigid", *POSE, "--out", "out", "--json")
    assert outcome.code == 0, outcome.err
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    soft = outcome.json["poses"][0]["weakest_N_per_mm"]
    first = answer_of(page)
    assert f"{soft:.4g} N/mm" in first
    assert "deflects most there" in first
    assert page.count("<h1>") == 1
    assert 'href="index.csv"' in page
    assert "nan" not in first


@pytest.mark.slow
def test_the_page_of_map_index_says_what_the_best_gamma_costs(cli: Command, tmp_path: Path) -> None:
    outcome = cli(
        "map",
        "index",
        "kr60-3",
        "--links",
        "rigid",
        "--x",
        "900:2000:275",
        "--y",
        "-500:500:250",
        "--z",
        "800",
        "--gamma",
        "-180:180:30",
        "--tool",
        "120,0,250,0,0,0",
        "--out",
        "out",
        "--json",
    )
    assert outcome.code == 0, outcome.err
    front = outcome.json["trade_off"]
    reach = [one["points_reached"] for one in front]
    assert reach == sorted(reach, reverse=True)
    assert (np.diff([one["value_N_per_mm"] for one in front]) > 0.0).all()
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for name in outcome.json["files"]:
        if not name.endswith((".png", "report.html")):
            assert f'href="{name}"' in page
    assert "which gamma, and what does it cost?" in page
    assert (tmp_path / "out" / "gamma_trade_off.png").exists() == (len(front) > 1)


def test_a_model_without_a_covariance_has_no_interval() -> None:
    description = load_description("kr60-3")
    given = Arm.of(description, "rigid")
    assert half_widths(given, np.zeros((1, 6)), np.array([0.0, 0.0, -1.0])) is None
    assert build_model(description, "rigid").robot.dof == 6


@pytest.mark.parametrize(("half", "ends"), [(0.25, (80.0, 400.0 / 3.0)), (1.5, (40.0, np.inf))])
def test_the_compliance_is_off_by_its_share(half: float, ends: tuple[float, float]) -> None:
    assert stiffness_interval(100.0, half) == pytest.approx(ends)
