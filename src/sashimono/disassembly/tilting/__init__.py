"""A part that must tilt or turn among fixed ones: a search in SE(3) along the contact surface."""
