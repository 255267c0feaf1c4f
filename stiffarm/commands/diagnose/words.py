"""What a diagnosis says, in words for the shop floor."""

from __future__ import annotations

import math
from collections.abc import Sequence

from doe.diagnosis.checks import stated
from doe.diagnosis.diagnose import Found
from doe.diagnosis.hypotheses import NONE, UNKNOWN
from doe.diagnosis.nested import Nested
from doe.diagnosis.where import Group, least_rms_mm, noise_floor_mm
from doe.tables.loaded import rms_mm
from fem.effects.base import Effect
from fem.effects.learned import axes_of
from robots.quantities import percent, significant
from stiffarm.commands.diagnose.check_words import check_sentences
from stiffarm.commands.diagnose.effect_numbers import Number, numbers_of, short
from stiffarm.commands.diagnose.ladder import NAMES
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.session.words.noise import RESIDUAL, is_residual

# A group with at least this share is named as a place of the disagreement.
LARGE = 0.15
# Below this, "nothing missing" is not what is most probable; from SURE on it is firm.
HALF, SURE = 0.5, 0.8
NAMED = 3
# What something unknown varies with, for a sentence.
BY = {
    "pose": "the pose",
    "load": "the load",
    "load history": "whether loads are put on or taken off",
    "clock": "the time",
    "session": "the session",
    "direction": "the direction of the load",
    "": "the pose",
}
NAMED_ODD = 6
VERDICTS = {
    "named": "named",
    "ambiguous": "not settled",
    "unknown": "unknown effect",
    "learned": "learned, no name",
    "none": "nothing missing",
    "uninformative": "readings tell nothing",
}


def headline(d: Diagnosed) -> str:
    """The verdict in one sentence."""
    found = d.found
    if found.verdict == "none":
        if hints(d):
            return "These readings do not prove that anything is missing, but they hint at it."
        if found.rankings[0].of(NONE).probability < SURE:
            return "These readings do not show that anything is missing; they leave room for something small."
        if is_residual(found.after.setting.data):
            return (
                "Nothing is missing that these readings could show. Without repeats, it is not known how much of "
                "the remaining error is noise."
            )
        return "Nothing is missing that these readings could show: the remaining error is noise."
    if not d.tells:
        return "These readings tell nothing about the arm: neither that something is missing nor that nothing is."
    if found.verdict == "named":
        names = and_list([what(f) for f in found.effects])
        beside = f" Beside that, with no name: {_learned(found.learned)}." if found.learned else ""
        return f"What is missing has a name: {names}.{beside}"
    if found.verdict == "learned":
        return f"Something is missing that the catalogue has no name for: {_learned(found.learned)}."
    if found.verdict == "ambiguous" and found.effects:
        names = and_list([what(f) for f in found.effects])
        return f"Missing: {names}. Beyond that {_beyond(d)}."
    if probable(d):
        beyond = f" Beyond that {_beyond(d)}." if len(d.in_model) > 1 else ""
        return (
            f"Something is missing, most probably {what(found.provisional[0])}: {percent(found.stated)} after its "
            f"checks, which is too little to name it.{beyond}"
        )
    if found.verdict == "ambiguous":
        return f"Something is missing, but these readings cannot tell which of several effects it is: {rivals_text(d)}."
    if found.provisional:
        codes = and_list([f.code for f in found.provisional])
        return f"Something is missing that the catalogue does not know; {codes} would explain part of it at best."
    return "Something is missing that no effect of the catalogue explains."


def _learned(found: Sequence[Found]) -> str:
    """``joint j2 turns by a law of its own over its torque (along load, pose; learned-torque:j2)``."""
    return and_list([_law(f.placed.effect) for f in found])


def _law(effect: Effect) -> str:
    return f"{effect.words} (along {' and '.join(axes_of(effect.code))}; {effect.code})"


def hints(d: Diagnosed) -> bool:
    """Whether nothing is proven to be missing, but that is not the most probable either."""
    return d.found.verdict == "none" and d.found.rankings[0].of(NONE).probability < HALF


