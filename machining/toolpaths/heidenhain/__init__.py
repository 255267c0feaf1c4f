"""Programs in Heidenhain's conversational language (Klartext)."""
