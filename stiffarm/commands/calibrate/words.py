"""A calibration in words: values with their intervals, what is not determined, noise, outliers, the model's case."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from doe.calibration.run import StageResult
from doe.certainty.doubts import CAREFUL, LEVEL, MOST_OUTLIERS, Doubt, Drift, Unexplained, p_words
from doe.certainty.lack_of_fit import LackOfFit, downweighted
from doe.certainty.predictive import Coverage
from doe.certainty.uncertainty import Certainty, ParameterEstimate
from doe.estimation.estimate import Estimate
from doe.estimation.noise import FEWEST_POSES, Noise, estimable
from doe.estimation.problem import Problem
from doe.plausibility.passive_arm import NOISY
from doe.published.pose_studies import PoseStudies
from doe.tables.columns import COMPONENTS
from doe.tables.loaded import PointOf
from fem.free.parameters import TURN, Parameter
from robots.quantities import relative, significant
from stiffarm.result import sentence
from stiffarm.session.words.springs import bound_remark

if TYPE_CHECKING:
    from stiffarm.commands.calibrate.step import Calibrated

# Below this probability a test's outcome is no chance.
REFUTED = 0.01
# Residual scatter beyond this many digits of the gauge is not the gauge's.
BEYOND_GAUGE = 2.0
# Parameters that a drift moves by so many standard deviations are named, so many of them.
MOVED, SHOWN = 0.5, 3

_SHOWN = {
    "N m/rad": (1e-6, "1e6 N m/rad"),
    "N/m": (1e-6, "N/um"),
    "Pa": (1e-9, "GPa"),
    "rad": (180.0 / math.pi, "deg"),
    "m": (1e3, "mm"),
}
_SPRING = re.compile(r"[^.]+\.(rz|stiffness)")


def names_joint_spring(name: str) -> bool:
    """Whether a parameter's name is that of a joint's spring about its own axis."""
    return bool(_SPRING.fullmatch(name)) and name.partition(".")[0] not in ("base", "tool", "bar")


# What an interval of a prediction is made of.
INTERVAL = (
    "An interval combines the parameters' covariance, the readings' noise and the lack of fit, from a calibration "
    "without the pose, with Student's t because few readings determine the noise."
)


# What the picture of springs studied pose by pose shows.
STUDIES = (
    "Regression of each spring over its angles. Filled points were calibrated, hollow ones mirrored, grey ones held at "
    "the start value during an earlier stage. Strokes and band: what would match the readings as well, to within the "
    "gauge, with the other springs of the stage free; a law with a point that nothing matches has no band."
)


def mm(value: float) -> str:
    """A length in mm, or that it is not known."""
    return f"{significant(value)} mm" if np.isfinite(value) else "not known"


def errors_text(c: Calibrated) -> str:
    """How good a calibration fits, and predicts poses that it has not seen."""
    missed = f" ({len(c.skipped)} not predicted)" if c.skipped else ""
    error = c.left_out_rms_mm
    predicted = f"to {mm(error)} RMS{missed}" if np.isfinite(error) else f"not at all{missed}"
    text = (
        f"RMS {mm(c.found.rms_mm)} on {len(c.found.overall)} readings with {c.found.count}; "
        f"poses left out one at a time are predicted {predicted}"
    )
    return text if c.holdout is None else f"{text}, poses held out to {mm(c.holdout.rms_mm)}"


def coverage_text(c: Coverage, where: str) -> str:
    """How many of the readings ``where`` lie in their intervals."""
    return (
        f"of {c.readings} readings at {where}, the 95 % interval of the prediction covers {c.inside} "
        f"({significant(100.0 * c.share)} %)"
    )


def study_remarks(studies: Sequence[PoseStudies]) -> tuple[str, ...]:
    """Bounds that studies pose by pose met, and what they could not match."""
    return tuple(
        f"{s.stage.name}, pose {fit.pose}: {remark}" for s in studies for fit in s.fits for remark in fit.remarks
    )


def shown_unit(p: Parameter) -> tuple[float, str]:
    """Factor from SI and the unit in which a parameter is shown."""
    return _SHOWN.get(p.unit, (1.0, p.unit))


def spoken_unit(p: Parameter) -> tuple[float, str]:
    """Factor from SI and the unit in a sentence, where "90 1e6 N m/rad" would not do."""
    return (1.0, p.unit) if p.unit in ("N m/rad", "N/m") else shown_unit(p)


def known(e: ParameterEstimate) -> bool:
    """Whether the estimate's value may stand as a number."""
    return e.status in ("determined", "one-sided")


