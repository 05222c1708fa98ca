"""Several translations in a row: the search, and the proofs that there is no way out."""
