"""What a comparison of two link models says, in sentences computed from its numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from fem import LinkKind
from robots.arrays import Bools
from stiffarm.commands.run.link_models import LinkCalibrations, LinkModels, Pair, SpringPair
from stiffarm.pages.blocks import percent

NOUN: Final[Mapping[LinkKind, str]] = MappingProxyType({"rigid": "rigid links", "beam": "beams", "shell": "shells"})


def sentences(both: LinkModels, best: str, gauge_mm: float) -> tuple[str, ...]:
    """What the comparison says, computed from it; ``best`` is the recommended variant."""
    return (
        _alone(both),
        _shares(both, best),
        *(_springs(pair, both) for pair in both.pairs),
        _prediction(both, gauge_mm),
        _verdict(both, best, gauge_mm),
    )


def _alone(both: LinkModels) -> str:
    """The links' own bending, before any spring is calibrated."""
    path = both.own.variants[0].model.load_path
    a, b = (np.abs(side.alone_mm[path][_vertical(both)]) for side in (both.own, both.other))
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    start = f"With rigid joints ({path} load path) "
    if not a.any() or not b.any():
        kind, flexible = (other, a) if a.any() else (own, b)
        name = own if a.any() else other
        return (
            start + f"{name} alone give {flexible.min():.3f} to {flexible.max():.3f} mm at the readings used, "
            f"{kind} nothing."
        )
    ratio = a / b - 1.0
    word = "softer" if ratio.mean() > 0.0 else "stiffer"
    low, high = sorted(np.abs([ratio.min(), ratio.max()]))
    if ratio.min() * ratio.max() < 0.0:
        by = f"{percent(-ratio.min())} stiffer to {percent(ratio.max())} softer, by pose"
    else:
        by = f"{percent(low)} to {percent(high)} {word}"
    return (
        start + f"{own} alone give {a.min():.3f} to {a.max():.3f} mm at the readings used, {other} {b.min():.3f} to "
        f"{b.max():.3f} mm: {own} are {by}."
    )


def _vertical(both: LinkModels) -> Bools:
    return np.asarray(both.own.variants[0].found.overall.component == 2)


def _shares(both: LinkModels, best: str) -> str:
    """What the link model changes in the compliance budget of the recommended calibration."""
    pair = next(pair for pair in both.pairs if pair.own.name == best)
    mean = {side.links: 100.0 * float(side.share[best].mean()) for side in (both.own, both.other)}
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    return (
        f"{best.capitalize()} (recommended): links, bar and crank hold {share_text(both.own, pair)} of the strain "
        f"energy with {own} and {share_text(both.other, pair)} with {other}; on average over the readings "
        f"{mean[both.own.links]:.2f} and {mean[both.other.links]:.2f}\u00a0%. The rest is in the joints."
    )


def _springs(pair: Pair, both: LinkModels) -> str:
    """How far the springs move, and whether the intervals cover it."""
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    known = [s for s in pair.springs if s.has_values]
    judged = [s for s in pair.springs if s.agreement != "unknown"]
    outside = [s for s in judged if s.agreement == "outside"]
    text = f"{_name(pair)}, springs with {own} compared with {other}: "
    if not known:
        text += "none has a value with both"
    elif not pair.own.found.studies:
        text += ", ".join(f"{s.joint} {signed(s.change)}" for s in known)
    else:
        most = max(known, key=lambda s: abs(s.change))
        equal = sum(signed(s.change) == signed(0.0) for s in known)
        text += f"{equal} of {len(known)} stand on the same level, the largest change is that of {_place(most)} "
        text += f"({signed(most.change)})"
    interval = "95 % intervals" if not pair.own.found.studies else "ranges that match as well"
    if not judged:
        return text + "; without spare readings there are no intervals to judge that by."
    count = "all" if len(judged) == len(pair.springs) else f"the {len(judged)} that have one"
    if not outside:
        return text + f"; {count} lie within each other's {interval}."
    return (
        text + f". {len(outside)} of {len(judged)} lie outside each other's {interval}: {_list(map(_place, outside))}."
    )


def _name(pair: Pair) -> str:
    return pair.own.name.capitalize()


def _place(spring: SpringPair) -> str:
    return spring.joint if spring.where is None else f"{spring.joint} at pose {spring.where[1]}"


def _list(words: Iterable[str]) -> str:
    return ", ".join(words)


def signed(change: float) -> str:
    """A relative change in percent with its sign."""
    size = 100.0 * abs(change)
    number = f"{size:.0f}" if size >= 10.0 else f"{size:.1f}"
    sign = "" if float(number) == 0.0 else "+" if change > 0.0 else "−"
    return f"{sign}{number}\u00a0%"


def _prediction(both: LinkModels, gauge_mm: float) -> str:
    """Which links predict poses better that the calibration has not seen."""
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    known = [pair for pair in both.pairs if np.isfinite(pair.left_out_difference_mm)]
    large = [pair for pair in known if abs(pair.left_out_difference_mm) >= gauge_mm]
    if not known:
        return "Poses left out: at least one kind of links cannot predict them."
    small = f"below the gauge's digit ({gauge_mm:g} mm)"
    if not large:
        return f"Poses left out: in every calibration {own} and {other} predict them alike, the difference is {small}."
    parts = []
    for pair in large:
        better, poses = pair.poses_better()
        winner, count = (own, better) if pair.left_out_difference_mm < 0.0 else (other, poses - better)
        size = f"{abs(pair.left_out_difference_mm):.3f} mm"
        parts.append(
            f"{pair.own.name}: {winner} predict them better by {size} RMS, and are nearer at {count} of {poses}"
        )
    rest = len(known) - len(large)
    text = "Poses left out, " + "; ".join(parts)
    if not rest:
        return text + "."
    return text + f"; in the other{'' if rest == 1 else f' {rest}'} the difference is {small}."


def _verdict(both: LinkModels, best: str, gauge_mm: float) -> str:
    """What follows for the recommended calibration, and which calibration predicts best of all."""
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    pair = next(pair for pair in both.pairs if pair.own.name == best)
    difference = pair.left_out_difference_mm
    outside = any(s.agreement == "outside" for s in pair.springs)
    text = f"For the recommended calibration ({best}) "
    if not np.isfinite(difference):
        text += f"the left-out poses do not compare {own} with {other}"
    elif abs(difference) < gauge_mm and not outside:
        text += f"these readings do not tell {own} from {other}: the springs take up the difference"
    elif abs(difference) < gauge_mm:
        text += f"{own} and {other} predict alike, but with springs that do not agree"
    else:
        text += f"{own if difference < 0.0 else other} predict better by {abs(difference):.3f} mm"
    errors = {
        f"{v.name} with {NOUN[side.links]}": v.left_out_rms_mm
        for side in (both.own, both.other)
        for v in side.variants
        if np.isfinite(v.left_out_rms_mm)
    }
    if not errors:
        return text + "."
    least = min(errors, key=errors.__getitem__)
    return text + f". The smallest left-out error of all: {least}, {errors[least]:.3f} mm."


def share_text(side: LinkCalibrations, pair: Pair) -> str:
    """Least and largest share of links, bar and crank in the strain energy over the readings."""
    share = 100.0 * side.share[pair.own.name]
    low, high = f"{share.min():.1f}", f"{share.max():.1f}"
    return f"{low}\u00a0%" if low == high else f"{low} to {high}\u00a0%"