def bound_of(e: ParameterEstimate) -> str | None:
    """Which end of its range an estimate stands at: "rigid" and "soft" for stiffnesses, else "upper" and "lower"."""
    if e.status != "at bound":
        return None
    p = e.parameter
    upper = abs(e.value - p.upper) <= abs(e.value - p.lower) if p.scale == "linear" else e.value**2 > p.lower * p.upper
    if p.scale != "compliance":
        return "upper" if upper else "lower"
    return "rigid" if upper else "soft"


def value_text(e: ParameterEstimate) -> str:
    """The value with three digits in its shown unit, or why there is none."""
    if e.status == "not identified":
        return "not identified"
    bound = bound_of(e)
    if bound is not None:
        return f"at its bound: {bound} fits best"
    factor, _ = shown_unit(e.parameter)
    return significant(e.value * factor)


def interval_text(e: ParameterEstimate, factor: float | None = None) -> str:
    """The 95 % interval in the shown unit, or times ``factor``; an open end is said as a limit."""
    low, high = (v * (shown_unit(e.parameter)[0] if factor is None else factor) for v in e.interval)
    if math.isnan(low):
        return "-"
    floor = 0.0 if e.parameter.lower >= 0.0 else -math.inf
    if math.isinf(high):
        return "none" if low <= floor else f">= {significant(low)}"
    return f"<= {significant(high)}" if low <= floor else f"{significant(low)} to {significant(high)}"


def estimate_text(e: ParameterEstimate) -> str:
    """The value with its 95 % interval in the shown unit, or why there is none."""
    if e.status == "not identified":
        return value_text(e)
    interval = interval_text(e)
    return f"{value_text(e)} ({'no spare reading' if interval == '-' else interval})"


def remarks(stages: Sequence[StageResult], expected: tuple[float, float] | None) -> tuple[str, ...]:
    """What a reader must not overlook: bounds, what is not seen, what trades off, what did not settle."""
    out: list[str] = []
    for s in stages:
        out += [place(s, stages) + text for text in _stage_remarks(s, expected)]
    return tuple(out)


def place(s: StageResult, stages: Sequence[StageResult]) -> str:
    """The stage's name before what is said of it, where there are several."""
    return f"stage {s.stage.name}: " if len(stages) > 1 else ""


def drift_doubt(s: StageResult, found: Drift, by_rows: bool) -> Doubt:
    """How far what was read drifts, and what the parameters would be with the drift free."""
    p, sizes = s.estimate.problem, {}
    for k in np.unique(p.component).tolist():
        sizes[k] = float(np.ptp(found.size[p.component == k]))
    most = max(sizes, key=lambda k: sizes[k] / (1.0 if k < 3 else 1e3))
    moves = sorted(
        (
            (abs(float(u - v)) / e.sd, e, e.parameter.outer(float(u)))
            for u, v, e in zip(found.u, s.estimate.u, s.certainty.estimates, strict=True)
            if e.sd > 0.0
        ),
        key=lambda one: -one[0],
    )
    moved = []
    for times, e, value in [one for one in moves if one[0] >= MOVED][:SHOWN]:
        factor, unit = spoken_unit(e.parameter)
        moved.append(
            f"{e.parameter.name} {significant(value * factor)} instead of {significant(e.value * factor)} {unit} "
            f"({significant(times, 2)} of its standard deviations)"
        )
    order = "the rows (if that is the order of reading)" if by_rows else "reading"
    text = (
        f"what was read drifts: the residual of {COMPONENTS[most]} follows the order of {order}, by up to "
        f"{significant(1e3 * sizes[most], 2)} {'mm' if most < 3 else 'mrad'} (F test, {p_words(found.p_value)}; "
        f"{relative(LEVEL)} of steady campaigns give an alarm). "
    )
    text += (
        f"With the drift free it would be {', '.join(moved)}"
        if moved
        else ("No parameter would move by more than half of its standard deviation with the drift free")
    )
    return Doubt("drift", text, found.p_value, moves[0][0] if moves else 0.0)


