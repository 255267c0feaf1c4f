"""Effects on the command line: in model files, with load history, set free, and a user's own."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_runs import ROOT, Command, run_here

from doe import read_measurements
from doe.tables.loaded import history_of
from fem.effects import build_arm, checked_maker, observed, reading_effects
from fem.statics.loads import LoadedPoses
from robots import load_description
from robots.library.models import to_toml

SPRINGS = {"j1": 3e6, "j2": 1.4e6, "j3": 0.8e6, "j4": 1e6, "j5": 1e6, "j6": 1e6}
FRICTION = """
[[effect]]
code = "friction:j3"
parameters.share = {{ value = 1, unit = "1", source = "assumed" }}
parameters.friction = {{ value = {friction}, unit = "N m", source = "assumed" }}
[[effect]]
code = "base-tilt"
parameters.stiffness_y = {{ value = 2e7, unit = "N m/rad", source = "assumed" }}
"""
POSE = ("--pose", "q2_deg=5,q3real_deg=77.5")
NOISE_MM = 0.002


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Write the xr701 with springs and effects."""
    folder = tmp_path_factory.mktemp("effects")
    data = load_description("xr701").model_dump(by_alias=True)
    for joint in data["joint"]:
        joint["stiffness"] = {"value": SPRINGS[joint["name"]], "unit": "N m/rad", "source": "assumed"}
    plain = to_toml(type(load_description("xr701")).model_validate(data))

    def write(text: str = "", name: str = "model.toml") -> Path:
        path = folder / name
        path.write_text(plain + text, encoding="utf-8")
        return path

    return write


def write_cycles(path: Path, model: Path, own: tuple[Any, ...] = (), *, phases: bool = True) -> Path:
    """Readings of five poses, up and down, twice, by the model with its effects and a little noise."""
    d = load_description(model)
    arm, rng = build_arm(d, own=own), np.random.default_rng(5)
    low, high = arm.robot.limits.T
    q = rng.uniform(0.7 * low, 0.7 * high, (200, 6))
    q[:, 2] = rng.uniform(low[2], high[2], 200)
    q = q[arm.robot.reachable(q)][:5]
    cycle = [(f, "loading") for f in (150, 400, 650)] + [(f, "unloading") for f in (400, 150)]
    head = ["pose", *arm.robot.coordinates, "fz_N", "repeat", "step", "dz_mm"] + ["phase"] * phases
    rows: list[list[object]] = []
    for k, pose in enumerate(q):
        for repeat in (1, 2):
            for load, phase in cycle:
                row = [f"P{k}", *np.degrees(pose).round(9), -load, repeat, len(rows) + 1, 0.0]
                rows.append(row + [phase] * phases)
    _write(path, head, rows)
    table = read_measurements(path, arm.robot)
    at = LoadedPoses(table.q, table.wrench, np.tile(arm.robot.T_flange_tool[:3, 3], (table.n, 1)))
    dz = observed(arm, at, reading_effects(d, arm, own), history_of(table))[:, 2] * 1e3
    for row, value in zip(rows, dz + NOISE_MM * rng.normal(size=table.n), strict=True):
        row[head.index("dz_mm")] = f"{value:.6f}"
    _write(path, head, rows)
    return path


