"""Commands about logs: import, info, doctor, recover."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Column, Table

from replay.cli.app import app, leave, out, say, warn
from replay.cli.arguments import Output

_SHOWN_GAPS = 3


@app.command("import")
def import_(
    spec: Annotated[Path, typer.Argument(help="TOML file: files, columns, units, axes, times.")],
    data: Annotated[Path, typer.Option(help="Folder of the files.")],
    output: Output,
    strict: Annotated[
        bool, typer.Option("--strict", help="Stop at the first row that would be skipped.")
    ] = False,
    update_expected: Annotated[
        bool, typer.Option("--update-expected", help="Write the digests found into the spec.")
    ] = False,
) -> None:
    """Make a log from files as a spec describes them."""
    from replay.importers import import_log
    from replay.importers import update_expected as save

    result = import_log(spec, data, output, strict=strict)
    table = Table("channel", "rows", "sha256", title=str(output), title_justify="left")
    for topic, digest in result.digests.items():
        table.add_row(topic, f"{digest.message_count:,}", digest.sha256[:16])
    out.print(table)
    for note in result.notes:
        say(f"note: {note}")
    for loss in result.losses.losses:
        warn(f"skipped: {loss}")
    for mismatch in result.mismatches:
        warn(mismatch, lead="not as expected: ", style="bold red")
    if update_expected and result.mismatches:
        save(spec, result)
        warn(f"{spec}: expected digests updated")
    leave(result.exit_code)


@app.command()
def info(log: Annotated[Path, typer.Argument(help="Log to describe.")]) -> None:
    """Show channels, rates, spans, gaps and digests."""
    from replay import time
    from replay.log.describe import describe

    found = describe(log)
    packed = ", ".join(
        f"{name or 'not compressed'} {s.compressed_bytes / max(1, s.uncompressed_bytes):.0%}"
        for name, s in found.compression.items()
    )
    say(f"{found.path}: {found.file_bytes / 1e6:,.1f} MB, {packed}, by {found.library}")
    table = Table(
        Column("channel", no_wrap=True),
        *("message", "rows", "rate", "from (GPS time)", "span", "gaps", "sha256"),
    )
    for channel in found.channels:
        start, end = channel.valid_span_ns
        rows = channel.digest.message_count
        table.add_row(
            channel.topic,
            channel.schema,
            f"{rows:,}",
            f"{channel.rate_hz:.2f} Hz" if channel.median_interval_ns else "",
            time.to_text(start) if rows else "",
            f"{(end - start) / 1e9:,.2f} s" if rows else "",
            f"{len(channel.gaps_ns)}" if len(channel.gaps_ns) else "",
            channel.digest.sha256[:16],
        )
    out.print(table)
    for channel in found.channels:
        for start, end in channel.gaps_ns[:_SHOWN_GAPS]:
            say(f"gap: {channel.topic}, {time.to_text(int(start))}, {(end - start) / 1e9:.3f} s")
        if len(channel.gaps_ns) > _SHOWN_GAPS:
            say(f"     and {len(channel.gaps_ns) - _SHOWN_GAPS} more in {channel.topic}")
        if channel.backward:
            say(f"backward: {channel.topic}, {channel.backward} valid times")
        if channel.duplicates:
            say(f"duplicates: {channel.topic}, {channel.duplicates} rows")
        for field, count in channel.not_finite.items():
            say(f"not finite: {channel.topic}, {field}, {count} rows")
        if channel.undecodable:
            say(f"not decoded: {channel.topic}, {channel.undecodable}")
    say("metadata: " + (", ".join(sorted(found.metadata)) or "none"))
    for name, media_type, size in found.attachments:
        say(f"attachment: {name}, {media_type}, {size:,} bytes")
    for loss in found.report.losses:
        warn(f"damaged: {loss}")
    leave(found.report.exit_code)


@app.command()
def doctor(log: Annotated[Path, typer.Argument(help="Log to look at.")]) -> None:
    """Say what is damaged in a log and where."""
    from replay import time
    from replay.log.recover import diagnose

    found = diagnose(log)
    count = sum(found.message_counts.values())
    span = (
        f", {time.to_text(found.start_ns)} to {time.to_text(found.end_ns)} GPS time"
        if count
        else ""
    )
    say(f"{found.path}: {found.file_bytes:,} bytes, {count:,} readable messages{span}")
    for loss in found.report.losses:
        say(str(loss), lead="damaged: ", style="red")
    for note in found.notes:
        say(f"note: {note}")
    if found.report:
        say(f"mend: replay recover {log} -o RECOVERED.mcap")
    else:
        say("", lead="whole", style="green")
    leave(found.exit_code)


@app.command()
def recover(
    log: Annotated[Path, typer.Argument(help="Damaged log.")],
    output: Output,
) -> None:
    """Write what is whole of a damaged log to a new one."""
    from replay.log.reader import LogReader
    from replay.log.recover import recover as save

    report = save(log, output)
    with LogReader(output) as reader:
        count = sum(info.message_count for info in reader.channels.values())
    say(f"{output}: {count:,} messages came back")
    for loss in report.losses:
        warn(f"lost: {loss}")
    leave(report.exit_code)
