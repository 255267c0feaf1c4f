"""The ``simulate`` command: one pose, or every reading of a table."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fem import ArmModel, deflection_by_part
from fem.arm import Arm
from fem.effects import History, observed
from fem.effects.base import STAGES
from fem.effects.secant import StatedLoad
from fem.statics.loads import LoadedPoses
from robots import InputError, load_description, require_positive
from robots.arrays import Array
from stiffarm.pages.numbers import ranged
from stiffarm.session.console import say, show_table
from stiffarm.session.json_text import number
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import DISPLACEMENT_NAMES, WRENCH_NAMES, refuse_given
from stiffarm.session.softness import flagged
from stiffarm.session.stated import interval_ends, interval_json, intervals_at

NO_LINKS = "no links described: all bodies rigid"


def head(given: Arm, model: ArmModel, rigid_joints: bool) -> dict[str, Any]:
    """What the results of a pose and of a table begin with."""
    codes = [table.code for table in given.description.effect]
    effects = {"effects": [] if rigid_joints else codes} if codes else {}
    rigid = [j.name for j in model.joints if not j.axial.compliance(np.zeros((1, model.robot.dof))).any()]
    return {
        "robot": given.robot.name,
        "links": model.link_kind if model.links or model.link_kind == "rigid" else NO_LINKS,
        "load_path": model.load_path,
        "rigid_joints": rigid_joints,
        "joints_without_spring": rigid,
    } | effects


def of_pose(
    given: Arm, q: Array, wrench: Array, rigid_joints: bool, unload_from: Array | None = None
) -> dict[str, Any]:
    """Displacement and directional stiffness at one pose, split by part.

    The load is put on from zero, or reached by taking load off from ``unload_from`` (6,): effects with a memory tell
    the two apart. With rigid joints effects are left out.
    """
    model = given.model.with_rigid_joints() if rigid_joints else given.model
    parts = deflection_by_part(model, q[None], wrench)
    if not rigid_joints:
        parts |= _by_effect(given, q, wrench, unload_from)
    d = np.sum([part[0] for part in parts.values()], axis=0) if parts else np.zeros(6)
    flagged(model.robot, d[None], "--pose under --load")
    force = wrench[:3]
    # What a load or a gauge adds is in the reading, and no compliance of the arm.
    arm = d - np.sum(
        [parts[e.effect.code][0] for e in given.effects if e.effect.code in parts and not e.effect.of_the_arm]
        or [np.zeros(6)],
        axis=0,
    )
    along = float(arm[:3] @ force) / float(force @ force) if force.any() else float("nan")
    low = high = np.array([np.nan])
    if not rigid_joints and along > 0.0 and not wrench[3:].any():
        stated = given.at_load(StatedLoad(force)).model
        low, high = intervals_at(given.description, stated, q[None], force, np.array([1e-3 / along]))
    return head(given, model, rigid_joints) | {
        "pose_deg": {n: number(v) for n, v in zip(given.robot.coordinates, np.degrees(q), strict=True)},
        "load": {n: number(v) for n, v in zip(WRENCH_NAMES, wrench, strict=True)},
        "displacement": {n: number(v * 1e3) for n, v in zip(DISPLACEMENT_NAMES, d, strict=True)},
        "stiffness_N_per_mm": number(1e-3 / along) if along > 0.0 else None,
        "interval95_N_per_mm": interval_json(low[0], high[0]),
        "by_part": {
            name: {n: number(v * 1e3) for n, v in zip(DISPLACEMENT_NAMES, part[0], strict=True)}
            for name, part in parts.items()
        },
    }


def _by_effect(given: Arm, q: Array, wrench: Array, unload_from: Array | None) -> dict[str, Array]:
    """What each effect beyond the linear arm adds (1, 6), one after the other in the order in which they act."""
    if not given.effects:
        return {}
    steps_to = [wrench] if unload_from is None else [unload_from, wrench]
    n = len(steps_to)
    tool = np.broadcast_to(given.robot.T_flange_tool[:3, 3], (n, 3))
    at = LoadedPoses(np.tile(q, (n, 1)), np.array(steps_to), tool)
    then = History(np.zeros(n, dtype=np.intp), np.arange(n), np.full(n, np.nan), is_known=True)
    before, out = observed(given.model, at, (), then)[-1:], {}
    order = sorted(given.effects, key=lambda e: STAGES.index(e.effect.stage))
    for k, effect in enumerate(order, start=1):
        after = observed(given.model, at, order[:k], then)[-1:]
        out[effect.effect.code] = after - before
        before = after
    return out


def check_request(
    pose: str | None,
    data: Path | None,
    load: str | None,
    out: Path | None,
    field: bool,
    scale: float | None,
    unload_from: str | None = None,
) -> None:
    """Refuse options that do not go together, before anything is built.

    Raises
    ------
    InputError
        A pose and a table, a load for a table, or fields without a pose, without a folder or not asked for.
    """
    if pose is not None and data is not None:
        raise InputError(
            "simulate takes a pose or a measurement table, not both", code="A002", remedy="leave out --pose or DATA"
        )
    if field and pose is None:
        raise InputError(
            "--field",
            code="A003",
            value="a measurement table",
            allowed="one pose and load",
            remedy="give --pose, as in --pose q2_deg=5, and --load if it is not 650 N downward",
        )
    if field and out is None:
        raise InputError("--field writes files and has no folder for them", code="A003", remedy="give --out DIR")
    if not field:
        refuse_given({"--scale": scale}, "only with --field", "add --field or leave it out")
    require_positive("--scale", scale, code="A003", remedy="1 draws motion at its true size")
    if pose is None:
        why_not = "only with --pose: a measurement table has its own loads and phases"
        refuse_given({"--load": load, "--unload-from": unload_from}, why_not, "leave it out")


def field_links(model: str, links: str | None) -> str:
    """The kind of links for fields: shells, unless solids were asked for or calibrated with.

    Raises
    ------
    InputError
        Another kind was asked for, or the model was calibrated with another kind and none was asked for.
    """
    if links not in (None, "shell", "solid"):
        raise InputError(
            "--links with --field",
            code="M003",
            value=links,
            allowed="shell or solid: only these have displacements, stresses and energies to show",
            remedy="leave --links out, or give --links shell",
        )
    calibration = load_description(model).calibration
    if links is None and calibration is not None and calibration.links not in ("shell", "solid"):
        raise InputError(
            f"--field: model {model} was calibrated with links",
            code="M003",
            value=calibration.links,
            allowed="shell or solid",
            remedy="give --links shell to keep its springs with shell links, or calibrate with --links shell",
        )
    return links or (calibration.links if calibration is not None else "shell")


def field_of_pose(
    given: Arm, q: Array, wrench: Array, rigid_joints: bool, scale: float | None, folder: OutputFolder
) -> dict[str, Any]:
    """Fields and energy budget of one pose: see :func:`stiffarm.commands.simulate.field_results.write`."""
    from stiffarm.commands.simulate import field_results

    model = given.model.with_rigid_joints() if rigid_joints else given.model
    say("fields of the deformed arm")
    with folder.timed("fields"):
        arm = field_results.deformed_arm(given.description, model, q, wrench, scale=scale)
        return field_results.write(arm, model, folder, rigid_joints)


def show(result: dict[str, Any]) -> None:
    """Tables for people."""
    if result.get("effects"):
        say(f"with effects: {', '.join(result['effects'])}")
    if result["joints_without_spring"] and not result["rigid_joints"]:
        say(f"note: no spring is given for {', '.join(result['joints_without_spring'])}: held rigid until calibrated")
    if result["links"] == NO_LINKS:
        say(f"note: {NO_LINKS} (`stiffarm import` makes links of a URDF's meshes)")
    else:
        say(f"links: {result['links']}, {result['links_because']}")
    if "readings" in result:
        columns = list(dict.fromkeys(key for row in result["readings"] for key in row))
        rms = [f"{result[k]:.3f} {k.removeprefix('rms_')}" for k in ("rms_mm", "rms_mrad") if result[k] is not None]
        show_table(
            f"{result['robot']}: measured and simulated (RMS difference {' and '.join(rms)})",
            columns,
            [["-" if row.get(c) is None else str(row[c]) for c in columns] for row in result["readings"]],
        )
        return
    show_table(
        f"{result['robot']}: displacement of the tool point",
        ["part", *DISPLACEMENT_NAMES],
        [[name, *(f"{part[n]:+.4f}" for n in DISPLACEMENT_NAMES)] for name, part in result["by_part"].items()]
        + [["total", *(f"{result['displacement'][n]:+.4f}" for n in DISPLACEMENT_NAMES)]],
    )
    if "field" in result:
        _show_field(result["field"])
    k = result["stiffness_N_per_mm"]
    low, high = interval_ends(result["interval95_N_per_mm"])
    sure = "" if np.isnan(low) else f" (95 %: {ranged(low, high, 'N/mm')})"
    say("stiffness along the force: " + ("none (no force, or a rigid model)" if k is None else f"{k:.1f} N/mm{sure}"))


def _show_field(found: dict[str, Any]) -> None:
    for message in found["messages"]:
        say(f"note: {message}")
    say(f"strain energy: {found['budget']['leader']}")
    stress, part = found["largest_von_mises_MPa"], found["largest_von_mises_in"]
    say(f"largest von Mises stress: {stress:.3g} MPa in {part} (a peak at an end or a kink rises with a finer mesh)")
    say(f"deflection is drawn magnified {found['scale_factor']:g} times")
