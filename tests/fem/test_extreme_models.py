"""Figures that a model file may hold one by one, and that no arm can have together: bad input, no figure."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refuses

from fem.effects import build_arm, reading_effects
from fem.model import build_model
from fem.springs import WIDEST_LOG, FourierBasis, LawSpring
from robots import load_description
from robots.schema.effects import EffectTable


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("coefficient", [1.01 * WIDEST_LOG, -1.01 * WIDEST_LOG, 1e30, -1e30])
def test_a_law_that_runs_away_gives_no_stiffness(coefficient: float) -> None:
    q = np.zeros((2, 3))
    refuses(
        "M002", "stiffness of a joint by its law", LawSpring(FourierBasis(1, 0), np.array([coefficient])).compliance, q
    )
    assert LawSpring(FourierBasis(1, 0), np.array([14.0])).compliance(q) == pytest.approx(np.exp(-14.0), rel=1e-15)


def test_a_link_that_cannot_be_solved_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def singular(*_: object) -> None:
        raise ArithmeticError("the stiffness matrix is singular")

    monkeypatch.setattr("fem.model.condense", singular)
    monkeypatch.setattr("fem.model._beam_parts", {})
    refuses(
        "M004",
        r"link pedestal: the stiffness matrix is singular.*far too small",
        build_model,
        load_description("xr701"),
        "beam",
    )


@pytest.mark.parametrize(
    ("code", "name", "value", "unit"),
    [
        ("softening:j2", "torque", 1e-300, "N m"),
        ("softening:j2", "power", 900.0, "1"),
        ("backlash:j2", "crossing", 1e-9, "N m"),
    ],
)
def test_numbers_of_a_law_far_from_plausible_are_refused(code: str, name: str, value: float, unit: str) -> None:
    plausible = {
        "softening:j2": {"share": (0.3, "1"), "torque": (500.0, "N m"), "power": (1.0, "1")},
        "backlash:j2": {"gap": (0.5, "mrad"), "crossing": (10.0, "N m")},
    }[code]

    def effects_with(numbers: dict[str, tuple[float, str]]) -> int:
        rows = {key: {"value": v, "unit": u, "source": "assumed"} for key, (v, u) in numbers.items()}
        table = EffectTable.model_validate({"code": code, "parameters": rows})
        description = load_description("xr701").model_copy(update={"effect": (table,)})
        return len(reading_effects(description, build_arm(description, "rigid")))

    assert effects_with(plausible) == 1
    refuses("M011", f"{name}.*not far from what is plausible", effects_with, plausible | {name: (value, unit)})
