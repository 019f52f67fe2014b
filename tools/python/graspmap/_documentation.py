"""Completes docstrings with the tables of the libraries: options of stages and fields of results."""

import inspect
from types import ModuleType
from typing import Any, Callable

from . import _core


def _entry(one: dict[str, Any], kind: str) -> str:
    return f"{one['key']} : {kind}\n    {one['description']}\n"


def _option_type(option: dict[str, Any]) -> str:
    """For example "float, default 0.005" or "{'a', 'b'}, default 'a'"."""
    kind, default = option["type"], option["default"]
    if option["choices"]:
        kind = "{" + ", ".join(map(repr, option["choices"])) + "}"
    if option["type"] == "str":
        default = repr(default)
    elif option["type"] == "bool":
        default = default.capitalize()
    return f"{kind}, default {default}"


def _indented(text: str) -> str:
    return "".join(f"    {line}\n" if line else "\n" for line in text.splitlines())


def _complete_result(result: type, stage: str) -> None:
    """Adds the fields that the libraries describe to Attributes, the last section."""
    fields = "".join(_entry(one, one["type"]) for one in _core.results(stage))
    result.__doc__ = f"{inspect.cleandoc(result.__doc__)}\n{fields}"


def _complete_stage(function: Callable[..., Any], result: type | None, stage: str) -> None:
    """Adds the fields of the result to Returns, and the options as Other Parameters."""
    text, raises, tail = inspect.cleandoc(function.__doc__).partition("\nRaises\n")
    if result is not None:
        text += "\n" + _indented(result.__doc__.partition("\nAttributes\n----------\n")[2])
    options = "".join(_entry(one, _option_type(one)) for one in _core.options(stage))
    function.__doc__ = f"{text}\nOther Parameters\n----------------\n{options}{raises}{tail}"


def complete(*modules: ModuleType) -> None:
    """Completes the functions of all stages and their results, which the modules define."""
    if __doc__ is None:  # python -OO
        return
    found = {name: value for module in modules for name, value in vars(module).items()}
    for stage in _core.stages():
        function = found[stage]
        name = function.__annotations__["return"]
        result = found[name] if name.endswith("Result") else None
        if result is not None:
            _complete_result(result, stage)
        _complete_stage(function, result, stage)
