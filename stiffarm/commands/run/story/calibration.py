"""The report's first half: data, first model, sensitivity, calibration, comparison."""

from __future__ import annotations

import numpy as np

from robots.arrays import Array
from stiffarm.commands.calibrate.figures import springs as figures_springs
from stiffarm.commands.calibrate.step import Calibrated
from stiffarm.commands.calibrate.study_section import study_blocks
from stiffarm.commands.run.figures import match as figures_match
from stiffarm.commands.run.figures import readings as figures_data
from stiffarm.commands.run.figures.readings import Doubt
from stiffarm.commands.run.findings import Findings
from stiffarm.commands.run.held_out import sentences
from stiffarm.commands.run.story.words import is_published_data, springs_text
from stiffarm.commands.sensitivity.figures.factorial import sensitivity_figure
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Bullets, Note, Section, Table, Text
from stiffarm.session.spring_words import SpringEstimate, bound_of

_DOUBTS = (
    Doubt(("3", "4"), (375.0,), "outliers? (about 1.0 mm expected)"),
    Doubt(("39", "40"), (375.0,), "39 and 40 may be swapped"),
    Doubt(("3", "4", "39", "40"), (650.0,), "3/4 and 39/40 may be swapped"),
)
_DOUBTS_TEXT = (
    "The published chart's labels lost their order. At 375 N and 650 N the readings of poses 3 and 4, and of "
    "39 and 40, may be swapped within each pair (they differ by at most 0.03 mm). Poses 3 and 4 at 375 N "
    "look like outliers: about 1.0 mm would be expected from the other loads."
)
_PUBLISHED_RANKING = (
    "The paper finds joint 2 dominant at all three poses, then joints 3 and 5, and joint 4 almost without "
    "effect. The serial load path gives that order at poses 41 and 77; at pose 5 joint 3 leads, with the "
    "assumed geometry. With the parallelogram joint 3 leads everywhere."
)
_LEAST_ROUGHNESS = (
    "Three distinct angles cannot fix the seven coefficients of a sixth degree. The rest is decided by least "
    "roughness: ln k is the polynomial through the points whose coefficients, weighted by (1 + degree)^2, "
    "are smallest. So the springs stay positive and show no bump that no point asks for. Two springs matched "
    "to one reading form a valley; the choice in it leans to the starting value and is not information from "
    "the data."
)


def data_section(f: Findings, pictures: Pictures) -> Section:
    """What was measured, what is in doubt, what is used."""
    levels = np.unique(np.round(f.data.loads_N, 6))
    unused = [v for v in levels if f.scheme.loads_N and not np.isclose(v, f.scheme.loads_N, rtol=0.01).any()]
    used = ", ".join(f"{v:g} N" for v in f.scheme.loads_N) or "all loads"
    published = is_published_data(f)
    figure = figures_data.data_figure(
        f.data,
        excluded_loads_N=unused,
        doubts=_DOUBTS if published else (),
        families=figures_data.wrist_families(f.data, f.given.robot),
    )
    caption = "Measured deflection by pose and load. Pale bars were not used; hatched ones are in doubt."
    if published:
        caption += " Of the three straight-wrist poses the middle one (41) deflects least at every load."
    blocks: list[Block] = [
        Text(
            f"{f.data.n} readings at {len(f.data.pose_groups())} poses under "
            f"{', '.join(f'{v:g}' for v in levels)} N. Calibration uses {used}, as the scheme says."
        ),
        pictures.add(figure, "measured", caption),
    ]
    if len(levels) > 1:
        blocks.append(Note(_proportionality(f, levels)))
    if published:
        blocks.append(Note(_DOUBTS_TEXT))
    blocks.append(Bullets(f.data.notes))
    return Section("The measurements", tuple(blocks))


def _proportionality(f: Findings, levels: Array) -> str:
    rows = [np.isclose(f.data.loads_N, load) & f.data.used[:, 2] for load in levels]
    means = [np.abs(f.data.displacement[row, 2]).mean() / load * 1e6 for row, load in zip(rows, levels, strict=True)]
    listed = ", ".join(f"{mean:.2f} um/N at {load:g} N" for mean, load in zip(means, levels, strict=True))
    if max(means) < 1.05 * min(means):
        return f"Load and deflection are proportional within 5 %: {listed}."
    return (
        f"Load and deflection are not proportional: on average {listed}. The models below are linear and "
        "cannot say why (friction, preload or backlash would do it)."
    )


def first_model_section(f: Findings, pictures: Pictures) -> Section:
    """Flexible links with rigid joints against the readings."""
    r = f.rigid
    name = f"{r.links} links, rigid joints"
    figure = figures_match.rigid_joint_figure(r.pose, r.measured_mm, {name: r.simulated_mm})
    simulated = np.abs(r.simulated_mm)
    note = "Where sections of links are assumed, the factor is an order of magnitude."
    if is_published_data(f):
        note += (
            " The paper's text gives 10^5 for its own shell model; the deflections printed in its Table 1 make "
            "it about 10^4."
        )
    return Section(
        "First model: flexible links, rigid joints",
        (
            Text(
                f"With rigid joints the links alone give {simulated.min():.3f} to {simulated.max():.3f} mm. "
                f"Measured is {np.min(r.factor):.0f} to {np.max(r.factor):.0f} times more: the joints, not "
                "the links, make the arm soft."
            ),
            pictures.add(
                figure,
                "rigid_joints",
                "Measured deflection against the model with rigid joints; logarithmic axis.",
            ),
            Note(note),
        ),
    )


