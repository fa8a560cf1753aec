"""Walks that react: what a stabilised walk knows, and one cycle of it, over scalars of any kind."""
