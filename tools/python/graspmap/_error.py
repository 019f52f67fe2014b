"""The exception of the module, in a file of its own: the extension module imports it."""


class Error(Exception):
    """What the commands print as one line, with its parts as fields.

    `str(error)` is "FILE: FIELD is VALUE: REASON (must be BOUND)"; parts that are not known are empty.
    `kind` is "bad_input" where a file, an option or data cannot be used (exit code 3 of the
    commands), "failed" where the run itself went wrong, for instance on a full disk (exit code 1).
    """

    def __init__(self, message: str, reason: str, file: str = "", field: str = "", value: str = "",
                 bound: str = "", kind: str = "bad_input") -> None:
        super().__init__(message)
        self.reason = reason
        self.file = file
        self.field = field
        self.value = value
        self.bound = bound
        self.kind = kind

    def __reduce__(self) -> tuple[type["Error"], tuple[str, ...]]:
        return Error, (str(self), self.reason, self.file, self.field, self.value, self.bound,
                       self.kind)


Error.__module__ = "graspmap"
