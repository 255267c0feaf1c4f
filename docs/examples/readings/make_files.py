"""Write the files beside this one: readings of the KUKA KR60-3, made up, in the layouts of six instruments.

Run it from the project's folder: ``python docs/examples/readings/make_files.py``. The figures are those of the bundled
model (its springs, a target on its flange, a tracker that stands aside) with made-up scatter; no instrument took them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from openpyxl import Workbook

from fem import build_model, deflection
from robots import forward_kinematics, load_description
from robots.arrays import Array
from robots.constants import STANDARD_GRAVITY
from robots.frames import frame_mm_deg
from robots.schema.units import factor

HERE = Path(__file__).resolve().parent
DESCRIPTION = load_description("kr60-3")
MODEL = build_model(DESCRIPTION, "rigid", None)
ROBOT = MODEL.robot
TRACKER = frame_mm_deg((2500.0, -1800.0, 600.0, 1.0, -2.0, 130.0))
TARGETS = {"SMR1": (60.0, 0.0, 40.0), "SMR2": (-30.0, 52.0, 45.0), "SMR3": (-30.0, -52.0, 50.0)}
INCH_mm = 25.4


def poses(count: int, seed: int) -> Array:
    """Angles (count, 6) deg that the arm can take, to a hundredth."""
    rng = np.random.default_rng(seed)
    low, high = np.array([-60, -110, -20, -90, -80, -90]), np.array([60, -40, 60, 90, 80, 90])
    return np.round(rng.uniform(low, high, (count, 6)), 2)


def energy(q: Array, payload_kg: float) -> Array:
    """Potential energy (count,) J of links and payload."""
    frames = forward_kinematics(ROBOT, q)
    heights = [(mass.kg, frames.p[:, mass.body, 2] + frames.R[:, mass.body, 2] @ mass.centre) for mass in MODEL.masses]
    return STANDARD_GRAVITY * np.sum([kg * z for kg, z in (*heights, (payload_kg, frames.p_flange[:, 2]))], axis=0)


def sagged(q: Array, payload_kg: float) -> Array:
    """Angles (count, 6) rad of joints that turn by their torque, the slope of the energy, over their stiffness."""
    step = 1e-5  # rad: the energy's third derivative then adds less than 1e-6 of the torque
    out = q.copy()
    for j, joint in enumerate(DESCRIPTION.joint):
        stiffness = joint.stiffness.value * factor("rotational stiffness", joint.stiffness.unit)
        up, down = q.copy(), q.copy()
        up[:, j] += step
        down[:, j] -= step
        out[:, j] -= (energy(up, payload_kg) - energy(down, payload_kg)) / (2.0 * step) / stiffness
    return out


def seen(q_deg: Array, target: str, seed: int, payload_kg: float = 0.0) -> Array:
    """Where a tracker sees a target (count, 3) mm on the arm that sags, with a scatter of 0.02 mm."""
    frames = forward_kinematics(ROBOT, sagged(np.radians(q_deg), payload_kg))
    at = frames.R_flange @ (1e-3 * np.array(TARGETS[target])) + frames.p_flange
    there = (at - TRACKER[:3, 3]) @ TRACKER[:3, :3]
    return 1e3 * there + np.random.default_rng(seed).normal(0.0, 0.02, at.shape)


def write(name: str, lines: list[str], encoding: str = "utf-8", end: str = "\r\n") -> None:
    """A text file."""
    (HERE / name).write_bytes((end.join(lines) + end).encode(encoding))


def comma(value: float, digits: int) -> str:
    """A number with a decimal comma."""
    return f"{value:.{digits}f}".replace(".", ",")


def leica() -> None:
    """A tracker's log in UTF-16, with uncertainties, weather and time; the controller's angles in a workbook."""
    q, head = poses(20, 1), "Point,X [mm],Y [mm],Z [mm],U total [mm],Temperature [\u00b0C],Pressure [hPa],Timestamp"
    rows = [
        f"P{k},{x:.4f},{y:.4f},{z:.4f},0.021,{21.0 + 0.02 * k:.2f},1003.2,2026-05-04 09:{10 + k}:12"
        for k, (x, y, z) in enumerate(seen(q, "SMR1", 2), 1)
    ]
    write("leica.csv", ["Job: cell 4", "Operator: Anna", "", head, *rows], "utf-16")
    book = Workbook()
    book.active.title = "theta"
    book.active.append(["Point", *(f"A{k} [deg]" for k in range(1, 7))])
    for k, row in enumerate(q.tolist(), 1):
        book.active.append([f"P{k}", *row])
    book.save(HERE / "leica_angles.xlsx")


def faro() -> None:
    """A tab-separated export in inches, stated above the table; angles in the same rows."""
    q = poses(20, 3)
    head = ["Pose", *(f"J{k} (deg)" for k in range(1, 7)), "Actual X", "Actual Y", "Actual Z", "Device", "User", "Time"]
    rows = [
        "\t".join(
            [
                f"M{k:03d}",
                *(f"{a:.2f}" for a in angles),
                *(f"{v / INCH_mm:.6f}" for v in xyz),
                "Tracker 2",
                "Bert",
                f"05/14/2026 02:{20 + k}:00 PM",
            ]
        )
        for k, (angles, xyz) in enumerate(zip(q, seen(q, "SMR1", 4), strict=True), 1)
    ]
    write(
        "faro.txt", ["Report of measurements", "Units: inch", "Coordinate system: tracker", "", "\t".join(head), *rows]
    )


def api() -> None:
    """Semicolons, decimal commas and Western letters; three targets in a row, a payload."""
    q = poses(12, 5)
    xyz = [seen(q, name, 6 + k, 12.5) for k, name in enumerate(TARGETS)]
    head = [
        "Punkt",
        *(f"Achse {k} [\u00b0]" for k in range(1, 7)),
        *(f"{t} {a} [mm]" for t in TARGETS for a in "XYZ"),
        "Nutzlast [kg]",
        "Bediener",
    ]
    rows = [
        ";".join(
            [
                str(k + 1),
                *(comma(a, 2) for a in q[k]),
                *(comma(v, 3) for one in xyz for v in one[k]),
                "12,5",
                "J\u00fcrgen",
            ]
        )
        for k in range(len(q))
    ]
    write("api.csv", [";".join(head), *rows], "latin-1")


def spatialanalyzer() -> None:
    """Collection, group, target and coordinates between blanks, without names; comments begin with //."""
    q = poses(8, 8)
    xyz = {name: seen(q, name, 9 + k) for k, name in enumerate(TARGETS)}
    rows = [
        f"A P{k + 1} {name} " + " ".join(f"{v:.4f}" for v in xyz[name][k]) for k in range(len(q)) for name in TARGETS
    ]
    write("spatialanalyzer.txt", ["// frame: tracker", "// units: mm", *rows])
    angles = [f"P{k + 1} " + " ".join(f"{a:.2f}" for a in row) for k, row in enumerate(q)]
    write("spatialanalyzer_angles.txt", ["pose q1_deg q2_deg q3_deg q4_deg q5_deg q6_deg", *angles])


