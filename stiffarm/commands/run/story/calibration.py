"""The report's first half: data, first model, sensitivity, calibration, comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from doe.tables.measurements import rows_of
from robots.arrays import Array
from stiffarm.commands.calibrate.figures.identifiability import intervals_figure
from stiffarm.commands.calibrate.results import identified_blocks, study_blocks
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.commands.calibrate.words import doubt_sentences, estimate_text, verdict
from stiffarm.commands.run.figures import (
    MOST_LEVELS,
    axis_words,
    data_figure,
    match_figure,
    wrist_families,
)
from stiffarm.commands.run.findings import Findings
from stiffarm.commands.run.held_out import sentences
from stiffarm.commands.sensitivity.figures import read_words, sensitivity_figure
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Bullets, Fold, Note, Section, Table, Text
from stiffarm.session.steps import RigidJoints, springs_seen

_LEAST_ROUGHNESS = (
    "Three distinct angles cannot fix the seven coefficients of a sixth-degree polynomial. Of all polynomials for "
    "ln k through the points, the smoothest is chosen: the one with the smallest coefficients, weighted by "
    "(1 + degree)^2. So the springs stay positive, without bumps between points. When two springs are matched to one "
    "reading, many pairs fit equally well; the pair chosen depends on the starting value, not on the data."
)

# More readings than these hide one another in a picture of poses side by side.
MOST_COLUMNS = 60


def data_section(f: Findings, pictures: Pictures) -> Section:
    """What was measured, what is in doubt, what is used."""
    levels = np.unique(np.round(f.data.loads_N, 6))
    unused = [v for v in levels if f.scheme.loads_N and not np.isclose(v, f.scheme.loads_N, rtol=0.01).any()]
    used = ", ".join(f"{v:g} N" for v in f.scheme.loads_N) or "all loads"
    notes = f.notes
    figure = data_figure(
        f.data,
        excluded_loads_N=unused,
        doubts=notes.doubts,
        families=wrist_families(f.data, f.given.robot),
    )
    caption = "Measured deflection by pose and load."
    if unused:
        caption += " Pale bars were not used."
    if notes.doubts:
        caption += " Hatched bars are in doubt."
    caption = f"{caption} {notes.measured}".rstrip()
    few = len(levels) <= MOST_LEVELS
    under = ", ".join(f"{v:g}" for v in levels) if few else f"{levels[0]:.4g} to {levels[-1]:.4g}"
    uses = f" Calibration uses {used}, as the scheme says." if f.published else ""
    still = idle_joints(f)
    blocks: list[Block] = [
        Text(f"{f.data.n} readings at {len(f.data.pose_groups())} poses under {under} N.{uses}"),
        pictures.add(figure, "measured", caption),
    ]
    if still:
        blocks.append(Text(f"No reading depends on {', '.join(still)}, so their springs cannot be identified."))
    doubts: list[Block] = [Note(_proportionality(f, levels))] if 1 < len(levels) <= MOST_LEVELS else []
    if notes.doubted:
        doubts.append(Note(notes.doubted))
    if f.data.notes:
        doubts.append(Bullets(f.data.notes))
    if doubts:
        blocks.append(Fold("What is in doubt about these readings", tuple(doubts)))
    return Section("The measurements", tuple(blocks))


def idle_joints(f: Findings) -> tuple[str, ...]:
    """Joints whose springs no reading moves with."""
    seen = springs_seen(f.given, f.data)
    return tuple(name for name in f.given.robot.joint_names if name not in seen)


def _proportionality(f: Findings, levels: Array) -> str:
    size = f.data.deflection * 1e3
    rows = [np.isclose(f.data.loads_N, load) & ~np.isnan(size) for load in levels]
    means = [size[row].mean() / load * 1e3 for row, load in zip(rows, levels, strict=True)]
    listed = ", ".join(f"{mean:.2f} um/N at {load:g} N" for mean, load in zip(means, levels, strict=True))
    if max(means) < 1.05 * min(means):
        return f"Load and deflection are proportional within 5 %: {listed}."
    return (
        f"Load and deflection are not proportional: on average {listed}. The models below are linear and cannot "
        "explain this; friction, preload or backlash could."
    )


def first_model_section(f: Findings, r: RigidJoints) -> Section:
    """Flexible links with rigid joints against the readings."""
    simulated = np.abs(r.simulated_mm)
    factors = ", ".join(f"{factor:.0f} times in pose {pose}" for pose, factor in zip(r.pose, r.factor, strict=True))
    note = f"Where link sections are assumed, the factor is only an order of magnitude. {f.notes.first_model}".rstrip()
    return Section(
        "First model: flexible links, rigid joints",
        (
            Text(
                f"With rigid joints the {r.links} links alone deflect {simulated.min():.3f} to {simulated.max():.3f} "
                f"mm. The measured deflection is larger, {factors}: the joints, not the links, make the arm soft."
            ),
            Note(note),
        ),
        folded=True,
    )


def sensitivity_section(f: Findings, pictures: Pictures) -> Section:
    """Effects of the springs, ranked, for each load path."""
    figure = sensitivity_figure(f.effects, f.scheme.springs.ends)
    caption = f"Effect of each spring on {read_words(f.effects)} (mm): positive means that a stiffer spring lowers it."
    if len(f.effects) > 1:
        caption = f"{caption} {f.notes.effects}".rstrip()
    rankings = tuple(
        f"{path} load path, pose {e.pose}: {' > '.join(e.ranking)}"
        for path, effects in f.effects.items()
        for e in effects
    )
    return Section(
        "Sensitivity: which spring matters",
        (
            Text(
                f"Two-level full factorial of {', '.join(f.scheme.beside.sensitivity.joints)} between "
                f"{f.scheme.springs.low_Nm_per_rad:.0e} and {f.scheme.springs.high_Nm_per_rad:.0e} N m/rad. "
                "The deflection is a sum over the springs, so there are no interactions."
            ),
            pictures.add(figure, "sensitivity", caption),
            Bullets(rankings),
            *([Note(f.notes.ranking)] if f.notes.ranking else []),
        ),
        folded=True,
    )


def staged_section(f: Findings, pictures: Pictures) -> Section:
    """The published scheme, stage by stage, and its springs against angle."""
    blocks: list[Block] = [
        Text(
            "The published scheme varies the springs joint by joint on levels and refines about the best level until "
            "simulation and reading agree to within the gauge's resolution or a bound is hit. A bound that is hit is "
            "widened, and this is reported."
        )
    ]
    for variant in f.variants:
        if variant.found.studies:
            blocks += study_blocks(variant, pictures)
    blocks.append(Note(_LEAST_ROUGHNESS))
    return Section("Calibration in the published staged scheme", tuple(blocks), folded=True)


def comparison_section(f: Findings, pictures: Pictures) -> Section:
    """Which calibration is recommended and why; all variants side by side fold away."""
    held = f.held_out
    path = f.best.model.load_path
    mine = {v.name: v for v in f.variants if v.model.load_path == path}
    springs = {v.name: v.springs for v in f.variants if v.springs}
    others = [v for v in f.variants if v is not f.best.calibrated and np.isfinite(v.left_out_rms_mm)]
    beside = ", ".join(f"{v.left_out_rms_mm:.3f} mm ({v.name})" for v in others)
    text = (
        f"The recommended model, {f.best.name}, predicts poses that it has not seen best: "
        f"{f.best.left_out_rms_mm:.3f} mm RMS" + (f" against {beside}." if beside else ".")
    )
    caption = f"Measured and simulated deflection by pose ({path} load path), and residuals. Band: gauge resolution."
    stage = f.constant.stages[-1]
    more: list[Block] = [
        _variants_table(f),
        Bullets(sentences(held, f.best.beside_variants_mm)),
        *map(Note, doubt_sentences(f.constant.doubts)),
        Text(f"What {f.used.n} readings can and cannot identify ({f.constant.name} springs):"),
        *identified_blocks(f.constant, stage),
        Note(verdict(stage.result, f.scheme.noise.gauge_mm)[1]),
    ]
    return Section(
        "Which calibration to trust",
        (
            Text(text),
            pictures.add(_match_picture(mine, f.scheme.noise.gauge_mm, f"{path} load path"), "match", caption),
            pictures.add(
                intervals_figure(springs, "Constant springs from all poses at once", f.scheme.springs.ends),
                "springs",
                "Constant springs with 95 % intervals. Arrow to the right: the data do not exclude a rigid joint.",
            ),
            Fold("All calibrations side by side, and what the readings can identify", tuple(b for b in more if b)),
        ),
    )


def _variants_table(f: Findings) -> Table:
    held = f.held_out
    heads = ("variant", "parameters", "RMS (mm)", "left-out RMS (mm)", *(["held-out RMS (mm)"] if held else []))
    rows = []
    for v in f.variants:
        errors_mm = (v.found.rms_mm, v.left_out_rms_mm, *([held[v.name].rms_mm] if held else []))
        rows.append((v.name, _count(v), *(f"{error:.3f}" for error in errors_mm), _springs(v)))
    best = next((k for k, v in enumerate(f.variants) if v is f.best.calibrated), len(rows))
    if f.best.calibrated is None:
        of = f.best
        cells = (f"{error:.3f}" for error in (of.rms_mm, of.left_out_rms_mm, of.held_out_rms_mm) if error is not None)
        rows.append((of.name, "with the missing effects", *cells, f"in {f.looks[-1].stem}/model.toml"))
    return Table(
        "Variants side by side (highlighted: recommended). Left-out: each pose is predicted by a calibration that has "
        "not seen it; many parameters can fit well and predict badly",
        (*heads, "springs (1e6 N m/rad, 95 % interval)"),
        tuple(rows),
        text_columns=(0, 1, len(heads)),
        best=best,
    )


def _match_picture(variants: Mapping[str, Calibrated], gauge_mm: float, of: str) -> Figure:
    """Variants with the same readings: each reading's translation along the measured one."""
    first = next(iter(variants.values()))
    system = first.found.overall
    linear = np.flatnonzero(system.component < 3)
    of_row = np.unique(system.row[linear], return_inverse=True)[1]
    read = first.measured_mm[linear]
    size = np.sqrt(np.bincount(of_row, read**2))

    def along(values_mm: Array) -> Array:
        return np.asarray(np.bincount(of_row, read * values_mm[linear]) / np.maximum(size, 1e-12))

    of_reading = linear[np.unique(of_row, return_index=True)[1]]
    poses = [first.pose[k] for k in of_reading]
    simulated = {name: along(v.predicted_mm) for name, v in variants.items()}
    heading = f"Measured and simulated deflection by pose, {of}"
    if len(poses) > MOST_COLUMNS:
        poses, kept = _by_pose(poses, first.data.loads_N[system.row[of_reading]])
        size, simulated = kept @ size, {name: kept @ values for name, values in simulated.items()}
        heading += "; means under each pose's largest load"
    return match_figure(poses, size, simulated, gauge_mm, heading, axis_words(first.data))


def _by_pose(poses: Sequence[str], load: Array) -> tuple[list[str], Array]:
    """Labels of the poses (p,), and weights (p, n) of the means over the readings under each one's largest load."""
    groups = rows_of(poses)
    weight = np.zeros((len(groups), len(poses)))
    for k, rows in enumerate(groups.values()):
        top = rows[load[rows] > 0.99 * load[rows].max()]
        weight[k, top] = 1.0 / len(top)
    return list(groups), weight


def _count(v: Calibrated) -> str:
    n = v.found.count
    return f"{n.free} ({n.identified} identified, {n.at_bound} at a bound)"


def _springs(v: Calibrated) -> str:
    """Constant springs with their intervals."""
    if v.found.studies:
        return "depend on angle (see the figure above)"
    return "; ".join(f"{e.parameter.place} {estimate_text(e)}" for e in v.springs)
