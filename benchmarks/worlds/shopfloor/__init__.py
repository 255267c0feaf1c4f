"""A shop floor: robots, a technician with weights and a gauge, and something hidden. A world that stiffarm never saw.

It shares no code with stiffarm nor with another world; of the bundled robots it reads the geometry as data.

Mechanics
---------
Kinematics by Pinocchio from URDF text that is made of the DH table or frames. Parts (joints, base, tool) yield by 6x6
flexibilities in their frames; with the action ``X`` of a part's frame the tool moves by ``X C X^T w`` (Dumas et al.
2011; Klimchik and Pashkevich). Displacements are small and superpose. A parallelogram is ideal: the third drive holds
the forearm's direction, so the second spring moves the elbow alone. Link weights (slender rods) load the gears in half
of the sets; in the others the arm is balanced. Readings are differences to the gauge's zero without load.

What is hidden
--------------
Sizes come from the ranges of the catalogue of effects (FACTS, tables 4 and 5) where it has one. Laws are our own:

========================== ========================================================================================
joint springs              nominal times 0.5 to 2, log-uniform
hardening, softening       a maker's curve of three straight pieces of the total torque; a rounded knee
angle-dependent stiffness  a wave and a triangle wave; gear ripple with an overtone; compensator by its pins' geometry
backlash                   a play operator over a narrow band of torque, preloaded by the links' weight; 0.3 to 0.9 mrad
friction                   Bouc-Wen (n = 1) with unequal limits, 60 to 225 N m, soft from the start; exact between turns
tilt, base, tool           unequal about their two axes
creep, recovery            power law of time with an exponent near zero (nearly the logarithm), 3 to 10 %, superposed
loose-base                 anchor bolts that stretch only beyond a moment
cable-package              a hose pack in tension only, between shoulder and wrist: couples joints 2 to 4
others                     slip of ring, tool and foot; stick-slip; warming; bearings that bed in; wind-up; floor creep;
                           load-cell hysteresis; pulley friction; stiction, touch and warm frame of the gauge;
                           two joints in one casing; a worn bar (partial-load-path)
========================== ========================================================================================

Links are rigid in most sets; what upper arm and forearm then yield is a nuisance (0.2 to 1.0 % of the softer of
springs 2 and 3, at joints 2 to 4 and about all axes). In the others (`"links": "beam"`) they are tapered Timoshenko
beams, 3 % off each, of which `link-flexibility` hides one with a wall 10 to 35 % thinner and up to 10 % less modulus.

Time
----
A technician works from eight: warm-up moves in some campaigns, tea every two hours, lunch, home after eight hours or
earlier; each morning is a session, and the stand is set up anew. Joints warm with 50 and cool with 90 minutes. Memory
(friction, play, creep, slip) begins with each set-up, as servo and brakes shake the joints loose on the way; with
``exercised`` in the tags the top load was hung once before. The gauge is set to zero before each cycle or each set-up.

Noise
-----
Share of the component (0.5 to 3 %) or of the vector, proportional to the load (0.02 to 0.08 um/N), white (5 to 30 um),
different by axis, heavy-tailed (Student t with 3 degrees of freedom as a scale mixture), with an offset of each
session (8 to 30 um); steps of 1 or 10 um; set-up scatter of 0 or 1.5 % of the displacement; in half of the sets one
reading in fifty is spoilt. Nuisances: lengths 1 mm, zeros 0.03 deg, loads 0.5 % in common and 0.1 % each.

Places, sizes and poses are drawn again up to 8 times (pairs: 20) while an effect is not detectable; what still is not
stays, with its ``excess_chi2`` in the key. ``nuisance.excess_chi2`` says what the nuisances alone would leave.
"""

from .sets import fill, make

__all__ = ["fill", "make"]