def _write(path: Path, head: list[str], rows: list[list[object]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([head, *rows])


def test_a_single_load_is_put_on_from_zero_or_reached_from_above(cli: Command, model: Callable[..., Path]) -> None:
    file = model(FRICTION.format(friction=100))
    load = ("--load", "fz_N=-400")
    up = cli("simulate", file, *POSE, *load, "--json").json
    down = cli("simulate", file, *POSE, *load, "--unload-from", "fz_N=-1300", "--json").json
    plain = cli("simulate", model(name="plain.toml"), *POSE, *load, "--json").json
    assert up["effects"] == ["friction:j3", "base-tilt"]
    assert "effects" not in plain
    parts = {row["part"]: row["dz_mm"] for row in up["by_part"]}
    a = parts["friction:j3"]
    b = next(row["dz_mm"] for row in down["by_part"] if row["part"] == "friction:j3")
    # 400 N hold more than two frictions: what was missing on the way up is on top on the way down.
    assert a == pytest.approx(-b, rel=1e-5)
    assert a > 0.1
    assert up["dz_mm"] == parts.pop("total") == pytest.approx(sum(parts.values()), abs=1e-6)
    assert up["dz_mm"] == pytest.approx(plain["dz_mm"] + a + parts["base"], abs=1e-5)


def test_a_table_says_which_way_the_load_went(cli: Command, model: Callable[..., Path], tmp_path: Path) -> None:
    file = model(FRICTION.format(friction=100))
    table = write_cycles(tmp_path / "cycles.csv", file)
    outcome = cli("simulate", file, table, "--json")
    # Three standard deviations of the RMS of fifty readings.
    assert outcome.json["rms_mm"] == pytest.approx(NOISE_MM, rel=0.3)
    assert "taken as loadings" not in outcome.err
    rows = [line.split(",") for line in table.read_text().splitlines()]
    cut = [k for k, name in enumerate(rows[0]) if name not in ("phase", "step")]
    # Without phase and step, up and down at one load are the same reading: of each cycle the way up is left.
    kept = [rows[0], *(row for row in rows[1:] if row[-1] == "loading")]
    blind = tmp_path / "blind.csv"
    blind.write_text("\n".join(",".join(row[k] for k in cut) for row in kept))
    outcome = cli("simulate", file, blind, "--json")
    assert "friction:j3: the table does not say" in outcome.err
    assert outcome.json["rms_mm"] == pytest.approx(NOISE_MM, rel=0.3)


def test_rigid_joints_have_no_effects(cli: Command, model: Callable[..., Path]) -> None:
    with_effects = cli("simulate", model(FRICTION.format(friction=100)), *POSE, "--rigid-joints", "--json").json
    assert with_effects["effects"] == []
    plain = cli("simulate", model(name="plain.toml"), *POSE, "--rigid-joints", "--json").json
    rigid, alone = ({row["part"] for row in found["by_part"]} for found in (with_effects, plain))
    assert rigid == alone | {"base"}


@pytest.mark.slow
def test_calibration_finds_an_effects_number_and_writes_it_back(
    cli: Command, model: Callable[..., Path], tmp_path: Path
) -> None:
    table = write_cycles(tmp_path / "cycles.csv", model(FRICTION.format(friction=110)))
    start = model(FRICTION.format(friction=60), "start.toml")
    outcome = cli(
        "calibrate",
        start,
        table,
        "--free",
        "j2.stiffness,j3.stiffness,friction:j3.friction",
        "--out",
        tmp_path / "out",
        "--json",
    )
    assert outcome.code == 0, outcome.err
    assert "with effects: friction:j3, base-tilt" in outcome.err
    numbers = {n["name"]: n for n in outcome.json["parameters"]}
    assert numbers["friction:j3.friction"]["value"] == pytest.approx(110.0, rel=0.01)
    assert numbers["j3.stiffness"]["value"] == pytest.approx(SPRINGS["j3"], rel=0.01)
    low, high = numbers["friction:j3.friction"]["value_interval95"]
    assert low < 110.0 < high
    written = load_description(tmp_path / "out" / "model.toml")
    assert [e.code for e in written.effect] == ["friction:j3", "base-tilt"]
    friction = written.effect[0].parameters["friction"]
    assert friction.source == "calibrated"
    assert "95 % interval" in (friction.note or "")
    again = cli("simulate", tmp_path / "out" / "model.toml", table, "--json")
    assert again.json["rms_mm"] == pytest.approx(NOISE_MM, rel=0.3)


def test_loads_alone_of_a_loop_are_refused(cli: Command, model: Callable[..., Path], tmp_path: Path) -> None:
    file = model(FRICTION.format(friction=100))
    table = write_cycles(tmp_path / "cycles.csv", file)
    outcome = cli("calibrate", file, table, "--free", "j3.stiffness", "--loads", "150")
    assert outcome.code == 2
    assert "--loads, with friction:j3 and readings while unloading" in outcome.err


def test_a_map_has_the_effects_and_says_what_it_leaves_out(
    cli: Command, model: Callable[..., Path], tmp_path: Path
) -> None:
    warming = (
        "parameters.share = { value = 0.2, unit = '1', source = 'assumed' }\nparameters.settling = { value = 0.1, "
    )
    warming = f"[[effect]]\ncode = 'warming:j2'\n{warming}unit = '1', source = 'assumed' }}\n"
    file = model(FRICTION.format(friction=100) + warming)
    outcome = cli("map", "joints", file, "--points", "2", "--no-pictures", "--out", tmp_path / "map")
    assert outcome.code == 0, outcome.err
    found = json.loads((tmp_path / "map" / "map.json").read_text(encoding="utf-8"))["at_load"]
    assert (found["effects"], found["not_linear"], found["left_out"]) == (
        ["friction:j3"],
        ["friction:j3"],
        ["warming:j2"],
    )
    assert found["left_out_worth_N_per_mm"] < 0.0
    assert "base-tilt" not in outcome.err


def test_the_staged_scheme_refuses_effects(cli: Command, model: Callable[..., Path], data_file: Path) -> None:
    file = model(FRICTION.format(friction=100))
    for command in (("calibrate", file, data_file, "--scheme", "staged"), ("run", file, "--out", "chain")):
        outcome = cli(*command)
        assert outcome.code == 2
        assert "a model with effects: got 'friction:j3, base-tilt'" in " ".join(outcome.err.split())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (FRICTION.format(friction=100).replace('"N m"', '"N"'), "unit 'N' is not a unit of torque"),
        (FRICTION.format(friction=100).replace("friction:j3", "friction:j7"), "effect.friction:j7"),
    ],
)
def test_a_wrong_table_ends_with_2(text: str, words: str, cli: Command, model: Callable[..., Path]) -> None:
    outcome = cli("simulate", model(text, "wrong.toml"), *POSE)
    assert outcome.code == 2
    assert words in outcome.err


