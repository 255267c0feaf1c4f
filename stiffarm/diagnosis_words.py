"""What a diagnosis says, in words for the shop floor."""

from __future__ import annotations

import math
from collections.abc import Sequence

from doe.diagnosis.diagnose import Found
from doe.diagnosis.ranking import NONE, UNKNOWN
from doe.diagnosis.where import Group, least_rms_mm, noise_floor_mm
from stiffarm.diagnosing import Diagnosed
from stiffarm.effect_numbers import Number, numbers_of

# A group with at least this share is named as a place of the disagreement.
LARGE = 0.15
# Below this, "nothing missing" is not what is most probable.
HALF = 0.5
NAMED = 3

_PHASES = {"not told": "readings without a phase"}


def headline(d: Diagnosed) -> str:
    """The verdict in one sentence."""
    found = d.found
    if found.verdict == "none":
        if found.rankings[0].of(NONE).probability < HALF:
            return "These readings do not prove that anything is missing, but they hint at it."
        return "Nothing is missing that these readings could show: what is left is noise."
    if found.verdict == "named":
        names = _and([what(f) for f in found.effects])
        return f"What is missing has a name: {names}."
    if found.verdict == "ambiguous":
        return f"Something is missing, but these readings cannot tell which of several effects it is: {_rivals(d)}."
    return "Something is missing that no effect of the catalogue explains."


def what(f: Found) -> str:
    """``joint j2 gets stiffer with the torque (hardening:j2)``."""
    return f"{f.placed.effect.words} ({f.code})"


def how_sure(d: Diagnosed) -> str:
    """How sure the verdict is."""
    first = d.found.rankings[0]
    if d.found.verdict == "named":
        parts = [f"{f.code} {percent(f.probability)}" for f in d.found.effects]
        return f"Probability among all candidates when it was found: {', '.join(parts)}; {d.found.reason}."
    if d.found.verdict == "none":
        none = first.of(NONE).probability
        other = next(h for h in first.hypotheses if h.code != NONE)
        hint = f" Most probable otherwise: {other.code}, {percent(other.probability)}." if none < HALF else ""
        return f"Probability that nothing is missing: {percent(none)}; {d.found.reason}.{hint}"
    if d.found.verdict == "unknown":
        return (
            f"Probability of something unknown: {percent(_unknown(d))}, against "
            f"{percent(first.of(NONE).probability)} that nothing is missing; {d.found.reason}."
        )
    last = d.found.rankings[max(len(d.in_model) - 1, 0)]
    parts = [f"{h.code} {percent(h.probability)}" for h in last.hypotheses[:4]]
    return f"Probabilities: {', '.join(parts)}; {d.found.reason}."


def _unknown(d: Diagnosed) -> float:
    """The highest probability that any look gave to something unknown."""
    return max(r.of(UNKNOWN).probability for r in d.found.rankings)


def gap_sentence(d: Diagnosed) -> str:
    """How the gap shrank, on readings that the fit has not seen."""
    before, after, h = d.found.before, d.found.after, d.held_out
    floor = noise_floor_mm(d.found)
    if not d.in_model:
        text = f"The model with fitted springs is {before.fit_rms_mm:.3f} mm (RMS) off its readings"
        far = before.left_out_rms_mm if h is None else h.rms_before_mm
        where = "at poses left out one at a time" if h is None else f"on {h.data.source}, which it has not seen"
        return f"{text} and {far:.3f} mm {where}; noise alone would give {floor:.3f} mm."
    a, b = (before.left_out_rms_mm, after.left_out_rms_mm) if h is None else (h.rms_before_mm, h.rms_after_mm)
    where = "At poses left out one at a time" if h is None else f"On {h.data.source}, which nothing was fitted to,"
    return (
        f"{where} the error went from {a:.3f} to {b:.3f} mm RMS (in the fit from {before.fit_rms_mm:.3f} to "
        f"{after.fit_rms_mm:.3f} mm; no springs alone get below {least_rms_mm(before.setting):.3f} mm). Noise alone would "
        f"give {floor:.3f} mm."
    )


