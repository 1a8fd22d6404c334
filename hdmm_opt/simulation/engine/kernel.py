"""Compiled loops: LLVM code made into machine code, kept on disk, and called without the interpreter's lock.

The code of a loop is compiled once for a processor. Its object file goes to the cache folder, under a name that is the
hash of the code, of the compiler's release and of the processor; a file that does not match its own hash is not loaded.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: How code is made; part of its name in the cache.
_OPTIONS = "O2, no loop or SLP vectorisation, no unrolling, whole registers"

#: Environment variable that names another cache folder; empty keeps nothing on disk.
CACHE_VARIABLE = "HDMM_OPT_CACHE"


def available() -> bool:
    """Whether loops can be compiled here."""
    try:
        import llvmlite.binding  # noqa: F401
    except ImportError:
        return False
    return True


@cache
def vector_lanes() -> int:
    """Numbers of double precision that fit a vector register of this processor."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features().flatten()
    return 8 if "+avx512f" in features else 4 if "+avx2" in features else 2


class Kernel:
    """The function `run` of a module as machine code; see `compiler.py` for its arguments.

    Args:
        text: The LLVM module.
    """

    def __init__(self, text: str) -> None:
        import llvmlite.binding as llvm

        features, processor = llvm.get_host_cpu_features().flatten(), llvm.get_host_cpu_name()
        seal = "\n".join((text, processor, features, llvm.get_process_triple(), str(llvm.llvm_version_info), _OPTIONS))
        key = hashlib.sha256(seal.encode()).hexdigest()
        code = _cached(key)
        if code is None:
            code = _compiled(text, _machine())
            _keep(key, code)
        # an engine owns a machine; both must outlive the function
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        address = self._engine.get_function_address("run")
        self._run = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 2, *[ctypes.c_void_p] * 6)(address)

    def __call__(
        self, first: int, count: int, shared: Array, own: Array, fixed: Array, seeds: NDArray[np.uint64], state: Array,
        trace: Array,
    ) -> None:  # fmt: skip
        """Move all lanes over ticks ``first … first + count - 1``; `state` and `trace` are written."""
        arrays = (shared, own, fixed, seeds, state, trace)
        kinds = (np.float64, np.float64, np.float64, np.uint64, np.float64, np.float64)
        if count < 1 or not all(a.flags.c_contiguous and a.dtype == k for a, k in zip(arrays, kinds, strict=True)):
            raise ValueError(f"a kernel takes contiguous arrays of doubles, and at least one tick: got {count}")
        self._run(first, count, *(a.ctypes.data for a in arrays))


def _machine() -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    # whole registers, also where LLVM would rather use half of them
    features += ",-prefer-256-bit" if "+avx512f" in features else ""
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=features, opt=2, jit=True
    )


def _compiled(text: str, machine: Any) -> bytes:
    import llvmlite.binding as llvm

    module = llvm.parse_assembly(text)
    module.triple = llvm.get_process_triple()
    module.verify()
    options = llvm.create_pipeline_tuning_options(speed_level=2)
    options.loop_vectorization = options.slp_vectorization = options.loop_unrolling = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module)


def _folder() -> Path | None:
    chosen, home = os.environ.get(CACHE_VARIABLE), os.environ.get("XDG_CACHE_HOME")
    try:
        if chosen is not None:
            return Path(chosen).expanduser() if chosen else None
        return (Path(home) if home else Path.home() / ".cache") / "hdmm-opt"
    except RuntimeError:  # a user without a home
        return None


def _cached(key: str) -> bytes | None:
    folder = _folder()
    try:
        data = (folder / f"{key}.o").read_bytes() if folder else b""
    except OSError:
        return None
    seal, code = data[:32], data[32:]
    return code if code and hashlib.sha256(code).digest() == seal else None


def _keep(key: str, code: bytes) -> None:
    """Best effort: without a writable folder the code is compiled anew each time."""
    folder = _folder()
    if folder is None:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        handle, temporary = tempfile.mkstemp(dir=folder)
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(hashlib.sha256(code).digest() + code)
            Path(temporary).replace(folder / f"{key}.o")
        finally:
            Path(temporary).unlink(missing_ok=True)
    except OSError:
        return
