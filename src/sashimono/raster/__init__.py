"""Pictures drawn on the processor: triangles to pixels, light, lines, PNG. Needs no window and no GPU."""
