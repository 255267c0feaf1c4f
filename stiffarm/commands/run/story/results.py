"""The report's second half: compliance budget, main effects, surrogate, maps, assumptions."""

from __future__ import annotations

from typing import Any

from robots.schema.quantities import Quantity
from stiffarm.commands.fit.figures import effects as fs
from stiffarm.commands.run.figures.budget import budget_figure
from stiffarm.commands.run.findings import Findings, slug
from stiffarm.commands.run.story.budget import budget_blocks
from stiffarm.pages.blocks import Pictures, percent
from stiffarm.pages.report import Block, Bullets, Note, Picture, Section, Table, Text
from surrogate import default_sweep
from surrogate.main_effects import main_effects


def budget_section(f: Findings, pictures: Pictures) -> Section:
    """Each part's share in the deflection."""
    figure = budget_figure(f.budget_mm, f.budget_poses)
    return Section(
        "Where the compliance comes from",
        (
            Text(f"Each part's share in the vertical deflection of the recommended model ({f.best.name})."),
            pictures.add(
                figure,
                "budget",
                "Compliance budget by pose. The arm is statically determinate, so the shares add up exactly. "
                "Link shares rest on assumed sections.",
            ),
            *budget_blocks(f, pictures),
        ),
    )


def effects_section(f: Findings, pictures: Pictures) -> Section:
    """Main effects over the factorial."""
    count = len(next(iter(f.factorial.values())).poses_deg)
    text = f"{count} runs of the full factorial of {', '.join(f.scheme.beside.factorial.inputs)}."
    if f.scheme.beside.factorial.adjust:
        text += (
            " Some levels are adjusted because the robot cannot reach every combination, so the design is not "
            "orthogonal and main effects mix a little."
        )
    blocks: list[Block] = [Text(text)]
    for name, runs in f.factorial.items():
        effects = main_effects(runs.poses_deg, runs.stiffness_N_per_mm, runs.inputs)
        role = "recommended model" if name == f.best.name else "the published scheme"
        caption = (
            f"{name.capitalize()} ({role}): largest, mean and smallest normalised stiffness at each level "
            f"(1 = {runs.stiffness_N_per_mm.max():.0f} N/mm)."
        )
        if f.published.name == name:
            caption += (
                " Angle-dependent springs are interpolated between few poses; extremes far from them are not data."
            )
        blocks.append(pictures.add(fs.main_effects_figure(effects), f"main_effects_{slug(name)}", caption))
    return Section("Main effects of the joint angles", tuple(blocks))


def surrogate_section(f: Findings, pictures: Pictures) -> Section:
    """Held-out errors of every basis, and the measured poses."""
    trained = f.trained[f.best.name]
    true = 1e-3 / trained.held_out.value
    figure = fs.surrogate_quality_figure([fs.HeldOut(name, true, 1e-3 / c) for name, c in trained.predicted.items()])
    return Section(
        "The surrogate and its error",
        (
            Text(
                "A surrogate answers the structural stiffness under a vertical load from "
                f"{', '.join(f.scheme.beside.factorial.inputs)} without the FE model. Errors are relative errors of "
                "compliance on runs that neither the fit nor its error bars have seen; some lie on the boundary of the "
                "domain, where polynomials are worst, and the interior columns leave those out. The last column is "
                "the share of the interior ones inside their 95 % error bars."
            ),
            _error_table(f),
            pictures.add(
                figure,
                "surrogate_quality",
                "Predicted against true stiffness on held-out runs of the recommended model, and how large "
                "the errors are.",
            ),
            _measured_poses(f),
            Note(
                "Outside the fitted joint ranges, or where the robot cannot go, the surrogate flags the pose and gives "
                "no value unless told otherwise (--extrapolate)."
            ),
        ),
    )


