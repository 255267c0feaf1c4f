"""What to do after a diagnosis, in words: what is left to settle, and the set-ups that would."""

from __future__ import annotations

from dataclasses import dataclass

from doe.diagnosis.hypotheses import Kind
from doe.diagnosis.proposals.foresight import SETTLED, WORTH_MEASURING
from doe.diagnosis.proposals.next_readings import NextReadings
from doe.diagnosis.proposals.rivals import look_of
from robots.quantities import percent
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.commands.diagnose.words import NAMED, and_list, odd_places, rivals_text, sentence
from stiffarm.pages.report import Block, Bullets, Fold, Table, Text
from stiffarm.session.words.directions import set_up_rows

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


def proposal_blocks(d: Diagnosed, n: NextReadings) -> list[Block]:
    """The proposal as text, what it is expected to tell, and a table of set-ups."""
    heads = ("set-up", *(f"{c.removesuffix('_deg')} (deg)" for c in d.given.robot.coordinates), "load")
    rows = set_up_rows(n.labels, n.q, n.direction)
    # How probable each name is now stands in the ladder; here only what the set-ups would change.
    told = tuple(f"{sentence(w)}." for w in n.words[1:])
    return [
        Text(proposal_text(n)),
        Table("Set-ups to measure next", heads, rows, (0, len(heads) - 1), folded=True),
        Fold("What they are expected to show", (Bullets(told),)),
    ]
