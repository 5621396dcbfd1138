"""How a run fails. Imports nothing, so that the command line knows the errors before it needs the rest."""


class BusError(RuntimeError):
    """The bus could not be opened."""


class RunFailed(RuntimeError):
    """A run that did not reach its end; the text names the culprit."""


class LockStepError(RuntimeError):
    """The lock step cannot go on; the text says who waits for what."""


class DivergedError(LockStepError):
    """A state is not sound: no longer finite, or where its coordinates end."""
