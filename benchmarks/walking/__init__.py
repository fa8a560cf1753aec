"""Walks that meet other worlds than the planned one: screwkin's with feedback and open loop, and placo's.

Seeds of ``tuning.txt`` are for choosing gains, those of ``judging.txt`` for judging alone.
"""
