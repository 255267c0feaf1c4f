"""report.html of an identification of joint twists: the stiffnesses, how sure, hysteresis, checks, comparison, map."""

from __future__ import annotations

import numpy as np

from doe.joint_twists import Direction
from doe.joint_twists.model_file import held_constant
from fem.statics.ports import ROWS
from robots.arrays import Array
from stiffarm.commands.identify import figures, sections
from stiffarm.commands.identify.step import JointTwists
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Bullets, KeyFigure, Note, Section, Table, Text, data_words, write_page
from stiffarm.session.outputs import OutputFolder


def write_report(d: JointTwists, folder: OutputFolder) -> None:
    """Draw all figures and write report.html."""
    pictures = Pictures(folder)
    parts = [
        _in_short(d), _stiffnesses(d, pictures), sections.hysteresis(d, pictures), sections.diagonal(d),
        sections.usual(d, pictures), sections.prediction(d), sections.stiffness_map(d, pictures), sections.how(d),
    ]  # fmt: skip
    data = d.found.data
    kind = "made-up (synthetic) readings" if d.synthetic else "readings"
    lede = (
        f"Substitute stiffness model: six stiffnesses at each of {d.given.robot.dof} joints, over the joint's angle, "
        f"from {data.n} {kind} in {d.found.cycles.m} load cycles of {len(d.found.cycles.setups)} set-ups."
    )
    title = d.given.description.title.split(" (")[0] + (" - synthetic data" if d.synthetic else "")
    write_page(folder, title, lede, _key(d), parts, made_of=data_words(data))


def _key(d: JointTwists) -> list[KeyFigure]:
    status = [x.status for x in d.found.directions.values()]
    out = [
        KeyFigure(f"{status.count('determined')} of {len(status)}", "stiffnesses determined"),
    ]
    if d.flange is not None:
        spread, gears = 100.0 * float(d.flange.spread.max()), 100.0 * float(d.flange.same.mean.max())
        shown = f"± {spread:.1f} %" if np.isfinite(spread) else "none"
        out.append(KeyFigure(shown, "95 % interval of directional stiffness, median pose"))
        out.append(KeyFigure(f"{gears:.0f} %", "mean error of gears alone, worst flange axis"))
    if d.held_out is not None:
        worst = 100.0 * float(np.abs(d.held_out.error).max())
        out.append(KeyFigure(f"{worst:.1f} %", "largest error at readings held out"))
    return out


def _in_short(d: JointTwists) -> Section:
    blocks: list[Block] = []
    if d.synthetic:
        blocks.append(Note("The readings are synthetic: made up from known stiffnesses, nobody measured them."))
    blocks.append(Bullets(tuple(summary(d))))
    return Section("In short", tuple(blocks))


def summary(d: JointTwists) -> list[str]:
    """What a reader must know, in sentences."""
    status = [x.status for x in d.found.directions.values()]
    counts = [f"{status.count(s)} {s}" for s in dict.fromkeys(status)]
    out = [f"Of {len(status)} stiffnesses {', '.join(counts)}."]
    out += [f"{note[0].upper()}{note[1:]}." for note in d.found.notes]
    out.append(_scatter_words(d))
    proven = [x for x in d.loops if x.proven and x.row == "rz"]
    if proven:
        most = max(proven, key=lambda x: abs(x.share))
        out.append(
            f"Hysteresis about the gear axes of {', '.join(x.joint for x in proven)}; at most "
            f"{100.0 * most.share:.1f} % of the range ({most.joint}). From the way up alone that gear would come out "
            f"{100.0 * most.loading_only:+.1f} % stiffer."
        )
    out += _diagonal_words(d)
    if d.flange is None:
        out.append(f"{d.no_flange[0].upper()}{d.no_flange[1:]}.")
    else:
        out.append(
            f"Gears alone, with the same stiffness, are off by {_percent(d.flange.same.mean)} on average in flange "
            f"X, Y, Z, refitted to flange deflections by {_percent(d.flange.refitted.mean)}."
        )
    out += [f"{note}." for note in held_constant(d.found)]
    if d.flange is not None and held_constant(d.found):
        out.append(
            f"Against the laws that makes {_percent(d.flange.file.mean)} on average in flange X, Y, Z, at worst "
            f"{_percent(d.flange.file.worst)}."
        )
    return out


