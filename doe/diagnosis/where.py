"""Where and how far a model and readings disagree: groups beyond the noise, least errors, readings held out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from doe.diagnosis.diagnose import Diagnosis
from doe.diagnosis.hypotheses import UNKNOWN
from doe.diagnosis.known import base_of
from doe.diagnosis.scatter import with_setup
from doe.diagnosis.setting import Setting
from doe.estimation.noise import Noise, within_readings
from doe.estimation.problem import Problem, problem
from doe.tables.checks import refuse_seen
from doe.tables.columns import COMPONENTS
from doe.tables.loaded import history_of, rms_mm
from doe.tables.measurements import Measurements
from robots.arrays import Array, Integers

# Set-ups scatter by so much of the deflection as a rule; more of it counts as disagreement.
USUAL_SETUP = 0.01
# Loads that differ by less (relative) are one load.
SAME_LOAD = 0.005
# Draws by which a share has its standard deviation: that of a standard deviation is then 4 %.
DRAWS = 400


@dataclass(frozen=True)
class Group:
    """Readings of one pose, load, direction or phase.

    ``share``: of all squared standardised residuals beyond the expected ones, NaN where there are none;
    ``mean_square``: of the standardised residuals, 1 where noise is all; ``mean``: mean residual (m or rad as read);
    ``share_sd``: standard deviation of the share by what springs and effects are uncertain by, NaN where not known.
    """

    label: str
    readings: int
    share: float
    mean_square: float
    mean: float
    share_sd: float = math.nan


def shares(z: Array, residual: Array, labels: Sequence[str], drawn: Array | None = None) -> tuple[Group, ...]:
    """Groups of equal ``labels`` (m,), in order of first appearance.

    ``z`` (m,): residuals over their standard deviations, each of which is expected to have a square of 1. A group's
    excess is its sum of squares less its number, not below zero; its share is that of all groups' excess. ``drawn``
    (m, k): z as it may be just as well, from which shares have their standard deviations.
    """
    names = list(dict.fromkeys(labels))
    number = np.array([names.index(label) for label in labels], dtype=np.intp)
    count = np.bincount(number, minlength=len(names))
    square = np.bincount(number, z**2, minlength=len(names))
    mean = np.bincount(number, residual, minlength=len(names)) / np.maximum(count, 1)
    part = _parts(np.asarray(square, dtype=np.float64)[:, None], count)[:, 0]
    sd = np.full(len(names), np.nan)
    if drawn is not None and np.isfinite(part).all():
        sd = np.nanstd(_parts((number == np.arange(len(names))[:, None]) @ drawn**2, count), axis=1)
    return tuple(
        Group(name, int(count[k]), float(part[k]), float(square[k] / count[k]), float(mean[k]), float(sd[k]))
        for k, name in enumerate(names)
    )


def _parts(square: Array, count: Integers) -> Array:
    """Shares (g, k) of what sums of squares (g, k) are beyond their numbers (g,); NaN where none is."""
    excess = np.maximum(square - count[:, None], 0.0)
    total = excess.sum(axis=0)
    return np.asarray(np.where(total > 0.0, excess / np.maximum(total, 1e-300), np.nan))


def where(d: Diagnosis) -> dict[str, tuple[Group, ...]]:
    """Disagreement of the model before with its readings, by ``pose``, ``load``, ``direction`` and ``phase``.

    Where nothing is missing, or the readings tell nothing, there are no shares. Odd readings are left out.
    """
    s, good = d.before.setting, np.flatnonzero(d.counts)
    sd = spread(s, own_noise(d))
    z, residual = (d.before.residual / sd)[good], d.before.residual[good]
    drawn = z[:, None] + (_uncertain(d) / sd[:, None])[good]
    found = {kind: shares(z, residual, [labels[k] for k in good], drawn) for kind, labels in labels_of(s).items()}
    if d.verdict not in ("none", "uninformative"):
        return found
    # What is beyond the expected by chance is no disagreement that could lie anywhere.
    return {
        kind: tuple(replace(g, share=math.nan, share_sd=math.nan) for g in groups) for kind, groups in found.items()
    }


def _uncertain(d: Diagnosis, rng: np.random.Generator | None = None) -> Array:
    """What the true readings (m, ``DRAWS``) may be beside those of the model found: its springs and effects drawn.

    The model before stays as it was fitted, so that its disagreement with the truth moves by this.
    """
    s, refit = d.after.setting, d.after.refit
    chosen = [*range(len(s.free)), *(k for number in range(len(s.accepted)) for k in refit.columns(number))]
    root = np.linalg.cholesky(refit.inverse[np.ix_(chosen, chosen)])
    numbers = root @ (rng or np.random.default_rng(0)).standard_normal((len(chosen), DRAWS))
    return np.asarray(base_of(s).columns[:, chosen] @ numbers)


def own_noise(d: Diagnosis) -> Noise:
    """The readings' own noise as the best explanation has it, with set-ups that scatter no more than usual."""
    noise = d.rankings[-1].of(UNKNOWN).noise if d.verdict == "unknown" else d.after.refit.noise
    return with_setup(noise, min(noise.pose_share, USUAL_SETUP))


