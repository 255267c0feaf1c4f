"""The report's story, in order: data, first model, sensitivity, calibration, comparison, surrogate, maps."""

from __future__ import annotations

import datetime as dt
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from doe import PoseFit, SpringEstimate
from robots.schema import Quantity
from stiffarm import __version__
from stiffarm import figures_calibration as fc
from stiffarm import figures_surrogate as fs
from stiffarm.outputs import OutputFolder
from stiffarm.picture_style import save_png
from stiffarm.report import Block, Bullets, KeyFigure, Note, Picture, Section, Table, Text, render
from stiffarm.steps import Variant
from stiffarm.workflow import Findings
from surrogate.main_effects import main_effects


class _Pictures:
    """Saves figures into the output folder and hands them to the report."""

    def __init__(self, folder: OutputFolder) -> None:
        self._folder = folder

    def add(self, figure: Figure, name: str, caption: str) -> Picture:
        path = self._folder.path(f"figures/{name}.png")
        save_png(figure, path)
        return Picture(path, caption, name.replace("_", " "))


def write_report(findings: Findings, drawn: dict[str, Any], folder: OutputFolder) -> None:
    """Draw all figures and write report.html."""
    pictures = _Pictures(folder)
    sections = [
        _data(findings, pictures),
        _first_model(findings, pictures),
        _sensitivity(findings, pictures),
        _staged(findings, pictures),
        _comparison(findings, pictures),
        _budget(findings, pictures),
        _effects(findings, pictures),
        _surrogate(findings, pictures),
        _maps(findings, drawn, folder),
        _assumptions(findings),
    ]
    best, error = findings.best, findings.surrogate.errors
    key = [
        KeyFigure(
            f"{np.median(findings.rigid.factor):.0f} times",
            "measured over simulated deflection with rigid joints (median)",
        ),
        KeyFigure(
            f"{best.rms_mm:.3f} mm",
            f"RMS of the recommended model ({best.name} springs) on {len(best.system)} readings",
        ),
        KeyFigure(f"{best.left_out.rms_mm:.3f} mm", "RMS when it predicts poses it has not seen"),
        KeyFigure(
            f"{_percent(error.rms_relative)} / {_percent(error.max_relative)}",
            "held-out error of the surrogate, RMS / worst",
        ),
    ]
    lede = (
        f"{len(findings.data.pose_groups())} measured poses, {len(findings.variants)} calibrated variants, one surrogate and "
        f"one map. Recommended is the variant that best predicts poses left out of its fit: {best.name} springs."
    )
    footer = (
        f"stiffarm {__version__}, {dt.datetime.now(dt.UTC):%Y-%m-%d %H:%M} UTC, data {findings.data.source} "
        f"(SHA-256 {findings.data.sha256[:12]}...), seed {findings.seed}. Versions, command and timings: run.json."
    )
    folder.write_text("report.html", render(findings.given.description.title, lede, key, sections, footer))


def _percent(value: float) -> str:
    return f"{value * 100:.2g} %" if value >= 1e-6 else f"{value:.0e}"


def _mega(value: float) -> str:
    return "rigid" if not np.isfinite(value) else f"{value / 1e6:.3g}"


def _data(f: Findings, pictures: _Pictures) -> Section:
    loads = ", ".join(f"{v:g}" for v in np.unique(np.round(f.data.loads_N, 6)))
    used = ", ".join(f"{v:g} N" for v in f.scheme.loads_N) or "all loads"
    blocks: list[Block] = [
        Text(
            f"{f.data.n} readings at {len(f.data.pose_groups())} poses under {loads} N. Calibration uses {used}, as the scheme says."
        ),
    ]
    doubts = _doubts(f)
    figure = fc.data_figure(
        f.data,
        excluded_loads_N=[
            v
            for v in np.unique(f.data.loads_N)
            if f.scheme.loads_N and not np.isclose(v, f.scheme.loads_N, rtol=0.01).any()
        ],
        doubts=doubts,
        families=fc.wrist_families(f.data, f.given.robot),
    )
    blocks.append(
        pictures.add(
            figure,
            "measured",
            "Measured deflection by pose and load. Pale bars were not used; hatched ones are in doubt. The middle straight pose deflects least at every load.",
        )
    )
    per_newton = [
        f"{load:g} N: {np.abs(f.data.displacement[np.isclose(f.data.loads_N, load), 2]).mean() / load * 1e6:.2f} um/N"
        for load in np.unique(np.round(f.data.loads_N, 6))
    ]
    if len(per_newton) > 1:
        blocks.append(
            Note(
                "Load and deflection are not proportional: the mean deflection per newton is "
                + ", ".join(per_newton)
                + ". The models below are linear and say nothing about that."
            )
        )
    if doubts:
        blocks.append(Note(" ".join(d.note for d in doubts)))
    blocks.append(Bullets(f.data.notes))
    return Section("The measurements", tuple(blocks))


