"""The report's section on the link model: the same calibrations with two kinds of links, beside each other."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from fem import LinkKind
from stiffarm.commands.calibrate.figures import springs as figures_springs
from stiffarm.commands.run.figures import match as figures_match
from stiffarm.commands.run.findings import Findings
from stiffarm.commands.run.link_models import LinkModels, SpringPair
from stiffarm.commands.run.link_words import NOUN, sentences, share_text, signed
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Bullets, Note, Section, Table, Text
from stiffarm.session.spring_words import mega, spring_text

_AGREE: Final = MappingProxyType({"within": "yes", "outside": "NO", "unknown": "no interval"})
_HINT: Final[Mapping[LinkKind, str]] = MappingProxyType(
    {
        "shell": "Beams know a link's sections along its centre line; shells know its walls, with openings, rims and "
        "flanges where the model file has them.",
        "beam": "Rigid links show what flexible links add at all. Shells take longer to build and are compared with "
        "beams by `stiffarm run --links shell`.",
        "rigid": "Shells are compared with beams by `stiffarm run --links shell`.",
    }
)


def links_section(f: Findings, pictures: Pictures) -> Section:
    """Both kinds of links, calibration by calibration: errors, springs, pictures, and what follows."""
    both = f.link_models
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    blocks: list[Block] = [
        Text(
            f"The links of this run are {own}. Here every calibration is repeated with {other}: same readings, "
            f"same scheme, same joints. {_HINT[both.own.links]}"
        ),
        _error_table(both, f.best.name),
        Bullets(sentences(both, f.best.name, f.scheme.noise.gauge_mm)),
        pictures.add(_springs_picture(f), "link_models_springs", _springs_caption(both)),
        _constant_table(both),
    ]
    for path in dict.fromkeys(v.model.load_path for v in f.variants):
        blocks.append(
            pictures.add(
                _match_picture(f, path),
                f"link_models_match_{path}",
                f"{path.capitalize()} load path: measured deflections, and those simulated with {own} and with "
                f"{other}. Where the two stand at one height, the springs make up for the difference in the links.",
            )
        )
    blocks += [
        _staged_table(both),
        Note(
            "Calibration hides errors of the link model: what links give too little, the springs give more, as far "
            "as both bend the arm in the same way over the poses. So an equally good fit does not say that the links "
            "are right, and absolute link shares rest on the sections in the model file."
        ),
    ]
    return Section(f"What the link model changes: {own} beside {other}", tuple(blocks))


def _error_table(both: LinkModels, best: str) -> Table:
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    columns = ["load path", "scheme"]
    for what in ("RMS", "left-out RMS"):
        columns += [f"{what}, {other} (mm)", f"{what}, {own} (mm)"]
    columns += [f"structure's share, {other}", f"structure's share, {own}"]
    rows = tuple(
        (
            pair.own.model.load_path,
            pair.own.name.split(",")[0],
            f"{pair.other.rms_mm:.4f}",
            f"{pair.own.rms_mm:.4f}",
            _millimetres(pair.other.left_out_rms_mm),
            _millimetres(pair.own.left_out_rms_mm),
            share_text(both.other, pair),
            share_text(both.own, pair),
        )
        for pair in both.pairs
    )
    return Table(
        f"{other.capitalize()} beside {own} (highlighted: recommended). Structure: links, bar and crank, their share "
        "in the strain energy, least to most of the readings",
        tuple(columns),
        rows,
        text_columns=(0, 1),
        best=next(i for i, pair in enumerate(both.pairs) if pair.own.name == best),
    )


def _millimetres(value: float) -> str:
    return f"{value:.4f}" if np.isfinite(value) else "not predicted"


def _springs_picture(f: Findings) -> Figure:
    both = f.link_models
    rows = {
        f"{v.model.load_path}, {NOUN[side.links]}": v.springs
        for path in dict.fromkeys(v.model.load_path for v in f.variants)
        for side in (both.other, both.own)
        for v in side.variants
        if not v.found.studies and v.model.load_path == path
    }
    heading = f"Constant joint springs with {NOUN[both.other.links]} and with {NOUN[both.own.links]}"
    return figures_springs.springs_figure(rows, f.scheme.springs.ends, heading)


def _springs_caption(both: LinkModels) -> str:
    constant = [s for pair in both.pairs if not pair.own.found.studies for s in pair.springs]
    inside = sum(s.agreement == "within" for s in constant)
    return (
        f"Constant springs with 95 % intervals, side by side. {inside} of {len(constant)} pairs lie within each "
        "other's interval. Arrow to the right: the data do not exclude a rigid joint."
    )


def _match_picture(f: Findings, path: str) -> Figure:
    both = f.link_models
    first = both.own.variants[0]
    vertical = first.component == 2
    simulated = {
        f"{v.name.split(',')[0]}, {NOUN[side.links]}": v.predicted_mm[vertical]
        for scheme in ("global", "staged")
        for side in (both.other, both.own)
        for v in side.variants
        if v.scheme == scheme and v.model.load_path == path
    }
    return figures_match.match_figure(
        tuple(str(p) for p in np.array(first.pose)[vertical]),
        first.measured_mm[vertical],
        simulated,
        f.scheme.noise.gauge_mm,
        f"Measured and simulated deflection by pose, {path} load path",
    )


def _constant_table(both: LinkModels) -> Table:
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    rows = tuple(
        (pair.own.model.load_path, s.joint, spring_text(b), spring_text(a), _change(s), _AGREE[s.agreement])
        for pair in both.pairs
        if not pair.own.found.studies
        for s, a, b in zip(pair.springs, pair.own.springs, pair.other.springs, strict=True)
    )
    columns = ("load path", "joint", other, own, "change", "within each other's interval")
    return Table("Constant springs in 10⁶ N m/rad with 95 % intervals", columns, rows, text_columns=(0, 1, 2, 3, 5))


def _staged_table(both: LinkModels) -> Table:
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    rows = tuple(
        (
            pair.own.model.load_path,
            *(s.where or ("", "")),
            s.joint,
            _ranged(s.other),
            _ranged(s.own),
            _change(s),
            _AGREE[s.agreement],
        )
        for pair in both.pairs
        if pair.own.found.studies
        for s in pair.springs
    )
    columns = ("load path", "stage", "pose", "joint", other, own, "change", "within each other's range")
    return Table(
        "Springs of the staged scheme in 10⁶ N m/rad, with the range that would match as well",
        columns,
        rows,
        text_columns=(0, 1, 2, 3, 4, 5, 7),
        folded=True,
    )


def _ranged(spring: tuple[float, float, float]) -> str:
    value, low, high = spring
    return f"{mega(value)} ({mega(low)} to {mega(high)})" if np.isfinite(low) else f"{mega(value)} (nothing matches)"


def _change(s: SpringPair) -> str:
    return signed(s.change) if s.has_values else "–"
