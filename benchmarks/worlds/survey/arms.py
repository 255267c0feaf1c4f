"""Three arms as modified Denavit-Hartenberg tables, and the model file that the program is given of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SurveyArm:
    """An arm as its maker describes it.

    ``dh`` (6, 4): alpha (rad), a, d (m), theta offset (rad), modified; ``limits`` (6, 2) rad; ``kg`` (6,) of the body
    behind each joint, in the middle of its link; ``stiffness`` (6,) N m/rad, 0 where the maker calls the joint rigid;
    ``payload`` kg.
    """

    name: str
    dh: Floats
    limits: Floats
    kg: Floats
    stiffness: Floats
    payload: float


def arms() -> list[SurveyArm]:
    """A heavy arm, a middling one with a skew wrist, a light one."""
    h = np.pi / 2.0
    heavy = SurveyArm(
        "schlepper",
        np.array(
            [[0, 0, 0.75, 0], [-h, 0.35, 0, 0], [0, 1.2, 0, -h], [-h, 0.12, 1.15, 0], [h, 0, 0, 0], [-h, 0, 0.22, 0]]
        ),
        np.radians([[-180, 180], [-120, 20], [-100, 150], [-300, 300], [-120, 120], [-300, 300]]),
        np.array([0.0, 210.0, 200.0, 0.0, 35.0, 0.0]),
        np.array([2.1e6, 2.6e6, 1.7e6, 0.0, 0.0, 0.0]),
        120.0,
    )
    middling = SurveyArm(
        "mittler",
        np.array(
            [[0, 0, 0.42, 0], [-h, 0.16, 0, -h], [0, 0.6, 0, 0], [-h, 0.13, 0.62, 0], [h, 0, 0, 0], [-h, 0, 0.1, 0]]
        ),
        np.radians([[-170, 170], [-90, 130], [-170, 80], [-200, 200], [-120, 120], [-350, 350]]),
        np.array([0.0, 40.0, 42.0, 0.0, 6.0, 0.0]),
        np.array([0.0, 3.2e5, 1.9e5, 0.0, 0.0, 0.0]),
        16.0,
    )
    light = SurveyArm(
        "leicht",
        np.array(
            [[0, 0, 0.15, 0], [h, 0, 0, 0], [0, -0.61, 0, 0], [0, -0.57, 0.16, 0], [h, 0, 0.12, 0], [-h, 0, 0.1, 0]]
        ),
        np.radians([[-180, 180]] * 6),
        np.array([0.0, 10.0, 5.0, 2.2, 2.0, 0.0]),
        np.array([0.0, 9e4, 7e4, 4e4, 0.0, 0.0]),
        8.0,
    )
    return [heavy, middling, light]


def model_toml(arm: SurveyArm) -> str:
    """The model file of an arm."""

    def value(x: float, unit: str) -> str:
        return f'{{ value = {x!r}, unit = "{unit}", source = "maker" }}'

    tube = 'section = {{ kind = "tube", diameter = {}, wall = {} }}'.format(value(200.0, "mm"), value(8.0, "mm"))
    out = [
        f'schema = "stiffarm-model/1"\nname = "{arm.name}"\ntitle = "{arm.name}"',
        f"mass = {value(float(arm.kg.sum()) + 80.0, 'kg')}",
        '[sources]\nmaker = "made up"',
        "[materials.steel]",
        f"youngs_modulus = {value(210.0, 'GPa')}",
        f"poissons_ratio = {value(0.3, '1')}",
        f"density = {value(7850.0, 'kg/m^3')}",
    ]
    for j in range(6):
        alpha, a, d, theta = (float(x) for x in arm.dh[j])
        low, high = (round(float(x), 9) for x in np.degrees(arm.limits[j]))
        out += [
            "[[joint]]",
            f'name = "j{j + 1}"',
            f'coordinate = "q{j + 1}_deg"',
            f'limits = {{ value = [{low}, {high}], unit = "deg", source = "maker" }}',
        ]
        if arm.stiffness[j] > 0.0:
            out.append(f"stiffness = {value(float(arm.stiffness[j]), 'N m/rad')}")
        if theta:
            out.append(f"offset = {value(round(float(np.degrees(theta)), 9), 'deg')}")
        out += [
            "[joint.dh]",
            f"alpha = {value(round(float(np.degrees(alpha)), 9), 'deg')}",
            f"a = {value(1e3 * a, 'mm')}",
            f"d = {value(1e3 * d, 'mm')}",
        ]
    out += ["[flange]", 'xyz = { value = [0, 0, 0], unit = "mm", source = "maker" }']
    for j in range(1, 5):
        if not arm.kg[j]:
            continue
        out += [
            "[[link]]",
            f'name = "link-{j + 1}"',
            f'body = "j{j + 1}"',
            'material = "steel"',
            f"mass = {value(float(arm.kg[j]), 'kg')}",
            tube,
        ]
    return "\n".join(out) + "\n"
