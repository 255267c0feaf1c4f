"""What the readers of tool paths can be told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from machining.magnitudes import FARTHEST
from robots import InputError, require_at_least, require_one_of

UNITS = {"mm": 1e-3, "inch": 25.4e-3}
ROTARY = ("none", *(f"{kind}-{first}C" for kind in ("table", "head", "mixed") for first in "AB"))
Point = tuple[float, float, float]


@dataclass(frozen=True)
class ReadOptions:
    """Options of :func:`read_toolpath`; the defaults refuse what could be read in two ways.

    Parameters
    ----------
    units : "mm" or "inch" where the file does not say; None: a file that does not say is refused
    chord_tolerance : m, farthest that a chord lies from its arc
    arc_tolerance : m, largest difference between the radii at both ends of an arc, and from a radius stated
    unknown_motion : "error" refuses words that are not read and may move the tool; "report" makes them notes
    frames : "one" wants all motion in one frame (MSYS, CSYS, TRANS, ORIGIN; G54..G59.3) and gives the coordinates as
        written; "written" gives them as written whatever the frames; "absolute" applies MSYS, TRANS and ORIGIN
        (APT only)
    circle_axis : how an APT ``CIRCLE/`` turns about its vector: "right" or "left" hand; "auto": left for the ten or
        more numbers that Siemens NX writes, right for six or seven (Creo, SolidWorks CAM)
    max_bytes : largest file read
    max_moves : most moves kept; about 170 bytes of memory each
    rotary : kinematics of the rotary axes in G-code, such as "table-AC" or "head-BC" (see :func:`tool_axis`)
    tcp : the program's X Y Z are the tool tip in the part frame from its first line, without G43.4 or TRAORI
    start : m, where the tool stands before the first G-code line, if known
    offsets : m, origin of each work offset by its word ("G54"); added to the coordinates
    arc_absolute : I, J, K of G-code arcs are coordinates of the centre from the first line on (G90.1)
    dwell_unit : "s" or "ms", unit of a whole-numbered P in G4
    skip_deleted : leave out G-code blocks that start with "/"
    compensation : "error" refuses points under cutter compensation (G41, G42, RL, RR, CUTCOM with a cutter of
        diameter 0), which lie on the part's edge or, where only wear is compensated, at the tool's centre; "centre"
        takes them as the tool's centre
    pivot : m, where the axes of a turning table meet, in the coordinates of the program at angles of 0: X Y Z without
        tool centre point control are then turned back into the part
    ignore : words that change nothing about the path on the machine at hand, such as "M136" or "STOPRE": left out
    rotation : what a second G68 does: "absolute" turns anew, "added" turns on; "": it is refused
    rotary_feed : feed per minute of a move that a table turns in: "linear" is that of X Y Z alone (RS-274), "vector"
        that of millimetres and degrees together (Fanuc); "": it is refused
    rotary_reversed : letters of rotary axes that turn against ISO 841, such as "C"
    retract : m, height along the tool axis in the part frame at which the tool is held while it is at a place of the
        machine; None: above the highest point of the path (:mod:`machining.toolpaths.retracts`)

    Raises
    ------
    InputError
        A value that is not one of these.
    """

    units: str | None = None
    chord_tolerance: float = 2e-6
    arc_tolerance: float = 10e-6
    unknown_motion: str = "error"
    frames: str = "one"
    circle_axis: str = "auto"
    max_bytes: int = 256 * 2**20
    max_moves: int = 10_000_000
    rotary: str = "none"
    tcp: bool = False
    start: Point | None = None
    offsets: Mapping[str, Point] = field(default_factory=dict)
    arc_absolute: bool = False
    dwell_unit: str = "s"
    skip_deleted: bool = False
    compensation: str = "error"
    rotary_reversed: str = ""
    ignore: tuple[str, ...] = ()
    rotation: str = ""
    rotary_feed: str = ""
    pivot: Point | None = None
    retract: float | None = None

    def __post_init__(self) -> None:
        choices: dict[str, tuple[str | None, ...]] = {
            "units": (None, *UNITS),
            "unknown_motion": ("error", "report"),
            "frames": ("one", "written", "absolute"),
            "circle_axis": ("auto", "right", "left"),
            "rotary": ROTARY,
            "dwell_unit": ("s", "ms"),
            "compensation": ("error", "centre"),
            "rotation": ("", "absolute", "added"),
            "rotary_feed": ("", "linear", "vector"),
            "rotary_reversed": ("", "A", "B", "C", "AC", "BC"),
        }
        for name, allowed in choices.items():
            require_one_of(f"option {name}", getattr(self, name), allowed, code="P007")
        for name in ("chord_tolerance", "arc_tolerance"):
            if not 1e-9 <= getattr(self, name) <= 1e-2:
                raise InputError(f"option {name}", code="P007", value=getattr(self, name), allowed="1e-9 to 1e-2 m")
        if self.retract is not None and not abs(self.retract) <= FARTHEST:
            raise InputError(
                "option retract", code="P007", value=self.retract, allowed=f"-{FARTHEST:g} to {FARTHEST:g} m"
            )
        for name in ("max_bytes", "max_moves"):
            require_at_least(f"option {name}", getattr(self, name), 1, code="P007")
        for name, point in (("start", self.start), ("pivot", self.pivot), *self.offsets.items()):
            if point is not None and (len(point) != 3 or not all(abs(v) <= FARTHEST for v in point)):
                raise InputError(
                    f"option {name}", code="P007", value=str(point), allowed=f"three numbers of at most {FARTHEST:g} m"
                )