def _diagonal_words(d: JointTwists) -> list[str]:
    bad = [t.joint for t in d.diagonal if not t.suffices]
    if bad:
        return [f"A diagonal matrix is not enough at {', '.join(bad)}: cross terms are proven."]
    if not d.diagonal:
        return ["Whether a diagonal matrix a joint is enough cannot be tested: no two rows of a joint have numbers."]
    where = "" if len(d.diagonal) == d.given.robot.dof else f" at {', '.join(t.joint for t in d.diagonal)}"
    return [
        f"A diagonal matrix a joint is enough{where}: no cross term is both proven and above a tenth of the diagonal."
    ]


def _scatter_words(d: JointTwists) -> str:
    parts = [
        f"{100.0 * s:.1f} % ({kind})" if n else f"not known ({kind}: too few set-ups at one angle)"
        for kind, s, n in zip(("translations", "rotations"), d.found.scatter, d.found.scatter_dof, strict=True)
    ]
    return f"Set-ups at one angle scatter beyond their readings' noise by {' and '.join(parts)} of the compliance."


def _percent(values: Array) -> str:
    return ", ".join(f"{100.0 * v:.1f}" if v < 0.1 else f"{100.0 * v:.0f}" for v in values) + " %"


def _stiffnesses(d: JointTwists, pictures: Pictures) -> Section:
    names = d.given.robot.joint_names
    blocks: list[Block] = [
        Text(
            "Frame: the modified DH frame of the joint, Z along the gear axis, X along the common normal to the next "
            "axis, turning with the arm behind the joint. Stiffness at the middle of the angles measured, "
            "translations in N/µm, rotations in 10⁶ N m/rad, 95 % intervals in brackets."
        ),
        Table("Six stiffnesses of each joint", ("joint", *ROWS), stiffness_rows(d)),
        pictures.add(
            figures.compliances_figure(d.found, names, sections.made_up(d)), "compliances",
            "Compliances side by side. n.i.: never loaded or never read; n.d.: the best compliance is not positive.",
        ),
        pictures.add(
            figures.laws_figure(d.found, names, sections.made_up(d)), "stiffness_over_angle",
            "Each stiffness over its joint's angle. Points: each angle by itself, without any law. Where a band is "
            "wider than the axis, readings hardly see the direction. Laws hold between the outermost angles.",
        ),
        Text(_law_words(d)),
    ]  # fmt: skip
    return Section("Six stiffnesses a joint", tuple(blocks))


def stiffness_rows(d: JointTwists) -> tuple[tuple[str, ...], ...]:
    """One row a joint: its name, and six stiffnesses at the middle of the angles measured, with intervals."""
    names, dof = d.given.robot.joint_names, d.given.robot.dof
    return tuple(
        (name, *(_cell(d.found.directions[name, row], j, dof) for row in ROWS)) for j, name in enumerate(names)
    )


def _cell(d: Direction, column: int, dof: int) -> str:
    if d.law is None:
        _, low, _ = d.stiffness(np.zeros((1, dof)))
        at_least = f", ≥ {low[0] / 1e6:.3g}" if d.status == "not determined" and np.isfinite(low[0]) else ""
        return d.status + at_least
    q = np.zeros((1, dof))
    q[0, column] = (d.angle.min() + d.angle.max()) / 2.0
    k, low, high = (v[0] / 1e6 for v in d.stiffness(q))
    if np.isinf(high):
        return f"{k:.3g} (≥ {low:.3g})"
    if np.isnan(low):
        return f"{k:.3g} (no interval)"
    return f"{k:.3g} ({low:.3g}–{high:.3g})"


def _law_words(d: JointTwists) -> str:
    if d.request.law is not None:
        return f"Law of every stiffness, as asked: {d.request.law}."
    kinds = [x.law.kind for x in d.found.directions.values() if x.law]
    counts = ", ".join(f"{kinds.count(k)} {k}" for k in dict.fromkeys(kinds))
    better = sum(
        min(x.scores, key=lambda k: x.scores[k]) != "constant" for x in d.found.directions.values() if x.scores
    )
    return (
        f"Laws of ln k, by leaving out one angle at a time: {counts}. Order one is the least where four angles or more "
        "were measured, so that an interval does not pretend that a stiffness is constant; order two is taken where "
        f"it predicts angles left out clearly better. For {better} stiffnesses a law that varies predicts angles left "
        "out better than a constant does."
    )
