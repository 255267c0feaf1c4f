"""Where on the rail should it stand?
=====================================

A TX200 on a rail mills a long skin on a bench. It may stand still, or move along during
the cut. The joint stiffnesses and the part are made up.
"""

import matplotlib.pyplot as plt

import stiffarm as sa

files = "docs/examples/tx200_wing"
arm = sa.identify(sa.load("tx200"), synthetic=True, law="constant").arm
force = {"force": [0, 60, -80], "force_axes": "process"}
part, cell = f"{files}/wing.cls", f"{files}/cell.toml"
placed = sa.place(arm, part, cell=cell, **force, mode="moving")
print(placed.answer)

frame = placed.to_frame()
moving = frame["stiffness_N_per_mm"]
still = frame["best_position_at_rest_stiffness_N_per_mm"]
figure, ax = plt.subplots(layout="constrained")
ax.plot(frame["path_mm"], moving, label="moving with the cut")
ax.plot(frame["path_mm"], still, "--", label="best place at rest")
ax.set(xlabel="path (mm)", ylabel="stiffness along the force (N/mm)", ylim=(0, None))
ax.legend()
# Picture: the stiffness along the four rows of the part. With the rail moving it is the
# higher one nearly everywhere, most at the ends of the part.
figure.savefig("where_on_the_rail.png")

at_rest, e = 1e3 * placed.found.placed.fixed.e[0, 0], frame["e1_mm"]
gain = 100 * (moving.mean() / still.mean() - 1)
moves = f"{e.min():.0f} to {e.max():.0f} mm"
print(f"At rest: {at_rest:.0f} mm; moving {moves}: {gain:.0f} % stiffer")
assert abs(at_rest) < 100
assert gain > 10
assert moving.min() > still.min()

# %%
# If it stands still, the best place is near the middle of the part, where one would
# have put it by eye. Moving the rail gains more; `stiffarm verify` must then confirm
# its speeds and accelerations.
#
# Read on: :doc:`/how-to/program`, :doc:`/validation/placement`. Next:
# :doc:`write_and_verify`.
