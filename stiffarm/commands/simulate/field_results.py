"""One pose in detail: the deformed arm as file and picture, and the budget of its strain energy."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fem import ArmModel, arm_fields
from fem.statics.budget import whole_joints
from robots import ModelDescription, Robot, content_hash
from robots.arrays import Array
from robots.quantities import rounded
from stiffarm.commands.simulate.budgets import pose_budget
from stiffarm.commands.simulate.field_files import automatic_scale, field_grid, write_field
from stiffarm.commands.simulate.field_picture import DeformedArm, load_text, render_field
from stiffarm.commands.simulate.figures import energy_share_figure
from stiffarm.pages.style import save_png
from stiffarm.session.caution import caution
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import WRENCH_NAMES


def deformed_arm(
    description: ModelDescription,
    model: ArmModel,
    q: Array,
    wrench: Array,
    point: Array | None = None,
    scale: float | None = None,
) -> DeformedArm:
    """Fields of one pose q (dof,) under one load (6,), and how many times to draw them (None: automatic)."""
    fields = arm_fields(model, q, wrench, point)
    grid = field_grid(fields)
    budget = pose_budget(model, q, wrench, point)
    drawn = automatic_scale(grid) if scale is None else scale
    return DeformedArm(description, model.robot, q, wrench, point, fields, grid, budget, drawn)


def write(arm: DeformedArm, model: ArmModel, folder: OutputFolder, rigid_joints: bool = False) -> dict[str, Any]:
    """Write ``field.vtu``, ``field.png``, ``energy_share.png`` and ``budget.json``; returns names and figures."""
    save_vtu(arm, model, folder.path("field.vtu"))
    picture = picture_of(arm, folder, "field.png")
    facts = f"{pose_text(arm.robot, arm.q)}; load {wrench_text(arm.wrench)}".replace("-", "−")
    figure = energy_share_figure(arm.budget, f"Where the {_short(arm)} deflects", facts)
    save_png(figure, folder.path("energy_share.png"))
    content = {
        "robot": arm.robot.name,
        "load_path": model.load_path,
        "rigid_joints": rigid_joints,
        "warning": caution() or None,
        "pose_deg": {n: rounded(v) for n, v in zip(arm.robot.coordinates, np.degrees(arm.q), strict=True)},
        "load": {n: rounded(v) for n, v in zip(WRENCH_NAMES, arm.wrench, strict=True)},
        **arm.budget.payload(),
    }
    folder.write_json("budget.json", content)
    stress = arm.grid.von_mises.max(axis=1)
    worst = int(stress.argmax())
    return {
        "files": ["field.vtu", "field.png", "energy_share.png", "budget.json"],
        "scale_factor": arm.scale,
        "largest_von_mises_MPa": rounded(float(stress[worst]) * 1e-6),
        "largest_von_mises_in": arm.grid.parts[arm.grid.part[worst]],
        "messages": [picture] if picture else [],
        "budget": arm.budget.payload(),
    }


def save_vtu(arm: DeformedArm, model: ArmModel, path: Path) -> None:
    """Write the deformed arm with all its arrays (see :func:`stiffarm.commands.simulate.field_files.write_field`)."""
    springs = whole_joints(model, arm.fields.springs)
    write_field(arm.grid, arm.scale, path, springs=springs, metadata=_metadata(arm, model))


def picture_of(arm: DeformedArm, folder: OutputFolder, name: str) -> str:
    """Draw the deformed arm; returns what to tell the user about the renderer, if anything."""
    motion = float(np.linalg.norm(arm.fields.displacement[:3])) * 1e3
    drawn = f"drawn {arm.scale:g} times as large" if arm.scale != 1.0 else "drawn at true size"
    picture = render_field(
        arm,
        folder.path(name),
        heading=f"{_short(arm)} under {load_text(arm.wrench)}: motion {drawn}",
        subtitle=f"{pose_text(arm.robot, arm.q)}; the tool moves {motion:.3g} mm; "
        f"dashed: unloaded; strain energy: {arm.budget.leader}".replace("-", "−"),
    )
    return picture.message


def pose_text(robot: Robot, q: Array) -> str:
    """Joint coordinates in words: ``q2 5, q3real 77.5 deg, the others 0``."""
    degrees = dict(zip(robot.coordinates, np.degrees(q), strict=True))
    named = [f"{n.removesuffix('_deg')} {v:.4g}" for n, v in degrees.items() if abs(v) > 1e-9]
    if not named:
        return "all joints at 0 deg"
    return f"{', '.join(named)} deg" + ("" if len(named) == len(degrees) else ", the others 0")


def wrench_text(wrench: Array) -> str:
    """A load as ``--load`` takes it: ``fz_N=-650``."""
    return ",".join(f"{n}={v:g}" for n, v in zip(WRENCH_NAMES, wrench, strict=True) if v != 0.0)


def _short(arm: DeformedArm) -> str:
    return arm.description.title.split(" (")[0]


def _metadata(arm: DeformedArm, model: ArmModel) -> Mapping[str, str]:
    out = {
        "robot": arm.robot.name,
        "model_hash": content_hash(arm.description),
        "load_path": model.load_path,
        "pose": ",".join(f"{n}={v:.9g}" for n, v in zip(arm.robot.coordinates, np.degrees(arm.q), strict=True)),
        "load": wrench_text(arm.wrench),
    }
    if caution():
        out["warning"] = caution()
    if arm.point is not None:
        out["loaded_point_flange_mm"] = ",".join(f"{v * 1e3:.9g}" for v in arm.point)
    return out