def _beyond(d: Diagnosed) -> str:
    """What is left beyond the effects that are named or probable."""
    if not d.rivals:
        return "something is left that no effect of the catalogue explains"
    return f"something is left, and these readings cannot tell which effect it is: {rivals_text(d)}"


def probable(d: Diagnosed) -> bool:
    """Whether no effect is named, and one was more probable than all else together when it was found."""
    found = d.found
    if found.verdict != "ambiguous" or found.effects or not found.provisional:
        return False
    return len(d.rivals) == 1 or (len(d.in_model) > 1 and found.provisional[0].probability > HALF)


def what(f: Found) -> str:
    """``joint j2 gets stiffer with the torque (hardening:j2)``."""
    return f"{f.placed.effect.words} ({f.code})"


def how_sure(d: Diagnosed) -> str:
    """How sure the verdict is."""
    first = d.found.rankings[0]
    if not d.tells:
        return (
            f"{d.found.reason[0].upper()}{d.found.reason[1:]}. No parameter is derived from them, and no model is "
            "written."
        )
    if d.found.verdict in ("named", "learned"):
        return f"{then_and_now(d)}; {d.found.reason}."
    if d.found.verdict == "none":
        none = first.of(NONE).probability
        other = next(h for h in first.hypotheses if h.code != NONE)
        hint = (
            f" Most probable otherwise: {NAMES.get(other.code, other.code)}, {percent(other.probability)}."
            if none < HALF
            else ""
        )
        return f"Probability that nothing is missing: {percent(none)}; {d.found.reason}.{hint}"
    if d.found.verdict == "unknown":
        most = max(r.of(UNKNOWN).probability for r in d.found.rankings)
        suspect = d.found.suspect
        law = None if suspect is None or suspect.signature is None else suspect.signature.effect
        where = "" if law is None else f" The best-fitting law learned at one place: {_law(law)}."
        return (
            f"Probability of something unknown: {percent(most)}, against {percent(first.of(NONE).probability)} "
            f"that nothing is missing; {d.found.reason}. It varies mainly with {BY[first.of(UNKNOWN).axis]}.{where}"
        )
    last = d.found.rankings[max(len(d.in_model) - 1, 0)]
    parts = [f"{NAMES.get(h.code, h.code)} {percent(h.probability)}" for h in last.hypotheses[:4]]
    led = bool(d.found.effects) or (probable(d) and len(d.in_model) > 1)
    sure = f"{then_and_now(d)}. " if led else ""
    beyond = " beyond that" if led else ""
    return f"{sure}Probabilities{beyond}: {', '.join(parts)}; {d.found.reason}."


def then_and_now(d: Diagnosed) -> str:
    """``load-path 42 % now that its checks are heeded (92 % when it was found)``, of each name."""
    made = d.found.checks
    parts = [
        f"{f.code} {percent(stated(f, made))} ({percent(f.probability)} before)"
        for f in (*d.found.effects, *d.found.learned, *(d.found.provisional[:1] if probable(d) else ()))
    ]
    return f"Probability after the checks: {', '.join(parts)}"


def gap_sentence(d: Diagnosed) -> str:
    """How the gap shrank, on readings that the fit has not seen."""
    before, after, h = d.found.before, d.found.after, d.held_out
    a, b = d.unseen_rms_mm
    if not d.in_model:
        text = f"The model with fitted springs is {significant(before.fit_rms_mm)} mm (RMS) off its readings"
        where = f"at {unseen_poses(d)}" if h is None else f"on {h.data.source}, which it has not seen"
        read = rms_mm(before.setting.data.value, before.setting.data.component)
        if not d.tells:
            return f"{text}, which are {significant(read)} mm (RMS) themselves, and {significant(a)} mm {where}."
        return f"{text} and {significant(a)} mm {where}; {_floor(d)}.{_rejected(d)}"
    where = f"At {unseen_poses(d)}" if h is None else f"On {h.data.source}, which nothing was fitted to,"
    return (
        f"{where} the error went from {significant(a)} to {significant(b)} mm RMS (in the fit from "
        f"{significant(before.fit_rms_mm)} to {significant(after.fit_rms_mm)} mm; springs alone cannot get below "
        f"{significant(least_rms_mm(d.found))} mm). {_without_odd(d)}{sentence(_floor(d))}."
    )


