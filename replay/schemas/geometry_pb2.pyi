# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class Vector3(_message.Message):
    __slots__ = ("x", "y", "z")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class Quaternion(_message.Message):
    __slots__ = ("w", "x", "y", "z")
    W_FIELD_NUMBER: _ClassVar[int]
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    w: float
    x: float
    y: float
    z: float
    def __init__(self, w: _Optional[float] = ..., x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class SymmetricMatrix3(_message.Message):
    __slots__ = ("xx", "xy", "xz", "yy", "yz", "zz")
    XX_FIELD_NUMBER: _ClassVar[int]
    XY_FIELD_NUMBER: _ClassVar[int]
    XZ_FIELD_NUMBER: _ClassVar[int]
    YY_FIELD_NUMBER: _ClassVar[int]
    YZ_FIELD_NUMBER: _ClassVar[int]
    ZZ_FIELD_NUMBER: _ClassVar[int]
    xx: float
    xy: float
    xz: float
    yy: float
    yz: float
    zz: float
    def __init__(self, xx: _Optional[float] = ..., xy: _Optional[float] = ..., xz: _Optional[float] = ..., yy: _Optional[float] = ..., yz: _Optional[float] = ..., zz: _Optional[float] = ...) -> None: ...
