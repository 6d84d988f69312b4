"""Mitsuba plugins, one algorithm a file; :mod:`stratalux.plugins` registers them."""
