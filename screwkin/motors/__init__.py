"""Servo motors: their law, figures of models, and a bench on which they are identified."""
