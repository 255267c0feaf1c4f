"""A foreign world by screws: readings of an arm's stiffness, made without any of the program's code.

Mechanics. Kinematics are products of exponentials, ``T(q) = exp([S1]q1) ... exp([Sn]qn) M``, with screw axes in the
base frame (Lynch and Park, Modern Robotics, 2017, chapters 4 and 5). A load is a wrench ``W = (p x F, F)``; joint ``i``
feels ``S_i . W`` and yields by a twist about its own screw. Whatever else yields (base, tilting bearings, links,
tool) does so about screws of its own: ``twist = sum S c (S . W)``. A link is the integral of such screws along its
length, by Euler, Bernoulli and Timoshenko's section stiffness. An ideal parallelogram makes the second screw
``S2 - S3``. The deflection is the twist's velocity at the measured point. Weights of the arm are left out, but for the
preload of a fixture that hangs at the flange, which laws with a threshold may feel.

Laws (``joint_laws``, ``body_laws``, ``load_laws``, ``outside_laws``, ``strange_laws``). Sizes are drawn from the
catalogue of magnitudes in the project's fact sheet; where it gives none, a range stands in the law's own text.
Shapes are this world's: friction is a set of Maxwell slip elements beside the spring (Iwan 1966; Al-Bender, Lampaert
and Swevers 2005), solved for the joint's angle at each step of load; backlash is an error function with a preload;
hardening and softening are smooth laws with other exponents; stiffness that varies with angle is a triangle, a
kinked wave or a Fourier series.

Time. Everything that depends on time is the solution of an ordinary differential equation over the time stamps of the
readings: first-order creep that recovers while the arm moves unloaded, gear heating with two time constants from
motor power, lag of floor and frame behind load and air. A load acts some seconds before it is read; between cycles the
arm is unloaded; nights are cold. The gauge is zeroed on the unloaded arm at the start of each loading cycle; load
histories start anew at each visit of a pose, or at each cycle.

Noise (``instruments``). Seven instruments: a dial gauge with an error of so many per cent of the component, or of the
whole vector (its stem is never quite square); a load cell (noise grows with load); a plain gauge; a laser tracker at a
place of its own (angle noise grows with distance, range noise does not, so the covariance is no diagonal); a gauge
with heavy tails (Student t, 3 degrees of freedom); a gauge set up anew for each session with an offset of its own.
Beside it the scatter of the set-up, common to all readings of one visit, and outliers of 5 to 15 sigma, slipped
decimal points and lost signs.

Nuisance in every set: screw axes moved by 1 mm, joint zeros 0.03 deg, loads 0.5 % together and 0.1 % each, links of a
few per cent of the deflection (rigid in the model), resolution of the gauge 1 or 10 micrometres. How far all that
stands out of the noise without any effect is in the key, ``nuisance.excess_chi2``: 30 or more in a quarter of the sets.

Usage: ``python -m benchmarks.worlds.screws make OUT --seed N`` and ``... fill SETFOLDER SHEET.csv OUT.csv --visit K``.
"""

from .sets import fill, make

__all__ = ["fill", "make"]
