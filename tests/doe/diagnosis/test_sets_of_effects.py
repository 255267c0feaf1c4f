"""Sets of effects against dense formulas; what every arm is off by; laws that bend; processes along other axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up import few, kr60, read, setting
from scipy.stats import multivariate_normal

from doe.diagnosis.coarsening import coarsened
from doe.diagnosis.diagnose import diagnose
from doe.diagnosis.doubts import bends
from doe.diagnosis.evidence import Base
from doe.diagnosis.fits import Stack
from doe.diagnosis.hypotheses import UNKNOWN, Options, log_priors
from doe.diagnosis.known import base_of
from doe.diagnosis.ranking import rank
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import signatures
from doe.diagnosis.unknowns import processes
from doe.diagnosis.weighing import at_noise, bent, extended, sets_at
from doe.estimation.noise import Noise
from fem import build_model
from fem.effects import Effect, catalogue
from robots import load_description

NOISE = Noise(white=(5e-6, 1e-5), share=0.02)
# Signed amplitudes: their evidence is a normal density, with no share above zero to reckon with.
PAIR = ("load-misalignment", "joint-zero-offset:j3")


@pytest.fixture(scope="module")
def small() -> Setting:
    return setting(read({}, poses=8, repeats=1))


def unbounded(base: Base) -> Base:
    return replace(base, floor=np.full(len(base.floor), -np.inf))


def dense(s: Setting, base: Base) -> float:
    """Log density of the readings with all numbers of a base integrated out, by the full covariance matrix."""
    V = np.diag(NOISE.variance(s.data, s.prediction))
    V += base.columns @ np.diag(1.0 / base.precision) @ base.columns.T
    return float(multivariate_normal(cov=V, allow_singular=True).logpdf(base.residual))


def test_a_pair_is_the_density_with_both_effects(small: Setting) -> None:
    base, weight = unbounded(base_of(small)), np.ones(len(small.data))
    some = {code: signatures(small, small.known[code]) for code in PAIR}
    row = at_noise(small, base, weight, NOISE, Stack(some), Options(priors=False), {})
    prior = dict.fromkeys(PAIR, -3.0)
    found = sets_at(small, base, weight, row, Stack(some), prior, [])
    both = extended(small, extended(small, base, some[PAIR[0]][0]), some[PAIR[1]][0])
    # Two factorisations of a matrix of condition 1e6 or so.
    assert found.worth[frozenset(PAIR)] == pytest.approx(dense(small, both), abs=1e-4)


def test_an_effect_beside_something_unknown(small: Setting) -> None:
    base, weight = unbounded(base_of(small)), np.ones(len(small.data))
    code = PAIR[0]
    some = {code: signatures(small, small.known[code])}
    row = at_noise(small, base, weight, NOISE, Stack(some), Options(priors=False), {})
    process = next(x for x in processes(small) if x.axis == "load")
    found = sets_at(small, base, weight, row, Stack(some), {code: -3.0}, [process])
    both = extended(small, base.beside(process.columns), some[code][0])
    assert found.worth[frozenset({code, "unknown"})] == pytest.approx(dense(small, both), abs=1e-4)


def test_a_bent_law_has_columns_of_the_size_of_its_doubt(small: Setting) -> None:
    c = signatures(small, small.known["hardening:j2"])[0]
    amplitude = np.array([0.5])
    wide = bent(small, c, amplitude)
    more = wide.columns[:, 1:]
    own = c.columns @ amplitude
    functions = bends(c.effect, small.data, small.situation, small.unloading)
    np.testing.assert_allclose(more, c.effect.law_doubt * own[:, None] * functions)
    assert (np.abs(more) <= c.effect.law_doubt * np.abs(own)[:, None] * (1.0 + 1e-12)).all()
    exact = signatures(small, small.known["load-misalignment"])[0]
    assert bent(small, exact, exact.sd) is exact


@pytest.mark.slow
def test_lengths_that_are_off_pass_for_nothing() -> None:
    """Axes moved by 1 mm, the gauge exact to half a per mille: what stands out of the noise is no effect."""
    from doe.diagnosis.setting import setting_of
    from doe.tables.loaded import history_of, loaded_points
    from fem.effects.observed import observed
    from fem.statics.loads import as_loaded

    description, model = kr60()
    data = read({}, share=0.0005, setup=0.0, poses=20, repeats=1, components=(0, 1, 2))
    rng = np.random.default_rng(5)
    T = model.robot.T_pre.copy()
    T[1:, :3, 3] += 1e-3 * rng.normal(size=(len(T) - 1, 3))
    built = replace(model, robot=replace(model.robot, T_pre=T))
    at = as_loaded(model, data.q, data.wrench, loaded_points(model, data))
    d = observed(built, at, (), history_of(data))
    d = d * (1.0 + 0.0005 * rng.normal(size=d.shape))
    data = replace(data, displacement=np.where(np.isnan(data.displacement), np.nan, d))
    found = diagnose(few(setting_of(description, model, data), "joint-zero-offset:j5"))
    assert found.verdict == "none"
    bare = replace(found.start, errors=np.zeros((len(found.start.data), 0)))
    # Without that knowledge something is asked for.
    assert rank(bare, found.weight).of("none").probability < 0.1


def test_priors_of_all_hypotheses_make_one(small: Setting) -> None:
    prior = log_priors(small, ["none", "unknown", *small.known], Options())
    # Some effects have a chance of less than one within their family.
    assert 0.8 < sum(np.exp(list(prior.values()))) <= 1.0 + 1e-12


@pytest.mark.slow
def test_a_law_of_another_world_is_learned_where_it_acts() -> None:
    """A joint that another one turns: no effect of the catalogue does that."""
    from doe.diagnosis.setting import setting_of
    from doe.tables.loaded import history_of, loaded_points
    from fem.effects.base import PlacedEffect
    from fem.effects.catalogue import effect_of
    from fem.effects.observed import observed
    from fem.statics.loads import as_loaded

    description, model = kr60()
    data = read({}, share=0.01, setup=0.0, poses=27, repeats=2, components=(0, 1, 2))
    effect = effect_of("learned-coupling:j3", model)
    placed = PlacedEffect(effect, np.array([0.0, 0.4, 0.0, 0.0, 0.0]))
    at = as_loaded(model, data.q, data.wrench, loaded_points(model, data))
    rng = np.random.default_rng(6)
    d = observed(model, at, (placed,), history_of(data))
    d = d * (1.0 + 0.01 * rng.normal(size=d.shape))
    found = diagnose(
        setting_of(description, model, replace(data, displacement=np.where(np.isnan(data.displacement), np.nan, d)))
    )
    assert found.verdict == "learned"
    assert [f.code for f in found.learned] == ["learned-coupling:j3"]
    assert found.after.left_out_rms_mm < 0.5 * found.before.left_out_rms_mm


# ------------------------------------------------------------
# Laws of one place are weighed no finer than laws are known; levers are

NONE: frozenset[str] = frozenset()
FRICTION, STICKING, ELSEWHERE = "friction:j2", "stick-slip:j2", "friction:j3"


@pytest.fixture(scope="module")
def known() -> dict[str, Effect]:
    description = load_description("xr701")
    return catalogue(build_model(description, "rigid"), description)


def one(code: str) -> frozenset[str]:
    return frozenset({code})


def test_laws_of_one_place_come_closer_as_they_explain_more(known: dict[str, Effect]) -> None:
    doubt = known[FRICTION].law_doubt
    assert doubt == known[STICKING].law_doubt > 0.0
    for gain in (10.0, 1000.0):
        sets = {NONE: 0.0, one(FRICTION): gain, one(STICKING): gain - 5.0, one(ELSEWHERE): gain - 5.0}
        out = coarsened(sets, known)
        assert out[one(FRICTION)] == gain
        assert gain - out[one(STICKING)] == pytest.approx(5.0 / (1.0 + doubt**2 * gain))
        assert out[one(ELSEWHERE)] == gain - 5.0  # another place has another lever


def test_beside_another_effect_they_are_judged_by_what_they_add(known: dict[str, Effect]) -> None:
    doubt = known[FRICTION].law_doubt
    with_tilt = {frozenset({code, "base-tilt"}): z for code, z in ((FRICTION, 500.0), (STICKING, 480.0))}
    out = coarsened({NONE: 0.0, one("base-tilt"): 400.0} | with_tilt, known)
    assert 500.0 - out[frozenset({STICKING, "base-tilt"})] == pytest.approx(20.0 / (1.0 + doubt**2 * 100.0))


def test_what_explains_nothing_and_what_is_unknown_stay_as_they_are(known: dict[str, Effect]) -> None:
    sets = {NONE: 0.0, one(FRICTION): -2.0, one(STICKING): -3.0, one(UNKNOWN): 1.0}
    assert coarsened(sets, known) == sets
