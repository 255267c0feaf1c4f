"""What a power analysis says."""

from __future__ import annotations

import math

from doe.power.chances import POWER, Chance
from robots.quantities import percent, significant
from stiffarm.commands.rehearse.power.step import Addition, Power, Prospect, SpringProspect

HEADS = ("effect", "smallest found with 80 %", "usual", "found", "named", "size known to ±", "remark")
# A terminal has 80 characters a line, and no room for what is hardly ever found.
SHORT_HEADS = ("effect", "smallest found with 80 %", "found (%)", "named (%)")
MOST_SHORT = 16
SPRING_HEADS = ("spring", "as planned (N m/rad)", "95 % interval to expect")
MORE_HEADS = ("with", "readings", "found", "named", "gains most")
# From this chance on an effect is called sure to be named, below the second unlikely.
SURE, UNLIKELY = 0.8, 0.5
LISTED = 4


def chance(c: Chance) -> str:
    """``72 % (41 to 91)``."""
    return f"{percent(c.value)} ({100 * c.low:.0f} to {100 * c.high:.0f})"


def size(p: Prospect) -> str:
    """The smallest size that is found: of a stiffness the stiffest; a dash where none is."""
    if not p.parameter:
        return "-"
    unit = "" if p.unit == "1" else f" {p.unit}"
    if p.smallest is None:
        return "none"
    return f"{p.parameter} {'up to' if p.is_stiffness else 'from'} {significant(p.smallest, 2)}{unit}"


def usual(p: Prospect) -> str:
    """Ends of the usual range."""
    if p.usual is None:
        return "-"
    unit = "" if p.unit == "1" else f" {p.unit}"
    return f"{significant(p.usual[0], 2)} to {significant(p.usual[1], 2)}{unit}"


def remark(p: Prospect) -> str:
    """Why it is not named where it is found, or nothing at all."""
    if p.why_not is not None:
        return p.why_not
    if p.twin == "none":
        return "too small here, at usual sizes"
    if p.twin == "unknown":
        return "may be called unknown"
    return f"looks like {p.twin}" if p.twin else ""


def row(p: Prospect) -> tuple[str, ...]:
    """A line of the table."""
    if p.why_not is not None:
        return p.code, "-", "-", "-", "-", "-", p.why_not
    accuracy = "-" if p.accuracy95 is None else "over 100 %" if p.accuracy95 > 1.0 else percent(p.accuracy95)
    return p.code, size(p), usual(p), chance(p.found), chance(p.named), accuracy, remark(p)


def short_rows(r: Power) -> list[tuple[str, ...]]:
    """Lines for a terminal: what is more likely found than not, most surely named first."""
    likely = [p for p in r.judged if p.found.value >= UNLIKELY] or r.judged
    return [(p.code, size(p), _short(p.found), _short(p.named)) for p in likely[:MOST_SHORT]]


def _short(c: Chance) -> str:
    """``72 (41-91)``: a chance in a column of percent."""
    share = percent(c.value).replace(" %", "").replace("above ", ">").replace("below ", "<")
    return f"{share} ({100 * c.low:.0f}-{100 * c.high:.0f})"


def split_rows(r: Power) -> tuple[list[tuple[str, ...]], list[tuple[str, ...]]]:
    """Lines of effects that are more likely found than not, and of all others."""
    all_rows = rows(r)
    likely = {p.code for p in r.judged if p.found.value >= UNLIKELY}
    return [one for one in all_rows if one[0] in likely], [one for one in all_rows if one[0] not in likely]


def assumed_springs(r: Power) -> str:
    """Where the springs come from that the model does not have; empty where it has all."""
    if not r.assumed:
        return ""
    return (
        f"No spring in the model for {', '.join(r.assumed)}: the middle of the range for arms of this size is "
        "assumed. All sizes and chances depend on it."
    )


def rows(r: Power) -> list[tuple[str, ...]]:
    """All effects: those most surely named first, then what these readings cannot judge."""
    return [*(row(p) for p in r.judged), *(row(p) for p in r.prospects if p.why_not is not None)]


def spring_row(s: SpringProspect) -> tuple[str, ...]:
    """A spring with its interval."""
    if not math.isfinite(s.stiffness):
        return s.joint, "rigid", "-"
    low = significant(s.low)
    ends = f"at least {low}" if s.high is None else f"{low} to {significant(s.high)}"
    return s.joint, significant(s.stiffness), ends


def more_row(a: Addition) -> tuple[str, ...]:
    """What one more adds, in points of a hundred."""
    most = f"{a.most} ({_points(a.most_gain)})" if a.most and a.most_gain > 0.01 else "-"
    return a.what, str(a.readings), _points(a.found), _points(a.named), most


def _points(share: float) -> str:
    return f"{100 * share:+.1f} points".replace("+0.0", "0.0").replace("-0.0", "0.0")


def headline(r: Power) -> str:
    """The answer in a sentence."""
    judged = r.judged
    if not judged:
        return "These readings can show none of the effects that this arm can have."
    found = sum(p.found.value >= POWER for p in judged)
    named = sum(p.named.value >= SURE for p in judged)
    return (
        f"Of {len(r.prospects)} effects that this arm can have, {found} of usual size would be found with 80 % or "
        f"more and {named} named; on average over the {len(judged)} that the readings can show, "
        f"{percent(r.mean[0])} are found and {percent(r.mean[1])} named."
    )


def blind(r: Power) -> str:
    """What stays hidden, in a sentence; empty where nothing does."""
    poor = [p for p in r.judged if p.found.value < UNLIKELY]
    never = [p for p in r.prospects if p.why_not is not None and not p.is_fitted]
    parts = []
    if poor:
        parts.append(f"probably not found: {_listed([p.code for p in poor])}")
    if never:
        parts.append(f"changes no reading here, or springs absorb it: {_listed([p.code for p in never])}")
    return (". ".join(part[0].upper() + part[1:] for part in parts) + ".") if parts else ""


def twins(r: Power) -> str:
    """What is found and not named, in a sentence; empty where nothing is."""
    some = [p for p in r.judged if p.found.value >= POWER and p.named.value < UNLIKELY]
    return f"Found, but probably not named: {_listed([p.code for p in some])}." if some else ""


def best(r: Power) -> str:
    """What one more set-up, load or repeat adds, the best first."""
    if not r.additions:
        return ""
    top = max(r.additions, key=lambda a: (a.named, a.found))
    if top.named < 0.005 and top.found < 0.005:
        return "One more set-up, load or repeat adds next to nothing: add several, or read other axes."
    return f"Best to add: {top.what} ({_points(top.named)} named, {_points(top.found)} found, on average over effects)."


def sentences(r: Power) -> list[str]:
    """The whole answer."""
    return [text for text in (headline(r), assumed_springs(r), twins(r), blind(r), best(r)) if text]


def _listed(codes: list[str]) -> str:
    more = f" and {len(codes) - LISTED} more" if len(codes) > LISTED else ""
    return ", ".join(codes[:LISTED]) + more