def where_sentences(d: Diagnosed) -> tuple[str, ...]:
    """Where the disagreement lies: the groups with large shares."""
    if d.found.verdict == "none":
        return ("Residuals are as large everywhere as noise makes them.",)
    out = []
    for kind, groups in d.where.items():
        text = _of_kind(kind, groups)
        if text:
            out.append(text)
    return tuple(out)


def _of_kind(kind: str, groups: Sequence[Group]) -> str:
    if len(groups) < 2 or any(math.isnan(g.share) for g in groups):
        return ""
    order = sorted(groups, key=lambda g: -g.share)
    large = [g for g in order if g.share >= max(LARGE, 1.2 / len(groups))][:NAMED]
    if not large:
        top = order[:NAMED]
        listed = ", ".join(f"{_PHASES.get(g.label, g.label)} {percent(g.share)}" for g in top)
        return f"By {kind} it is spread out; the largest shares are {listed}."
    listed = ", ".join(f"{_PHASES.get(g.label, g.label)} {percent(g.share)}{_sign(g)}" for g in large)
    return f"By {kind}: {listed} of all that is beyond the noise."


def _sign(g: Group) -> str:
    return f" (read minus predicted {1e3 * g.mean:+.3f} mm on average)".replace("+-", "±").replace("-", "−")


def number_text(n: Number) -> str:
    """``gap 0.84 ± 0.05 mrad``, or with its interval where that says more."""
    unit = "" if n.unit == "1" else f" {n.unit}"
    if not math.isfinite(n.value):
        return f"{n.name}: nothing of it acts"
    if n.sd is None or not math.isfinite(n.sd):
        return f"{n.name} {_short(n.value)}{unit}"
    if n.low is not None and n.high is not None and (math.isinf(n.high) or n.sd > 0.3 * abs(n.value)):
        high = "no upper limit" if math.isinf(n.high) else _short(n.high)
        return f"{n.name} {_short(n.value)}{unit} (95 %: {_short(n.low)} to {high})"
    return f"{n.name} {_short(n.value)} ± {_short(n.sd, 2)}{unit}"


def numbers_sentence(d: Diagnosed, f: Found) -> str:
    """All numbers of an effect of the new model."""
    mine = [n for n in numbers_of(d.found.after) if n.code == f.code]
    return "; ".join(number_text(n) for n in mine) or "no number: it is there or it is not"


def _short(value: float, digits: int = 3) -> str:
    return f"{value:.{digits}g}".replace("e+0", "e").replace("e+", "e").replace("-", "−")


def percent(value: float) -> str:
    """``82 %``; never 0 % or 100 % for what is neither."""
    if 0.0 < value < 0.005:
        return "below 1 %"
    if 0.995 <= value < 1.0:
        return "above 99 %"
    return f"{100.0 * value:.0f} %"


def _rivals(d: Diagnosed) -> str:
    return " or ".join(d.rivals[:4]) + (" or others" if len(d.rivals) > 4 else "") if d.rivals else "none stands out"


def _and(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def twin_sentences(d: Diagnosed) -> tuple[str, ...]:
    """Which candidates these readings could not tell apart."""
    out = []
    for code, others in d.twins.items():
        if others:
            listed = ", ".join(others[:6]) + (f" and {len(others) - 6} more" if len(others) > 6 else "")
            out.append(f"{code} could not be told from {listed}.")
        else:
            out.append(f"{code} could be told from every other effect.")
    return tuple(out)


def next_sentence(d: Diagnosed) -> str:
    """What to do next."""
    if d.found.verdict == "named":
        return "Nothing is left to be settled between candidates; readings in new poses would confirm the name."
    if d.found.verdict == "none":
        return "Nothing needs to be settled. What these readings cannot see would need other poses, loads or directions."
    if d.found.verdict == "ambiguous":
        return f"Readings that differ between {_rivals(d)} would settle it."
    return (
        "Look at the poses named above first: cables, stops, bolts, a dial gauge that sticks. A law of your own can be "
        "tried with --effect FILE.py."
    )


def summary(d: Diagnosed) -> list[str]:
    """The lines that a terminal shows."""
    out = [headline(d), how_sure(d), gap_sentence(d)]
    out += [f"{f.code}: {numbers_sentence(d, f)}" for f in d.in_model]
    return out
