"""What an effect is stands in its own file: nothing else asks for its code."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np
import pytest

from fem import ArmModel, build_model
from fem.effects import Effect, EffectParameter, catalogue
from fem.effects.base import ASSUMED_LAW
from robots import load_description

ROOT = Path(__file__).resolve().parents[3]
# Not `rehearsal`: a world that shares nothing names its effects itself.
PACKAGES = ("robots", "meshes", "fem", "doe", "surrogate", "machining", "stiffarm")
# Families whose names are also plain words, and the one that a description's load path asks for.
WORDS = {"payload", "load-path", "drift"}
# A catalogue of its own: what positions may be asked for.
OTHER_CATALOGUE = ROOT / "doe" / "absolute" / "missing" / "candidates.py"


@pytest.fixture(scope="module")
def model() -> ArmModel:
    return build_model(load_description("xr701"))


@pytest.fixture(scope="module")
def known(model: ArmModel) -> dict[str, Effect]:
    return catalogue(model, load_description("xr701"))


def asked(text: str, families: set[str]) -> list[str]:
    """Families that a source compares or looks up by name."""
    # Parsing all files would take most of the test's time.
    if not re.search(f"[\"']({'|'.join(families)})\\b", text):
        return []
    strings = (n.value for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Constant) and isinstance(n.value, str))
    return [s for s in strings if s.partition(":")[0] in families]


def test_no_other_file_asks_for_a_family_by_name(known: dict[str, Effect]) -> None:
    families = {code.partition(":")[0] for code in known} - WORDS
    assert len(families) > 15
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            if "effects" in path.relative_to(ROOT).parts[:-1] or path == OTHER_CATALOGUE:
                continue
            assert not asked(path.read_text(encoding="utf-8"), families), path
    assert asked("x.code.startswith('warming')", families) == ["warming"]  # it can be seen


def test_every_number_says_what_it_means(known: dict[str, Effect]) -> None:
    assert not [f"{code}.{p.name}" for code, effect in known.items() for p in effect.parameters if not p.meaning]


def test_what_a_diagnosis_takes_of_an_effect(known: dict[str, Effect]) -> None:
    doubts = {code: known[code].law_doubt for code in ("friction:j2", "base-tilt", "payload", "drift", "gauge-zero")}
    assert doubts == {"friction:j2": 0.1, "base-tilt": 0.04, "payload": 0.04, "drift": 0.1, "gauge-zero": 0.0}
    assert known["load-path"].law_doubt == 0.0  # nothing of it is free
    assert {e.family for e in known.values() if e.needs_clock} == {"drift", "warming"}
    drawn = {family: known[f"{family}:j2"].drawn_over for family in ("friction", "gear-ripple", "joint-tilt")}
    assert drawn == {"friction": "torque", "gear-ripple": "angle", "joint-tilt": None}
    assert {e.slot for e in known.values() if e.place == "j2"} == {"", "bend", "lag"}
    usual = {e.family for e in known.values() if e.usual > 0.0}
    assert usual == {"link-flexibility", "joint-zero-offset"}


def test_an_effect_made_up_here_needs_no_other_file(model: ArmModel) -> None:
    """Everything that a diagnosis, a file and a page say of an effect comes from the effect."""

    def law(d: np.ndarray, s: object, v: np.ndarray) -> np.ndarray:
        return np.asarray(d * (1.0 + v[0]))

    share = EffectParameter("share", "ratio", "%", 0.01, 0.1, "assumed", signed=True, meaning="how much it warms up")
    warming = Effect(
        "warming", "the arm warms up", "gauge", (share,), law, "warming", depends_on="clock", doubt=ASSUMED_LAW
    )
    known = catalogue(model, own=[lambda _: [warming]])
    assert known["warming"].needs_clock
    assert known["warming"].law_doubt == ASSUMED_LAW
    assert known["warming"].parameters[0].meaning == "how much it warms up"
