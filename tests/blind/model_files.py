"""The model that the workflow is given: the bundled file, edited as text."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

from rehearsal.arm import Arm
from rehearsal.described import arm_of
from robots.library.models import load_description

from .spec import SetSpec

DATA = Path(__file__).resolve().parents[2] / "robots" / "data"
# The XR701's springs were never published; these are the figures a rigid-link fit of its readings gives.
NOMINAL_SPRINGS = {
    "xr701": {"j2": 1.4e6, "j3": 0.76e6, "j4": 1.4e6, "j5": 0.6e6},
}
# Newtons, up to half of what the arm carries (xr701) and three quarters (kr60-3).
LOADS = {"xr701": (150.0, 375.0, 650.0), "kr60-3": (150.0, 300.0, 450.0)}
# Where joint 2's spring cylinder would have its lever's end.
UPRIGHT = {"xr701": 0.0, "kr60-3": -1.5707963267948966}


@cache
def arm(name: str) -> Arm:
    """One of the bundled robots, by its name, with springs."""
    made, own = arm_of(load_description(name)), NOMINAL_SPRINGS.get(name)
    return made if own is None else replace(made, stiffness=tuple(own.get(joint) for joint in made.joints))


def held_rigid(spec: SetSpec) -> list[str]:
    """Joints whose spring the model lacks because the set hides just that."""
    return [code.split(":")[1] for code in spec.effects if code.startswith("joint-compliance:")]


def free_joints(spec: SetSpec) -> list[int]:
    """Joints (0 to 5) with a spring in the model TOML."""
    held = held_rigid(spec)
    springs = arm(spec.robot).stiffness
    return [j for j in range(6) if springs[j] is not None and f"j{j + 1}" not in held]


def model_parallelogram(spec: SetSpec) -> bool:
    """The load path the model is given: the other one where the set asks for it."""
    return arm(spec.robot).parallelogram != (spec.model_path == "other")


def model_toml(spec: SetSpec) -> str:
    """Text of the model TOML: springs put in (xr701), springs of missing joints taken out, load path as asked."""
    text = (DATA / f"{spec.robot}.toml").read_text(encoding="utf-8")
    own = NOMINAL_SPRINGS.get(spec.robot, {})
    blocks = re.split(r"(?m)^(?=\[\[joint\]\])", text)
    for k, block in enumerate(blocks):
        name = re.search(r'(?m)^name = "(j\d)"', block)
        if not block.startswith("[[joint]]") or name is None:
            continue
        joint = name.group(1)
        if joint in own:
            line = f'stiffness = {{ value = {own[joint]:.1f}, unit = "N m/rad", source = "assumed" }}\n'
            block = re.sub(r"(?m)^(limits = .*\n)", lambda m, line=line: m.group(1) + line, block, count=1)
        if joint in held_rigid(spec):
            block = re.sub(r"(?m)^stiffness = .*\n", "", block)
        blocks[k] = block
    path = "parallelogram" if model_parallelogram(spec) else "serial"
    return re.sub(r"(?m)^load_path = .*$", f'load_path = "{path}"', "".join(blocks), count=1)
