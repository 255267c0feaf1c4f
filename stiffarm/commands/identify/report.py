"""report.html of an identification of joint twists: the stiffnesses, how sure, hysteresis, checks, comparison, map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from doe.joint_twists import Direction
from doe.joint_twists.model_file import held_constant, rms_mm
from fem.statics.ports import ROWS
from robots.arrays import Array
from robots.constants import NORMAL_95
from stiffarm.commands.identify import figures
from stiffarm.commands.identify.payload import held_out_rows
from stiffarm.commands.identify.step import POSES, JointTwists
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Answer, Block, Bullets, KeyFigure, Note, Section, Table, Text, data_words, write_page
from stiffarm.session.outputs import OutputFolder

QUESTION = "how stiff is each joint, in all six directions?"
PAPER_ROBOT = "tx200"
# Table 1 of the TX200 paper: force (N) and direction, measured and model (N/mm). Configurations are not given.
PAPER_TABLE_1 = (
    ("1", "596.9 Z", 1187.95, 1148.79),
    ("2", "601.8 XY", 506.19, 436.68),
    ("3", "610.0 Z", 1135.99, 1170.07),
)


def write_report(d: JointTwists, folder: OutputFolder) -> None:
    """Draw all figures and write report.html."""
    pictures = Pictures(folder)
    parts = [
        _in_short(d),
        _stiffnesses(d, pictures),
        hysteresis(d, pictures),
        usual(d, pictures),
        prediction(d),
        stiffness_map(d, pictures),
        replace(diagonal(d), folded=True),
        replace(how(d), folded=True),
    ]
    data = d.found.data
    kind = "made-up (synthetic) readings" if d.synthetic else "readings"
    lede = (
        f"Six stiffnesses at each of {d.given.robot.dof} joints, as functions of the joint's angle, from {data.n} "
        f"{kind} in {d.found.cycles.m} load cycles of {len(d.found.cycles.setups)} set-ups."
    )
    title = d.given.description.title.split(" (")[0] + (" - synthetic data" if d.synthetic else "")
    open_ones = [f"{x.joint}.{x.row}" for x in d.found.directions.values() if x.status != "determined"]
    named = ", ".join(open_ones[:6]) + (f" and {len(open_ones) - 6} more" if len(open_ones) > 6 else "")
    todo = f"Not fully determined: {named}. Add readings that load these directions. " if open_ones else ""
    todo += "Use model.toml in other commands: `stiffarm map`, `posture`, `place`."
    answer = Answer(_scatter_words(d), todo)
    write_page(folder, title, lede, _key(d), parts, QUESTION, data_words(data), answer)


def _key(d: JointTwists) -> list[KeyFigure]:
    status = [x.status for x in d.found.directions.values()]
    out = [
        KeyFigure(f"{status.count('determined')} of {len(status)}", "stiffnesses determined"),
    ]
    if d.flange is not None:
        spread, gears = 100.0 * float(d.flange.spread.max()), 100.0 * float(d.flange.same.mean.max())
        shown = f"± {spread:.1f} %" if np.isfinite(spread) else "none"
        out.append(KeyFigure(shown, "95 % interval of directional stiffness, median pose"))
        out.append(KeyFigure(f"{gears:.0f} %", "mean error with gear stiffness alone, worst flange axis"))
    if d.held_out is not None:
        worst = 100.0 * float(np.abs(d.held_out.error).max())
        out.append(KeyFigure(f"{worst:.1f} %", "largest error at held-out readings"))
    return out


def _in_short(d: JointTwists) -> Section:
    synthetic = Note("The readings are synthetic: simulated from known stiffnesses, not measured.")
    said = Bullets(tuple(summary(d)))
    return Section("In short", (synthetic, said) if d.synthetic else (said,))


def summary(d: JointTwists) -> list[str]:
    """What a reader must know, in sentences."""
    status = [x.status for x in d.found.directions.values()]
    counts = [f"{status.count(s)} {s}" for s in dict.fromkeys(status)]
    only_low = " One-sided: only a lower limit; rigid is possible within 95 %." if "one-sided" in status else ""
    out = [f"{len(status)} stiffnesses: {', '.join(counts)}.{only_low}"]
    out += [f"{note[0].upper()}{note[1:]}." for note in d.found.notes]
    out.append(_scatter_words(d))
    proven = [x for x in d.loops if x.proven and x.row == "rz"]
    if proven:
        most = max(proven, key=lambda x: abs(x.share))
        out.append(
            f"Hysteresis about the gear axes of {', '.join(x.joint for x in proven)}, at most "
            f"{100.0 * most.share:.1f} % of the range ({most.joint}). Loading alone would change that gear's stiffness "
            f"by {100.0 * most.loading_only:+.1f} %."
        )
    out += _diagonal_words(d)
    if d.flange is None:
        out.append(f"{d.no_flange[0].upper()}{d.no_flange[1:]}.")
    else:
        out.append(
            f"A model of the gears alone is off by {_percent(d.flange.same.mean)} on average in flange X, Y, Z; "
            f"refitted to flange deflections, by {_percent(d.flange.refitted.mean)}."
        )
    out += [f"{note}." for note in held_constant(d.found)]
    if d.flange is not None and held_constant(d.found):
        out.append(
            f"Compared with the laws, these constants change the stiffness by {_percent(d.flange.file.mean)} on "
            f"average in flange X, Y, Z, at worst {_percent(d.flange.file.worst)}."
        )
    return out


def _diagonal_words(d: JointTwists) -> list[str]:
    bad = [t.joint for t in d.diagonal if not t.suffices]
    if bad:
        return [f"A diagonal stiffness matrix is not enough at {', '.join(bad)}: cross terms are proven."]
    if not d.diagonal:
        return ["Cross terms cannot be tested: at no joint are two stiffnesses identified."]
    where = "" if len(d.diagonal) == d.given.robot.dof else f" at {', '.join(t.joint for t in d.diagonal)}"
    return [
        f"A diagonal stiffness matrix per joint is enough{where}: no cross term is both proven and above a tenth of "
        "the diagonal."
    ]


def _scatter_words(d: JointTwists) -> str:
    parts = [
        f"{100.0 * s:.1f} % ({kind})" if n else f"not known ({kind}: too few set-ups at one angle)"
        for kind, s, n in zip(("translations", "rotations"), d.found.scatter, d.found.scatter_dof, strict=True)
    ]
    return f"Compliances of set-ups at the same angle scatter, beyond reading noise, by {' and '.join(parts)}."


def _percent(values: Array) -> str:
    return ", ".join(f"{100.0 * v:.1f}" if v < 0.1 else f"{100.0 * v:.0f}" for v in values) + " %"


def _stiffnesses(d: JointTwists, pictures: Pictures) -> Section:
    return Section(
        "Six stiffnesses a joint",
        (
            Text(
                "Frame: the modified DH frame of the joint, with Z along the gear axis and X along the common "
                "normal to "
                "the next axis; it turns with the link after the joint. Stiffness at the middle of the measured "
                "angles: "
                "translations in N/µm, rotations in 10⁶ N m/rad, 95 % intervals in brackets."
            ),
            Table("Six stiffnesses of each joint", ("joint", *ROWS), stiffness_rows(d)),
            pictures.add(
                figures.compliances_figure(d.found, made_up(d)),
                "compliances",
                "Compliances side by side. n.i.: never loaded or never read; n.d.: the best compliance is not "
                "positive.",
            ),
            pictures.add(
                figures.laws_figure(d.found, made_up(d)),
                "stiffness_over_angle",
                "Each stiffness over its joint's angle. Points: each angle by itself, without a law. Where a "
                "band is wider "
                "than the axis, the readings hardly depend on this stiffness. Laws hold between the outermost angles.",
            ),
            Text(_law_words(d)),
        ),
    )


def stiffness_rows(d: JointTwists) -> tuple[tuple[str, ...], ...]:
    """One row a joint: its name, and six stiffnesses at the middle of the angles measured, with intervals."""
    return tuple((name, *(_cell(d.found.directions[name, row]) for row in ROWS)) for name in d.found.names)


def _cell(d: Direction) -> str:
    if d.law is None:
        _, low, _ = d.stiffness(np.zeros(1))
        at_least = f", ≥ {low[0] / 1e6:.3g}" if d.status == "not determined" and np.isfinite(low[0]) else ""
        return d.status + at_least
    middle = np.array([(d.angle.min() + d.angle.max()) / 2.0])
    k, low, high = (v[0] / 1e6 for v in d.stiffness(middle))
    if np.isinf(high):
        return f"{k:.3g} (≥ {low:.3g})"
    if np.isnan(low):
        return f"{k:.3g} (no interval)"
    return f"{k:.3g} ({low:.3g}–{high:.3g})"


def _law_words(d: JointTwists) -> str:
    if d.request.law is not None:
        return f"Law of every stiffness over the joint angle, as asked: {d.request.law}."
    kinds = [x.law.kind for x in d.found.directions.values() if x.law]
    counts = ", ".join(f"{kinds.count(k)} {k}" for k in dict.fromkeys(kinds))
    better = sum(
        min(x.scores, key=lambda k: x.scores[k]) != "constant" for x in d.found.directions.values() if x.scores
    )
    return (
        f"Laws of ln k over the joint angle: {counts}. Each has the highest order that its angles can support (order "
        "one from four angles on, order two from six over half a turn), so that the interval does not rest on the "
        f"stiffness being constant or varying only once a turn. For {better} stiffnesses a varying law predicts "
        "left-out angles better than a constant."
    )


def made_up(d: JointTwists) -> str:
    """Ending of every figure's title where the readings were made up."""
    return " (synthetic data)" if d.synthetic else ""


