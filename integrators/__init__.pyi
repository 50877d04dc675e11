# Written by tools/stubs.py: do not edit.
from .. import DiagonallyImplicit, ExplicitNystrom, ExplicitRungeKutta
from ..hints import Integrator

class Taylor(Integrator):
    def __init__(
        self,
        tol: float = ...,
        order: int | None = ...,
        *,
        rtol: float | None = ...,
        atol: float | None = ...,
        step: float | None = ...,
        max_step: float | None = ...,
        first_step: float | None = ...,
    ) -> None: ...
    def orders(self) -> tuple[int, int, int]: ...
    @property
    def refined(self) -> int: ...
    @property
    def stages(self) -> int: ...
    def step_tolerances(self) -> tuple[float, float]: ...

class Nystrom4(ExplicitNystrom):
    def __init__(self, step: float = ...) -> None: ...

class DOP853(ExplicitRungeKutta):
    def __init__(
        self,
        rtol: float = ...,
        atol: float = ...,
        step: float | None = ...,
        max_step: float | None = ...,
        first_step: float | None = ...,
    ) -> None: ...

class ImplicitTrapezoid(DiagonallyImplicit):
    def __init__(
        self,
        rtol: float = ...,
        atol: float = ...,
        step: float | None = ...,
        max_step: float | None = ...,
        first_step: float | None = ...,
    ) -> None: ...

class RK45(ExplicitRungeKutta):
    def __init__(
        self,
        rtol: float = ...,
        atol: float = ...,
        step: float | None = ...,
        max_step: float | None = ...,
        first_step: float | None = ...,
    ) -> None: ...

class SDIRK54(DiagonallyImplicit):
    def __init__(
        self,
        rtol: float = ...,
        atol: float = ...,
        step: float | None = ...,
        max_step: float | None = ...,
        first_step: float | None = ...,
    ) -> None: ...

def registered() -> tuple[type[Integrator], ...]: ...
