"""Launches of a picture on many machines, by Dask."""
