"""Multibody dynamics of the floating base, ground wrench and ZMP, support polygon."""