def _doubts(f: Findings) -> tuple[fc.Doubt, ...]:
    """Doubts about the bundled XR701 readings (doe/data/xr701_gotlih.md); other data carry none here."""
    from stiffarm.steps import bundled_sha256

    if f.data.sha256 != bundled_sha256(f.given.robot.name):
        return ()
    return (
        fc.Doubt(
            ("3", "4"),
            (375.0,),
            "Poses 3 and 4 at 375 N look like outliers (about 1.0 mm would be expected), and may be swapped with each other.",
        ),
        fc.Doubt(("39", "40"), (375.0,), "Poses 39 and 40 at 375 N may be swapped with each other."),
        fc.Doubt(
            ("3", "4", "39", "40"),
            (650.0,),
            "At 650 N the pairs 3/4 and 39/40 may be swapped within each pair: the published chart labels lost their order.",
        ),
    )


def _first_model(f: Findings, pictures: _Pictures) -> Section:
    r = f.rigid
    figure = fc.rigid_joint_figure(
        r.pose, r.measured_mm, {f"{f.given.model.link_kind} links, rigid joints": r.simulated_mm}
    )
    low, high = np.min(r.factor), np.max(r.factor)
    return Section(
        "First model: flexible links, rigid joints",
        (
            Text(
                f"With rigid joints the links alone give {np.abs(r.simulated_mm).min():.3f} to {np.abs(r.simulated_mm).max():.3f} mm. "
                f"Measured is {low:.0f} to {high:.0f} times more: the joints, not the links, make the arm soft."
            ),
            pictures.add(
                figure,
                "rigid_joints",
                "Measured deflection against the model with rigid joints; note the logarithmic axis.",
            ),
            Note(
                "The sections of the links are assumed, so the factor is an order of magnitude. The paper's text gives 10^5 for its own shell model; the deflections printed in its Table 1 make it about 10^4."
            ),
        ),
    )


def _sensitivity(f: Findings, pictures: _Pictures) -> Section:
    figure = fc.sensitivity_figure(f.effects, (f.scheme.low_Nm_per_rad, f.scheme.high_Nm_per_rad))
    rankings = tuple(
        f"{path} load path, pose {e.pose}: {' > '.join(e.ranking)}"
        for path, effects in f.effects.items()
        for e in effects
    )
    return Section(
        "Sensitivity: which spring matters",
        (
            Text(
                f"Two-level full factorial of {', '.join(f.scheme.sensitivity.joints)} between {f.scheme.low_Nm_per_rad:.0e} and "
                f"{f.scheme.high_Nm_per_rad:.0e} N m/rad. Deflection is a sum over springs, so there are no interactions."
            ),
            pictures.add(
                figure,
                "sensitivity",
                "Effect of each spring on dz (mm): positive means a stiffer spring lifts the tool. With the parallelogram, joint 2 feels only the load times the upper arm's horizontal reach, so its effect all but vanishes where the upper arm is vertical.",
            ),
            Bullets(rankings),
        ),
    )