def test_unload_from_needs_a_pose(cli: Command, data_file: Path) -> None:
    outcome = cli("simulate", "xr701", data_file, "--unload-from", "fz_N=-1300")
    assert outcome.code == 2
    assert "--unload-from" in outcome.err


# --- effects of one's own ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def page() -> str:
    return (ROOT / "docs" / "how-to" / "own_effect.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def flange(page: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of the page, with its test."""
    path = tmp_path_factory.mktemp("own") / "flange.py"
    path.write_text("\n\n".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL)), encoding="utf-8")
    return path


def module_of(path: Path) -> Any:
    import importlib.util

    spec = importlib.util.spec_from_file_location("flange_of_the_page", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_test_on_the_page_passes(flange: Path) -> None:
    module_of(flange).test_the_flange_settles_along_the_force()


@pytest.mark.slow
def test_the_example_of_the_page(
    page: str, flange: Path, cli: Command, model: Callable[..., Path], tmp_path: Path
) -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    file = model("\n" + text, "flange.toml")
    maker = checked_maker(module_of(flange).effects, "flange.py")
    table = write_cycles(tmp_path / "cycles.csv", file, (maker,))
    simulated = cli("simulate", file, table, "--effect", flange, "--out", tmp_path / "simulated", "--json")
    assert simulated.json["rms_mm"] == pytest.approx(NOISE_MM, rel=0.3)
    run = json.loads((tmp_path / "simulated" / "run.json").read_text())
    assert "effect" in json.dumps(run)
    start = model("\n" + text.replace("value = 30", "value = 10"), "flange_start.toml")
    outcome = cli(
        "calibrate",
        start,
        table,
        "--effect",
        flange,
        "--free",
        "j2.stiffness,flange-settling.settling",
        "--out",
        tmp_path / "out",
        "--json",
    )
    assert outcome.code == 0, outcome.err
    numbers = {n["name"]: n for n in outcome.json["parameters"]}
    # 2 um of noise on fifty readings of some 25 um.
    low, high = numbers["flange-settling.settling"]["value_interval95"]
    assert low < 30e-6 < high
    assert numbers["flange-settling.settling"]["value"] == pytest.approx(30e-6, rel=0.1)
    without = cli("simulate", file, table)
    assert without.code == 2
    assert "--effect FILE.py" in without.err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('"length", "um"', '"length", "N"'), "unit 'N' is not a unit of length"),
        (("return d", "return d[:, 0]"), "law of effect flange-settling"),
        (("return d", "return d * np.nan"), "finite numbers"),
        (("def effects(model)", "def others(model)"), "it defines no function 'effects'"),
        (("import numpy as np", "import numpy_of_nobody as np"), "ModuleNotFoundError"),
        (('"flange-settling", words', '"payload", words'), "each code once"),
    ],
)
def test_a_file_with_a_fault_ends_with_2(
    change: tuple[str, str], words: str, flange: Path, cli: Command, model: Callable[..., Path], tmp_path: Path
) -> None:
    file = model(
        '\n[[effect]]\ncode = "payload"\nparameters.force = { value = 20, unit = "N", source = "assumed" }\n',
        "payload.toml",
    )
    wrong = tmp_path / "wrong.py"
    wrong.write_text(flange.read_text(encoding="utf-8").replace(*change), encoding="utf-8")
    outcome = cli("simulate", file, *POSE, "--effect", wrong)
    assert outcome.code == 2
    assert words in " ".join(outcome.err.split())
    assert "Traceback" not in outcome.err


def test_no_such_file_and_one_twice(cli: Command, flange: Path) -> None:
    assert run_here("simulate", "xr701", *POSE, "--effect", "nothing.py").code == 2
    outcome = cli("simulate", "xr701", *POSE, "--effect", flange, "--effect", flange)
    assert outcome.code == 2
    assert "each file once" in outcome.err
