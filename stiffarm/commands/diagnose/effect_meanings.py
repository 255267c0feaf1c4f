"""What the numbers of effects mean, in words for the shop floor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

# By family of the code (before the colon) and name of the number.
MEANINGS: Final[Mapping[str, Mapping[str, str]]] = {
    "joint-compliance": {"stiffness": "stiffness about the axis that comes on top of the spring"},
    "joint-tilt": {
        "stiffness_x": "stiffness against tilting about the joint's x axis",
        "stiffness_y": "stiffness against tilting about the joint's y axis",
        "turning": "1: the part behind the joint tilts, 0: the housing before it",
    },
    "angle-dependent-stiffness": {
        "cos1": "share of the compliance that goes with the cosine of the angle",
        "sin1": "share that goes with its sine",
        "cos2": "share that goes with the cosine of twice the angle",
        "sin2": "share that goes with the sine of twice the angle",
    },
    "gravity-compensator": {"share": "share by which it stiffens the joint at most", "phase": "lean where it does"},
    "hardening": {
        "share": "share of the compliance that is lost at large torques",
        "knee": "torque at which it bends",
        "power": "1: a bend, below: bends all the way",
    },
    "softening": {
        "share": "share of the compliance that is added at the torque named",
        "torque": "torque that the share belongs to",
        "power": "how steeply it grows",
    },
    "backlash": {
        "gap": "play between the flanks",
        "crossing": "torque that it takes to cross the gap",
        "preload": "1: the links' weight presses the flanks together, 0: it does not",
    },
    "friction": {
        "share": "share of the spring that the friction holds back",
        "friction": "torque at which it slips",
    },
    "payload": {"force": "force that acts with every load"},
    "load-point-offset": {axis: f"along the flange's {axis}" for axis in ("x", "y", "z")},
    "load-misalignment": {"tilt_x": "turned about the base's x", "tilt_y": "turned about the base's y"},
    "joint-zero-offset": {"angle": "real angle less the one that the controller says"},
    "gauge-zero": {axis: f"reading along {axis} without load" for axis in ("x", "y", "z")},
    "gauge-scale": {"share": "share by which it reads too much"},
    "drift": {
        **{axis: f"drift along {axis} over the whole campaign" for axis in ("x", "y", "z")},
        "settling": "time to settle over the campaign's; large: nearly straight",
    },
    "base-tilt": {"stiffness_x": "stiffness about the base's x", "stiffness_y": "stiffness about the base's y"},
    "base-vertical": {"stiffness": "vertical stiffness"},
    "parallelogram-bar": {"stiffness": "stiffness along the bar"},
    "tool-compliance": {"stiffness": "stiffness across the tool"},
    "link-flexibility": {"share": "share of the described compliance that comes on top"},
    "wrist-coupling": {"coupling": "turn of one wrist axis for a torque about the other"},
    "gear-ripple": {
        "cos": "share of the ripple in phase",
        "sin": "share of the ripple across it",
        "teeth": "ripples in a full turn",
    },
}


def meaning_of(code: str, name: str) -> str:
    """What a number of an effect means; empty for a user's own effect."""
    return MEANINGS.get(code.partition(":")[0], {}).get(name, "")
