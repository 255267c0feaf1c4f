"""The report on where the compliance sits: in the measured pose that deflects most, and over the workspace."""

from __future__ import annotations

import numpy as np

from doe import loaded_points
from doe.tables.measurements import largest_rows
from fem.statics.budget import compliance_budget
from robots import InputError
from stiffarm.commands.run.findings import Findings
from stiffarm.commands.simulate import field_results
from stiffarm.commands.simulate.budgets import PoseBudget, WorkspaceBudget, pose_budget, workspace_budget
from stiffarm.commands.simulate.field_picture import load_text
from stiffarm.commands.simulate.figures import pose_shares_figure, workspace_budget_figure
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Fold, Note, Picture, Section, Text


def budget_section(f: Findings, pictures: Pictures) -> Section:
    """Pictures and sentences for the poses and for the workspace; writes budget.json, and field.vtu for shells."""
    pose, budget, shape = _pose(f, pictures)
    blocks: list[Block] = []
    workspace = None
    try:
        found = workspace_budget(f.best.model)
        workspace = found.payload()
        blocks = _workspace(f, found, pictures)
    except InputError as error:
        blocks.append(Note(f"No budget of the workspace: {error.prose}."))
    pictures.folder.write_json("budget.json", {"pose": pose, **budget.payload(), "workspace": workspace})
    more = Fold(f"Pose by pose, and the arm in pose {pose}", (*_poses(f, pictures), *shape))
    return Section("Where the compliance comes from", (*blocks, more))


def _poses(f: Findings, pictures: Pictures) -> list[Block]:
    model = f.best.model
    # Shares do not change with the size of a load, nor from one repeat to the next.
    used = f.used.select(np.isin(np.arange(f.used.n), largest_rows(f.used.pose, f.used.loads_N)))
    budget = compliance_budget(model, used.q, used.wrench, loaded_points(model, used))
    motion_mm = 2e3 * budget.energy / used.loads_N if not used.wrench[:, 3:].any() else None
    return [
        Text(f"Each part's share in the strain energy of the recommended model ({f.best.name})."),
        pictures.add(
            pose_shares_figure(budget, used.pose, motion_mm),
            "budget",
            "Compliance budget by pose, each under its largest load. A part's share in the strain energy is its share "
            "in the tool's motion along the load. The arm is statically determinate, so the shares add up exactly. "
            "Link shares depend on assumed sections.",
        ),
    ]


def _pose(f: Findings, pictures: Pictures) -> tuple[str, PoseBudget, list[Block]]:
    """The measured pose with the largest deflection: its budget and, for shell links, its deformed shape."""
    used = f.used
    row = int(np.nanargmax(used.deflection))
    label, model, q, wrench = used.pose[row], f.best.model, used.q[row], used.wrench[row]
    point = loaded_points(model, used)[row]
    budget = pose_budget(model, q, wrench, point)
    shares = ", ".join(f"{budget.parts[i]} {_percent(float(budget.share[i]))}" for i in budget.order[:3])
    head = (
        f"In pose {label}, the measured one that deflects most under {load_text(wrench)}, the tool's motion comes from"
    )
    blocks: list[Block] = [Text(f"{head} {shares}.")]
    if model.link_kind in ("shell", "solid"):
        arm = field_results.deformed_arm(f.best.description, model, q, wrench, point)
        field_results.save_vtu(arm, model, pictures.folder.path("field.vtu"))
        field_results.picture_of(arm, pictures.folder, "figures/field.png")
        blocks.append(
            Picture(
                pictures.folder.path("figures/field.png"),
                f"The arm in pose {label}, its deflection magnified {arm.scale:g} times; dashed: unloaded. Colour: "
                "strain energy per volume of wall. Joints are grey, with the share of their springs beside them. "
                "field.vtu holds displacements, energies and stresses for ParaView.",
                "deformed arm",
            )
        )
    return label, budget, blocks


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f}\u00a0%"


def _workspace(f: Findings, found: WorkspaceBudget, pictures: Pictures) -> list[Block]:
    names = ", ".join(name.removesuffix("_deg") for name in found.swept)
    figure = workspace_budget_figure(
        found,
        f"Where the compliance of the {f.title} comes from",
        f"{len(found.q)} reachable poses, {names} spread evenly over their limits; vertical load",
    )
    blocks: list[Block] = [
        Text(
            f"Over the workspace, {len(found.q)} reachable poses, {names} spread evenly over their limits, "
            f"vertical load. {' '.join(found.sentences())}"
        ),
        pictures.add(
            figure,
            "workspace_budget",
            "Compliance budget of the workspace: how much each part's share varies, and how the mean shares change "
            "with the horizontal distance of the tool from the base's axis.",
        ),
    ]
    if f.best.depends_on_angles:
        blocks.append(
            Note("The springs of this model depend on joint angles; far from the measured poses that is extrapolation.")
        )
    return blocks
