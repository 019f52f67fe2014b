"""The exception of the module, in a separate file, because the extension module imports it."""


class Error(Exception):
    """Error of a stage or a file, with the parts of its message as attributes.

    ``str(error)`` is the line that the commands print: "FILE: FIELD is VALUE: REASON (must be
    BOUND)". A part that does not apply is empty.

    Attributes
    ----------
    reason : str
        Description of the fault.
    file : str
        Path of the file.
    field : str
        Name of the parameter, option, column or key.
    value : str
        Given value, or the shape and type of a given array.
    bound : str
        Accepted values.
    kind : {'bad_input', 'failed'}
        bad_input: a file, an argument or data cannot be used (exit code 3 of the commands). failed:
        the run itself failed, for example because of a full disk (exit code 1).

    Examples
    --------
    >>> try:
    ...     graspmap.score(np.zeros((5, 2)))
    ... except graspmap.Error as error:
    ...     print(error.field, "|", error.value, "|", error.bound)
    terrain | of shape (5, 2) and type float64 | a Cloud, or numbers of shape (N, 3)
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