def polyworks() -> None:
    """Nominal and measured coordinates and deviations, before and after a mass was hung; axes of the base."""
    q = poses(10, 12)
    kg = np.where(np.arange(len(q)) % 2, 40.0, 25.0)
    moved = _moved(q, kg)
    rng = np.random.default_rng(13)
    flange = 1e3 * forward_kinematics(ROBOT, np.radians(q)).p_flange
    before = flange + rng.normal(0.0, 0.01, flange.shape)
    after = flange + moved + rng.normal(0.0, 0.01, flange.shape)
    head = [
        "Point",
        *(f"J{k} [deg]" for k in range(1, 7)),
        "Mass hung [kg]",
        *(f"Nominal {a} [mm]" for a in "XYZ"),
        *(f"Measured {a} before [mm]" for a in "XYZ"),
        *(f"Measured {a} after [mm]" for a in "XYZ"),
        "Comment",
    ]
    rows = [
        "|".join(
            [
                f"F{k + 1}",
                *(f"{a:.2f}" for a in q[k]),
                f"{kg[k]:g}",
                *(f"{v:.3f}" for v in np.round(flange[k])),
                *(f"{v:.3f}" for v in before[k]),
                *(f"{v:.3f}" for v in after[k]),
                "ok",
            ]
        )
        for k in range(len(q))
    ]
    write("polyworks.txt", ["|".join(head), *rows])


def _moved(q: Array, kg: Array) -> Array:
    """Deflections (n, 3) mm of the flange under masses that hang on it."""
    wrench = np.zeros((len(q), 6))
    wrench[:, 2] = -STANDARD_GRAVITY * kg
    return 1e3 * deflection(MODEL, np.radians(q), wrench, np.zeros(3))[:, :3]


def dial_gauge() -> None:
    """A sheet filled in by hand: a cover sheet, headings above the table, units below its names, readings in um."""
    q = poses(9, 14)
    kg = np.array([20.0, 40.0, 60.0] * 3)
    before = 1000.0 + np.round(np.random.default_rng(15).normal(0.0, 5.0, len(q)))
    after = before + np.round(1e3 * _moved(q, kg)[:, 2])
    book = Workbook()
    cover = book.active
    cover.title = "Deckblatt"
    for row in (["Messprotokoll"], ["Roboter", "KR 60-3"], ["Datum", "12.05.2026"], ["Messuhr Nr.", 17]):
        cover.append(row)
    sheet = book.create_sheet("Messblatt")
    sheet.append(["Nachgiebigkeit am Flansch"])
    sheet.append([])
    sheet.append(
        [
            "Stellung",
            *(f"A{k}" for k in range(1, 7)),
            "Angeh\u00e4ngte Masse",
            "Messuhr Z vor",
            "Messuhr Z nach",
            "Bediener",
            "Temperatur",
            "Bemerkung",
        ]
    )
    sheet.append(["-", *["\u00b0"] * 6, "kg", "\u00b5m", "\u00b5m", "-", "\u00b0C", "-"])
    for k in range(len(q)):
        # Typed by hand: the angles as text with decimal commas.
        sheet.append([f"S{k + 1}", *(comma(a, 2) for a in q[k]), kg[k], before[k], after[k], "Eva", 22.5, ""])
    book.save(HERE / "dial_gauge.xlsx")


if __name__ == "__main__":
    for make in (leica, faro, api, spatialanalyzer, polyworks, dial_gauge):
        make()
