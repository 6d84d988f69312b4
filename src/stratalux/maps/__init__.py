"""What an environment map is and how it is cut, in NumPy; nothing here imports Mitsuba."""
