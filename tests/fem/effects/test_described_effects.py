"""Effects in a model file: read, built, written and removed, and every kind of fault."""

from __future__ import annotations

import numpy as np
import pytest
from effect_arms import SPRINGS, of, plausible
from refusals import refuses, refuses_each

from fem import build_model, deflection
from fem.effects import (
    Effect,
    EffectParameter,
    build_arm,
    catalogue,
    checked_maker,
    described_effects,
    path_of,
    reading_effects,
    with_effects,
    with_load_path,
    without_effect,
)
from robots import ModelDescription, content_hash, load_description
from robots.library.models import parse_description, to_toml

DESCRIPTION = load_description("xr701")
PLAIN = to_toml(DESCRIPTION)
RIGID = build_model(DESCRIPTION, links="rigid")
BACKLASH = """
[[effect]]
code = "backlash:j2"
[effect.parameters]
gap = { value = 0.5, unit = "mrad", source = "assumed", note = "by hand" }
crossing = { value = 20, unit = "N m", source = "assumed" }
preload = { value = 100, unit = "%", source = "assumed" }
"""
Q = np.array([[0.2, 0.3, 1.4, 0.5, -0.6, 0.0]])
DOWN = np.array([0.0, 100.0, -650.0, 0.0, 0.0, 0.0])


def read(text: str) -> ModelDescription:
    return parse_description(PLAIN + text, "model.toml")


def number(**parts: object) -> str:
    shown = {"value": 0.5, "unit": "mrad", "source": "assumed", **parts}
    return "{ " + ", ".join(f"{k} = {v!r}" for k, v in shown.items()).replace("'", '"') + " }"


def test_numbers_come_in_si() -> None:
    d = read(BACKLASH)
    (placed,) = described_effects(d, build_arm(d))
    assert placed.effect.code == "backlash:j2"
    assert placed.by_name == pytest.approx({"gap": 5e-4, "crossing": 20.0, "preload": 1.0, "pressed": 0.0})
    assert reading_effects(d, build_arm(d)) == (placed,) or len(reading_effects(d, build_arm(d))) == 1


def test_every_effect_goes_through_a_file() -> None:
    arm = build_model(DESCRIPTION)
    placed = [plausible(e, 0.7) for code, e in catalogue(arm, DESCRIPTION).items() if code != "load-path"]
    d = parse_description(to_toml(with_effects(DESCRIPTION, placed, "diagnosed")), "written")
    back = described_effects(d, arm)
    assert [e.effect.code for e in back] == [e.effect.code for e in placed]
    for one, other in zip(back, placed, strict=True):
        np.testing.assert_allclose(one.values, other.values, rtol=1e-12)
        d = without_effect(d, one.effect.code)
    assert d.effect == ()


def test_effects_of_the_model_are_in_the_arm_and_no_others() -> None:
    arm = build_model(DESCRIPTION).with_springs(SPRINGS)
    tilt = of(arm, "base-tilt", stiffness_x=2e7, stiffness_y=1e7)
    zero = of(arm, "gauge-zero", x=0.0, y=0.0, z=3e-5)
    d = with_effects(DESCRIPTION, [tilt, zero], "diagnosed")
    built = build_arm(d)
    np.testing.assert_allclose(built.base[[3, 4], [3, 4]], [5e-8, 1e-7], rtol=1e-12)
    assert [e.effect.code for e in reading_effects(d, built)] == ["gauge-zero"]
    assert [e.effect.code for e in described_effects(d, built)] == ["base-tilt", "gauge-zero"]
    assert not build_model(d).base.any()


def test_a_description_without_effects_keeps_model_file_and_hash() -> None:
    assert "effect" not in PLAIN
    d = read(BACKLASH)
    assert content_hash(d) != content_hash(DESCRIPTION)
    assert content_hash(without_effect(d, "backlash:j2")) == content_hash(DESCRIPTION)
    assert build_arm(DESCRIPTION).robot.name == "xr701"


