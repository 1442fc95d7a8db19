"""Receivers' binary formats as streams of a spec."""

from __future__ import annotations

from collections.abc import Mapping

from replay import time
from replay.errors import ConfigurationError
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.nmea import read_nmea
from replay.importers.novatel import read_novatel
from replay.importers.rtcm import read_rtcm
from replay.importers.sbf import read_sbf
from replay.importers.spec import Stream
from replay.importers.ubx import read_ubx
from replay.log.columns import Columns


def ubx_stream(file: File, findings: Findings, stream: Stream) -> Mapping[str, Columns]:
    """UBX: observations, ephemerides, fixes."""
    return read_ubx(
        file,
        findings,
        receiver=stream.receiver,
        lever_arm_m=_lever_arm(file, stream),
        approximate_ns=_approximate_ns(file, stream),
        truth=stream.truth,
    )


def rtcm_stream(file: File, findings: Findings, stream: Stream) -> Mapping[str, Columns]:
    """RTCM 3: observations, ephemerides, the station's position."""
    near = _approximate_ns(file, stream)
    return read_rtcm(file, findings, receiver=stream.receiver, approximate_ns=near)


def sbf_stream(file: File, findings: Findings, stream: Stream) -> Mapping[str, Columns]:
    """SBF: observations, ephemerides, fixes, inertial samples."""
    lever_arm = _lever_arm(file, stream)
    return read_sbf(file, findings, receiver=stream.receiver, lever_arm_m=lever_arm)


def novatel_stream(file: File, findings: Findings, stream: Stream) -> Mapping[str, Columns]:
    """NovAtel: observations, ephemerides, fixes, inertial samples, fused solution."""
    return read_novatel(
        file,
        findings,
        receiver=stream.receiver,
        lever_arm_m=_lever_arm(file, stream),
        gyro_scale_rad=stream.gyro_scale,
        accel_scale_m_s=stream.accel_scale,
    )


def nmea_stream(file: File, findings: Findings, stream: Stream) -> Mapping[str, Columns]:
    """NMEA: fixes."""
    return read_nmea(
        file,
        findings,
        receiver=stream.receiver,
        lever_arm_m=_lever_arm(file, stream),
        approximate_ns=_approximate_ns(file, stream),
        truth=stream.truth,
    )


def _lever_arm(file: File, stream: Stream) -> tuple[float, ...]:
    if len(stream.lever_arm) != 3:
        raise ConfigurationError(
            f"lever_arm has {len(stream.lever_arm)} numbers", where=file.name, mend="write three"
        )
    return stream.lever_arm


def _approximate_ns(file: File, stream: Stream) -> int | None:
    if not stream.approximate_time:
        return None
    try:
        return time.parse_calendar(stream.approximate_time)
    except ValueError as error:
        raise ConfigurationError(
            f"approximate_time {stream.approximate_time!r} is no date",
            where=file.name,
            mend="write 2025-08-28T17:30:00, GPS time",
        ) from error
