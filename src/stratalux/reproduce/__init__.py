"""The figures and numbers of the paper, computed again on its own data, each claim with a verdict."""