def _error_table(f: Findings) -> Table:
    rows = tuple(
        (
            name,
            f"{s.errors.basis} {s.errors.degree}",
            s.target,
            str(s.errors.n_terms),
            percent(s.errors.rms_relative),
            percent(s.errors.p95_relative),
            percent(s.errors.max_relative),
            percent(s.errors.rms_interior),
            percent(s.errors.max_interior),
            f"{100.0 * s.errors.coverage95:.1f} %",
        )
        for name, t in f.trained.items()
        for s in t.surrogates
    )
    columns = (
        "model",
        "basis",
        "fitted",
        "terms",
        "RMS",
        "95 %",
        "worst",
        "RMS, interior",
        "worst, interior",
        "inside 95 % bars",
    )
    return Table("Held-out relative error (highlighted: surrogate.json)", columns, rows, text_columns=(0, 1, 2), best=0)


def _measured_poses(f: Findings) -> Table:
    worst = f.surrogate.errors.max_relative
    rows = tuple(
        (
            pose,
            f"{learned:.2f}",
            f"{exact:.2f}",
            f"{learned / exact - 1.0:+.1e}",
            "yes" if abs(exact / learned - 1.0) <= max(worst, 1e-12) else "NO",
        )
        for pose, learned, exact in zip(*f.pose_check, strict=True)
    )
    columns = (
        "pose",
        "surrogate (N/mm)",
        "model (N/mm)",
        "relative difference",
        "within the worst error stated",
    )
    return Table("The measured poses", columns, rows)


def map_section(f: Findings, drawn: dict[str, Any], pictures: Pictures) -> Section:
    """The stiffness map from both viewpoints."""
    captions = {
        "oblique": "Every end-effector position of the sweep with its structural stiffness; warm and bright is "
        "stiff. Points on the viewer's side of the robot's plane are left out.",
        "side": "The same map seen along Y, onto the XZ cross-section.",
    }
    k = drawn["stiffness_N_per_mm"]
    swept, layer = default_sweep(f.given.robot)
    text = f"{drawn['points']} poses swept over {', '.join(swept)}"
    text += f", with {layer} moving the tool out of the plane. " if layer else ". "
    text += f"Stiffness runs from {k['min']:.0f} to {k['max']:.0f} N/mm, median {k['median']:.0f} N/mm."
    blocks: list[Block] = [Text(text)]
    for name in drawn["files"]:
        if name.endswith(".png"):
            view = name.removesuffix(".png").rsplit("_", 1)[-1]
            blocks.append(Picture(pictures.folder.path(name), captions[view], f"stiffness map, {view} view"))
    blocks.append(
        Text("stiffness_map.vtu opens in ParaView; docs/reference/stiffness_map.md lists its arrays and their units.")
    )
    return Section("The stiffness map", tuple(blocks))


def assumptions_section(f: Findings) -> Section:
    """Every figure of the model with its source."""
    # A source whose text begins so is an assumption too, with its reason.
    guesses = {key for key, text in f.given.description.sources.items() if text.startswith("assumed")}
    rows = tuple(
        (place, value, "assumed" if source in guesses else source, note)
        for place, value, source, note in quantities(f.given.description, "")
    )
    assumed = sum(row[2] == "assumed" for row in rows)
    sources = tuple(f"{key}: {text}" for key, text in f.given.description.sources.items())
    return Section(
        "Assumptions and sources",
        (
            Note(
                f"{assumed} of {len(rows)} figures of the robot's description are assumed. Calibrated springs "
                "absorb part of the errors in them; absolute link shares do not."
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


def quantities(node: Any, place: str) -> list[tuple[str, str, str, str]]:
    """All figures of a description: place in the file, value with unit, source, note."""
    if isinstance(node, Quantity):
        value = ", ".join(f"{v:g}" for v in node.value) if isinstance(node.value, tuple) else f"{node.value:g}"
        return [(place, f"{value} {node.unit}", node.source, node.note or "")]
    out: list[tuple[str, str, str, str]] = []
    if isinstance(node, tuple):
        for i, child in enumerate(node):
            out += quantities(child, f"{place}[{getattr(child, 'name', i)}]")
    elif hasattr(type(node), "model_fields"):
        for name in type(node).model_fields:
            out += quantities(getattr(node, name), f"{place}.{name}" if place else name)
    elif isinstance(node, dict):
        for name, child in node.items():
            out += quantities(child, f"{place}.{name}")
    return out
