"""The model file: a robot, its parts with values, units and sources, validated."""
