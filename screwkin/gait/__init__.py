"""Gaits: files of parameters and key points, footholds, splines, phase timing, and the plan of a walk."""
