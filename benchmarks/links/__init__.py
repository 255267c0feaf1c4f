"""Links of known geometry: what an import makes of their outer surface and mass, against solid finite elements."""
