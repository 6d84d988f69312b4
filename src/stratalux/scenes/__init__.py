"""What gets rendered: Mitsuba XML files, meshes on a stage, and the built-in demo."""
