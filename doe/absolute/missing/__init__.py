"""What an arm's model is missing by absolute readings, geometry, frames and targets free beside every candidate."""