def doubt_sentences(doubts: Sequence[Doubt]) -> tuple[str, ...]:
    """The words of doubts as sentences, for a page's first screen."""
    return tuple(sentence(d.words) for d in doubts)


def unexplained_doubts(left: Unexplained) -> list[Doubt]:
    """That springs alone do not explain the readings, with what says so and how to ask what is missing."""
    ask = "ask what is missing: `stiffarm diagnose`"
    out = []
    if left.zero_p < 0.5 * LEVEL:
        out.append(
            Doubt(
                "not-proportional",
                (
                    "the springs alone do not explain these readings: deflections are not proportional to the load, "
                    f"{significant(1e3 * left.zero_m, 2)} mm RMS would be left at no load "
                    f"(F test, {p_words(left.zero_p)}; "
                    "backlash, "
                    f"friction, hardening or a wrong load do that, no spring does); {ask}"
                ),
                left.zero_p,
                left.zero_times,
            )
        )
    if left.setups_p < 0.5 * LEVEL and left.setups_share > CAREFUL and not out:
        out.append(
            Doubt(
                "set-ups-differ",
                (
                    f"the springs alone do not explain these readings: set-ups differ from them by "
                    f"{relative(left.setups_share)} of the deflection, which readings of one set-up do not "
                    "scatter by "
                    f"(F test, {p_words(left.setups_p)}) and careful set-ups stay within {relative(CAREFUL)}; {ask}"
                ),
                left.setups_p,
                left.setups_share / CAREFUL,
            )
        )
    return out


def points_remark(names: Sequence[str], points: Sequence[PointOf]) -> tuple[str, ...]:
    """Which points a shift of the point (``names``) moved, where readings have their own."""
    if not names or "table" not in points:
        return ()
    tool = "the model's tool point moves with them" if "tool" in points else "the model's tool point stays"
    return (
        f"{', '.join(names)}: the points of the table (px_mm, py_mm, pz_mm) are off by this, which the model file "
        f"holds as [load] point; {tool}",
    )


def _stage_remarks(s: StageResult, expected: tuple[float, float] | None) -> list[str]:
    out: list[str] = []
    for e in s.certainty.estimates:
        if e.parameter.name in s.unseen:
            out.append(f"{e.parameter.name}: no reading moves with it; it stays as the model has it")
        elif e.parameter.spring_of is not None and expected is not None and e.status != "not identified":
            widest = min(TURN[0], expected[0]), max(TURN[1], expected[1])
            out += bound_remark(e, expected, widest)
        elif e.status == "at bound":
            out.append(f"{e.parameter.name}: stands at the {bound_of(e)} end of its range, {_range(e.parameter)}")
    out += [t.words for t in s.trade_offs]
    named = {name for t in s.trade_offs for name in t.parameters} | set(s.unseen)
    out += [
        f"{e.parameter.name}: any value in its range fits, its share is lost in the noise"
        for e in s.certainty.estimates
        if e.status == "not identified" and e.parameter.name not in named
    ]
    out += _unexplained(s.estimate)
    if not s.estimate.settled:
        out.append("noise and parameters did not converge together: use the intervals with care")
    if all(e.degrees_of_freedom <= 0.0 for e in s.certainty.estimates):
        out.append("as many parameters as readings: no residual is left, so no error bars can be given")
    return out


def _unexplained(e: Estimate) -> list[str]:
    """That most of what was read is left: the readings tell something, but not of the numbers set free."""
    p, out = e.problem, []
    for unit, mine in (("mm", p.component < 3), ("mrad", p.component >= 3)):
        left, read = (float(np.sqrt(np.sum(v[mine] ** 2) / max(int(mine.sum()), 1))) for v in (e.residual, p.value))
        if left > NOISY * read:
            out.append(
                f"{significant(1e3 * left)} of {significant(1e3 * read)} {unit} read (RMS) are left unexplained: "
                "these parameters hardly explain the deflection; free others, or `stiffarm diagnose`"
            )
    return out


def _range(p: Parameter) -> str:
    factor, unit = spoken_unit(p)
    return f"{significant(p.lower * factor)} to {significant(p.upper * factor)} {unit}"