def _staged(f: Findings, pictures: _Pictures) -> Section:
    blocks: list[Block] = [
        Text(
            "The published scheme: parametric studies joint by joint on levels, refined about the best level until the match is inside the gauge's digit or a bound is hit. A bound that is hit is widened and said so."
        ),
    ]
    for variant in f.variants:
        if variant.staged is None:
            continue
        result = variant.staged
        rows = tuple(_stage_row(stage, fit) for stage, fits in result.fits.items() for fit in fits)
        path = variant.model.load_path
        blocks.append(
            Table(
                f"Staged scheme, {path} load path: {variant.parameters} spring values, RMS {variant.rms_mm:.3f} mm",
                (
                    "stage",
                    "pose",
                    "springs (1e6 N m/rad)",
                    "error (mm)",
                    "runs",
                    "would match as well (1e6 N m/rad)",
                ),
                rows,
                text_columns=(0, 2, 5),
            )
        )
        figure = fs.response_surface_figure(result.laws, result.points, f.given.robot)
        blocks.append(
            pictures.add(
                figure,
                f"springs_against_angle_{path}",
                f"{path.capitalize()} load path: sixth-degree regression of each spring. Filled points were calibrated, hollow ones mirrored, grey ones held at the start value during an earlier stage.",
            )
        )
        unmatched = tuple(r for r in variant.remarks if "not matched" in r or "bound" in r)
        if unmatched:
            blocks.append(Bullets(unmatched))
    blocks.append(
        Note(
            "Three distinct angles cannot fix the seven coefficients of a sixth degree. The rest is decided by least roughness: ln k is a polynomial through the points whose coefficients, weighted by (1 + degree)^2, are smallest. So the springs stay positive and add no bumps that no point asks for. Two springs matched to one reading form a valley; the choice in it leans to the starting value and is not information from the data."
        )
    )
    return Section("Calibration in the published staged scheme", tuple(blocks))


def _stage_row(stage: str, fit: PoseFit) -> tuple[str, ...]:
    springs = ", ".join(f"{j} {_mega(k)}" for j, k in zip(fit.joints, fit.stiffness, strict=True))
    ranges = ", ".join(
        f"{j} {_mega(a)} to {_mega(b)}" if np.isfinite(a) else f"{j}: nothing matches"
        for j, (a, b) in zip(fit.joints, fit.equivalent, strict=True)
    )
    return stage, fit.pose, springs, f"{fit.error_mm:+.3f}", str(fit.runs), ranges


def _comparison(f: Findings, pictures: _Pictures) -> Section:
    rows = tuple(
        (v.name, str(v.parameters), f"{v.rms_mm:.3f}", f"{v.left_out.rms_mm:.3f}", _springs_text(v))
        for v in f.variants
    )
    first = f.variants[0]
    vertical = first.system.component == 2
    poses = tuple(np.array(first.system.pose, dtype=object)[vertical])
    simulated = {v.name: v.predicted_mm[vertical] for v in f.variants}
    constant: dict[str, tuple[SpringEstimate, ...]] = {v.model.load_path: v.constant.springs for v in f.variants if v.constant is not None}
    best_index = list(f.variants).index(f.best)
    blocks: list[Block] = [
        Text(
            "The same readings, four ways: the published scheme and constant springs fitted to all readings at once by bounded least squares, each with both load paths."
            if len(f.variants) == 4
            else "The same readings, the published scheme and constant springs fitted to all readings at once."
        ),
        Table(
            "Variants side by side",
            (
                "variant",
                "parameters",
                "RMS (mm)",
                "left-out RMS (mm)",
                "springs (1e6 N m/rad, 95 % interval)",
            ),
            rows,
            text_columns=(0, 4),
            best=best_index,
        ),
        pictures.add(
            fc.comparison_figure(
                [fc.VariantRow(v.name, v.parameters, v.rms_mm, v.left_out.rms_mm) for v in f.variants]
            ),
            "comparison",
            "Fit and prediction. Left-out: each pose is predicted by a calibration that has not seen it. Many parameters fit well and predict badly.",
        ),
        pictures.add(
            fc.match_figure(poses, first.system.value[vertical] * 1e3, simulated, f.scheme.gauge_mm),
            "match",
            "Measured and simulated deflection by pose, and the residuals with the gauge's digit as a band.",
        ),
        pictures.add(
            fc.springs_figure(constant, (f.scheme.low_Nm_per_rad, f.scheme.high_Nm_per_rad)),
            "springs",
            "Constant springs with their 95 % intervals. An arrow means that the data do not exclude a rigid joint.",
        ),
        Note(_identifiability(f)),
    ]
    return Section("Which calibration to trust", tuple(blocks))


