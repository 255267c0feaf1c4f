"""Figures far beyond any arm are refused as they are read, so that no later product overflows."""

from __future__ import annotations

import warnings
from importlib import resources
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError
from refusals import refuses

from robots import load_description
from robots.schema import quantities as q
from robots.schema import units
from robots.schema.effects import EffectNumber
from robots.schema.quantities import LARGEST_NUMBER, Quantity, Scalar, Strict
from robots.schema.springs import LogFourierLaw, LogPolynomialLaw, TableLaw
from robots.schema.units import DIMENSIONS, Dimension, check_magnitude, dimension_of

MODEL = resources.files("robots").joinpath("data", "xr701.toml").read_text(encoding="utf-8")
KINDS = [kind for kind in vars(q).values() if isinstance(kind, type) and issubclass(kind, Quantity) and kind.dimension]
KINDS.remove(q.PoissonsRatio)  # its own range is narrower
POSITIVE = [kind for kind in KINDS if issubclass(kind, q._Positive)]


@pytest.fixture(autouse=True)
def _no_warnings() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def of(kind: type[Quantity], number: float, unit: str) -> Quantity:
    value: Any = number
    if issubclass(kind, q._Triple):
        value = (0.0, number, 0.0)
    elif issubclass(kind, q._Range):
        value = (0.0, number)
    return kind(value=value, unit=unit, source="assumed")


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_no_quantity_is_beyond_its_range_in_any_unit(kind: type[Quantity]) -> None:
    for unit, factor in DIMENSIONS[kind.dimension].units.items():
        most = DIMENSIONS[kind.dimension].most / factor
        of(kind, 0.999 * most, unit)
        for number in (1.001 * most, 1e25, 1e308):
            with pytest.raises(ValidationError, match="at most"):
                of(kind, number, unit)


@pytest.mark.parametrize("kind", POSITIVE, ids=lambda kind: kind.__name__)
def test_no_positive_quantity_is_next_to_nothing(kind: type[Quantity]) -> None:
    for unit, factor in DIMENSIONS[kind.dimension].units.items():
        of(kind, 1.001 * DIMENSIONS[kind.dimension].least / factor, unit)
        with pytest.raises(ValidationError, match="at least"):
            of(kind, 1e-300, unit)


def test_every_dimension_has_a_range_and_an_si_unit() -> None:
    for dimension in DIMENSIONS.values():
        assert dimension.units[dimension.si] == 1.0
        assert 0.0 < dimension.least < dimension.most
    with pytest.raises(ValueError, match="at most 1e\\+06 mm"):
        check_magnitude("length", "mm", 1e300)
    assert dimension_of("kN m/rad") == "rotational stiffness"


def test_a_quantity_made_up_here_needs_no_other_file(monkeypatch: pytest.MonkeyPatch) -> None:
    made_up = {**DIMENSIONS, "speed": Dimension({"m/s": 1.0, "mm/s": 1e-3}, 1e-9, 1e3)}
    monkeypatch.setattr(units, "DIMENSIONS", made_up)

    class Speed(Scalar):
        dimension = "speed"

    assert Speed(value=250.0, unit="mm/s", source="assumed").si == 0.25
    for value, unit in ((1e9, "mm/s"), (1.0, "mm")):
        with pytest.raises(ValidationError):
            Speed(value=value, unit=unit, source="assumed")


def test_an_effects_number_is_judged_by_its_unit() -> None:
    EffectNumber(value=1e14, unit="N m/rad", source="assumed")
    for number, unit in ((1e14, "mm"), (1e308, "N m/rad"), (-1e10, "rad")):
        with pytest.raises(ValidationError, match="at most"):
            EffectNumber(value=number, unit=unit, source="assumed")


