"""Fills in pendant.csv: where the controller of the made-up arm in dh.csv shows its flange, by a chain of its own.

    python make_files.py my-arm/pendant.csv pendant.csv

readings.csv is the sheet of `stiffarm plan` as `stiffarm rehearse` filled it in (README.md has the commands).
"""

import csv
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent


def about(axis, angle):
    """4 x 4 turn about x (0) or z (2)."""
    c, s = np.cos(angle), np.sin(angle)
    T = np.eye(4)
    i, j = ((1, 2), (0, 1))[axis == 2]
    T[i, i], T[i, j], T[j, i], T[j, j] = c, -s, s, c
    return T


def along(x, z):
    """4 x 4 shift."""
    T = np.eye(4)
    T[:3, 3] = x, 0.0, z
    return T


def flange(rows, q_deg):
    """Position in mm: modified Denavit-Hartenberg parameters, a row after the other."""
    T = np.eye(4)
    for row, q in zip(rows, [*q_deg, 0.0], strict=True):
        alpha, a, d, theta = (float(row[key]) for key in ("alpha_deg", "a_mm", "d_mm", "theta_deg"))
        sign = float(row["sign"] or 1)
        T = T @ about(0, np.radians(alpha)) @ along(a, 0.0) @ about(2, np.radians(theta + sign * q)) @ along(0.0, d)
    return T[:3, 3]


def main(empty, filled):
    """Write the table with x, y and z."""
    with (HERE / "dh.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    with open(empty, encoding="utf-8", newline="") as file:
        poses = list(csv.DictReader(file))
    with open(filled, "w", encoding="utf-8", newline="") as file:
        out = csv.DictWriter(file, list(poses[0]), lineterminator="\n")
        out.writeheader()
        for pose in poses:
            at = flange(rows, [float(pose[f"q{k}_deg"]) for k in range(1, 7)])
            # A pendant shows hundredths.
            out.writerow({**pose, **{key: f"{x:.2f}" for key, x in zip(("x_mm", "y_mm", "z_mm"), at, strict=True)}})


if __name__ == "__main__":
    main(*sys.argv[1:])
