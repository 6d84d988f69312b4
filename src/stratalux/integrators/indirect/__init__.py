"""Light that is reflected or refracted more than once: all that paths bring beyond direct light."""
