"""Arithmetic in texts of benchmarks: worked out, never run."""

from __future__ import annotations

import math

import arithmetic
import pytest


def test_sums_products_powers_functions_and_names() -> None:
    names = {"pi": math.pi, "radians": math.radians, "prefix": ""}
    assert arithmetic.value(" -2 * (3 + 0.5)**2 / 7", names) == -2 * (3 + 0.5) ** 2 / 7
    assert arithmetic.value("-pi / 2", names) == -math.pi / 2
    assert arithmetic.value("radians(90)", names) == math.radians(90)
    assert arithmetic.value("prefix", names) == ""


@pytest.mark.parametrize("text", ["", "1 +", "unknown", "__import__('os')", "(1).real", "[1]", "'a'", "radians(1, 2)"])
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="arithmetic"):
        arithmetic.value(text, {"radians": math.radians})
