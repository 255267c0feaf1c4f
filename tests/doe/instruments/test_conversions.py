"""From files to the table: units, differences with their variance, axes, targets, joined files, what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from refusals import refuses, refuses_each

from doe.instruments.convert import Converted, convert
from doe.instruments.mapping_file import Settings, mapping_text, read_mapping
from doe.instruments.meanings import meaning_of
from robots import load_robot
from robots.frames import rotation_rpy
from robots.kinematics import forward_kinematics

ROBOT = load_robot("kr60-3")
Q = "q1_deg;q2_deg;q3_deg"
ANGLES = ["0;-90;30", "10;-80;40", "20;-70;20"]


def made(tmp_path: Path, *texts: str, **settings: object) -> Converted:
    files = []
    for k, text in enumerate(texts, 1):
        files.append(tmp_path / f"file{k}.csv")
        files[-1].write_text(text, encoding="utf-8")
    columns = settings.pop("columns", {})
    meanings = {name: meaning_of(text, name) for name, text in columns.items()}  # type: ignore[attr-defined]
    return convert(files, Settings(columns=meanings, **settings), ROBOT)  # type: ignore[arg-type]


def column(table: Converted, name: str) -> list[float]:
    k = table.header.index(name)
    return [float(row[k]) if row[k] else np.nan for row in table.rows]


def words(table: Converted, name: str) -> list[str]:
    return [row[table.header.index(name)] for row in table.rows]


def sheet(head: str, *rows: str) -> str:
    return "\n".join([f"{Q};{head}", *(f"{a};{row}" for a, row in zip(ANGLES * 9, rows, strict=False))]) + "\n"


@pytest.mark.parametrize(
    ("head", "cell", "name", "value"),
    [
        ("dz [um]", "-250", "dz_mm", -0.25),
        ("dz [inch]", "-0.01", "dz_mm", -0.254),
        ("dz [mil]", "-10", "dz_mm", -0.254),
        ("dz [1/100mm]", "-25", "dz_mm", -0.25),
        ("dz [m]", "-0.00025", "dz_mm", -0.25),
        ("Rx [rad]", "0.001", "rx_mrad", 1.0),
        ("Ry [deg]", "0.1", "ry_mrad", np.radians(100.0)),
        ("Rz [arcmin]", "6", "rz_mrad", np.radians(100.0)),
    ],
)
def test_units_of_readings(tmp_path: Path, head: str, cell: str, name: str, value: float) -> None:
    table = made(tmp_path, sheet(f"fz_N;{head}", f"-100;{cell}"))
    # Twelve digits are written.
    assert column(table, name) == pytest.approx([value], rel=1e-11)


@pytest.mark.parametrize(
    ("head", "cell", "newtons"),
    [
        ("Mass hung [kg]", "10", -98.0665),
        ("Mass hung [lb]", "10", -44.4822161526),
        ("Mass hung [N]", "98", -98.0),
        ("Fz [kgf]", "-10", -98.0665),
        ("Fz [lbf]", "-10", -44.4822161526),
        ("Fz [kN]", "-0.1", -100.0),
    ],
)
def test_units_of_loads(tmp_path: Path, head: str, cell: str, newtons: float) -> None:
    table = made(tmp_path, sheet(f"{head};dz_mm", f"{cell};-0.2"))
    assert column(table, "fz_N") == pytest.approx([newtons], rel=1e-11)


def test_angles_in_radians_temperatures_and_clocks(tmp_path: Path) -> None:
    head = "J1 [rad];J2 [rad];J3 [rad];fz_N;dz_mm;Temp [degF];Date;Time"
    rows = "0.1;-1.5;0.5;-100;-0.2;70;31.05.2026;23:59:30\n0.2;-1.4;0.5;-100;-0.3;;01.06.2026;00:00:30"
    table = made(tmp_path, f"{head}\n{rows}\n")
    assert column(table, "q1_deg") == pytest.approx(np.degrees([0.1, 0.2]), rel=1e-11)
    assert column(table, "temperature_C")[0] == pytest.approx(21.1111111111, rel=1e-11)
    assert np.isnan(column(table, "temperature_C")[1])
    assert column(table, "time_s") == [0.0, 60.0]


def test_before_and_after_with_the_variance_of_both(tmp_path: Path) -> None:
    head = "Mass hung [kg];Gauge z before [um];Gauge z after [um]"
    text = sheet(head, "10;1000;800", "10;1001;700", "10;1002;-")
    table = made(tmp_path, text, sigma_mm=0.003)
    assert column(table, "dz_mm") == pytest.approx([-0.2, -0.301], rel=1e-11)
    assert column(table, "sigma_mm") == pytest.approx([0.003 * np.sqrt(2.0)] * 2, rel=1e-11)
    assert any("left out: 4" in note for note in table.notes)
    own = made(tmp_path, sheet(f"{head};Sigma before [um];Sigma after [um]", "10;1000;800;3;4"))
    assert column(own, "sigma_mm") == pytest.approx([0.005], rel=1e-11)
    assert "sigma_mm" not in made(tmp_path, text).header, "nothing is known of the scatter"


def test_rows_without_a_load_are_what_others_are_compared_with(tmp_path: Path) -> None:
    rows = [
        "P1;0;-90;30;0;100.0",
        "P1;0;-90;30;-500;99.0",
        "P1;0;-90;30;0;100.2",
        "P2;10;-80;40;0;50",
        "P2;10;-80;40;-500;48.5",
    ]
    table = made(tmp_path, "\n".join([f"pose;{Q};fz_N;z_mm", *rows]), axes="base", sigma_mm=0.01)
    assert column(table, "dz_mm") == pytest.approx([-1.1, -1.5], rel=1e-11)
    # Variances of the reading and of the mean of two, or of one, without a load.
    assert column(table, "sigma_mm") == pytest.approx(0.01 * np.sqrt([1.5, 2.0]), rel=1e-11)
    refuses(
        "I008",
        "no row without a load",
        made,
        tmp_path,
        "\n".join([f"pose;{Q};fz_N;z_mm", *rows[:3], rows[4]]),
        axes="base",
    )


def test_rows_of_one_pose_are_found_by_angles_that_agree_to_a_hundredth_of_a_degree(tmp_path: Path) -> None:
    rows = ["0.0049;-90;30;0;1.0", "0.0051;-90;30;-500;0.5", "10;-90;30;-500;0.5", "10.0099;-90;30;0;0.8"]
    table = made(tmp_path, "\n".join([f"{Q};fz_N;dz_mm", *rows]))
    assert column(table, "dz_mm") == pytest.approx([-0.5, -0.3], rel=1e-11)
    refuses(
        "I008",
        "no row without a load",
        made,
        tmp_path,
        "\n".join([f"{Q};fz_N;dz_mm", *rows]).replace("10.0099", "10.0101"),
    )


def test_a_load_that_was_taken_off_again_is_no_reference_beside_one_before(tmp_path: Path) -> None:
    rows = ["0;-90;30;0;1.0;loading", "0;-90;30;-500;0.0;loading", "0;-90;30;0;0.9;unloading"]
    table = made(tmp_path, "\n".join([f"{Q};fz_N;dz_mm;phase", *rows]))
    assert column(table, "dz_mm") == pytest.approx([-1.0], rel=1e-11)


def test_differences_are_turned_into_base_axes(tmp_path: Path) -> None:
    move = np.array([0.3, -0.2, -0.9])
    seen = rotation_rpy(np.radians([10.0, -20.0, 130.0])).T @ move
    row = "-100;1000;2000;3000;" + ";".join(f"{v:.9f}" for v in np.array([1000, 2000, 3000]) + seen)
    head = "fz_N;X before [mm];Y before [mm];Z before [mm];X after [mm];Y after [mm];Z after [mm]"
    refuses("I007", r"--axes base", made, tmp_path, sheet(head, row))
    table = made(tmp_path, sheet(head, row), axes="10,-20,130")
    # Nine decimals are written in the file.
    assert [column(table, f"d{a}_mm")[0] for a in "xyz"] == pytest.approx(move.tolist(), abs=2e-9)
    for axes in ("10,20", "left", "nan,0,0"):
        refuses("I007", r"--axes", made, tmp_path, sheet(head, row), axes=axes)


def test_targets_of_a_row_become_rows(tmp_path: Path) -> None:
    head = ";".join(f"{t} {a} [mm]" for t in ("SMR1", "SMR2") for a in "XYZ") + ";Operator"
    table = made(tmp_path, sheet(head, "1;2;3;4;5;6;Eva", "7;8;9;-;-;-;Eva"))
    assert words(table, "target") == ["SMR1", "SMR2", "SMR1"]
    assert column(table, "z_mm") == [3.0, 6.0, 9.0]
    assert words(table, "operator") == ["Eva"] * 3
    assert len(made(tmp_path, sheet(head, "1;2;3;4;5;6;Eva"), target="SMR2").rows) == 1
    refuses("I013", "coordinate is missing", made, tmp_path, sheet(head, "1;2;3;4;5;-;Eva"))


def test_a_deflection_is_that_of_one_target(tmp_path: Path) -> None:
    text = sheet("fz_N;target;dz_mm", "-100;a;-0.2", "-100;b;-0.3")
    refuses("I012", r"--target", made, tmp_path, text)
    assert column(made(tmp_path, text, target="b"), "dz_mm") == [-0.3]
    refuses("I012", "'c'", made, tmp_path, text, target="c")


def test_angles_of_another_file_are_joined_by_pose_or_in_order(tmp_path: Path) -> None:
    angles = "\n".join([f"pose;{Q}", *(f"P{k};{a}" for k, a in enumerate(ANGLES, 1))])
    seen = "Point;X [mm];Y [mm];Z [mm]\nP3;1;2;3\nP1;4;5;6\nP3;7;8;9\n"
    table = made(tmp_path, seen, angles)
    assert column(table, "q1_deg") == [20.0, 0.0, 20.0]
    refuses("I006", "'P9'", made, tmp_path, seen.replace("P1", "P9"), angles)
    bare = seen.replace("Point;", "No remark;")
    refuses("I006", r"--join order", made, tmp_path, bare, angles)
    assert column(made(tmp_path, bare, angles, join="order"), "q1_deg") == [0.0, 10.0, 20.0]
    refuses("I006", "has 3 rows", made, tmp_path, bare + "P4;1;2;3\n", angles, join="order")
    refuses("I006", "twice", made, tmp_path, seen, angles + "\nP1;1;-90;30\n")


def test_a_controllers_own_position_is_kept_apart_from_the_trackers(tmp_path: Path) -> None:
    log = "\n".join([f"pose;{Q};X [mm]", *(f"P{k};{a};900" for k, a in enumerate(ANGLES, 1))])
    seen = "pose;X [mm];Y [mm];Z [mm]\nP1;1;2;3\nP2;4;5;6\n"
    refuses("I005", "", made, tmp_path, seen, log)
    table = made(tmp_path, seen, log, columns={"file2.csv:X [mm]": "ignore"})
    assert column(table, "x_mm") == [1.0, 4.0]


def test_several_files_are_sessions(tmp_path: Path) -> None:
    table = made(tmp_path, sheet("x_mm;y_mm;z_mm", "1;2;3"), sheet("x_mm;y_mm;z_mm", "4;5;6"))
    assert words(table, "session") == ["file1", "file2"]


def test_repeats_are_numbered_and_angles_of_one_label_are_one(tmp_path: Path) -> None:
    rows = ["P1;0;-90;30;-100;-0.2", "P1;0.004;-90;30;-100;-0.21", "P1;0;-90;30;-200;-0.4"]
    table = made(tmp_path, "\n".join([f"pose;{Q};fz_N;dz_mm", *rows]))
    assert words(table, "repeat") == ["1", "2", "1"]
    assert column(table, "q1_deg") == [0.0, 0.0, 0.0]
    refuses(
        "I008",
        "differ by",
        made,
        tmp_path,
        "\n".join([f"pose;{Q};fz_N;dz_mm", rows[0], rows[1].replace("0.004", "0.4")]),
    )


def test_values_that_no_file_holds(tmp_path: Path) -> None:
    table = made(tmp_path, sheet("dz_mm", "-0.2"), fill={"hung": "10 kg", "session": "day 1"})
    assert (column(table, "fz_N"), words(table, "session")) == ([-98.0665], ["day 1"])
    for fill in ({"hung": "10"}, {"dz": "1 mm"}, {"hung": "x kg"}, {"colour": "red"}, {"hung": "nan kg"}):
        refuses("I004 I010", "", made, tmp_path, sheet("dz_mm", "-0.2"), fill=fill)


def test_columns_that_are_kept_take_no_name_of_ours(tmp_path: Path) -> None:
    text = sheet("x_mm;y_mm;z_mm;reflector;a_deg;Note", "1;2;3;1.5 in;7;ok")
    table = made(tmp_path, text, columns={"reflector": "keep", "a_deg": "keep"})
    assert {"original reflector", "original a_deg", "Note"} <= set(table.header)


@pytest.mark.parametrize(
    ("text", "settings", "says"),
    [
        (sheet("fz_N;dz_mm", "-100;soft"), {}, "row 2, column dz_mm"),
        (sheet("fz_N;dz_mm", ";-0.2"), {}, "column fz_N is empty"),
        (sheet("dz_mm", "-0.2"), {}, "--fill"),
        (sheet("fz_N;Gauge z before [um]", "-100;5"), {}, "after"),
        (sheet("Mass hung [kg];dz_mm", "-10;-0.2"), {}, "pulls down"),
        (sheet("Mass hung [kg];Gauge z before [um];Gauge z after [um]", "0;5;6", "9;5;6"), {}, "the load is 0"),
        (sheet("fz_N;dz_mm", "-100;-0.2"), {"axes": "base"}, "leave it out"),
        (sheet("fz_N;rx before [deg];rx after [deg]", "-100;-90.1;-90.2"), {}, "up to 20 mrad"),
        (sheet("fz_N;x_mm;y_mm;z_mm;rx_mrad", "0;1;2;3;1", "-1;1;2;3;2"), {"axes": "0,0,9"}, "axes of an instrument"),
        (sheet("fz_N;x_mm;y_mm;z_mm", "-100;1;2;3"), {"axes": "base"}, "load 0"),
        (sheet("fz_N;x_mm;y_mm;z_mm", "-100;1;2;3"), {"kind": "positions"}, "payload kg"),
        (sheet("x_mm;y_mm", "1;2"), {}, "no z"),
        (sheet("x_mm;dx_mm;fz_N", "1;2;-3"), {}, "--kind"),
        (sheet("x_mm;y_mm;z_mm;session", "1;2;3;a", "1;2;3;"), {}, "session in each row"),
        (sheet("fz_N;dz_mm;phase", "-100;-0.2;up"), {}, "loading, unloading"),
        (sheet("fz_N;dz_mm;repeat", "-100;-0.2;1.5"), {}, "whole numbers"),
        (sheet("fz_N;dz_mm;sigma_mm", "-100;-0.2;0"), {}, "above 0"),
        (sheet("Hold;dz_mm", "1;-0.2"), {"columns": {"Halt": "keep"}}, "Halt"),
        ("x_mm;y_mm;z_mm\n1;2;3\n4;5;6\n", {}, "no joint angles"),
        (f"{Q}\n1;2;3\n4;5;6\n", {}, "no readings"),
        (f"q1_deg;q9_deg;{Q[14:]};fz_N;dz_mm\n1;2;3;-100;-0.2\n", {}, "q9"),
        (sheet("fz_N;dz_mm", "-100;-0.2").replace("0;-90", "0;-900"), {}, "q2_deg = -900"),
        (sheet("fz_N;dz_mm", "-100;-0.2").replace("_deg", "_rad"), {}, "ten turns"),
        (sheet("fz_N;dz_mm", "-100;-0.2"), {"kind": "angles"}, "deflections, positions"),
        (sheet("fz_N;dz_mm", "-100;-0.2"), {"units": ("furlong",)}, "--units"),
        (sheet("x_mm;y_mm;z_mm;Time", "1;2;3;31.02.2026"), {}, "31.05.2026"),
    ],
)
def test_what_is_refused_says_what_to_do(tmp_path: Path, text: str, settings: dict[str, object], says: str) -> None:
    refused = refuses("A001 I004 I005 I007 I008 I009 I013 T005", "", made, tmp_path, text, **settings)
    assert says in str(refused)
    assert "To fix it" in str(refused) or "allowed" in str(refused)


def test_all_questions_are_asked_at_once(tmp_path: Path) -> None:
    refused = refuses("I004", "", made, tmp_path, "J1;J2;J3;Load [kg];Gauge [mm]\n1;2;3;4;5\n6;7;8;9;1\n")
    assert all(f"'{name}'" in str(refused) for name in ("J1", "J2", "J3", "Load [kg]", "Gauge [mm]"))


def seen_by_a_tracker(rng: np.random.Generator) -> tuple[list[str], np.ndarray]:
    """Rows of twelve poses, positions before and after in turned axes; and the deflections in base axes."""
    q = rng.uniform([-60, -110, -20, -90, -80, -90], [60, -40, 60, 90, 80, 90], (12, 6))
    frames = forward_kinematics(ROBOT, np.radians(q))
    at = 1e3 * (frames.p_flange + frames.R_flange @ np.array([0.05, -0.02, 0.1]))
    moved = rng.uniform(-1.0, 1.0, (12, 3))
    R = rotation_rpy(np.radians([5.0, -8.0, 140.0]))
    before, after = ((p @ R + [500.0, -800.0, 300.0]).tolist() for p in (at, at + moved))
    cells = [[*angles, -500.0, *b, *a] for angles, b, a in zip(q.tolist(), before, after, strict=True)]
    return [";".join(f"{v:.9f}" for v in row) for row in cells], moved


TRACKED = (
    ";".join(f"q{k}_deg" for k in range(1, 7))
    + ";fz_N;"
    + ";".join(f"{a} {when} [mm]" for when in ("before", "after") for a in "XYZ")
)


def test_a_trackers_axes_are_found_from_its_positions(tmp_path: Path) -> None:
    rows, moved = seen_by_a_tracker(np.random.default_rng(3))
    table = made(tmp_path, "\n".join([TRACKED, *rows]), axes="found")
    # Nine decimals are written in the file; the arm is exactly the model.
    assert np.column_stack([column(table, f"d{a}_mm") for a in "xyz"]) == pytest.approx(moved, abs=1e-6)
    assert any("axes found" in note for note in table.notes)
    refuses("I007", r"--model", convert, [tmp_path / "file1.csv"], Settings(axes="found"))
    refuses("C001", "or more", made, tmp_path, "\n".join([TRACKED, *rows[:4]]), axes="found")
    # A second joint counted the other way brings no frame that half of the readings meet.
    cells = [row.split(";") for row in rows]
    wrong = [";".join([first, str(-150.0 - float(second)), *rest]) for first, second, *rest in cells]
    refuses("I007", "", made, tmp_path, "\n".join([TRACKED, *wrong]), axes="found")


# ------------------------------------------------------------
# The mapping file: what was found once is read back the same, and faults in it are all named

FULL = Settings(
    columns={"Z vor": meaning_of("z mm before", ""), 'odd "name" \\ \t=': meaning_of("x um negated of my ball", "")},
    fill={"session": "day 1"},
    encoding="latin-1",
    separator="tab",
    decimal="comma",
    sheets=("A", "B"),
    names=("a", "b"),
    header=3,
    units=("mm", "deg"),
    sigma_mm=0.02,
    axes="0,0,90",
    join="order",
    target="ball",
    kind="deflections",
)


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    file = tmp_path / "m.toml"
    for made in (FULL, Settings()):
        file.write_text(mapping_text(made, "a file"), encoding="utf-8")
        assert read_mapping(file) == made


@given(
    st.dictionaries(
        st.text(st.characters(exclude_categories=("Cs",)), max_size=8), st.sampled_from(["keep", "q3 deg"])
    ),
    st.text(st.characters(exclude_categories=("Cs",)), max_size=20),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40)
def test_any_name_of_a_column_is_read_back(tmp_path: Path, names: dict[str, str], source: str) -> None:
    made = Settings(columns={name: meaning_of(text, "") for name, text in names.items()})
    file = tmp_path / "m.toml"
    file.write_bytes(mapping_text(made, source).encode())
    assert read_mapping(file) == made


def test_options_go_before_the_file() -> None:
    own = Settings(columns={"Z vor": meaning_of("ignore", "")}, decimal="point", fill={"session": "day 2"})
    both = own.over(FULL)
    assert (both.decimal, both.axes, both.fill) == ("point", "0,0,90", {"session": "day 2"})
    assert str(both.columns["Z vor"]) == "ignore"
    assert len(both.columns) == 2


def test_every_fault_is_named(tmp_path: Path) -> None:
    file = tmp_path / "m.toml"
    file.write_text(
        'schema = "other"\ncolour = 1\ndecimal = 3\nheader = "x"\nsigma_mm = "y"\n'
        'sheets = "a"\n[columns]\na = "z kg"\n',
        encoding="utf-8",
    )
    refused = refuses_each("F006 I004 I011", "", read_mapping, file)
    assert refused.count == 7
    for text in (
        "[[[",
        'schema = "stiffarm-readings/1"\ncolumns = 3\n',
        'schema = "stiffarm-readings/1"\n[fill]\na = 1\n',
    ):
        file.write_text(text, encoding="utf-8")
        refuses("F005 I011", "", read_mapping, file)
