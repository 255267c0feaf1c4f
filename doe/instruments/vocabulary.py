"""Words of columns' names, in English and German, in small letters without brackets and units."""

from __future__ import annotations

from typing import Final

from doe.instruments.meanings import AXES

BEFORE: Final = frozenset(("before", "unloaded", "zero", "initial", "start", "vor", "vorher", "unbelastet", "leer"))
AFTER: Final = frozenset(("after", "loaded", "final", "end", "nach", "nachher", "belastet"))
MEASURED: Final = frozenset(
    (
        "actual",
        "act",
        "measured",
        "meas",
        "ist",
        "gemessen",
        "coordinate",
        "coord",
        "pos",
        "position",
        "koordinate",
        "tracker",
        "wert",
        "value",
        "measurement",
    )
)
# Coordinates that nobody has measured, differences from these, and what a tracker works out of its own readings.
NOMINAL: Final = frozenset(
    (
        "nominal",
        "nom",
        "soll",
        "target",
        "design",
        "deviation",
        "dev",
        "abweichung",
        "error",
        "residual",
        "command",
        "commanded",
        "programmed",
        "goal",
        "planned",
    )
)
NO_JOINT: Final = frozenset(
    (
        "hz",
        "v",
        "azimuth",
        "elevation",
        "zenith",
        "horizontal",
        "vertical",
        "az",
        "el",
        "h",
        "roll",
        "pitch",
        "yaw",
        "rotation",
        "tilt",
        "inclination",
        "neigung",
    )
)
# What a log has of joints besides their angles.
RATES: Final = frozenset(
    (
        "velocity",
        "vel",
        "speed",
        "effort",
        "torque",
        "current",
        "acceleration",
        "accel",
        "load",
        "geschwindigkeit",
        "drehmoment",
        "strom",
        "beschleunigung",
    )
)
# Words of which a column of numbers may be a joint.
JOINT_WORDS: Final = frozenset(("joint", "axis", "achse", "gelenk", "elbow", "wrist", "shoulder", "theta", "winkel"))
# What logs write around the name of a joint.
AROUND_JOINTS: Final = frozenset(
    (
        "joint",
        "joints",
        "state",
        "states",
        "angle",
        "winkel",
        "pos",
        "position",
        "positions",
        "actual",
        "act",
        "ist",
        "measured",
    )
)
# What says that a load or deflection may be along axes that move with the arm.
LOCAL: Final = frozenset(
    (
        "sensor",
        "ft",
        "tool",
        "tcp",
        "flange",
        "wrist",
        "gripper",
        "ee",
        "eef",
        "effector",
        "hand",
        "local",
        "transducer",
        "cell",
        "body",
        "werkzeug",
        "flansch",
        "greifer",
    )
)
# Joints of Universal Robots by the names of their public URDF, from the base on.
URDF_JOINTS: Final = ("shoulder pan", "shoulder lift", "elbow", "wrist 1", "wrist 2", "wrist 3")
WORDS: Final = {
    "pose": (
        "pose",
        "pose no",
        "pose id",
        "pose number",
        "point",
        "point id",
        "point name",
        "point no",
        "punkt",
        "punktnummer",
        "messpunkt",
        "stellung",
        "pos nr",
    ),
    "repeat": ("repeat", "repetition", "rep", "wiederholung"),
    "phase": ("phase",),
    "step": ("step", "order", "reihenfolge", "schritt"),
    "session": ("session", "station", "sitzung", "day"),
    "target": ("target", "target name", "reflector", "reflektor", "smr", "ziel", "nest"),
    "operator": ("operator", "user", "inspector", "measured by", "bediener", "pr\u00fcfer"),
    "instrument": ("instrument", "device", "tracker", "ger\u00e4t", "messger\u00e4t"),
    "approach": ("approach", "anfahrt"),
}
QUANTITIES: Final = {
    "temperature": ("temperature", "temp", "air temperature", "air temp", "temperatur", "lufttemperatur"),
    "time": ("time", "timestamp", "time stamp", "date time", "datetime", "zeit", "uhrzeit", "zeitstempel"),
    "date": ("date", "datum"),
    "sigma": ("sigma", "std", "std dev", "standard deviation", "stddev", "standardabweichung"),
    "payload": ("payload", "payload mass", "nutzlast"),
    "rail": ("rail", "rail position", "schiene", "fahrachse"),
    "hung": (
        "hung",
        "hung mass",
        "hanging mass",
        "mass hung",
        "hanging weight",
        "weight hung",
        "hung load",
        "load hung",
        "angeh\u00e4ngt",
        "angeh\u00e4ngte masse",
        "angeh\u00e4ngte last",
    ),
    **{
        f"d{a}": (
            f"d{a}",
            f"d {a}",
            f"delta {a}",
            f"deflection {a}",
            f"{a} deflection",
            f"durchbiegung {a}",
            f"verformung {a}",
            f"gauge {a}",
            f"dial {a}",
            f"messuhr {a}",
            f"{a} gauge",
            f"indicator {a}",
        )
        for a in AXES
    },
    **{f"f{a}": (f"f{a}", f"f {a}", f"force {a}", f"load {a}", f"kraft {a}", f"{a} force") for a in AXES},
    **{f"m{a}": (f"m{a}", f"m {a}", f"moment {a}", f"torque {a}", f"{a} moment") for a in AXES},
    **{f"r{a}": (f"r{a}", f"rot {a}") for a in AXES},
    **{f"p{a}": (f"p{a}",) for a in AXES},
    **{f"payload_{a}": (f"payload {a}",) for a in AXES},
}
MEANINGS: Final = {word: what for table in (WORDS, QUANTITIES) for what, words in table.items() for word in words}
# Names that leave the direction, or the sort of load, open.
GAUGES: Final = frozenset(
    (
        "gauge",
        "dial",
        "dial gauge",
        "indicator",
        "reading",
        "deflection",
        "messuhr",
        "anzeige",
        "durchbiegung",
        "verformung",
    )
)
UNDIRECTED: Final = frozenset(("load", "force", "f", "last", "kraft", "mass", "masse", "m", "weight", "gewicht"))
