"""Links as solids: tetrahedra from STEP files and from closed surfaces of the material itself."""
