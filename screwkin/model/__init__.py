"""Robots as data: tables in and out, the ``Robot`` record, conversion to other formats."""