def identified_text(estimates: Sequence[ParameterEstimate]) -> list[str]:
    """Sentences: which numbers the readings determine, which only to one side, which not at all."""
    names = {
        s: [e.parameter.name for e in estimates if e.status == s]
        for s in ("determined", "one-sided", "at bound", "not identified")
    }
    out = []
    if names["determined"]:
        out.append(f"Determined, with both limits: {', '.join(names['determined'])}.")
    else:
        out.append("No parameter is determined with both limits.")
    half = [f"{e.parameter.name} ({_limit(e)})" for e in estimates if e.status == "one-sided"]
    if half:
        out.append(f"Only a limit to one side: {', '.join(half)}.")
    ends = [f"{e.parameter.name} ({bound_of(e)} fits best{_beside(e)})" for e in estimates if e.status == "at bound"]
    if ends:
        out.append(f"At an end of the range, so no value: {', '.join(ends)}.")
    if names["not identified"]:
        out.append(f"Not determined by these readings: {', '.join(names['not identified'])}.")
    return out


def _limit(e: ParameterEstimate) -> str:
    factor, unit = spoken_unit(e.parameter)
    return f"{interval_text(e, factor)} {unit}"


def _beside(e: ParameterEstimate) -> str:
    return "" if interval_text(e) in ("-", "none") else f", {_limit(e)}"


def noise_parts(noise: Noise, p: Problem) -> list[tuple[str, str]]:
    """The noise's terms as (name, size), those that are there."""
    out = []
    given = ~np.isnan(p.sigma)
    for kind, (what, unit) in enumerate((("translations", "mm"), ("rotations", "mrad"))):
        mine = (p.component >= 3) == bool(kind)
        if not mine.any():
            continue
        if given[mine].all():
            out.append((f"each reading, {what}", "as given in sigma_mm"))
        elif any(noise.axes[3 * kind : 3 * kind + 3]):
            for k in np.unique(p.component[mine]).tolist():
                sd = math.hypot(noise.white[kind], noise.axes[k])
                out.append((f"each reading, {COMPONENTS[k]}", f"{significant(sd * 1e3)} {unit}"))
        else:
            out.append((f"each reading, {what}", f"{significant(noise.white[kind] * 1e3)} {unit}"))
        if noise.load[kind]:
            out.append((f"each reading, {what}, for each kN of load", f"{significant(noise.load[kind] * 1e6)} {unit}"))
        if noise.pose[kind]:
            out.append((f"each set-up, {what}", f"{significant(noise.pose[kind] * 1e3)} {unit}"))
    if noise.share:
        out.append(("each reading, share of the deflection", f"{relative(noise.share)}"))
    if noise.vector:
        out.append(("each reading, share of the displacement's length", f"{relative(noise.vector)}"))
    if noise.tail:
        out.append(
            ("each reading, tails", f"Student's t, {noise.tail:g} degrees of freedom; sizes are those of its core")
        )
    if noise.pose_share:
        out.append(("each set-up, share of the deflection", f"{relative(noise.pose_share)}"))
    return out


def setups_text(s: StageResult, independent: Certainty | None) -> str:
    """Whether set-ups scatter, and what leaving that out of the noise would do to the intervals."""
    p, e = s.estimate.problem, s.estimate
    if independent is None:
        if estimable(p, e.prediction)[1]:
            return "No scatter between set-ups was found in addition to that of the readings."
        return (
            f"Scatter between set-ups cannot be separated from that of the readings: this needs {FEWEST_POSES} "
            "poses with several readings of one component each. If there is some, the intervals are too narrow."
        )
    ratios = [
        r for pair in zip(s.certainty.estimates, independent.estimates, strict=True) if (r := _width_ratio(*pair))
    ]
    sizes = [f"{size} of {name.split(', ')[1]}" for name, size in noise_parts(e.noise, p) if "set-up" in name]
    text = f"Readings of one set-up share a common scatter ({' and '.join(sizes)}), so they are not independent. "
    if e.noise.pose_share > CAREFUL:
        text += (
            f"More than {relative(CAREFUL)} of the deflection is more than careful set-ups give: something that "
            "the model lacks, or a spring held stiffer than it is, may stand behind it. "
        )
    if not ratios:
        return text + "Without this noise term, the scatter would be reported as lack of fit."
    low, middle, high = min(ratios), float(np.median(ratios)), max(ratios)
    spread = f" ({significant(low, 2)} to {significant(high, 2)})" if len(ratios) > 1 else ""
    factor = significant(middle, 2)
    if middle < 1.05:
        return text + f"Leaving it out of the noise would hardly change the intervals: factor {factor}{spread}."
    return text + (f"With that term left out of the noise, intervals would wrongly be {factor} times narrower{spread}.")


