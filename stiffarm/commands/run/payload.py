"""What the whole chain found, as JSON-ready dictionaries."""

from __future__ import annotations

from typing import Any

import numpy as np

from robots.quantities import rounded
from stiffarm.commands.calibrate import tables as calibration_tables
from stiffarm.commands.run.link_models import LinkModels, Pair
from stiffarm.session.steps import FactorialRuns, RigidJoints
from stiffarm.session.words.springs import at_widest_bound


def rigid(result: RigidJoints) -> dict[str, Any]:
    """The rigid-joint model against the readings."""
    return {
        "poses": list(result.pose),
        "measured_mm": [rounded(v) for v in result.measured_mm],
        "simulated_mm": [rounded(v) for v in result.simulated_mm],
        "factor_measured_over_simulated": [rounded(v) for v in result.factor],
        "median_factor": rounded(float(np.median(result.factor))),
    }


def link_models(compared: LinkModels) -> dict[str, Any]:
    """Every load path and scheme with the run's own links and with those beside them."""
    return {
        "own": compared.own.links,
        "beside": compared.other.links,
        "rigid_joints_readings": {
            side.links: {path: [rounded(v) for v in alone] for path, alone in side.alone_mm.items()}
            for side in (compared.own, compared.other)
        },
        "calibrations": [_link_pair(pair, compared) for pair in compared.pairs],
    }


def _link_pair(pair: Pair, compared: LinkModels) -> dict[str, Any]:
    better, poses = pair.poses_better()
    return {
        "calibration": pair.own.name,
        "load_path": pair.own.model.load_path,
        "scheme": pair.own.scheme,
        **{
            side.links: {
                "rms_mm": rounded(one.found.rms_mm),
                "left_one_pose_out_rms_mm": rounded(one.left_out_rms_mm),
                "links_bar_and_crank_share": [rounded(float(v)) for v in side.share[one.name]],
                "poses": calibration_tables.readings(one).rows(),
            }
            for side, one in ((compared.own, pair.own), (compared.other, pair.other))
        },
        "left_out_difference_mm": rounded(pair.left_out_difference_mm),
        "poses_predicted_better": better,
        "poses_predicted": poses,
        "springs": [
            {
                "joint": s.joint,
                **({} if s.where is None else {"stage": s.where[0], "pose": s.where[1]}),
                **{
                    side.links: {
                        "k_Nm_per_rad": None if at_widest_bound(value) else rounded(value),
                        "interval_Nm_per_rad": [rounded(low), rounded(high)],
                    }
                    for side, (value, low, high) in ((compared.own, s.own), (compared.other, s.other))
                },
                "each_within_the_others_interval": {"within": True, "outside": False, "unknown": None}[s.agreement],
            }
            for s in pair.springs
        ],
    }


def factorial(runs: FactorialRuns) -> dict[str, Any]:
    """The factorial runs as columns."""
    columns = {name: [rounded(v) for v in runs.poses_deg[:, i]] for i, name in enumerate(runs.inputs)}
    return columns | {"stiffness_N_per_mm": [rounded(v) for v in runs.stiffness_N_per_mm]}
