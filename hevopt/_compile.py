"""The one way hevopt compiles its loops: the same bits however one came about, kept on disk where there is a place.

Arithmetic is that of IEEE 754, in the order written, division by zero included: a test before every division would
keep loops from doing several at a time. Freedom to reorder sums or to fuse them with products would
be used one way where a loop is compiled with what it calls, another where a part of it comes from the disk.

What is kept is one file per loop and types, written whole under another name first, with a digest in front: a file
that is spoilt, or older than any of the loops, is passed over and replaced by what is compiled afresh.
"""

import hashlib
import os
import pickle
import shutil
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from fnmatch import fnmatch
from functools import cache, cached_property
from io import BytesIO
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import numpy as np


@contextmanager
def _without(*modules: str) -> Iterator[None]:
    """Imports within find none of some modules, which they could do without, unless these are loaded already."""
    hidden = [name for name in modules if name not in sys.modules]
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type]
    try:
        yield
    finally:
        for name in hidden:
            sys.modules.pop(name, None)


# The command line is a program of its own: what else imports modules or compiles with numba in other programs is to
# find both as they are.
_OWN_PROGRAM = "hevopt.cli" in sys.modules and threading.active_count() == 1
# What numba would take along where it is installed; yaml reads settings from one file.
_TAKEN_ALONG = ["coverage", "scipy", *([] if os.path.exists(".numba_config.yaml") else ["yaml"])]
with _without(*(_TAKEN_ALONG if _OWN_PROGRAM else [])):
    import numba
    from numba.core import types
    from numba.core.caching import FunctionCache, IndexDataCacheFile, NullCache
    from numba.core.codegen import JITCodeLibrary, ll
    from numba.core.compiler import CompileResult
    from numba.core.dispatcher import Dispatcher
    from numba.core.environment import Environment, _rebuild_env
    from numba.core.errors import NumbaNotImplementedError
    from numba.core.runtime import rtsys
    from numba.core.typing.typeof import typeof_impl
    from numba.np import numpy_support

_DIGEST_BYTES = hashlib.sha256().digest_size
# Files of loops, and of the tuples and constants that they are compiled with.
_COMPILED_WITH = (
    "_*kernels.py", "_compile.py", "parameters.py", "states.py", "handling.py", "choices.py", "switching.py",
    "units.py",
)  # fmt: skip
_Loop = TypeVar("_Loop", bound=Callable[..., Any])
_type_of_any_array = typeof_impl.dispatch(np.ndarray)


def _type_of_array(array: Any, context: Any) -> Any:
    """What numba says an array is, which asks whether it is a masked one, and loads numpy's masked arrays for that;
    where nobody has loaded them there is none.
    """
    if "numpy.ma" not in sys.modules:
        with suppress(NumbaNotImplementedError):
            kind, layout = numpy_support.from_dtype(array.dtype), numpy_support.map_layout(array)
            return types.Array(kind, array.ndim, layout, readonly=not array.flags.writeable)
    return _type_of_any_array(array, context)


if _OWN_PROGRAM:
    typeof_impl.register(np.ndarray)(_type_of_array)


def compiled(
    *, inline: Literal["never", "always"] = "never", nogil: bool = False, bare: bool = False
) -> Callable[[_Loop], _Loop]:
    """Decorator: numba.njit, kept on disk; without that where neither package nor home can be written.

    nogil: others may run meanwhile, for loops that threads share
    bare: reads and fills arrays, but makes none and gives none back. Nobody counts references to them then, which
    for tuples of many arrays is most of the work, and it becomes part of whatever calls it but for a nogil one.
    """
    options: dict[str, Any] = {"inline": inline, "nogil": nogil, "error_model": "numpy"}
    if bare:
        options |= {"_nrt": False, "forceinline": not nogil}

    def decorate(function: _Loop) -> _Loop:
        loop: Any = numba.njit(**options)(function)
        if isinstance(loop, Dispatcher):
            loop._cache = _LateCache(function)  # type: ignore[attr-defined]
        return cast(_Loop, loop)

    return decorate


class _LateCache:
    """A loop's cache, whose place is looked for when the loop is first called: most of a command's never are."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @cached_property
    def _cache(self) -> Any:
        try:
            return _Cache(self._function)
        except RuntimeError as error:
            if "no locator available" not in str(error):
                raise
        return NullCache()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)


class _Cache(FunctionCache):  # type: ignore[misc]
    """numba's cache, to which no state of the disk is an error."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file = _Files(
            self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        # What is compiled needs numba's runtime, but none of its registries, whose reading takes longer than all
        # else of a short command; who compiles reads them first. Whatever a file of another making holds, the loop
        # can be compiled.
        with suppress(Exception):
            rtsys.initialize(target_context)
            kept = self._cache_file.load(self._index_key(sig, target_context.codegen()))
            return None if kept is None else _rebuilt(target_context, *kept)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        with suppress(OSError):
            super().save_overload(sig, data)


