"""The published factorial: effects of the springs on each pose's deflection."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from doe import Measurements, PoseEffects, sensitivity_study
from fem.arm import Arm
from robots.quantities import Quantity, ranged, rounded
from stiffarm.commands.sensitivity.ranking import MOST_PANELS, ranking
from stiffarm.result import Result, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def payload(results: Sequence[PoseEffects]) -> list[dict[str, Any]]:
    """Sensitivity effects by pose."""
    return [
        {
            "pose": e.pose,
            "read": f"d{'xyz'[e.component]}",
            "effect_mm": {joint: rounded(v) for joint, v in zip(e.joints, e.effect_mm, strict=True)},
            "share": {joint: rounded(v) for joint, v in zip(e.joints, e.share, strict=True)},
            "ranking": list(e.ranking),
        }
        for e in results
    ]


def result(given: Arm, data: Measurements, springs: tuple[str, ...], levels: tuple[float, float]) -> Result:
    """Effect of stiffening each spring from the low to the high level, at the poses of ``data``."""
    from stiffarm.pages.numbers import naturally

    found = sensitivity_study(given.model, data, springs, *levels)
    order = naturally([e.pose for e in found])
    effects = sorted(found, key=lambda e: order.index(e.pose))
    size = np.array([np.abs(e.effect_mm) for e in effects])
    joints, path = effects[0].joints, given.model.load_path
    columns = zip(joints, np.array([e.effect_mm for e in effects]).T, strict=True)
    shares = zip(joints, np.array([e.share for e in effects]).T, strict=True)
    table = Table(
        "effects",
        f"Effect of stiffening each spring from {ranged(*levels)} N m/rad ({path}), positive: less deflection",
        {
            "pose": [e.pose for e in effects],
            "read": [f"d{'xyz'[e.component]}" for e in effects],
            "ranking": [" > ".join(e.ranking) for e in effects],
        },
        {Quantity(f"effect_{joint}", "mm", 1e3, joint): 1e-3 * values for joint, values in columns},
        in_files={Quantity(f"share_{joint}"): values for joint, values in shares},
    )
    how = (
        f"Two-level full factorial of {', '.join(joints)}, {path} load path. The deflection is a sum over springs, so "
        "there are no interactions. Positive: a stiffer spring lowers the deflection."
    )
    return ranking(
        given,
        data,
        joints,
        size / max(float(size.sum(axis=1).mean()), 1e-300),
        [e.ranking[0] for e in effects],
        (f"every spring from {ranged(*levels)} N m/rad",),
        how,
        partial(_figure, path, effects[:MOST_PANELS], levels),
        (table,),
        {"method": "factorial", "low_Nm_per_rad": levels[0], "high_Nm_per_rad": levels[1]},
    )


def _figure(path: str, effects: Sequence[PoseEffects], levels: tuple[float, float]) -> Figure:
    from stiffarm.commands.sensitivity.figures import sensitivity_figure

    return sensitivity_figure({path: effects}, levels)
