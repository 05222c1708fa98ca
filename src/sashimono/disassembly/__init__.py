"""Level 1: which part can leave, along which motion, and in which orders."""
