"""What a calibration from positions gives back: the model, a URDF, and what a controller takes."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from doe.absolute.calibrate import Positions
from doe.absolute.chain import flange_targets
from doe.absolute.written import Written
from machining.programs.controller_offsets import ControllerOffsets, controller_offsets, orientations
from robots import save_description
from robots.frames import framed
from robots.quantities import rounded, significant
from robots.robot import robot_from
from robots.urdf.writing import urdf_text
from stiffarm.pages.report import Section, Table, Text
from stiffarm.session.outputs import OutputFolder

MODEL, URDF, CONTROLLER = "model.toml", "calibrated.urdf", "controller.json"
SCHEMA = "stiffarm-controller-offsets/1"
ZERO_WORDS = (
    "The actual angle of an axis is the angle that the controller shows plus this correction: enter the actual angle "
    "when mastering. These readings do not identify the zeros of axes without a value."
)


def offsets(c: Positions, w: Written) -> tuple[ControllerOffsets, ...]:
    """What controllers of the arm take."""
    sessions = {
        name: framed(frame.R, frame.t) for name, frame in zip(c.found.data.session.names, w.fit.frames, strict=True)
    }
    at = flange_targets(w.fit.layout, w.fit.u)
    targets = {name: at[k] for k, name in enumerate(c.found.data.target.names)}
    known = np.array([_is_known(c, joint.name, joint.zero_error is not None) for joint in w.description.joint])
    return controller_offsets(robot_from(w.description), sessions, targets, known)


def _is_known(c: Positions, joint: str, described: bool) -> bool:
    """Whether a joint's zero is known: identified, or not asked for and in the model already."""
    free = next((f for f in c.findings if f.name == f"{joint}.zero"), None)
    return described if free is None else free.value is not None


def remarks(c: Positions, w: Written) -> tuple[str, ...]:
    """What the files cannot hold."""
    kinds = {one.kind for one in w.fit.layout.unknowns if one.kind not in ("target", "rail", "payload")}
    out = list(w.notes)
    turning = {"ratio": "ratios", "coupling": "couplings", "periodic": "error curves"}
    lost = [words for kind, words in turning.items() if kind in kinds]
    if kinds & {"spring"}:
        lost.append("springs")
    if lost:
        out.append(f"{URDF} has the joints' frames and zeros; a URDF cannot hold {', '.join(lost)}: see {MODEL}")
    if "frame" in kinds and "zero" in kinds:
        out.append(
            "zeros found together with frames are valid only with these frames: for a controller that takes zeros "
            "alone, calibrate again with --free zeros"
        )
    return tuple(out)


def content(c: Positions, w: Written, found: tuple[ControllerOffsets, ...]) -> dict[str, Any]:
    """What positions.json says of it."""
    return {
        "model": MODEL,
        "urdf": URDF,
        "controller": CONTROLLER,
        "model_rms_mm": rounded(1e3 * float(np.sqrt(np.mean(np.sum(w.fit.residual[c.right] ** 2, axis=1))))),
        "springs_without_value": list(w.silent),
        "leaving_them_out_moves_rms_mm": rounded(1e3 * w.moved_m),
        "found_without_place_in_the_model": list(w.elsewhere),
        "remarks": list(remarks(c, w)),
        "controllers": [controller(one) for one in found],
    }


def controller(one: ControllerOffsets) -> dict[str, Any]:
    """What one controller takes, keys with units."""
    return {
        "formats": list(one.formats),
        "joint_zeros": [
            {"axis": name, "really_beyond_shown_deg": rounded(float(v))}
            for name, v in zip(one.axes, one.zeros_deg, strict=True)
        ],
        "robot_frame": "the controller's" if one.knows_robot_frame else "the model's base frame",
        "robot_frame_in_tracker": [
            {"session": name, "position_mm": (1e3 * T[:3, 3]).tolist(), "orientation": orientations(T[:3, :3])}
            for name, T in one.T_tracker_robot.items()
        ],
        "tools": [
            {"target": name, "x_mm": 1e3 * float(p[0]), "y_mm": 1e3 * float(p[1]), "z_mm": 1e3 * float(p[2])}
            for name, p in one.tools.items()
        ],
    }


def write(c: Positions, w: Written, found: tuple[ControllerOffsets, ...], folder: OutputFolder) -> dict[str, Any]:
    """model.toml, calibrated.urdf, controller.json."""
    save_description(w.description, folder.path(MODEL))
    at = flange_targets(w.fit.layout, w.fit.u)
    links = _link_names(c.found.data.target.names)
    comment = f"stiffarm: calibrated from positions {c.found.data.source}, SHA-256 {c.found.data.sha256}"
    points = {link: at[k] for k, link in enumerate(links)}
    folder.write_text(URDF, urdf_text(robot_from(w.description), points, comment))
    folder.write_json(
        CONTROLLER,
        {
            "schema": SCHEMA,
            "robot": w.description.name,
            "zeros": ZERO_WORDS,
            "controllers": [controller(one) for one in found],
        },
    )
    return {}


def _link_names(targets: tuple[str, ...]) -> list[str]:
    """Names of links for targets: letters, digits and underscores, each once."""
    out: list[str] = []
    for k, name in enumerate(targets, start=1):
        link = "target_" + (re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or str(k))
        out.append(link if link not in out else f"{link}_{k}")
    return out


def section(c: Positions, w: Written, found: tuple[ControllerOffsets, ...]) -> Section:
    """The page's part on what to do with the result."""
    tables = []
    for one in found:
        who = f"for {', '.join(one.formats)}" if one.formats else "as tables of this model count the angles"
        rows = tuple((name, significant(v, 4)) for name, v in zip(one.axes, one.zeros_deg, strict=True))
        tables.append(Table(f"Joint zeros, {who}", ("axis", "actual minus shown (deg)"), rows, text_columns=(0,)))
        tools = tuple((name, *(significant(1e3 * v, 6) for v in p)) for name, p in one.tools.items())
        heads = ("target", "x (mm)", "y (mm)", "z (mm)")
        tables.append(Table(f"Targets in the flange frame, {who}", heads, tools, text_columns=(0,)))
    text = (
        f"{MODEL} is the arm with its errors, for every other command; {URDF} has the calibrated frames and zeros; "
        f"{CONTROLLER} has what a controller can use, including the robot's base frames in the tracker's frame. Errors "
        "of joint frames, ratios, couplings and curves cannot be entered in a controller: `stiffarm post --compensate` "
        f"with this model corrects them in programs. {ZERO_WORDS}"
    )
    return Section("Corrections", (Text(text), *tables))
