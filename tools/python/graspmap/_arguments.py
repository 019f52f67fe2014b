"""Checks the names of a call's arguments, so that a wrong name raises `Error`, not TypeError."""

import functools
import inspect
from typing import Any, Callable

from . import _core


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """Returns `function`, wrapped to raise `Error` for an unknown keyword or a missing argument."""
    parameters = inspect.signature(function).parameters
    takes_options = any(one.kind is one.VAR_KEYWORD for one in parameters.values())
    names = [name for name, one in parameters.items() if one.kind is not one.VAR_KEYWORD]
    required = {name for name in names if parameters[name].default is inspect.Parameter.empty}

    @functools.wraps(function)
    def call(*arguments: Any, **values: Any) -> Any:
        given = {*names[:len(arguments)], *values}
        others = [] if takes_options else [name for name in values if name not in parameters]
        missing = [name for name in names if name in required - given]
        if others or missing:
            _core.check_names(names, others, missing)
        return function(*arguments, **values)

    return call
