"""`stiffarm help`: a failure explained by its code."""
