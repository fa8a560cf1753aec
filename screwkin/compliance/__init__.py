"""Elastic joints: how a robot deflects under its weight (virtual joint method)."""
