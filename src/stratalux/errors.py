"""The one exception that means "your input, not our bug"."""


class InputError(ValueError):
    """Bad input: the message is one line that says what is wrong, where, and what to do.

    The command line prints it without a traceback and exits with code 2.
    """


class CacheWarning(UserWarning):
    """A file of the cache cannot be read or written; the work is done without it."""


class EnvironmentMapWarning(UserWarning):
    """Something in a map was repaired or is unusual."""


class ImageWarning(UserWarning):
    """Something of an image was left out, replaced or repaired when it was read or written."""


class SceneWarning(UserWarning):
    """Something that a scene's file says is not shown, or was replaced or repaired."""


class RigWarning(UserWarning):
    """Something of a light rig cannot be said in the format that it is written in, or a map has not what is asked."""
