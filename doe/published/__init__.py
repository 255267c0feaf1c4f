"""The published staged scheme: parametric studies joint by joint, then laws over the angle."""
