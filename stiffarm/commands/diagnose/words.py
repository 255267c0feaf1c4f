"""What a diagnosis says, in words for the shop floor."""

from __future__ import annotations

import math
from collections.abc import Sequence

from doe.diagnosis.diagnose import Found
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Kind
from doe.diagnosis.nested import Nested
from doe.diagnosis.proposals.next_readings import NextReadings
from doe.diagnosis.proposals.rivals import look_of
from doe.diagnosis.where import Group, least_rms_mm, noise_floor_mm
from doe.tables.loaded import rms_mm
from fem.effects.base import Effect
from fem.effects.learned import axes_of
from stiffarm.commands.diagnose.check_words import check_sentences
from stiffarm.commands.diagnose.effect_numbers import Number, numbers_of, short
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.pages.report import Block, Bullets, Table, Text
from stiffarm.session.direction_words import set_up_rows
from stiffarm.session.noise_words import RESIDUAL, is_residual

# A group with at least this share is named as a place of the disagreement.
LARGE = 0.15
# Below this, "nothing missing" is not what is most probable.
HALF = 0.5
NAMES = {NONE: "nothing missing", UNKNOWN: "something unknown"}
NAMED = 3
# What something unknown varies with, for a sentence.
BY = {
    "pose": "the pose", "load": "the load", "load history": "whether loads come on or off", "clock": "the time",
    "session": "the day or visit", "direction": "the direction of the load", "": "the pose",
}  # fmt: skip
NAMED_ODD = 6
NEXT: dict[Kind, str] = {
    "named": "Nothing is left to be settled between candidates; readings in new poses would confirm the name.",
    "none": "Nothing needs to be settled. What these readings cannot see would need other poses, loads or directions.",
    "uninformative": "Check signs, the order of the rows, which column is which, loads and joint angles; else measure "
    "again with larger loads.",
    "learned": "Look at the place named above: what could act there, and along that? The law that was learned is in "
    "the new model and can be used as it is; a law of your own can be tried with --effect FILE.py.",
    "unknown": "Look at the poses named above first: cables, stops, bolts, a dial gauge that sticks. A law of your own "
    "can be tried with --effect FILE.py.",
}


def headline(d: Diagnosed) -> str:
    """The verdict in one sentence."""
    found = d.found
    if found.verdict == "none":
        if hints(d):
            return "These readings do not prove that anything is missing, but they hint at it."
        if is_residual(found.after.setting.data):
            return (
                "Nothing is missing that these readings could show. Without repeats, how much of what is left is noise "
                "cannot be told."
            )
        return "Nothing is missing that these readings could show: what is left is noise."
    if not d.tells:
        return "These readings tell nothing about the arm: not that something is missing, nor that nothing is."
    if found.verdict == "named":
        names = _and([what(f) for f in found.effects])
        beside = f" Beside that, with no name: {_learned(found.learned)}." if found.learned else ""
        return f"What is missing has a name: {names}.{beside}"
    if found.verdict == "learned":
        return f"Something is missing that the catalogue has no name for: {_learned(found.learned)}."
    if found.verdict == "ambiguous" and found.effects:
        names = _and([what(f) for f in found.effects])
        return f"Missing: {names}. Beyond that these readings cannot tell which it is: {_rivals(d)}."
    if found.verdict == "ambiguous":
        return f"Something is missing, but these readings cannot tell which of several effects it is: {_rivals(d)}."
    if found.provisional:
        codes = _and([f.code for f in found.provisional])
        return f"Something is missing that the catalogue does not know; {codes} would explain part of it at best."
    return "Something is missing that no effect of the catalogue explains."


def _learned(found: Sequence[Found]) -> str:
    """``joint j2 turns by a law of its own over its torque (along load, pose; learned-torque:j2)``."""
    return _and([_law(f.placed.effect) for f in found])


def _law(effect: Effect) -> str:
    return f"{effect.words} (along {' and '.join(axes_of(effect.code))}; {effect.code})"


def hints(d: Diagnosed) -> bool:
    """Whether nothing is proven to be missing, but that is not the most probable either."""
    return d.found.verdict == "none" and d.found.rankings[0].of(NONE).probability < HALF


def what(f: Found) -> str:
    """``joint j2 gets stiffer with the torque (hardening:j2)``."""
    return f"{f.placed.effect.words} ({f.code})"