def _springs_text(v: Variant) -> str:
    if v.constant is None:
        return "depend on angle (see the figure above)"
    out = []
    for s in v.constant.springs:
        low, high = s.interval
        if s.status == "not identified":
            out.append(f"{s.joint}: not determined")
        elif s.status == "at bound":
            out.append(f"{s.joint} at least {_mega(low)} (rigid fits best)")
        else:
            upper = "no upper limit" if np.isinf(high) else _mega(high)
            out.append(f"{s.joint} {_mega(s.stiffness)} ({_mega(low)} to {upper})")
    return "; ".join(out)


def _identifiability(f: Findings) -> str:
    constant = f.best.constant or next(v.constant for v in f.variants if v.constant is not None)
    known = [s.joint for s in constant.springs if s.status == "determined"]
    half = [s.joint for s in constant.springs if s.status in ("one-sided", "at bound")]
    text = f"What {len(f.best.system)} readings can tell: "
    text += (
        f"{', '.join(known)} are determined both ways. " if known else "no spring is determined both ways. "
    )
    if half:
        text += f"For {', '.join(half)} there is only a lower limit: the data do not exclude that these joints are rigid. "
    rest = [j for j in f.given.robot.joint_names if j not in f.scheme.constant.joints]
    if rest:
        text += f"{', '.join(rest)} carry no torque under this load and were held rigid. "
    sigma = constant.sigma_m * 1e3
    return text + (
        f"The residual standard deviation is {sigma:.3f} mm, {sigma / f.scheme.gauge_mm:.0f} times the gauge's digit, so something beyond "
        "constant springs is left in these readings; intervals are from this residual, not from the gauge."
    )


def _budget(f: Findings, pictures: _Pictures) -> Section:
    figure = fs.budget_figure(f.budget_mm, f.budget_poses)
    return Section(
        "Where the compliance comes from",
        (
            Text(f"Each part's share in the vertical deflection of the recommended model ({f.best.name})."),
            pictures.add(
                figure,
                "budget",
                "Compliance budget by pose. The arm is statically determinate, so the shares add up exactly. Link shares rest on assumed sections.",
            ),
        ),
    )


def _effects(f: Findings, pictures: _Pictures) -> Section:
    blocks: list[Block] = [
        Text(
            f"{len(next(iter(f.factorial.values())).poses_deg)} runs of the adjusted full factorial. Levels of q3real change with q2 because the parallelogram does not reach them all, so the design is not orthogonal and main effects mix a little."
        )
    ]
    for name, runs in f.factorial.items():
        effects = main_effects(runs.poses_deg, runs.stiffness_N_per_mm, runs.inputs)
        blocks.append(
            pictures.add(
                fs.main_effects_figure(effects),
                f"main_effects_{'_'.join(name.replace(',', ' ').split())}",
                f"{name.capitalize()}: largest, mean and smallest normalised stiffness at each level (1 = {runs.stiffness_N_per_mm.max():.0f} N/mm)."
                + (" Recommended model." if name == f.best.name else " The paper's scheme."),
            )
        )
    return Section("Main effects of the joint angles", tuple(blocks))


