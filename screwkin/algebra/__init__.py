"""Scalars of any kind, rigid displacements, screws, and the small equations that robots lead to."""