def how_sure(d: Diagnosed) -> str:
    """How sure the verdict is."""
    first = d.found.rankings[0]
    if not d.tells:
        return (
            f"{d.found.reason[0].upper()}{d.found.reason[1:]}. No number is given from them, and no model is written."
        )
    if d.found.verdict == "named":
        parts = [f"{f.code} {percent(f.probability)}" for f in d.found.effects]
        return (
            f"Probability among all candidates when it was found: {', '.join(parts)}; {d.found.reason}. "
            f"After the checks below {percent(d.found.stated)} are left for {d.found.effects[0].code}."
        )
    if d.found.verdict == "learned":
        parts = [f"{f.code} {percent(f.probability)}" for f in d.found.learned]
        return f"Probability when it was found: {', '.join(parts)}; {d.found.reason}."
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
        where = "" if law is None else f" Of laws learned at one place this one goes best with it: {_law(law)}."
        return (
            f"Probability of something unknown: {percent(most)}, against "
            f"{percent(first.of(NONE).probability)} that nothing is missing; {d.found.reason}. "
            f"It goes by {BY[first.of(UNKNOWN).axis]} first of all.{where}"
        )
    last = d.found.rankings[max(len(d.in_model) - 1, 0)]
    parts = [f"{NAMES.get(h.code, h.code)} {percent(h.probability)}" for h in last.hypotheses[:4]]
    return f"Probabilities: {', '.join(parts)}; {d.found.reason}."


def gap_sentence(d: Diagnosed) -> str:
    """How the gap shrank, on readings that the fit has not seen."""
    before, after, h = d.found.before, d.found.after, d.held_out
    a, b = d.unseen_rms_mm
    if not d.in_model:
        text = f"The model with fitted springs is {before.fit_rms_mm:.3f} mm (RMS) off its readings"
        where = f"at {unseen_poses(d)}" if h is None else f"on {h.data.source}, which it has not seen"
        read = rms_mm(before.setting.data.value, before.setting.data.component)
        if not d.tells:
            return f"{text}, which are {read:.3f} mm (RMS) themselves, and {a:.3f} mm {where}."
        return f"{text} and {a:.3f} mm {where}; {_floor(d)}."
    where = f"At {unseen_poses(d)}" if h is None else f"On {h.data.source}, which nothing was fitted to,"
    return (
        f"{where} the error went from {a:.3f} to {b:.3f} mm RMS (in the fit from {before.fit_rms_mm:.3f} to "
        f"{after.fit_rms_mm:.3f} mm; no springs alone get below {least_rms_mm(d.found):.3f} mm). "
        f"{_without_odd(d)}{_sentence(_floor(d))}."
    )


def _without_odd(d: Diagnosed) -> str:
    """That an RMS leaves out readings that hardly count, where there are some."""
    return f"The {len(d.odd)} readings that hardly count are left out of this. " if d.odd else ""


def unseen_poses(d: Diagnosed) -> str:
    """Which poses the shown error is at, where no readings were held out."""
    if d.nested is None:
        return "poses left out one at a time"
    if d.nested.folds == len(d.found.start.data.poses):
        return "poses it has not seen (one at a time, effects chosen anew without it)"
    return f"poses it has not seen ({d.nested.folds} folds, effects chosen anew in each)"


def nested_sentence(n: Nested) -> str:
    """What the folds found."""
    chosen = ", ".join(f"{code} in {count} of {n.folds}" for code, count in n.chosen.items())
    return f"Found without the poses left out: {chosen or 'nothing, in any fold'}."


def _floor(d: Diagnosed) -> str:
    """What noise alone would give, or what the model leaves where only that is known."""
    floor, p = noise_floor_mm(d.found), d.found.after.setting.data
    if is_residual(p):
        return f"{RESIDUAL}, from which no repeats tell the noise, is put at {floor:.3f} mm"
    return f"noise alone would give {floor:.3f} mm"


def where_sentences(d: Diagnosed) -> tuple[str, ...]:
    """Where the disagreement lies: the groups with large shares."""
    if d.found.verdict == "none":
        return ("Residuals are as large everywhere as their scatter makes them.",)
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
        return f"{n.name}: nothing of it acts"
    if n.sd is None or not math.isfinite(n.sd):
        return f"{n.name} {short(n.value)}{unit}"
    if n.low is not None and n.high is not None and (math.isinf(n.high) or n.sd > 0.3 * abs(n.value)):
        high = "no upper limit" if math.isinf(n.high) else short(n.high)
        return f"{n.name} {short(n.value)}{unit} (95 %: {short(n.low)} to {high})"
    return f"{n.name} {short(n.value)} ± {short(n.sd, 2)}{unit}"


def value_text(n: Number) -> str:
    """``0.845`` with its unit."""
    if not math.isfinite(n.value):
        return "nothing of it acts"
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
    return "; ".join(number_text(n) for n in mine) or "no number: it is there or it is not"


