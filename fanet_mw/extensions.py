"""Loads parts of other packages, such as routing protocols, that a scenario names.

    routing.protocol = "gossip3"              the name of an entry point, group `fanet_mw.routing`
    routing.protocol = "mypackage:Gossip3"    or a module and a name in it
    [routing.options]                         the part's own table, checked by its `Options`, a pydantic model

This project's own names cannot be redefined. Each named part is looked up when the scenario is read; anything but a
class with the methods of its contract, which take what it names, is refused without being called
(`part_signature.py`). A scenario that is read with `AS_TEXT`, such as that of a result folder, imports nothing.
"""

import ast
import difflib
import hashlib
import inspect
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from functools import lru_cache
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES, SOURCE_SUFFIXES
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel, GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationError, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import core_schema

from fanet_mw.errors import ConfigError
from fanet_mw.part_failure import OURS, exits_raised, said_at
from fanet_mw.part_signature import misfit

GROUPS: Final[Mapping[str, str]] = {
    "routing.protocol": "fanet_mw.routing",
    "mobility.model": "fanet_mw.mobility",
    "clusters.method": "fanet_mw.clustering",
    "radio.channel": "fanet_mw.channels",
    "applications.use": "fanet_mw.applications",
}
"""The keys of a scenario that may name a part of another package, and the group of entry points for each."""
_SUFFIXES: Final = frozenset(Path(f"_{suffix}").suffix for suffix in (*SOURCE_SUFFIXES, *EXTENSION_SUFFIXES))
_INSTALLED: Final = ("site-packages", "dist-packages")
"""Folders of packages that were installed: of this environment, of another on its path, of the user, of Debian."""
_DIGITS: Final = 16
_METHODS: Final[Mapping[str, Sequence[str]]] = {
    "routing.protocol": ("start", "originate", "receive", "wake", "next_wake_ns", "report"),
    "mobility.model": ("track",),
    "clusters.method": ("divide",),
    "radio.channel": ("loss_db", "reach_m"),
    "applications.use": ("start", "on_message", "wake", "next_wake_ns", "report"),
}
"""The methods by which a class of each kind is recognized."""
_MADE_WITH: Final[Mapping[str, str]] = {
    "routing.protocol": "(port)",
    "mobility.model": "(starts, scenario)",
    "clusters.method": "(count=, range_m=, options=)",
    "radio.channel": "(radio)",
    "applications.use": "(scenario, node, options)",
}
"""What a class of each kind is made with."""
_CONTRACTS: Final[Mapping[str, str]] = {
    "routing.protocol": "fanet_mw.node.contract:RoutingProtocol",
    "mobility.model": "sim.world.mobility.contract:MobilityModel",
    "clusters.method": "fanet_mw.routing.clustered.clustering.contract:Clustering",
    "radio.channel": "emulator.channel.link_budget:Channel",
    "applications.use": "fanet_mw.application:Application",
}
"""The contract of each kind, by name: it is imported for a part alone, and some need numpy."""
_LONGEST: Final = 300
AS_TEXT: Final[Mapping[str, bool]] = {"imports": False}
"""The context of pydantic in which names of parts of other packages are taken as they are."""
_NOT_EVERYWHERE: Final = ("numpy", "numba")
"""Modules that a companion computer lacks. A part that needs one of them is checked where it runs."""


class Options(dict[str, Any]):
    """The options of a part; immutable and hashable, so that a scenario can be the key of a cache."""

    def __hash__(self) -> int:  # type: ignore[override]  # a dict has none, because a dict changes
        return hash(json.dumps(self, sort_keys=True, default=str))

    def __setitem__(self, key: str, value: object) -> None:
        raise TypeError(f"options do not change; {key} = {value!r} was to be set")

    def __reduce__(self) -> tuple[type["Options"], tuple[dict[str, Any]]]:
        return Options, (dict(self),)


def installed(key: str) -> dict[str, EntryPoint]:
    """The entry points that installed packages offer for a key of a scenario."""
    return {entry.name: entry for entry in sorted(entry_points(group=GROUPS[key]))}


def module_of(key: str, name: str) -> str:
    """The top-level module of the part that a scenario names; empty if the name is none of a part."""
    entry = installed(key).get(name)
    module, colon, _ = (entry.value if entry is not None else name).partition(":")
    return module.partition(".")[0] if colon else ""


