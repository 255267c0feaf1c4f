"""Is the program safe to run?
==============================

A KUKA program is written from a tool path, read back, and compared with the path. Then
it is replayed in the cell: collisions, limits, speeds and singularities.
"""

import stiffarm as sa

files = "docs/examples/kr60_posture"
arm = sa.load("kr60-3", links="rigid")
cell = f"{files}/cell.toml"
choice = {"gamma": (-180, 180, 5), "format": ["krl", "json"], "tolerance_um": 100}
program = sa.post(arm, f"{files}/path.csv", cell=cell, **choice)
print(program)
program.save("programs")
checked = sa.verify(arm, "programs/json/path.json", cell=cell)
print(checked)
# Picture: the least distance of any two bodies in each move of the program. It stays
# far above the safety distance.
checked.plot("clearance", "write_and_verify.png")

nearest = 1e3 * checked.found.swept.distance.min()
off = program["off_path_um"].max()
print(f"Nothing comes nearer than {nearest:.0f} mm; read back within {off:.3f} um")
assert checked.found.clean
assert nearest > 2 * 1e3 * checked.found.safety
assert off < 1.0

# %%
# Whole moves are checked, not only their end points. Frames and axis signs depend on
# how the controller was set up: the program's notes say what to check there.
#
# Read on: :doc:`/how-to/program`, :doc:`/how-to/operations`. Before the cut:
# :doc:`which_posture`.
