"""Servos behind one small interface."""
