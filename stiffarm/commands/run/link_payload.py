"""Calibrations with two models of the links as JSON."""

from __future__ import annotations

from typing import Any

from stiffarm.commands.calibrate import payload as calibration_payload
from stiffarm.commands.run.link_models import LinkModels, Pair
from stiffarm.session.payloads import number
from stiffarm.session.spring_words import at_widest_bound


def payload(compared: LinkModels) -> dict[str, Any]:
    """Every load path and scheme with the run's own links and with those beside them."""
    return {
        "own": compared.own.links,
        "beside": compared.other.links,
        "rigid_joints_readings": {
            side.links: {path: [number(v) for v in alone] for path, alone in side.alone_mm.items()}
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
                "rms_mm": number(one.rms_mm),
                "left_one_pose_out_rms_mm": number(one.left_out_rms_mm),
                "links_bar_and_crank_share": [number(float(v)) for v in side.share[one.name]],
                "poses": calibration_payload.poses(one),
            }
            for side, one in ((compared.own, pair.own), (compared.other, pair.other))
        },
        "left_out_difference_mm": number(pair.left_out_difference_mm),
        "poses_predicted_better": better,
        "poses_predicted": poses,
        "springs": [
            {
                "joint": s.joint,
                **({} if s.where is None else {"stage": s.where[0], "pose": s.where[1]}),
                **{
                    side.links: {
                        "k_Nm_per_rad": None if at_widest_bound(value) else number(value),
                        "interval_Nm_per_rad": [number(low), number(high)],
                    }
                    for side, (value, low, high) in ((compared.own, s.own), (compared.other, s.other))
                },
                "each_within_the_others_interval": {"within": True, "outside": False, "unknown": None}[s.agreement],
            }
            for s in pair.springs
        ],
    }
