"""A robot's programs as files for other software."""
