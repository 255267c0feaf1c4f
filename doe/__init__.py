"""Experiments: measurement tables, designs, sensitivity, staged and global calibration."""

from typing import TYPE_CHECKING

from robots.lazily import lazily

if TYPE_CHECKING:
    from doe.model_file.calibrated import with_constant_springs, with_spring_laws
    from doe.planning.designs import factorial_poses, level_grid, two_level_factorial
    from doe.published.comparison import (
        Prediction,
        constant_fit,
        constant_left_out,
        leave_one_pose_out,
        staged_left_out,
    )
    from doe.published.constant import ConstantFit, SpringEstimate, fit_constant
    from doe.published.parametric import PoseFit, fit_pose
    from doe.published.readings import Equations, equations, loaded_points, model_compliances, select_loads
    from doe.published.scheme import Scheme, bundled_scheme, load_scheme
    from doe.published.sensitivity import PoseEffects, sensitivity_study
    from doe.published.spring_regression import SpringPoints, fit_law
    from doe.published.staged import StagedResult, calibrate_staged
    from doe.tables.measurements import Measurements
    from doe.tables.reading import bundled_data, read_measurements, write_measurements
else:
    __getattr__ = lazily(__name__)

__all__ = [
    "ConstantFit",
    "Equations",
    "Measurements",
    "PoseEffects",
    "PoseFit",
    "Prediction",
    "Scheme",
    "SpringEstimate",
    "SpringPoints",
    "StagedResult",
    "bundled_data",
    "bundled_scheme",
    "calibrate_staged",
    "constant_fit",
    "constant_left_out",
    "equations",
    "factorial_poses",
    "fit_constant",
    "fit_law",
    "fit_pose",
    "leave_one_pose_out",
    "level_grid",
    "load_scheme",
    "loaded_points",
    "model_compliances",
    "read_measurements",
    "select_loads",
    "sensitivity_study",
    "staged_left_out",
    "two_level_factorial",
    "with_constant_springs",
    "with_spring_laws",
    "write_measurements",
]
