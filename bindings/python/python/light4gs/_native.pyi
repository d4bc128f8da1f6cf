"""The part of the package that is written in Rust. Use what `light4gs` gives."""

from os import PathLike
from typing import final

__version__: str

@final
class Scene:
    @staticmethod
    def open(path: str | PathLike[str], limits: dict[str, int] | None) -> Scene: ...
    @staticmethod
    def from_bytes(bytes: bytes, limits: dict[str, int] | None) -> Scene: ...
    def metadata(self) -> dict[str, object]: ...
    def gsplat(self, time: float) -> list[bytearray]: ...
    def inria(self, time: float) -> tuple[list[bytearray], dict[str, tuple[int, bytearray]]]: ...
    def render(
        self,
        size: tuple[int, int],
        intrinsics: tuple[float, float, float, float],
        rotation: list[float],
        translation: list[float],
        time: float,
        background: list[float],
    ) -> bytearray: ...

@final
class Take:
    @staticmethod
    def open(path: str | PathLike[str], limits: dict[str, int] | None) -> Take: ...
    @staticmethod
    def from_bytes(bytes: bytes, limits: dict[str, int] | None) -> Take: ...
    def metadata(self) -> dict[str, object]: ...
    def gsplat(self, seconds: float) -> list[bytearray]: ...
    def inria(self, seconds: float) -> tuple[list[bytearray], dict[str, tuple[int, bytearray]]]: ...
    def render(
        self,
        size: tuple[int, int],
        intrinsics: tuple[float, float, float, float],
        rotation: list[float],
        translation: list[float],
        seconds: float,
        background: list[float],
    ) -> bytearray: ...

def check_camera(
    size: tuple[int, int],
    intrinsics: tuple[float, float, float, float],
    rotation: list[float],
    translation: list[float],
) -> None: ...
def look_at(
    eye: list[float], target: list[float], up: list[float], fov_x: float, size: tuple[int, int]
) -> tuple[float, list[float], list[float]]: ...
def limits(name: str) -> dict[str, int]: ...