@lru_cache(maxsize=64)
def digest(module: str) -> str:
    """The digest of a module's sources and of those beside it that they import; once, before it is imported."""
    whole = hashlib.sha256()
    for name, path in sorted(_sources(module)):
        whole.update(f"{name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return whole.hexdigest()[:_DIGITS]


def _sources(module: str) -> Iterator[tuple[str, Path]]:
    """Name and file of each source, without those of Python, of this project, and of packages that were installed."""
    waiting, known = [module], {module, *OURS, *sys.stdlib_module_names}
    while waiting:
        for name, path in _files(waiting.pop()):
            yield name, path
            for other in _imported(path) - known:
                known.add(other)
                if not any(folder in file.parts for _, file in _files(other) for folder in _INSTALLED):
                    waiting.append(other)


def _files(module: str) -> list[tuple[str, Path]]:
    """The files of a top-level module or package, by their names in it."""
    loaded = getattr(sys.modules.get(module), "__file__", None) if module == "__main__" else None
    try:
        spec = None if loaded else find_spec(module)
    except (ImportError, ValueError):
        spec = None
    if spec is not None and spec.submodule_search_locations is not None:
        found = [(folder, path) for folder in map(Path, spec.submodule_search_locations) for path in folder.rglob("*")]
        return [
            (f"{module}/{path.relative_to(folder).as_posix()}", path)
            for folder, path in found
            if path.suffix in _SUFFIXES and path.is_file()
        ]
    origin = loaded or (spec.origin if spec is not None and spec.has_location else None)
    return [(module, Path(origin))] if origin and Path(origin).is_file() else []


def _imported(path: Path) -> set[str]:
    """The top-level modules that a source imports."""
    try:
        tree = ast.parse(path.read_bytes()) if path.suffix == ".py" else ast.Module([], [])
    except (SyntaxError, ValueError):
        return set()
    names = [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
    froms = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and not node.level]
    return {name.partition(".")[0] for name in (*names, *froms)} - {""}


@lru_cache(maxsize=64)
def load(key: str, name: str) -> Any:  # noqa: ANN401  (whatever the contract of the key asks for)
    """The class that a scenario names; ValueError if there is none, ModuleNotFoundError if it needs an emulator."""
    entry = installed(key).get(name)
    text = entry.value if entry is not None else name
    module, colon, path = text.partition(":")
    if not colon:
        known = ", ".join(installed(key)) or "none"
        raise ValueError(
            f"{key} = {name!r}: is neither one of ours, nor an entry point of the group {GROUPS[key]} "
            f"(installed: {known}), nor MODULE:CLASS"
        )
    if module.partition(".")[0] in sys.stdlib_module_names:
        raise ValueError(f"{key} = {name!r}: {text} is a part of Python, and no class with {_methods(key)}")
    digest(module.partition(".")[0])
    try:
        with exits_raised(), redirect_stdout(sys.stderr):  # a greeting would stand in the output of --json
            found: Any = import_module(module)
        for part in path.split("."):
            found = getattr(found, part)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] in _NOT_EVERYWHERE:
            raise
        remedy = "; install it, or put its folder on PYTHONPATH" if error.name == module.partition(".")[0] else ""
        raise ValueError(f"{key} = {name!r}: {text} cannot be imported: {error}{remedy}") from error
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # whatever the code of another package does when it is imported
        raise ValueError(f"{key} = {name!r}: {text} cannot be imported: {error}") from error
    if not _is_part(key, found):
        raise ValueError(f"{key} = {name!r}: {text} is no class with {_methods(key)}")
    if (wrong := misfit(found, _contract(key))) is not None:
        raise ValueError(f"{key} = {name!r}: {text} {wrong}")
    return found


def _contract(key: str) -> type:
    module, _, name = _CONTRACTS[key].partition(":")
    contract: type = getattr(import_module(module), name)
    return contract


