"""Inverse kinematics: closed forms and numeric methods, of one limb and of the whole body."""
