"""Measurements of speed: this library beside others, on equal work and equal results."""
