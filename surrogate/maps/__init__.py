"""Stiffness maps: layouts, poses at points, quantities, evaluation block by block, files."""
