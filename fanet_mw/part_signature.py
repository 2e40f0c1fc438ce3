"""Whether the methods of a part can be called as those of its contract are; nothing of the part is called for it."""

import inspect
from functools import lru_cache


@lru_cache(maxsize=64)
def misfit(part: type, contract: type) -> str | None:
    """What is wrong with the first method that does not fit the contract, as the end of a sentence; None: all fit."""
    for name, promised in vars(contract).items():
        if name.startswith("_") or not (inspect.isfunction(promised) or isinstance(promised, property)):
            continue
        found = inspect.getattr_static(part, name, None)
        if found is None and isinstance(promised, property):
            continue  # it may be set when the part is made
        if found is None:
            return f"lacks the method {name}{_parameters(promised)}"
        if inspect.isfunction(found) and (wrong := _misfit_of(found, promised)) is not None:
            return f"has a method {name} that {wrong}"
    return None


def _misfit_of(found: object, promised: object) -> str | None:
    if inspect.iscoroutinefunction(found) or inspect.isasyncgenfunction(found):
        return "is async, and would never be awaited"
    wanted = inspect.signature(promised)  # type: ignore[arg-type]
    if inspect.isgeneratorfunction(found) and wanted.return_annotation in (None, "None"):
        return "is a generator, and would never run"
    keywords = [p.name for p in wanted.parameters.values() if p.kind is p.KEYWORD_ONLY]
    try:
        inspect.signature(found).bind(*wanted.parameters.keys() - keywords, **dict.fromkeys(keywords))  # type: ignore[arg-type]
    except TypeError:
        return f"takes {_parameters(found)}, and is called with {_parameters(promised)}"
    return None


def _parameters(method: object) -> str:
    """The parameters of a method without `self`, as they are written."""
    names, begun = [], False
    for parameter in list(inspect.signature(method).parameters.values())[1:]:  # type: ignore[arg-type]
        if parameter.kind is parameter.KEYWORD_ONLY and not begun:
            begun = True
            names.append("*")
        names.append(str(parameter.replace(annotation=parameter.empty)))
    return f"({', '.join(names)})"
