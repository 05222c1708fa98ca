"""Fits that are declared: elastic parts that have to give more on their way than assembled, told by shape and depth."""
