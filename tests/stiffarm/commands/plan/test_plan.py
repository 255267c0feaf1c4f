"""The command `plan`: what it names, writes and says, and that its sheet goes back into `calibrate`."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from cli_runs import ROOT, Command, run_here, tree
from figure_texts import texts
from shortened import blank_pictures

from fem import build_model, deflection
from robots import load_description
from stiffarm.commands.plan.figures import plan_figure
from stiffarm.commands.plan.request import PlanRequest, components_of, directions_of, usual_loads
from stiffarm.commands.plan.step import make_plan
from stiffarm.session import inputs, readings

XR701 = inputs.read_model("xr701", None, None)
DATA = readings.read_data(XR701.robot, None)
SIX_AXIS = ROOT / "tests" / "robots" / "data" / "six_axis.urdf"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a small plan for the published data."""
    folder = tmp_path_factory.mktemp("plan") / "out"
    with blank_pictures():
        outcome = run_here("plan", "xr701", "--poses", "2", "--candidates", "300", "--repeats", "2", "--out", folder)
    assert outcome.code == 0, outcome.err
    return folder


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.usefixtures("blank")
def test_a_turned_frame_is_planned_for_on_the_fanuc(cli: Command) -> None:
    outcome = cli(
        "plan",
        "fanuc-r2000ic",
        "--free",
        "frame.rz,j2.stiffness,j3.stiffness",
        "--poses",
        "2",
        "--candidates",
        "60",
        "--repeats",
        "1",
        "--out",
        "o",
        "--json",
    )
    assert outcome.code == 0, outcome.err
    turn, *_ = outcome.json["parameters"]
    assert (turn["name"], turn["unit"]) == ("frame.rz", "rad")
    assert turn["shrink"] > 1.5
    rows = rows_of(Path("o") / "measurement_sheet.csv")
    # All three translations were read; what is to be read stays empty.
    assert all(row[name] == "" for row in rows for name in ("dx_mm", "dy_mm", "dz_mm"))
    # A load straight down the axis that the frame turns about would not show it.
    assert any(float(row["fx_N"]) or float(row["fy_N"]) for row in rows)


def test_six_poses_settle_what_nine_readings_cannot_tell(cli: Command) -> None:
    outcome = cli("plan", "xr701", "--poses", "6", "--json")
    assert outcome.code == 0, outcome.err
    result = outcome.json
    assert result["schema"] == "stiffarm-plan/2"
    assert len(result["setups"]) == 6
    assert result["loads_N"] == [150.0, 375.0, 650.0]
    assert result["read"] == ["dz_mm"]
    by_name = {p["name"]: p for p in result["parameters"]}
    # Joints 1 and 6 turn about the load and about its line of action: no such reading moves with them.
    assert list(by_name) == [f"j{k}.stiffness" for k in (2, 3, 4, 5)]
    for name in ("j4.stiffness", "j5.stiffness"):
        assert by_name[name]["status"] in ("one-sided", "at bound")
        assert by_name[name]["shrink"] > 2.0
    # Afterwards every one is known within a factor 1.5 (95 %).
    assert all(math.exp(1.96 * p["sd_after"]) < 1.5 for p in result["parameters"])
    assert result["held_deg"] == {"q1_deg": 0.0, "q6_deg": 0.0}
    assert all(s["q1_deg"] == s["q6_deg"] == 0.0 for s in result["setups"])
    robot = XR701.robot
    q = np.radians([[s[name] for name in robot.coordinates] for s in result["setups"]])
    assert robot.reachable(q).all()
    assert result["value"] < result["random"]["median_value"]
    assert result["random"]["setups_for_the_same"] > 6
    said = " ".join(result["words"])
    assert "j4.stiffness: known within a factor" in said
    # The lack of fit makes it wider than by the readings' noise alone; what it rests on is said.
    assert all(p["promised_half_width95"] > 1.96 * p["sd_after"] for p in result["parameters"])
    assert result["promise"]["aims_at"] == 0.9
    assert result["promise"]["lack_of_fit"] == "of the readings"
    assert "only ≥" in said
    assert f"it takes about {result['random']['setups_for_the_same']} set-ups" in said