def hysteresis(d: JointTwists, pictures: Pictures) -> Section:
    """Loops, and what the way up alone would give."""
    used = "the mean of loading and unloading" if d.found.branches == "mean" else "loading alone"
    blocks: list[Block] = [
        Text(
            "Width of the loop: the unloading reading minus the loading reading at the same load. The stiffnesses come "
            f"from {used}: one slope and one width are fitted to each load cycle."
        )
    ]
    rows = tuple(
        (
            f"{x.joint}.{x.row}",
            f"{1e6 * x.width:+.1f} ± {1e6 * NORMAL_95 * x.spread:.1f}",
            "µm" if x.row[0] == "t" else "µrad",
            f"{100.0 * x.share:+.1f}",
            f"{100.0 * x.loading_only:+.1f}",
            "yes" if x.proven else "no",
        )
        for x in d.loops
    )
    if rows:
        gears = tuple(r for r in rows if r[0].endswith("rz"))
        columns = ("stiffness", "width, 95 %", "unit", "of the range (%)", "change of k by loading alone (%)", "proven")
        blocks.append(Table("Loops about the gear axes", columns, gears, text_columns=(0, 2, 5)))
        blocks.append(
            Table("All loops (one in twenty is “proven” by chance)", columns, rows, text_columns=(0, 2, 5), folded=True)
        )
    if any(x.row == "rz" for x in d.loops):
        blocks.append(
            pictures.add(
                figures.loops_figure(d.found, made_up(d)),
                "hysteresis",
                "Loading and unloading about the gear axes.",
            )
        )
    if d.found.branches == "loading":
        blocks.append(Note("Only loading was used, so the stiffnesses include friction."))
    return Section("Hysteresis", tuple(blocks))


