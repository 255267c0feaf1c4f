"""The model has a serial load path, the robot a parallelogram: do the readings tell?"""

import stiffarm as sa

arm = sa.load("xr701")
readings = sa.read_readings(sa.bundled("xr701"), arm)
why = sa.diagnose(arm, readings, loads_N=[650], load_path="serial", next_poses=0)
print(why)
why.plot("what_is_missing.png")

assert why.effects == ("load-path",)
# At poses not seen, with effects chosen anew for each: nine poses make the choice hard.
assert why.gap.held_out_after_mm < 0.85 * why.gap.held_out_before_mm
