"""Formulas as straight-line programs: recorded, emitted as Python, NumPy, C99 and JAX; knows no robot."""