def diagonal(d: JointTwists) -> Section:
    """Cross terms, and the twist ratio of the paper's joint."""
    rows = []
    for t in d.diagonal:
        c = min(t.couplings, key=lambda c: c.p_value) if t.couplings else None
        proven = ", ".join(f"{'-'.join(x.rows)} ({x.share:+.2f})" for x in t.couplings if x.proven)
        most = "–" if c is None else f"{'-'.join(c.rows)} {c.share:+.2f} (p = {c.p_value:.2g})"
        rows.append((t.joint, "yes" if t.suffices else "no", most, proven or "none"))
    blocks: list[Block] = [
        Text(
            "Does a load in one direction cause motion in another, as when a moment about Z twists the joint about X? "
            "Each of the 15 off-diagonal entries is fitted along with the laws and tested; “proven” means significant "
            "after correction for all entries of all joints (Holm). Shares are relative to the geometric mean of the "
            "two diagonal compliances. A bearing away from the origin of the DH frame shows up here, because its tilt "
            "moves the origin."
        ),
        Table(
            "Cross terms",
            ("joint", "diagonal is enough", "least likely to be chance", "proven"),
            tuple(rows),
            text_columns=(0, 1, 2, 3),
        ),
    ]
    if d.bending is not None:
        b = d.bending
        words = (
            f"Joint {b.joint}: the same moment twists it about X by {b.ratio:.2f} ({b.low:.2f} to {b.high:.2f}) times "
            "as much as about the gear axis."
        )
        if d.found.robot == PAPER_ROBOT:
            words += " The TX200 paper measured 0.010 deg against 0.017 deg (0.59) with the force along flange Y."
        blocks.append(Text(words))
    return Section("Is a diagonal matrix enough?", tuple(blocks))


