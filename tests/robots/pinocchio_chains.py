"""Robot files as pinocchio models, for the tests that take it as their oracle."""

from __future__ import annotations

import math
import tomllib
from importlib import resources
from typing import Any

import numpy as np

from robots.arrays import Array

TO_SI = {"m": 1.0, "mm": 1e-3, "rad": 1.0, "deg": math.pi / 180.0}


def raw(name: str) -> dict[str, Any]:
    return tomllib.loads(resources.files("robots").joinpath("data", f"{name}.toml").read_text(encoding="utf-8"))


def si(figure: dict[str, Any]) -> Any:
    return np.multiply(figure["value"], TO_SI[figure["unit"]])


def pinocchio_chain(pin: Any, data: dict[str, Any]) -> tuple[Any, int, Array, Array]:
    """The robot file as a pinocchio model, with its flange frame's id, and the signs and offsets."""

    def placed(xyz: Any, rpy: Any = (0.0, 0.0, 0.0)) -> Any:
        return pin.SE3(pin.rpy.rpyToMatrix(*map(float, rpy)), np.asarray(xyz, dtype=float))

    def framed(table: dict[str, Any]) -> Any:
        return placed(si(table["xyz"]), si(table["rpy"]) if "rpy" in table else (0.0, 0.0, 0.0))

    model, parent = pin.Model(), 0
    for joint in data["joint"]:
        if "dh" in joint:
            dh = {key: float(si(figure)) for key, figure in joint["dh"].items()}
            placement = placed((0, 0, 0), (dh["alpha"], 0, 0)) * placed((dh["a"], 0, 0)) * placed((0, 0, dh["d"]))
            kind = pin.JointModelRZ()
        else:
            placement = framed(joint["frame"])
            axis = np.array(joint["frame"].get("axis", [0, 0, 1]), dtype=float)
            kind = pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis))
        parent = model.addJoint(parent, kind, placement, joint["name"])
    flange = model.addFrame(pin.Frame("flange", parent, 0, framed(data["flange"]), pin.FrameType.OP_FRAME))
    sign = np.array([joint.get("sign", 1) for joint in data["joint"]], dtype=float)
    offset = np.array([si(joint["offset"]) if "offset" in joint else 0.0 for joint in data["joint"]])
    return model, flange, sign, offset
