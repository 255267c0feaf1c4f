"""One pose under one load: how the tool moves, part by part, and how stiff the arm is along the force."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fem import ArmModel, deflection_by_part
from fem.arm import Arm
from fem.effects import History, observed
from fem.effects.base import STAGES
from fem.effects.secant import StatedLoad
from fem.statics.loads import LoadedPoses
from robots import Remark
from robots.arrays import Array
from robots.quantities import QUANTITIES, known_to, length, rounded_all
from stiffarm.pages.report import Bullets, KeyFigure, Section
from stiffarm.result import Drawing, Number, Result, Table
from stiffarm.session.caution import RIGID_AS_ASKED
from stiffarm.session.console import say, say_notes
from stiffarm.session.outputs import OutputFolder
from stiffarm.session.parsing import WRENCH_NAMES
from stiffarm.session.softness import flagged
from stiffarm.session.stated import intervals_at

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stiffarm.commands.simulate.command import SimulateRequest

NO_LINKS = "no links described: all bodies rigid"
MOTIONS = tuple(QUANTITIES[name] for name in ("dx", "dy", "dz", "rx", "ry", "rz"))
MOTION = length("motion")
STIFFNESS = QUANTITIES["stiffness"]


def at_pose(given: Arm, q: Array, wrench: Array, asked: SimulateRequest) -> Result:
    """Displacement and directional stiffness at pose q (dof,) under a wrench (6,), split by part."""
    model = given.model.with_rigid_joints() if asked.rigid_joints else given.model
    parts = deflections(given, q, wrench, asked)
    d = np.sum(list(parts.values()), axis=0) if parts else np.zeros(6)
    flagged(model.robot, d[None], "--pose under --load")
    stiffness = _stiffness(given, q, wrench, parts, d, asked.rigid_joints)
    motion = float(np.linalg.norm(d[:3]))
    most = max(parts, key=lambda name: float(np.linalg.norm(parts[name][:3])), default="nothing")
    pose_deg = dict(zip(given.robot.coordinates, rounded_all(np.degrees(q)), strict=True))
    named = dict(zip(WRENCH_NAMES, rounded_all(wrench), strict=True))
    pose = ", ".join(f"{n.removesuffix('_deg')} {v:g}" for n, v in pose_deg.items() if v) or "all joints at 0"
    under = ", ".join(f"{n.rpartition('_')[0]} {v:g} {n.rpartition('_')[2]}" for n, v in named.items() if v)
    facts = about(given, model, asked.rigid_joints)
    lengths_um = {name: 1e6 * float(np.linalg.norm(part[:3])) for name, part in parts.items()}
    figure = partial(_parts_figure, lengths_um)
    rows = np.array([*parts.values(), d])
    known = stiffness is not None and np.isfinite(stiffness.ends[0])
    return Result(
        name="simulation",
        title=given.description.title.split(" (")[0],
        question="how far does the tool move?",
        answer=f"At {pose} deg under {under or 'no load'} the tool moves by {MOTION.text(motion, unit=True)}; "
        f"{most} contributes most."
        + (
            " Stiffness along the force: none (no force, or a rigid model)."
            if stiffness is None
            else f" Stiffness along the force: {STIFFNESS.text(stiffness.value, unit=True)}"
            + (f" (95 %: {STIFFNESS.between(*stiffness.ends)})." if known else ".")
        ),
        how_sure=how_sure(given, facts),
        what_next=what_next(given),
        facts=facts | {"pose_deg": pose_deg, "load": named},
        numbers={q: Number(value) for q, value in zip(MOTIONS, d, strict=True)}
        | ({} if stiffness is None else {STIFFNESS: stiffness}),
        tables=(
            Table(
                "by_part",
                "Motion of the tool by part",
                {"part": [*parts, "total"]},
                dict(zip(MOTIONS, rows.T, strict=True)),
            ),
        ),
        drawings=(Drawing("parts", "The parts' motions add up as vectors.", "parts", figure),) if parts else (),
        key=_key(motion, most, stiffness),
        sections=(model_section(facts),),
        remarks=tuple(remarks(facts)),
        arm=given,
        caution=RIGID_AS_ASKED if asked.rigid_joints else None,
        more=partial(_field, given, model, q, wrench, asked) if asked.field else None,
    )


def _parts_figure(lengths_um: dict[str, float]) -> Figure:
    from stiffarm.pages.bars import ranked_figure

    return ranked_figure("How far each part moves the tool", lengths_um, "length of the motion (um)")


def _key(motion: float, most: str, stiffness: Number | None) -> tuple[KeyFigure, ...]:
    moved = KeyFigure(MOTION.text(motion, unit=True), f"motion of the tool; {most} contributes most")
    if stiffness is None:
        return (moved,)
    value, low, high = (STIFFNESS.factor * v for v in (stiffness.value, *stiffness.ends))
    if np.isnan(low):
        return KeyFigure(
            STIFFNESS.text(stiffness.value, unit=True), "stiffness along the force", "no interval: not calibrated"
        ), moved
    interval = f"95\u00a0%: {STIFFNESS.between(*stiffness.ends)}"
    return KeyFigure(f"{known_to(value, low, high)} N/mm", "stiffness along the force", interval), moved


def deflections(given: Arm, q: Array, wrench: Array, asked: SimulateRequest) -> dict[str, Array]:
    """What each part and each effect adds to the displacement (6,) at pose q (dof,).

    The load is put on from zero, or reached by taking load off from ``unload_from``: effects with a memory tell the two
    apart. With rigid joints effects are left out.
    """
    model = given.model.with_rigid_joints() if asked.rigid_joints else given.model
    parts = {name: part[0] for name, part in deflection_by_part(model, q[None], wrench).items()}
    if asked.rigid_joints or not given.effects:
        return parts
    steps_to = [wrench] if asked.unload_from is None else [np.asarray(asked.unload_from), wrench]
    n = len(steps_to)
    tool = np.broadcast_to(given.robot.T_flange_tool[:3, 3], (n, 3))
    at = LoadedPoses(np.tile(q, (n, 1)), np.array(steps_to), tool)
    then = History(np.zeros(n, dtype=np.intp), np.arange(n), np.full(n, np.nan), is_known=True)
    before = observed(given.model, at, (), then)[-1]
    order = sorted(given.effects, key=lambda e: STAGES.index(e.effect.stage))
    for k, effect in enumerate(order, start=1):
        after = observed(given.model, at, order[:k], then)[-1]
        parts[effect.effect.code] = after - before
        before = after
    return parts


def _stiffness(
    given: Arm, q: Array, wrench: Array, parts: Mapping[str, Array], d: Array, rigid_joints: bool
) -> Number | None:
    """The force over the displacement along it, N/m, with its interval; None without a force, or for a rigid arm.

    What a load or a gauge adds is in the reading, and no compliance of the arm.
    """
    others = [e.effect.code for e in given.effects if not e.effect.of_the_arm]
    arm = d - np.sum([parts[code] for code in others if code in parts] or [np.zeros(6)], axis=0)
    force = wrench[:3]
    along = float(arm[:3] @ force) / float(force @ force) if force.any() else 0.0
    if along <= 0.0:
        return None
    if rigid_joints or wrench[3:].any():
        return Number(1.0 / along, np.nan, np.nan)
    stated = given.at_load(StatedLoad(force)).model
    low, high = intervals_at(given.description, stated, q[None], force, np.array([1.0 / along]))
    return Number(1.0 / along, float(low[0]), float(high[0]))


def about(given: Arm, model: ArmModel, rigid_joints: bool) -> dict[str, Any]:
    """What the results of a pose and of a table say of the arm."""
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


def remarks(facts: Mapping[str, Any]) -> list[str]:
    """What the reader must know of the arm."""
    out = [f"with effects: {', '.join(facts['effects'])}"] if facts.get("effects") else []
    if facts["joints_without_spring"] and not facts["rigid_joints"]:
        names = ", ".join(facts["joints_without_spring"])
        out.append(Remark(f"no spring is given for {names}: held rigid until calibrated", code="W001"))
    if facts["links"] == NO_LINKS:
        out.append(f"{NO_LINKS} (`stiffarm import` makes links of a URDF's meshes)")
    return out


def how_sure(given: Arm, facts: Mapping[str, Any]) -> str:
    """What an interval of the answer holds, or why there is none."""
    if facts["rigid_joints"]:
        return "Joints are held rigid, as asked: only the links deflect."
    if facts["joints_without_spring"]:
        names = ", ".join(facts["joints_without_spring"])
        return (
            f"No spring is given for {names}: they are held rigid, so the real arm is softer than computed wherever a "
            "load turns them."
        )
    if given.description.calibration is None:
        return "The springs are those of the model file, which does not say how well they are known."
    return "The interval covers the uncertainty of the calibrated parameters, but not what the model leaves out."


def what_next(given: Arm, *, from_table: bool = False) -> str:
    """The command that leads on; MODEL: as the model was typed (:func:`stiffarm.capability.capability`)."""
    if given.description.calibration is None:
        return "Calibrate the model with readings: `stiffarm calibrate MODEL DATA --out calibrated`."
    if from_table:
        return (
            "If they differ by more than the scatter of the readings, find out what the model is missing: "
            "`stiffarm diagnose MODEL DATA`."
        )
    return "Map the stiffness over the workspace: `stiffarm map joints MODEL --html --out map`."


def model_section(facts: Mapping[str, Any]) -> Section:
    """Links and load path, folded away."""
    shown = (f"links: {facts['links']}", f"load path: {facts['load_path']}")
    return Section("The model", (Bullets(shown),), folded=True)


def _field(
    given: Arm, model: ArmModel, q: Array, wrench: Array, asked: SimulateRequest, folder: OutputFolder
) -> dict[str, Any]:
    """Fields and energy budget of the pose: see :func:`stiffarm.commands.simulate.field_results.write`."""
    from stiffarm.commands.simulate import field_results

    say("fields of the deformed arm")
    with folder.timed("fields"):
        arm = field_results.deformed_arm(given.description, model, q, wrench, scale=asked.scale)
        found = field_results.write(arm, model, folder, asked.rigid_joints)
    say_notes(found["messages"])
    say(f"strain energy: {found['budget']['leader']}")
    stress, part = found["largest_von_mises_MPa"], found["largest_von_mises_in"]
    say(f"largest von Mises stress: {stress:.3g} MPa in {part} (a peak at an end or a kink rises with a finer mesh)")
    say(f"deflection is drawn magnified {found['scale_factor']:g} times")
    return {"field": found}
