"""What a robot of unknown names is: its mirror plane, limbs, soles and home, from geometry alone."""
