"""What names of columns are taken for, and what is asked about instead."""

from __future__ import annotations

import pytest
from refusals import refuses

from doe.instruments.meanings import meaning_of
from doe.instruments.recognised import Recognised, recognise


def found(*header: str, kinds: dict[str, str] | None = None, **more: object) -> Recognised:
    every = [(kinds or {}).get(name, "number") for name in header]
    return recognise(header, [""] * len(header), every, **{"given": {}, **more})  # type: ignore[arg-type]


SURE = {
    "q1_deg": "q1 deg",
    "fz_N": "fz N",
    "dz_mm": "dz mm",
    "x_mm": "x mm",
    "sigma_mm": "sigma mm",
    "time_s": "time s",
    "temperature_C": "temperature C",
    "X [mm]": "x mm",
    "X (in)": "x inch",
    "Y_um": "y um",
    "Z/mm": "z mm",
    "Actual X [mm]": "x mm",
    "Measured Z [inch]": "z inch",
    "X vor [mm]": "x mm before",
    "Z nachher (\u00b5m)": "z um after",
    "Messuhr Z [\u00b5m]": "dz um",
    "Gauge z before [1/100mm]": "dz 1/100mm before",
    "Deflection Z [mil]": "dz mil",
    "Fz [kgf]": "fz kgf",
    "Kraft Z [N]": "fz N",
    "Mz [N m]": "mz Nm",
    "Mass hung [kg]": "hung kg",
    "Angeh\u00e4ngte Masse (kg)": "hung kg",
    "Payload [lb]": "payload lb",
    "Nutzlast [kg]": "payload kg",
    "Rail [m]": "rail m",
    "Temperatur [\u00b0C]": "temperature C",
    "Temp [degF]": "temperature F",
    "Std dev [um]": "sigma um",
    "Nominal X [mm]": "keep",
    "Dev X [mm]": "keep",
    "Abweichung X [mm]": "keep",
    "Azimuth [deg]": "keep",
    "Pressure [hPa]": "keep",
    "Bemerkung": "keep",
    "Bediener": "operator",
    "Operator": "operator",
    "Tracker": "instrument",
    "Station": "session",
    "Punkt": "pose",
    "Reflector": "target",
    "Wiederholung": "repeat",
    "Rx [mrad]": "rx mrad",
}


@pytest.mark.parametrize("name", SURE)
def test_names_that_are_sure(name: str) -> None:
    made = found(name)
    assert not made.questions
    assert str(made.meanings[name]) == SURE[name]


ASKED = {
    "X": "--units mm",
    "Z": '--column "Z=z mm"',
    "Temperature": "temperature C",
    "Load [kg]": "payload kg",
    "Last (kg)": "hung kg",
    "Weight [kg]": "hung kg",
    "Load [N]": "fz N",
    "Force [lbf]": "hung lbf",
    "Gauge [mm]": "dz mm",
    "Messuhr vor [\u00b5m]": "dz um before",
    "Fz [kg]": "fz kgf",
    "elbow [deg]": "q1 deg",
    "E1 [mm]": "rail mm",
    "q0": "q1 deg",
    "J3 [deg]": "q3 deg",
    "A2": "q2 deg",
    "X [kg]": "x mm",
    "Payload [N]": "hung N",
    "Sigma": "sigma mm",
}


@pytest.mark.parametrize("name", ASKED)
def test_names_that_are_not_sure_are_asked_about_with_the_option(name: str) -> None:
    made = found(name)
    assert name not in made.meanings
    (question,) = made.questions
    options = " ".join(question.options)
    assert ASKED[name] in options
    for option in question.options:  # each option that is offered is one that is taken
        if option.startswith("--column"):
            column, _, meaning = option.removeprefix('--column "').removesuffix('"').rpartition("=")
            assert column == name
            again = found(name, given={name: meaning_of(meaning, "")})
            assert not again.questions