def test_adding_replaces_by_code_and_loses_nothing() -> None:
    arm = build_model(DESCRIPTION)
    d = read(BACKLASH)
    bigger = of(arm, "backlash:j2", gap=1e-3, crossing=30.0, preload=0.0)
    tilt = of(arm, "base-tilt", stiffness_x=np.float64(2e7), stiffness_y=1e7)
    changed = with_effects(d, [tilt, bigger], "diagnosed", {"backlash:j2.gap": "0.9 to 1.1 mrad"}, "diagnosis of x.csv")
    assert [e.code for e in changed.effect] == ["backlash:j2", "base-tilt"]
    assert changed.effect[0].parameters["gap"].value == pytest.approx(1.0)
    assert changed.effect[0].parameters["gap"].note == "0.9 to 1.1 mrad"
    assert changed.sources["diagnosed"] == "diagnosis of x.csv"
    same = {k: v for k, v in changed.model_dump().items() if k not in ("effect", "sources")}
    assert same == {k: v for k, v in d.model_dump().items() if k not in ("effect", "sources")}
    assert without_effect(without_effect(changed, "base-tilt"), "base-tilt").effect == changed.effect[:1]


def test_an_amplitude_left_out_is_zero_and_zero_is_left_out() -> None:
    d = read(
        '[[effect]]\ncode = "base-tilt"\n[effect.parameters]\nstiffness_y = '
        '{ value = 2e7, unit = "N m/rad", source = "assumed" }\n'
    )
    (placed,) = described_effects(d, build_arm(d))
    np.testing.assert_allclose(placed.values, [0.0, 5e-8, 0.0])
    again = with_effects(DESCRIPTION, [placed], "diagnosed")
    assert set(again.effect[0].parameters) == {"stiffness_y", "heading"}


def test_load_path_in_a_file() -> None:
    arm = build_model(DESCRIPTION)
    d = with_effects(DESCRIPTION, [of(arm, "load-path", DESCRIPTION)], "diagnosed")
    serial = build_model(DESCRIPTION, load_path="serial").with_springs(SPRINGS)
    built = build_arm(d)
    assert (path_of(d), built.load_path) == ("serial", "serial")
    np.testing.assert_array_equal(deflection(built.with_springs(SPRINGS), Q, DOWN), deflection(serial, Q, DOWN))
    # The option goes before the file; and then the file of that arm says so without an effect.
    assert build_arm(d, load_path="parallelogram").load_path == "parallelogram"
    assert with_load_path(d, "parallelogram").effect == ()
    assert with_load_path(d, "serial") == d
    for start in (build_model(d), built):
        (placed,) = described_effects(d, start)
        assert placed.effect.law(start, None, placed.values).load_path == "serial"


def test_the_bar_of_a_load_path_that_came_by_an_effect() -> None:
    d = DESCRIPTION.model_copy(update={"load_path": "serial"})
    both = '[[effect]]\ncode = "load-path"\n[[effect]]\ncode = "parallelogram-bar"\n[effect.parameters]\nstiffness = '
    text = to_toml(d) + both + '{ value = 5e7, unit = "N/m", source = "assumed" }\n'
    built = build_arm(parse_description(text, "both"))
    plain = build_model(DESCRIPTION)
    assert built.bar is not None
    assert plain.bar is not None
    assert built.bar.compliance == pytest.approx(plain.bar.compliance + 2e-8)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BACKLASH.replace("j2", "j9"), r"xr701: effect.backlash:j9: this model has no such effect.*backlash:\{j1\|j2"),
        (BACKLASH.replace("gap", "gop"), r"effect.backlash:j2.parameters: unknown parameter: got 'gop'; allowed: gap"),
        (BACKLASH.replace('"mrad"', '"N"'), r"backlash:j2.parameters.gap: unit 'N' is not a unit of angle"),
        (BACKLASH.replace('"mrad"', '"furlong"'), r"unit 'furlong' is not known"),
        (BACKLASH.replace("0.5", "-0.5"), r"parameters.gap: got -0.5; allowed: 0 or more, plausible 0.2 to 1.8 mrad"),
        (BACKLASH.replace("value = 20", "value = 0"), r"parameters.crossing: got 0.*greater than 0"),
        (BACKLASH.replace("0.5", "nan"), r"gap.value: must be a finite number"),
        (BACKLASH.replace("0.5", "[1, 2]"), r"effect.backlash:j2.parameters.gap.value: must be a valid number"),
        (BACKLASH.replace(', source = "assumed", note', ", note"), r"gap.source: this key is missing"),
        (BACKLASH.replace('source = "assumed", note', 'source = "nobody", note'), r"source not listed.*nobody"),
        (BACKLASH + BACKLASH, r"effect code used twice: backlash:j2"),
        ('[[effect]]\ncode = "base-tilt"\n', r"effect.base-tilt: no parameter is given"),
        ('[[effect]]\ncode = "backlash:j1"\n[effect.parameters]\ngap = ' + number(), r"crossing: this key is missing"),
        (
            '[[effect]]\ncode = "wrist-coupling"\n[effect.parameters]\ncoupling = ' + number(value=1e-6, unit="mm/N"),
            r"wrist-coupling.parameters.coupling: unit: got 'mm/N'",
        ),
        (
            '[[effect]]\ncode = "base-vertical"\n[effect.parameters]\nstiffness = ' + number(value=0.0, unit="N/m"),
            r"greater than 0",
        ),
        ('[[effect]]\ncode = "payload"\ncolour = "red"\n', r"effect.payload.colour: unknown key"),
    ],
)
def test_faults_are_named_with_their_place(text: str, words: str) -> None:
    refuses("F011 M011", words, lambda: described_effects(read(text), RIGID))


