"""Serialised samples out of a reader: small ones as bytes, large ones in place in the middleware's memory.

The wheel's own function copies a sample twice, which is a sixth of the latency of a 640 × 480
image. The functions of the C library used here belong to the minor version that this distribution pins.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import Any, NamedTuple

from cyclonedds.core import DDSException, Entity, InstanceState, SampleState, ViewState
from cyclonedds.internal import DDS

_ANY = SampleState.Any | ViewState.Any | InstanceState.Any
#: From this size on, a copy costs more than the book-keeping of a loan.
_LOAN_B = 128 * 1024


class _SampleInfo(ctypes.Structure):
    """``dds_sample_info_t`` of dds.h."""

    _fields_ = (
        ("sample_state", ctypes.c_uint32),
        ("view_state", ctypes.c_uint32),
        ("instance_state", ctypes.c_uint32),
        ("valid_data", ctypes.c_bool),
        ("source_timestamp", ctypes.c_int64),
        ("instance_handle", ctypes.c_uint64),
        ("publication_handle", ctypes.c_uint64),
        ("counts_and_ranks", ctypes.c_uint32 * 5),
    )


class _Piece(ctypes.Structure):
    """``ddsrt_iovec_t``: a piece of memory."""

    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


def _function(library: Any, name: str, result: Any, *arguments: Any) -> Any:
    found = getattr(library, name)
    found.restype, found.argtypes = result, arguments
    return found


# taking waits for locks of the network thread, which may need the interpreter lock, so taking must release it
_take = _function(
    DDS._dll_handle,
    "dds_takecdr",
    ctypes.c_int32,
    ctypes.c_int32,
    ctypes.POINTER(ctypes.c_void_p),
    ctypes.c_uint32,
    ctypes.POINTER(_SampleInfo),
    ctypes.c_uint32,
)
# these only read and count: releasing the interpreter lock would cost more than they do
_quick = ctypes.PyDLL(DDS._dll_handle._name, handle=DDS._dll_handle._handle)
_size = _function(_quick, "ddsi_serdata_size", ctypes.c_uint32, ctypes.c_void_p)
_borrow = _function(
    _quick,
    "ddsi_serdata_to_ser_ref",
    ctypes.c_void_p,
    ctypes.c_void_p,
    ctypes.c_size_t,
    ctypes.c_size_t,
    ctypes.POINTER(_Piece),
)
_give_back = _function(_quick, "ddsi_serdata_to_ser_unref", None, ctypes.c_void_p, ctypes.POINTER(_Piece))
_release = _function(_quick, "ddsi_serdata_unref", None, ctypes.c_void_p)


class Taken(NamedTuple):
    """One sample of a reader.

    Attributes:
        cdr: payload with its encapsulation header: bytes, or a read-only memoryview that keeps a large
            sample alive; None for a state change of an instance without data.
        source_timestamp_ns: the writer's clock.
        publication_handle: of the writer that sent it.
    """

    cdr: bytes | memoryview | None
    source_timestamp_ns: int
    publication_handle: int


class Taker:
    """Takes the samples of one reader, on one thread."""

    def __init__(self, reader: Entity) -> None:
        self._reader = reader._ref
        self._info = _SampleInfo()
        self._sample = ctypes.c_void_p()
        self._arguments = (ctypes.byref(self._sample), 1, ctypes.byref(self._info), _ANY)

    def take(self) -> Taken | None:
        """Take the oldest sample; return None if there is none.

        Raises:
            DDSException: the reader is gone.
        """
        count = _take(self._reader, *self._arguments)
        if count < 0:
            raise DDSException(count, "while taking a sample")
        if not count:
            return None
        sample, info = self._sample.value, self._info
        if not info.valid_data:
            _release(sample)
            return Taken(None, info.source_timestamp, info.publication_handle)
        piece = _Piece()
        loan = _borrow(sample, 0, _size(sample), ctypes.byref(piece))
        _release(sample)  # the loan keeps it
        if piece.length < _LOAN_B:
            cdr: bytes | memoryview = ctypes.string_at(piece.base, piece.length)
            _give_back(loan, ctypes.byref(piece))
        else:
            memory = _loan_type(piece.length).from_address(piece.base)
            memory.loan, memory.piece = loan, piece
            cdr = memoryview(memory).cast("B").toreadonly()
        return Taken(cdr, info.source_timestamp, info.publication_handle)


class _Loan:
    """Memory of the middleware, returned when this process no longer refers to it."""

    loan: int | None = None
    piece: _Piece

    def __del__(self) -> None:
        if self.loan is not None:
            _give_back(self.loan, ctypes.byref(self.piece))
            self.loan = None


@lru_cache(maxsize=64)
def _loan_type(size: int) -> Any:
    return type("_LoanOfSize", (_Loan, ctypes.c_ubyte * size), {})
