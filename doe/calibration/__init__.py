"""A calibration file carried out: stage by stage, and what goes into the calibrated model file."""
