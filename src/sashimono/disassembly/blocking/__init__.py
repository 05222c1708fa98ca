"""Which parts stop a part on its way along a direction, and by how much they overlap already."""