def percent(value: float) -> str:
    """``82 %``; never 0 % or 100 % for what is neither."""
    if 0.0 < value < 0.005:
        return "below 1 %"
    if value >= 0.995:
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
            out.append(f"{code} has none: every other effect would look different.")
    return tuple(out)


def odd_sentences(d: Diagnosed) -> tuple[str, ...]:
    """Which readings hardly count; none where all do."""
    if not d.odd or not d.tells:
        return ()
    p, loads = d.found.before.setting.data, d.used.loads_N
    told = [f"pose {p.poses[p.pose[k]]} at {loads[p.row[k]]:g} N" for k in d.odd[:NAMED_ODD]]
    more = f" and {len(d.odd) - NAMED_ODD} more" if len(d.odd) > NAMED_ODD else ""
    return (
        f"{len(d.odd)} of {len(p)} readings hardly count, for they are far from what all others make of them: "
        f"{', '.join(dict.fromkeys(told))}{more}. Look at them first.",
    )


def next_sentence(d: Diagnosed) -> str:
    """What to do next."""
    if d.found.verdict == "ambiguous" and d.found.same:
        return (
            f"In these readings {_and([f.code for f in d.found.provisional] or ['it'])} cannot be told from "
            f"{' or '.join(d.found.same)}: look at the set-up itself (mastering marks, the frame of forces and "
            "readings measured against the robot's base, the tool point); further readings help only where they differ."
        )
    if d.nothing_next and d.found.verdict != "unknown":
        return f"No further set-up would settle it: {d.nothing_next}."
    if d.found.verdict == "ambiguous":
        return f"Readings that differ between {_rivals(d)} would settle it."
    if d.still_open:
        return _still_open(d)
    if d.found.verdict == "named" and any(d.twins.get(f.code) for f in d.found.effects):
        return _beside_twins(d)
    return NEXT[d.found.verdict]


def _still_open(d: Diagnosed) -> str:
    """What a name could still be instead."""
    parts = []
    for code, others in d.still_open.items():
        best = look_of(d.found, code)
        listed = ", ".join(f"{other} ({percent(best.of(other).probability)})" for other in others[:NAMED])
        parts.append(f"{code} could still be {listed}")
    return f"{_and(parts)}: readings that differ between them would settle it."


def _beside_twins(d: Diagnosed) -> str:
    """Why nothing is left to settle of a name that others could imitate."""
    parts = []
    for f in d.found.effects:
        if others := d.twins.get(f.code):
            parts.append(f"{_and(others[:NAMED])}{' and others' if len(others) > NAMED else ''} could imitate {f.code}")
    return (
        f"{_and(parts)}, but each is less than a hundredth as probable. Readings in new poses would confirm the name."
    )


def proposal_text(n: NextReadings) -> str:
    """Loads, phases and repeats of a proposal."""
    done = n.protocol
    loads = ", ".join(f"{v:g}" for v in done.forces)
    way = "put on one after the other and taken off again" if done.unloading else "put on one after the other"
    read = ", ".join(
        ("X", "Y", "Z", "rotation about X", "rotation about Y", "rotation about Z")[k] for k in done.components
    )
    return (
        f"{len(n.labels)} set-ups, chosen so that the candidates that are left predict different readings there: loads "
        f"of {loads} N {way}, {done.repeats} times; read {read}. The sheet is next_readings.csv; fill it in and run "
        "`stiffarm diagnose MODEL DATA next_readings.csv`."
    )


def _sentence(text: str) -> str:
    """With a capital, unless it begins with a code."""
    return text if ":" in text.split()[0] or "-" in text.split()[0] else f"{text[0].upper()}{text[1:]}"


def proposal_blocks(d: Diagnosed, n: NextReadings) -> list[Block]:
    """The proposal as text, what it is expected to tell, and a table of set-ups."""
    heads = ("set-up", *(f"{c.removesuffix('_deg')} (deg)" for c in d.given.robot.coordinates), "load")
    return [
        Text(proposal_text(n)),
        Bullets(tuple(f"{_sentence(w)}." for w in n.words)),
        Table(
            "Set-ups to measure next", heads, set_up_rows(n.labels, n.q, n.direction), (0, len(heads) - 1), folded=True
        ),
    ]


def summary(d: Diagnosed) -> list[str]:
    """The lines that a terminal shows."""
    out = [headline(d), how_sure(d), *check_sentences(d.found), gap_sentence(d), *odd_sentences(d)]
    out += [f"{f.code}: {numbers_sentence(d, f)}" for f in d.in_model]
    return out
