"""Six stiffnesses at every joint from displacements and twists between neighbouring arms."""

from doe.joint_twists.cycles import Cycles, cycles_of
from doe.joint_twists.identify import Identified, identify
from doe.joint_twists.laws import LAWS, Direction, LawKind
from doe.joint_twists.readings import TwistReadings, joined
from doe.joint_twists.table import read_twists, write_twists

__all__ = [
    "LAWS",
    "Cycles",
    "Direction",
    "Identified",
    "LawKind",
    "TwistReadings",
    "cycles_of",
    "identify",
    "joined",
    "read_twists",
    "write_twists",
]
