"""Simulators behind one small interface, what they measure, and pictures of them."""