def make(key: str, name: str, *arguments: object, **named: object) -> Any:  # noqa: ANN401
    """The part that a scenario names, made with the arguments of its contract; ConfigError if its class cannot be."""
    part = load(key, name)
    try:
        return part(*arguments, **named)
    except (Exception, SystemExit) as error:
        offered = f"the entry point of {GROUPS[key]} for " if name in installed(key) else ""
        what = f"{key} = {name!r}: {offered}{part.__module__}:{part.__qualname__}"
        raised = " ".join(f"{type(error).__name__}: {error}".split()).removesuffix(":")[:_LONGEST]
        if (where := said_at(error)) is None:
            why = f"cannot be made with {_MADE_WITH[key]}: {raised}"
        else:
            why = f"has raised {raised}, at {where}, when it was made"
        raise ConfigError(f"{what} {why}") from error


def _is_part(key: str, found: object) -> bool:
    """True for a class that can be made and has the methods of the contract."""
    if not isinstance(found, type) or inspect.isabstract(found):
        return False
    return all(callable(inspect.getattr_static(found, method, None)) for method in _METHODS[key])


def _methods(key: str) -> str:
    return f"the methods {', '.join(_METHODS[key])}" if len(_METHODS[key]) > 1 else f"a method {_METHODS[key][0]}"


def _imports(info: ValidationInfo) -> bool:
    return info.context is None or info.context.get("imports", True) is True


class PartName:
    """Annotates a key that holds the name of a part: one of this project, or one that can be loaded."""

    def __init__(self, key: str, ours: Sequence[str]) -> None:
        self._key = key
        self.ours: Final = tuple(ours)

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.with_info_after_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> JsonSchemaValue:
        other = f"an entry point of {GROUPS[self._key]}, or MODULE:CLASS"
        foreign = {"type": "string", "x-names": other}
        return {"anyOf": [{"enum": list(self.ours), "type": "string"}, foreign]} if self.ours else foreign

    def _check(self, name: str, info: ValidationInfo) -> str:
        if name not in self.ours and _imports(info):
            try:
                load(self._key, name)
            except ModuleNotFoundError:
                return name  # the part does not run on this machine
            except ValueError as error:
                close = difflib.get_close_matches(name, [*self.ours, *installed(self._key)], n=1)
                hint = (
                    f"; did you mean {close[0]}?" if close else f"; ours: {', '.join(self.ours)}" if self.ours else ""
                )
                raise ValueError(f"{error}{hint}") from error
        return name


class OptionsOf:
    """Annotates the table of options of such a key, checked by the part's own `Options`, with defaults written out."""

    def __init__(self, key: str, ours: Sequence[str]) -> None:
        self._key = key
        self._ours = tuple(ours)

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.with_info_after_validator_function(self._check, handler(source))

    def _check(self, options: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
        table, field = self._key.split(".")
        name = info.data.get(field)
        if name is None:
            return Options(options)  # the name itself is wrong, which was reported already
        model = _model(self._key, name) if name not in self._ours and _imports(info) else None
        if model is None:
            if options and name in self._ours:
                raise ValueError(f"{table}.options: {field} = {name!r} is one of ours and has no options")
            return Options(options)
        try:
            return Options(model.model_validate(options).model_dump(mode="json", exclude_none=True))
        except ValidationError as error:
            wrong = (_mistake(f"{table}.options.{_path(item['loc'])}", item, model) for item in error.errors())
            raise ValueError("; ".join(wrong)) from error


def _mistake(key: str, item: Mapping[str, Any], model: type[BaseModel]) -> str:
    """One mistake in a table of options as `key = value: bound`."""
    if item["type"] == "extra_forbidden":
        return f"{key}: unknown option; known: {', '.join(model.model_fields) or 'none'}"
    message = str(item["msg"]).removeprefix("Value error, ")
    return f"{key} = {item['input']!r}: {message[:1].lower()}{message[1:]}"


def _model(key: str, name: str) -> type[BaseModel] | None:
    """The model of a part's options, which is its attribute `Options`."""
    try:
        model = getattr(load(key, name), "Options", None)
    except (ValueError, ModuleNotFoundError):
        return None
    if model is None or (isinstance(model, type) and issubclass(model, BaseModel)):
        return model
    raise ValueError(f"{key} = {name!r}: its Options must be a pydantic model")


def _path(location: Sequence[str | int]) -> str:
    return ".".join(str(part) for part in location)
