"""Cutting force and the surface error that it leaves: models of the force, the error with its uncertainty."""

from machining.cutting.coefficients import PUBLISHED, CuttingCoefficients, published, shop_coefficients
from machining.cutting.comparison import Change, Comparison, compare
from machining.cutting.end_mill import EndMill, Engagement, ToolBending, down_milling, slotting, up_milling
from machining.cutting.equilibrium import Balance, Balanced
from machining.cutting.force import ConstantForce, CuttingForce, ForceAlong, MillingForce
from machining.cutting.milling_file import Cut, read_milling
from machining.cutting.process_axes import ProcessAxes, process_axes
from machining.cutting.spread import Estimated
from machining.cutting.stiffness_uncertainty import (
    CalibratedCompliances,
    Drawn,
    PartShares,
    StiffnessUncertainty,
    assumed_uncertainty,
    calibrated_uncertainty,
    drawn_objective,
    drawn_stiffness,
    part_shares,
    stiffness_uncertainty,
)
from machining.cutting.surface_error import STATISTICS, SurfaceError, statistics_of, surface_error

__all__ = [
    "PUBLISHED",
    "STATISTICS",
    "Balance",
    "Balanced",
    "CalibratedCompliances",
    "Change",
    "Comparison",
    "ConstantForce",
    "Cut",
    "CuttingCoefficients",
    "CuttingForce",
    "Drawn",
    "EndMill",
    "Engagement",
    "Estimated",
    "ForceAlong",
    "MillingForce",
    "PartShares",
    "ProcessAxes",
    "StiffnessUncertainty",
    "SurfaceError",
    "ToolBending",
    "assumed_uncertainty",
    "calibrated_uncertainty",
    "compare",
    "down_milling",
    "drawn_objective",
    "drawn_stiffness",
    "part_shares",
    "process_axes",
    "published",
    "read_milling",
    "shop_coefficients",
    "slotting",
    "statistics_of",
    "stiffness_uncertainty",
    "surface_error",
    "up_milling",
]
