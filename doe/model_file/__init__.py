"""Calibrated values written into a model file, with their source and covariance."""
