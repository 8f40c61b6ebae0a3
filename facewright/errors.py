"""The three ways in which Facewright says no: bad input, a stage that gave out, and misuse of the API (ValueError)."""


class InputError(Exception):
    """The user's data cannot be used. One sentence: what, where, expected against got, what to do. CLI: exit code 2."""


class StageError(Exception):
    """Numerics or topology gave out inside a stage.

    stage    name of the stage
    outcome  short machine-readable word, e.g. "not_positive_definite"
    stats    dict of numbers that help to see why
    """

    def __init__(self, stage, outcome, message, stats=None):
        super().__init__(f"{stage}: {message}")
        self.message = message
        self.stage = stage
        self.outcome = outcome
        self.stats = dict(stats or {})

    def __reduce__(self):  # from one process to another
        return type(self), (self.stage, self.outcome, self.message, self.stats)
