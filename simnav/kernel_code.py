"""The machine code of kernels: made only for what is called, and optimised once.

By itself Numba makes machine code for each function that it compiles. But helpers, and Numba's own functions of arrays,
become parts of the kernels that call them, so nobody uses their machine code. And Numba optimises each function twice,
before and after its parts are put into it. Here machine code is made when somebody asks for the address of a function,
and the first of the two is left out.

A kernel with fast arithmetic, and what is a part of one, is compiled as by Numba alone: there the order of the passes
may decide the last bit of a sum (`simnav.compiled.kernel`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

from numba.core import codegen
from numba.core.environment import lookup_environment
from numba.core.runtime.nrt import rtsys

__all__ = ["LibraryOnDemand", "libraries"]

_Library: Any = codegen.JITCodeLibrary  # Numba has no annotations
_environment_of: Any = lookup_environment
_ENVIRONMENT = "_ZN08NumbaEnv"  # how the names of the variables begin that hold a function's objects of Python


class LibraryOnDemand(_Library):  # type: ignore[misc]
    """The code of a function and its parts; machine code is made when an address in it is first asked for."""

    _made = False

    @property
    def codegen(self) -> Any:
        """What Numba asks to set the objects of a function (`set_env`)."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Set the objects of Python of a function; without machine code it is done later."""
        if self._made:
            self._codegen.set_env(name, environment)

    def get_pointer_to_function(self, name: str) -> int:
        """The address of a function; zero if the library has none of this name."""
        self._ensure_finalized()
        if not self._made:
            defined = {function.name for function in self.get_defined_functions()}
            if name not in defined:
                return 0
            self._make()
        address: int = super().get_pointer_to_function(name)
        return address

    def serialize_using_object_code(self) -> Any:
        """What the cache keeps: the machine code, or the code for callers where none was made."""
        if self._made:
            return super().serialize_using_object_code()
        return self.name, "bitcode", self._get_module_for_linking().as_bitcode()

    def _optimize_functions(self, module: Any) -> None:
        """Nothing but the layout of data: all passes run when the parts are there."""
        module.data_layout = self._codegen._data_layout

    def _finalize_final_module(self) -> None:
        if getattr(self, "_compiled_object", None) is not None:  # machine code from the cache
            self._make()
        else:
            self._finalize_dynamic_globals()
            self._finalized = True

    def _make(self) -> None:
        self._made = True
        super()._finalize_final_module()
        for variable in self._final_module.global_variables:
            environment = _environment_of(variable.name) if variable.name.startswith(_ENVIRONMENT) else None
            if environment is not None:
                self._codegen.set_env(variable.name, environment)


@contextlib.contextmanager
def libraries(context: Any, on_demand: bool) -> Iterator[None]:
    """Within it, the libraries that a target context of Numba makes are `LibraryOnDemand`, or those of Numba."""
    rtsys.initialize(context)  # the runtime of Numba is called by address
    generator = context.codegen()
    previous = generator._library_class
    generator._library_class = LibraryOnDemand if on_demand else _Library  # Numba has no public way to choose it
    try:
        yield
    finally:
        generator._library_class = previous
