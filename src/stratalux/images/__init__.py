"""Image files, colours, and what turns radiance into a picture; the lowest layer, which knows nothing of maps."""