@pytest.mark.parametrize(
    "names",
    [
        ("A1 [deg]", "A2 [deg]", "A3 [deg]"),
        ("J1_deg", "J2_deg", "J3_deg"),
        ("Axis 1 (\u00b0)", "Axis 2 (\u00b0)", "Axis 3 (\u00b0)"),
        ("theta1 [rad]", "theta2 [rad]", "theta3 [rad]"),
        ("Joint 1 angle [deg]", "Joint 2 angle [deg]", "Joint 3 angle [deg]"),
    ],
)
def test_joints_counted_from_one_are_joints(names: tuple[str, ...]) -> None:
    made = found(*names)
    assert [made.meanings[name].what for name in names] == ["q1", "q2", "q3"]


def test_joints_of_a_urdf_by_name() -> None:
    names = [f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]
    assert [m.what for m in found(*names, said=("rad",)).meanings.values()] == [f"q{k}" for k in range(1, 7)]
    assert len(found(*names).questions) == 6
    assert found(*names[1:], said=("rad",)).questions, "one is missing: what the others are is not sure"


def test_letters_behind_an_underscore_are_no_tons() -> None:
    assert str(found("x_t").meanings["x_t"]) == "keep"
    assert str(found("measurement_x", said=("mm",)).meanings["measurement_x"]) == "x mm"


def test_joints_with_a_gap_or_without_units_are_asked_about() -> None:
    assert len(found("J1 [deg]", "J2 [deg]", "J4 [deg]").questions) == 3
    assert len(found("J1", "J2", "J3").questions) == 3
    assert not found("J1", "J2", "J3", said=("rad",)).questions
    assert not found("J1", "J2", "J3", stated=("deg",)).questions


def test_targets_beside_one_another() -> None:
    three = found(*(f"{a}{k} [mm]" for k in (1, 2, 3) for a in "XYZ"))
    assert [str(m) for m in three.meanings.values()][:4] == ["x mm of 1", "y mm of 1", "z mm of 1", "x mm of 2"]
    named = found("SMR1 X [mm]", "SMR2 X [mm]")
    assert [m.target for m in named.meanings.values()] == ["SMR1", "SMR2"]


def test_two_numbered_positions_may_be_before_and_after() -> None:
    made = found("X1 [mm]", "X2 [mm]")
    assert len(made.questions) == 2
    assert "before" in " ".join(made.questions[0].options)


def test_units_that_are_given_go_before_units_that_the_file_states() -> None:
    assert found("X", stated=("inch",)).meanings["X"].unit == "inch"
    assert found("X", stated=("inch",), said=("mm",)).meanings["X"].unit == "mm"
    assert found("X [um]", stated=("inch",), said=("mm",)).meanings["X [um]"].unit == "um"
    assert found("X", stated=("inch", "mm")).questions
    assert found("Load [kg]", "X", said=("kg", "mm")).questions[0].column == "Load [kg]"


def test_units_of_all_columns_are_not_those_of_small_rotations_and_deviations() -> None:
    assert [q.column for q in found("J1", "J2", "J3", "Rx", "Sigma", said=("rad", "mm")).questions] == ["Rx", "Sigma"]


def test_deviations_beside_nominal_coordinates_are_no_deflections() -> None:
    assert str(found("Delta X [mm]").meanings["Delta X [mm]"]) == "dx mm"
    assert str(found("Nominal X [mm]", "Delta X [mm]").meanings["Delta X [mm]"]) == "keep"


def test_columns_that_would_hold_the_same_are_asked_about() -> None:
    made = found("X [mm]", "Actual X [mm]")
    assert [q.column for q in made.questions] == ["Actual X [mm]"]


def test_dates_are_asked_about_where_day_and_month_may_be_either() -> None:
    assert found("Time", kinds={"Time": "iso"}).meanings["Time"].unit == "iso"
    assert "mdy" in " ".join(found("Time", kinds={"Time": "text"}).questions[0].options)
    assert "time s" in " ".join(found("Time").questions[0].options)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "z kg",
        "w mm",
        "z mm sideways",
        "q0 deg",
        "pose mm",
        "hung mm",
        "q1 N",
        "fz before",
        "keep mm",
        "session of a",
        "z mm inch",
        "time mm",
    ],
)
def test_meanings_that_are_none(text: str) -> None:
    refuses("I004", "w", meaning_of, text, "w")
