"""Which law belongs to which code, and what a set must be like for it to be possible."""

from __future__ import annotations

from collections.abc import Callable

from . import body_laws, joint_laws, load_laws, outside_laws, strange_laws
from .chance import Chance
from .mechanics import Effect

Family = Callable[[Chance], Effect]

CATALOGUE: dict[str, Family] = {
    "joint-compliance": joint_laws.joint_compliance,
    "joint-tilt": body_laws.joint_tilt,
    "angle-dependent-stiffness": joint_laws.angle_dependent,
    "hardening": joint_laws.hardening,
    "softening": joint_laws.softening,
    "backlash": joint_laws.backlash,
    "friction": joint_laws.friction,
    "payload": load_laws.payload,
    "gravity-compensator": joint_laws.gravity_compensator,
    "base-tilt": body_laws.base_tilt,
    "base-vertical": body_laws.base_vertical,
    "parallelogram-bar": body_laws.parallelogram_bar,
    "load-path": body_laws.load_path,
    "link-flexibility": body_laws.link_flexibility,
    "tool-compliance": body_laws.tool_compliance,
    "load-point-offset": load_laws.load_point_offset,
    "load-misalignment": load_laws.load_misalignment,
    "joint-zero-offset": joint_laws.zero_offset,
    "gauge-zero": load_laws.gauge_zero,
    "gauge-scale": load_laws.gauge_scale,
    "drift": load_laws.drift,
    "gear-ripple": joint_laws.gear_ripple,
    "wrist-coupling": joint_laws.wrist_coupling,
    "turned-frame": load_laws.turned_frame,
    "tool-point-offset": load_laws.tool_point_offset,
    "angle-sign": joint_laws.angle_sign,
    "angle-offset": joint_laws.angle_offset,
    "angle-coupling": joint_laws.angle_coupling,
}
# Twelve of these nineteen act along time or lag, the others along pose and load.
OUTSIDE: dict[str, Family] = {
    "creep": outside_laws.creep,
    "warming": outside_laws.warming,
    "slip": outside_laws.slip,
    "stick-slip": outside_laws.stick_slip,
    "load-cell-hysteresis": outside_laws.load_cell_hysteresis,
    "touched-gauge": outside_laws.touched_gauge,
    "gauge-stick": outside_laws.gauge_stick,
    "frame-temperature": outside_laws.frame_temperature,
    "bearing-settling": outside_laws.bearing_settling,
    "floor-lag": outside_laws.floor_lag,
    "belt-retensioned": outside_laws.retensioned,
    "wind-up": strange_laws.approach,
    "partial-load-path": strange_laws.partial_load_path,
    "loose-base": strange_laws.loose_base,
    "cable-package": strange_laws.cable_package,
    "joints-coupled": strange_laws.coupled_joints,
    "floor-sag": strange_laws.floor_sag,
    "column-buckling": strange_laws.column,
    "one-sided-stiffness": strange_laws.one_sided,
}
BAR = ("parallelogram-bar", "load-path", "partial-load-path")
# Whole tables that are counted otherwise, or scaled, are no half of a pair; links need another model.
ALONE = ("gauge-scale", "angle-sign", "angle-offset", "angle-coupling", "link-flexibility", *BAR)
PAIRED = tuple(name for name in CATALOGUE if name not in ALONE)
