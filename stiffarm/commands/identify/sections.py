"""Sections of the report of joint twists: hysteresis, cross terms, gears alone, prediction, map, how."""

from __future__ import annotations

import numpy as np

from doe.joint_twists.model_file import rms_mm
from robots.constants import NORMAL_95
from stiffarm.commands.identify import figures
from stiffarm.commands.identify.payload import held_out_rows
from stiffarm.commands.identify.step import POSES, JointTwists
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Bullets, Note, Section, Table, Text

PAPER_ROBOT = "tx200"
# Table 1 of the TX200 paper: force (N) and direction, measured and model (N/mm). Configurations are not given.
PAPER_TABLE_1 = (
    ("1", "596.9 Z", 1187.95, 1148.79),
    ("2", "601.8 XY", 506.19, 436.68),
    ("3", "610.0 Z", 1135.99, 1170.07),
)


def made_up(d: JointTwists) -> str:
    """Ending of every figure's title where the readings were made up."""
    return " (synthetic data)" if d.synthetic else ""


def hysteresis(d: JointTwists, pictures: Pictures) -> Section:
    """Loops, and what the way up alone would give."""
    used = "the mean of both ways" if d.found.branches == "mean" else "the way up alone"
    blocks: list[Block] = [
        Text(
            "Width of the loop: reading on the way down less reading on the way up at the same load. The stiffnesses "
            f"are from {used}: one slope and one width are fitted to each load cycle."
        )
    ]
    rows = tuple(
        (
            f"{x.joint}.{x.row}", f"{1e6 * x.width:+.1f} ± {1e6 * NORMAL_95 * x.spread:.1f}",
            "µm" if x.row[0] == "t" else "µrad", f"{100.0 * x.share:+.1f}", f"{100.0 * x.loading_only:+.1f}",
            "yes" if x.proven else "no",
        )
        for x in d.loops
    )  # fmt: skip
    if rows:
        gears = tuple(r for r in rows if r[0].endswith("rz"))
        columns = ("stiffness", "width, 95 %", "unit", "of the range (%)", "way up alone: k (%)", "proven")
        blocks.append(Table("Loops about the gear axes", columns, gears, text_columns=(0, 2, 5)))
        blocks.append(
            Table("All loops (one in twenty is “proven” by chance)", columns, rows, text_columns=(0, 2, 5), folded=True)
        )
    if any(x.row == "rz" for x in d.loops):
        blocks.append(
            pictures.add(
                figures.loops_figure(d.found, made_up(d)), "hysteresis",
                "Up and down about the gear axes.",
            )
        )  # fmt: skip
    if d.found.branches == "loading":
        blocks.append(Note("The way up alone was used: friction stays in the stiffnesses."))
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
            "Does a load on one row move another (a moment about Z twist about X)? Each of the 15 entries off the "
            "diagonal is fitted beside the laws and tested; proven means beyond chance with all entries of all joints "
            "looked at (Holm). Shares are of the geometric mean of the two diagonal compliances. A bearing that does "
            "not sit at the origin of the DH frame shows here: its tilt moves the origin."
        ),
        Table(
            "Cross terms", ("joint", "diagonal is enough", "least likely to be chance", "proven"), tuple(rows),
            text_columns=(0, 1, 2, 3),
        ),
    ]  # fmt: skip
    if d.bending is not None:
        b = d.bending
        words = (
            f"Joint {b.joint}: under the same moment it twists about X by {b.ratio:.2f} ({b.low:.2f} to {b.high:.2f}) "
            "of what it does about the gear axis."
        )
        if d.found.robot == PAPER_ROBOT:
            words += " The paper reads 0.010 deg against 0.017 deg, 0.59, with the force in flange Y: not negligible."
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
    blocks: list[Block] = [
        Text(
            f"The usual model has one stiffness a joint, about the gear axis. Against six a joint, over {POSES} random "
            "poses within limits with the flange above the floor: once with the same torsional stiffnesses, once "
            "with constants refitted to the flange's deflections at other random poses."
        ),
        pictures.add(
            figures.usual_models_figure(f.same, f.refitted, made_up(d)), "gears_alone",
            "Error of directional stiffness by flange axis. The worst poses are those in which a force has no lever "
            "about any gear axis: there gears alone are as good as rigid.",
        ),
        Table(
            "Errors of directional stiffness (%)", ("gears alone", "axis", "signed mean", "mean", "95th %", "worst"),
            rows, text_columns=(0, 1),
        ),
        Text(f"Effective stiffnesses of the refitted gears (10⁶ N m/rad): {springs}."),
    ]  # fmt: skip
    return Section("Gears alone", tuple(blocks))


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
        blocks.append(Table(f"Flange deflections that were not used ({h.source})", columns, rows))
    else:
        blocks.append(
            Text("No flange deflections were held out (--holdout TABLE): the prediction is not checked here.")
        )
    if d.found.robot != PAPER_ROBOT:
        return Section("Prediction", tuple(blocks))
    rows = tuple((n, f, f"{m:.2f}", f"{k:.2f}", f"{100.0 * (k / m - 1.0):+.2f}") for n, f, m, k in PAPER_TABLE_1)
    blocks.append(
        Table(
            "For comparison, Table 1 of the paper (another arm's readings; its configurations are not given)",
            ("configuration", "force (N)", "measured (N/mm)", "paper's model (N/mm)", "error (%)"), rows,
            text_columns=(0, 1),
        )
    )  # fmt: skip
    return Section("Prediction", tuple(blocks))


def stiffness_map(d: JointTwists, pictures: Pictures) -> Section:
    """The map over the window."""
    w = d.window
    if w is None:
        return Section("Stiffness map", (Text(f"{d.no_window[0].upper()}{d.no_window[1:]}."),))
    reached = 100.0 * float(np.isfinite(w.mean).mean())
    blocks: list[Block] = [
        pictures.add(
            figures.window_figure(w, d.given.robot.name, made_up(d)), "stiffness_map",
            "Mean of the directional stiffnesses in flange X, Y and Z, each under a unit force of its own.",
        ),
        Text(
            f"As Fig. 3 of the paper: the flange keeps its orientation ({w.orientation}), elbow {w.elbow}. The paper "
            "gives the origin of its map (X 1344, Z 550 mm); the window's size is not stated there and is chosen here. "
            f"{reached:.0f} % of the window is reached. Numbers: stiffness_map.csv."
        ),
    ]  # fmt: skip
    return Section("Stiffness map", tuple(blocks))


def how(d: JointTwists) -> Section:
    """How it was done, and the noise."""
    c = d.found.cycles
    noise = tuple(
        (name, f"{1e6 * a:.2f}", f"{1e6 * b:.2f}", f"{dof[0]}, {dof[1]}")
        for name, (a, b), dof in zip(d.given.robot.joint_names, c.noise, c.noise_dof, strict=True)
    )
    blocks: list[Block] = [
        Text(
            "Statics gives force and moment at the joint from those at the flange. Each load cycle gives one slope a "
            "row; a set-up's cycles give its compliance by weighted least squares; the law over the angle is fitted to "
            "the set-ups, whose scatter is estimated by restricted likelihood from set-ups at one angle. Arms are "
            f"taken as rigid, as in the paper. Displacements are left over by {1e3 * rms_mm(d.found):.1f} µm RMS at "
            "the top loads."
        ),
        Table(
            "Noise of a reading, where the table gives none", ("joint", "µm", "µrad", "degrees of freedom"), noise,
            folded=True,
        ),
    ]  # fmt: skip
    if d.found.data.notes:
        blocks.append(Bullets(d.found.data.notes))
    return Section("How", tuple(blocks))
