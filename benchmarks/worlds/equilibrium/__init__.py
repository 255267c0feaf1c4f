"""A foreign world: arms as MuJoCo models, loaded and unloaded until forces balance at the deflected pose.

It makes measurement sets with hidden truths for `stiffarm diagnose` to be tried on, and shares no code with it.

    python -m benchmarks.worlds.equilibrium make OUT --seed 1
    python -m benchmarks.worlds.equilibrium fill OUT/single-001 next_readings.csv filled.csv --visit 1

Mechanics
---------
Robots are written as MJCF from their description files (`arm`, `chain`): KUKA KR60-3, Staubli TX200, the XR701 with
its ideal parallelogram, and two of this world's own, a seven-axis `heron7` and a five-axis `mantis5`. Every gear is a
hinge that gives way; where an effect wants them, so do tilting hinges, slides of the base or the tool, and the six
freedoms at a casing's tip. MuJoCo gives positions, Jacobians and the links' own weight at the deflected pose;
Newton's method on the complementary form finds the equilibrium there (residual below 1e-12 rad;
`chain.Chain.settle`). A displacement is the loaded equilibrium less the unloaded one under gravity, so it is not
quite proportional to the load even with constant springs, by 0.1 to 1 %. Controllers compensate none, 90 % or all of
the sag under the arm's weight. Laws of gears act on the whole torque, weight included. A set whose nuisances (lengths
1 mm, zeros 0.03 deg, loads 0.5 and 0.1 %, masses 5 %, a casing of 0.5 to 2 % of the shoulder's compliance) could be
seen by the gauge, chi-square over 15, is drawn again, up to twenty times; what is left stands in the key as
`nuisance.excess_chi2`, and what the geometry of large deflections alone does as `nuisance.geometry_excess_chi2`.

Laws
----
Ranges are those of FACTS' catalogue (gears: RV series data sheets; friction, bases, tools: estimates), laws are this
world's: gears that harden by asinh or where a second pair of teeth bears (compliance falls by 35 to 75 %), that
soften by Ramberg and Osgood's law (20 to 70 % at the largest torque, exponents 2.5 to 4), a dead zone with rounded
corners (0.3 to 0.9 mrad), Dahl's friction (60 to 225 N m, 1.5 to 10 times as stiff as the gear before it slips)
integrated exactly from equilibrium to equilibrium, worn sectors as von Mises bells (10 to 45 %), a triangular wave of
gear teeth (10 to 30 %), a spring past the shoulder by the law of cosines (10 to 40 %), bearings, bases and tools that
differ in both directions, Euler-Bernoulli cantilevers two to eight times too soft. Where the catalogue asks for a
sign, a zero or a frame, there is nothing to be original about. Effects on a joint follow the torque that the campaign
puts on it.

Outside of the catalogue (`outside`, `surroundings`): creep with recovery (two Kelvin-Voigt elements), a fixture that
slips once, gears that soften as the day's work warms them, friction that lets go by chance, a foot that lifts, a
cable package, a parallelogram that carries in part, coupled shoulder and elbow, bearings that run in with each load
cycle, a load cell that remembers, a gauge's rod that sticks, other people from day two on, a bumped gauge, a warm
stand of the gauge, the arm's iron that follows the hall hours late, a floor that goes on sagging by the square of the
reach.

Noise
-----
A share of each component or of the vector's length (1 to 4 %, and 5 um), proportional to load, white of 5 to 30 um,
of 5 to 30 um for each axis by itself, Student's t with three degrees of freedom, or white with 10 to 40 um in
common within a session. Set-ups scatter by nothing or 1.5 % of their displacement, a pose at a time and all its
components alike. In half of the sets one reading in fifty is off by 5 to 15 sigma, by a digit or by its sign.
Resolution is 1 um, in a quarter of the sets 10 um.

Time
----
A campaign goes through its set-ups (in random order in three quarters of the sets): 3 to 7 minutes to set up, 25 to
60 s a reading; days of 7 to 9 hours from their first morning on, each a session. The hall's air is a sum of waves: a
day and its half, doors, a weather front of four days. A thermometer hangs in the air, or sits on a joint's housing
(an hour's lag, and warm from work), or there is none. Later visits (`fill`) come as many days later and find weather,
wear and steps going on. Displacements refer to the unloaded pose of the same set-up; what the gauge and slipped
fixtures do since the campaign's beginning adds to them.

Choices that the study should know
----------------------------------
Links are rigid in every model, so `link-flexibility` is hidden where the model has no beam at all. A single effect
that comes out below a chi-square of 30 is drawn again three times, a pair twenty times; then the most visible stays.
`key.json` holds every number of the truth, and `hidden.hidden_of` reads it back. `mantis5` comes without links, so its
model cannot know the weight that its gears hold.
"""
