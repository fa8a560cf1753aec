"""The kernel compiler: the formulas of this robot, run once on graph scalars, as straight-line programs.

A screw table is known before the computation starts and most of its entries are 0 or +-1, so the program for
one robot is several times shorter than a general engine's loop. ``graph`` records it, ``program`` orders it,
and it is emitted as NumPy, Python, JAX or C. No kernel is written by hand for one robot.
"""
