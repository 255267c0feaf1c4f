"""Models with parameters set free: exact derivatives for calibration."""