def test_files_of_a_plan(written: Path) -> None:
    assert {p.name for p in written.iterdir()} == {
        "measurement_sheet.csv",
        "measurement_sheet.html",
        "plan.json",
        "plan.csv",
        "parameters.csv",
        "plan.png",
        "narrower.png",
        "report.html",
        "run.json",
    }
    plan = json.loads((written / "plan.json").read_text(encoding="utf-8"))
    rows = rows_of(written / "measurement_sheet.csv")
    assert len(rows) == 2 * 2 * 3
    assert [row["step"] for row in rows] == [str(k) for k in range(1, 13)]
    for setup in plan["setups"]:
        mine = [row for row in rows if row["pose"] == setup["pose"]]
        assert len(mine) == 6
        for name in XR701.robot.coordinates:
            # The table keeps 15 digits, the JSON 6.
            assert float(mine[0][name]) == pytest.approx(setup[name], abs=1e-4)
    html = (written / "measurement_sheet.html").read_text(encoding="utf-8")
    assert html.count("data:image/png;base64,") == 2
    assert "to expect at 650 N" in html


def test_a_sheet_partly_filled_in_goes_into_calibrate(written: Path, cli: Command, tmp_path: Path) -> None:
    """Readings simulated with known springs come back as these springs; rows left empty are named and skipped."""
    rows = rows_of(written / "measurement_sheet.csv")
    truth = build_model(load_description("xr701")).with_springs({"j2": 8e5, "j3": 9e5})
    for k, row in enumerate(rows):
        if k in (3, 4, 11):
            continue
        q = np.radians([[float(row[name]) for name in XR701.robot.coordinates]])
        load = np.array([0.0, 0.0, float(row["fz_N"]), 0.0, 0.0, 0.0])
        row["dz_mm"] = f"{1e3 * deflection(truth, q, load)[0, 2]:.9f}"
    filled = tmp_path / "filled.csv"
    with filled.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    outcome = cli("calibrate", "xr701", filled, "--scheme", "global", "--joints", "j2,j3", "--json")
    assert outcome.code == 0, outcome.err
    assert "3 row(s) without any reading skipped: 5-6, 13" in outcome.err
    # Readings to 1e-9 mm: the springs to some 1e-7.
    springs = [one["k_Nm_per_rad"] for one in outcome.json["springs"].values()]
    assert springs == pytest.approx([8e5, 9e5], rel=1e-5)


def test_new_labels_are_not_those_of_the_data(written: Path) -> None:
    labelled = readings.read_data(XR701.robot, None)
    object.__setattr__(labelled, "pose", ("N2", *labelled.pose[1:]))
    planned = make_plan(XR701, labelled, PlanRequest(poses=2, candidates=50))
    assert planned.labels == ("N3", "N4")


def test_a_first_campaign_of_a_robot_without_data(cli: Command) -> None:
    outcome = cli(
        "plan", "kr60-3", "--poses", "3", "--candidates", "200", "--directions", "+x,-z", "--read", "xz", "--json"
    )
    assert outcome.code == 0, outcome.err
    result = outcome.json
    assert result["data"] is None
    # A quarter, half and all of 60 kg, rounded.
    assert result["loads_N"] == [150.0, 290.0, 590.0]
    assert "j1.stiffness" in [p["name"] for p in result["parameters"]]
    assert all(p["status"] == "no readings" for p in result["parameters"])
    assert not any(key.startswith("expected") for key in result["setups"][0])
    assert any("no readings yet" in note for note in result["remarks"])


