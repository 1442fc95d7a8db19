"""A picture of a recording without a display.

Rerun's viewer renders headless where a Vulkan driver is; without a graphics
card that is Mesa's software rasteriser. `--screenshot-to` takes the first frame,
before the viewer has fetched what its views show, so the viewer is asked for
pictures until two in a row are equal: nothing loads and no notice fades any more.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from rerun.experimental import ViewerClient

from replay.errors import ReplayError
from replay.time import to_datetime64
from replay.view.sink import TIMELINE

_DRIVERS: Final = "apt-get install -y --no-install-recommends mesa-vulkan-drivers libvulkan1"
_NO_GRAPHICS: Final = ("no graphics adapter", "vulkan", "wgpu")
_STOP_WAIT_S: Final = 5.0
_POLL_S: Final = 0.5
_TAIL_LINES: Final = 8


def render_png(
    rrd: Path,
    png: Path,
    *,
    width: int = 1600,
    height: int = 1000,
    at_ns: int | None = None,
    timeout_s: float = 120.0,
) -> None:
    """Open a recording as its blueprint says and save what is seen.

    Parameters
    ----------
    rrd : Path
    png : Path
        Replaced once the picture is whole.
    width, height : int, pixels
    at_ns : int or None, GPS ns
        Where the time cursor stands; None leaves it where the viewer puts it.
    timeout_s : float, s
        After this the viewer is stopped.

    Raises
    ------
    ReplayError
        Where there is no recording, no viewer, no graphics driver, or no steady picture in time.
    """
    if not rrd.is_file():
        raise ReplayError(
            "there is no such recording", where=str(rrd), mend="make it with `replay view`"
        )
    deadline = time.monotonic() + timeout_s
    with _viewer(rrd, width, height) as viewer:
        client = viewer.connect(deadline)
        viewer.wait_for_data(client, deadline)
        client.set_time(play_state="paused")  # else every picture differs from the one before
        if at_ns is not None:
            client.set_time(TIMELINE, timestamp=to_datetime64([at_ns])[0], play_state="paused")
        image = viewer.steady_image(client, deadline)
    part = png.with_name(png.name + ".part")
    part.write_bytes(image)
    os.replace(part, png)


class _Viewer:
    """A running viewer and what it has said."""

    def __init__(self, process: subprocess.Popen[bytes], port: int, said: Path, rrd: Path) -> None:
        self._process = process
        self._url = f"rerun+http://127.0.0.1:{port}/proxy"
        self._said = said
        self._rrd = rrd

    def connect(self, deadline: float) -> ViewerClient:
        """A client of the viewer, as soon as that answers."""
        while True:
            try:
                client = ViewerClient.connect(self._url)
                client.get_state()
            except (RuntimeError, OSError, ValueError):
                self._pause(deadline)
            else:
                return client

    def wait_for_data(self, client: ViewerClient, deadline: float) -> None:
        """Return when the recording is open and nothing is loading."""
        while True:
            state = client.get_state()
            if state.active_recording and not state.loading:
                return
            self._pause(deadline)

    def steady_image(self, client: ViewerClient, deadline: float) -> bytes:
        """A PNG that is equal to the one before it."""
        before = client.take_screenshot()
        while True:
            self._pause(deadline)
            image = client.take_screenshot()
            if image and image == before:
                return image
            before = image

    def _pause(self, deadline: float) -> None:
        if self._process.poll() is not None:
            raise self._failure("the viewer ended without a picture")
        if time.monotonic() > deadline:
            raise self._failure("the viewer gave no steady picture in time")
        time.sleep(_POLL_S)

    def _failure(self, what: str) -> ReplayError:
        said = self._said.read_text(errors="replace")
        tail = " | ".join(said.splitlines()[-_TAIL_LINES:])
        bare = any(word in said.lower() for word in _NO_GRAPHICS) and "llvmpipe" not in said
        mend = _DRIVERS if bare else "open it with `rerun`, or give a longer timeout"
        return ReplayError(f"{what}: {tail}", where=str(self._rrd), mend=mend)


@contextmanager
def _viewer(rrd: Path, width: int, height: int) -> Iterator[_Viewer]:
    """A headless viewer in a process group of its own; all of it is gone at the end."""
    program = Path(sys.executable).parent / "rerun"
    if not program.is_file():
        raise ReplayError(
            "the Rerun viewer is not installed", where=str(program), mend="pip install rerun-sdk"
        )
    port = _free_port()
    command = [
        str(program), str(rrd.resolve()), "--headless", "--bind", "127.0.0.1",
        "--port", str(port), "--window-size", f"{width}x{height}",
    ]  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="replay-picture-") as folder:
        said = Path(folder) / "said.txt"
        with said.open("wb") as stream:
            process = subprocess.Popen(
                command,
                stdout=stream,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                env={**os.environ, "NO_COLOR": "1"},
            )
        try:
            yield _Viewer(process, port, said, rrd)
        finally:
            _stop(process)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _stop(process: subprocess.Popen[bytes]) -> None:
    """End the whole group: the viewer is a child of a small launcher."""
    for gravity in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, gravity)
        except ProcessLookupError:
            break
        try:
            process.wait(timeout=_STOP_WAIT_S)
        except subprocess.TimeoutExpired:
            continue
    process.wait()
