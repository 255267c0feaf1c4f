"""Arms that no bundled robot is like: seven skew joints with everything a description has, and a small one of four."""

from __future__ import annotations

from typing import Any

from robots import ModelDescription
from robots.library.models import parse_description


def figure(value: Any, unit: str) -> str:
    return f'{{ value = {value}, unit = "{unit}", source = "assumed" }}'


def skew(name: str = "skew", joints: int = 7, springs: bool = True, more: str = "") -> ModelDescription:
    """Joints with frames that are turned, alternating signs and offsets, coordinates of other names, no links."""
    axes = ((0, 0, 1), (0, 1, 0), (0.1, -1, 0.2), (1, 0, 0), (0, 1, -0.3), (0, 0, -1), (1, 1, 0))
    parts = [
        'schema = "stiffarm-model/1"',
        f'name = "{name}"',
        'title = "Skew"',
        "[sources]",
        '[payload]\nvalue = 40\nunit = "kg"\nsource = "assumed"',
    ]
    for k in range(joints):
        parts += [
            "[[joint]]",
            f'name = "a{k + 1}"',
            f'coordinate = "theta{k + 1}_deg"',
            f"sign = {1 if k % 2 else -1}",
            f"offset = {figure(10 * k - 20, 'deg')}",
            f"limits = {figure([-100 + 5 * k, 90], 'deg')}",
        ]
        if springs and k != 5:
            parts.append(f"stiffness = {figure(1e6 / (k + 1), 'N m/rad')}")
        rpy = figure([5 * k, -3 * k, 40 if k == 2 else 0], "deg")
        xyz = figure([0.05 * k, 0.02, 0.4], "m")
        parts.append(f"frame = {{ xyz = {xyz}, rpy = {rpy}, axis = {list(axes[k])} }}")
    parts.append(f"[flange]\nxyz = {figure([0.0, 0.05, 0.1], 'm')}\nrpy = {figure([10, 20, 30], 'deg')}")
    return parse_description("\n".join([*parts, more]), name)


EVERYTHING = f"""
[tool]
xyz = {figure([0.1, -0.05, 0.2], "m")}
rpy = {figure([0, 90, 0], "deg")}
[tool.stiffness]
tx = {figure(3e6, "N/m")}
rz = {figure(4e5, "N m/rad")}
[base]
tz = {figure(2e7, "N/m")}
tx = {figure(5e7, "N/m")}
rx = {figure(5e6, "N m/rad")}
ry = {figure(8e6, "N m/rad")}
entry = [{{ rows = ["tx", "ry"], compliance = {figure(1e-9, "rad/N")} }}]
[load]
offset = {figure([0.01, 0.02, -0.01], "m")}
tilt = {figure([1, -2, 0.5], "deg")}
"""
