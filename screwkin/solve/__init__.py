"""Rates, positions and statuses: the algorithms that meet the formulas at arrays."""