def test_bare_numbers_are_bounded_wherever_they_stand() -> None:
    class Table(Strict):
        one: float
        rows: tuple[tuple[int, ...], ...] = ()
        named: dict[str, float] = {}  # noqa: RUF012 - pydantic copies it

    Table(one=LARGEST_NUMBER, rows=((1, -2),), named={"a": -1e29})
    for bad in ({"one": 1e31}, {"one": 0.0, "rows": ((1,), (10**40,))}, {"one": 0.0, "named": {"a": -1e300}}):
        with pytest.raises(ValidationError, match="at most 1e\\+30"):
            Table(**bad)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "table"),
    [
        (LogPolynomialLaw, {"exponents": ((21,),)}),
        (LogPolynomialLaw, {"half_range_deg": (1e-200,)}),
        (LogPolynomialLaw, {"coefficients": (1e300,)}),
        (TableLaw, {"stiffness_Nm_per_rad": (1e6, 1e-200)}),
        (TableLaw, {"stiffness_Nm_per_rad": (1e6, 1e200)}),
        (LogFourierLaw, {"coefficients": (-1e300,)}),
    ],
)
def test_laws_that_would_overflow_are_refused(kind: type[Strict], table: dict[str, Any]) -> None:
    good: dict[type[Strict], dict[str, Any]] = {
        LogPolynomialLaw: {
            "inputs": ("q1_deg",),
            "centre_deg": (0.0,),
            "half_range_deg": (90.0,),
            "exponents": ((1,),),
            "coefficients": (14.0,),
        },
        TableLaw: {"kind": "table", "input": "q1_deg", "nodes_deg": (0.0, 1.0), "stiffness_Nm_per_rad": (1e6, 2e6)},
        LogFourierLaw: {"kind": "log-fourier", "input": "q1_deg", "coefficients": (14.0,)},
    }
    kind(**good[kind], source="assumed")
    with pytest.raises(ValidationError):
        kind(**(good[kind] | table), source="assumed")


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("beam_up = [1, 0, 0]", "beam_up = [1e308, 1e308, 0]", "link.carousel.beam_up"),
        ("beam_up = [1, 0, 0]", "beam_up = [1, 0, 1e400]", "link.carousel.beam_up"),
        ("mass = { value = ", 'mass = { value = 1e200, note = "" } #', "mass"),
    ],
)
def test_a_model_file_with_such_a_figure_is_refused_by_its_place(
    old: str, new: str, place: str, tmp_path: Path
) -> None:
    assert old in MODEL
    (tmp_path / "model.toml").write_text(MODEL.replace(old, new), encoding="utf-8")
    refuses("F011", place, load_description, tmp_path / "model.toml")


URDF = """<robot name="r"><link name="base"/><link name="l1"><inertial><mass value="5"/></inertial>
<visual><geometry><box size="1 1 1"/></geometry></visual></link><link name="end"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 0.3" rpy="0 0 0"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1.5"/></joint>
<joint name="jf" type="fixed"><parent link="l1"/><child link="end"/><origin xyz="0 0.1 0" rpy="0 0 0"/></joint>
</robot>"""


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("0 0 0.3", "1e200 1e200 0", "joint j1: origin xyz"),
        ("0 0.1 0", "1e308 0 0", "joint jf: origin xyz"),
        ("0 0.1 0", "9e5 0 0", "position must be at most 1000 m"),
        ('0.1 0" rpy="0 0 0"', '0.1 0" rpy="1e308 1e300 0"', "joint jf: origin rpy"),
        ('axis xyz="0 0 1"', 'axis xyz="1e200 1e200 0"', "joint j1: axis xyz"),
        ('mass value="5"', 'mass value="1e308"', "link l1: mass value"),
        ('box size="1 1 1"', 'box size="1e200 1 1"', "link l1: box size"),
        ('lower="-1"', 'lower="-1e308"', "joint j1: limit lower"),
        ('lower="-1"', 'lower="-1e16"', "continuous if it turns without end"),
    ],
)
def test_urdf_figures_whose_products_overflow_are_refused(old: str, new: str, says: str, tmp_path: Path) -> None:
    file = tmp_path / "r.urdf"
    file.write_text(URDF, encoding="utf-8")
    load_description(file)
    assert old in URDF
    file.write_text(URDF.replace(old, new), encoding="utf-8")
    refuses("R013", says, load_description, file)


def test_masses_that_are_too_large_together_are_bad_input_too(tmp_path: Path) -> None:
    heavy = URDF.replace('mass value="5"', 'mass value="9e5"')
    heavy = heavy.replace('<link name="end"/>', '<link name="end"><inertial><mass value="9e5"/></inertial></link>')
    (tmp_path / "r.urdf").write_text(heavy, encoding="utf-8")
    refuses("R013", "mass must be at most", load_description, tmp_path / "r.urdf")
