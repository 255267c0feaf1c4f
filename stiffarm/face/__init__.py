"""The Python face: what ``import stiffarm as sa`` offers, thin over the same steps that the commands run."""
