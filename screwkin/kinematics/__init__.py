"""Positions by successive screw displacements, screw Jacobians, and the centre of mass."""
