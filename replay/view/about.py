"""What a log was made from, as its metadata tells it."""

from __future__ import annotations

from collections.abc import Mapping

from google.protobuf import json_format

from replay.errors import LogError
from replay.schemas import replay_pb2
from replay.time import seconds_between, to_text
from replay.view.gather import RunData
from replay.view.scene import Scene, ellipsoid_name

MANIFEST_RECORD = "replay.manifest"


def manifest_of(metadata: Mapping[str, Mapping[str, str]]) -> replay_pb2.Manifest | None:
    """The log's manifest; None where it has none.

    Raises
    ------
    LogError
        Where the record is no manifest.
    """
    text = metadata.get(MANIFEST_RECORD, {}).get("json")
    if not text:
        return None
    try:
        return json_format.Parse(text, replay_pb2.Manifest(), ignore_unknown_fields=True)
    except json_format.ParseError as error:
        raise LogError(
            f"the manifest cannot be read: {error}",
            where=f"metadata record {MANIFEST_RECORD}",
            mend="make the log again with `replay run`",
        ) from error


def about_markdown(data: RunData, scene: Scene | None) -> str:
    """Text of the recording's last tab: the run, its colours, what is scaled or left out."""
    parts = ["# What was run", *_manifest_lines(data), "", "# Reading the views"]
    parts += [
        "- Times are the calendar of GPS time (no leap seconds).",
        "- White: truth. Orange, yellow, brown: receivers. Blue, green, purple and on: runs, "
        "in the order of their names. **Red: outage** or a rejected measurement.",
        "- Bands are three standard deviations to each side.",
        "- Errors are solution minus truth at the truth's point, east, north, up there; truth "
        "is interpolated within its span and across at most twice its median interval.",
    ]
    if scene is not None:
        latitude, longitude, height = scene.frame.origin_geodetic
        parts.append(
            f"- Origin of the plan: latitude {latitude:.9f}°, longitude {longitude:.9f}°, "
            f"height {height:.3f} m above the ellipsoid."
        )
        parts.append(f"- Ellipsoids: `{ellipsoid_name(scene.exaggeration)}`.")
        if scene.path_stride > 1:
            parts.append(
                f"- Paths on map and plan have every {scene.path_stride}th point; all else has "
                "every row."
            )
        if scene.left_out:
            parts.append(
                f"- {scene.left_out} rows have no finite position and are not on map and plan."
            )
    parts += ["", "# Outages", *_outage_lines(data), "", "# Channels", *_channel_lines(data)]
    return "\n".join(parts)


def _manifest_lines(data: RunData) -> list[str]:
    manifest = manifest_of(data.metadata)
    if manifest is None:
        return ["The log has no manifest."]
    lines = [
        f"- Command: {manifest.command}",
        f"- Pipeline: {manifest.pipeline}",
        f"- Version: {manifest.package_version}",
    ]
    lines += [f"- Stage: {stage.name}, version {stage.version}" for stage in manifest.stages]
    lines += [f"- Note: {note}" for note in manifest.notes]
    if manifest.configuration:
        lines += ["", "```toml", manifest.configuration.strip(), "```"]
    return lines


def _outage_lines(data: RunData) -> list[str]:
    return [
        f"- {to_text(o.start_ns)} to {to_text(o.end_ns)}: "
        f"{float(seconds_between(o.end_ns, o.start_ns)):.1f} s, "
        + ("cut on purpose" if o.cut else "gap between fixes")
        for o in data.outages
    ] or ["None."]


def _channel_lines(data: RunData) -> list[str]:
    lines = ["| topic | rows | rate [Hz] |", "|---|---|---|"]
    for topic, stats in data.stats.items():
        rate = "" if stats.rate_hz is None else f"{stats.rate_hz:.2f}"
        lines.append(f"| {topic} | {stats.count} | {rate} |")
    return lines
