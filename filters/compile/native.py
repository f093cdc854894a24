"""Printed functions → machine code of this processor, kept in the cache folder, and calls of it from compiled loops.

The functions of a model are straight-line LLVM code (:mod:`.emit`). LLVM translates them in a fraction of a second, and
the loops over time, which numba compiles once for all models, call them by their addresses.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from llvmlite import binding, ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from ..support.files import write_bytes
from .cache import cache_folder, opened, sealed, unless_full
from .emit import module_of

_ENGINES: list[Any] = []
"""What owns the machine code: it stays as long as the process."""


def addresses(functions: Mapping[str, str], label: str) -> dict[str, int]:
    """Addresses of printed functions (:func:`.emit.print_function`) in the memory of this process.

    ``label`` begins the name of the file that keeps the machine code.
    """
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    # the code runs in place, for which Windows needs the format of other systems
    triple = binding.get_process_triple() + ("-elf" if sys.platform == "win32" else "")
    processor, features = binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
    target = binding.Target.from_triple(triple)
    machine = target.create_target_machine(cpu=processor, features=features, opt=3, jit=True)
    text = module_of(functions, triple)
    versions = f"{binding.llvm_version_info} {processor} {features}"
    folder, name = cache_folder(), f"{label}_{hashlib.sha256(f'{versions}{text}'.encode()).hexdigest()[:20]}.o"
    path = None if folder is None else folder / name
    code = None if path is None or not path.is_file() else opened(path.read_bytes())
    if code is None:
        code = translated(text, machine)
        if path is not None:
            with unless_full(path.parent):
                write_bytes(path, sealed(code))
    engine = binding.create_mcjit_compiler(binding.parse_assembly(f'target triple = "{triple}"\n'), machine)
    engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _ENGINES.append(engine)
    return {name: engine.get_function_address(name) for name in functions}


def translated(text: str, machine: Any) -> bytes:
    """Machine code of a module, as an object file."""
    module = binding.parse_assembly(text)
    options = binding.create_pipeline_tuning_options(speed_level=2)
    options.slp_vectorization = True
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module)


@intrinsic
def call(context: Any, address: Any, arrays: Any) -> tuple[Any, Any]:
    """Call a printed function with the first elements of a tuple of arrays.

    Raises:
        TypeError: an argument is not an array of floats in one piece.
    """
    for array in arrays:
        if not (isinstance(array, types.Array) and array.dtype == types.float64 and array.layout == "C"):
            raise TypeError(f"a printed function takes arrays of floats, each in one piece, got {array}")

    def generate(context: Any, builder: Any, signature: Any, values: Sequence[Any]) -> Any:
        place, packed = values
        pairs = zip(signature.args[1], cgutils.unpack_tuple(builder, packed), strict=True)
        pointers = [context.make_array(kind)(context, builder, value).data for kind, value in pairs]
        kind = ir.FunctionType(ir.VoidType(), [pointer.type for pointer in pointers])
        builder.call(builder.inttoptr(place, kind.as_pointer()), pointers)
        return context.get_dummy_value()

    return types.void(address, arrays), generate
