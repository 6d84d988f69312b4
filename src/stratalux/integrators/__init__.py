"""Mitsuba plugins, one algorithm a file; :mod:`stratalux.integrators.plugins` registers them."""
