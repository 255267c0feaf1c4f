"""Writes wing.cls: rows along a long curved skin, as a CAM system would emit them. The part is made up."""

from pathlib import Path

import numpy as np

ROWS, POINTS, LENGTH = 4, 150, 2400.0

lines = [
    "TOOL PATH/SKIN_FINISH,TOOL,BALL_D16",
    "UNITS/MM",
    "TLDATA/MILL,16.0000,8.0000,90.0000,0.0000,0.0000",
    "MSYS/0.0000,0.0000,0.0000,1.0000000,0.0000000,0.0000000,0.0000000,1.0000000,0.0000000",
    "$$ made up for stiffarm",
    "LOADTL/3",
    "SPINDL/RPM,12000,CLW",
    "COOLNT/ON",
]
last = (0.0, 0.0)
x = np.linspace(-0.5 * LENGTH, 0.5 * LENGTH, POINTS)
for row in range(ROWS):
    y = 40.0 * row
    z = 60.0 * np.cos(np.pi * x / LENGTH) - 0.002 * y**2
    slope = -60.0 * np.pi / LENGTH * np.sin(np.pi * x / LENGTH)
    axis = np.stack([-slope, np.full(POINTS, 0.004 * y), np.ones(POINTS)], axis=1)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    order = slice(None) if row % 2 == 0 else slice(None, None, -1)
    points = list(zip(x[order], z[order], axis[order], strict=True))
    first = points[0]
    if row:
        # Across at the height that the tool was drawn back to, then down.
        lines += ["RAPID", f"GOTO/{first[0]:.4f},{y:.4f},{last[1] + 60:.4f}"]
    lines += [
        "RAPID",
        f"GOTO/{first[0]:.4f},{y:.4f},{first[1] + 60:.4f},{first[2][0]:.7f},{first[2][1]:.7f},{first[2][2]:.7f}",
    ]
    lines += ["FEDRAT/MMPM,4000"]
    lines += [f"GOTO/{px:.4f},{y:.4f},{pz:.4f},{a[0]:.7f},{a[1]:.7f},{a[2]:.7f}" for px, pz, a in points]
    last = points[-1]
    lines += ["RAPID", f"GOTO/{last[0]:.4f},{y:.4f},{last[1] + 60:.4f}"]
lines += ["COOLNT/OFF", "END-OF-PATH"]
Path(__file__).with_name("wing.cls").write_text("\n".join(lines) + "\n", encoding="utf-8")
