"""What a diagnosis says, in words for the shop floor: the verdict, how sure it is, and what to do next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from doe.diagnosis.checks import Code, stated
from doe.diagnosis.diagnose import Diagnosis, Found
from doe.diagnosis.findings.numbers import Number
from doe.diagnosis.hypotheses import NONE, UNKNOWN, Kind
from doe.diagnosis.nested import Nested
from doe.diagnosis.proposals.foresight import SETTLED, WORTH_MEASURING
from doe.diagnosis.proposals.next_readings import NextReadings
from doe.diagnosis.proposals.rivals import look_of
from doe.diagnosis.where import Group, least_rms_mm, noise_floor_mm
from doe.tables.loaded import rms_mm
from fem.effects.base import Effect
from fem.effects.learned import axes_of
from robots.constants import M_TO_MM
from robots.quantities import percent, significant
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
NAMES: Final = {NONE: "nothing missing", UNKNOWN: "something unknown"}
NEXT: dict[Kind, str] = {
    "named": "Nothing is left to settle between candidates; readings in new poses would confirm the name.",
    "none": "Nothing needs to be settled. What these readings cannot see would need other poses, loads or directions.",
    "uninformative": "Check signs, the order of the rows, the columns, loads and joint angles; if these are "
    "right, measure again with larger loads.",
    "learned": "Look at the place named above: what could act there and vary in that way? The learned law is in "
    "the new model and can be used as it is; try a law of your own with --effect FILE.py.",
    "unknown": "Look at the poses named below first, for cables, stops, bolts or a sticking dial gauge. Try a law "
    "of your own with --effect FILE.py.",
}
LITTLE = "Further readings would hardly settle it, not even with other loads or directions."
SET_UP = "Check the set-up itself: mastering marks, play, the base's bolts, how loads and gauge are held."
# What a check says where it fails.
AGAINST: Final[dict[Code, str]] = {
    "plausible-parameters": "its parameters are not plausible",
    "predicts-left-out": "it does not predict poses left out",
    "stable": "it depends on a few poses",
    "nothing-left": "something is left",
    "no-twin": "another effect fits as well",
    "one-of-a-kind": "several joints have this fault",
    "like-noise": "the remaining error does not look like noise",
}
RESULT: Final = {True: "passed", False: "failed", None: "not applicable"}


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


def remarks(d: Diagnosed) -> tuple[str, ...]:
    """What the reader must know: checks that failed, how the gap shrank, outliers, and what the input says."""
    return (*check_sentences(d.found), gap_sentence(d), *odd_sentences(d), *d.remarks, *d.used.notes)


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
    return f" (read minus simulated {significant(M_TO_MM * g.mean, 2)} mm on average)"


def number_cells(n: Number) -> tuple[str, ...]:
    """A parameter of an effect as cells of a table: name, value, 95 % interval, plausible range, what it is."""
    unit = "" if n.unit == "1" else f"\u00a0{n.unit}".replace(" ", "\u00a0")
    value = f"{significant(n.value)}{unit}" if math.isfinite(n.value) else "no effect"
    interval = "best of those tried"
    if n.low is not None and n.high is not None:
        end = "no upper limit" if math.isinf(n.high) else significant(n.high)
        interval = f"{significant(n.low)}\u00a0to\u00a0{end}"
    low, high = (significant(v) for v in n.plausible)
    return n.name, value, interval, f"{'±' if n.signed else ''}{low} to {high}", n.meaning


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


def check_sentences(d: Diagnosis) -> tuple[str, ...]:
    """A line for each check that failed; one line where none did; nothing where nothing was found."""
    failed = [c for c in d.checks if c.passed is False]
    if failed:
        return tuple(f"Against {c.effect or _all(d)}: {AGAINST[c.code]} ({c.evidence})." for c in failed)
    if not d.checks:
        return ()
    passed = sum(c.passed is True for c in d.checks)
    other = len(d.checks) - passed
    beside = f"; {other} of {len(d.checks)} do not apply" if other else ""
    return (f"No check speaks against {_all(d)}: {passed} passed{beside}.",)


def _all(d: Diagnosis) -> str:
    return d.found[0].code if len(d.found) == 1 else f"all {len(d.found)} effects together"


@dataclass(frozen=True)
class Advice:
    """What to do next. ``chance``: that the set-ups proposed bring it, None without any; ``measure``: whether to."""

    text: str
    chance: float | None = None
    measure: bool = False


def advice(d: Diagnosed, sheet: str = "next_readings.csv") -> Advice:
    """What to do next, with its chance; set-ups are advised only where they will probably tell something.

    ``sheet``: the file with the set-ups, as the reader finds it.
    """
    n = d.proposal
    if n is None:
        return Advice(next_sentence(d))
    if d.found.verdict == "none":
        chance = sum(r.probability for r in n.rivals if r.hidden and r.against_none >= SETTLED)
        said, little = f"chance {percent(chance)} that the arm has one of them", NEXT["none"]
    else:
        chance = n.expected.right
        said, little = f"chance {percent(chance)} that they settle the right name", f"{_open(d)} {LITTLE}{_again(d)}"
    if chance < WORTH_MEASURING:
        return Advice(f"{little} The best set-ups tried are in {sheet}: {said}.", chance)
    way = f", {d.other_way}" if d.other_way else ""
    text = f"{next_sentence(d)} Measure the {len(n.labels)} set-ups of {sheet}{way}: {said}."
    return Advice(text, chance, measure=True)


def _open(d: Diagnosed) -> str:
    """What readings have left open."""
    if d.still_open:
        return f"{_still_open(d)}. {SET_UP}"
    if d.found.verdict == "unknown" or not d.rivals:
        return NEXT["unknown"]
    return f"Still possible: {rivals_text(d)}. {SET_UP}"


def _again(d: Diagnosed) -> str:
    """That outliers should be read again, where there are some."""
    return f" Read the outliers again: {odd_places(d)}." if d.odd else ""


def next_sentence(d: Diagnosed) -> str:
    """What is left to settle."""
    if d.found.verdict == "ambiguous" and d.found.same:
        return (
            f"In these readings {and_list([f.code for f in d.found.provisional] or ['it'])} cannot be separated "
            f"from {' or '.join(d.found.same)}: check the set-up itself (mastering marks, the frame of forces and "
            "readings measured against the robot's base, the tool point); further readings help only where they "
            "differ."
        )
    if d.nothing_next and d.found.verdict != "unknown":
        return f"No further set-up would settle it: {d.nothing_next}."
    if d.found.verdict == "none" and d.proposal is not None:
        return _hidden(d.proposal)
    if d.found.verdict == "ambiguous":
        if not d.rivals:
            return NEXT["unknown"]
        return f"Readings that differ between {rivals_text(d)} would settle it."
    if d.still_open:
        return f"{_still_open(d)}: readings that differ between them would settle it."
    if d.found.verdict == "named" and any(d.twins.get(f.code) for f in d.found.effects):
        return _beside_twins(d)
    return NEXT[d.found.verdict]


def _hidden(n: NextReadings) -> str:
    """What set-ups would show of what these readings cannot see."""
    hidden = [r for r in n.rivals if r.hidden]
    seen = [r.code for r in hidden if r.against_none >= SETTLED]
    if not seen:
        return "Nothing needs to be settled, and no further set-up of this kind would show more."
    some = f"{', '.join(seen[:NAMED])}{' and others' if len(seen) > NAMED else ''}"
    return (
        f"Of what these readings can show, nothing needs to be settled. {len(hidden)} effects are hidden from "
        f"them; the set-ups of next_readings.csv would show {len(seen)} of these: {some}."
    )


def _still_open(d: Diagnosed) -> str:
    """What a name could still be instead."""
    parts = []
    for code, others in d.still_open.items():
        best = look_of(d.found, code)
        some = ", ".join(f"{other} ({percent(best.of(other).probability)})" for other in others[:NAMED])
        parts.append(f"{code} could still be {some}")
    return and_list(parts)


def _beside_twins(d: Diagnosed) -> str:
    """Why nothing is left to settle of a name that others could imitate."""
    parts = []
    for f in d.found.effects:
        if others := d.twins.get(f.code):
            parts.append(
                f"{and_list(others[:NAMED])}{' and others' if len(others) > NAMED else ''} could look like {f.code}"
            )
    return (
        f"{and_list(parts)}, but each is less than a hundredth as probable. Readings in new poses would confirm the "
        "name."
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
        f"{len(n.labels)} set-ups, chosen so that the remaining candidates predict different readings: loads of "
        f"{loads} N {way}, {done.repeats} times; read {read}. The sheet is next_readings.csv; fill it in and run "
        "`stiffarm diagnose MODEL DATA next_readings.csv`."
    )
