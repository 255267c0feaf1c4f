"""The cell file: validated TOML; units stand in the names of the keys.

Frames are a position and either fixed-axis roll, pitch, yaw angles (as in URDF) or the directions of z and x. A box
and a cylinder stand on the xy plane of their frame.
"""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, NonNegativeFloat, field_validator, model_validator

SCHEMA = "stiffarm-cell/1"

# Whatever the unit: squares and products of what is within are numbers still.
LARGEST = 1e9
# Positive: what is smaller than a millionth of its unit is 0 to a shop.
SMALLEST = 1e-6
# Bodies in mm: from a thin sheet to a hall. Collision checks merge points nearer than 1e-8 m.
THINNEST, WIDEST = 1e-3, 1e7

# Names of controllers' signals and routines, and how many terminals one has at most.
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}")
MOST_TERMINALS = 8192
DIGITAL_OUTPUTS = (
    "spindle_clockwise",
    "spindle_counterclockwise",
    "coolant_flood",
    "coolant_mist",
    "coolant_through",
    "probe",
)

Positive = Annotated[float, Field(ge=SMALLEST, le=LARGEST)]
Size = Annotated[float, Field(ge=THINNEST, le=WIDEST)]
Triple = tuple[float, float, float]
Pair = tuple[float, float]


def _a_direction(direction: Triple) -> Triple:
    if not max(map(abs, direction)) > 1e-9:
        raise ValueError("the direction must not have length zero")
    return direction


def _a_range(limits: Pair) -> Pair:
    if not limits[0] < limits[1]:
        raise ValueError("must be a pair [lower, upper] with lower < upper")
    return limits


Direction = Annotated[Triple, AfterValidator(_a_direction)]
Range = Annotated[Pair, AfterValidator(_a_range)]


class Strict(BaseModel):
    """No unknown keys, no text in place of numbers, no NaN, no number beyond :data:`LARGEST`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)

    @field_validator("*")
    @classmethod
    def _not_beyond(cls, value: Any) -> Any:
        for one in value if isinstance(value, tuple) else (value,):
            if isinstance(one, int | float) and abs(one) > LARGEST:
                raise ValueError(f"must be a number of at most {LARGEST:g}")
        return value


class Placed(Strict):
    """A frame in its parent's: ``position_mm``, and ``rpy_deg`` or ``z_axis`` with ``x_axis``."""

    position_mm: Triple = (0.0, 0.0, 0.0)
    rpy_deg: Triple | None = None
    z_axis: Triple | None = None
    x_axis: Triple | None = None

    @model_validator(mode="after")
    def _one_orientation(self) -> Self:
        if (self.z_axis is None) != (self.x_axis is None):
            raise ValueError("z_axis and x_axis go together")
        if self.z_axis is not None and self.rpy_deg is not None:
            raise ValueError("give rpy_deg, or z_axis and x_axis, not both")
        if self.z_axis is not None and self.x_axis is not None:
            z, x = np.array(self.z_axis), np.array(self.x_axis)
            if not np.linalg.norm(np.cross(z, x)) > 1e-6 * np.linalg.norm(z) * np.linalg.norm(x):
                raise ValueError("z_axis and x_axis must be directions, not of length zero and not parallel")
        return self


class BoxShape(Strict):
    """A box that stands on the xy plane, centred."""

    kind: Literal["box"]
    size_mm: tuple[Size, Size, Size]


class CylinderShape(Strict):
    """A cylinder along z from the xy plane up."""

    kind: Literal["cylinder"]
    diameter_mm: Size
    length_mm: Size


class SphereShape(Strict):
    """A sphere about the origin."""

    kind: Literal["sphere"]
    diameter_mm: Size


class MeshShape(Strict):
    """A closed surface from a file beside the cell file: STL, OBJ or PLY."""

    kind: Literal["mesh"]
    file: str
    unit: Literal["mm", "m"]


Shape = Annotated[BoxShape | CylinderShape | SphereShape | MeshShape, Field(discriminator="kind")]


class ToolBodyTable(Placed):
    """A body of the tool in the flange frame; a ``cutter`` may touch the part."""

    name: str
    shape: Shape
    cutter: bool = False