def usual(d: JointTwists, pictures: Pictures) -> Section:
    """Models of the gears alone against six stiffnesses a joint."""
    if d.flange is None:
        return Section("Gears alone", (Text(f"{d.no_flange[0].upper()}{d.no_flange[1:]}."),))
    f = d.flange
    rows = tuple(
        (words, axis, *(f"{100.0 * float(getattr(e, name)[k]):.1f}" for name in ("bias", "mean", "p95", "worst")))
        for words, e in (("same torsional stiffness", f.same), ("refitted", f.refitted))
        for k, axis in enumerate(("flange X", "flange Y", "flange Z"))
    )
    springs = ", ".join(
        f"{name} {'not seen' if c == 0.0 else f'{1e-6 / c:.3g}'}"
        for name, c in zip(d.given.robot.joint_names, f.effective.tolist(), strict=True)
    )
    return Section(
        "Gears alone",
        (
            Text(
                "The usual model has one stiffness per joint, about the gear axis. It is compared with six per "
                "joint at "
                f"{POSES} random poses within limits and with the flange above the floor: once with the same torsional "
                "stiffnesses, once with constants refitted to flange deflections at other random poses."
            ),
            pictures.add(
                figures.usual_models_figure(f.same, f.refitted, made_up(d)),
                "gears_alone",
                "Error of directional stiffness by flange axis. In the worst poses the force has no lever arm "
                "about any "
                "gear axis, so that a model of the gears alone is practically rigid.",
            ),
            Table(
                "Errors of directional stiffness (%)",
                ("gears alone", "axis", "signed mean", "mean", "95th %", "worst"),
                rows,
                text_columns=(0, 1),
            ),
            Text(f"Effective stiffnesses of the refitted gears (10⁶ N m/rad): {springs}."),
        ),
    )


def prediction(d: JointTwists) -> Section:
    """Flange deflections held out, and the paper's own check."""
    blocks: list[Block] = []
    if d.held_out is not None:
        h = d.held_out
        rows = tuple(
            (label, f"{f:.1f}", f"{m:.1f}", f"{p:.1f} ({1e-3 * lo:.1f}–{1e-3 * hi:.1f})", f"{e:+.1f}")
            for (label, f, m, p, e), lo, hi in zip(held_out_rows(d), h.low, h.high, strict=True)
        )
        columns = ("pose", "force (N)", "measured (N/mm)", "predicted, 95 % (N/mm)", "error (%)")
        blocks.append(Table(f"Held-out flange deflections ({h.source})", columns, rows))
    else:
        blocks.append(Text("Not checked: no flange deflections were held out (`--holdout TABLE`)."))
    if d.found.robot != PAPER_ROBOT:
        return Section("Prediction", tuple(blocks))
    rows = tuple((n, f, f"{m:.2f}", f"{k:.2f}", f"{100.0 * (k / m - 1.0):+.2f}") for n, f, m, k in PAPER_TABLE_1)
    blocks.append(
        Table(
            "For comparison, Table 1 of the TX200 paper (readings of another arm; its poses are not given)",
            ("configuration", "force (N)", "measured (N/mm)", "paper's model (N/mm)", "error (%)"),
            rows,
            text_columns=(0, 1),
        )
    )
    return Section("Prediction", tuple(blocks))


def stiffness_map(d: JointTwists, pictures: Pictures) -> Section:
    """The map over the window."""
    w = d.window
    if w is None:
        return Section("Stiffness map", (Text(f"{d.no_window[0].upper()}{d.no_window[1:]}."),))
    reached = 100.0 * float(np.isfinite(w.mean).mean())
    return Section(
        "Stiffness map",
        (
            pictures.add(
                figures.window_figure(w, d.given.robot.name, made_up(d)),
                "stiffness_map",
                "Mean of the directional stiffnesses along flange X, Y and Z, each under a unit force in that "
                "direction.",
            ),
            Text(
                f"The flange keeps its orientation ({w.orientation}), elbow {w.elbow}, as in Fig. 3 of the "
                "TX200 paper. "
                "The paper gives the origin of its map (X 1344, Z 550 mm) but not its size, which is chosen here. "
                f"{reached:.0f} % of the window can be reached. Figures: stiffness_map.csv."
            ),
        ),
    )


def how(d: JointTwists) -> Section:
    """How it was done, and the noise."""
    c = d.found.cycles
    noise = tuple(
        (name, f"{1e6 * a:.2f}", f"{1e6 * b:.2f}", f"{dof[0]}, {dof[1]}")
        for name, (a, b), dof in zip(d.given.robot.joint_names, c.noise, c.noise_dof, strict=True)
    )
    blocks: list[Block] = [
        Text(
            "Statics gives force and moment at each joint from those at the flange. Each load cycle gives one slope "
            "per direction; the cycles of a set-up give its compliance by weighted least squares; the law over the "
            "angle is fitted to the set-ups, whose scatter is estimated by restricted likelihood from set-ups at the "
            "same angle. The links are rigid. Displacements at the top loads leave a residual of "
            f"{1e3 * rms_mm(d.found):.1f} µm RMS."
        ),
        Table(
            "Noise of one reading, estimated where the table gives none",
            ("joint", "µm", "µrad", "degrees of freedom"),
            noise,
            folded=True,
        ),
    ]
    if d.found.data.notes:
        blocks.append(Bullets(d.found.data.notes))
    return Section("How", tuple(blocks))
