"""How types are checked while testing: an int passes for a float, as in Python's own numeric tower."""

from __future__ import annotations

from beartype import BeartypeConf, beartype

check = beartype(conf=BeartypeConf(is_pep484_tower=True))