def test_a_urdf_needs_no_more_than_loads(cli: Command) -> None:
    outcome = cli("plan", SIX_AXIS, "--poses", "3", "--candidates", "200", "--loads", "50,100", "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.json["robot"] == "six_axis"


@pytest.mark.parametrize("design", ["sobol", "latin", "factorial", "fractional"])
def test_plain_designs(design: str) -> None:
    planned = make_plan(XR701, DATA, PlanRequest(design_only=200 if design == "factorial" else 12, design=design))  # type: ignore[arg-type]
    q = planned.made.q
    assert XR701.robot.reachable(q).all()
    assert len(q) == 12 if design in ("sobol", "latin") else len(q) > 2
    assert not len(planned.made.random)
    assert not any("random" in sentence for sentence in planned.sentences)


def test_drawn_poses_are_in_whole_degrees_and_not_wound_up() -> None:
    planned = make_plan(inputs.read_model("kr60-3", None, None), None, PlanRequest(poses=5, candidates=100))
    degrees = np.degrees(planned.made.q)
    np.testing.assert_allclose(degrees, np.round(degrees), atol=1e-9)
    assert np.abs(degrees[:, 3]).max() <= 180.0


@pytest.mark.slow
def test_vary_and_hold_override_what_makes_no_difference() -> None:
    planned = make_plan(XR701, DATA, PlanRequest(poses=3, candidates=50, vary=("q1_deg", "q2_deg", "q3real_deg")))
    assert len(np.unique(planned.made.q[:, 0])) > 1
    assert set(planned.held_deg) == {"q4_deg", "q5_deg", "q6_deg"}
    planned = make_plan(XR701, DATA, PlanRequest(poses=3, candidates=50, hold={"q1_deg": 30.0}))
    np.testing.assert_allclose(np.degrees(planned.made.q[:, 0]), 30.0)


@pytest.mark.slow
def test_order_is_a_tour_or_random_on_request() -> None:
    way = make_plan(XR701, DATA, PlanRequest(poses=8, candidates=100))
    drawn = make_plan(XR701, DATA, PlanRequest(poses=8, candidates=100, random_order=True))
    turns = [np.abs(np.diff(p.made.q, axis=0)).max(axis=1).sum() for p in (way, drawn)]
    assert turns[0] < turns[1]
    assert sorted(map(tuple, way.made.q)) == sorted(map(tuple, drawn.made.q))
    assert "drift" in " ".join(drawn.notes)


@pytest.mark.slow
def test_same_seed_same_plan() -> None:
    one, two, other = (make_plan(XR701, DATA, PlanRequest(poses=3, candidates=30, seed=s)) for s in (1, 1, 2))
    np.testing.assert_array_equal(one.made.q, two.made.q)
    assert not np.array_equal(one.made.q, other.made.q)


def test_no_pose_below_the_floor_or_in_a_box() -> None:
    asked = PlanRequest(poses=4, candidates=100, floor_mm=500.0, keep_out=(1000, -400, 0, 3000, 400, 1200))
    planned = make_plan(XR701, DATA, asked)
    assert asked.zone(XR701).free(XR701.robot, planned.made.q).all()
    assert "above z = 500 mm; out of 1 box(es)" in " ".join(planned.notes)


# --- words and figure ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("-z", [[0, 0, -1]]),
        ("+x,-x,y", [[1, 0, 0], [-1, 0, 0], [0, 1, 0]]),
        ("0,0,-1;3,0,-4", [[0, 0, -1], [0.6, 0, -0.8]]),
        ("-z;0,2,0", [[0, 0, -1], [0, 1, 0]]),
    ],
)
def test_directions(text: str, expected: list[list[float]]) -> None:
    np.testing.assert_allclose(directions_of(text), expected, atol=1e-12)


def test_what_is_read() -> None:
    assert components_of("z") == (2,)
    assert PlanRequest(poses=1, read="XZ").read == "xz"
    assert components_of("xyzr") == (0, 1, 2, 3, 4, 5)


def test_usual_loads_are_those_of_the_data() -> None:
    assert usual_loads(XR701.description, DATA).tolist() == [150.0, 375.0, 650.0]


@pytest.mark.slow
@pytest.mark.parametrize("criterion", ["D", *(pytest.param(c, marks=pytest.mark.slow) for c in "AI")])
def test_figure(criterion: str) -> None:
    request = PlanRequest(
        poses=3,
        candidates=60,
        criterion=criterion,  # type: ignore[arg-type]
        free=("j3.stiffness", "j4.stiffness", "j2.zero", "forearm.modulus"),
    )
    planned = make_plan(XR701, None, request)
    figure = plan_figure(planned.made, planned.found, "$x_{")
    seen = texts(figure)
    for one in seen:  # nothing is cut off, but for a pixel
        assert min(one.box.x0, one.box.y0) >= -1
        assert max(one.box.x1 - figure.bbox.x1, one.box.y1 - figure.bbox.y1) <= 1
    shown = [one.text for one in seen]
    assert any("3 set-ups for $x_{" in text for text in shown)
    assert any(text.startswith("j4.stiffness") for text in shown)
    assert "this plan" in shown
    assert len(figure.axes) == 2