class _Loaded(JITCodeLibrary):  # type: ignore[misc]
    """The machine code of a loop from the disk; what others that are compiled later take over is read for them."""

    bitcode = b""
    _shared_module: Any

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = ll.parse_bitcode(self.bitcode)
        return super()._get_module_for_linking()


def _rebuilt(
    target_context: Any,
    library_data: tuple[str, str, tuple[bytes, bytes]],
    described: Any,
    environment: Environment,
    signature: Any,
    objectmode: bool,
    lifted: Any,
    annotation: str,
    reload_init: Any,
    referenced: Any,
) -> CompileResult:
    """A loop of what numba keeps of it, as numba itself rebuilds it, but for the names of all that its code holds,
    which takes numba longer than all else: the one that is called will do."""
    for refresh in reload_init or ():
        refresh()
    (name, _, (code, bitcode)), codegen = library_data, target_context.codegen()
    library = _Loaded(codegen, name)
    library.bitcode = bitcode
    library.enable_object_caching()
    library._set_compiled_object(code)
    library._finalize_final_module()
    codegen._engine._defined_symbols.add(described.llvm_cpython_wrapper_name)
    loop = target_context.get_executable(library, described, environment)
    for one in referenced:
        codegen.set_env(one.env_name, one)
    return CompileResult(
        target_context=target_context,
        typing_context=target_context.typing_context,
        library=library,
        environment=environment,
        entry_point=loop,
        fndesc=described,
        type_annotation=annotation,
        signature=signature,
        objectmode=objectmode,
        lifted=lifted,
        typing_error=None,
        call_helper=None,
        metadata=None,
        reload_init=reload_init,
        referenced_envs=referenced,
    )


class _Files(IndexDataCacheFile):  # type: ignore[misc]
    """The compiled forms of one loop: without an index, two processes have nothing to disagree on."""

    def load(self, key: Any) -> Any:
        """What was compiled, None where it is not there, spoilt or stale."""
        path = self._path(key)
        kept = path.read_bytes() if path.is_file() else b""
        digest, contents = kept[:_DIGEST_BYTES], kept[_DIGEST_BYTES:]
        return _Unpickler(BytesIO(contents)).load() if digest == self._digest(contents) else None

    def save(self, key: Any, data: Any) -> None:
        """Keep what was compiled in place of what is there."""
        path, contents = self._path(key), self._dump(data)
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        with self._open_for_write(str(path)) as file:
            file.write(self._digest(contents) + contents)

    def _path(self, key: Any) -> Path:
        types = hashlib.sha256(repr(key).encode()).hexdigest()
        return Path(self._cache_path, self._data_name(int(types[:15], 16)))

    def _digest(self, contents: bytes) -> bytes:
        stamp = repr((self._version, self._source_stamp, _loops_digest())).encode()
        return hashlib.sha256(stamp + contents).digest()


class _Unpickler(pickle.Unpickler):
    """Reads a compiled loop without what it was compiled from."""

    def find_class(self, module: str, name: str, /) -> Any:
        rebuild = (module, name) == (Environment.__module__, "_rebuild_env")
        return _environment if rebuild else super().find_class(module, name)


def _environment(module: str, constants: list[Any], name: str) -> Any:
    """The constants of a loop. It reads no globals, so that the part of numba they are of need not be there."""
    if module in sys.modules or name in Environment._memo:
        return _rebuild_env(module, constants, name)
    made = Environment({"__name__": module})
    made.consts[:], made.env_name = constants, name
    Environment._memo[name] = made
    return made


@cache
def _loops_digest() -> str:
    """Of the text of all loops: a loop carries those it calls, of other files too, inside."""
    digest = hashlib.sha256()
    found = []
    for folder, folders, names in os.walk(Path(__file__).parent):
        folders[:] = [name for name in folders if name != "__pycache__"]
        loops = {name for name in names for kind in _COMPILED_WITH if fnmatch(name, kind)}
        found += [Path(folder, name) for name in loops]
    for path in sorted(found):
        digest.update(path.read_bytes())
    return digest.hexdigest()