def _rejected(d: Diagnosed) -> str:
    """What the model does not have because poses not seen would get worse with it."""
    r = d.found.rejected
    if r is None:
        return ""
    there = f"{significant(r.after_mm)} mm there instead of {significant(r.before_mm)}"
    return f" With {and_list(r.codes)} it would be {there}, so the model goes without."


def gap_title(before_mm: float, after_mm: float) -> str:
    """Title of two errors at poses not seen, as they are; of one alone where the second is NaN."""
    if not math.isfinite(after_mm) or after_mm == before_mm:
        return "How large the gap is"
    return "How the gap shrank" if after_mm < before_mm else "How the gap grew"


def _without_odd(d: Diagnosed) -> str:
    """That an RMS leaves out readings that hardly count, where there are some."""
    return f"The {len(d.odd)} outliers are left out of this. " if d.odd else ""


def unseen_poses(d: Diagnosed) -> str:
    """Which poses the shown error is at, where no readings were held out."""
    if d.nested is None:
        return "poses left out one at a time"
    if d.nested.folds == len(d.found.start.data.poses):
        return "poses it has not seen (left out one at a time, effects chosen again without each)"
    return f"poses it has not seen ({d.nested.folds} folds, effects chosen again in each)"


def chosen_anew(n: Nested) -> str:
    """What the folds found and how far off they are: the error to rely on."""
    chosen = ", ".join(f"{code} in {count} of {n.folds}" for code, count in n.chosen.items())
    return (
        f"The error to rely on is that at poses left out of the whole search: {significant(n.rms_before_mm)} → "
        f"{significant(n.rms_after_mm)} mm. Found without them: {chosen or 'nothing, in any fold'}."
    )


def _floor(d: Diagnosed) -> str:
    """What noise alone would give, or what the model leaves where only that is known."""
    floor, p = noise_floor_mm(d.found), d.found.after.setting.data
    if is_residual(p):
        return f"{RESIDUAL} is {significant(floor)} mm; without repeats, it is not known how much of it is noise"
    return f"noise alone would give {significant(floor)} mm"


def where_sentences(d: Diagnosed) -> tuple[str, ...]:
    """Where the disagreement lies: the groups with large shares."""
    if d.found.verdict == "none":
        return ("Residuals are no larger anywhere than their scatter explains.",)
    if not d.tells:
        return ("Residuals are as large as the readings.",)
    return tuple(filter(None, (_of_kind(kind, groups) for kind, groups in d.where.items())))


def _of_kind(kind: str, groups: Sequence[Group]) -> str:
    if len(groups) < 2 or any(math.isnan(g.share) for g in groups):
        return ""
    order = sorted(groups, key=lambda g: -g.share)
    large = [g for g in order if g.share >= max(LARGE, 1.2 / len(groups))][:NAMED]
    if not large:
        top = order[:NAMED]
        listed = ", ".join(f"{_place(kind, g)} {share_text(g)}" for g in top)
        return f"By {kind} it is spread out; the largest shares are {listed}."
    listed = ", ".join(f"{_place(kind, g)} {share_text(g)}{_sign(g)}" for g in large)
    return f"By {kind}: {listed} of all that is beyond the noise."


def share_text(g: Group) -> str:
    """``31 ± 6 %``, one standard deviation by the uncertainty of springs and effects."""
    return f"{100.0 * g.share:.0f} ± {100.0 * g.share_sd:.0f} %" if g.share_sd >= 0.005 else percent(g.share)


def _place(kind: str, g: Group) -> str:
    if kind == "pose":
        return f"pose {g.label}"
    return "readings without a phase" if g.label == "not told" else g.label


def _sign(g: Group) -> str:
    return f" (read minus simulated {1e3 * g.mean:+.3f} mm on average)".replace("+-", "±").replace("-", "−")


