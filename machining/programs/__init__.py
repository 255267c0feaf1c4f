"""Programs: joint and Cartesian coordinates of a tool path, and what controllers read and write."""
