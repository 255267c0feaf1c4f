"""A diagnosis in space, as files: gap.vtp with arrows at the measured poses, and the map of what an effect costs."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from doe.diagnosis.space import cost_of_leaving_out, gaps
from fem.arm import Arm
from fem.statics.loads import LoadedPoses
from robots import ModelDescription, content_hash
from robots.arrays import Array
from robots.constants import DOWN, M_TO_MM
from robots.quantities import rounded, significant
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.pages.report import Block, Text
from stiffarm.result import Drawing
from stiffarm.session.outputs import OutputFolder
from surrogate.maps.blocks import sweep_engine
from surrogate.maps.data import Figures, MapData, figures
from surrogate.maps.mesh import described, point_cloud, save_mesh, write_map
from surrogate.maps.quantities import Kind, Poses, Quantities, Quantity

COST_STEM = "missing_effect"
COST_ARRAY = "error_without_effect_mm"
# Values of each swept coordinate: a map that a page shows, in a second or two.
POINTS = 15


def write_gap(d: Diagnosed, folder: OutputFolder, name: str) -> None:
    """Write the gap for ParaView: at each pose what was read, and what the model leaves of it before and after."""
    found = gaps(d.found)
    named = {"measured": found.measured, "gap_before": found.before, "gap_after": found.after}
    # An arrow of which a component is NaN is not drawn: 0 there, and was_read tells these from those that were read.
    arrays: dict[str, tuple[Array, str]] = {f"{k}_mm": (M_TO_MM * np.nan_to_num(v), "mm") for k, v in named.items()}
    arrays |= {
        "was_read": (np.isfinite(found.measured).astype(np.float64), "1"),
        "outlier": (found.outlier.astype(np.float64), "1"),
    }
    arrays["force_N"] = found.force, "N"
    texts = {
        "pose": found.pose,
        "readings": [d.used.source],
        "model": [d.given.description.title],
        "effects": [f.code for f in d.in_model],
    }
    save_mesh(described(point_cloud(M_TO_MM * found.point), arrays, texts), folder.path(name))


def cost_map(d: Diagnosed, new: ModelDescription) -> MapData:
    """The displacement that the model without the effects misses, over the sweep of the workspace.

    ``new``: the model with them.

    The load is the largest force that was read, straight down as in stiffness maps, at the point that was read if
    that is one point of the flange.
    """
    at = d.found.before.setting.data.free.at
    load = float(np.linalg.norm(at.wrench[:, :3], axis=1).max())
    one_point = not np.ptp(at.point, axis=0).any()
    point = at.point[0] if one_point else d.given.robot.T_flange_tool[:3, 3]
    wrench = load * np.array([*DOWN, 0.0, 0.0, 0.0])

    def missed(p: Poses) -> list[Array]:
        n = len(p.q)
        at = LoadedPoses(p.q, np.broadcast_to(wrench, (n, 6)), np.broadcast_to(point, (n, 3)))
        return [M_TO_MM * np.linalg.norm(cost_of_leaving_out(d.found, at), axis=1)]

    codes = ", ".join(f.code for f in d.in_model)
    row = Quantity("missing", (Kind(COST_ARRAY, "mm", "error where the missing effect is left out"),), missed)
    model = d.found.after.setting.arm
    metadata = {
        "robot": model.robot.name,
        "model_hash": content_hash(new),
        "load": f"{significant(load)} N straight down, without {codes}",
        "load_N": repr(load),
        "effects": codes,
    }
    made = sweep_engine(Quantities(model, np.array(DOWN), (row,), point=point), POINTS).computed(metadata)
    made.require_reached("check the limits and couplings of the model file")
    return made


def _figures(made: MapData) -> Figures:
    """Least, median and greatest error, mm."""
    found = figures(made.fields[COST_ARRAY].values)
    assert found is not None  # noqa: S101 - some pose was reached, else there is no map
    return found


def _worst(made: MapData) -> dict[str, float]:
    """The pose that suffers most, deg by coordinate."""
    return dict(zip(made.coordinates, np.degrees(made.q[_figures(made).row_of_greatest]).tolist(), strict=True))


def cost_facts(made: MapData) -> dict[str, Any]:
    """What leaving the effects out costs, for JSON."""
    of = _figures(made)
    return {
        "load_N": rounded(float(made.metadata["load_N"])),
        "poses": of.count,
        "error_mm": {"min": rounded(of.least), "median": rounded(of.median), "max": rounded(of.greatest)},
        "worst_pose": {name: rounded(v) for name, v in _worst(made).items()},
    }


def write_cost(made: MapData, d: Diagnosed, new: Arm, folder: OutputFolder, before: str = "") -> None:
    """Write the map for ParaView and as a page to turn and pick in; ``before``: what file names begin with."""
    from stiffarm.commands.maps.viewer import viewer_page

    write_map(made, folder.path(f"{before}{COST_STEM}.vtu"))
    title = f"{d.given.description.title.split(' (')[0]}: what leaving out {made.metadata['effects']} costs"
    folder.write_text(f"{before}{COST_STEM}.html", viewer_page(made, new.description, new.model, title=title))


def cost_blocks(made: MapData, given: Arm, before: str = "") -> tuple[Block, ...]:
    """What leaving the effects out costs over the workspace; ``before``: as of :func:`write_cost`."""
    from stiffarm.commands.maps.figures.whole import one_figure

    of = _figures(made)
    where = ", ".join(f"{name.removesuffix('_deg')} {value:.0f}" for name, value in _worst(made).items() if value)
    load = significant(float(made.metadata["load_N"]))
    text = (
        f"Without {made.metadata['effects']} the model would be off by {significant(of.median, 2)} mm under {load} N "
        f"straight down (median of {of.count:,} poses over the joint limits), and by up to "
        f"{significant(of.greatest, 2)} mm at {where or 'all joints zero'} deg."
    )
    caption = (
        f"What leaving it out would cost. {before}{COST_STEM}.html is the map to turn and pick in, "
        f"{before}{COST_STEM}.vtu is for ParaView. Far from the measured poses both models extrapolate."
    )
    return Text(text), Drawing(COST_STEM, caption, "missing effect", partial(one_figure, made, COST_ARRAY, given))
