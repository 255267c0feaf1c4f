"""Other units and results beyond small displacements at the command line: refused, confirmed, flagged."""

from __future__ import annotations

import inspect
import json
from pathlib import Path

import pytest
from cli_runs import Command

import stiffarm as sa
from fem import build_model
from machining.cell import Cell
from machining.service import Session
from robots import load_description
from stiffarm.commands.calibrate import command as calibration
from stiffarm.commands.identify import command as identification
from stiffarm.commands.plan import command as planning
from stiffarm.commands.run import command as chain
from stiffarm.session.softness import FLAG

POSE = "q2_deg=5,q3real_deg=77.5"


def _model(folder: Path, **springs: float) -> Path:
    """The xr701 with some of its joints' springs, N m/rad."""
    text = (Path(__file__).parents[3] / "robots" / "data" / "xr701.toml").read_text(encoding="utf-8")
    for name, value in springs.items():
        spring = f'stiffness = {{ value = {value}, unit = "N m/rad", source = "assumed" }}'
        text = text.replace(f'name = "{name}"\n', f'name = "{name}"\n{spring}\n', 1)
    file = folder / "model.toml"
    file.write_text(text, encoding="utf-8")
    return file


def _table(folder: Path, data_file: Path, column: str, factor: float) -> Path:
    """The bundled readings with one column so many times as large."""
    head, *rows = [line.split(",") for line in data_file.read_text(encoding="utf-8").splitlines() if line]
    k = head.index(column)
    for row in rows:
        row[k] = repr(float(row[k]) * factor)
    file = folder / "typed.csv"
    file.write_text("\n".join(",".join(row) for row in (head, *rows)) + "\n", encoding="utf-8")
    return file


def test_a_table_in_other_units_is_refused_and_taken_if_confirmed(
    cli: Command, tmp_path: Path, data_file: Path
) -> None:
    table = _table(tmp_path, data_file, "dz_mm", 100.0)
    arguments = ("calibrate", "xr701", table, "--scheme", "global", "--json")
    refused = cli(*arguments)
    assert (refused.code, refused.out) == (2, "")
    assert "these look like deflections in dial divisions of 1/100 mm" in refused.err
    assert "--confirm-units" in refused.err
    taken = cli(*arguments, "--confirm-units")
    assert taken.code == 0, taken.err
    assert "taken as it is, though it looks like deflections in dial divisions" in taken.err


@pytest.mark.parametrize(
    "arguments", [("simulate",), ("sensitivity",), ("plan", "--poses", "3"), ("diagnose",), ("run",)]
)
def test_every_command_asks(cli: Command, tmp_path: Path, data_file: Path, arguments: tuple[str, ...]) -> None:
    table = _table(tmp_path, data_file, "dz_mm", 0.1)
    outcome = cli(arguments[0], "xr701", table, *arguments[1:])
    assert outcome.code == 2, outcome.err
    assert "these look like deflections in centimetres" in outcome.err


def test_a_table_held_out_is_asked_too(cli: Command, tmp_path: Path, data_file: Path) -> None:
    table = _table(tmp_path, data_file, "fz_N", 1.0 / 9.80665)
    outcome = cli("calibrate", "xr701", "--scheme", "global", "--holdout", table)
    assert outcome.code == 2, outcome.err
    assert "loads in kgf" in outcome.err


def test_all_that_read_tables_have_the_flag() -> None:
    commands = (
        calibration.calibrate,
        chain.run,
        identification.identify,
        planning.plan,
    )
    for command in commands:
        assert "confirm_units" in inspect.signature(command).parameters, command
    for function in (sa.diagnose, sa.simulate, sa.sensitivity):
        assert "confirm_units" in inspect.signature(function).parameters


def test_readings_beyond_small_displacements_are_refused_though_confirmed(
    cli: Command, tmp_path: Path, data_file: Path
) -> None:
    table = _table(tmp_path, data_file, "dz_mm", 1000.0)
    outcome = cli("calibrate", "xr701", table, "--scheme", "global", "--confirm-units")
    assert outcome.code == 2, outcome.err
    assert "beyond small displacements" in outcome.err


@pytest.mark.parametrize(
    "arguments",
    [
        ("simulate", "--pose", POSE),
        ("fit", "--out", "fit"),
        ("index", "--pose", POSE),
        ("serve",),
        ("plan", "--poses", "3"),
    ],
)
def test_a_spring_of_1_newton_metre_is_refused_by_name(
    cli: Command, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    """j2 of 1 N m/rad sagged by 68 m under 650 N."""
    model = _model(tmp_path, j2=1.0, j3=8e5)
    outcome = cli(arguments[0], model, *arguments[1:])
    assert (outcome.code, outcome.out) == (2, ""), outcome.err
    assert "beyond small displacements at every pose" in outcome.err
    assert "j2, stiffness (N m/rad): got '1'" in outcome.err
    assert "4.32e+05 to 4.32e+06" in outcome.err


def test_a_load_beyond_small_displacements_is_refused(cli: Command) -> None:
    outcome = cli("simulate", "kr60-3", "--pose", "q2_deg=-60,q3_deg=30", "--load", "fz_N=-100000", "--json")
    assert (outcome.code, outcome.out) == (2, "")
    assert "--pose under --load: beyond small displacements" in outcome.err


def test_rows_of_a_table_are_flagged_one_by_one(cli: Command, tmp_path: Path) -> None:
    """One load of 65 t among those of a measurement: its row does not hold, the others do."""
    model = _model(tmp_path, j2=1.4e6, j3=8e5)
    table = tmp_path / "two.csv"
    rows = "5,77.5,-650,-1.9", "5,77.5,-650000,-1900", "10,77.5,-650,-1.9"
    table.write_text("\n".join(("q2_deg,q3real_deg,fz_N,dz_mm", *rows)) + "\n", encoding="utf-8")
    outcome = cli("simulate", model, table, "--json")
    assert outcome.code == 0, outcome.err
    assert [row.get(FLAG, False) for row in outcome.json["readings"]] == [False, True, False]
    assert "1 of 3 beyond small displacements" in outcome.err


def test_answers_of_the_service_carry_the_flag() -> None:
    description = load_description("kr60-3")
    session = Session(build_model(description), Cell())

    def answer(**request: object) -> dict[str, object]:
        return dict(json.loads(session.answer(json.dumps(request).encode())))

    q = [0.0, -60.0, 30.0, 0.0, 30.0, 0.0]
    small = answer(do="deflection", q_deg=q, force_N=[0, 0, -500])
    assert small["ok"] is True
    assert FLAG not in small
    large = answer(do="deflection", q_deg=q, force_N=[0, 0, -1e5])
    assert large[FLAG] is True
    several = answer(do="deflection", q_deg=[q, q], force_N=[[0, 0, -500], [0, 0, -1e5]])
    assert several[FLAG] == [False, True]
