"""Parts that are turned out: by threads read off their surfaces, or declared."""
