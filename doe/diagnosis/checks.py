"""Checks after the name: what speaks against an effect that was taken up, with its evidence.

A ranking gives a name the probability that it has among all candidates. What no ranking asks is asked here: whether its
numbers are plausible, whether it predicts poses left out and not one of them alone, whether another effect could stand
in its place, whether anything is left, and whether what is left looks like noise (posterior predictive runs: Gelman,
Meng and Stern 1996). Each check that fails multiplies the odds of the name by its factor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from doe.diagnosis.evidence import LeftOut, Whitened, leave_one_pose_out
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Ranking, too_large, too_small
from doe.diagnosis.known import base_of, free_numbers
from doe.diagnosis.scatter import covariance
from doe.diagnosis.setting import Setting
from doe.diagnosis.unknowns import SIZES, processes
from fem.effects.base import EffectParameter
from robots.arrays import Array
from robots.quantities import percent
from robots.schema.units import factor

if TYPE_CHECKING:
    from doe.diagnosis.diagnose import Diagnosis, Found

Code = Literal[
    "plausible-parameters", "predicts-left-out", "stable", "nothing-left", "no-twin", "one-of-a-kind", "like-noise"
]
# By how much a failed check multiplies the odds of the name, in round numbers by what came of 105 first names on 250
# sets of five foreign worlds: of those that failed the check these were right: 5 of 9 (plausible-parameters), 13 of 19
# (nothing-left), 16 of 21 (no-twin) and 13 of 15 (like-noise). The rest failed too seldom to tell and are guesses. Of
# "plausible-parameters" it is set so that none of these names stands: a number outside of its range is the trace of
# another law. Of "nothing-left" it is the least: its factor is the odds by the last look that nothing else is missing.
FACTORS: Final[dict[Code, float]] = {
    "plausible-parameters": 0.2,
    "predicts-left-out": 0.3,
    "stable": 0.5,
    "nothing-left": 0.1,
    "no-twin": 0.8,
    "one-of-a-kind": 0.3,
    "like-noise": 0.8,
}
# No name is surer than this before its checks, by the same names: of 57 with 99 % and more 51 were right. Evidence
# grows without end with the readings, though no law and no noise is quite right.
SUREST: Final = 0.92
# Fewer poses than these tell nothing when one of them is left out.
FEWEST: Final = 4
# The best of the poses are left out of the gain, this share of them; what is left must speak for the name three to one.
BEST, SPEAKS = 0.1, math.log(3.0)
# Numbers of a fit must leave so many readings free for what is left to look like anything.
FREE: Final = 3.0
# Runs, and the share of them below which what is left is no noise.
RUNS, RARE = 400, 0.02
# Lists longer than this are cut.
NAMED: Final = 3


@dataclass(frozen=True)
class Check:
    """One check of one effect, or of all that was taken up together (``effect`` empty).

    ``passed``: None where it does not apply, which is no pass; ``evidence`` says why, or what speaks for and against.
    ``factor``: by how much the odds of the name are multiplied, 1 where it passes or does not apply.
    """

    code: Code
    effect: str
    passed: bool | None
    evidence: str
    factor: float


def checks(d: Diagnosis, rng: np.random.Generator | None = None) -> tuple[Check, ...]:
    """All checks of all that was taken up, effect by effect; none where nothing was.

    ``rng``: of the runs of "like-noise", by default of seed 0.
    """
    if not d.found:
        return ()
    out = []
    after = _best_left_out(d, d.after.setting)
    for f in d.found:
        out += [_plausible(f), *_predicting(d, f, after), _no_twin(d, f), _one_of_a_kind(d, f)]
    return (*out, _nothing_left(d), _like_noise(d, rng or np.random.default_rng(0)))


def stated(f: Found, made: tuple[Check, ...]) -> float:
    """Probability of an effect that was taken up, after the factors of all checks that are about it."""
    p = min(f.probability, SUREST)
    odds = p / (1.0 - p) * math.prod(c.factor for c in about(f, made))
    return odds / (1.0 + odds)


def about(f: Found, made: tuple[Check, ...]) -> list[Check]:
    """The checks of an effect, and those of all that was taken up."""
    return [c for c in made if c.effect in ("", f.code)]


def _judged(code: Code, effect: str, passed: bool | None, evidence: str, by: float | None = None) -> Check:
    """A check with its factor; ``by``: of one that fails, where it is not that of the table."""
    return Check(code, effect, passed, evidence, (FACTORS[code] if by is None else by) if passed is False else 1.0)


def _plausible(f: Found) -> Check:
    """Numbers within their ranges, give or take their uncertainty; too small is an effect only as a whole."""
    numbers = [(p, float(f.placed.values[k]), f.sd[p.name]) for k, p in free_numbers(f.placed)]
    if not numbers:
        reason = "it has no parameter that could be implausible: it is present or not"
        return _judged("plausible-parameters", f.code, None, reason)
    sizes = [n for n in numbers if n[0].role == "amplitude"]
    nothing = all(too_small(*n) for n in sizes)
    odd = [n for n in numbers if too_large(*n) or (too_small(*n) and (nothing or n[0].role == "shape"))]
    if not odd:
        text = _listed([_number(*n) for n in numbers]) + " within what is plausible"
        return _judged("plausible-parameters", f.code, True, text)
    text = _listed([f"{_number(*n)} where {_range(n[0])} is plausible" for n in odd])
    return _judged("plausible-parameters", f.code, False, text)


def _number(p: EffectParameter, acts: float, sd: float) -> str:
    """``gap 0.84 ± 0.05 mrad``; of a stiffness its interval of two standard deviations of the compliance."""
    unit, scale = "" if p.unit == "1" else f" {p.unit}", factor(p.dimension, p.unit)
    value = f"{p.name} {_short(p.value(acts) / scale)}"
    if p.scale == "linear":
        return f"{value} ± {_short(sd / scale, 2)}{unit}"
    ends = p.value(acts + 2.0 * sd), p.value(acts - 2.0 * sd) if acts > 2.0 * sd else math.inf
    low, high = (_short(x / scale) for x in ends)
    return f"{value}{unit} ({low} to {high if math.isfinite(ends[1]) else 'rigid'})"


def _range(p: EffectParameter) -> str:
    unit, scale = "" if p.unit == "1" else f" {p.unit}", factor(p.dimension, p.unit)
    return f"{'±' if p.signed else ''}{_short(p.lower / scale)} to {_short(p.upper / scale)}{unit}"


def _short(x: float, digits: int = 3) -> str:
    return f"{x:.{digits}g}".replace("e+0", "e").replace("e+", "e").replace("e-0", "e-").replace("-", "−")


def _listed(parts: list[str], between: str = "; ") -> str:
    more = f" and {len(parts) - NAMED} more" if len(parts) > NAMED else ""
    return between.join(parts[:NAMED]) + more


def _best_left_out(d: Diagnosis, s: Setting) -> LeftOut:
    """Each pose predicted from the others, at the noise that goes better with it: where nothing is missing, or found.

    At the noise that the better model leaves alone, the poorer one would look worse than it is.
    """
    base, out = base_of(s), []
    for noise in dict.fromkeys((d.after.refit.noise, d.rankings[0].of(NONE).noise)):
        out.append(leave_one_pose_out(base, covariance(s, noise, d.weight), s.data.pose))
    return max(out, key=lambda one: float(one.log_density.sum()))


def _predicting(d: Diagnosis, f: Found, after: LeftOut) -> tuple[Check, Check]:
    """What an effect gains at each pose that is predicted from the others, all else that was found in the model."""
    codes: tuple[Code, Code] = ("predicts-left-out", "stable")
    labels = d.after.setting.data.poses
    if len(labels) < FEWEST:
        text = f"{len(labels)} poses are too few to leave any out"
        return _judged(codes[0], f.code, None, text), _judged(codes[1], f.code, None, text)
    before = _best_left_out(d, d.without(f.code))
    gain = after.log_density - before.log_density
    ratio = _rms(d, after.error) / max(_rms(d, before.error), 1e-300)
    order = np.argsort(-gain)
    total, alone = float(gain.sum()), float(gain[order[0]])
    text = f"poses predicted from the others: log density {_signed(total)}, RMS error {ratio:.2f} times that without it"
    if total > 0.0 >= total - alone:
        text += f"; all of it by pose {labels[order[0]]}, without which it is {_signed(total - alone)}"
    predicts = _judged(codes[0], f.code, total > 0.0 and ratio < 1.0 and total - alone > 0.0, text)
    best = max(1, round(BEST * len(gain)))
    rest = float(gain[order[best:]].sum())
    without = "the pose that gains most" if best == 1 else f"the {best} poses that gain most"
    text = f"log density of poses left out {_signed(rest)} without {without}, where {SPEAKS:.1f} would speak for it"
    return predicts, _judged(codes[1], f.code, rest >= SPEAKS, text)


def _rms(d: Diagnosis, error: Array) -> float:
    """RMS of the readings that count: of displacements, of rotations where nothing else was read."""
    linear = d.after.setting.data.component < 3
    mine = d.counts & (linear if linear.any() else ~linear)
    return float(np.sqrt(np.mean(error[mine] ** 2)))


def _signed(x: float) -> str:
    return f"{x:+.1f}".replace("-", "−")


def _no_twin(d: Diagnosis, f: Found) -> Check:
    """Whether another effect could do what it does with numbers that are plausible for that one."""
    others = d.plausible_twins(f.code)
    if others is None:
        return _judged("no-twin", f.code, None, "it is so small here that anything would imitate it")
    if not others:
        return _judged("no-twin", f.code, True, "no other effect of plausible sign and size would look the same")
    text = f"{_listed(list(others), ', ')} of plausible sign and size would look the same"
    return _judged("no-twin", f.code, False, text)


def _one_of_a_kind(d: Diagnosis, f: Found) -> Check:
    """Several joints with one fault are rather one fault that the catalogue does not have."""
    effect, joints = f.placed.effect, d.start.model.robot.joint_names
    if effect.place not in joints:
        return _judged("one-of-a-kind", f.code, None, "it does not act at a joint")
    others = [g.placed.effect for g in d.found if g.placed.effect.place in set(joints) - {effect.place}]
    alike = [other.code for other in others if other.family == effect.family]
    if not alike:
        return _judged("one-of-a-kind", f.code, True, "nothing of its family was found at another joint")
    text = f"found together with {_listed(alike, ', ')}: a single fault that is not in the catalogue is more likely"
    return _judged("one-of-a-kind", f.code, False, text)


def last_look(d: Diagnosis) -> Ranking | None:
    """The ranking with all that was taken up in the model; None where there was no such look."""
    return d.rankings[len(d.found)] if len(d.found) < len(d.rankings) else None


def _nothing_left(d: Diagnosis) -> Check:
    """What the look with all of it in the model still gives to something else."""
    last = last_look(d)
    if last is None:
        return _judged("nothing-left", "", None, "the last look did not have all of it in the model")
    none, unknown = last.of(NONE).probability, last.of(UNKNOWN).probability
    further = max(1.0 - none - unknown, 0.0)
    text = f"the last look gives {percent(unknown)} to something unknown and {percent(further)} to further effects"
    effects = [h for h in last.hypotheses if h.code not in (NONE, UNKNOWN)]
    if effects and further > max(none, unknown):
        text += f", {effects[0].code} first"
    odds = none / max(1.0 - none, 1e-300)
    return _judged("nothing-left", "", odds >= 1.0, text, max(odds, FACTORS["nothing-left"]))


def _like_noise(d: Diagnosis, rng: np.random.Generator) -> Check:
    """Whether readings drawn of the model found leave as much, and as much along smooth processes, as the real ones."""
    s, noise = d.after.setting, d.after.refit.noise
    w = Whitened(base_of(s), covariance(s, noise, d.weight))
    free = len(w.r) - float(np.sum(w.inverse * (w.W.T @ w.W)))
    if free < FREE:
        return _judged("like-noise", "", None, f"only {free:.1f} of {len(w.r)} readings are left free by the fit")
    left = leftovers(w, rng)
    size = np.sum(left**2, axis=0)
    runs, every = {"leave a sum of squares as large": _as_much(size)}, processes(s)
    for axis, words in (("pose", "as much of it smooth over the poses"), ("clock", "as much of it over time")):
        # Sizes only scale a process: one of each will do.
        some = [x.columns for x in every if x.axis == axis][:: len(SIZES)]
        if some:
            smooth = np.sum((w.V.whiten(np.hstack(some)).T @ left) ** 2, axis=0)
            runs[words] = _as_much(smooth / size)
    text = ", ".join(f"{percent(share)} {words}" for words, share in runs.items())
    return _judged("like-noise", "", min(runs.values()) >= RARE, f"of runs of the model with its noise {text}")


def leftovers(w: Whitened, rng: np.random.Generator, runs: int = RUNS) -> Array:
    """What a refit of the base leaves (m, 1 + runs) of the readings and of readings drawn of the model, whitened.

    The runs' numbers are drawn as uncertain as the readings leave them; the refit is linear, with its priors.
    """
    root = np.linalg.solve(w.L.T, rng.standard_normal((len(w.L), runs)))
    drawn = w.W @ (w.u[:, None] + root) + rng.standard_normal((len(w.r), runs))
    every = np.column_stack([w.r, drawn])
    return np.asarray(every - w.W @ (w.inverse @ (w.W.T @ every)))


def _as_much(measure: Array) -> float:
    """Share of the runs (after the first, the readings') in which a measure (1 + n,) is as large as theirs."""
    return float((1 + np.sum(measure[1:] >= measure[0])) / len(measure))
