"""The report's section on the link model: the same calibrations with two kinds of links, beside each other."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from fem import LinkKind
from stiffarm.commands.run.findings import Findings
from stiffarm.commands.run.link_models import LinkModels, SpringPair
from stiffarm.commands.run.link_words import NOUN, sentences, share_text, signed
from stiffarm.pages.report import Bullets, Note, Section, Table, Text
from stiffarm.session.spring_words import mega

_COMPARED: Final = (("RMS", " (mm)"), ("left-out RMS", " (mm)"), ("structure's share", ""))
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


def links_section(f: Findings) -> Section:
    """Both kinds of links, calibration by calibration: errors, shares, springs, and what follows."""
    both = f.link_models
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    return Section(
        f"What the link model changes: {own} beside {other}",
        (
            Text(
                f"The links of this run are {own}. Here every calibration is repeated with {other}: same readings, "
                f"same scheme, same joints. {_HINT[both.own.links]}"
            ),
            Bullets(sentences(both, f.best.name, f.scheme.noise.gauge_mm)),
            _error_table(both, f.best.name),
            _springs_table(both),
            Note(
                "Calibration hides errors of the link model: what links give too little, the springs give more, as far "
                "as both bend the arm in the same way over the poses. So an equally good fit does not say that the "
                "links are right, and absolute link shares rest on the sections in the model file."
            ),
        ),
    )


def _error_table(both: LinkModels, best: str) -> Table:
    own, other = NOUN[both.own.links], NOUN[both.other.links]
    columns = [f"{what}, {links}{unit}" for what, unit in _COMPARED for links in (other, own)]
    rows = []
    for pair in both.pairs:
        better, poses = pair.poses_better()
        sides = ((both.other, pair.other), (both.own, pair.own))
        cells = [f"{v.rms_mm:.4f}" for _, v in sides] + [_millimetres(v.left_out_rms_mm) for _, v in sides]
        cells += [share_text(side, pair) for side, _ in sides]
        rows.append((pair.own.name, *cells, f"{better} of {poses}"))
    return Table(
        f"{other.capitalize()} beside {own} (highlighted: recommended). Structure: links, bar and crank, their share "
        f"in the strain energy, least to most of the readings. Last column: left-out poses to which {own} are nearer",
        ("calibration", *columns, f"{own} nearer"),
        tuple(rows),
        best=next(i for i, pair in enumerate(both.pairs) if pair.own.name == best),
    )


def _millimetres(value: float) -> str:
    return f"{value:.4f}" if np.isfinite(value) else "not predicted"


def _springs_table(both: LinkModels) -> Table:
    own, other = NOUN[both.own.links], NOUN[both.other.links]
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
