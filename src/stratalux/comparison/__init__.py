"""Comparing techniques with each other and with a reference, and what a comparison leaves."""
