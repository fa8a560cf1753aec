"""Servos, a bus and a robot that answer as real ones do, for tests and rehearsals."""
