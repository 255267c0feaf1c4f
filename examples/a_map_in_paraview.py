"""How does the map look in 3-D?
================================

A map of the whole workspace is saved as one file that ParaView opens; pyvista reads the
same file in Python. The script cuts out the part of the workspace that is stiff enough
for the job.
"""
# Needs: OpenGL

import pyvista as pv

import stiffarm as sa

arm = sa.load("kr60-3", links="rigid")
wide, high = (-2000, 2000, 200), (-600, 2400, 200)
box = sa.map_box(arm, x_mm=wide, y_mm=wide, z_mm=high, pose="best-gamma")
box.save("map.vti")

stiffness = "stiffness_N_per_mm"
workspace = pv.read("map.vti")
reached = workspace.threshold(1, scalars=stiffness, all_scalars=True)
stiff = workspace.threshold(800, scalars=stiffness, all_scalars=True)
plotter = pv.Plotter(off_screen=True, window_size=(1200, 800))
plotter.add_mesh(reached, color="lightgrey", opacity=0.08)
cut = stiff.clip("-y", origin=(0, 0, 0))
bar = {"title": "N/mm", "fmt": "%.0f", "vertical": True, "height": 0.6}
plotter.add_mesh(cut, clim=(800, 3000), scalar_bar_args=bar)
plotter.camera_position = "xz"
plotter.camera.azimuth, plotter.camera.elevation = -25, 20
plotter.camera.zoom(1.4)
# Picture: the workspace as a pale shell; in it, cut open, the part that is stiff
# enough, a thick ring about the column.
plotter.screenshot("a_map_in_paraview.png")

share = stiff.volume / reached.volume
print(f"Stiffer than 800 N/mm: {100 * share:.0f} % of the workspace")
assert 0.2 < share < 0.8

# %%
# In ParaView: open `map.vti`, apply *Threshold* to `stiffness_N_per_mm`, then *Clip*.
# The file also has all other quantities of the map and the joint angles of each point.
#
# Read on: :doc:`/how-to/maps`, :doc:`/reference/stiffness_map`. A plane of it with the
# arm: :doc:`where_is_it_stiff`.
