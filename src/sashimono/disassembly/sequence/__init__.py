"""Which part leaves when, and what is said of those that stay."""