def noise_floor_mm(d: Diagnosis) -> float:
    """RMS of the translations that the readings' noise alone would give, by the best explanation that there is.

    Where nothing of the catalogue explains the readings, set-ups are taken to scatter no more than usual: what they
    seem to scatter there is the disagreement itself.
    """
    if d.verdict != "unknown":
        return d.after.noise_floor_mm
    s = d.after.setting
    return rms_mm(spread(s, own_noise(d)), s.data.component)


def least_rms_mm(d: Diagnosis) -> float:
    """The smallest RMS of the translations (mm) that any springs of the free joints could reach by themselves."""
    s = d.before.setting
    linear = (s.data.component < 3) & d.counts
    if not linear.any():
        return float("nan")
    A, y = s.spring_columns[linear], s.residual[linear] + s.spring_columns[linear] @ s.springs
    size = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    return float(nnls(A / size, y)[1] / np.sqrt(linear.sum()) * 1e3)


def spread(s: Setting, noise: Noise) -> Array:
    """Standard deviation (m,) of each reading by a noise."""
    return within_readings(s.data, s.prediction, noise).spread(s.data, s.prediction)


def labels_of(s: Setting) -> Mapping[str, list[str]]:
    """Labels (m,) of the readings of a setting by pose, load, direction and phase."""
    p = s.data
    wrench = p.free.at.wrench[p.row]
    return {
        "pose": [p.poses[k] for k in p.pose],
        "load": load_labels(wrench),
        "direction": _directions(p, wrench),
        "phase": _phases(s),
    }


def load_labels(wrench: Array) -> list[str]:
    """``650 N`` for each wrench (m, 6); loads that hardly differ get one label. Pure moments in N m."""
    force, moment = np.linalg.norm(wrench[:, :3], axis=1), np.linalg.norm(wrench[:, 3:], axis=1)
    size = np.where(force > 0.0, force, moment)
    unit = np.where(force > 0.0, "N", "N m")
    heads: list[float] = []
    for value in np.unique(size):
        if not heads or value > heads[-1] * (1.0 + SAME_LOAD):
            heads.append(float(value))
    nearest = np.array(heads)[np.abs(size[:, None] - np.array(heads)[None]).argmin(axis=1)]
    return [f"{v:.4g} {u}" for v, u in zip(nearest, unit, strict=True)]


def _directions(p: Problem, wrench: Array) -> list[str]:
    """What was read, and under a load along which axis where there are several."""
    main = np.abs(wrench).argmax(axis=1)
    sign = np.where(np.take_along_axis(wrench, main[:, None], axis=1)[:, 0] < 0.0, "-", "+")
    names = ("X", "Y", "Z", "about X", "about Y", "about Z")
    loads = [f"{s}{names[k]}" for s, k in zip(sign, main, strict=True)]
    read = [COMPONENTS[k] for k in p.component]
    if len(set(loads)) == 1:
        return read
    return [f"{r}, load {load}" for r, load in zip(read, loads, strict=True)]


def _phases(s: Setting) -> list[str]:
    if not s.history.is_known:
        return ["not told"] * len(s.data)
    return ["unloading" if down else "loading" for down in s.unloading[s.data.row]]


def without_history(s: Setting) -> Setting:
    """The setting where nothing is known of the order of loads: friction cannot be judged then."""
    return replace(s, history=replace(s.history, is_known=False))


@dataclass(frozen=True)
class HeldOutReadings:
    """Errors (m,), read minus predicted, of a model before and after; ``setting``: the model after on these readings.

    ``remarks``: what of an effect these readings cannot follow, in words.
    """

    data: Measurements
    setting: Setting
    before: Array
    after: Array
    remarks: tuple[str, ...]

    @property
    def rms_before_mm(self) -> float:
        """RMS of the translations before."""
        return rms_mm(self.before, self.setting.data.component)

    @property
    def rms_after_mm(self) -> float:
        """RMS of the translations after."""
        return rms_mm(self.after, self.setting.data.component)


def hold_out(d: Diagnosis, seen: Measurements, held_out: Measurements) -> HeldOutReadings:
    """Predict readings by the model before and after a diagnosis, with the numbers that are written into its file.

    Raises
    ------
    InputError
        As of :func:`doe.tables.checks.refuse_seen`.
    """
    refuse_seen(seen, held_out)
    before, after = applied(d.before.setting, held_out), applied(d.after.setting, held_out)
    return HeldOutReadings(held_out, after, before.residual, after.residual, tuple(_remarks(after)))


def applied(s: Setting, data: Measurements) -> Setting:
    """A setting's model with its numbers, on other readings."""
    # Errors that every model has are columns on the setting's own readings.
    p = problem(s.model, data, ())
    return replace(s, data=p, history=history_of(data), errors=np.zeros((len(p), 0)))


def _remarks(s: Setting) -> list[str]:
    out = []
    for placed in s.accepted:
        code = placed.effect.code
        if placed.effect.needs_history and not s.history.is_known:
            out.append(f"{code}: these readings do not tell loading from unloading; all are taken as loading from zero")
        if placed.effect.needs_clock:
            out.append(f"{code}: another campaign has a clock of its own; nothing of the {code} need repeat there")
    return out