class ToolTable(Placed):
    """T_flange_tool, its origin at the tip, and the tool's bodies; what the controller has to know of its weight.

    ``mass_kg`` of all that is on the flange, its ``centre_mm`` in the flange frame, and ``inertia_kg_m2`` about axes
    through that centre, parallel to the flange's.
    """

    body: tuple[ToolBodyTable, ...] = ()
    mass_kg: Positive | None = None
    centre_mm: Triple | None = None
    inertia_kg_m2: tuple[NonNegativeFloat, NonNegativeFloat, NonNegativeFloat] | None = None

    @model_validator(mode="after")
    def _a_whole_load(self) -> Self:
        if (self.mass_kg is None) != (self.centre_mm is None):
            raise ValueError("mass_kg and centre_mm go together")
        if self.inertia_kg_m2 is not None and self.mass_kg is None:
            raise ValueError("inertia_kg_m2 needs mass_kg and centre_mm")
        # No body's largest moment of inertia is more than the sum of the other two.
        if self.inertia_kg_m2 is not None and 2.0 * max(self.inertia_kg_m2) > (1.0 + 1e-9) * sum(self.inertia_kg_m2):
            raise ValueError("inertia_kg_m2: no body has one moment above the sum of the other two")
        return self


class ChangedToolTable(ToolTable):
    """A tool of the changer under ``[tools.KEY]``; ``name``: what tool paths call it, where the key is its number.

    ``milling``: its milling file beside the cell file; it acts where a command is given neither force nor milling file.
    """

    name: Annotated[str, Field(min_length=1, max_length=80)] | None = None
    milling: str | None = None


class PartTable(Placed):
    """The part frame in the world, and the part's (or raw stock's) surface in that frame."""

    shape: Shape | None = None


class FixtureTable(Placed):
    """Something that stands in the world; ``on_turntable``: it turns with the part."""

    name: str
    shape: Shape
    on_turntable: bool = False


class FloorTable(Strict):
    """The floor; ``none = true``: there is none, not even the plane that the robot stands on."""

    height_mm: float = 0.0
    none: bool = False

    @model_validator(mode="after")
    def _one(self) -> Self:
        if self.none and "height_mm" in self.model_fields_set:
            raise ValueError("give height_mm, or none = true, not both")
        return self


