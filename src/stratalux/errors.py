"""The one exception that means "your input, not our bug"."""


class InputError(ValueError):
    """Bad input: the message is one line that says what is wrong, where, and what to do.

    The command line prints it without a traceback and exits with code 2.
    """


class CacheWarning(UserWarning):
    """A file of the cache cannot be read or written; the work is done without it."""


class SceneWarning(UserWarning):
    """Something that a mesh or a scene file says is left out of the scene, replaced, or guessed."""
