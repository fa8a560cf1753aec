"""Pictures, numbers and pages about a trajectory and its simulation."""