class RobotTable(Placed):
    """The robot's base in the world with all linear axes at 0, and what robot descriptions do not say."""

    joint_speed_deg_s: tuple[Positive, ...] | None = None
    joint_acceleration_deg_s2: tuple[Positive, ...] | None = None
    safety_mm: Annotated[float, Field(ge=0.0)] = 0.0
    home_deg: tuple[float, ...] | None = None
    beam_radius_mm: Annotated[float, Field(ge=0.0, le=WIDEST)] | None = None

    @field_validator("joint_speed_deg_s", "joint_acceleration_deg_s2", mode="before")
    @classmethod
    def _one_for_all(cls, rate: Any) -> Any:
        return (rate,) if isinstance(rate, int | float) else rate

    @field_validator("joint_speed_deg_s", "joint_acceleration_deg_s2")
    @classmethod
    def _some(cls, rate: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if rate == ():
            raise ValueError("must be one number, or one for each joint")
        return rate


class MovesTable(Strict):
    """How programs begin and end: ``home``: with joint moves from and to ``home_deg`` of ``[robot]``.

    ``approach_mm``, ``retract_mm``: of each operation, the way along the tool axis before its first point and behind
    its last.
    """

    home: bool = False
    approach_mm: Positive | None = None
    retract_mm: Positive | None = None


class CarriageTable(Placed):
    """A carriage, in the world with all axes at 0."""

    shape: Shape


class LinearAxisTable(Strict):
    """A linear axis; the first in the file stands on the floor, the last carries the robot."""

    name: str
    direction: Direction
    limits_mm: Range
    speed_mm_s: Positive | None = None
    acceleration_mm_s2: Positive | None = None
    compliance_um_per_N: Triple | None = None  # noqa: N815 - units are in the names of the file's keys
    compliance_urad_per_Nm: Triple | None = None  # noqa: N815
    carriage: CarriageTable | None = None


class TurntableTable(Strict):
    """The axis that carries the part; exactly one of ``limits_deg`` and ``endless = true``."""

    point_mm: Triple
    axis: Direction
    limits_deg: Range | None = None
    endless: bool = False
    speed_deg_s: Positive | None = None
    acceleration_deg_s2: Positive | None = None

    @model_validator(mode="after")
    def _one_kind_of_limit(self) -> Self:
        if self.endless == (self.limits_deg is not None):
            raise ValueError("give exactly one of limits_deg and endless = true")
        return self


def _a_terminal(name: int | str) -> int | str:
    if isinstance(name, str) and not NAME.fullmatch(name):
        raise ValueError("must be a number, or a name of letters, digits and _ that starts with a letter")
    if isinstance(name, int) and not 0 <= name <= MOST_TERMINALS:
        raise ValueError(f"must be a number from 0 to {MOST_TERMINALS}, or a name")
    return name


# An output or input of the robot's controller: by number (KUKA, Universal Robots) or by name (ABB, Staubli).
Terminal = Annotated[int | str, AfterValidator(_a_terminal)]


class CommandsTable(Strict):
    """How the robot's controller tells spindle, coolant, probe and tool changer what to do; what is missing it cannot.

    Digital outputs that are on while something is; ``spindle_speed``: an analog output, at full scale at
    ``spindle_full_rpm``. ``spindle_ready``: a digital input that is on while the spindle turns at its speed, or
    ``spindle_dwell_s``: the time that it takes; programs wait for it after a start. ``optional_stop``, ``restart``:
    digital inputs, on: stop there; go on behind a stop (where the language has no stop of its own). ``tool_change``: a
    routine of the controller, called with the tool's number.
    """

    spindle_clockwise: Terminal | None = None
    spindle_counterclockwise: Terminal | None = None
    spindle_speed: Terminal | None = None
    spindle_full_rpm: Positive | None = None
    coolant_flood: Terminal | None = None
    coolant_mist: Terminal | None = None
    coolant_through: Terminal | None = None
    probe: Terminal | None = None
    spindle_ready: Terminal | None = None
    spindle_dwell_s: Annotated[float, Field(ge=1e-3, le=600.0)] | None = None
    optional_stop: Terminal | None = None
    restart: Terminal | None = None
    tool_change: str | None = None

    @model_validator(mode="after")
    def _once(self) -> Self:
        outputs = [getattr(self, key) for key in DIGITAL_OUTPUTS]
        named = [str(terminal).lower() for terminal in outputs if terminal is not None]
        if len(set(named)) < len(named):
            raise ValueError("an output may do one thing only")
        if self.spindle_ready is not None and self.spindle_dwell_s is not None:
            raise ValueError("give spindle_ready or spindle_dwell_s, not both")
        inputs = [self.spindle_ready, self.optional_stop, self.restart]
        asked = [str(terminal).lower() for terminal in inputs if terminal is not None]
        if len(set(asked)) < len(asked):
            raise ValueError("an input may mean one thing only")
        if (self.spindle_speed is None) != (self.spindle_full_rpm is None):
            raise ValueError("spindle_speed and spindle_full_rpm go together")
        if self.tool_change is not None and not NAME.fullmatch(self.tool_change):
            raise ValueError("tool_change must be a name of letters, digits and _ that starts with a letter")
        return self


class CellFile(Strict):
    """A whole cell file."""

    schema_version: Literal["stiffarm-cell/1"] = Field(alias="schema")
    name: str = "cell"
    notes: tuple[str, ...] = ()
    robot: RobotTable = Field(default_factory=RobotTable)
    tool: ToolTable = Field(default_factory=ToolTable)
    tools: dict[str, ChangedToolTable] = Field(default_factory=dict)
    part: PartTable = Field(default_factory=PartTable)
    fixture: tuple[FixtureTable, ...] = ()
    floor: FloorTable | None = None
    linear_axis: tuple[LinearAxisTable, ...] = Field(default=(), max_length=3)
    turntable: TurntableTable | None = None
    allowed_contacts: tuple[tuple[str, str], ...] = ()
    commands: CommandsTable = Field(default_factory=CommandsTable)
    moves: MovesTable = Field(default_factory=MovesTable)

    @model_validator(mode="after")
    def _a_home(self) -> Self:
        if self.moves.home and self.robot.home_deg is None:
            raise ValueError("[moves] home needs home_deg in [robot]")
        return self

    @model_validator(mode="after")
    def _each_tool_once(self) -> Self:
        called = [
            [key.strip().lower()] + ([] if tool.name is None else [tool.name.strip().lower()])
            for key, tool in self.tools.items()
        ]
        names = [name for one in called for name in set(one)]
        if "" in names or len(set(names)) < len(names):
            raise ValueError("tools need numbers or names of their own, in any case: [tools.3], [tools.MILL_10]")
        return self
