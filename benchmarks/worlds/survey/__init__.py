"""A foreign world of surveyed arms: positions of targets by a laser tracker, with one thing wrong or none.

It stands on Pinocchio and shares no code with the program. Every joint is three of Pinocchio's: the joint itself, and
one about each of its other axes, which stand at zero but give way; so is the base. Gravity's torques on all of them are
Pinocchio's, and the arm rests where springs and torques agree, found by going there and asking again. Joints run out
like an eccentric gear (no Fourier series), rails bow like a beam on its supports, and what drifts goes on like the
square root of the time; noise is a tracker's: along the beam and across, with tails, one reading in fifty wrong in half
of the sets.

    python -m benchmarks.worlds.survey make OUT --seed N [--single 100] [--none 60]

writes a folder a set: ``model.toml``, ``positions.csv``, ``unseen.csv`` (other poses, no noise), ``key.json``.
"""
