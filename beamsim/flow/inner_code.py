"""Functions that only compiled functions call get no machine code of their own.

Their callers take them in as LLVM's code, before the callers' own is made. Numba makes machine code for each of them
all the same, which nobody executes: a fourteenth of a first run. Here LLVM is handed object code that holds nothing but
the variables by which Numba knows functions: a compiled function's own, a saved one's those of all that it calls.

What a version of Numba without these means does then is what it always did.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import llvmlite.binding as llvm
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.typed_passes import NativeLowering

_MARK = "_beamsim_without_code"  # attribute of a library of Numba's
_VARIABLE = "_ZN08NumbaEnv"  # begin of the names of those variables


class _InnerLower(Lower):
    """Hands LLVM the object code of a function that has been lowered."""

    def lower(self) -> None:
        super().lower()  # type: ignore[no-untyped-call]
        try:
            self.library._set_compiled_object(_declaring([self.context.get_env_name(self.fndesc)]))
        except (AttributeError, RuntimeError, ValueError):  # another version of Numba or LLVM
            return
        setattr(self.library, _MARK, True)


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[no-untyped-call]
class _InnerLowering(NativeLowering):
    _name = "inner_lowering"
    lowering_class = _InnerLower


class InnerCompiler(CompilerBase):
    """Numba's compiler for functions that only compiled functions call."""

    def define_pipelines(self) -> list[Any]:
        """Numba's passes, the one that makes LLVM's code replaced."""
        passes: Any = DefaultPassBuilder
        manager = passes.define_nopython_pipeline(self.state)
        manager.passes = [(_InnerLowering if one is NativeLowering else one, what) for one, what in manager.passes]
        manager.finalize()
        return [manager]


def prepare_to_save(library: Any) -> None:
    """Give a library object code again, where LLVM has taken it: to be loaded where nothing that it calls is loaded."""
    if getattr(library, _MARK, False):
        variables = [each.name for each in library._final_module.global_variables if each.name.startswith(_VARIABLE)]
        library._compiled_object = _declaring(variables)


def _declaring(variables: list[str]) -> bytes:
    """Object code with these variables and nothing else."""
    source = "\n".join(f'@"{name}" = common global i64 0' for name in variables)
    code: bytes = _machine().emit_object(llvm.parse_assembly(source))
    return code


@cache
def _machine() -> Any:
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(codemodel="jitdefault", jit=True)
