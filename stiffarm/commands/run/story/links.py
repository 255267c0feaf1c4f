"""The report's section on the link model: two kinds of links beside each other, in tables and in sentences."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from fem import LinkKind
from robots.quantities import relative
from stiffarm.commands.run.findings import Findings
from stiffarm.commands.run.link_models import NOUN, LinkCalibrations, LinkModels, Pair, SpringPair
from stiffarm.pages.report import Bullets, Note, Section, Table, Text
from stiffarm.session.words.springs import mega

_COMPARED: Final = (("RMS", " (mm)"), ("left-out RMS", " (mm)"), ("structure's share", ""))
_AGREE: Final = MappingProxyType({"within": "yes", "outside": "NO", "unknown": "no interval"})
_HINT: Final[Mapping[LinkKind, str]] = MappingProxyType(
    {
        "shell": "Beams model a link by its sections along the centre line; shells model its walls, with openings, "
        "rims and flanges where the model file has them.",
        "solid": "Beams model a link by its sections along the centre line; solids model all of its material. Links "
        "without a solid are shells.",
        "beam": "The comparison shows what flexible links contribute. Shells take longer to build; to compare them "
        "with beams, use `stiffarm run --links shell`.",
        "rigid": "To compare shells with beams, use `stiffarm run --links shell`.",
    }
)


def links_section(f: Findings, both: LinkModels) -> Section:
    """Both kinds of links, calibration by calibration: errors, shares, springs, and what follows."""
    own, other = both.nouns
    return Section(
        f"What the link model changes: {own} compared with {other}",
        (
            Text(
                f"The links of this run are {own}. Here every calibration is repeated with {other}: same readings, "
                f"same scheme, same joints. {_HINT[both.own.links]}"
            ),
            Bullets(sentences(both, f.best_variant.name, f.scheme.noise.gauge_mm)),
            _error_table(both, f.best_variant.name),
            _springs_table(both),
            Note(
                "Calibration hides errors of the link model: if the links are too stiff, the springs come out softer, "
                "as far as both move the tool in the same way over the poses. So an equally good fit does not prove "
                "that the links are right, and absolute link shares depend on the sections in the model file."
            ),
        ),
        folded=True,
    )


def _error_table(both: LinkModels, best: str) -> Table:
    own, other = both.nouns
    columns = [f"{what}, {links}{unit}" for what, unit in _COMPARED for links in (other, own)]
    rows = []
    for pair in both.pairs:
        better, poses = pair.poses_better()
        sides = ((both.other, pair.other), (both.own, pair.own))
        cells = [f"{v.found.rms_mm:.4f}" for _, v in sides] + [_millimetres(v.left_out_rms_mm) for _, v in sides]
        cells += [share_text(side, pair) for side, _ in sides]
        rows.append((pair.own.name, *cells, f"{better} of {poses}"))
    return Table(
        f"{other.capitalize()} and {own} (highlighted: recommended). Structure's share: links, bar and crank in the "
        f"strain energy, smallest to largest over the readings. Last column: left-out poses that {own} predict better",
        ("calibration", *columns, f"{own} better"),
        tuple(rows),
        best=next(i for i, pair in enumerate(both.pairs) if pair.own.name == best),
    )


def _millimetres(value: float) -> str:
    return f"{value:.4f}" if np.isfinite(value) else "not predicted"


def _springs_table(both: LinkModels) -> Table:
    own, other = both.nouns
    pairs = [(pair.own.name, s) for pair in both.pairs for s in pair.springs]
    judged = [s.agreement for _, s in pairs if s.agreement != "unknown"]
    rows = tuple(
        (name, *(s.where or ("", "all")), s.joint, _ranged(s.other), _ranged(s.own), _change(s), _AGREE[s.agreement])
        for name, s in pairs
    )
    return Table(
        f"Springs in 10⁶ N m/rad with 95 % intervals, or the range that would match as well: of {len(judged)} pairs "
        f"that have one, {judged.count('within')} lie within each other's",
        ("calibration", "stage", "pose", "joint", other, own, "change", "within each other's range"),
        rows,
        text_columns=(0, 1, 2, 3, 4, 5, 7),
        folded=True,
    )


def _ranged(spring: tuple[float, float, float]) -> str:
    value, low, high = spring
    return f"{mega(value)} ({mega(low)} to {mega(high)})" if np.isfinite(low) else f"{mega(value)} (no range)"


def _change(s: SpringPair) -> str:
    return signed(s.change) if s.has_values else "–"


def sentences(both: LinkModels, best: str, gauge_mm: float) -> tuple[str, ...]:
    """What the comparison says, computed from it; ``best`` is the recommended variant."""
    return (_alone(both), _verdict(both, best, gauge_mm))


def _alone(both: LinkModels) -> str:
    """The links' own bending, before any spring is calibrated."""
    first = both.own.variants[0]
    path, linear = first.model.load_path, first.found.overall.component < 3
    a, b = (np.abs(side.alone_mm[path][linear]) for side in (both.own, both.other))
    own, other = both.nouns
    start = f"With rigid joints ({path} load path) "
    if not a.any() or not b.any():
        kind, flexible = (other, a) if a.any() else (own, b)
        name = own if a.any() else other
        return (
            start + f"{name} alone deflect {flexible.min():.3f} to {flexible.max():.3f} mm at the readings used; "
            f"{kind} do not deflect."
        )
    ratio = a / b - 1.0
    word = "softer" if ratio.mean() > 0.0 else "stiffer"
    low, high = sorted(np.abs([ratio.min(), ratio.max()]))
    if ratio.min() * ratio.max() < 0.0:
        by = f"{relative(-ratio.min())} stiffer to {relative(ratio.max())} softer, by pose"
    else:
        by = f"{relative(low)} to {relative(high)} {word}"
    return (
        start + f"{own} alone deflect {a.min():.3f} to {a.max():.3f} mm at the readings used, {other} {b.min():.3f} to "
        f"{b.max():.3f} mm: {own} are {by}."
    )


def signed(change: float) -> str:
    """A relative change in percent with its sign."""
    size = 100.0 * abs(change)
    number = f"{size:.0f}" if size >= 10.0 else f"{size:.1f}"
    sign = "" if float(number) == 0.0 else "+" if change > 0.0 else "−"
    return f"{sign}{number}\u00a0%"


def _verdict(both: LinkModels, best: str, gauge_mm: float) -> str:
    """What follows for the recommended calibration, and which calibration predicts best of all."""
    own, other = both.nouns
    pair = next(pair for pair in both.pairs if pair.own.name == best)
    difference = pair.left_out_difference_mm
    outside = any(s.agreement == "outside" for s in pair.springs)
    text = f"For the recommended calibration ({best}) "
    if not np.isfinite(difference):
        text += f"the left-out poses cannot compare {own} with {other}"
    elif abs(difference) < gauge_mm and not outside:
        text += f"these readings cannot distinguish {own} from {other}: the springs make up for the difference"
    elif abs(difference) < gauge_mm:
        text += f"{own} and {other} predict equally well, but with different springs"
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
    return text + f". Smallest left-out error of all: {errors[least]:.3f} mm, {least}."


def share_text(side: LinkCalibrations, pair: Pair) -> str:
    """Least and largest share of links, bar and crank in the strain energy over the readings."""
    share = 100.0 * side.share[pair.own.name]
    low, high = f"{share.min():.1f}", f"{share.max():.1f}"
    return f"{low}\u00a0%" if low == high else f"{low} to {high}\u00a0%"