@pytest.mark.slow
def test_figure_of_a_design_with_many_parameters_and_one_unseen() -> None:
    free = tuple(f"j{j}.{row}" for j in range(1, 7) for row in ("tx", "ty", "tz", "rx", "rz"))
    planned = make_plan(XR701, None, PlanRequest(design_only=4, free=free))
    shown = [seen.text for seen in texts(plan_figure(planned.made, planned.found, "xr701"))]
    assert any("6 more parameters in plan.json" in text for text in shown)


# --- bad input -------------------------------------------------------------------------------------

BAD = {
    "no task": ("", ("one of --poses N, --design-only N, --positions N",)),
    "two tasks": ("--poses 3 --positions 8", ("'--poses with --positions'",)),
    "unknown parameter": ("--poses 3 --free j9.stiffness", ("'j9.stiffness'", "bar.stiffness")),
    "parameter twice": ("--poses 3 --free j2.stiffness,j2.stiffness", ("each once",)),
    "parameter under two names": ("--poses 3 --free j2.stiffness,j2.rz", ("j2.rz", "each number once")),
    "wall": ("--poses 3 --free forearm.wall", ("forearm.modulus",)),
    "nothing moves": ("--poses 3 --free j1.stiffness", ("no reading of this plan moves with j1.stiffness",)),
    "floor too high": ("--poses 3 --floor-mm 9000", ("poses that xr701 can take: 0 of", "lower the floor")),
    "floor text": ("--poses 3 --floor-mm high", ("--floor-mm: got 'high'", "none")),
    "more set-ups than candidates": ("--poses 30 --candidates 10", ("--poses: got 30", "1 to 10")),
    "direction twice": ("--poses 3 --directions +x,1,0,0", ("--directions",)),
    "same direction": ("--poses 3 --directions +x;2,0,0", ("number 1 and number 2 are the same direction",)),
    "contradictory sign": ("--poses 3 --directions +-x", ("'+-x'", "as in +x,-x,-z")),
    "direction of length zero": ("--poses 3 --directions 0,0,0", ("vectors that are not zero",)),
    "direction NaN": ("--poses 3 --directions nan,0,1", ("--directions",)),
    "read twice": ("--poses 3 --read zz", ("--read: got 'zz'",)),
    "criterion": ("--poses 3 --criterion E", ("D, A, I",)),
    "design": ("--poses 3 --design random", ("factorial, fractional, latin, sobol",)),
    "factorial larger than asked": ("--design-only 3 --design factorial", ("72", "--vary")),
    "box": ("--poses 3 --keep-out 1,2:3", ("two opposite corners",)),
    "flat box": ("--poses 3 --keep-out 0,0,0:1,1,0", ("a box with a volume",)),
    "coordinate": ("--poses 3 --vary q9_deg", ("'q9_deg'", "q3real_deg")),
    "hold": ("--poses 3 --hold q2_deg=90", ("--hold: q2_deg", "-35 to 45 deg")),
    "hold and vary": ("--poses 3 --hold q1_deg=9 --vary q1_deg,q2_deg", ("both in --vary and in --hold",)),
    "gauge": ("--poses 3 --gauge-mm 0", ("--gauge-mm: got 0.0",)),
    "load": ("--poses 3 --loads 0", ("above 0 N",)),
    "no load known": ("SIX_AXIS --poses 3", ("no payload is known", "--loads 150")),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input(name: str, cli: Command, tmp_path: Path) -> None:
    arguments, says = BAD[name]
    words_given = arguments.split()
    # The path is put in afterwards: it may hold blanks.
    model = SIX_AXIS if words_given[:1] == ["SIX_AXIS"] else "xr701"
    outcome = cli("plan", model, *(word for word in words_given if word != "SIX_AXIS"), "--out", "out")
    assert outcome.code == 2, outcome.err
    assert outcome.out == ""
    messages = [line for line in outcome.err.splitlines() if line.startswith("stiffarm: ")]
    assert len(messages) == 1
    for part in says:
        assert part in outcome.err
    assert tree(tmp_path) == {}
