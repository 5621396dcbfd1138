"""Object code of compiled blocks, from the optimised LLVM code that `lapwing run` executes.

The machine code is emitted again: position-independent, and for a processor of the chosen generation. The results are
bit-for-bit identical, because no floating-point operation may be contracted, reordered or replaced.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numba
from llvmlite import binding

from lapwing.cosim.diagram.compiled_block import Block, BoundBlock, advance, advance_counted
from lapwing.kernels.compiler.code_libraries import _run

TRIPLE = "x86_64-unknown-linux-gnu"
PORTABLE = "x86-64-v3"  # processors since 2013
_ALLOCATES = re.compile(  # all but the arrays of step_arrays.h
    r"@(NRT_Allocate\w*|NRT_MemInfo_(?:alloc(?!_aligned\()|new|varsize)\w*|NRT_Reallocate|malloc)\("
)
_ADDRESS = re.compile(r"inttoptr \(i64 \d{5,} to")


def step_code(part: Block, bound: BoundBlock, symbol: str, cpu: str, names: Mapping[str, str]) -> bytes:
    """Return the object code of a bound block: int32_t symbol(int64_t *signal, void **error, void *cell, int64_t tick).

    Args:
        part: the block.
        bound: its code in this process.
        symbol: name of its function.
        cpu: LLVM's name of a processor; "native" for this one.
        names: new names of functions that it calls.

    Raises:
        ValueError: the block allocates memory, or calls a function that only exists in this process.
    """
    signature = (numba.typeof(bound.cell), numba.types.int64)
    compiled: Any = (advance if part.trusted else advance_counted).overloads[signature]  # type: ignore[attr-defined]
    text = str(compiled.library._get_module_for_linking())
    function = compiled.fndesc.mangled_name
    if _ADDRESS.search(text):
        raise ValueError(f"{part.name}: calls Python code; only compiled blocks can be exported")
    text = re.sub(r"@sqrt\(", "@llvm.sqrt.f64(", text)  # both become the correctly rounded instruction
    if len(result := re.findall(r"^declare .*@llvm\.sqrt\.f64\(.*$", text, re.M)) > 1:
        text = text.replace(result[0] + "\n", "", 1)
    module = binding.parse_assembly(text)
    for each in module.functions:
        if not each.is_declaration and each.name != function:
            each.linkage = "internal"
    entry = module.get_function(function)
    entry.linkage, entry.visibility, entry.name = "external", "hidden", symbol
    _drop_unused(module)
    if match := _ALLOCATES.search(str(module)):
        raise ValueError(f"{part.name}: allocates memory ({match[1]}); only blocks without allocation can be exported")
    for each in module.functions:
        if each.is_declaration and each.name in names:
            each.name = names[each.name]
    unknown = [f.name for f in module.functions if f.is_declaration and not _is_known(f.name, names.values())]
    if unknown:
        raise ValueError(f"{part.name}: calls {', '.join(unknown)}, which only exists in this process")
    return _machine(cpu).emit_object(module)


def _is_known(name: str, own: Iterable[str]) -> bool:
    return name.startswith("llvm.") or name in own


def data_object(symbol: str, data: bytes) -> bytes:
    """Return an object with constant data and nothing else."""
    text = "".join(f"\\{byte:02x}" for byte in data)
    source = f'@{symbol} = hidden constant [{len(data)} x i8] c"{text}", align 16\n'
    return _machine(PORTABLE).emit_object(binding.parse_assembly(source))


def _drop_unused(module: Any) -> None:
    manager = binding.create_new_module_pass_manager()
    manager.add_global_dead_code_eliminate_pass()
    manager.add_strip_dead_prototype_pass()
    _run(manager, module, binding.create_pass_builder(_machine(PORTABLE), binding.create_pipeline_tuning_options()))


def _machine(cpu: str) -> Any:
    """Return LLVM's code generator for a processor.

    Raises:
        ValueError: a platform other than Linux on x86-64, or an unknown processor.
    """
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    target = binding.Target.from_triple(TRIPLE)
    features = ""
    if cpu == "native":
        cpu, features = binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
    return target.create_target_machine(cpu=cpu, features=features, opt=3, reloc="pic", codemodel="default")


def architectures() -> Sequence[str]:
    """Return the generations of processors that code can be exported for."""
    return ("x86-64-v2", PORTABLE, "x86-64-v4", "native")
