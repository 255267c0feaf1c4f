"""Parts that give way although the model has them rigid: joints, bearings, base, bar, links, tool, load path."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fem.effects.base import Effect, EffectParameter, Law
from fem.effects.situation import Situation
from fem.effects.sizes import Usual
from fem.model import ArmModel, JointPart, LinkPart
from fem.springs import SumSpring
from robots.arrays import Array

# Sources of plausible ranges: joint stiffness and tilt of RV gearboxes of 100-270 kg robots, floors and rails, tools.
CLASS = "same-class robots and RV gearboxes"
ASSUMED = "assumed"
# What every link's compliance is off by, as a share of it, one standard deviation.
OFF_BY = 0.07
# Directions tried of two axes that a part gives way about; beyond a right angle they come again.
HEADINGS = tuple(np.radians([0.0, 30.0, 60.0]).tolist())


def stiffness(name: str, unit: str, lower: float, upper: float, source: str, meaning: str) -> EffectParameter:
    """A stiffness, N/m or N m/rad, that acts as a compliance."""
    dimension = "translational stiffness" if unit == "N/m" else "rotational stiffness"
    return EffectParameter(name, dimension, unit, lower, upper, source, scale="compliance", meaning=meaning)


def structure(model: ArmModel, usual: Usual) -> Iterator[Effect]:
    """Effects of this kind that the model can have.

    Ranges are those of the reference class, made larger or smaller; of floors and tools, which do not know what stands
    on them, made wider only.
    """
    for joint in model.joints:
        yield _joint_compliance(joint, usual)
        yield _joint_tilt(joint, usual)
    along, soft, stiff = usual.rigid, min(usual.rigid, 1.0), max(usual.rigid, 1.0)
    lowest, highest = 2e6 * min(usual.stiff, 1.0), 1e8 * max(usual.stiff, 1.0)
    tilts = [
        stiffness(
            f"stiffness_{a}", "N m/rad", lowest, highest, ASSUMED, f"stiffness about the {which} of two level axes"
        )
        for a, which in zip("xy", ("first", "second"), strict=True)
    ]
    yield Effect(
        "base-tilt",
        "the base or floor tilts",
        "model",
        (*tilts, _heading("base's x")),
        _across("base", slice(3, 5)),
        "base-tilt",
    )
    yield Effect(
        "base-vertical",
        "the base or rail deflects vertically",
        "model",
        (stiffness("stiffness", "N/m", 3e6 * soft, 5e8 * stiff, ASSUMED, "vertical stiffness"),),
        _vertical,
        "base-vertical",
    )
    across = [
        stiffness(
            f"stiffness_{axis}",
            "N/m",
            soft / 6e-7,
            stiff / 1.5e-7,
            CLASS,
            f"stiffness along the {which} of two axes across the tool",
        )
        for axis, which in zip("xy", ("first", "second"), strict=True)
    ]
    own_axis = stiffness("stiffness_z", "N/m", soft / 1.5e-7, stiff / 2e-8, ASSUMED, "stiffness along the tool")
    yield Effect(
        "tool-compliance",
        "the tool or sensor deflects, mostly across its axis",
        "model",
        (*across, own_axis, _heading("flange's x")),
        _across("tool", slice(0, 2)),
        "tool-compliance",
    )
    if model.bar is not None:
        yield Effect(
            "parallelogram-bar",
            "the parallelogram's bar stretches along its length",
            "model",
            (stiffness("stiffness", "N/m", 2e7 * along, 1e9 * along, ASSUMED, "stiffness along the bar"),),
            _bar,
            "parallelogram-bar",
        )


def joint_is_rigid(joint: JointPart, dof: int) -> bool:
    """Whether a joint has no spring about its axis."""
    return not joint.axial.compliance(np.zeros((1, dof))).any()


def _joint_compliance(joint: JointPart, usual: Usual) -> Effect:
    def law(model: ArmModel, _: object, v: Array) -> ArmModel:
        old = model.joints[joint.joint]
        return model.with_joint(joint.name, axial=SumSpring(old.axial, float(v[0])))

    lower, upper = float(usual.low[joint.joint]), float(usual.high[joint.joint])
    meaning = "stiffness about the axis, in series with the spring"
    return Effect(
        f"joint-compliance:{joint.name}",
        f"joint {joint.name} deflects about its axis",
        "model",
        (stiffness("stiffness", "N m/rad", lower, upper, CLASS, meaning),),
        law,
        "joint-compliance",
        spring=joint.name,
    )


def _joint_tilt(joint: JointPart, usual: Usual) -> Effect:
    """Tilt about the two axes across, fixed in the part before the joint (its housing) or in the one behind it.

    The two differ where the two stiffnesses do.
    """

    def law(model: ArmModel, _: object, v: Array) -> ArmModel:
        old = model.joints[joint.joint]
        place = "bearing" if v[2] >= 0.5 else "housing"
        C = getattr(old, place).copy()
        C[3:5, 3:5] += turned(v[0], v[1], v[3])
        return model.with_joint(joint.name, **{place: C})

    # Behind a vertical first axis the base's tilt and the joint's are one.
    family = "base-tilt" if joint.joint == 0 else "joint-tilt"
    behind = EffectParameter(
        "turning",
        "ratio",
        "1",
        0.0,
        1.0,
        "definition",
        role="shape",
        grid=(0.0, 1.0),
        default=1.0,
        meaning="1: the part behind the joint tilts, 0: the housing before it",
    )
    across = (
        stiffness(
            f"stiffness_{axis}",
            "N m/rad",
            5e5 * usual.stiff,
            5e6 * usual.stiff,
            CLASS,
            f"stiffness against tilting about the {which} of two axes across the joint's",
        )
        for axis, which in zip("xy", ("first", "second"), strict=True)
    )
    return Effect(
        f"joint-tilt:{joint.name}",
        f"joint {joint.name} tilts across its axis",
        "model",
        (*across, behind, _heading("joint's x")),
        law,
        family,
    )


def turned(first: float, second: float, heading: float) -> Array:
    """Compliances about (or along) two axes at right angles, the first by an angle from x, as a matrix (2, 2)."""
    c, s = np.cos(heading), np.sin(heading)
    R = np.array([[c, -s], [s, c]])
    return np.asarray(R @ np.diag([first, second]) @ R.T)


def _heading(start: str) -> EffectParameter:
    """Direction of the first of two axes; a right angle on they have changed places."""
    return EffectParameter(
        "heading",
        "angle",
        "deg",
        0.0,
        np.pi / 2,
        "definition",
        role="shape",
        grid=HEADINGS,
        default=0.0,
        meaning=f"direction of the first axis, from the {start} axis",
    )


def _across(place: str, rows: slice) -> Law:
    """Two compliances in the plane of x and y, the rows named, with a heading behind them; others follow on z."""

    def law(model: ArmModel, _: object, v: Array) -> ArmModel:
        C = getattr(model, place).copy()
        C[rows, rows] += turned(v[0], v[1], v[-1])
        if len(v) > 3:
            C[rows.stop, rows.stop] += v[2]
        return replace(model, **{place: C})

    return law


def _vertical(model: ArmModel, _: object, v: Array) -> ArmModel:
    C = model.base.copy()
    C[2, 2] += v[0]
    return replace(model, base=C)


def _bar(model: ArmModel, _: object, v: Array) -> ArmModel:
    if model.bar is None:
        return model
    return replace(model, bar=replace(model.bar, compliance=model.bar.compliance + float(v[0])))


def link_flexibility(link: LinkPart, is_there: bool) -> Effect:
    """A link softer (or stiffer) than described; where the model's links are rigid, the described beam is added.

    The number is the share of the described link's compliance that comes on top.
    """
    lower, upper = (0.15, 1.5) if is_there else (0.3, 2.0)
    meaning = "share of the described compliance that is added"
    share = EffectParameter("share", "ratio", "1", lower, upper, ASSUMED, signed=is_there, meaning=meaning)

    def law(model: ArmModel, _: object, v: Array) -> ArmModel:
        own = next((part for part in model.links if part.name == link.name), None)
        # A link stiffer than rigid does not exist: large negative shares end at a tenth of the compliance.
        factor = max(1.0 + float(v[0]), 0.1) if is_there else float(v[0])
        if factor <= 0.0:
            return model
        others = tuple(x for x in model.links if x.name != link.name)
        return replace(model, links=(*others, softer(link if own is None else own, factor)))

    words = f"link {link.name} is softer or stiffer than described" if is_there else f"link {link.name} is flexible"
    usual = OFF_BY if is_there else 0.0
    return Effect(
        f"link-flexibility:{link.name}",
        words,
        "model",
        (share,),
        law,
        "link-flexibility",
        usual=usual,
        held_rigid=not is_there,
    )


def softer(part: LinkPart, factor: float) -> LinkPart:
    """The link with ``factor`` times its compliance: as if its modulus were so many times smaller, meshes too."""
    element = replace(
        part.element, flexibility=factor * part.element.flexibility, stiffness=part.element.stiffness / factor
    )
    shell = part.shell
    if shell is not None:
        shell = replace(shell, youngs_modulus=shell.youngs_modulus / factor)
    mesh = replace(part.mesh, youngs_modulus=part.mesh.youngs_modulus / factor)
    return LinkPart(part.name, part.body, element, mesh, shell, part.flanges)


def wrist_coupling(model: ArmModel, usual: Usual) -> Iterator[Effect]:
    """A torque about the second last but one axis turns the next one, and back (Maxwell's reciprocity)."""
    if model.robot.dof < 5:
        return
    names = model.robot.joint_names
    # The two wrist axes before the last of six; the last two of five.
    k = len(names) - (3 if len(names) >= 6 else 2)
    first, second = names[k], names[k + 1]

    def law(_: object, s: Situation, v: Array) -> Array:
        return np.asarray(s.turned(second, v[0] * s.torque(first)) + s.turned(first, v[0] * s.torque(second)))

    # Of the order of the two joints' own compliances; no coupling is above their geometric mean.
    mean = float(np.sqrt(usual.softness[k] * usual.softness[k + 1]))
    entry = EffectParameter(
        "coupling",
        "compliance",
        "rad/(N m)",
        0.05 * mean,
        0.7 * mean,
        CLASS,
        signed=True,
        meaning="rotation of one wrist axis for a torque about the other",
    )
    words = f"torque about {first} turns {second}, and back"
    yield Effect("wrist-coupling", words, "arm", (entry,), law, "wrist-coupling", depends_on="pose")
