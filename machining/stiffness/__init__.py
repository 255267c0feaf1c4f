"""Stiffness of the tool: Cartesian matrices, indices, ellipsoid, distribution over space."""
