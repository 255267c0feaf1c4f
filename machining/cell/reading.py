"""Cell files read: TOML to a :class:`Cell`, with the mesh files that lie beside it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from machining.cell.cell import Cell, Fixture, LinearAxis, Load, Tool, Turntable
from machining.cell.schema import (
    BoxShape,
    CellFile,
    ChangedToolTable,
    CylinderShape,
    LinearAxisTable,
    MeshShape,
    Placed,
    Shape,
    ToolTable,
    TurntableTable,
)
from machining.cell.solids import Body, Solid, box, cylinder, mesh_file, sphere
from robots import InputError
from robots.arrays import Array
from robots.constants import MM
from robots.files.reading import parse_toml, read_text
from robots.files.validated import tuples, validated
from robots.frames import framed, rotation_rpy
from robots.inverse.axis_lines import basis


def read_cell(path: str | Path) -> Cell:
    """Read a cell file; mesh files are found beside it, by paths relative to its folder.

    Raises
    ------
    InputError
        The file is missing or no TOML, a mesh that is missing, cannot be read or is not closed, a name used twice.
    InputErrors
        Several keys that do not fit the schema, all of them.
    """
    file = Path(path)
    return parse_cell(read_text(file, "cell file"), str(file), file.resolve().parent)


def parse_cell(text: str, where: str, folder: Path) -> Cell:
    """Read a cell from TOML text; ``where`` names it in messages, ``folder`` holds the mesh files."""
    # TOML has lists and whole numbers; both are fine where tuples and floats are meant.
    table = validated(CellFile, tuples(parse_toml(text, where)), where)
    T_world_part = frame(table.part)
    part = None if table.part.shape is None else Body("part", (_solid(table.part.shape, folder, "part"),))
    return Cell(
        name=table.name,
        T_world_base0=frame(table.robot),
        T_world_part0=T_world_part,
        tool=_tool(table.tool, folder),
        part=None if part is None else part.moved(T_world_part),
        fixtures=tuple(Fixture(_body(f.name, f.shape, f, folder), f.on_turntable) for f in table.fixture),
        floor=None if table.floor is None or table.floor.none else table.floor.height_mm * MM,
        stands=table.floor is None,
        beam_radius=_millimetres(table.robot.beam_radius_mm),
        linear_axes=tuple(_linear_axis(axis, folder) for axis in table.linear_axis),
        turntable=None if table.turntable is None else _turntable(table.turntable),
        joint_speed=_rates(table.robot.joint_speed_deg_s),
        joint_acceleration=_rates(table.robot.joint_acceleration_deg_s2),
        safety=table.robot.safety_mm * MM,
        home=None if table.robot.home_deg is None else np.radians(table.robot.home_deg),
        allowed_contacts=table.allowed_contacts,
        commands=table.commands,
        moves=table.moves,
        tools=tuple(_changed(key.strip(), one, folder) for key, one in table.tools.items()),
    )


def frame(placed: Placed) -> Array:
    """Transform (4, 4) m of a frame's table; x is laid onto the plane across z."""
    R = np.eye(3)
    if placed.rpy_deg is not None:
        R = rotation_rpy(np.radians(placed.rpy_deg))
    elif placed.z_axis is not None and placed.x_axis is not None:
        R = basis(np.array(placed.z_axis), np.array(placed.x_axis))
    return framed(R, np.array(placed.position_mm) * MM)


def _solid(shape: Shape, folder: Path, name: str) -> Solid:
    if isinstance(shape, MeshShape):
        file = folder / shape.file
        if not file.is_file():
            raise InputError(
                f"mesh file of {name} not found",
                code="K002",
                value=shape.file,
                remedy="give its path relative to the cell file",
            )
        return mesh_file(file, shape.unit)
    if isinstance(shape, BoxShape):
        return box(np.array(shape.size_mm) * MM)
    if isinstance(shape, CylinderShape):
        return cylinder(0.5 * shape.diameter_mm * MM, shape.length_mm * MM)
    return sphere(0.5 * shape.diameter_mm * MM)


def _body(name: str, shape: Shape, placed: Placed, folder: Path) -> Body:
    return Body(name, (_solid(shape, folder, name).moved(frame(placed)),))


def _tool(table: ToolTable, folder: Path) -> Tool:
    made = [(_body(body.name, body.shape, body, folder), body.cutter) for body in table.body]
    load = None
    if table.mass_kg is not None and table.centre_mm is not None:
        inertia = None if table.inertia_kg_m2 is None else np.array(table.inertia_kg_m2)
        load = Load(table.mass_kg, np.array(table.centre_mm) * MM, inertia)
    holder, cutter = (tuple(body for body, cuts in made if cuts is wanted) for wanted in (False, True))
    return Tool(frame(table), holder, cutter, load=load)


def _changed(key: str, table: ChangedToolTable, folder: Path) -> Tool:
    """A tool of the changer by its number, or by its name."""
    numbered = key.isascii() and key.isdecimal() and len(key) < 10
    name = table.name or ("" if numbered else key)
    milling = None if table.milling is None else folder / table.milling
    if milling is not None and not milling.is_file():
        raise InputError(
            f"milling file of tool {key} not found",
            code="K003",
            value=table.milling,
            remedy="give its path relative to the cell file",
        )
    return replace(_tool(table, folder), number=int(key) if numbered else None, name=name, milling=milling)


def _linear_axis(table: LinearAxisTable, folder: Path) -> LinearAxis:
    carriage = None
    if table.carriage is not None:
        carriage = _body(f"carriage {table.name}", table.carriage.shape, table.carriage, folder)
    compliance = None
    if table.compliance_um_per_N is not None or table.compliance_urad_per_Nm is not None:
        along, about = table.compliance_um_per_N or (0.0,) * 3, table.compliance_urad_per_Nm or (0.0,) * 3
        compliance = 1e-6 * np.array([*along, *about])
    return LinearAxis(
        table.name,
        np.array(table.direction),
        np.array(table.limits_mm) * MM,
        _millimetres(table.speed_mm_s),
        _millimetres(table.acceleration_mm_s2),
        compliance,
        carriage,
    )


def _turntable(table: TurntableTable) -> Turntable:
    return Turntable(
        np.array(table.point_mm) * MM,
        np.array(table.axis),
        None if table.limits_deg is None else np.radians(table.limits_deg),
        None if table.speed_deg_s is None else float(np.radians(table.speed_deg_s)),
        None if table.acceleration_deg_s2 is None else float(np.radians(table.acceleration_deg_s2)),
    )


def _millimetres(value: float | None) -> float | None:
    return None if value is None else value * MM


def _rates(rates: tuple[float, ...] | None) -> Array | None:
    """Rates of the joints in rad, one for all of them if one is given."""
    if rates is None:
        return None
    return np.asarray(np.radians(rates if len(rates) > 1 else rates[0]))
