"""Statics of small displacements: what each part carries, and what the tool does."""
