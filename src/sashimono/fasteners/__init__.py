"""Fasteners recognised from shape and place: what they are, what they clamp, what must come before what."""
