"""One arm, one answer: every command, file and function gives a pose the same stiffness and the same interval.

The walk goes over arms with and without effects. A figure is asked for at one pose under one load; what is compared is
stiffness along the load (N/mm) and the ends of its 95 % interval.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
from cli_runs import run_here

import stiffarm as sa
from robots import load_description
from robots.library.models import to_toml
from stiffarm.session.stated import at_load
from stiffarm.session.workspace import workspace_stiffness

# Files hold six digits, pages and screens fewer.
SIX_DIGITS = 6e-6
INTERVAL = 0.01
LOAD_N = 400.0
BACKLASH = """
[[effect]]
code = "backlash:j3"
parameters.gap = { value = 0.6, unit = "mrad", source = "assumed" }
parameters.crossing = { value = 40, unit = "N m", source = "assumed" }
"""
TILT = """
[[effect]]
code = "base-tilt"
parameters.stiffness_y = { value = 2e7, unit = "N m/rad", source = "assumed" }
"""


@dataclass(frozen=True)
class Case:
    """An arm of the walk: its file, whether it was calibrated, and whether a surrogate of it is exact."""

    file: Path
    has_interval: bool
    is_linear: bool


def springs(name: str) -> dict[str, float]:
    largest = 4e6 if name == "fanuc-r2000ic" else 2e6
    return dict(zip([f"j{k}" for k in range(1, 7)], np.geomspace(largest, 1e5, 6).tolist(), strict=True))


def described(name: str, effects: str) -> str:
    """A model with a spring at every joint and a covariance of two of them, as a calibration leaves it."""
    data = load_description(name).model_dump(by_alias=True)
    k = springs(name)
    for joint in data["joint"]:
        joint["stiffness"] = {"value": k[joint["name"]], "unit": "N m/rad", "source": "calibrated"}
    data["sources"] = {"calibrated": "made for a test", "assumed": "made for a test", **data["sources"]}
    c = np.array([1.0 / k["j2"], 1.0 / k["j3"]])
    data["calibration"] = {
        "scheme": "global",
        "load_path": data["load_path"],
        "links": "beam",
        "data": "none",
        "data_sha256": "0" * 64,
        "rms_mm": 0.01,
        "loads_N": [LOAD_N / 2.0, LOAD_N],
        "notes": [],
        "uncertainty": {
            "parameters": ["j2.stiffness", "j3.stiffness"],
            "unit": ["N m/rad"] * 2,
            "variable": ["1/value"] * 2,
            "estimate": c.tolist(),
            "covariance": [[(0.1 * c[0]) ** 2, 0.0], [0.0, (0.08 * c[1]) ** 2]],
            "degrees_of_freedom": [6.0, 6.0],
            "status": ["determined"] * 2,
            "undetermined_directions": [],
            "undetermined": [],
            "note": "made for a test",
        },
    }
    description = load_description(name)
    return to_toml(type(description).model_validate(data)) + effects


def own_arm(folder: Path) -> str:
    """An arm from a table of Denavit-Hartenberg parameters, with springs of its class: nobody calibrated it."""
    rows = ["joint,alpha_deg,a_mm,d_mm,theta_deg,lower_deg,upper_deg,sign"]
    table = [(-90, 25, 400, 0), (0, 560, 0, -90), (-90, 35, 0, 0), (90, 0, 515, 0), (-90, 0, 0, 0), (0, 0, 80, 180)]
    limits = [(-170, 170), (-120, 40), (-120, 150), (-180, 180), (-115, 115), (-350, 350)]
    both = enumerate(zip(table, limits, strict=True), 1)
    rows += [f"j{k},{al},{a},{d},{th},{lo},{hi},1" for k, ((al, a, d, th), (lo, hi)) in both]
    (folder / "dh.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    made = run_here("new", "own", "--dh", folder / "dh.csv", "--springs", "class", "--out", folder / "own")
    assert made.code == 0, made.err
    return (folder / "own" / "own.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], Case]:
    """An arm of the walk by its name and its effects."""

    def make(name: str, effects: str) -> Case:
        folder = tmp_path_factory.mktemp(name)
        text = own_arm(folder) + effects if name == "own" else described(name, effects)
        (folder / "model.toml").write_text(text, encoding="utf-8")
        return Case(folder / "model.toml", name != "own", "backlash" not in effects)

    return make


def told(found: Mapping[str, Any], value: str, ends: tuple[str, str] | str) -> tuple[float, float, float]:
    low, high = (found[ends] or (np.nan, np.nan)) if isinstance(ends, str) else (found[e] for e in ends)
    return found[value], np.nan if low is None else low, np.nan if high is None else high


def of_map(k: float, percent: float) -> tuple[float, float, float]:
    """A map's value with the ends that its uncertainty stands for."""
    e = 1.959963985 * percent / 100.0
    return k, k / (1.0 + e), k / (1.0 - e)


