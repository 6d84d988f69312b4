"""Rendering a scene with a technique: variants of Mitsuba, and passes that add up to one image."""
