"""What a power analysis says: effects that would be found and named, springs to expect, what to add."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from doe.power.chances import POWER
from robots.arrays import Array
from robots.quantities import Probability, Quantity, percent, rounded, rounded_all, significant
from stiffarm.commands.rehearse.power.step import Power, Prospect
from stiffarm.pages.report import Bullets, KeyFigure, Section
from stiffarm.result import Drawing, Result, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# From this chance on an effect is called sure to be named, below the second unlikely.
SURE, UNLIKELY = 0.8, 0.5
LISTED = 4
CHANCES: Final = tuple(Probability(name, stored=3) for name in ("found", "named"))
ACCURACY: Final = Quantity("size_half_width95", "%", 100.0, "size known to ±", 2, 3)
SPRING: Final = Quantity("stiffness", "N m/rad", digits=3)


def result(r: Power, seed: int) -> Result:
    """Everything that a planned sheet would show."""
    given, set_ups = r.given, r.set_ups
    assumed: tuple[str, ...] = ()
    if r.assumed:
        assumed = (
            f"No spring in the model for {', '.join(r.assumed)}: the middle of the range for arms of this size is "
            "assumed. All sizes and chances depend on it.",
        )
    many = sum(p.found.value >= POWER for p in r.judged)
    likely = [p for p in r.judged if p.found.value >= UNLIKELY]
    never = [p for p in r.prospects if p.why_not is not None]
    effects = _effects("effects", "All effects, found: something is missing; named: rightly what", [*r.judged, *never])
    return Result(
        name="rehearse",
        title=given.description.title.split(" (")[0],
        question="would these readings show what is missing?",
        answer=_headline(r, many),
        how_sure="Linear theory, before anyone measures. The intervals are those in which the shares of twenty "
        "campaigns should lie; in a study of 200 simulated sets 19 of 20 shares did.",
        what_next=_best(r) or "Compare with another sheet: give it in place of this one.",
        facts={
            "kind": "power",
            "robot": given.robot.name,
            "load_path": given.model.load_path,
            "links": given.model.link_kind,
            "set_ups": set_ups.source,
            "readings": r.readings,
            "poses": len(set_ups.table.pose_groups()),
            "noise": set_ups.words,
            "draws": r.draws,
            "seed": seed,
            "power": POWER,
            "mean_found": rounded(r.mean[0], 4),
            "mean_named": rounded(r.mean[1], 4),
            "springs_assumed": list(r.assumed),
        },
        tables=(
            effects,
            *((_effects("likely", "More likely found than not", likely),) if likely else ()),
            _springs(r),
            *_one_more(r),
        ),
        drawings=tuple(_drawings(r)),
        key=(
            KeyFigure(percent(r.mean[0]), "of effects of usual size would be found, in the mean"),
            KeyFigure(percent(r.mean[1]), "would be named"),
            KeyFigure(f"{many} of {len(r.prospects)}", "effects found with 80 % or more"),
        ),
        sections=(_how(r),),
        remarks=(*assumed, *_hidden(r)),
        arm=given,
        caution="",
        found=r,
        made_of=f"{set_ups.source}; {given.model.link_kind} links, {given.model.load_path} load path; noise "
        f"{set_ups.words}",
    )


def _effects(name: str, caption: str, some: Sequence[Prospect]) -> Table:
    """Effects with their chances; a size that is found is, of a stiffness, the stiffest."""
    is_short = name != "effects"

    def column(value: Callable[[Prospect], float | None]) -> Array:
        found = (None if p.why_not is not None else value(p) for p in some)
        return np.array([np.nan if v is None else v for v in found])

    labels = {"effect": [p.code for p in some], "smallest_found_with_80": [_size(p) for p in some]}
    if not is_short:
        labels |= {
            "remark": [_remark(p) for p in some],
            "parameter": [p.parameter for p in some],
            "unit": [p.unit for p in some],
            "twin": [p.twin for p in some],
        }
    found: dict[Quantity, Array] = {q: column(lambda p, q=q: getattr(p, q.key).value) for q in CHANCES}  # type: ignore[misc]
    ends: dict[Quantity, tuple[Array, Array]] = {
        q: (column(lambda p, q=q: getattr(p, q.key).low), column(lambda p, q=q: getattr(p, q.key).high))  # type: ignore[misc]
        for q in CHANCES
    }
    return Table(
        name,
        caption,
        labels,
        found | ({} if is_short else {ACCURACY: column(lambda p: p.accuracy95)}),
        ends,
        in_files={
            Quantity("smallest", stored=3): column(lambda p: p.smallest),
            Quantity("chi2_of_usual", stored=4): column(lambda p: p.chi2),
        },
        extra={
            "words": [p.words for p in some],
            "is_stiffness": [p.is_stiffness for p in some],
            "usual": [None if p.usual is None else rounded_all(p.usual) for p in some],
            "why_not": [p.why_not for p in some],
            "sizes_from": ["rehearsals" if p.by_rehearsal else "catalogue" for p in some],
        },
        folded=not is_short,
        is_extract=is_short,
    )


def _size(p: Prospect) -> str:
    """The smallest size that is found; empty where none is."""
    if not p.parameter or p.smallest is None:
        return "none" if p.parameter else ""
    unit = "" if p.unit == "1" else f" {p.unit}"
    return f"{p.parameter} {'up to' if p.is_stiffness else 'from'} {significant(p.smallest, 2)}{unit}"


def _remark(p: Prospect) -> str:
    """Why it is not named where it is found, or nothing at all."""
    if p.why_not is not None:
        return p.why_not
    known = {"": "", "none": "too small here, at usual sizes", "unknown": "may be called unknown"}
    return known.get(p.twin, f"looks like {p.twin}")


def _springs(r: Power) -> Table:
    low = np.array([s.low for s in r.springs])
    high = np.array([np.inf if s.high is None else s.high for s in r.springs])
    return Table(
        "springs",
        "What the springs would be known to, by these readings alone and with nothing missing",
        {"joint": [s.joint for s in r.springs]},
        {SPRING: np.array([s.stiffness for s in r.springs])},
        {SPRING: (np.where(np.isfinite(low), low, np.nan), high)},
    )


def _one_more(r: Power) -> Iterator[Table]:
    some = r.additions
    if some:
        yield Table(
            "one_more",
            "What one more adds to the chances, on average over effects",
            {
                "with": [a.what.removeprefix("one more ") for a in some],
                "gains_most": [a.most if a.most_gain > 0.01 else "" for a in some],
            },
            {
                Quantity("readings"): np.array([float(a.readings) for a in some]),
                **{
                    Quantity(name, "points", 100.0, digits=2, stored=3): np.array(
                        [getattr(a, name) for a in r.additions]
                    )
                    for name in ("found", "named", "most_gain")
                },
            },
        )


def _drawings(r: Power) -> Iterator[Drawing]:
    from stiffarm.commands.rehearse.power.figures import DRAWN

    caption = "Chance that each effect of usual size is found, and named."
    if len(r.judged) > DRAWN:
        caption = f"{caption[:-1]}: the {DRAWN} of {len(r.judged)} that are most surely named; the tables have all."
    yield Drawing("chances", caption, "chances to be found and named", partial(_chances, r))
    if r.additions:
        caption = "Chances with one more, over those of this sheet."
        yield Drawing("one_more", caption, "what one more adds", partial(_additions, r))


def _chances(r: Power) -> Figure:
    from stiffarm.commands.rehearse.power.figures import chances_figure

    return chances_figure(r)


def _additions(r: Power) -> Figure:
    from stiffarm.commands.rehearse.power.figures import additions_figure

    return additions_figure(r.additions)


def _points(share: float) -> str:
    return f"{'+' if share > 0.0 else ''}{significant(100.0 * share, 2)} points"


def _headline(r: Power, many: int) -> str:
    """The answer in a sentence; ``many`` are found with 80 % or more."""
    judged = r.judged
    if not judged:
        return "These readings can show none of the effects that this arm can have."
    named = sum(p.named.value >= SURE for p in judged)
    return (
        f"Of {len(r.prospects)} effects that this arm can have, {many} of usual size would be found with 80 % or "
        f"more and {named} named; on average over the {len(judged)} that the readings can show, "
        f"{percent(r.mean[0])} are found and {percent(r.mean[1])} named."
    )


def _hidden(r: Power) -> Iterator[str]:
    """What is found and not named, and what stays hidden, a sentence each."""
    kinds = {
        "found, but probably not named": [p for p in r.judged if p.found.value >= POWER and p.named.value < UNLIKELY],
        "probably not found": [p for p in r.judged if p.found.value < UNLIKELY],
        "changes no reading here, or springs absorb it": [
            p for p in r.prospects if p.why_not is not None and not p.is_fitted
        ],
    }
    for words, some in kinds.items():
        if some:
            more = f" and {len(some) - LISTED} more" if len(some) > LISTED else ""
            yield f"{words}: {', '.join(p.code for p in some[:LISTED])}{more}"


def _best(r: Power) -> str:
    """What one more set-up, load or repeat adds, the best first."""
    if not r.additions:
        return ""
    top = max(r.additions, key=lambda a: (a.named, a.found))
    if top.named < 0.005 and top.found < 0.005:
        return "One more set-up, load or repeat adds next to nothing: add several, or read other axes."
    return f"Best to add: {top.what} ({_points(top.named)} named, {_points(top.found)} found, on average over effects)."


def _how(r: Power) -> Section:
    other = dict.fromkeys(p.kind for p in r.judged if not p.by_rehearsal)
    words = f" Of {', '.join(other)} the rehearsals have no laws: the catalogue's own stand in." if other else ""
    bullets = (
        f"{r.draws} usual sizes of each effect, drawn as rehearsals draw them (laws that are not the catalogue's)."
        + words,
        "What each changes of the readings, less what springs and the small errors of every arm can follow, over the "
        "noise, is its chi-square; candidates explain it and are charged as the diagnosis charges them. Chances follow "
        "from the noncentral chi-square distribution and the diagnosis's thresholds.",
        "An effect with a twin - one that moves these readings alike - is found and not named.",
        "One more set-up is the pose farthest from all others within the angles read; one more load lies between the "
        "two largest.",
        "`--hide CODE` makes one rehearsal of an effect, with readings, a diagnosis and the truth.",
    )
    return Section("How it was done", (Bullets(bullets),), folded=True)