ARMS = ["xr701", "fanuc-r2000ic", "kr60-3", "tx200", "own"]
EVERYDAY = [("kr60-3", ""), ("own", BACKLASH)]
REST = [(arm, effects) for arm in ARMS for effects in ("", TILT, BACKLASH) if (arm, effects) not in EVERYDAY]


@pytest.mark.parametrize(
    ("name", "effects"), [*EVERYDAY, *(pytest.param(*one, marks=pytest.mark.slow) for one in REST)]
)
def test_the_same_pose_and_load_have_the_same_answer_everywhere(
    case: Callable[[str, str], Case], name: str, effects: str, tmp_path: Path
) -> None:
    c = case(name, effects)
    arm = sa.load(c.file)
    # The map's grid decides which pose is asked for: its files hold that one to the last digit.
    at = ("--at-load", f"{LOAD_N:g}")
    assert run_here("map", "joints", c.file, "--points", "3", "--no-pictures", *at, "--out", tmp_path / "map").code == 0
    rows = list(csv.DictReader((tmp_path / "map" / "map.csv").open(encoding="utf-8")))
    ks = [float(r["stiffness_N_per_mm"] or "nan") for r in rows]
    row = int(np.argsort(np.where(np.isfinite(ks), ks, np.inf))[np.count_nonzero(np.isfinite(ks)) // 2])
    q_deg = {n: float(rows[row][n]) for n in arm.coordinates}
    pose, load = ",".join(f"{n}={v!r}" for n, v in q_deg.items()), {"fz_N": -LOAD_N}
    found: dict[str, tuple[float, float, float]] = {}

    s = run_here("simulate", c.file, "--pose", pose, "--load", f"fz_N={-LOAD_N}", "--json").json
    names = "stiffness_N_per_mm", "stiffness_interval95_N_per_mm"
    found["simulate"] = told(s, *names)
    found["sa.simulate"] = told(sa.simulate(arm, pose=q_deg, load=load).as_json, *names)

    one = run_here("index", c.file, "--pose", pose, *at, "--json").json["poses"][0]
    found["index"] = told(one, "directional_N_per_mm", "directional_interval95_N_per_mm")
    indices = sa.index(arm, pose=q_deg, at_load=LOAD_N)
    ends = [float(end[0]) * 1e-3 for end in indices.interval("directional")]
    found["sa.index"] = (float(indices["directional"][0]) * 1e-3, ends[0], ends[1] if np.isfinite(ends[1]) else np.nan)

    assert run_here("fit", c.file, "--runs", "2000", "--basis", "factored", *at, "--out", tmp_path / "fit").code == 0
    file = tmp_path / "fit" / "surrogate.json"
    learned = sa.load_surrogate(file)
    part = {n: v for n, v in q_deg.items() if n in learned.learned.inputs}
    asked = ",".join(f"{n}={v!r}" for n, v in part.items())
    answers = run_here("query", file, "--pose", asked, "--json").json
    found["query"] = told(answers["answers"][0], *names)
    found["sa.query"] = told(sa.query(surrogate=learned, pose=part).as_json["answers"][0], *names)

    def percent(value: str | float | None) -> float:
        return float(value) if c.has_interval and value is not None else float("nan")

    found["map.csv"] = of_map(ks[row], percent(rows[row].get("uncertainty_percent")))
    grid = pyvista.read(tmp_path / "map" / "stiffness_map.vtu")
    vtk = grid.point_data
    near = int(np.argmin(np.abs(vtk["stiffness_N_per_mm"] - ks[row])))
    found["VTK"] = of_map(
        float(vtk["stiffness_N_per_mm"][near]), percent(vtk["uncertainty_percent"][near] if c.has_interval else None)
    )
    mapped = sa.map_joints(arm, points=3, at_load=LOAD_N).data
    fields = {n: float(np.asarray(f.values)[row]) for n, f in mapped.fields.items() if not f.categories}
    found["sa.map_joints"] = of_map(fields["stiffness_N_per_mm"], percent(fields.get("uncertainty_percent")))

    request = {"do": "stiffness", "q_deg": list(q_deg.values()), "direction": [0, 0, 1]}
    answer = served(c.file, request, at)
    found["serve"] = (answer["directional_N_per_mm"], np.nan, np.nan)

    value, low, high = found["simulate"]
    assert np.isfinite(value)
    assert np.isfinite(low) == c.has_interval
    for what, (k, k_low, k_high) in found.items():
        if "query" in what and not c.is_linear:
            # What an arm with backlash does over its poses is no sum of a few waves: the answer's own bar holds it.
            assert k_low < value < (k_high if np.isfinite(k_high) else np.inf), (what, found)
            continue
        tolerance = SIX_DIGITS
        assert k == pytest.approx(value, rel=tolerance), (what, found)
        if c.has_interval and np.isfinite(k_low):
            # Percents in files have six digits too; a surrogate's intervals are learned to a share of the largest.
            bars = learned.learned.parameters
            near = 2e-5 if "query" not in what or bars is None else max(INTERVAL, bars.misfit)
            assert (k_low, k_high) == pytest.approx((low, high), rel=near), (what, found)
    if not c.is_linear:
        # At a tenth of the load the gap weighs more, and every answer says so.
        few = run_here("index", c.file, "--pose", pose, "--at-load", f"{LOAD_N / 10:g}", "--json").json
        assert few["poses"][0]["directional_N_per_mm"] < 0.99 * value
        assert few["at_load"]["not_linear"] == ["backlash:j3"]
        for content in (answers, json.loads((tmp_path / "map" / "map.json").read_text(encoding="utf-8"))):
            assert content["at_load"]["load_N"] == LOAD_N
            assert content["at_load"]["not_linear"] == ["backlash:j3"]


def test_cards_say_of_their_poses_what_a_simulation_says(case: Callable[[str, str], Case]) -> None:
    c = case("xr701", BACKLASH)
    arm = at_load(sa.load(c.file))
    spots = workspace_stiffness(arm.description, arm.model)
    for spot in spots.spots:
        q_deg = dict(zip(arm.coordinates, spot.q_deg, strict=True))
        simulated = sa.simulate(sa.load(c.file), pose=q_deg, load={"fz_N": -LOAD_N}).as_json
        assert simulated["stiffness_N_per_mm"] == pytest.approx(spot.stiffness, rel=SIX_DIGITS)
        assert simulated["stiffness_interval95_N_per_mm"] == pytest.approx((spot.low, spot.high), rel=2e-5)


def test_two_models_that_are_the_same_compare_as_the_same(case: Callable[[str, str], Case], tmp_path: Path) -> None:
    c = case("kr60-3", BACKLASH)
    for name in ("one", "two"):
        assert run_here("map", "joints", c.file, "--points", "3", "--no-pictures", "--out", tmp_path / name).code == 0
    found = run_here("compare", tmp_path / "one", tmp_path / "two", "--json")
    assert found.code == 0, found.err


def served(model: Path, request: Mapping[str, Any], more: tuple[str, ...]) -> dict[str, Any]:
    """One answer of `stiffarm serve`, from its session: the process and its streams have tests of their own."""
    from stiffarm.commands.serve.command import open_session
    from stiffarm.session.task_setup import read_setup

    arm = at_load(sa.load(model), float(more[1]))
    setup = read_setup(str(model), arm, None, None, None)
    return open_session(arm, setup).reply(dict(request))
