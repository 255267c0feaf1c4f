"""A diagnosis in space, as files: gap.vtp with arrows at the measured poses, and the map of what an effect costs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from doe.diagnosis.space import Gaps, cost_of_leaving_out, gaps
from fem.arm import Arm
from fem.statics.loads import LoadedPoses
from robots import ModelDescription, content_hash
from robots.arrays import Array
from robots.constants import DOWN, M_TO_MM
from robots.quantities import rounded
from stiffarm.commands.diagnose.step import Diagnosed
from stiffarm.pages.blocks import Pictures
from stiffarm.pages.report import Block, Picture, Text
from stiffarm.session.outputs import OutputFolder
from surrogate.maps.blocks import sweep_engine
from surrogate.maps.data import Figures, MapData, figures
from surrogate.maps.mesh import described, point_cloud, save_mesh, write_map
from surrogate.maps.quantities import Kind, Poses, Quantities, Quantity

GAP_FILE, COST_STEM = "gap.vtp", "missing_effect"
COST_ARRAY = "error_without_effect_mm"
# Values of each swept coordinate: a map that a page shows, in a second or two.
POINTS = 15


@dataclass(frozen=True, eq=False)
class CostMap:
    """What leaving the effects out would cost over the workspace, under ``load_N`` straight down."""

    data: MapData
    load_N: float  # noqa: N815 - the unit's letter

    @property
    def figures(self) -> Figures:
        """Least, median and greatest, in mm."""
        found = figures(self.data.fields[COST_ARRAY].values)
        assert found is not None  # noqa: S101 - some pose was reached, else there is no map
        return found

    @property
    def worst_pose_deg(self) -> dict[str, float]:
        """The pose that suffers most, deg by coordinate."""
        q = np.degrees(self.data.q[self.figures.row_of_greatest])
        return dict(zip(self.data.coordinates, q.tolist(), strict=True))


def write_gap(d: Diagnosed, folder: OutputFolder, name: str = GAP_FILE) -> Gaps:
    """Write gap.vtp: at each measured pose what was read, and what the model leaves of it without and with effects."""
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
    return found


def cost_map(d: Diagnosed, new: ModelDescription) -> CostMap:
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
        "load": f"{load:.4g} N straight down, without {codes}",
        "effects": codes,
    }
    made = sweep_engine(Quantities(model, np.array(DOWN), (row,), point=point), POINTS).computed(metadata)
    made.require_reached("check the limits and couplings of the model file")
    return CostMap(made, load)


def payload(made: CostMap) -> dict[str, Any]:
    """What leaving the effects out costs, as JSON."""
    of = made.figures
    return {
        "load_N": rounded(made.load_N),
        "poses": of.count,
        "error_mm": {"min": rounded(of.least), "median": rounded(of.median), "max": rounded(of.greatest)},
        "worst_pose": {name: rounded(v) for name, v in made.worst_pose_deg.items()},
    }


def write_cost(made: CostMap, d: Diagnosed, new: Arm, folder: OutputFolder, before: str = "") -> None:
    """Write the map for ParaView and as a page to turn and pick in; ``before``: what file names begin with."""
    from stiffarm.commands.maps.viewer import viewer_page

    write_map(made.data, folder.path(f"{before}{COST_STEM}.vtu"))
    title = f"{d.given.description.title.split(' (')[0]}: what leaving out {made.data.metadata['effects']} costs"
    folder.write_text(f"{before}{COST_STEM}.html", viewer_page(made.data, new.description, new.model, title=title))


def campaign_picture(d: Diagnosed, found: Gaps, pictures: Pictures, before: str = "") -> Picture:
    """The whole campaign in space: the gap at the measured poses, and the poses to measure next.

    ``before``: what file names begin with, as of :func:`write_cost`.
    """
    from stiffarm.commands.diagnose.space_figure import space_figure

    planned = None if d.proposal is None else d.proposal.q
    next_ = "" if planned is None else " Diamonds with dashed arms: set-ups proposed to measure next."
    return pictures.add(
        space_figure(found, d.given, planned, changed=bool(d.in_model)),
        "gap_in_space",
        f"Arrows of measured minus simulated displacement.{next_} {before}{GAP_FILE} opens in ParaView with all loads.",
    )


def cost_blocks(d: Diagnosed, made: CostMap | None, pictures: Pictures, before: str = "") -> list[Block]:
    """What leaving the effects out costs over the workspace; nothing where none was found.

    ``before``: what file names begin with, as of :func:`write_cost`.
    """
    from stiffarm.commands.maps.figures.whole import one_figure

    if made is None:
        return []
    of, worst = made.figures, made.worst_pose_deg
    where = ", ".join(f"{name.removesuffix('_deg')} {value:.0f}" for name, value in worst.items() if value)
    return [
        Text(
            f"Without {made.data.metadata['effects']} the model would be off by {of.median:.2f} mm under "
            f"{made.load_N:.4g} N straight down (median of {of.count:,} poses over the joint limits), and by up to "
            f"{of.greatest:.2f} mm at {where or 'all joints zero'} deg."
        ),
        pictures.add(
            one_figure(made.data, COST_ARRAY, d.given),
            COST_STEM,
            f"What leaving it out would cost. {before}{COST_STEM}.html is the map to turn and pick in, "
            f"{before}{COST_STEM}.vtu is for "
            "ParaView. Far from the measured poses both models extrapolate.",
        ),
    ]