def _width_ratio(a: ParameterEstimate, b: ParameterEstimate) -> float | None:
    """Width of a's interval over that of b's, of the logarithm where positive; None where either is open."""
    if a.status != "determined" or b.status != "determined":
        return None
    log = a.parameter.scale != "linear"
    wide, narrow = (float(np.diff(np.log(e.interval) if log else e.interval)[0]) for e in (a, b))
    return wide / narrow if narrow > 0.0 else None


def verdict(s: StageResult, gauge_mm: float) -> tuple[str, str]:
    """("refuted" | "not refuted" | "not testable", one or two sentences)."""
    test: LackOfFit = s.lack_of_fit
    e = s.estimate
    if not math.isnan(test.p_value):
        freedom = f"{test.fit_dof} and {test.pure_dof} degrees of freedom"
        found = f"F = {significant(test.ratio)} on {freedom}, {p_words(test.p_value)}"
        if not math.isnan(test.pure_error_m):
            found = f"Replicates scatter by {significant(test.pure_error_m * 1e3)} mm; {found}. "
        else:
            found += ". "
        if test.p_value >= REFUTED:
            return "not refuted", found + "The model fits as well as the replicates allow: nothing refutes it."
        if e.noise.has_common:
            return "not refuted", found + (
                "The model misses by more than the replicates scatter; the scatter between set-ups found above "
                "would explain that. A systematic miss of the model looks the same: see residuals by pose and load."
            )
        return "refuted", found + (
            "The model is refuted: it misses by more than the replicates scatter, and no scatter between set-ups "
            "was found that would explain it."
        )
    if not np.isnan(e.problem.sigma).any() and not math.isnan(test.chi_p_value):
        found = (
            f"Against the sigmas given: chi-square {significant(test.chi_square)} on {test.chi_dof} degrees of "
            f"freedom, {p_words(test.chi_p_value)}. "
        )
        # Scatter between set-ups is part of the noise in this test, outliers have lost their weight in it.
        far = downweighted(e)
        if far > MOST_OUTLIERS * len(e.problem):
            return "refuted", found + (
                f"{far} of {len(e.problem)} readings are far off and lost weight, too many to be outliers: these "
                "sigmas are too small, or the model is refuted."
            )
        if test.chi_p_value < REFUTED:
            return "refuted", found + "The model is refuted if these sigmas are right."
        if test.chi_p_value > 1.0 - REFUTED:
            return "refuted", found + "Readings fit better than these sigmas allow: the sigmas are too large."
        return "not refuted", found + "Nothing refutes the model."
    digits = e.noise.white[0] * 1e3 / gauge_mm
    text = "There are no replicates to spare, so the model cannot be tested against their scatter. "
    if digits > BEYOND_GAUGE and (e.problem.component < 3).any():
        text += (
            f"What is left in the readings, {significant(e.noise.white[0] * 1e3)} mm, is "
            f"{significant(digits, 2)} times the gauge's digit: "
            "either readings scatter more than the gauge, or the model lacks something. The intervals are from this "
            "scatter, not from the gauge."
        )
    return "not testable", text


def full_weight_text(robust: StageResult, full: StageResult | None) -> str:
    """What the numbers would be with outliers at full weight: those that would move by more than half an interval."""
    if full is None:
        return ""
    moved = []
    for a, b in zip(robust.certainty.estimates, full.certainty.estimates, strict=True):
        if a.status != "determined" or not known(b):
            continue
        log = a.parameter.scale != "linear"
        x, y, (low, high) = (np.log(v) if log else np.asarray(v) for v in (a.value, b.value, a.interval))
        if abs(float(y - x)) > 0.25 * float(high - low):
            factor, unit = spoken_unit(a.parameter)
            values = f"{significant(b.value * factor)} instead of {significant(a.value * factor)}"
            moved.append(f"{a.parameter.name} {values} {unit}")
    if not moved:
        return "With all readings at full weight no number would move by more than half of its interval's half width."
    return f"With all readings at full weight the estimate would be {', '.join(moved)}."