def number_text(n: Number) -> str:
    """``gap 0.84 ± 0.05 mrad``, or with its interval where that says more."""
    unit = "" if n.unit == "1" else f" {n.unit}"
    if not math.isfinite(n.value):
        return f"{n.name}: no effect"
    if n.sd is None or not math.isfinite(n.sd):
        return f"{n.name} {short(n.value)}{unit}"
    if n.low is not None and n.high is not None and (math.isinf(n.high) or n.sd > 0.3 * abs(n.value)):
        high = "no upper limit" if math.isinf(n.high) else short(n.high)
        return f"{n.name} {short(n.value)}{unit} (95 %: {short(n.low)} to {high})"
    return f"{n.name} {short(n.value)} ± {short(n.sd, 2)}{unit}"


def value_text(n: Number) -> str:
    """``0.845`` with its unit."""
    if not math.isfinite(n.value):
        return "no effect"
    return short(n.value) + ("" if n.unit == "1" else f" {n.unit}".replace(" ", "\u00a0"))


def interval_text(n: Number) -> str:
    """``0.8 to 0.9``, or that the number was chosen from those tried."""
    if n.low is None or n.high is None:
        return "best of those tried"
    return f"{short(n.low)}\u00a0to\u00a0{'no upper limit' if math.isinf(n.high) else short(n.high)}"


def plausible_text(n: Number) -> str:
    """The range expected beforehand."""
    return f"{'±' if n.signed else ''}{short(n.plausible[0])} to {short(n.plausible[1])}"


def numbers_sentence(d: Diagnosed, f: Found) -> str:
    """All numbers of an effect of the new model."""
    mine = [n for n in numbers_of(d.found.after) if n.code == f.code]
    return "; ".join(number_text(n) for n in mine) or "no parameter: it is present or not"


def rivals_text(d: Diagnosed) -> str:
    """Effects between which the verdict could not choose."""
    return " or ".join(d.rivals[:4]) + (" or others" if len(d.rivals) > 4 else "") if d.rivals else "something unknown"


def and_list(parts: Sequence[str]) -> str:
    """``a, b and c``."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def twin_sentences(d: Diagnosed) -> tuple[str, ...]:
    """Which candidates these readings could not tell apart."""
    out = []
    for code, others in d.twins.items():
        if others:
            listed = ", ".join(others[:6]) + (f" and {len(others) - 6} more" if len(others) > 6 else "")
            out.append(f"{code} cannot be separated from {listed}.")
        else:
            out.append(f"{code} has none: every other effect would look different.")
    return tuple(out)


def odd_sentences(d: Diagnosed) -> tuple[str, ...]:
    """Which readings hardly count; none where all do."""
    if not d.odd or not d.tells:
        return ()
    return (
        f"{len(d.odd)} of {len(d.found.before.setting.data)} readings are outliers and get almost no weight, because "
        f"they do not fit all the others: {odd_places(d)}. Check them first.",
    )


def odd_places(d: Diagnosed) -> str:
    """``pose 3 at 375 N, ...`` of the readings that hardly count."""
    p, loads = d.found.before.setting.data, d.used.loads_N
    told = [f"pose {p.poses[p.pose[k]]} at {loads[p.row[k]]:g} N" for k in d.odd[:NAMED_ODD]]
    more = f" and {len(d.odd) - NAMED_ODD} more" if len(d.odd) > NAMED_ODD else ""
    return f"{', '.join(dict.fromkeys(told))}{more}"


def sentence(text: str) -> str:
    """With a capital, unless it begins with a code."""
    return text if ":" in text.split()[0] or "-" in text.split()[0] else f"{text[0].upper()}{text[1:]}"


def summary(d: Diagnosed) -> list[str]:
    """The lines that a terminal shows."""
    out = [headline(d), how_sure(d), *check_sentences(d.found), gap_sentence(d), *odd_sentences(d)]
    out += [f"{f.code}: {numbers_sentence(d, f)}" for f in d.in_model]
    return out
