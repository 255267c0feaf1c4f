"""Experiments: measurement tables, designs, sensitivity, staged and global calibration."""

from typing import TYPE_CHECKING

from robots.lazily import lazily

if TYPE_CHECKING:
    from doe.estimation.campaign import Campaign, bundled_campaign, load_campaign
    from doe.planning.designs import factorial_poses, level_grid, two_level_factorial
    from doe.published.parametric import PoseFit, fit_pose
    from doe.published.pose_studies import SpringPoints, fit_law
    from doe.published.sensitivity import PoseEffects, sensitivity_study
    from doe.tables.loaded import loaded_points, select_loads
    from doe.tables.measurements import Measurements
    from doe.tables.reading import bundled_data, read_measurements, write_measurements
else:
    __getattr__ = lazily(__name__)

__all__ = [
    "Campaign",
    "Measurements",
    "PoseEffects",
    "PoseFit",
    "SpringPoints",
    "bundled_campaign",
    "bundled_data",
    "factorial_poses",
    "fit_law",
    "fit_pose",
    "level_grid",
    "load_campaign",
    "loaded_points",
    "read_measurements",
    "select_loads",
    "sensitivity_study",
    "two_level_factorial",
    "write_measurements",
]
