"""The one exception type for mistakes a user can make and mend."""


class InputError(ValueError):
    """Bad input: one sentence that names the value, the place and the remedy.

    The command line prints the sentence without a traceback and exits with 2.
    Everything else that is raised is a fault of the program.
    """
