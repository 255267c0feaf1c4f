"""Writes series_b.csv and series_c.csv from the published files: python make_tables.py FOLDER.

Source: github.com/christianlandgraf/ipa-robot-accuracy, commit 507fba6 (Landgraf et al., CASE 2021; MIT, see LICENSE),
files ur10_B.csv and ur10_C.csv. Of the columns joint angles (rad, here deg) and positions are kept; of series C every
fifth pose.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")


def table(source: Path, series: str) -> pd.DataFrame:
    """A series as ``stiffarm calibrate`` reads it: each has its own session and its own target."""
    read = pd.read_csv(source / f"ur10_{series.upper()}.csv")
    angles = {f"q{k}_deg": np.degrees(read[f"{joint}_joint"]).round(5) for k, joint in enumerate(JOINTS, start=1)}
    places = {f"{axis}_mm": read[f"measurement_{axis}"].round(4) for axis in "xyz"}
    return pd.DataFrame({**angles, **places, "session": series, "target": f"t-mac {series}"})


if __name__ == "__main__":
    for series, every in {"b": 1, "c": 5}.items():
        made = table(Path(sys.argv[1]), series).iloc[::every]
        made.to_csv(Path(__file__).parent / f"series_{series}.csv", index=False)