def _surrogate(f: Findings, pictures: _Pictures) -> Section:
    blocks: list[Block] = [
        Text(
            f"A surrogate answers the structural stiffness (vertical load) from {', '.join(f.scheme.factorial.inputs)} without the FE model. Errors below are relative errors of compliance on runs the fit has not seen, a quarter of them on the boundary of the domain, where polynomials are worst."
        ),
    ]
    rows = tuple(
        (
            name,
            f"{s.errors.basis} {s.errors.degree}",
            s.target,
            str(s.errors.n_terms),
            _percent(s.errors.rms_relative),
            _percent(s.errors.p95_relative),
            _percent(s.errors.max_relative),
        )
        for name, t in f.trained.items()
        for s in t.surrogates
    )
    blocks.append(
        Table(
            "Held-out relative error",
            ("model", "basis", "fitted", "terms", "RMS", "95 %", "worst"),
            rows,
            text_columns=(0, 1, 2),
            best=0,
        )
    )
    trained = f.trained[f.best.name]
    true = 1e-3 / trained.held_out.compliance
    figure = fs.surrogate_quality_figure([fs.HeldOut(name, true, 1e-3 / c) for name, c in trained.predicted.items()])
    blocks.append(
        pictures.add(
            figure,
            "surrogate_quality",
            "Predicted against true stiffness on held-out runs of the recommended model, and the distribution of the relative error.",
        )
    )
    labels, learned, exact = f.pose_check
    blocks.append(
        Table(
            "The measured poses",
            (
                "pose",
                "surrogate (N/mm)",
                "model (N/mm)",
                "relative difference",
                "within the stated worst error",
            ),
            tuple(
                (
                    p,
                    f"{a:.2f}",
                    f"{b:.2f}",
                    f"{a / b - 1.0:+.1e}",
                    "yes" if abs(b / a - 1.0) <= max(trained.best.errors.max_relative, 1e-12) else "NO",
                )
                for p, a, b in zip(labels, learned, exact, strict=True)
            ),
        )
    )
    blocks.append(
        Note(
            "Outside the fitted joint ranges, or where the parallelogram cannot go, the surrogate refuses unless told otherwise (--extrapolate), and then flags the answer."
        )
    )
    return Section("The surrogate and its error", tuple(blocks))


def _maps(f: Findings, drawn: dict[str, Any], folder: OutputFolder) -> Section:
    k = drawn["stiffness_N_per_mm"]
    captions = {
        "oblique": "Every end-effector position of the sweep with its structural stiffness; warm and bright is stiff. Points on the viewer's side of the robot's plane are left out.",
        "side": "The same map along Y, onto the XZ cross-section.",
    }
    blocks: list[Block] = [
        Text(
            f"{drawn['points']} poses swept over q2, q3real and q5, with q4 moving the tool out of the plane. Stiffness runs from {k['min']:.0f} to {k['max']:.0f} N/mm, median {k['median']:.0f} N/mm."
            if f.given.robot.name == "xr701"
            else f"{drawn['points']} poses. Stiffness runs from {k['min']:.0f} to {k['max']:.0f} N/mm, median {k['median']:.0f} N/mm."
        ),
    ]
    for name in drawn["files"]:
        if name.endswith(".png"):
            view = name.removesuffix(".png").rsplit("_", 1)[-1]
            blocks.append(Picture(folder.path(name), captions[view], f"stiffness map, {view} view"))
    blocks.append(
        Text(
            "stiffness_map.vtu opens in ParaView; array names carry their units and the README documents them."
        )
    )
    return Section("The stiffness map", tuple(blocks))


def _assumptions(f: Findings) -> Section:
    rows = tuple(_figures(f.given.description, ""))
    assumed = sum("assumed" in r[2] for r in rows)
    sources = tuple(f"{key}: {text}" for key, text in f.given.description.sources.items())
    return Section(
        "Assumptions and sources",
        (
            Note(
                f"{assumed} of {len(rows)} figures of the robot's description are assumed, most of them geometry and sections that were never published. Calibrated springs absorb part of such errors; absolute link shares do not."
            ),
            Bullets(f.given.description.notes),
            Bullets(sources),
            Table(
                "Every figure of the model with its source",
                ("figure", "value", "source", "note"),
                rows,
                text_columns=(0, 1, 2, 3),
                folded=True,
            ),
        ),
    )


def _figures(node: Any, place: str) -> list[tuple[str, str, str, str]]:
    """All quantities of a description, with their place in the file."""
    if isinstance(node, Quantity):
        source = "assumed" if node.source in ("assumed", "class") else node.source
        return [(place, f"{node.value} {node.unit}", source, node.note or "")]
    out: list[tuple[str, str, str, str]] = []
    if isinstance(node, tuple):
        for i, child in enumerate(node):
            out += _figures(child, f"{place}[{getattr(child, 'name', i)}]")
    elif hasattr(type(node), "model_fields"):
        for name in type(node).model_fields:
            out += _figures(getattr(node, name), f"{place}.{name}" if place else name)
    elif isinstance(node, dict):
        for name, child in node.items():
            out += _figures(child, f"{place}.{name}")
    return out
