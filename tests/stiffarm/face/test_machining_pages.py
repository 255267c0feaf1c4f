"""What the machining pages say of their examples is what the commands on these pages give: each sentence, each digit.

A sentence is written here with places for its figures; with the figures of a run in them it must stand on the page.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli_runs import ROOT, run_here

DOCS = ROOT / "docs"
POSTURE, WING = DOCS / "examples" / "kr60_posture", DOCS / "examples" / "tx200_wing"
FORCE = ("--force", "0,60,-80", "--force-axes", "process")

pytestmark = pytest.mark.slow


def check(page: str, sentences: list[str]) -> None:
    """Each sentence stands on the page, wherever its lines break."""
    text = " ".join((DOCS / "how-to" / page).read_text(encoding="utf-8").split())
    missing = [sentence for sentence in sentences if sentence not in text]
    assert not missing, f"not in {page}: {missing}"


def asked(*arguments: str | Path, code: int = 0) -> Any:
    outcome = run_here(*arguments, "--json")
    assert outcome.code == code, outcome.err
    return outcome.json


def span(low: float, high: float, shown: Callable[[float], str]) -> str:
    return shown(low) if shown(low) == shown(high) else f"{shown(low)} to {shown(high)}"


def test_the_page_on_postures(tmp_path: Path) -> None:
    found = asked(
        "posture",
        "kr60-3",
        POSTURE / "path.csv",
        "--cell",
        POSTURE / "cell.toml",
        "--milling",
        POSTURE / "milling.toml",
        "--links",
        "rigid",
        "--before",
        "90",
        "--out",
        tmp_path / "posture",
    )
    names = {
        "recommended": "recommended",
        "as_programmed": "as programmed (gamma 90)",
        "fixed_gamma": "best fixed gamma",
        "each_point": "each point by itself (the paper's rule)",
    }
    rows = []
    for key, name in names.items():
        one = found["courses"][key]
        gamma = span(*one["gamma_deg"], lambda v: f"{v:.0f}")
        drivable = "yes" if not one["undrivable_segments"] else "no, a jump"
        figures = f"{one['mean_k_fs_N_per_mm']:.0f} | {one['worst_k_fs_N_per_mm']:.0f}"
        rows.append(f"| {name} | {figures} | {gamma} | {drivable} |")
    before, after = (found["surface_error"][key] for key in ("as_programmed", "recommended"))
    change = found["surface_error"]["change"]
    factor = change["rms"]["factor"]
    check(
        "posture.md",
        [
            f"a tool path of {found['points']} points",
            *rows,
            f"The predicted RMS error along the surface normal falls from {before['rms_um']['value']:.0f} to "
            f"{after['rms_um']['value']:.0f} um (factor {factor['low95']:.1f} to {factor['high95']:.1f}, 95 %)",
            f"its peak to valley grows from {before['peak_to_valley_um']['value']:.0f} to "
            f"{after['peak_to_valley_um']['value']:.0f} um",
        ],
    )
    assert (change["rms"]["verdict"], change["peak_to_valley"]["verdict"]) == ("smaller", "larger")
    # The lower end spans the other published coefficients of this alloy too.
    assert factor["low95"] > 1.3 * found["gain"]["as_programmed"]["high95"]
    written = {path.name for path in (tmp_path / "posture").iterdir()}
    assert {"report.html", "posture.csv", "posture.json", "axes.html"} <= written


def test_the_page_on_programs(tmp_path: Path) -> None:
    model, cell = tmp_path / "twists" / "model.toml", ("--cell", WING / "cell.toml")
    asked("identify", "tx200", "--synthetic", "--out", tmp_path / "twists")

    def place(name: str, *more: str) -> Any:
        return asked("place", model, WING / "wing.cls", *cell, *FORCE, "--aim", "ksf", *more, "--out", tmp_path / name)

    def program(name: str, formats: str) -> Any:
        placement, out = tmp_path / name / "placement.json", tmp_path / f"{name}_program"
        return asked(
            "post", model, WING / "wing.cls", *cell, "--placement", placement, "--format", formats, "--out", out
        )

    def verify(name: str, *more: str, code: int = 0) -> Any:
        return asked("verify", model, tmp_path / f"{name}_program" / "json" / "wing.json", *cell, *more, code=code)

    rest = place("rest")
    one = rest["placements"]["recommended"]
    assert all(
        rest[gain]["present_place_best_gamma"]["value"] == pytest.approx(1.0, abs=0.005)
        for gain in ("gain", "gain_of_worst")
    )
    moving = place("moving", "--mode", "moving")
    go = moving["placements"]["recommended"]
    off = max(format["off_path_um"] for format in program("rest", "val3,sinumerik,json")["programs"].values())
    replayed = verify("rest")
    assert replayed["clean"]
    assert replayed["least_distance_bodies"] is None, "nothing came nearer than the distance that was worked out"
    program("moving", "json")
    refused = verify("moving", code=1)["offences"][0]
    assert refused["kind"] == "axis acceleration"
    assert verify("moving", "--smoothing", "100")["clean"]
    check(
        "program.md",
        [
            f"here {one['axes_mm']['rail'][0]:.2g} mm from the middle, with gamma {one['gamma_deg'][0]:.0f} deg.",
            f"at the softest point ({one['worst_stiffness_N_per_mm']:.0f} N/mm) and on average "
            f"({one['mean_stiffness_N_per_mm']:.0f} N/mm) and the predicted error ({one['rms_error_um']:.0f} um RMS)",
            "the four plunges are not judged. Its first lines say how much that gains over the present place: here "
            "nothing.",
            f"between {go['axes_mm']['rail'][0]:.0f} and {go['axes_mm']['rail'][1]:.0f} mm: then the mean is "
            f"{go['mean_stiffness_N_per_mm']:.0f} N/mm, the softest point {go['worst_stiffness_N_per_mm']:.0f} N/mm "
            f"and the error {go['rms_error_um']:.0f} um",
            f"(here within {off:.1g} um)",
            f"clearance (here over {replayed['distances_worked_out_up_to_mm']:.0f} mm)",
            f"refused for the rail's acceleration in line {refused['line']}; with `--smoothing 100`, for a "
            "controller that blends corners over 100 ms, it passes",
        ],
    )


def test_the_documented_map_and_its_best_gamma(tmp_path: Path) -> None:
    """docs/decisions/machining.md: with every point at the rim it would be nearly the worst of the curve."""
    options = (
        "--x",
        "600:1600:50",
        "--y",
        "-600:600:50",
        "--z",
        "600",
        "--tool",
        "200,0,80,0,90,0",
        "--links",
        "rigid",
    )
    made = asked("map", "index", "kr60-3", "--quantity", "k_fs", *options, "--no-pictures", "--out", tmp_path / "map")
    best, means = made["best_gamma"], sorted(one["reached_mean_k_fs_N_per_mm"] for one in made["gamma_statistics"])
    assert made["points"] == 525
    assert best["points_reached"] >= 0.99 * made["points"]
    whole = made["trade_off"][0]
    assert whole["points_reached"] == made["points"]
    # Among the lowest quarter of all angles' means, where the chosen one is above the middle.
    assert whole["value_N_per_mm"] < means[len(means) // 4]
    assert best["value"] > 1.2 * whole["value_N_per_mm"]
    # 95 deg either way misses two points.
    (side,) = [one for one in made["gamma_statistics"] if one["gamma_deg"] == 95.0]
    assert round(made["points"] * (1.0 - side["share_reached"])) == 2
