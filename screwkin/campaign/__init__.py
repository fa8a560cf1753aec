"""Campaigns: a walk under many settings in many worlds, resumable, on any workers; and what they permit."""
