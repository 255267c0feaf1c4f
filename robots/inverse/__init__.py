"""Inverse kinematics: closed forms, a numerical search, branches, singularities."""
