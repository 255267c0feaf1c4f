"""Many candidates at once against one at a time, and what is worked out once against what is worked out anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up import read, setting

from doe.diagnosis.evidence import Whitened
from doe.diagnosis.finer import STEPS, finer
from doe.diagnosis.fits import Fits, Kept, Stack, fit_all, scaled_evidence
from doe.diagnosis.known import base_of
from doe.diagnosis.scatter import covariance
from doe.diagnosis.setting import Setting
from doe.diagnosis.signatures import signatures
from doe.diagnosis.unknowns import processes
from doe.diagnosis.weighing import bent, extended
from doe.estimation.noise import Noise

NOISE = Noise(white=(5e-6, 1e-5), share=0.02, pose_share=0.01)
# Laws of one and of several amplitudes, without and with a memory, and with a clock, which tells repeats apart.
CODES = ("hardening:j2", "load-misalignment", "friction:j2", "warming:j3", "learned-clock:j2", "gear-ripple:j3")


@pytest.fixture(scope="module")
def repeats() -> Setting:
    return setting(read({}, poses=6, repeats=3, components=(0, 2)))


@pytest.fixture(scope="module")
def base(repeats: Setting) -> Whitened:
    weight = np.where(np.arange(len(repeats.data)) % 7 == 0, 0.1, 1.0)
    return Whitened(base_of(repeats), covariance(repeats, NOISE, weight))


def stack(s: Setting) -> Stack:
    some = {code: signatures(s, s.known[code])[:9] for code in CODES}
    some["hardening:j2"] = [bent(s, c, c.mean) for c in some["hardening:j2"]]
    return Stack(some)


def the_same(a: Fits, b: Fits) -> None:
    """To rounding, times the condition of the base, some 1e6."""
    np.testing.assert_allclose(a.log_evidence, b.log_evidence, rtol=1e-10)
    np.testing.assert_allclose(a.excess, b.excess, rtol=1e-6, atol=1e-6)
    for k in range(len(a.log_evidence)):
        np.testing.assert_allclose(a.mean(k), b.mean(k), rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(a.shows(k), b.shows(k), rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(a[k].base, b[k].base, rtol=1e-6, atol=1e-8)


def test_repeats_are_told_once_and_change_nothing(repeats: Setting, base: Whitened) -> None:
    once = stack(repeats)
    # What sticks from one load cycle to the next may make another thing of each.
    carried = [c for c in once.flat if c.effect.code == "friction:j2" and c.values[2] > 0.0]
    assert carried
    assert any(c.alike is None for c in carried)
    groups = {c.effect.code: c.alike for c in once.flat if not any(c is other for other in carried)}
    assert groups["hardening:j2"] is groups["friction:j2"] is repeats.alike
    assert groups["warming:j3"] is groups["learned-clock:j2"] is None
    assert len(repeats.alike.groups) == len(repeats.data) // 3
    whole = [replace(c, rows=c.columns, alike=None) for c in once.flat]
    the_same(fit_all(base, once), fit_all(base, whole))


def test_one_candidate_at_a_time_gives_the_same(repeats: Setting, base: Whitened) -> None:
    """Without floors: shares above zero are of margins, which depend on the order in which numbers are taken."""
    none = np.full(len(base.base.floor), -np.inf)
    free = Whitened(replace(base.base, floor=none), base.V)
    every = stack(repeats)
    flat = [replace(c, positive=np.zeros_like(c.positive)) for c in every.flat]
    together = fit_all(free, flat).log_evidence
    for c, value in zip(flat, together, strict=True):
        assert value == pytest.approx(Whitened(extended(repeats, free.base, c), base.V).log_evidence, rel=1e-10)


def test_what_is_kept_of_a_base_serves_for_one_with_more_columns(repeats: Setting, base: Whitened) -> None:
    every = stack(repeats)
    kept = Kept(base, every)
    for code in ("load-misalignment", "warming:j3"):
        wide = extended(repeats, base.base, every.flat[every.place[code].start])
        anew, grown = Whitened(wide, base.V), Whitened(wide, base.V, base)
        assert grown.log_evidence == pytest.approx(anew.log_evidence, rel=1e-10)
        np.testing.assert_allclose(grown.u, anew.u, rtol=1e-7, atol=1e-10)
        the_same(kept.fit(grown), fit_all(anew, every))
        the_same(kept.fit(anew), fit_all(anew, every))


def test_sizes_of_something_unknown_are_worked_out_together(repeats: Setting, base: Whitened) -> None:
    for axis in ("pose", "clock"):
        one = next(x for x in processes(repeats) if x.axis == axis)
        sizes = (0.5, 1.0, 4.0)
        found = scaled_evidence(base, one.unit.rows, one.unit.alike, sizes)
        for size, value in zip(sizes, found, strict=True):
            wide = Whitened(base.base.beside(size * one.unit.columns), base.V)
            assert value == pytest.approx(wide.log_evidence, rel=1e-10)


def test_columns_that_the_base_follows_add_no_excess(repeats: Setting, base: Whitened) -> None:
    """Two columns of which one is the other again: the excess is that of one."""
    c = signatures(repeats, repeats.known["base-vertical"])[0]
    twice = replace(
        c,
        rows=np.hstack([c.rows, c.rows]),
        mean=np.tile(c.mean, 2),
        sd=np.tile(c.sd, 2),
        positive=np.tile(c.positive, 2),
    )
    one, two = fit_all(base, [c])[0].excess, fit_all(base, [twice])[0].excess
    assert one > 0.0
    assert two == pytest.approx(one, rel=1e-6)


# ------------------------------------------------------------
# Shapes between the points of a law's grid: found where the noise is small, charged for, within their range

# Between two points of the grid.
TRUE = {"share": 0.9, "torque": 95.0, "kept": 0.45}


def test_a_joint_that_lets_go_at_a_torque_between_two_points() -> None:
    s = setting(read({"stick-slip:j2": TRUE}, share=0.005, setup=0.0))
    w = Whitened(base_of(s), covariance(s, Noise(white=(1e-6, 1e-6), share=0.005), np.ones(len(s.data))))
    some = signatures(s, s.known["stick-slip:j2"])
    coarse = fit_all(w, some).log_evidence
    best = some[int(np.argmax(coarse))]
    found = finer(s, w, best)
    assert found is not None
    c, amplitude = found
    assert c.rarity in [-2.0 * np.log(step) for step, _, _ in STEPS]
    z = float(fit_all(w, [c]).log_evidence[0])
    # What it is charged for is in the evidence; a coarse grid misses by far more.
    assert z > coarse.max() + 20.0
    assert abs(c.values[1] - TRUE["torque"]) < 0.5 * abs(best.values[1] - TRUE["torque"]) + 3.0
    assert amplitude.shape == (1,)
    low, high = (f([x.values[1] for x in some]) for f in (min, max))
    assert low <= c.values[1] <= high


def test_laws_without_such_shapes_are_left_alone() -> None:
    s = setting(read({}, poses=6))
    w = Whitened(base_of(s), covariance(s, Noise(white=(1e-5, 1e-5)), np.ones(len(s.data))))
    assert finer(s, w, signatures(s, s.known["gauge-scale"])[0]) is None