def sensitivity_section(f: Findings, pictures: Pictures) -> Section:
    """Effects of the springs, ranked, for each load path."""
    figure = sensitivity_figure(f.effects, f.scheme.springs.ends)
    caption = "Effect of each spring on dz (mm): positive means that the tool sags less with a stiffer spring."
    if len(f.effects) > 1:
        caption += (
            " With the parallelogram, joint 2 feels only the load times the upper arm's horizontal reach, so "
            "its effect all but vanishes where the upper arm is vertical."
        )
    remarks: list[Block] = []
    if is_published_data(f):
        remarks.append(Note(_PUBLISHED_RANKING))
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
                "Deflection is a sum over springs, so there are no interactions."
            ),
            pictures.add(figure, "sensitivity", caption),
            Bullets(rankings),
            *remarks,
        ),
    )


def staged_section(f: Findings, pictures: Pictures) -> Section:
    """The published scheme, stage by stage, and its springs against angle."""
    blocks: list[Block] = [
        Text(
            "The published scheme: parametric studies joint by joint on levels, refined about the best level "
            "until the match is inside the gauge's digit or a bound is hit. A bound that is hit is widened, "
            "and said so."
        )
    ]
    for variant in f.variants:
        if not variant.found.studies:
            continue
        blocks += study_blocks(variant, pictures)
    blocks.append(Note(_LEAST_ROUGHNESS))
    return Section("Calibration in the published staged scheme", tuple(blocks))


def comparison_section(f: Findings, pictures: Pictures) -> Section:
    """All variants side by side: parameters, fit, prediction, springs."""
    rows = tuple(
        (v.name, _count(v), f"{v.found.rms_mm:.3f}", f"{v.left_out_rms_mm:.3f}", *_held_out(f, v), springs_text(v))
        for v in f.variants
    )
    bars = [figures_match.VariantRow(v.name, v.found.count.free, v.found.rms_mm, v.left_out_rms_mm) for v in f.variants]
    first = f.variants[0]
    vertical = first.component == 2
    match = figures_match.match_figure(
        tuple(str(p) for p in np.array(first.pose)[vertical]),
        first.measured_mm[vertical],
        {v.name: v.predicted_mm[vertical] for v in f.variants},
        f.scheme.noise.gauge_mm,
    )
    constant: dict[str, tuple[SpringEstimate, ...]] = {
        f"load path: {v.model.load_path}": v.springs for v in f.variants if not v.found.studies
    }
    springs = figures_springs.springs_figure(constant, f.scheme.springs.ends)
    return Section(
        "Which calibration to trust",
        (
            Text(
                "The published scheme beside the plain alternative, constant springs fitted to all readings at "
                "once by bounded least squares, for each load path the robot can have."
            ),
            Table(
                "Variants side by side (highlighted: recommended)",
                (
                    "variant",
                    "parameters",
                    "RMS (mm)",
                    "left-out RMS (mm)",
                    *(() if f.held_out is None else ("held-out RMS (mm)",)),
                    "springs (1e6 N m/rad, 95 % interval)",
                ),
                rows,
                text_columns=(0, 4 if f.held_out is None else 5),
                best=list(f.variants).index(f.best),
            ),
            *(() if f.held_out is None else (Bullets(sentences(f.held_out)),)),
            pictures.add(
                figures_match.comparison_figure(bars),
                "comparison",
                "Fit and prediction. Left-out: each pose is predicted by a calibration that has not seen it. "
                "A variant with many parameters can fit well and predict badly.",
            ),
            pictures.add(
                match,
                "match",
                "Measured and simulated deflection by pose, and the residuals with the gauge's digit as a band.",
            ),
            pictures.add(
                springs,
                "springs",
                "Constant springs with 95 % intervals. Arrow to the right: the data do not exclude a rigid joint.",
            ),
            Note(_identifiability(f)),
        ),
    )


def _count(v: Calibrated) -> str:
    n = v.found.count
    return f"{n.free} ({n.identified} identified, {n.at_bound} at a bound)"


def _held_out(f: Findings, v: Calibrated) -> tuple[str, ...]:
    return () if f.held_out is None else (f"{f.held_out.rms_mm[v.name]:.3f}",)


def _identifiability(f: Findings) -> str:
    """What the readings can and cannot tell about constant springs, in words."""
    constant = f.best if not f.best.found.studies else next(v for v in f.variants if not v.found.studies)
    known = [s.joint for s in constant.springs if s.status == "determined"]
    half = [s.joint for s in constant.springs if s.status == "one-sided" or bound_of(s) == "rigid"]
    soft = [s.joint for s in constant.springs if bound_of(s) == "soft"]
    text = f"What {len(f.best.found.overall)} readings can tell: "
    text += f"{', '.join(known)} determined, with both limits. " if known else "no spring has both limits. "
    if half:
        text += (
            f"For {', '.join(half)} there is only a lower limit: the data do not exclude that these joints are rigid. "
        )
    if soft:
        text += (
            f"The fit drives {', '.join(soft)} to the soft bound: the model is too stiff in a way that these springs "
            "are made to stand for. "
        )
    rest = [j for j in f.given.robot.joint_names if j not in f.scheme.beside.constant.joints]
    if rest:
        text += f"{', '.join(rest)} are not in the scheme and were held as the model has them. "
    e = constant.found.stages[-1].estimate
    sigma = e.noise.white[0] * 1e3 if len(e.problem) > e.seen.sum() else np.nan
    if not np.isfinite(sigma):
        return text + "There are no spare readings, so no uncertainty can be given."
    return text + (
        f"The residual standard deviation is {sigma:.3f} mm, {sigma / f.scheme.noise.gauge_mm:.0f} times the gauge's "
        "digit"
        + (
            ", so something beyond constant springs is left in these readings"
            if sigma > 2.0 * f.scheme.noise.gauge_mm
            else ""
        )
        + "; the intervals are from this residual, not from the gauge."
    )