def test_all_faults_at_once() -> None:
    text = BACKLASH.replace('"mrad"', '"N"') + BACKLASH.replace("j2", "j9")
    caught = refuses_each("M011", "", build_arm, read(text))
    assert len(caught.errors) == 2


def own_effect(law: object, stage: str = "arm", **changes: object) -> Effect:
    given: dict[str, object] = {"dimension": "length", "unit": "um", "lower": 1e-6, "upper": 1e-4, **changes}
    parameter = EffectParameter("size", source="own", **given)  # type: ignore[arg-type]
    return Effect("own", "own", stage, (parameter,), law, "own")  # type: ignore[arg-type]


def good(_: object, s: object, v: np.ndarray) -> np.ndarray:
    return np.full((len(s.at), 6), v[0])  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda m: [own_effect(lambda _, s, v: np.zeros(3))], r"law of effect own \(stage arm\).*shape"),
        (lambda m: [own_effect(lambda _, s, v: v[0] * np.full((len(s.at), 6), np.nan))], "finite numbers"),
        (lambda m: [own_effect(lambda _, s, v: 1 / 0)], "ZeroDivisionError"),
        (lambda m: [own_effect(lambda _, s, v: np.ones((len(s.at), 6)))], "acts although its amplitudes are zero"),
        (lambda m: [own_effect(lambda m, s, v: None, "model")], "an ArmModel"),
        (lambda m: [own_effect(lambda at, s, v: at.q, "load")], "LoadedPoses"),
        (lambda m: [own_effect(lambda d, s, v: d[:1], "gauge")], "shape"),
        (lambda m: [own_effect(good, "nowhere")], "stage"),
        (lambda m: [own_effect(good, unit="N")], "unit 'N' is not a unit of length"),
        (lambda m: [own_effect(good, dimension="colour")], "dimension"),
        (lambda m: [own_effect(good, lower=2.0, upper=1.0)], "plausible range"),
        (lambda m: own_effect(good), "a list of fem.effects.Effect"),
        (lambda m: [1], "a list of fem.effects.Effect"),
        (lambda m: m.nothing, "AttributeError"),
    ],
)
def test_an_own_effect_is_checked(make: object, words: str) -> None:
    maker = checked_maker(make, "mine.py")  # type: ignore[arg-type]
    refuses("M012", rf"(?s)mine.py.*{words}", lambda: list(maker(RIGID)))


def test_a_code_twice_is_refused() -> None:
    maker = checked_maker(lambda m: [own_effect(good)], "mine.py")
    refuses("M011", "each code once", catalogue, RIGID, None, [maker, maker])


def test_an_own_effect_in_a_file_needs_its_law() -> None:
    maker = checked_maker(lambda m: [own_effect(good)], "mine.py")
    d = read('[[effect]]\ncode = "own"\n[effect.parameters]\nsize = ' + number(value=20, unit="um"))
    arm = build_arm(d, own=[maker])
    (placed,) = reading_effects(d, arm, [maker])
    assert placed.effect.own
    assert placed.by_name == pytest.approx({"size": 2e-5})
    refuses("M011", r"--effect FILE\.py", build_arm, d)
