"""Texts of the page that `tx200_stiffness.py` writes."""

from __future__ import annotations

HEADING = """# The TX200's substitute stiffness model, on synthetic data

From synthetic readings `identify` finds all 36 stiffnesses of the TX200. Its 95 % intervals contain the true value in
{coverage} %; of the directional stiffnesses at unseen poses {within} % are within 3 %, and the worst is off by
{worst} %. With constant stiffnesses where the true ones vary, or with readings under growing load alone, coverage falls
to {constants} and {loading} %. No reading of a real arm is on this page.

Written by `python benchmarks/tx200/tx200_stiffness.py --repeats {repeats} --write docs/validation/tx200_stiffness.md`.

The paper ("Postprocessor for Verification of Robot Movements with Additional Axis after Toolpath Optimization",
section 2.1) gives every joint six stiffnesses as functions of its angle, from displacements between neighbouring links
under known forces at the flange. Its readings and stiffnesses are not public. **Everything on this page is synthetic**:
readings are simulated from stiffnesses drawn at random, which the identification never sees.

- **Truth**: stiffness about the gear axes 2.4, 2.0, 1.4, 0.6, 0.4, 0.3 x 1e6 N m/rad (within the 100-270 kg class);
  across them 5 to 7.5 times that, as RV gearboxes' tilt to torsion (5 to 9, recalled from catalogues), but joint 2
  about X: 17/10 of the gear's, after the paper's 0.010 and 0.017 deg. Translations 4e7 to 1.8e8 N/m are assumed. Each
  varies over its joint's angle by up to 12 %. Friction holds back 1 to 25 N m about the gears.
- **Campaign**: {c.angles} angles a joint, {c.poses} poses of the others at each; 150 to 600 N and back in steps of
  150 N in flange X, Y and Z. Noise {um:.0f} um and {urad:.0f} urad a reading, set-ups scatter by {percent:.0f} % (both
  assumed). Forces at the flange's centre never load joint 6 about its gear, nor joint 5 about the flange's axis, so
  at those two joints one pose in three is loaded 150 mm off the axis. Without that 34 of 36 stiffnesses are found, and
  two are "not identified".
"""

COVERAGE = """
## Do the intervals contain the true value? Are other poses predicted?

Coverage of 95 % intervals of all 36 stiffnesses at the angles measured, with its standard error over repeats; mean
error of the gears' stiffness; errors of directional stiffness (flange X, Y, Z) at random poses that were not used for
the identification, and coverage of its intervals. All in percent.

| case | coverage | gears off by | poses: mean | 95th | worst | within 3 % | coverage there |
|---|---|---|---|---|---|---|---|
"""

BY_ROW = """
Coverage of each stiffness in the first case (%; one figure has a standard error of some 1.5):

"""

PREDICTION = """
Of directional stiffnesses in {n} unseen poses, over all repeats, {within:.1f} % are within 3 % of the truth, 95 %
within {p95:.1f} %; the worst is off by {worst:.1f} %. The worst are poses about seven times stiffer than the median:
forces along flange Z with hardly a lever arm at any joint, so that most of the deflection comes from translations,
which the readings determine worst. The paper compares its own model with real readings that were not used for it (its
Table 1; configurations are not given, so this cannot be repeated here):

| configuration | force (N) | measured (N/mm) | paper's model (N/mm) | error (%) |
|---|---|---|---|---|
"""

FINDING = """
A real arm has features that this synthetic one lacks: links that bend, bearings away from the DH origin, loads that
are not exactly known. Three per cent on synthetic data does not promise three per cent on a robot.

## The paper's finding at joint 2

With the arm at ({q}) deg and 600 N, flange Y bends joint 2 about X by {b.moment_x:.0f} N m and flange Z
bends it about its gear axis by {b.moment_z:.0f} N m. By the identified model it twists by {b.twist_x_deg:.4f} deg
about X and {b.twist_z_deg:.4f} deg about the gear axis. Over all angles the ratio under the same moment is
{r.ratio:.2f} ({r.low:.2f} to {r.high:.2f}); the paper's is 0.59. It agrees because it was built into the simulated arm:
this shows that such readings can reveal it, not that the robot has it.
"""

HYSTERESIS = """
## Hysteresis

| gear | loop width, 95 % (urad) | of the range (%) | stiffness from the way up alone (%) |
|---|---|---|---|
"""

DIAGONAL = """
## Is a diagonal matrix enough?

A cross term between twist about X and moment about the gear axis of joint 2 was put into the truth:
{cross}.
"""

USUAL = """
## Gears alone, as usual

Compared with six identified stiffnesses per joint, {n} random poses within limits with the flange above the floor;
errors of directional stiffness in percent.

| model | flange axis | signed mean | mean | 95th | worst |
|---|---|---|---|---|---|
"""

EFFECTIVE = """
In the worst poses the force has no lever arm about any gear axis; a model of gears alone is rigid there. Effective
stiffnesses of the refitted gears (1e6 N m/rad): {springs}. A refit attributes other deflections to the gears: those
of the wrist come out several times too soft.
"""

MAP = """
## The map (Fig. 3 of the paper)

Window of the plane Y = 0 from X 1344, Z 550 mm (the paper's origin), 600 x 600 mm (chosen; not stated there). The mean
of the directional stiffnesses in flange X, Y and Z, each under a unit force of its own, in N/mm.

| flange | elbow | reached (%) | lowest | highest |
|---|---|---|---|---|
"""

NOTES = """
"The flange coordinate system was not rotated in any axis" leaves the orientation open. `forward` (flange Z along base
X) is the default: the wrist centre of the origin is then at 1344 - 194 = 1150 mm, a round figure, and all of the window
is reached. With flange axes parallel to the base's (`base`) it is not.

![Stiffness of the TX200 over a window of its workspace](tx200_map.png)
"""
